"""Linear first integrals of a flow, and the equations of motion in which these integrals are constants.

For example, the sum S = s_1 + s_2 of two spins is constant along the flow of s_1·s_2. With S as a constant, ṡ_1 = s_1 ×
s_2 becomes the linear equation ṡ_1 = s_1 × S.
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
    """Equations of motion after elimination of some coordinates x_i = I_i − L_i by linear first integrals I_i = x_i +
    L_i.

    ``ring`` has the symbols of the I_i in place of these coordinates. ``field`` is the vector field in this ring, with
    0 for the eliminated coordinates. ``forms`` maps the index of an eliminated coordinate to the linear form L_i in the
    other coordinates. ``integrals`` maps the symbol of I_i to x_i + L_i.
    """

    ring: Ring
    field: list[Poly]
    forms: Mapping[int, Expression]
    integrals: Mapping[str, Expression]


def reduced(ring: Ring, field: Sequence[Poly]) -> Reduced | None:
    """Return the equations of a vector field after elimination of coordinates by linear first integrals.

    The integrals have rational coefficients. Returns None if there are no such integrals.
    """
    moving = [i for i, f in enumerate(field) if f != 0]
    relations = kernel(Field(), _equations(field, moving), len(moving))
    if not relations:
        return None
    forms: dict[int, Expression] = {}
    integrals: dict[str, Expression] = {}
    # A relation has the coefficients c_k of a sum Σ c_k ẋ_k that is 0. Its last coefficient is 1, and the coordinate of
    # this coefficient occurs in no other relation.
    for relation in relations:
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
    """Return the linear equations for the c_k in Σ_k c_k field_k = 0, one row for each monomial of the field.

    ``moving`` has the indices of the components that are not 0. A row maps k to the coefficient of c_k, where k is a
    position in ``moving``.
    """
    rows: dict[tuple[int, ...], dict[int, object]] = {}
    for k, i in enumerate(moving):
        for monomial, c in field[i].to_dict().items():
            rows.setdefault(tuple(int(e) for e in monomial), {})[k] = c
    return list(rows.values())
