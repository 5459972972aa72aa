"""Benchmarks: phigen's solvers compared with the methods that people would otherwise use; see docs/benchmarks.md."""
