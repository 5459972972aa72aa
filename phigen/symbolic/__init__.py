"""Formulas: the expression graph, the differential ring of expressions, and truncated power series."""
