"""Budgets of the arithmetic of polynomials; `phigen.spec.limits` has these numbers beside all others."""

#: Terms of a product or a power of polynomials, and its memory in bytes: tenths of a second.
PRODUCT_TERMS, PRODUCT_BYTES = 1_000_000, 128 * 2**20
#: Memory of all products and sums of a series, in bytes.
TAYLOR_BYTES = 300 * 2**20
