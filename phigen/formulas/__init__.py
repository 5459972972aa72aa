"""Formulas for reading: in text, LaTeX and MathML."""
