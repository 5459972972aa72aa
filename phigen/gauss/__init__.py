"""Gauss collocation: its coefficients, and the algebras by which its step becomes an exact Poisson map."""
