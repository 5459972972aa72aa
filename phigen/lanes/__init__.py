"""Choice of the kernels that a program evaluates at several points together, in SIMD lanes."""
