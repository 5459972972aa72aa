"""Limits on what a spec may contain, so that no file can hang or exhaust the compiler.

Exceeding a limit is a `LimitError`, which has its own exit code.
"""

from __future__ import annotations

from fractions import Fraction

from phigen.symbolic.budgets import PRODUCT_BYTES, PRODUCT_TERMS, TAYLOR_BYTES

__all__ = ["PRODUCT_BYTES", "PRODUCT_TERMS", "TAYLOR_BYTES", "number_is_bounded"]

#: Largest size of a spec file, in bytes.
FILE_BYTES = 512 * 1024
#: Largest number of YAML nodes (scalars, sequences, mappings, keys) in a file.
YAML_NODES = 20_000
#: Largest nesting of YAML collections.
YAML_DEPTH = 32
#: Largest length of the text of one expression, in characters.
EXPRESSION_LENGTH = 10_000
#: Largest number of numbers, names, operators and calls in one expression.
EXPRESSION_NODES = 2_000
#: Largest nesting of parentheses, calls, signs and exponents in one expression.
EXPRESSION_DEPTH = 64
#: Bound of the absolute value of numbers, both written ones and results of constant folding.
NUMBER = 10**40
#: Bound of denominators: a number of 40 decimals below 10^-40 has a smaller one.
DENOMINATOR = 10**80
#: Largest absolute value of a literal exponent; ``x**n`` is emitted as products.
EXPONENT = 1_000
#: Largest offset of a neighbour along an axis of a lattice.
OFFSET = 8
#: Largest number of sites of a lattice.
SITES = 10**10
#: Largest number of bonds of a graph in a spec; files may contain more.
BONDS = 5_000
#: Largest number of coordinates.
COORDINATES = 256
#: Largest number of entries of any other mapping or list of the user.
ENTRIES = 1_000
#: Largest length of the name of a coordinate, parameter, definition, Casimir or run.
NAME_LENGTH = 63
#: Largest lengths of a text of one line, and of a text of several lines.
LINE_LENGTH = 500
TEXT_LENGTH = 20_000
#: Largest number of terms of the generating function, and largest order of a method.
ORDER = 16
#: Largest number of correction terms of the modified Hamiltonian.
CORRECTIONS = 8
#: Largest number of operations of one kernel, mainly for gradient and Hessian of S_h: about 5 MB of C and a minute of
#: compilation.
OPERATIONS = 100_000
#: Largest number of terms of an S_i; the next S_i would take minutes.
SERIES_TERMS = 50_000
#: Largest number of exponents of all monomials of a collected polynomial and of its derivatives: 80 MB, and some
#: seconds.
CELLS = 8_000_000
#: Largest estimated number of products of terms in the proof of a bi-realisation: ten seconds. Larger ones are checked
#: at points.
PROOF_PRODUCTS = 20_000_000
#: Seeds of noise have 64 bits, members of an ensemble 32.
SEED, MEMBERS = 2**64 - 1, 2**32
#: Largest seed of a sweep: a word of the counter-based generator without its sign bit.
SWEEP_SEED = 2**63 - 1
#: Largest number of sources of noise.
SOURCES = 64
#: Largest number of members of a sweep.
SWEPT = 10**11
#: Largest number of steps of a run.
STEPS = 10**12
#: Largest number of errors listed for one file; more would hardly help.
ERRORS = 100


def number_is_bounded(value: Fraction) -> bool:
    """Whether a constant is within the limits of its size and its denominator."""
    return abs(value) < NUMBER and value.denominator < DENOMINATOR
