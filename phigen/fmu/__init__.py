"""Functional mock-up units: solvers for simulators that import FMI 2.0 or 3.0, for co-simulation."""
