"""Limits on what a spec may contain, so that no file can hang or exhaust the compiler.

Exceeding a limit is a `LimitError`, which has its own exit code.
"""

from __future__ import annotations

from fractions import Fraction

from phigen.symbolic.budgets import PRODUCT_BYTES, PRODUCT_TERMS, TAYLOR_BYTES

__all__ = ["PRODUCT_BYTES", "PRODUCT_TERMS", "TAYLOR_BYTES", "number_is_bounded"]

#: Largest size of a spec file, in bytes.
FILE_BYTES = 512 * 1024
#: Largest number of YAML nodes in a file. Nodes are scalars (also keys), sequences and mappings.
YAML_NODES = 20_000
#: Largest nesting of YAML collections.
YAML_DEPTH = 32
#: Largest length of the text of one expression, in characters.
EXPRESSION_LENGTH = 10_000
#: Largest number of numbers, names, operators and calls in one expression.
EXPRESSION_NODES = 2_000
#: Largest nesting of parentheses, calls, signs and exponents in one expression.
EXPRESSION_DEPTH = 64
#: Numbers in a spec, and numbers that constant folding makes, are smaller than this in absolute value.
NUMBER = 10**40
#: Denominators of rationals are smaller than this. So a decimal may have up to 79 places after the point.
DENOMINATOR = 10**80
#: Largest absolute value of a literal exponent. The generated code computes ``x**n`` by products.
EXPONENT = 1_000
#: Largest offset of a neighbour along an axis of a lattice.
OFFSET = 8
#: Largest number of sites of a lattice.
SITES = 10**10
#: Largest number of bonds of a graph in a spec; files may contain more.
BONDS = 5_000
#: Largest number of coordinates.
COORDINATES = 256
#: Largest number of entries of a mapping or list for which no other limit is listed here.
ENTRIES = 1_000
#: Largest length of the name of a coordinate, parameter, definition, Casimir or run.
NAME_LENGTH = 63
#: Largest numbers of characters: LINE_LENGTH of a text of one line, TEXT_LENGTH of a text of several lines.
LINE_LENGTH = 500
TEXT_LENGTH = 20_000
#: Largest number of terms of the generating function, and largest order of a method.
ORDER = 16
#: Largest number of correction terms of the modified Hamiltonian.
CORRECTIONS = 8
#: Largest number of operations in one generated function. The gradient and the Hessian of the generating function have
#: the most operations. At the limit, the C has about 5 MB and compiles in about a minute.
OPERATIONS = 100_000
#: Largest number of monomials in a term S_i of the Hamilton–Jacobi series. After a term of this size, the next term
#: would take minutes to compute.
SERIES_TERMS = 50_000
#: Largest number of exponents that are stored when a polynomial and its derivatives are expanded; each monomial has one
#: exponent for each symbol. At the limit this takes 80 MB and some seconds.
CELLS = 8_000_000
#: If the proof of a bi-realisation is estimated to need more products of terms than this, the bi-realisation is checked
#: at sample points instead. At the limit, the proof takes ten seconds.
PROOF_PRODUCTS = 20_000_000
#: SEED: largest seed of noise; seeds have 64 bits. MEMBERS: largest number of members; their indices have 32 bits.
SEED, MEMBERS = 2**64 - 1, 2**32
#: Largest seed of a sweep. The random generator takes seeds of 64 bits, of which the sign bit must be 0.
SWEEP_SEED = 2**63 - 1
#: Largest number of sources of noise.
SOURCES = 64
#: Largest number of members of a sweep.
SWEPT = 10**11
#: Largest number of steps of a run.
STEPS = 10**12
#: Largest number of errors that are listed for one file. After this number, reading stops.
ERRORS = 100


def number_is_bounded(value: Fraction) -> bool:
    """Whether the absolute value and the denominator of a constant are below `NUMBER` and `DENOMINATOR`."""
    return abs(value) < NUMBER and value.denominator < DENOMINATOR
