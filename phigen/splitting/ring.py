"""The ring for the division of a Hamiltonian into parts: H, π and all their derivatives as polynomials.

A *variable* of the ring is a coordinate, a parameter, the time t, or a function value such as cos(q) or 1/r. Variables
that do not depend on coordinates are *static*. Along the flow of a part G, a variable v that depends on coordinates is
*frozen* if its derivative Σ_j (π∇G)_j ∂_j v vanishes; otherwise it is *moving*.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import mul, sub
from typing import Any

from phigen.geometry.shapes import Matrix
from phigen.geometry.system import System
from phigen.symbolic.expression import Expression, number, symbol
from phigen.symbolic.horner import horner
from phigen.symbolic.symbols import STEP, Symbol
from phigen.symbolic.tower import Poly, Tower, rational

#: Symbol of the duration of a flow; it is the symbol of the step size in the solver.
TIME = STEP

#: Symbol of κ in a kick with modified potential, V + κ{V, {V, T}}; see `phigen.splitting.kicks`.
KICK = Symbol("κ")

#: A monomial: the exponents of all variables of the ring.
Monomial = tuple[int, ...]


@dataclass(frozen=True)
class Ring:
    """A polynomial ring that contains the functions of a system and their derivatives, with the Poisson
    bracket.

    ``tower`` is the ring itself. ``poisson`` has the entries of π as polynomials of the ring, ``brackets`` has them as
    expressions.
    """

    tower: Tower
    coordinates: tuple[str, ...]
    poisson: tuple[tuple[Poly, ...], ...]
    brackets: Matrix
    #: Symbols that are constant along all flows but change from step to step: the time, and on lattices the values of
    #: neighbours.
    still: tuple[str, ...] = ()

    @cached_property
    def state(self) -> tuple[int, ...]:
        """The indices of the variables of the ring that depend on coordinates."""
        tower = self.tower
        return tuple(i for i, g in enumerate(tower.gens[: len(tower.names)]) if tower.depends_on(g, self.coordinates))

    @cached_property
    def changing(self) -> tuple[int, ...]:
        """The indices of the variables of the ring that change during a run, so that they are not known before the
        steps."""
        tower, names = self.tower, [*self.coordinates, *self.still]
        return tuple(i for i, g in enumerate(tower.gens[: len(tower.names)]) if tower.depends_on(g, names))

    @cached_property
    def values(self) -> list[Expression]:
        """The expressions for which the variables of the ring stand."""
        return [symbol(n) for n in self.tower.symbols] + [g.expression for g in self.tower.generators]

    @cached_property
    def zero_pairs(self) -> frozenset[tuple[int, int]]:
        """The pairs (i, j) of coordinates with {x_i, x_j} = 0."""
        n = len(self.coordinates)
        return frozenset((i, j) for i in range(n) for j in range(n) if self.tower.is_zero(self.poisson[i][j]))

    @cached_property
    def brackets_of(self) -> list[list[int]]:
        """For each coordinate, the indices of the coordinates with which it has a nonzero bracket."""
        n = range(len(self.coordinates))
        return [[j for j in n if (i, j) not in self.zero_pairs] for i in n]

    def support(self, element: Poly) -> tuple[int, ...]:
        """Return the indices of the coordinates that an element depends on, directly or inside a function."""
        names = self.tower.names_in(element)
        return tuple(i for i, c in enumerate(self.coordinates) if c in names)

    def field(self, g: Poly) -> list[Poly]:
        """Return the vector field π∇g of a function g in the ring."""
        sums: dict[int, list[Poly]] = {}
        for i in self.support(g):
            slope = self.tower.derivative(g, self.coordinates[i])
            for j in self.brackets_of[i]:
                sums.setdefault(j, []).append(self.poisson[j][i] * slope)
        zero = self.tower.zero
        return [self.lowest(self.tower.combine(sums[j])) if j in sums else zero for j in range(len(self.poisson))]

    def lowest(self, element: Poly) -> Poly:
        """Return the element after products q·(1/q) have been replaced by 1.

        This is done in each term that contains the variable 1/q, if q divides the coefficient of this variable.
        """
        for g in self.tower.generators:
            if g.kind != "reciprocal" or element == 0:
                continue
            reciprocal, q = self.tower.names.index(g.name), g.arguments[0]
            if element.degrees()[reciprocal] == 0:
                continue
            pending, final = [element], []
            while pending:
                powers = self.terms(pending.pop(), [reciprocal])
                for monomial, coefficient in powers.items():
                    quotient, remainder = divmod(coefficient, q) if monomial[reciprocal] else (coefficient, 1)
                    lower = (*monomial[:reciprocal], max(monomial[reciprocal] - 1, 0), *monomial[reciprocal + 1 :])
                    if remainder == 0:
                        pending.append(quotient * self.monomial(lower))
                    else:
                        final.append(coefficient * self.monomial(monomial))
            element = self.tower.combine(final)
        return element

    def rate(self, element: Poly, field: Sequence[Poly]) -> Poly:
        """Return the derivative of an element along a vector field.

        The result is literally 0 if the derivative vanishes by a relation between variables, such as sin² + cos² = 1.
        """
        derivative = self.tower.combine(
            field[j] * self.tower.derivative(element, self.coordinates[j])
            for j in self.support(element)
            if field[j] != 0
        )
        return self.tower.zero if self.tower.is_zero(derivative) else self.lowest(derivative)

    def commute(self, f: Poly, g: Poly) -> bool:
        """Whether {f, g} = 0 is proved."""
        if all((i, j) in self.zero_pairs for i in self.support(f) for j in self.support(g)):
            return True
        return bool(self.rate(f, self.field(g)) == 0)

    def terms(self, element: Poly, variables: Collection[int]) -> dict[Monomial, Poly]:
        """Return an element as a polynomial in some ``variables``, given by index: exponents → coefficient.

        The coefficients are polynomials in all other variables.
        """
        groups: dict[Monomial, dict[Monomial, Any]] = {}
        chosen_variables = frozenset(variables)
        mask = [int(i in chosen_variables) for i in range(len(self.tower.gens))]
        for m, c in element.to_dict().items():
            exponents = tuple(map(int, m))
            key = tuple(map(mul, exponents, mask))
            other_exponents = tuple(map(sub, exponents, key))
            groups.setdefault(key, {})[other_exponents] = c
        return {m: self.tower.context.from_dict(part) for m, part in groups.items()}

    def monomial(self, exponents: Monomial) -> Poly:
        """Return the product of powers of the variables of the ring with the given exponents."""
        return self.tower.context.from_dict({exponents: 1})

    def expression(self, element: Poly) -> Expression:
        """Return the element as an expression, in which factors that do not depend on the state are collected.

        These factors are then computed before the steps.
        """
        names = len(self.tower.names)
        state = set(self.state)
        static = [i for i in range(names) if i not in state]
        groups: dict[Monomial, dict[Monomial, Expression]] = {}
        for m, c in element.to_dict().items():
            key = tuple(int(m[i]) for i in self.state)
            groups.setdefault(key, {})[tuple(int(m[i]) for i in static)] = number(rational(c))
        static_values = [self.values[i] for i in static]
        collected = {key: horner(part, static_values) for key, part in sorted(groups.items())}
        return horner(collected, [self.values[i] for i in self.state])


def ring_of(system: System, further: Iterable[Expression] = (), symbols: Sequence[str] = ()) -> Ring:
    """Return the ring that contains H, π and the functions ``further`` of a system.

    The time and the ``symbols`` are additional variables of the ring, which do not depend on the state.
    """
    further_expressions = list(further)
    roots = [system.hamiltonian, *further_expressions, *(e for row in system.poisson for e in row)]
    tower = Tower([*system.coordinates, *system.parameter_names, *symbols, TIME], roots, system.coordinates)
    images = tower.convert_all(roots)
    n, start = system.dimension, 1 + len(further_expressions)
    poisson = tuple(tuple(images[start + i * n : start + (i + 1) * n]) for i in range(n))
    return Ring(tower, system.coordinates, poisson, system.poisson, (*system.times, *system.standing))
