"""Search for polynomial Casimirs of a polynomial π, by exact linear algebra for their coefficients."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement
from math import comb

from phigen.geometry.field import Field, Scalar
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.linear import coprime_integers, kernel
from phigen.geometry.shapes import LiePoisson, Matrix, Shape, Terms, coordinate_terms
from phigen.symbolic.expression import Expression, number, symbol
from phigen.symbolic.horner import horner

#: Largest number of unknowns in the linear equations for the coefficients: the first number if π contains no
#: parameters, the second one if it contains some.
UNKNOWNS, UNKNOWNS_WITH_PARAMETERS = 800, 60

Exponents = tuple[int, ...]


def polynomial_casimirs(
    coordinates: Sequence[str], poisson: Matrix, shape: Shape, degree: int, notes: list[str]
) -> Iterator[Expression]:
    """Yield a basis of the polynomial Casimirs without constant terms, of degree 1, then 2, … up to ``degree``.

    If all terms of π have the same degree, the Casimirs are homogeneous. Otherwise a Casimir of degree d may contain
    terms of lower degree. If the linear equations for some degree are too large, the search ends, and a note is added
    to ``notes``.
    """
    n = len(coordinates)
    candidates = (
        _linear_terms(shape.algebra)
        if isinstance(shape, LiePoisson)
        else coordinate_terms(coordinates, [e for row in poisson for e in row])
    )
    if candidates is None:
        notes.append("polynomial Casimirs were not searched for: π is not polynomial in the coordinates")
        return
    field = Field(c for terms in candidates for c in terms.values())
    # The equations are Σ_j π_ij ∂_j C = 0, one for each row i.
    entries = [[_converted(field, candidates[i * n + j]) for j in range(n)] for i in range(n)]
    homogeneous = len({sum(e) for terms in candidates for e in terms}) <= 1
    largest = UNKNOWNS if field.is_rational else UNKNOWNS_WITH_PARAMETERS
    variables = [symbol(c) for c in coordinates]
    for d in range(1, degree + 1):
        size = comb(n + d - 1, d) if homogeneous else comb(n + d, d) - 1
        if size > largest:
            notes.append(f"polynomial Casimirs of degree {d} and more were not searched for: {size} unknowns")
            return
        monomials = [m for k in range(d if homogeneous else 1, d + 1) for m in _monomials(n, k)]
        for vector in kernel(field, _equations(entries, monomials), len(monomials)):
            if field.is_rational:
                terms = {monomials[i]: number(c) for i, c in coprime_integers(vector).items()}
            else:
                terms = {monomials[i]: field.expression(c) for i, c in vector.items()}
            yield horner(terms, variables)


def _linear_terms(algebra: LieAlgebra) -> list[Terms]:
    """Return the entries of a Lie–Poisson tensor as polynomials, row by row, from the structure constants.

    The result has the form of the result of `coordinate_terms`.
    """
    n = range(algebra.dimension)
    units = [tuple(int(k == m) for m in n) for k in n]
    return [{units[k]: c for k, c in sorted(algebra.bracket(i, j).items(), reverse=True)} for i in n for j in n]


def _converted(field: Field, terms: Terms) -> dict[Exponents, Scalar]:
    return {e: field.convert(c) for e, c in terms.items()}


def _monomials(n: int, degree: int) -> list[Exponents]:
    monomials = []
    for factors in combinations_with_replacement(range(n), degree):
        exponents = [0] * n
        for i in factors:
            exponents[i] += 1
        monomials.append(tuple(exponents))
    return monomials


def _equations(entries: list[list[dict[Exponents, Scalar]]], monomials: list[Exponents]) -> list[dict[int, Scalar]]:
    """Return the linear equations for the coefficients of the ``monomials`` in a Casimir C, as sparse rows.

    There is one equation for each component of π∇C and each monomial in this component.
    """
    rows: dict[tuple[int, Exponents], dict[int, Scalar]] = {}
    for column, monomial in enumerate(monomials):
        for j, exponent in enumerate(monomial):
            if not exponent:
                continue
            slope = (*monomial[:j], exponent - 1, *monomial[j + 1 :])
            for i, row in enumerate(entries):
                for e, c in row[j].items():
                    target = rows.setdefault((i, tuple(map(int.__add__, slope, e))), {})
                    value = c
                    for _ in range(exponent - 1):
                        value = value + c
                    target[column] = target[column] + value if column in target else value
    return [rows[key] for key in sorted(rows)]
