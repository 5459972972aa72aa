"""The NumPy target: one module, NumPy only, vectorised over leading axes."""
