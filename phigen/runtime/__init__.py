"""Compiling, loading and running generated solvers."""
