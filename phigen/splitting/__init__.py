"""Explicit steps: H as a sum of parts with elementary flows, and these flows."""
