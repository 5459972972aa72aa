"""The lowering to lanes: the parts of a program that are evaluated at several points at once."""
