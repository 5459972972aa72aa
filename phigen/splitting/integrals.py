"""Linear first integrals of a part, and its equations with the integrals as constants.

The sum S = s_1 + s_2 of two spins is constant along the flow of s_1·s_2. With S as a constant, ṡ_1 = s_1 × s_2 becomes
the linear equation ṡ_1 = s_1 × S.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.geometry.field import Field
from phigen.geometry.linear import kernel
from phigen.splitting.ring import TIME, Ring
from phigen.symbolic.expression import Expression, number, substitute, symbol, total
from phigen.symbolic.symbols import Symbol
from phigen.symbolic.tower import Poly, Tower, rational


@dataclass(frozen=True)
class Reduced:
    """A ring in which some coordinates are eliminated: x_i = I − L_i, with an integral I, a symbol of the ring.

    ``forms`` has for each of these coordinates the linear form L_i in the others. ``field`` is the vector field in this
    ring, 0 for the eliminated coordinates. ``integrals`` maps the symbols of integrals to their expressions.
    """

    ring: Ring
    field: list[Poly]
    forms: Mapping[int, Expression]
    integrals: Mapping[str, Expression]


def reduced(ring: Ring, field: Sequence[Poly]) -> Reduced | None:
    """Return the equations after elimination of the coordinates that linear integrals with rational coefficients
    determine.

    None if there are no such integrals.
    """
    moving = [i for i, f in enumerate(field) if f != 0]
    relations = kernel(Field(), _equations(field, moving), len(moving))
    if not relations:
        return None
    forms: dict[int, Expression] = {}
    integrals: dict[str, Expression] = {}
    for relation in relations:  # a relation is 1 at its last coordinate, where all others are 0
        pivot = moving[max(relation)]
        other_terms = total(
            number(rational(c)) * symbol(ring.coordinates[moving[k]]) for k, c in relation.items() if moving[k] != pivot
        )
        name = Symbol("integral", ring.coordinates[pivot])
        integrals[name] = symbol(ring.coordinates[pivot]) + other_terms
        forms[pivot] = other_terms
    values = {ring.coordinates[i]: symbol(n) - e for (i, e), n in zip(forms.items(), integrals, strict=True)}
    expressions = substitute([ring.tower.expression(f) for f in field], values)
    symbols = [*(s for s in ring.tower.symbols if s != TIME), *integrals, TIME]
    tower = Tower(symbols, expressions, ring.tower.variables)
    images = tower.convert_all(expressions)
    smaller = replace(ring, tower=tower, poisson=())
    return Reduced(smaller, [tower.zero if i in forms else f for i, f in enumerate(images)], forms, integrals)


def _equations(field: Sequence[Poly], moving: Sequence[int]) -> list[dict[int, object]]:
    """Return one row for each monomial, for the equation Σ_k c_k field_k = 0."""
    rows: dict[tuple[int, ...], dict[int, object]] = {}
    for k, i in enumerate(moving):
        for monomial, c in field[i].to_dict().items():
            rows.setdefault(tuple(int(e) for e in monomial), {})[k] = c
    return list(rows.values())
