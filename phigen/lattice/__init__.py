"""Lattices: systems of many identical sites. One site describes a lattice of any size: fields, brackets, energies,
step.
"""
