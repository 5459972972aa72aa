"""Derivatives of runs in reverse mode, with checkpointing: a run is divided into segments that fit on a tape.

All segments but the last are computed twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from phigen.runtime import arguments
from phigen.runtime.interface import BackendError, Floats, Interface, MissingExtraError, row_steps

if TYPE_CHECKING:
    from phigen.runtime.solver import Solver

#: Largest number of values on the tape, which holds one segment of a run (32 MiB in double precision). Longer runs are
#: divided into segments, of which all but the last are computed twice.
MAX_TAPE_VALUES = 1 << 22


def without_pullback(interface: Interface) -> TypeError:
    """Return the `TypeError` for a solver that was compiled without ``adjoint``, and so has no pullback."""
    hint = "compile it with adjoint=True, or write adjoint: true in the spec"
    return TypeError(f"{interface.name} was compiled without pullback; {hint}")


class Pullback(NamedTuple):
    """Result of `Solver.pullback`: states, and derivatives with respect to the initial state and to each parameter, by
    name.

    The function whose derivatives are computed is the scalar product of the states with a cotangent.
    """

    x1: Floats
    x0_bar: Floats
    parameters_bar: dict[str, Floats]


class Jacobian(NamedTuple):
    """Result of `Solver.jacobian`: the last state, and its derivatives with respect to the initial state and to each
    parameter.
    """

    x1: Floats
    by_x0: Floats
    by_parameters: dict[str, Floats]


@dataclass(frozen=True)
class Segment:
    """Part of a run that is differentiated at once: ``count`` steps, which begin after step number ``first``.

    ``rows`` are the numbers of the trajectory's rows in this part. If ``rows`` is not empty, there is a row after every
    ``stride`` steps of the part, and after its last step. If ``rows`` is empty, the next row comes in a later part.
    """

    first: int
    count: int
    stride: int
    rows: range


def segments(steps: int, stride: int, limit: int) -> list[Segment]:
    """Return the segments of a run of ``steps`` steps, each of at most ``limit`` steps.

    Row r of the run is after r·stride steps, the last row after the last step.
    """

    def cut() -> Iterator[Segment]:
        chunk = max(1, limit // stride) * stride
        for first in range(0, steps, chunk):
            last = min(first + chunk, steps)
            row = first // stride
            rows = range(row + 1, row + 1 + -(-(last - first) // stride))
            if last - first <= limit:
                yield Segment(first, last - first, stride, rows)
                continue
            for begin in range(first, last, limit):  # one stride exceeds the limit, and is divided
                count = min(limit, last - begin)
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
    parameters: Mapping[str, Any],
) -> Pullback:
    """Check the arguments of `Solver.pullback`, and compute its result."""
    interface = solver.interface
    start = arguments.states(x0, "x0", interface)
    if start.ndim > 2:
        shapes = f"({interface.dimension},) or (members, {interface.dimension})"
        raise ValueError(f"x0 must have shape {shapes}, not {start.shape}")
    steps, keyword_arguments = arguments.count(steps, "steps", 0), dict(parameters)
    width = max(1, steps) if stride is None else arguments.count(stride, "stride", 1)
    per_member = [v for v in (h, t0, *keyword_arguments.values()) if np.ndim(v) > 0] if start.ndim == 1 else []
    if per_member:
        start = np.tile(start, (len(per_member[0]), 1))
    several = start.reshape(-1, interface.dimension)
    members = arguments.ensemble(several, h, steps, width, t0, {}, keyword_arguments, interface)
    rows = len(row_steps(steps, width))
    bars = cotangents(cotangent, start.shape if stride is None else (rows, *start.shape))
    bars = bars.reshape(1 if stride is None else rows, *several.shape)
    if stride is None:
        bars = np.concatenate([np.zeros((rows - 1, *several.shape)), bars])
    try:
        states, x0_bar, parameter_bars = solver.backend.pullback(members, bars, threads)
    except MissingExtraError:
        raise without_pullback(interface) from None
    except BackendError as error:
        size, values, _ = members.numbers(error.members[0] if error.members else 0)
        if start.ndim == 1:
            error.members = ()
        raise solver.failure(error, size, None, values) from error
    states = states.reshape(rows, *start.shape)
    named_bars = zip(members.parameters.items(), parameter_bars, strict=True)
    bars_of = {name: bar if np.ndim(value) else bar.sum() for (name, value), bar in named_bars}
    return Pullback(states[-1] if stride is None else states, x0_bar.reshape(start.shape), bars_of)


def cotangents(cotangent: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return the user's cotangent as an array. Raises `ValueError` if its shape is not ``shape``, or a value is not
    finite."""
    bars = arguments.real(cotangent, "cotangent")
    if bars.shape != shape:
        raise ValueError(f"cotangent must have shape {shape}, that of the states, not {bars.shape}")
    if not np.isfinite(bars).all():
        raise ValueError("cotangent must be finite")
    return bars
