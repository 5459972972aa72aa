"""Lowering to SIMD lanes: the parts of a program that are evaluated at several points together."""
