"""Budgets of the arithmetic of polynomials. `phigen.spec.limits` repeats them among all other limits."""

#: Largest number of terms of a product or a power of polynomials, and its largest memory in bytes. It takes tenths of a
#: second.
PRODUCT_TERMS, PRODUCT_BYTES = 1_000_000, 128 * 2**20
#: Largest memory of all products and sums of a series, in bytes.
TAYLOR_BYTES = 300 * 2**20
