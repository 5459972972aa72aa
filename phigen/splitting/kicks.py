"""Which of two parts kicks: H = T + V of Runge–Kutta–Nyström type, {V, {V, {V, T}}} = 0.

T is then like a kinetic energy, quadratic in what V moves, on whatever Poisson structure: p²/2 beside a potential V(q),
a quadratic form of the momenta beside a function of γ on se(3)*. All terms of the Lie algebra that T and V generate
that hold too many V vanish, and a method has fewer order conditions to meet. In addition V commutes with {V, {V, T}},
and V + κ{V, {V, T}} may have an elementary flow of its own: a kick with modified potential.

The bracket is {f, g} = ∇f·π∇g. Of an even number of changes of its sign nothing is seen here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from phigen.geometry.system import System
from phigen.splitting.flow import Flow, NoFlowError, Term, flow_of
from phigen.splitting.parts import Splitting
from phigen.splitting.ring import KICK, Ring, ring_of
from phigen.splitting.terms import hamiltonian_terms
from phigen.symbolic.expression import symbol
from phigen.symbolic.tower import Poly

#: Largest {V, {V, T}}, in monomials, that a kick is modified by, and of which it is asked whether it commutes with V.
#: Where there are roots, questions of zero take far longer.
MOST_MONOMIALS, MOST_WITH_ROOTS = 200, 40


@dataclass(frozen=True)
class Kick:
    """Part ``part`` is V; ``modified`` is the flow of V + κ{V, {V, T}} with κ = `KICK`, if there is one."""

    part: int
    modified: Flow | None


def kicks(system: System, splitting: Splitting) -> tuple[Kick, ...]:
    """The parts that can be V, proved; none unless there are two parts."""
    if len(splitting.flows) != 2:
        return ()
    ring = ring_of(system, hamiltonian_terms(system), [KICK])
    elements = [ring.tower.convert(flow.hamiltonian) for flow in splitting.flows]
    proved = [part for part in (0, 1) if _graded(ring, elements[part], elements[1 - part])]
    most = MOST_WITH_ROOTS if any(g.kind == "root" for g in ring.tower.generators) else MOST_MONOMIALS
    found = []
    for part in proved or (0, 1):
        v, t = elements[part], elements[1 - part]
        gradient = _bracket(ring, v, _bracket(ring, v, t))
        small = len(gradient.to_dict()) <= most
        if proved or (small and ring.commute(v, gradient)):
            found.append(Kick(part, _modified(ring, splitting.flows[part], v, gradient) if small else None))
    return tuple(found)


def _graded(ring: Ring, v: Poly, t: Poly) -> bool:
    """Whether the condition follows from degrees, as it does for kinetic energies: this costs nothing, brackets may.

    Let V be a function of coordinates Q that commute, and all brackets of Q with the others, P, be functions of Q too.
    If brackets within P are linear in P, then {·, ·} lowers degrees in P by one; V has degree 0, and T at most 2.
    """
    inside = set(ring.support(v))
    everything = range(len(ring.coordinates))
    while True:
        more = {k for i in inside for j in everything for k in ring.support(ring.poisson[i][j])} - inside
        if not more:
            break
        inside |= more
    outside = [i for i in everything if i not in inside]
    return (
        all((i, j) in ring.zero_pairs for i in inside for j in inside)
        and all(degree(ring, ring.poisson[i][j], outside) <= 1 for i in outside for j in outside)
        and degree(ring, t, outside) <= 2
    )


def degree(ring: Ring, element: Poly, coordinates: Sequence[int]) -> float:
    """The degree of an element in some coordinates; infinite if it is no polynomial in them."""
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
    """{f, g}, not simplified: whether it vanishes may be a long question."""
    field = ring.field(g)
    slopes = {j: ring.tower.derivative(f, ring.coordinates[j]) for j in ring.support(f)}
    return ring.tower.combine(field[j] * slope for j, slope in slopes.items())


def _modified(ring: Ring, plain: Flow, v: Poly, gradient: Poly) -> Flow | None:
    """The flow of V + κ{V, {V, T}}."""
    if ring.tower.is_zero(gradient):
        return None
    gradient = ring.lowest(gradient)
    multiple = gradient * ring.tower.variable(KICK)
    terms = [Term(plain.hamiltonian, v), Term(symbol(KICK) * ring.expression(gradient), multiple)]
    try:
        return flow_of(ring, terms, numeric=False)
    except NoFlowError:
        return None
