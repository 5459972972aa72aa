"""Limits of memory for computations with polynomials. `phigen.spec.limits` lists them with all other limits."""

#: Largest number of terms, and largest memory in bytes, of a product or a power of polynomials. Computing a product of
#: this size takes some tenths of a second.
PRODUCT_TERMS, PRODUCT_BYTES = 1_000_000, 128 * 2**20
#: Largest memory, in bytes, of all products and sums that are stored while one power series is computed.
TAYLOR_BYTES = 300 * 2**20
