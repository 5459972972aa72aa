"""Functional mock-up units: solvers for co-simulation in simulators that import FMI 2.0 or 3.0."""
