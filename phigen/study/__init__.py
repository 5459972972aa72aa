"""Studies of runs: errors, orders, invariants, exponents, classical methods to compare with."""
