"""Generating functions of the steps: the Hamilton–Jacobi series of H, and the modified Hamiltonian of a method."""
