"""phigen's solvers beside the methods that people would otherwise use; see docs/benchmarks.md."""
