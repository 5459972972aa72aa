"""Sweeps: ensembles of any size, computed in chunks by processes on one or several machines."""
