"""Geometry of systems: Poisson tensors, brackets, Casimirs and Lie algebras."""
