"""Protocols of sessions: one trajectory that is computed step by step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, Self

import numpy as np

from phigen.runtime.interface import BackendError, Floats, Progress, row_steps

#: Largest number of progress reports of `rows_along`: their cost is then negligible.
_REPORTS = 200


class Course(Protocol):
    """A trajectory being computed by any method: its state, and all other data that the next step depends on.

    A failing step raises `BackendError` and leaves the state before it.
    """

    @property
    def steps(self) -> int:
        """The number of successful steps since the start."""
        ...

    def state(self) -> Floats:
        """Return a copy of the state (DIM,)."""
        ...

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps of size ``h``."""
        ...

    def branch(self) -> Self:
        """Return an independent copy."""
        ...


class Followed(Course, Protocol):
    """A `Course` of a generated solver, which additionally has a time and an attitude."""

    @property
    def rounding(self) -> float:
        """The machine epsilon of the solver's numbers: the distance from 1 to the next larger number."""
        ...

    def time(self) -> float:
        """Return the physical time since the start for steps equal in τ, which the solver sums up; else NaN."""
        ...

    def element(self) -> Floats:
        """Return a copy of the numbers of attitude and position; empty if the spec reconstructs neither."""
        ...


class Session(Followed, Protocol):
    """A trajectory being computed by a generated solver.

    The states have the same bits for every division of the steps into calls.
    """

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        """Replace all parameters; state, time, attitude and random numbers are unchanged.

        With a monitor, the energy level becomes −H. Raises `BackendError` for values that are not admissible.
        """
        ...

    def advance_along(self, h: float, increments: Floats) -> None:
        """Make one step for each row of ``increments`` (steps, draws), which replace the random increments of the
        noise."""
        ...

    def advance_tangent(self, h: float) -> Floats:
        """Make one step, and return its derivative (DIM, DIM).

        Raises `MissingExtraError` without the extra ``tangent``.
        """
        ...

    def interpolated(self, fractions: Sequence[float]) -> Floats | None:
        """Return states (fractions, DIM) at fractions of the last step, from its collocation polynomial.

        Fraction 0 is the start of the step. The states are far less accurate than steps, and serve to locate events.
        None if the method has no polynomial, or the last step does not lead to the present state.
        """
        ...

    def placed(self, x: Floats) -> Self:
        """Return a copy of a session at its start, with the state replaced by ``x`` (DIM,) and the same gauge."""
        ...

    def place(self, x: Floats) -> None:
        """Replace the state by ``x`` (DIM,); nothing else changes. Raises `BackendError` if ``x`` is not admissible."""
        ...

    def kick(self, change: Floats) -> None:
        """Add ``change`` (DIM,) to the state. Raises `BackendError` if the sum is not admissible."""
        ...

    def saved(self) -> bytes:
        """Return the session as bytes, for `Backend.restored`."""
        ...


def rows_along(
    session: Course, h: float, steps: int, stride: int, progress: Progress | None, see: Callable[[int], object] = id
) -> Floats:
    """Return the states (rows, DIM) after 0, stride, 2·stride, … steps and the last, of a session at its start.

    ``see`` is called with the number of each row while the session is at that row. Raises `BackendError`, whose rows
    end with the state before the failing step.
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
            good_steps = session.steps
            complete_rows = states[: len(row_steps(good_steps, stride))].copy()
            # The last row of a trajectory is its last state, whether or not a stride ends there.
            complete_rows[-1] = session.state()
            see(len(complete_rows) - 1)
            raise BackendError(error.status, good_steps, complete_rows) from error
        states[row] = session.state()
        see(row)
        if progress and (mark - reported >= report_every or mark == steps):
            reported = mark
            progress(mark)
    return states
