"""Lattices: systems of many identical sites. The description of one site is enough for a lattice of any size."""
