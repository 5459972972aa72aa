"""Proofs about one spec, and compilation on condition of these proofs."""
