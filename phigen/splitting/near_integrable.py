"""Kepler motions and free rigid bodies in H, and the division of H into a large and a small part.

A Kepler motion is a sum of p²/2m and −k/|q| for a single body; these two terms do not commute. The body has two or
three coordinates q, with 1/|q| in H, and their conjugate momenta p. All terms of H that belong to no Kepler motion and
no rigid body are perturbations. If the perturbations are small, H = A + εB is near-integrable.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf

from phigen.geometry.system import System
from phigen.splitting.euler import EulerMotion
from phigen.splitting.flow import Term
from phigen.splitting.kepler import KeplerMotion
from phigen.splitting.ring import Ring
from phigen.splitting.rotors import rotors
from phigen.splitting.terms import joined, monomial_terms
from phigen.symbolic.expression import symbol
from phigen.symbolic.numeric import DomainError, evaluate
from phigen.symbolic.tower import Generator, Poly

#: Dimensions of space in which Kepler motions are recognised.
_DIMENSIONS = (2, 3)

#: Let ε be the size of the perturbations, divided by the size of all other terms; `size_of` computes sizes. If ε is
#: below this number, methods for near-integrable systems are used. In steps of size h, their errors ε² h^6 and ε³ h^4
#: are then smaller than the errors of general methods of order 4.
SMALL = 0.02


def with_motions(ring: Ring, terms: Sequence[Term], *, rigid: bool) -> list[Term] | None:
    """Return H as a list of terms, which begins with the Hamiltonians of Kepler motions.

    The Hamiltonian of each Kepler motion is a single term. If the argument ``rigid`` is true, the Hamiltonians of free
    rigid bodies follow. Each of them is a single term too, and depends on one body only. Returns None if H contains no
    motion of these kinds.

    A term with coordinates of two bodies is not expanded: (p_1 + p_2)² stays one term, which commutes with functions of
    q_1 − q_2.
    """
    motions: list[tuple[KeplerMotion | EulerMotion, Poly]] = [*_motions(ring, terms)]
    if rigid:
        motions += rotors(ring, terms)
    if not motions:
        return None
    motion_terms = [Term(motion.hamiltonian, element, motion) for motion, element in motions]
    return [*motion_terms, *_remaining(ring, terms, motion_terms)]


def small_part(system: System, ring: Ring, parts: Sequence[Sequence[Term]]) -> int | None:
    """Return the index of the part εB of a near-integrable H = A + εB; None if H does not consist of a large and a
    small part.

    If parameters are declared small, εB is the part whose terms have such a parameter as a factor. This rule does not
    apply if a small parameter is also a divisor, such as the small mass in p²/2m. Where the rule does not apply, εB is
    the part without Kepler motions and rigid bodies, provided that its coefficients are small.
    """
    if len(parts) != 2:
        return None
    names = [p.name for p in system.parameters if p.small and p.name in ring.tower.names]
    declared = [ring.tower.names.index(name) for name in names]
    if declared and not any(_divided_by(ring, term, names) for part in parts for term in part):
        is_small = [all(_vanishes_with(ring, term, declared) for term in part) for part in parts]
        return is_small.index(True) if sum(is_small) == 1 else None
    perturbations = [k for k, part in enumerate(parts) if not any(term.motion for term in part)]
    if len(perturbations) != 1:
        return None
    perturbation, motions = [parts[k] for k in (perturbations[0], 1 - perturbations[0])]
    return perturbations[0] if size_of(system, ring, perturbation) < SMALL * size_of(system, ring, motions) else None


def _vanishes_with(ring: Ring, term: Term, variables: Sequence[int]) -> bool:
    """Whether every monomial of a term contains one of the ``variables``. They are indices of variables of the ring."""
    return all(any(exponents[v] for v in variables) for exponents in term.element.to_dict())


def _divided_by(ring: Ring, term: Term, names: Sequence[str]) -> bool:
    """Whether one of the parameters ``names`` occurs in a denominator of a term."""
    powers = term.element.degrees()[len(ring.tower.symbols) :]
    occurring = (g for g, degree in zip(ring.tower.generators, powers, strict=True) if degree > 0)
    return any(g.kind == "reciprocal" and ring.tower.depends_on(g.arguments[0], names) for g in occurring)


def size_of(system: System, ring: Ring, terms: Sequence[Term]) -> float:
    """Return the sum of the absolute values of the coefficients of some terms, for the default values of parameters.

    Terms whose vector field is 0 do not count.
    """
    values = {p.name: float(p.value) for p in system.parameters}
    sizes = []
    for term in terms:
        if all(e == 0 for e in ring.field(term.element)):
            continue
        sizes += [ring.expression(c) for c in ring.terms(term.element, ring.state).values()]
    try:
        return sum(abs(v) for v in evaluate(sizes, values))
    except (DomainError, KeyError):
        return inf


def _remaining(ring: Ring, terms: Sequence[Term], motions: Sequence[Term]) -> list[Term]:
    """Return the terms of H after removal of the monomials that occur in ``motions``.

    ``motions`` are the Hamiltonians of Kepler motions and rigid bodies. Terms of H without a removed monomial are left
    as written.
    """
    untouched, remaining = [], []
    for term in terms:
        motion_monomials = {
            m for motion in motions for m in ring.terms(motion.element, ring.state) if _is_of(ring, term, motion)
        }
        monomials = ring.terms(term.element, ring.state)
        if motion_monomials.isdisjoint(monomials):
            untouched.append(term)
        else:
            remaining += [c * ring.monomial(m) for m, c in monomials.items() if m not in motion_monomials]
    monomials_left = [t for e in remaining for t in monomial_terms(ring, e)]
    return [*untouched, *joined(ring, monomials_left)]


def _is_of(ring: Ring, term: Term, motion: Term) -> bool:
    """Whether a term depends only on coordinates that occur in the Hamiltonian ``motion``."""
    return {*ring.support(term.element)} <= {*ring.support(motion.element)}


def _motions(ring: Ring, terms: Sequence[Term]) -> Iterator[tuple[KeplerMotion, Poly]]:
    """Find the Kepler motions whose Hamiltonian is a sum of monomials of H. Yield each motion with its Hamiltonian, as
    an element of the ring.
    """
    size = len(ring.tower.gens)
    supports = [{*ring.support(t.element)} for t in terms]
    for generator in ring.tower.generators:
        positions = _distance_from(ring, generator.arguments) if is_inverse_distance(generator) else ()
        momenta = [j for i in positions if (j := conjugate(ring, i)) is not None]
        if not positions or len(momenta) < len(positions):
            continue
        elements = [t.element for t, support in zip(terms, supports, strict=True) if support <= {*positions, *momenta}]
        coefficients = ring.terms(ring.tower.combine(elements), ring.state)
        pull = coefficients.get(_exponents(size, ring.tower.names.index(generator.name), 1))
        momentum_indices = [ring.tower.names.index(ring.coordinates[j]) for j in momenta]
        squares: list[Poly] = [
            coefficients.get(_exponents(size, momentum_index, 2), ring.tower.zero)
            for momentum_index in momentum_indices
        ]
        if pull is None or squares[0] == 0 or any(square != squares[0] for square in squares):
            continue
        q, p = (tuple(symbol(ring.coordinates[i]) for i in indices) for indices in (positions, momenta))
        motion = KeplerMotion(q, p, ring.expression(2 * squares[0]), ring.expression(-pull))
        kinetic = [squares[0] * ring.tower.gens[momentum_index] ** 2 for momentum_index in momentum_indices]
        yield motion, ring.tower.combine([*kinetic, pull * ring.tower.variable(generator.name)])


def is_inverse_distance(generator: Generator) -> bool:
    """Whether a variable of the ring stands for the inverse of a square root, 1/√u."""
    return generator.kind == "root" and generator.degree == 2 and generator.inverse


def _distance_from(ring: Ring, arguments: Sequence[Poly]) -> tuple[int, ...]:
    """Return the indices of the coordinates q if the argument of a root is |q|²; () if it has another form."""
    support = ring.support(arguments[0])
    squares = ring.tower.combine(ring.tower.variable(ring.coordinates[i]) ** 2 for i in support)
    return support if len(support) in _DIMENSIONS and arguments[0] == squares else ()


def conjugate(ring: Ring, i: int) -> int | None:
    """Return the index of the momentum p of the coordinate q = x_i, with {q, p} = 1.

    Returns None if there is none, or if q or p has a bracket with a third coordinate.
    """
    partners = ring.brackets_of[i]
    alone = len(partners) == 1 and ring.brackets_of[partners[0]] == [i]
    return partners[0] if alone and ring.poisson[i][partners[0]] == 1 else None


def _exponents(size: int, variable: int, exponent: int) -> tuple[int, ...]:
    return tuple(exponent * (k == variable) for k in range(size))
