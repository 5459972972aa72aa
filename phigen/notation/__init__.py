"""Formulas to read: in text, LaTeX and MathML."""
