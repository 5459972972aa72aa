"""Cotangents of runs of lattices: one, or members that may have parameters of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.runtime import arguments
from phigen.runtime.gradients import Pullback, cotangents
from phigen.runtime.interface import BackendError, Floats, MissingExtraError, row_steps
from phigen.runtime.lattice_ensemble import has_members, states
from phigen.runtime.memory import filled

if TYPE_CHECKING:
    from phigen.runtime.lattice import LatticeSolver


def pullback(
    solver: LatticeSolver,
    x0: ArrayLike,
    h: ArrayLike,
    steps: int,
    cotangent: ArrayLike,
    stride: int | None,
    t0: Floats,
    given: Mapping[str, Any],
) -> Pullback:
    """See `LatticeSolver.pullback`."""
    steps = arguments.count(steps, "steps", 0)
    own = {name: np.asarray(value) for name, value in given.items() if has_members(solver.interface, name, value)}
    own |= {what: np.asarray(v) for what, v in (("the step size h", h), ("the times t0", t0)) if np.ndim(v)}
    single = np.ndim(x0) == 1 + len(solver.interface.axes) and not own
    start = solver.state(x0, "x0")[np.newaxis] if single else states(solver, x0, own, "x0")
    width = max(1, steps) if stride is None else arguments.count(stride, "stride", 1)
    shape = start.shape[1:] if single else start.shape
    rows = len(row_steps(steps, width))
    bars = cotangents(cotangent, shape if stride is None else (rows, *shape))
    bars = bars.reshape(1 if stride is None else rows, *start.shape)
    if stride is None:
        bars = np.concatenate([np.zeros((rows - 1, *start.shape)), bars])
    times = np.broadcast_to(t0, len(start))
    each = [arguments.step_size(size) for size in np.broadcast_to(h, len(start))]
    made = filled(f"{rows} frames", (rows, *start.shape))
    given = {**given, **solver.defaults(given, start.shape[2:])}  # made once for all members
    x0_bar, found = np.empty_like(start), list[dict[str, Floats]]()
    for m, x in enumerate(start):
        values = solver.values({n: own[n][m] if n in own else v for n, v in given.items()}, {}, start.shape[2:])
        try:
            made[:, m], x0_bar[m], by = solver.backend.pullback(
                x, each[m], steps, width, bars[:, m], values, float(times[m])
            )
        except MissingExtraError:
            hint = "compile it with adjoint=True, or say adjoint: true in the spec"
            raise TypeError(f"{solver.interface.name} was compiled without pullback; {hint}") from None
        except BackendError as error:
            told = BackendError(error.status, error.step, error.states, () if single else (m,))
            raise solver.failure(told, each[m], None, values) from error
        found.append(by)
    bar = x0_bar.reshape(shape)
    result = made.reshape(rows, *shape)
    every = {
        name: np.array([by[name] for by in found]) if name in own else np.sum([by[name] for by in found], axis=0)
        for name in solver.interface.parameters
    }
    if not found:
        every = {name: np.zeros(np.shape(given.get(name, 0.0))) for name in every}
    return Pullback(result[-1] if stride is None else result, bar, every)
