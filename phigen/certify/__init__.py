"""Certificates: proofs of an upper bound for the distance of a computed step, with rounding, from the exact Poisson
map."""
