"""Formulas: the expression graph, the differential ring over it, and truncated power series."""
