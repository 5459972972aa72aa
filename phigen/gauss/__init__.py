"""Gauss collocation: its coefficients, and the algebras through which it becomes an exact Poisson map."""
