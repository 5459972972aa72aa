"""The elements of exact flows: of parts of H whose gradient is constant along their own flow, exp(t∇H_k).

A part is written as c C + Q + R with a Casimir C, Q = ½c′|m|² for the angular momentum m, and R, such that the
gradients of Q and of R are constant along the flows of both. Then the flow of the part is, in the group,
exp(t∇Q) exp(t∇R) and what C turns: x does not feel that, and over a step all its times add up to h, so it is put back
once for all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phigen.attitude.elements import dot, product, rotated, rotation_by
from phigen.attitude.group import Group, refused
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.flow import Flow
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ONE, ZERO, Expression, derivative, gradient, symbol, symbols_of, total
from phigen.symbolic.readable import shortened
from phigen.symbolic.verdict import PROVED, Statement, decide_zero


@dataclass(frozen=True)
class Turning:
    """A part as ``casimir`` + ``round`` + ``rest``; the first and the second may be 0."""

    casimir: Expression
    round: Expression
    rest: Expression

    @property
    def factors(self) -> list[Expression]:
        """What has an element of its own."""
        return [e for e in (self.round, self.rest) if not e.is_zero]


def turnings(system: System, group: Group, flows: Sequence[Flow]) -> list[Turning]:
    """Each part in this form. Raises `SpecError` that names the first that has none."""
    return [_turning(system, group, flow, k) for k, flow in enumerate(flows, 1)]


def _turning(system: System, group: Group, flow: Flow, k: int) -> Turning:
    for candidate in _candidates(system, group, flow.hamiltonian):
        if constancy(system, candidate, "").verdict == PROVED:
            return candidate
    raise refused(
        system,
        f"reconstruct: the part H_{k} = {shortened(flow.hamiltonian)} of the splitting turns about an axis that moves "
        "along its own flow, and phigen does not know by what element",
        "scheme: series takes every H",
    )


def _candidates(system: System, group: Group, h: Expression) -> Iterator[Turning]:
    yield Turning(ZERO, ZERO, h)
    if not group.matrices and group.vectors:
        m = [symbol(system.coordinates[i]) for i in group.rotation]
        for c in _curvatures(system, h, dot(m, m) / 2):
            yield Turning(ZERO, c * (dot(m, m) / 2), h - c * (dot(m, m) / 2))
    for casimir in system.casimirs.values():
        for c in _curvatures(system, h, casimir):
            yield Turning(c * casimir, ZERO, h - c * casimir)


def _curvatures(system: System, h: Expression, q: Expression) -> Iterator[Expression]:
    """The c for which h − c q has no second derivative along some coordinate."""
    seen: list[Expression] = []
    for name in system.coordinates:
        above, below = (derivative(derivative(e, name), name) for e in (h, q))
        if below.is_zero or above.is_zero or any(s in system.coordinates for s in symbols_of(above, below)):
            continue
        if all(above / below is not s for s in seen):
            seen.append(above / below)
            yield above / below


def constancy(system: System, turning: Turning, name: str) -> Statement:
    """The gradients of all factors are constant along the flows of the factor itself and of those before it."""
    names, residuals = system.coordinates, list[tuple[str, Expression]]()
    fields = [hamiltonian_vector_field(system.poisson, gradient(f, names)) for f in turning.factors]
    for k, factor in enumerate(turning.factors):
        for c, slope in zip(names, gradient(factor, names), strict=True):
            by = gradient(slope, names)
            residuals += [(f"along {c}", total(a * b for a, b in zip(by, f, strict=True))) for f in fields[: k + 1]]
    return decide_zero(name, residuals, system.positive)


def factor_elements(system: System, group: Group, turning: Turning) -> list[list[Expression]]:
    """The elements of the factors for the time of the flow, at the state before it; generators for matrices."""
    t, found = symbol(TIME), []
    for factor in turning.factors:
        p = [t * slope for slope in gradient(factor, system.coordinates)]
        if group.matrices:
            found.append(group.generator(p))
        else:
            r, shift = [p[i] for i in group.rotation], [p[i] for i in group.translation]
            trivial = all(e.is_zero for e in r)
            found.append([ZERO] * 4 + shift if trivial else list(rotation_by(r, shift)))
    return found


def joined(group: Group, elements: Sequence[Sequence[Expression]]) -> list[Expression]:
    """The element of the factors, one after the other."""
    made, *others = elements
    result = list(made)
    for later in others:
        first, second = (later, result) if group.spatial else (result, later)
        q = [ONE + first[0], *first[1:4]]
        turn = [a + b + c for a, b, c in zip(first[:4], second[:4], product(first[:4], second[:4]), strict=True)]
        result = [*turn, *(a + b for a, b in zip(first[4:], rotated(q, second[4:]) if second[4:] else [], strict=True))]
    return result
