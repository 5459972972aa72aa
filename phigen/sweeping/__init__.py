"""Sweeps: runs for many parameters and initial values, computed in chunks by processes on one or several machines."""
