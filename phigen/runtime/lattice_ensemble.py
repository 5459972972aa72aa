"""Ensembles of lattices whose members have different states, steps and parameters; members are divided among
threads."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.errors import StepError
from phigen.memory import filled
from phigen.runtime import arguments
from phigen.runtime.interface import BackendError, Draws, Floats, LatticeInterface, row_steps
from phigen.runtime.members import cores, in_threads

if TYPE_CHECKING:
    from phigen.runtime.lattice import LatticeSolver


def ensemble(
    solver: LatticeSolver,
    X0: ArrayLike,
    h: ArrayLike,
    steps: int,
    stride: int | None,
    threads: int | None,
    parameters: Mapping[str, Any],
    t0: Floats,
    draws: Draws,
) -> Floats:
    """Check the arguments of `LatticeSolver.ensemble`, and compute its result."""
    per_member = {
        name: np.asarray(value) for name, value in parameters.items() if has_members(solver.interface, name, value)
    }
    per_member |= {
        argument: np.asarray(v) for argument, v in (("the step size h", h), ("the times t0", t0)) if np.ndim(v)
    }
    start = states(solver, X0, per_member)
    count, steps = len(start), arguments.count(steps, "steps", 0)
    marks = row_steps(steps, max(steps, 1) if stride is None else arguments.count(stride, "stride", 1))
    begin = np.broadcast_to(t0, count).tolist()
    sizes = [arguments.step_size(size) for size in np.broadcast_to(h, count)]
    parameters = {**parameters, **solver.defaults(parameters, start.shape[2:])}  # computed once for all members
    values = [
        solver.values(
            {n: per_member[n][m] if n in per_member else v for n, v in parameters.items()}, {}, start.shape[2:]
        )
        for m in range(count)
    ]
    frames, failures = filled(f"{len(marks)} frames of {count} members", (len(marks), *start.shape)), dict[int, str]()
    frames[0] = final = start.copy()

    def make(m: int) -> None:
        try:
            session = solver.backend.start(start[m], values[m], begin[m], replace(draws, member=draws.member + m))
            for row, ahead in enumerate(np.diff(marks), 1):
                session.advance(sizes[m], int(ahead))
                final[m] = frames[row, m] = session.state()
        except BackendError as error:
            failures[m] = error.status
            final[m] = error.states[-1]

    max_threads = cores() if threads is None else arguments.count(threads, "threads", 1)
    uses_all_threads = solver.interface.is_shared(
        math.prod(start.shape[2:])
    )  # if true, members are integrated one after another, each by all threads
    in_threads(1 if uses_all_threads else max(1, min(max_threads, count)), make, range(count))
    states_or_frames = final if stride is None else frames
    if failures:
        failed = tuple(sorted(failures))
        listing = ", ".join(map(str, failed[:5])) + (", …" if len(failed) > 5 else "")
        m, status = failed[0], failures[failed[0]]
        message = (
            f"{solver.interface.name}: a step failed for {len(failed)} member(s) of the ensemble ({listing}): {status}"
        )
        numbers = dict(zip(solver.coordinates, start[m], strict=True)) | values[m] | {"the step h": sizes[m]}
        if beyond_range := solver.interface.single and arguments.beyond_single(numbers):
            message += f", {beyond_range}"
        raise StepError(message, step=-1, status=status, trajectory=states_or_frames, members=failed)
    return states_or_frames


def has_members(interface: LatticeInterface, name: str, value: Any) -> bool:
    """Whether the value of a parameter has a first axis of members, before its axes of sites or bonds."""
    if interface.graph and name == "bonds":
        return False
    axes = len(interface.axes) if name in interface.at_sites else 1 if name in interface.at_bonds else 0
    return bool(np.ndim(value) == 1 + axes)


def states(solver: LatticeSolver, X0: ArrayLike, per_member: Mapping[str, Any], argument: str = "X0") -> Floats:
    """Return the initial states (members, coordinates, *sizes) from ``X0``. Raises `ValueError` for other
    shapes.

    ``per_member`` maps the names of other arguments with an axis of members to their values. If there are any, ``X0``
    may be one state, from which all members start.
    """
    axes = 1 + len(solver.interface.axes)
    member_states: Iterable[Floats]
    if np.ndim(X0) == axes and per_member:
        count, member_states = len(next(iter(per_member.values()))), repeat(solver.state(X0, argument))
    elif np.ndim(X0) == 1 + axes:
        count, member_states = len(np.asarray(X0)), (solver.state(x, argument) for x in np.asarray(X0))
    else:
        raise ValueError(f"{argument} must have shape (members, {solver.shape_text()}), not {np.shape(X0)}")
    start = filled(f"the states of {count} members", (count, *np.shape(X0)[-axes:]))
    for m, x in zip(range(count), member_states, strict=False):
        start[m] = x
    for name, value in per_member.items():
        if len(value) != len(start):
            raise ValueError(f"{name} has {len(value)} members, not {len(start)}")
    return start
