"""The lowering to lanes: what of a program is computed at several points at once, for targets that do so."""
