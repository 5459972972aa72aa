"""Poisson tensors, brackets, Casimirs and Lie algebras."""
