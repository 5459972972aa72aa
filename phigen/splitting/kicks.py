"""Which of two parts kicks: H = T + V of Runge–Kutta–Nyström type, {V, {V, {V, T}}} = 0.

T is then like a kinetic energy, quadratic in what V moves, on whatever Poisson structure: p²/2 beside a potential V(q),
a quadratic form of the momenta beside a function of γ on se(3)*. All terms of the Lie algebra that T and V generate
that hold too many V vanish, and a method has fewer order conditions to meet. In addition V commutes with {V, {V, T}},
and V + κ{V, {V, T}} may have an elementary flow of its own: a kick with modified potential.

The bracket is {f, g} = ∇f·π∇g. Of an even number of changes of its sign nothing is seen here.
"""

from __future__ import annotations

from dataclasses import dataclass

from phigen.geometry.system import System
from phigen.splitting.flow import Flow, NoFlowError, Term, flow_of
from phigen.splitting.parts import Splitting
from phigen.splitting.ring import KICK, Ring, ring_of
from phigen.splitting.terms import hamiltonian_terms
from phigen.symbolic.expression import symbol
from phigen.symbolic.tower import Poly

#: Largest {V, {V, T}}, in monomials, that a kick is modified by.
MOST_MONOMIALS = 400


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
    found = []
    for part in (0, 1):
        v, t = elements[part], elements[1 - part]
        gradient = _bracket(ring, v, _bracket(ring, v, t))
        if len(gradient.to_dict()) <= MOST_MONOMIALS and ring.commute(v, gradient):
            found.append(Kick(part, _modified(ring, splitting.flows[part], v, gradient)))
    return tuple(found)


def _bracket(ring: Ring, f: Poly, g: Poly) -> Poly:
    """{f, g}."""
    return ring.rate(f, ring.field(g))


def _modified(ring: Ring, plain: Flow, v: Poly, gradient: Poly) -> Flow | None:
    """The flow of V + κ{V, {V, T}}."""
    if gradient == 0:
        return None
    multiple = gradient * ring.tower.variable(KICK)
    terms = [Term(plain.hamiltonian, v), Term(symbol(KICK) * ring.expression(gradient), multiple)]
    try:
        return flow_of(ring, terms)
    except NoFlowError:
        return None
