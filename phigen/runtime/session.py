"""Types of sessions, as `typing.Protocol` classes. A session computes one trajectory step by step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, Self

import numpy as np

from phigen.runtime.interface import BackendError, Floats, Progress, row_steps

#: Largest number of calls of ``progress`` in a run, so that their cost is negligible.
_REPORTS = 200


class Course(Protocol):
    """A trajectory being computed by any method: its state, and all further data that the next step depends on.

    If a step fails, `BackendError` is raised, and the state before the step remains.
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
        """Return an independent copy; further steps of copy and original have equal results."""
        ...


class Followed(Course, Protocol):
    """A `Course` of a generated solver: a trajectory that also has a time and, if the spec reconstructs one, an
    attitude."""

    @property
    def rounding(self) -> float:
        """The machine epsilon of the solver's numbers: the distance from 1 to the next larger number."""
        ...

    def time(self) -> float:
        """Return the physical time since the start if there is a monitor; else NaN.

        Without a monitor, the time follows from the number of steps.
        """
        ...

    def element(self) -> Floats:
        """Return a copy of the components of the reconstructed attitude and position.

        The array is empty if the spec reconstructs neither.
        """
        ...


class Session(Followed, Protocol):
    """A trajectory being computed by a generated solver.

    The bits of the states do not depend on how the steps are divided into calls of `advance`.
    """

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        """Replace all parameters; state, time, attitude and random numbers are unchanged.

        With a monitor, the energy level e becomes −H of the state. Raises `BackendError` for values that are not
        admissible.
        """
        ...

    def advance_along(self, h: float, increments: Floats) -> None:
        """Make one step for each row of ``increments`` (steps, draws), which replace the random increments of the
        noise."""
        ...

    def advance_tangent(self, h: float) -> Floats:
        """Make one step, and return its derivative (DIM, DIM).

        Raises `MissingExtraError` if the solver was compiled without ``tangent``.
        """
        ...

    def interpolated(self, fractions: Sequence[float]) -> Floats | None:
        """Return states (fractions, DIM) inside the last step, from the polynomial of a collocation method.

        Fraction 0 is the start of the step, fraction 1 its end. These states are far less accurate than the states
        after steps; use them only to locate events. Returns None if the method has no polynomial, or if the state was
        changed after the last step.
        """
        ...

    def placed(self, x: Floats) -> Self:
        """Return a copy of this session with the state ``x`` (DIM,). This session must not have made a step
        yet.

        The gauge (the multiples of Casimirs that are subtracted from H) is not chosen again for x.
        """
        ...

    def place(self, x: Floats) -> None:
        """Replace the state by ``x`` (DIM,); time, step number and parameters are unchanged.

        With a monitor, the energy level e becomes −H(x). Raises `BackendError` if ``x`` is not admissible.
        """
        ...

    def kick(self, change: Floats) -> None:
        """Add ``change`` (DIM,) to the state. Raises `BackendError` if the sum is not admissible."""
        ...

    def saved(self) -> bytes:
        """Return the session as bytes, from which `Backend.restored` makes the session again."""
        ...


def rows_along(
    session: Course, h: float, steps: int, stride: int, progress: Progress | None, see: Callable[[int], object] = id
) -> Floats:
    """Advance a session from its start by ``steps`` steps, and return the states (rows, DIM) at the rows.

    Rows are after 0, stride, 2·stride, … steps, and after the last step. ``see`` is called with the number of each row
    while the session is at that row. Raises `BackendError`, whose ``states`` end with the state before the failing
    step.
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
            # The last row is the state before the failing step, even if the number of steps before it is no multiple of
            # the stride.
            complete_rows[-1] = session.state()
            see(len(complete_rows) - 1)
            raise BackendError(error.status, good_steps, complete_rows) from error
        states[row] = session.state()
        see(row)
        if progress and (mark - reported >= report_every or mark == steps):
            reported = mark
            progress(mark)
    return states
