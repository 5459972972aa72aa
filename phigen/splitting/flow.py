"""The exact flow of one part of H, as increments of the coordinates.

A part is a sum of terms that commute with one another. If the joint equations of motion have a closed form, that is the
flow; otherwise it is the composition of the flows of the terms, in any order, since they commute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phigen.splitting.closure import motion_of
from phigen.splitting.exponential import NoClosedFormError, solve
from phigen.splitting.ring import Ring
from phigen.symbolic.expression import ZERO, Expression, substitute, symbol, total
from phigen.symbolic.tower import Poly


@dataclass(frozen=True)
class Term:
    """A term of H, as the user wrote it and in the ring."""

    expression: Expression
    element: Poly


@dataclass(frozen=True)
class Flow:
    """The flow of ``hamiltonian`` for the time `TIME`: x + ``increment``; ``manner`` says how the coordinates move."""

    hamiltonian: Expression
    increment: tuple[Expression, ...]
    manner: str

    @property
    def is_still(self) -> bool:
        """Whether nothing moves: the Hamiltonian is a Casimir."""
        return all(e.is_zero for e in self.increment)


class NoFlowError(Exception):
    """A term has no elementary flow that phigen finds; the text says why."""

    def __init__(self, term: Term, reason: str) -> None:
        super().__init__(reason)
        self.term, self.reason = term, reason


def flow_of(ring: Ring, terms: Sequence[Term]) -> Flow:
    """The flow of a sum of commuting terms. Raises `NoFlowError` for the first term that has none."""
    pieces: list[tuple[list[Term], Flow]] = []
    for term in terms:
        if pieces:
            joint = _attempt(ring, [*pieces[-1][0], term])
            if isinstance(joint, Flow):
                pieces[-1] = ([*pieces[-1][0], term], joint)
                continue
        alone = _attempt(ring, [term])
        if not isinstance(alone, Flow):
            raise NoFlowError(term, alone)
        pieces.append(([term], alone))
    flows = [flow for _, flow in pieces]
    return flows[0] if len(flows) == 1 else _composed(ring, flows)


def _composed(ring: Ring, flows: Sequence[Flow]) -> Flow:
    total_increment: list[Expression] = [ZERO] * len(ring.coordinates)
    for flow in flows:
        point = {c: symbol(c) + e for c, e in zip(ring.coordinates, total_increment, strict=True)}
        moved = substitute(flow.increment, point)
        total_increment = [e + m for e, m in zip(total_increment, moved, strict=True)]
    manner = "; then ".join(f.manner for f in flows)
    return Flow(total(f.hamiltonian for f in flows), tuple(total_increment), manner)


def _attempt(ring: Ring, terms: Sequence[Term]) -> Flow | str:
    """The joint flow of terms, or why there is none."""
    g = total(t.expression for t in terms)
    field = ring.field(ring.tower.combine(t.element for t in terms))
    motion = motion_of(ring, field)
    names = ring.coordinates
    if motion.other:
        i = min(motion.other)
        return f"the equation of {names[i]} along its flow is not linear"
    increments: list[Expression] = [ZERO] * len(names)
    manners = []
    for linear in motion.linear:
        moving = ", ".join(names[i] for i in linear.coordinates)
        try:
            solution = solve(ring, linear)
        except NoClosedFormError as error:
            return f"phigen has no closed form for the motion of {moving} along its flow: {error}"
        for i, e in zip(linear.coordinates, solution.increments, strict=True):
            increments[i] = e
        manners.append((moving, solution.manner))
    increments = _as_written(ring, g, field, motion.frozen, increments)
    return Flow(g, tuple(increments), _manner(manners))


def _as_written(
    ring: Ring, g: Expression, field: Sequence[Poly], frozen: Sequence[int], increments: Sequence[Expression]
) -> list[Expression]:
    """The increments, in the form of the derivative of g as it was written where that has fewer operations.

    (x − y)⁴ costs less than its five terms. It applies to coordinates whose rate is frozen.
    """
    return list(increments)


def _manner(manners: Sequence[tuple[str, str]]) -> str:
    grouped: dict[str, list[str]] = {}
    for moving, manner in manners:
        grouped.setdefault(manner, []).append(moving)
    return "; ".join(f"{', '.join(moving)} {manner}" for manner, moving in grouped.items()) or "nothing moves"
