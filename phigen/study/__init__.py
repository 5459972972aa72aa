"""Studies of runs: errors, orders, invariants, Lyapunov exponents, and comparisons with classical methods."""
