"""Figures of runs, comparisons, tunings and sweeps, drawn with matplotlib."""
