"""Nested Horner form of sparse polynomials in several variables, chosen greedily for few operations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from phigen.symbolic.expression import ZERO, Expression, power, product, total

Monomial = tuple[int, ...]
#: A monomial as pairs (index of a variable, exponent). Only variables that occur in the monomial have a pair; in large
#: systems these are few.
Powers = tuple[tuple[int, int], ...]


def horner(terms: Mapping[Monomial, Expression], variables: Sequence[Expression]) -> Expression:
    """Return Σ coefficient · Π variables[i]**exponent[i] as a nested expression.

    ``terms`` maps the exponents of a monomial to its coefficient. At each level, the variable that occurs in the most
    terms is factored out of these terms, with its smallest exponent in them. A polynomial with even exponents becomes a
    polynomial in the squares of the variables, and each square is computed once. The result does not depend on the
    order of the terms.
    """
    return sparse_horner({_powers(m): c for m, c in terms.items()}, variables)


def sparse_horner(terms: Mapping[Powers, Expression], variables: Sequence[Expression]) -> Expression:
    """Return the same expression as `horner`; here each key of ``terms`` is a monomial of type `Powers`.

    In each monomial, the pairs (index of a variable, exponent) must be sorted by index.
    """
    left = {m: c for m, c in terms.items() if not c.is_zero}
    return _nested(left, variables) if left else ZERO


def _powers(monomial: Monomial) -> Powers:
    return tuple((i, e) for i, e in enumerate(monomial) if e)


def _nested(terms: Mapping[Powers, Expression], variables: Sequence[Expression]) -> Expression:
    """Return the result of `sparse_horner`. There is at least one term, and all coefficients are nonzero."""
    if len(terms) == 1:
        ((monomial, coefficient),) = terms.items()
        return coefficient * _monomial(monomial, variables)
    common = _common(terms)
    if common:
        inner = {tuple([(i, r) for i, e in m if (r := e - common.get(i, 0))]): c for m, c in terms.items()}
        return _monomial(tuple(common.items()), variables) * _nested(inner, variables)
    counts = Counter([i for m in terms for i, _ in m])
    best = min(counts, key=lambda i: (-counts[i], i))
    if counts[best] <= 1:
        ordered = sorted(terms.items(), key=lambda item: _graded(item[0]))
        return total(c * _monomial(m, variables) for m, c in ordered)
    places = {m: next((k for k, (i, _) in enumerate(m) if i == best), -1) for m in terms}
    step = min(m[k][1] for m, k in places.items() if k >= 0)
    with_variable = {
        m[:k] + ((best, m[k][1] - step),) * (m[k][1] > step) + m[k + 1 :]: terms[m] for m, k in places.items() if k >= 0
    }
    without_variable = {m: c for m, c in terms.items() if places[m] < 0}
    nested = power(variables[best], step) * _nested(with_variable, variables)
    return nested + _nested(without_variable, variables) if without_variable else nested


def _common(terms: Iterable[Powers]) -> dict[int, int]:
    """Return the greatest common divisor of monomials: the exponents by the index of the variable."""
    first, *remaining = terms
    common = dict(first)
    for m in remaining:
        exponents = dict(m)
        common = {i: min(e, exponents[i]) for i, e in common.items() if i in exponents}
        if not common:
            break
    return common


def _graded(monomial: Powers) -> tuple[int, list[tuple[int, int]]]:
    """Return a sort key for monomials: by total degree, then by the first variable whose exponents differ.

    The monomial with the larger exponent of this variable comes first.
    """
    return sum(e for _, e in monomial), [(i, -e) for i, e in monomial]


def _monomial(monomial: Powers, variables: Sequence[Expression]) -> Expression:
    return product(power(variables[i], e) for i, e in monomial)
