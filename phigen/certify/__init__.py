"""Certificates: rigorous bounds for the distance between a computed step and the exact Poisson map."""
