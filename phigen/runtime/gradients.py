"""Cotangents of runs: which states a run keeps to find its way back, and which steps are made again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from phigen.runtime import arguments
from phigen.runtime.interface import BackendError, Floats, MissingExtraError, row_steps

if TYPE_CHECKING:
    from phigen.runtime.solver import Solver

#: Numbers that the trail of a segment of a run takes at most; longer runs are made twice, but for their last segment.
KEPT = 1 << 22


class Pullback(NamedTuple):
    """What `Solver.pullback` gives: states, cotangents of the start, and those of parameters by name."""

    x1: Floats
    x0_bar: Floats
    parameters_bar: dict[str, Floats]


class Jacobian(NamedTuple):
    """What `Solver.jacobian` gives: the last state, its derivative along the start, and along parameters by name."""

    x1: Floats
    by_x0: Floats
    by_parameters: dict[str, Floats]


@dataclass(frozen=True)
class Segment:
    """Steps that are gone through at once: ``count`` of them after the step ``first``.

    ``rows`` are numbers of the rows that follow each ``stride`` steps, the last one also the end of the segment; empty
    where the segment ends between two rows.
    """

    first: int
    count: int
    stride: int
    rows: range


def segments(steps: int, stride: int, most: int) -> list[Segment]:
    """The segments of a run, none with more than ``most`` steps; row r follows r strides, or the last step."""

    def cut() -> Iterator[Segment]:
        many = max(1, most // stride) * stride
        for first in range(0, steps, many):
            last = min(first + many, steps)
            row = first // stride
            rows = range(row + 1, row + 1 + -(-(last - first) // stride))
            if last - first <= most:
                yield Segment(first, last - first, stride, rows)
                continue
            for begin in range(first, last, most):  # one stride, which is too long by itself
                count = min(most, last - begin)
                yield Segment(begin, count, count, rows if begin + count == last else range(0))

    return list(cut())


def pullback(
    solver: Solver,
    x0: ArrayLike,
    h: ArrayLike,
    steps: int,
    cotangent: ArrayLike,
    stride: int | None,
    t0: ArrayLike | None,
    threads: int | None,
    given: Mapping[str, Any],
) -> Pullback:
    """`Solver.pullback`, with the parameters that were given."""
    interface = solver.interface
    start = arguments.states(x0, "x0", interface)
    if start.ndim > 2:
        shapes = f"({interface.dimension},) or (members, {interface.dimension})"
        raise ValueError(f"x0 must have shape {shapes}, not {start.shape}")
    steps, rest = arguments.count(steps, "steps", 0), dict(given)
    width = max(1, steps) if stride is None else arguments.count(stride, "stride", 1)
    own = [v for v in (h, t0, *rest.values()) if np.ndim(v) > 0] if start.ndim == 1 else []
    if own:
        start = np.tile(start, (len(own[0]), 1))
    several = start.reshape(-1, interface.dimension)
    members = arguments.ensemble(several, h, steps, width, t0, {}, rest, interface)
    rows = len(row_steps(steps, width))
    bars = cotangents(cotangent, start.shape if stride is None else (rows, *start.shape))
    bars = bars.reshape(1 if stride is None else rows, *several.shape)
    if stride is None:
        bars = np.concatenate([np.zeros((rows - 1, *several.shape)), bars])
    try:
        states, x0_bar, found = solver.backend.pullback(members, bars, threads)
    except MissingExtraError:
        hint = "compile it with adjoint=True, or say adjoint: true in the spec"
        raise TypeError(f"{interface.name} was compiled without pullback; {hint}") from None
    except BackendError as error:
        size, values, _ = members.numbers(error.members[0] if error.members else 0)
        if start.ndim == 1:
            error.members = ()
        raise solver.failure(error, size, None, values) from error
    states = states.reshape(rows, *start.shape)
    each = zip(members.parameters.items(), found, strict=True)
    bars_of = {name: bar if np.ndim(value) else bar.sum() for (name, value), bar in each}
    return Pullback(states[-1] if stride is None else states, x0_bar.reshape(start.shape), bars_of)


def cotangents(cotangent: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Cotangents as an array of a shape. Raises `ValueError` for other shapes, and what is not finite."""
    bars = arguments.real(cotangent, "cotangent")
    if bars.shape != shape:
        raise ValueError(f"cotangent must have shape {shape}, that of the states, not {bars.shape}")
    if not np.isfinite(bars).all():
        raise ValueError("cotangent must be finite")
    return bars
