"""Certificates of steps: rigorous bounds for the distance between computed steps and the exact Poisson map."""
