"""Proofs about one spec: its system, its method, and a second derivation of the method."""
