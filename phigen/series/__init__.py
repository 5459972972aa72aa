"""Generating functions: the Hamilton–Jacobi series of a Hamiltonian in a bi-realisation."""
