"""Sweeps: ensembles of any size, computed in chunks by processes on one machine or on many."""
