"""Formulas of systems and methods for display, as text, LaTeX, MathML or sympy."""
