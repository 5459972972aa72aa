"""Lattices in C, computed by loops over the sites of rows."""
