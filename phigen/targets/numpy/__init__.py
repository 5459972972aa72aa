"""The NumPy target: one module that needs only NumPy, with functions for arrays of any number of states."""
