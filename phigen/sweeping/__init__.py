"""Sweeps: ensembles of any size, chunk by chunk, on the processes of one machine or of many."""
