"""Splitting of H into parts with elementary flows, for explicit steps: the parts and their flows."""
