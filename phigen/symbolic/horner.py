"""From a sparse polynomial to an expression with few operations (greedy nested Horner form)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import sub

from phigen.symbolic.expression import ZERO, Expression, power, product, total

Monomial = tuple[int, ...]


def horner(terms: Mapping[Monomial, Expression], variables: Sequence[Expression]) -> Expression:
    """Σ coefficient · Π variables[i]**exponent[i], nested.

    At each level the power that divides most terms is factored out. Even polynomials come out as
    polynomials in the squares of the variables, since the least exponent of the terms that share a
    variable is factored, and squares are shared nodes. Deterministic in the terms.
    """
    left = {m: c for m, c in terms.items() if not c.is_zero}
    if not left:
        return ZERO
    used = [i for i in range(len(variables)) if any(m[i] for m in left)]
    if len(used) < len(variables):
        left = {tuple(m[i] for i in used): c for m, c in left.items()}
    return _nested(left, [variables[i] for i in used])


def _nested(left: Mapping[Monomial, Expression], variables: Sequence[Expression]) -> Expression:
    """`horner` of terms that are not 0."""
    if len(left) == 1:
        ((monomial, coefficient),) = left.items()
        return coefficient * _monomial(monomial, variables)
    common = tuple(map(min, zip(*left, strict=True)))
    if any(common):
        inner = {tuple(map(sub, m, common)): v for m, v in left.items()}
        return _monomial(common, variables) * _nested(inner, variables)
    counts = [len(left) - column.count(0) for column in zip(*left, strict=True)]
    best = counts.index(max(counts))
    if counts[best] <= 1:
        ordered = sorted(left.items(), key=lambda item: (sum(item[0]), tuple(-e for e in item[0])))
        return total(c * _monomial(m, variables) for m, c in ordered)
    step = min(m[best] for m in left if m[best])
    inside = {(*m[:best], m[best] - step, *m[best + 1 :]): c for m, c in left.items() if m[best]}
    outside = {m: c for m, c in left.items() if not m[best]}
    nested = power(variables[best], step) * horner(inside, variables)
    return nested + horner(outside, variables) if outside else nested


def _monomial(monomial: Monomial, variables: Sequence[Expression]) -> Expression:
    return product(power(v, e) for v, e in zip(variables, monomial, strict=True) if e)
