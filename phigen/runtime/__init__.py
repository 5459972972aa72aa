"""Compilation and loading of generated solvers, and the classes with which users run them."""
