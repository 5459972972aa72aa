"""Splittings for attracting bodies in relative coordinates: Kepler motions A, and a small remainder B.

H is Σ p_i²/2m_i − Σ k_ij/|q_i − q_j| plus further terms. Further terms that do not contain coordinates of the bodies,
such as the free rotation of one of them, belong to A; all other further terms belong to B.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.conflicts import Conflicts
from phigen.splitting.exponential import SHIFTED
from phigen.splitting.flow import Flow, NoFlowError, Term, composed, flow_of
from phigen.splitting.near_integrable import conjugate, is_inverse_distance
from phigen.splitting.parts import SplitHamiltonian
from phigen.splitting.relative import CHANGES, AttractingBodies
from phigen.splitting.ring import TIME, Monomial, Ring, ring_of
from phigen.splitting.statements import bracket
from phigen.splitting.terms import hamiltonian_terms
from phigen.symbolic.expression import Expression, gradient, power, symbol, total
from phigen.symbolic.readable import shortened
from phigen.symbolic.tower import Generator, Poly
from phigen.symbolic.verdict import PROVED, decide_zero

#: The key of specs that selects relative coordinates.
KEY = "coordinates_from"

_FORM = (
    "H = sum of p_i**2/(2*m_i) - k_ij/sqrt((x_i - x_j)**2 + (y_i - y_j)**2 [+ (z_i - z_j)**2]) over bodies and pairs"
)
_HINT = "the first body is the heaviest, the others follow from the inside out, along each axis in the same order"


class _NoBodiesError(Exception):
    """Raised if H is not that of attracting bodies; the text is the reason."""


def split_bodies(system: System, change: str) -> SplitHamiltonian:
    """Return H as the sum of Kepler motions A and a remainder B, in relative coordinates.

    ``change`` is the name of the relative coordinates in specs, such as ``jacobi``. Raises `SpecError`, located at the
    key `KEY` of the spec, if H is not that of attracting bodies.
    """
    summands = hamiltonian_terms(system)
    ring = ring_of(system, summands)
    terms = [Term(e, ring.tower.convert(e)) for e in summands]
    try:
        bodies, other_terms = _bodies(ring, terms)
        motions, remainder = CHANGES[change](bodies)
        alone, coupled = _commuting_terms(ring, bodies, other_terms)
        flow = Flow(motions.hamiltonian, tuple(motions.increments(ring.coordinates)), motions.manner, motion=motions)
        a = _with_others(ring, flow, alone)
        b = _remainder(system, ring, remainder, coupled, _positions(ring, bodies), moving=change != "jacobi")
    except _NoBodiesError as error:
        place = system.locations.get((KEY,)) or system.locations.get(("hamiltonian",))
        raise SpecError([Diagnostic(f"{KEY}: {change} needs {_FORM}: {error}", place, _HINT)]) from None
    return SplitHamiltonian((a,)) if b is None else SplitHamiltonian((a, b), small=1)


@dataclass(frozen=True)
class _Distance:
    """A variable of the ring that stands for 1/|q_a − q_b|.

    ``variable`` is its index. ``pairs`` has the indices of the coordinates of q_a and q_b, as one pair for each axis.
    """

    variable: int
    pairs: tuple[tuple[int, int], ...]


def _bodies(ring: Ring, terms: Sequence[Term]) -> tuple[AttractingBodies, list[Term]]:
    """Return the attracting bodies in H, and the terms that are neither kinetic energies nor attractions of
    pairs.

    Raises `_NoBodiesError` if H contains no attracting bodies, or if one of them has no momentum, no kinetic energy, or
    no attraction by an earlier body. Bodies are in the order of their coordinates.
    """
    distances = [d for g in ring.tower.generators if is_inverse_distance(g) for d in [_distance(ring, g)] if d]
    if not distances:
        raise _NoBodiesError("no attraction of two bodies was found")
    axes = _axes(pair for d in distances for pair in d.pairs)
    if len(axes) not in (2, 3) or len({len(axis) for axis in axes}) > 1:
        raise _NoBodiesError(f"distances are along {len(axes)} axes with {', '.join(str(len(a)) for a in axes)} bodies")
    body_of = {c: i for axis in axes for i, c in enumerate(axis)}
    momenta = [[conjugate(ring, c) for c in axis] for axis in axes]
    if missing := [c for axis in axes for c in axis if conjugate(ring, c) is None]:
        reason = f"{ring.coordinates[missing[0]]} has no momentum p with {{q, p}} = 1; a velocity is not a momentum"
        raise _NoBodiesError(f"{reason}; declare momenta as poisson: {{canonical: {{q: […], p: […]}}}}")
    coefficients = ring.terms(ring.tower.combine(t.element for t in terms), ring.state)
    used_monomials: set[Monomial] = set()
    strengths: dict[tuple[int, int], Expression] = {}
    for d in distances:
        monomial = _power(ring, d.variable, 1)
        body_pairs = {(body_of[b], body_of[a]) for a, b in d.pairs}
        if monomial not in coefficients or len(body_pairs) > 1 or len(d.pairs) < len(axes):
            continue
        used_monomials.add(monomial)
        strengths[body_pairs.pop()] = ring.expression(-coefficients[monomial])
    masses = []
    for i in range(len(axes[0])):
        places = [ring.tower.names.index(ring.coordinates[axis[i] or 0]) for axis in momenta]
        squares = [_power(ring, position, 2) for position in places]
        weights: list[Poly] = [coefficients.get(square, ring.tower.zero) for square in squares]
        name = ring.coordinates[axes[0][i]]
        if weights[0] == 0 or any(weight != weights[0] for weight in weights):
            raise _NoBodiesError(f"the body at {name} has no kinetic energy p**2/(2*m)")
        if i and not any((i, j) in strengths for j in range(i)):
            raise _NoBodiesError(f"the body at {name} is not attracted by any body before it")
        used_monomials.update(squares)
        masses.append(power(ring.expression(2 * weights[0]), -1))
    positions, conjugates = (
        tuple(zip(*([ring.coordinates[c or 0] for c in axis] for axis in names), strict=True))
        for names in (axes, momenta)
    )
    bodies = AttractingBodies(positions, conjugates, tuple(masses), strengths)
    return bodies, [t for t in terms if not used_monomials.issuperset(ring.terms(t.element, ring.state))]


def _distance(ring: Ring, generator: Generator) -> _Distance | None:
    """Return the distance |q_a − q_b| of two bodies if ``generator`` is the variable 1/|q_a − q_b| of the ring.

    Returns None if ``generator`` is the inverse root of any other expression.
    """
    (argument,) = generator.arguments
    support, tower = ring.support(argument), ring.tower
    pairs = []
    for monomial, coefficient in ring.terms(argument, ring.state).items():
        variables = [v for v, exponent in enumerate(monomial) if exponent]
        if len(variables) == 2 and coefficient == -2:
            a, b = (ring.coordinates.index(tower.names[v]) for v in variables)
            pairs.append((min(a, b), max(a, b)))
    squares = tower.combine(
        (tower.variable(ring.coordinates[a]) - tower.variable(ring.coordinates[b])) ** 2 for a, b in pairs
    )
    return _Distance(tower.names.index(generator.name), tuple(pairs)) if support and argument == squares else None


def _axes(pairs: Iterator[tuple[int, int]]) -> list[list[int]]:
    """Return one list for each axis: the indices of the coordinates along this axis, in ascending order.

    ``pairs`` are pairs of coordinates whose difference occurs in H; the two coordinates of a pair lie along one axis.
    """
    axes: list[set[int]] = []
    for pair in pairs:
        merged = {*pair}.union(*(axis for axis in axes if not axis.isdisjoint(pair)))
        axes = [*(axis for axis in axes if axis.isdisjoint(pair)), merged]
    return sorted(map(sorted, axes))


def _power(ring: Ring, variable: int, exponent: int) -> Monomial:
    return tuple(exponent * (k == variable) for k in range(len(ring.tower.gens)))


def _commuting_terms(
    ring: Ring, bodies: AttractingBodies, other_terms: Sequence[Term]
) -> tuple[list[Term], list[Term]]:
    """Return two lists: the terms that commute with all coordinates of the bodies, and all other terms."""
    body_coordinates = {ring.coordinates.index(name) for name in bodies.names}
    partners = {j for i in body_coordinates for j in (i, *ring.brackets_of[i])}
    alone = [t for t in other_terms if partners.isdisjoint(ring.support(t.element))]
    return alone, [t for t in other_terms if t not in alone]


def _with_others(ring: Ring, flow: Flow, terms: Sequence[Term]) -> Flow:
    """Return the composition of ``flow`` and the flow of the sum of ``terms``. All ``terms`` commute with the
    Hamiltonian of ``flow``.
    """
    return composed(ring.coordinates, [flow, _flow(ring, terms)]) if terms else flow


def _flow(ring: Ring, terms: Sequence[Term]) -> Flow:
    """Return the flow of a sum of terms. Raises `_NoBodiesError` if the terms do not commute with each other, or if a
    term has no flow.
    """
    conflicts = Conflicts(ring).grouped(terms)
    if len(conflicts) > 1:
        first, second = (shortened(group[0].expression) for group in conflicts[:2])
        raise _NoBodiesError(f"the further terms {first} and {second} do not commute")
    try:
        return flow_of(ring, terms)
    except NoFlowError as error:
        raise _NoBodiesError(f"the further term {shortened(error.term.expression)} has no flow: {error}") from None


def _remainder(
    system: System, ring: Ring, remainder: Expression, terms: Sequence[Term], positions: frozenset[int], *, moving: bool
) -> Flow | None:
    """Return the flow of the part B of H = A + B, which consists of ``remainder`` and the further ``terms``; None if B
    is 0.

    ``moving`` says that the remainder contains momenta. Raises `_NoBodiesError` if the terms of B do not commute.
    """
    shifting = [t for t in terms if positions.issuperset(ring.support(t.element))]
    other_terms = [t for t in terms if t not in shifting]
    if moving and not remainder.is_zero and terms:
        first = shortened(terms[0].expression)
        raise _NoBodiesError(f"the further term {first} is not offered, since it may not commute with p_0**2/(2*m_0)")
    h = total([remainder, *(t.expression for t in shifting)])
    if h.is_zero and not other_terms:
        return None
    if h.is_zero:
        return _flow(ring, other_terms)
    for term in other_terms:
        if decide_zero("", [("", bracket(system, h, term.expression))]).verdict != PROVED:
            raise _NoBodiesError(f"the further term {shortened(term.expression)} does not commute with the attractions")
    slope = gradient(symbol(TIME) * h, system.coordinates)
    field = hamiltonian_vector_field(system.poisson, slope)
    names = [c for c, e in zip(system.coordinates, field, strict=True) if not e.is_zero]
    flow = Flow(h, tuple(field), f"{', '.join(names)} {SHIFTED}")
    return _with_others(ring, flow, other_terms)


def _positions(ring: Ring, bodies: AttractingBodies) -> frozenset[int]:
    """Return the indices of the positions of the bodies."""
    return frozenset(ring.coordinates.index(name) for body in bodies.positions for name in body)
