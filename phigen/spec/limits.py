"""Limits on what a spec may contain, so that no file can hang or exhaust the compiler.

Exceeding a limit is a `LimitError`, which has its own exit code.
"""

from __future__ import annotations

from fractions import Fraction

from phigen.symbolic.budgets import PRODUCT_BYTES, PRODUCT_TERMS, TAYLOR_BYTES

__all__ = ["PRODUCT_BYTES", "PRODUCT_TERMS", "TAYLOR_BYTES", "number_is_bounded"]

#: Size of a spec file, in bytes.
FILE_BYTES = 512 * 1024
#: YAML nodes (scalars, sequences, mappings, keys) in a file.
YAML_NODES = 20_000
#: Nesting of YAML collections.
YAML_DEPTH = 32
#: Length of the text of one expression, in characters.
EXPRESSION_LENGTH = 10_000
#: Numbers, names, operators and calls in one expression.
EXPRESSION_NODES = 2_000
#: Nesting of parentheses, calls, signs and exponents in one expression.
EXPRESSION_DEPTH = 64
#: Numbers are smaller than this in absolute value, whether written or the result of folding constants.
NUMBER = 10**40
#: Denominators are smaller than this: room for a number of 40 decimals below 10^-40.
DENOMINATOR = 10**80
#: Absolute value of a literal exponent; ``x**n`` is emitted as products.
EXPONENT = 1_000
#: Offset of a neighbour along an axis of a lattice.
OFFSET = 8
#: Sites of a lattice.
SITES = 10**10
#: Bonds of a graph that stand in a spec; files may hold more.
BONDS = 5_000
#: Number of coordinates.
COORDINATES = 256
#: Entries of any other mapping or list of the user's.
ENTRIES = 1_000
#: Length of the name of a coordinate, parameter, definition, Casimir or run.
NAME_LENGTH = 63
#: Length of a one-line text, and of a text of many lines.
LINE_LENGTH = 500
TEXT_LENGTH = 20_000
#: Terms of the generating function, and the order of a method.
ORDER = 16
#: Correction terms of the modified Hamiltonian.
CORRECTIONS = 8
#: Operations of one kernel, gradient and Hessian of S_h foremost; about 5 MB of C and a minute of compilation.
OPERATIONS = 100_000
#: Terms of an S_i: the next would take minutes.
SERIES_TERMS = 50_000
#: Exponents of all monomials of a collected polynomial and of its derivatives: 80 MB, and some seconds.
CELLS = 8_000_000
#: Products of terms in the proof of a bi-realisation, by estimate: ten seconds. Beyond, it is checked at points.
PROOF_PRODUCTS = 20_000_000
#: Seeds of noise have 64 bits, members of an ensemble 32.
SEED, MEMBERS = 2**64 - 1, 2**32
#: Seed of a sweep: a word of the counter-based generator, with its sign bit left free.
SWEEP_SEED = 2**63 - 1
#: Sources of noise.
SOURCES = 64
#: Members of a sweep.
SWEPT = 10**11
#: Steps of a run.
STEPS = 10**12
#: Errors listed in one run; a file with more is rarely improved by the rest.
ERRORS = 100


def number_is_bounded(value: Fraction) -> bool:
    """Whether a constant keeps the limits."""
    return abs(value) < NUMBER and value.denominator < DENOMINATOR
