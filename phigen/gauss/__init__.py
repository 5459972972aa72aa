"""Gauss collocation: its coefficients, and the algebras with which its step is exactly a Poisson map."""
