"""Certificates of steps: rigorous bounds for the distance of computed steps from the exact Poisson map."""
