"""What runs show: errors, orders, invariants, exponents, classical methods to compare with."""
