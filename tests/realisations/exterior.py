"""Differential forms on T*U whose coefficients are expressions: an independent check of
`phigen.realisations.cotangent`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from phigen.geometry.shapes import coordinate_terms
from phigen.symbolic.expression import ZERO, Expression, derivatives, number, substitute, symbol, total
from phigen.symbolic.symbols import Symbol
from phigen.symbolic.verdict import PROVED, decide_zero

#: 2-form in the variables z: each pair (a, b) with a < b is mapped to the coefficient of dz_a ∧ dz_b.
Form = dict[tuple[int, int], Expression]
TIME = Symbol("s")


def canonical(n: int) -> Form:
    """Return ω = Σ dx_i ∧ dp_i in the variables z = (x, p)."""
    return {(i, n + i): number(1) for i in range(n)}


def wedge(left: Sequence[Expression], right: Sequence[Expression]) -> Form:
    """Return λ ∧ μ of two 1-forms that are given by their components."""
    n = range(len(left))
    return {(a, b): left[a] * right[b] - left[b] * right[a] for a in n for b in n if a < b}


def combine(*parts: tuple[Fraction | int, Form]) -> Form:
    """Return the linear combination of forms for pairs of a coefficient and a form."""
    keys = sorted({key for _, form in parts for key in form})
    return {key: total(number(Fraction(c)) * form[key] for c, form in parts if key in form) for key in keys}


def pull_back(form: Form, images: Sequence[Expression], names: Sequence[str]) -> Form:
    """Return the pull-back φ*(Σ w_ab dz_a ∧ dz_b) of a 2-form by the map φ with z∘φ = images."""
    columns = [derivatives(images, name) for name in names]
    d = [[column[a] for column in columns] for a in range(len(images))]
    moved = substitute(list(form.values()), dict(zip(names, images, strict=True)))
    parts: list[tuple[int, Form]] = []
    for (a, b), w in zip(form, moved, strict=True):
        parts.append((1, {key: w * c for key, c in wedge(d[a], d[b]).items()}))
    return combine(*parts)


def differential(f: Expression, names: Sequence[str]) -> list[Expression]:
    """Return the components of df in the variables ``names``."""
    return [derivatives([f], name)[0] for name in names]


def integrated(e: Expression, start: Fraction | int, end: Fraction | int) -> Expression:
    """Return the integral over s from ``start`` to ``end`` of an expression that is a polynomial in s, the symbol
    `TIME`.
    """
    terms = coordinate_terms([TIME], [e])
    assert terms is not None
    limits = [Fraction(start), Fraction(end)]
    return total(
        c * number((limits[1] ** (k + 1) - limits[0] ** (k + 1)) / Fraction(k + 1)) for (k,), c in terms[0].items()
    )


def equal(left: Form, right: Form) -> bool:
    """Whether two forms are proved to agree."""
    return decide_zero("", [("", left.get(k, ZERO) - right.get(k, ZERO)) for k in {**left, **right}]).verdict == PROVED


def same(left: Sequence[Expression], right: Sequence[Expression]) -> bool:
    """Whether two lists of expressions are proved to agree."""
    return decide_zero("", [("", a - b) for a, b in zip(left, right, strict=True)]).verdict == PROVED


def is_flow(images: Sequence[Expression], field: Sequence[Expression], names: Sequence[str]) -> bool:
    """Whether ``images``, expressions in z and s = `TIME`, are the flow Φ of the vector field X: Φ is z at s = 0, and
    dΦ/ds = X∘Φ.
    """
    start = substitute(images, {TIME: ZERO})
    along = substitute(field, dict(zip(names, images, strict=True)))
    return same(start, [symbol(name) for name in names]) and same(derivatives(images, TIME), along)


def at_time(images: Sequence[Expression], time: Fraction | int) -> list[Expression]:
    """Return the flow ``images`` at a fixed time, in which `TIME` no longer occurs."""
    return substitute(images, {TIME: number(Fraction(time))})


def after(outer: Sequence[Expression], inner: Sequence[Expression], names: Sequence[str]) -> list[Expression]:
    """Return the composition outer ∘ inner of two maps of the variables ``names``."""
    return substitute(outer, dict(zip(names, inner, strict=True)))


def parts_in_p(e: Expression, covector: Sequence[str]) -> Mapping[int, Expression]:
    """Return the homogeneous parts in p of a polynomial in p, by their degree."""
    return dict(_by_degree(e, covector))


def _by_degree(e: Expression, covector: Sequence[str]) -> Iterator[tuple[int, Expression]]:
    terms = coordinate_terms(covector, [e])
    assert terms is not None
    for degree in sorted({sum(m) for m in terms[0]}):
        yield (
            degree,
            total(
                c * total([number(1)] if not any(m) else [_monomial(m, covector)])
                for m, c in terms[0].items()
                if sum(m) == degree
            ),
        )


def _monomial(exponents: Sequence[int], names: Sequence[str]) -> Expression:
    result = number(1)
    for name, k in zip(names, exponents, strict=True):
        result = result * symbol(name) ** k if k else result
    return result
