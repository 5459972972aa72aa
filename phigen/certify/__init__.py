"""Certificates: proofs that a computed step, with all rounding errors, is within a bound of the exact Poisson map."""
