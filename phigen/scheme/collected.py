"""Collected polynomials. Their variables depend on the state; their coefficients do not.

The coefficients are expressions in parameters and step size. The derivative of a variable such as sin(q) is a
polynomial in the variables too. So a coefficient of a gradient or a Hessian is a sum of coefficients of the function,
multiplied by integers and by coefficients of the derivatives of variables. ``prepare`` computes each coefficient once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import Expression, number, symbol
from phigen.symbolic.horner import Monomial, horner
from phigen.symbolic.tower import Poly, Tower, rational

Terms = Mapping[Monomial, Expression]


@dataclass(frozen=True)
class Collected:
    """A ring of collected polynomials. The ``variables`` depend on the state; the coefficients do not.

    ``slopes`` has the derivatives of the variables with respect to the coordinates.
    """

    variables: tuple[Expression, ...]
    slopes: tuple[tuple[Terms, ...], ...]  # slopes[v][j] = ∂variable_v / ∂x_j

    @cached_property
    def _moving(self) -> list[list[int]]:
        """For each coordinate, the indices of the variables that depend on this coordinate."""
        return [[v for v, row in enumerate(self.slopes) if row[j]] for j in range(len(self.slopes[0]))]

    def derivative(self, terms: Terms, j: int) -> Terms:
        """Return the derivative of a collected polynomial with respect to coordinate number j.

        The variables of the polynomial are functions of the coordinates, so the chain rule applies.
        """
        result: dict[Monomial, Expression] = {}
        moving = self._moving[j]
        for m, c in terms.items():
            for v in moving:
                if e := m[v]:
                    lowered = (*m[:v], e - 1, *m[v + 1 :])
                    for k, factor in self.slopes[v][j].items():
                        key = tuple(a + b for a, b in zip(lowered, k, strict=True))
                        term = e * c * factor
                        result[key] = result[key] + term if key in result else term
        return {m: c for m, c in result.items() if not c.is_zero}

    def cells(self, terms: Terms, j: int) -> int:
        """Return the number of exponents that `derivative` would write, as a measure of its computing time."""
        wide = [len(row[j]) for row in self.slopes]
        return sum(wide[v] for m in terms for v in self._moving[j] if m[v]) * len(self.variables)

    def expression(self, terms: Terms, coefficients: Coefficients) -> Expression:
        """Return a collected polynomial as an expression in nested Horner form; its coefficients are added to
        ``coefficients``."""
        return horner({m: coefficients.slot(c) for m, c in terms.items()}, self.variables)


def collect(
    tower: Tower, elements: Sequence[Poly], coordinates: Sequence[str], times: Sequence[str] = ()
) -> tuple[Collected, list[Terms]]:
    """Return a ring of collected polynomials, and the ``elements`` of a tower as polynomials of this ring.

    A tower is a polynomial ring over the rationals with function values as variables. In the returned ring, the
    variables depend on the state, and the coefficients do not. If H depends on the time, ``times`` has the symbols of
    the time. Each coefficient is then a polynomial in values such as sin(t). The coefficients of this polynomial depend
    only on parameters and the step size.
    """
    state, dated = _state(tower, coordinates), _state(tower, times)
    static = [i for i in range(len(tower.names)) if i not in state and i not in dated]
    dated = [i for i in dated if i not in state]
    values = [symbol(n) for n in tower.symbols] + [g.expression for g in tower.generators]

    def terms(element: Poly) -> Terms:
        groups: dict[Monomial, dict[Monomial, dict[Monomial, Expression]]] = {}
        for m, c in element.to_dict().items():
            key, when, static_powers = (tuple(int(m[i]) for i in among) for among in (state, dated, static))
            groups.setdefault(key, {}).setdefault(when, {})[static_powers] = number(rational(c))
        return {key: in_time(parts) for key, parts in sorted(groups.items())}

    def in_time(parts: Mapping[Monomial, Mapping[Monomial, Expression]]) -> Expression:
        by_power = {when: horner(part, [values[i] for i in static]) for when, part in sorted(parts.items())}
        return horner(by_power, [values[i] for i in dated]) if dated else next(iter(by_power.values()))

    slopes = tuple(tuple(terms(tower.derivative(tower.gens[i], c)) for c in coordinates) for i in state)
    return Collected(tuple(values[i] for i in state), slopes), [terms(e) for e in elements]


def cells(tower: Tower, elements: Sequence[Poly]) -> int:
    """Return the number of exponents that `collect` would write for some elements of a tower and their derivatives."""
    rules = sum(len(rule) for g in tower.generators for rule in g.derivative.values())
    return (sum(map(len, elements)) + rules) * len(tower.names)


def exceeds(tower: Tower, elements: Sequence[Poly], coordinates: Sequence[str], max_monomials: int) -> bool:
    """Whether the collected elements have more than ``max_monomials`` monomials in total.

    The test only counts monomials, and is much faster than `collect`.
    """
    state, count = _state(tower, coordinates), 0
    if sum(map(len, elements)) <= max_monomials:
        return False
    for element in elements:
        count += len({tuple(m[i] for i in state) for m in element.monoms()})
        if count > max_monomials:
            return True
    return False


def _state(tower: Tower, coordinates: Sequence[str]) -> list[int]:
    """Return the indices of the variables of a tower that depend on the coordinates."""
    return [i for i in range(len(tower.names)) if tower.depends_on(tower.gens[i], coordinates)]
