"""Limits of memory for computations with polynomials. `phigen.spec.limits` lists them with all other limits."""

#: Largest number of terms of a product or a power of polynomials, and largest memory in bytes. At the limit, a product
#: takes some tenths of a second.
PRODUCT_TERMS, PRODUCT_BYTES = 1_000_000, 128 * 2**20
#: Largest memory, in bytes, of all products and sums that the computation of one power series stores.
TAYLOR_BYTES = 300 * 2**20
