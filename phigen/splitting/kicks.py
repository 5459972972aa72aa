"""Kick parts: parts V of H = T + V with {V, {V, {V, T}}} = 0, for methods of Runge–Kutta–Nyström type.

The condition holds if T is like a kinetic energy: quadratic in the coordinates that the flow of V changes. Brackets
need not be canonical. A canonical example is T = p²/2 with a potential V(q). An example on se(3)* is a quadratic form T
of the angular momenta with a function V of the direction of gravity. By the condition, many repeated brackets of T and
V vanish, so a method has fewer order conditions. V also commutes with {V, {V, T}}. So V + κ{V, {V, T}} with a number κ
may have an elementary flow as well: a kick with modified potential.

The bracket is {f, g} = ∇f·π∇g. With the opposite sign, {V, {V, T}} is the same, since it contains two brackets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.flow import Flow, NoFlowError, Term, flow_of
from phigen.splitting.parts import SplitHamiltonian
from phigen.splitting.ring import KICK, TIME, Ring, ring_of
from phigen.splitting.statements import bracket
from phigen.splitting.terms import hamiltonian_terms
from phigen.symbolic.expression import gradient, symbol, symbols_of
from phigen.symbolic.tower import Poly

#: Largest number of monomials of {V, {V, T}}. With more monomials, phigen does not test by brackets whether V commutes
#: with {V, {V, T}}, and makes no modified kick. The second number is for expressions with roots: there, tests for zero
#: take much longer.
MOST_MONOMIALS, MOST_WITH_ROOTS = 200, 40


@dataclass(frozen=True)
class Kick:
    """A part of H that can be V in H = T + V; ``part`` is its index.

    ``modified`` is the flow of V + κ{V, {V, T}}, where κ is the symbol `KICK`; None if there is no such flow.
    """

    part: int
    modified: Flow | None


def kicks(system: System, splitting: SplitHamiltonian) -> tuple[Kick, ...]:
    """Return the parts V of H = T + V for which {V, {V, {V, T}}} = 0 is proved.

    If the number of parts of H is not 2, the result is ().
    """
    if len(splitting.flows) != 2:
        return ()
    ring = ring_of(system, hamiltonian_terms(system), [KICK])
    elements = [ring.tower.convert(flow.hamiltonian) for flow in splitting.flows]
    proved = [part for part in (0, 1) if _graded(ring, elements[part], elements[1 - part])]
    limit = MOST_WITH_ROOTS if any(g.kind == "root" for g in ring.tower.generators) else MOST_MONOMIALS
    kick_parts = []
    for part in proved or (0, 1):
        v, t = elements[part], elements[1 - part]
        gradient = _bracket(ring, v, _bracket(ring, v, t))
        is_small = len(gradient.to_dict()) <= limit
        if proved or (is_small and ring.commute(v, gradient)):
            kick_parts.append(Kick(part, _modified(ring, splitting.flows[part], v, gradient) if is_small else None))
    return tuple(kick_parts)


def modified_kick(system: System, kick: Flow, other: Flow) -> Flow | None:
    """Return the flow of V + κ{V, {V, T}} if V and {V, {V, T}} are functions of commuting coordinates, else None.

    V is the Hamiltonian of ``kick``, T that of ``other``, and κ is the symbol `KICK`. Unlike `kicks`, this function
    does not expand {V, {V, T}}, which has too many monomials for nine bodies.
    """
    v = kick.hamiltonian
    modified_potential = v + symbol(KICK) * bracket(system, v, bracket(system, v, other.hamiltonian))
    kicked_indices = [i for i, c in enumerate(system.coordinates) if c in symbols_of(modified_potential)]
    if kick.force or not all(system.poisson[i][j].is_zero for i in kicked_indices for j in kicked_indices):
        return None
    slope = gradient(symbol(TIME) * modified_potential, system.coordinates)
    return Flow(modified_potential, tuple(hamiltonian_vector_field(system.poisson, slope)), kick.manner)


def _graded(ring: Ring, v: Poly, t: Poly) -> bool:
    """Whether {V, {V, {V, T}}} = 0 follows from degrees, as for kinetic energies. This test is faster than computing
    brackets.

    Let V be a function of commuting coordinates Q, and let P be all other coordinates. The condition follows from three
    statements: brackets of Q and P are functions of Q, brackets within P are at most linear in P, and T has at most
    degree 2 in P. Then each bracket with V lowers the degree in P by one, so the third bracket is 0.
    """
    potential_coordinates = set(ring.support(v))
    everything = range(len(ring.coordinates))
    while True:
        bracket_support = {
            k for i in potential_coordinates for j in everything for k in ring.support(ring.poisson[i][j])
        } - potential_coordinates
        if not bracket_support:
            break
        potential_coordinates |= bracket_support
    other_coordinates = [i for i in everything if i not in potential_coordinates]
    return (
        all((i, j) in ring.zero_pairs for i in potential_coordinates for j in potential_coordinates)
        and all(
            degree(ring, ring.poisson[i][j], other_coordinates) <= 1
            for i in other_coordinates
            for j in other_coordinates
        )
        and degree(ring, t, other_coordinates) <= 2
    )


def degree(ring: Ring, element: Poly, coordinates: Sequence[int]) -> float:
    """Return the degree of an element of the ring in some coordinates, given by index.

    The degree is infinity if the element is no polynomial in these coordinates.
    """
    names = [ring.coordinates[i] for i in coordinates]
    highest = 0.0
    for exponents in element.to_dict():
        of_this = 0.0
        for variable, exponent in enumerate(exponents):
            if exponent and ring.tower.depends_on(ring.tower.gens[variable], names):
                of_this += int(exponent) if ring.tower.names[variable] in names else math.inf
        highest = max(highest, of_this)
    return highest


def _bracket(ring: Ring, f: Poly, g: Poly) -> Poly:
    """Return {f, g} = ∇f·π∇g. The bracket is not tested for being 0, since this test may be slow."""
    field = ring.field(g)
    slopes = {j: ring.tower.derivative(f, ring.coordinates[j]) for j in ring.support(f)}
    return ring.tower.combine(field[j] * slope for j, slope in slopes.items())


def _modified(ring: Ring, plain: Flow, v: Poly, gradient: Poly) -> Flow | None:
    """Return the flow of V + κ{V, {V, T}} for H = T + V; None if it is not elementary, or if {V, {V, T}} = 0.

    ``plain`` is the flow of V, and ``gradient`` is {V, {V, T}}.
    """
    if ring.tower.is_zero(gradient):
        return None
    gradient = ring.lowest(gradient)
    multiple = gradient * ring.tower.variable(KICK)
    terms = [Term(plain.hamiltonian, v), Term(symbol(KICK) * ring.expression(gradient), multiple)]
    try:
        return flow_of(ring, terms, numeric=False)
    except NoFlowError:
        return None
