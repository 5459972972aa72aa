"""Formulas for readers: in text, LaTeX and MathML."""
