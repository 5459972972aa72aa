"""Cotangents of runs: which states a run keeps to find its way back, and which steps are made again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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
    h: float,
    steps: int,
    cotangent: ArrayLike,
    stride: int | None,
    t0: float,
    given: Mapping[str, Any],
) -> Pullback:
    """`Solver.pullback`, for a start at ``t0`` and the parameters that were given."""
    interface = solver.interface
    start, h = arguments.states(x0, "x0", interface), arguments.step_size(h)
    if start.ndim > 2:
        shapes = f"({interface.dimension},) or (members, {interface.dimension})"
        raise ValueError(f"x0 must have shape {shapes}, not {start.shape}")
    steps, members = arguments.count(steps, "steps", 0), start.reshape(-1, interface.dimension)
    width = max(1, steps) if stride is None else arguments.count(stride, "stride", 1)
    rows = len(row_steps(steps, width))
    bars = cotangents(cotangent, start.shape if stride is None else (rows, *start.shape)).reshape(-1, *members.shape)
    if stride is None:
        bars = np.concatenate([np.zeros((rows - 1, *members.shape)), bars])

    def back(x: Floats, values: Mapping[str, float], own: Floats) -> tuple[Floats, Floats, Floats]:
        try:
            return solver.backend.pullback(x, h, steps, width, own, values, t0)
        except MissingExtraError:
            hint = "compile it with adjoint=True, or say adjoint: true in the spec"
            raise TypeError(f"{interface.name} was compiled without pullback; {hint}") from None
        except BackendError as error:
            raise solver.failure(error, h, None, values) from error

    states, x0_bar, of_parameters = _of_members(back, members, solver.values, given, bars)
    states = states.reshape(-1, *start.shape)
    return Pullback(states[-1] if stride is None else states, x0_bar.reshape(start.shape), of_parameters)


#: Pull cotangents of some members back: with x0 (members, DIM), parameters, and cotangents (rows, members, DIM) gives
#: the rows, the cotangents (members, DIM) of x0 and those (parameters, members) of parameters.
Back = Callable[[Floats, Mapping[str, float], Floats], tuple[Floats, Floats, Floats]]


def _of_members(
    back: Back,
    x0: Floats,
    values: Callable[[Mapping[str, float], Mapping[str, float]], dict[str, float]],
    given: Mapping[str, Any],
    bars: Floats,
) -> tuple[Floats, Floats, dict[str, Floats]]:
    """`Back` for members (members, DIM), where parameters may be arrays of one value for each.

    The cotangent of a parameter that all members share is the sum over members.
    """
    own = {name: np.asarray(value, dtype=np.float64) for name, value in given.items() if np.ndim(value) == 1}
    for name, value in own.items():
        if len(value) != len(x0):
            raise ValueError(f"parameter {name!r} has {len(value)} values, and there are {len(x0)} members")
    shared = {name: value for name, value in given.items() if name not in own}
    if not own:
        common = values(shared, {})
        rows, x0_bar, found = back(x0, common, bars)
        return rows, x0_bar, {name: found[k].sum() for k, name in enumerate(common)}
    each, names = [], list[str]()
    for m in range(len(x0)):
        mine = values(shared, {name: float(value[m]) for name, value in own.items()})
        names = list(mine)
        each.append(back(x0[m : m + 1], mine, bars[:, m : m + 1]))
    rows, x0_bar, found = (np.concatenate([e[k] for e in each], axis=axis) for k, axis in ((0, 1), (1, 0), (2, 1)))
    return rows, x0_bar, {name: found[k] if name in own else found[k].sum() for k, name in enumerate(names)}


def cotangents(cotangent: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Cotangents as an array of a shape. Raises `ValueError` for other shapes, and what is not finite."""
    bars = np.array(cotangent, dtype=np.float64)
    if bars.shape != shape:
        raise ValueError(f"cotangent must have shape {shape}, that of the states, not {bars.shape}")
    if not np.isfinite(bars).all():
        raise ValueError("cotangent must be finite")
    return bars
