"""Functional mock-up units (FMUs): solvers as files that simulators import through the standard FMI 2.0 or 3.0."""
