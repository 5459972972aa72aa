"""Derivatives of runs of lattices in reverse mode: for one run, or for an ensemble whose members have different
parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.memory import filled
from phigen.runtime import arguments
from phigen.runtime.gradients import Pullback, cotangents, without_pullback
from phigen.runtime.interface import BackendError, Floats, MissingExtraError, row_steps
from phigen.runtime.lattice_ensemble import has_members, states

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
    parameters: Mapping[str, Any],
) -> Pullback:
    """Check the arguments of `LatticeSolver.pullback`, and compute its result."""
    steps = arguments.count(steps, "steps", 0)
    per_member = {
        name: np.asarray(value) for name, value in parameters.items() if has_members(solver.interface, name, value)
    }
    per_member |= {
        argument: np.asarray(v) for argument, v in (("the step size h", h), ("the times t0", t0)) if np.ndim(v)
    }
    single = np.ndim(x0) == 1 + len(solver.interface.axes) and not per_member
    start = solver.state(x0, "x0")[np.newaxis] if single else states(solver, x0, per_member, "x0")
    width = max(1, steps) if stride is None else arguments.count(stride, "stride", 1)
    shape = start.shape[1:] if single else start.shape
    rows = len(row_steps(steps, width))
    bars = cotangents(cotangent, shape if stride is None else (rows, *shape))
    bars = bars.reshape(1 if stride is None else rows, *start.shape)
    if stride is None:
        bars = np.concatenate([np.zeros((rows - 1, *start.shape)), bars])
    times = np.broadcast_to(t0, len(start))
    step_sizes = [arguments.step_size(size) for size in np.broadcast_to(h, len(start))]
    frames = filled(f"{rows} frames", (rows, *start.shape))
    parameters = {**parameters, **solver.defaults(parameters, start.shape[2:])}  # computed once for all members
    x0_bar, bars_by_member = np.empty_like(start), list[dict[str, Floats]]()
    for m, x in enumerate(start):
        values = solver.values(
            {n: per_member[n][m] if n in per_member else v for n, v in parameters.items()}, {}, start.shape[2:]
        )
        try:
            frames[:, m], x0_bar[m], parameter_bars = solver.backend.pullback(
                x, step_sizes[m], steps, width, bars[:, m], values, float(times[m])
            )
        except MissingExtraError:
            raise without_pullback(solver.interface) from None
        except BackendError as error:
            member_error = BackendError(error.status, error.step, error.states, () if single else (m,))
            raise solver.failure(member_error, step_sizes[m], None, values) from error
        bars_by_member.append(parameter_bars)
    bar = x0_bar.reshape(shape)
    result = frames.reshape(rows, *shape)
    all_bars = {
        name: np.array([parameter_bars[name] for parameter_bars in bars_by_member])
        if name in per_member
        else np.sum([parameter_bars[name] for parameter_bars in bars_by_member], axis=0)
        for name in solver.interface.parameters
    }
    if not bars_by_member:
        all_bars = {name: np.zeros(np.shape(parameters.get(name, 0.0))) for name in all_bars}
    return Pullback(result[-1] if stride is None else result, bar, all_bars)
