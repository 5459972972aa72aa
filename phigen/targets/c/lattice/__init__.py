"""Lattices in C: loops over the sites of rows."""
