"""A solver on its way along one trajectory, step by step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self

import numpy as np

from phigen.runtime.interface import BackendError, Floats, Progress, row_steps

#: How often `rows_along` tells about its progress, at most.
_REPORTS = 200


class Course(Protocol):
    """A trajectory being computed, by whatever method: its state, and all that the next step depends on.

    A failing step raises `BackendError` and leaves the state before it.
    """

    @property
    def steps(self) -> int:
        """Good steps since the start."""
        ...

    def state(self) -> Floats:
        """A copy of the state (DIM,)."""
        ...

    def advance(self, h: float, steps: int) -> None:
        """Make so many steps."""
        ...

    def branch(self) -> Self:
        """An independent copy."""
        ...


class Followed(Course, Protocol):
    """A trajectory of a generated solver, with the time and the attitude that it keeps."""

    @property
    def rounding(self) -> float:
        """The spacing of the numbers it computes with, beside 1."""
        ...

    def time(self) -> float:
        """The physical time since the start, where steps are equal in τ and the solver keeps it; NaN elsewhere."""
        ...

    def element(self) -> Floats:
        """A copy of the numbers of the attitude, and of the position; none if they are not followed."""
        ...


class Session(Followed, Protocol):
    """A trajectory being computed by a generated solver.

    Steps are those of one integration, to the last bit, however they are split into calls.
    """

    def advance_along(self, h: float, increments: Floats) -> None:
        """Make a step with each row of increments of the noise (steps, draws), in place of random ones."""
        ...

    def advance_tangent(self, h: float) -> Floats:
        """Make one step; its derivative (DIM, DIM). Raises `MissingExtraError` without the extra ``tangent``."""
        ...

    def placed(self, x: Floats) -> Self:
        """A copy of a session that stands at its start, moved to ``x`` (DIM,): what it holds fixed stays."""
        ...

    def place(self, x: Floats) -> None:
        """Stand at ``x`` (DIM,), with all else as it is; raises `BackendError` where that is not allowed."""
        ...

    def kick(self, change: Floats) -> None:
        """Move the state by ``change`` (DIM,), else as `place`."""
        ...

    def saved(self) -> bytes:
        """All there is to know, for `Backend.restored`."""
        ...


def rows_along(
    session: Course, h: float, steps: int, stride: int, progress: Progress | None, see: Callable[[int], object] = id
) -> Floats:
    """States (rows, DIM) after 0, stride, 2·stride, … steps and the last, of a session that stands at its start.

    ``see`` is told the number of each row when the session stands there. Raises `BackendError`, whose rows end with
    the last good state.
    """
    marks = row_steps(steps, stride)
    start = session.state()
    states = np.empty((len(marks), len(start)))
    states[0] = start
    see(0)
    report_every, reported = max(1, steps // _REPORTS), 0
    for row, mark in enumerate(marks.tolist()[1:], start=1):
        try:
            session.advance(h, mark - session.steps)
        except BackendError as error:
            good = session.steps
            kept = states[: len(row_steps(good, stride))].copy()
            # The last row of a trajectory is its last state, whether or not a stride ends there.
            kept[-1] = session.state()
            see(len(kept) - 1)
            raise BackendError(error.status, good, kept) from error
        states[row] = session.state()
        see(row)
        if progress and (mark - reported >= report_every or mark == steps):
            reported = mark
            progress(mark)
    return states
