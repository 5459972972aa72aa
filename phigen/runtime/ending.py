"""Ends of runs between two steps: at a given time, or at a zero of a function of the state."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from phigen.runtime.crossings import CrossingFinder, Function
from phigen.runtime.interface import BackendError
from phigen.runtime.session import Followed
from phigen.runtime.timed import EQUAL, reached, steps_until

#: Function from a session after the last whole step to a session at the end and its number of steps from the start.
Finish = Callable[[Any], tuple[Any, float]]


#: Number of steps after the start within which a zero is ignored. A run that starts where another run stopped at a zero
#: is within rounding of the zero, and would otherwise stop at once.
START = 1e-9


@dataclass(frozen=True)
class End:
    """End of a run: after ``steps`` whole steps and, if ``part``, a part of a step, which ``finish`` makes.

    ``span`` is the time from the start to the end. ``stopped`` is true if a zero of a function ends the run.
    """

    steps: int
    finish: Finish
    span: float
    part: bool
    stopped: bool = False


def at_time(session: Followed, h: float, span: float) -> End:
    """Return the end of a run over a ``span`` of time; the session is at its start."""
    steps, left = steps_until(session, h, span)
    part = abs(left) > EQUAL * abs(span)

    def finish(last_session: Followed) -> tuple[Followed, float]:
        if not part:
            return last_session, float(steps)
        end_session, size = reached(last_session, h, left)
        return end_session, steps + size / h

    return End(steps, finish, span, part)


def after_steps(session: Followed, h: float, steps: int) -> End:
    """Return the end after a number of whole steps.

    The session is at its start, and is advanced to measure the time. If a step fails, the span is the time before that
    step.
    """
    with suppress(BackendError):  # the run itself will report the failure
        session.advance(h, steps)
    return End(steps, lambda here: (here, float(steps)), session.time(), part=False)


def where_zero(session: Followed, h: float, limit: int, g: Function, t0: float, *, timed: bool) -> End | None:
    """Return the end at the first zero of g after the start, in either direction; None if there is none in ``limit``
    steps.

    The session is at its start, and is advanced. The zero is located to round-off, by steps of the solver.
    """
    finder = CrossingFinder[Followed](g, h, t0, timed=timed, direction="both")
    try:
        for _ in finder.follow(session, limit, lambda: session.advance(h, 1)):
            for steps_at, end_session in finder.places:
                if steps_at > START:
                    clock = end_session.time()
                    span, steps = steps_at * h if math.isnan(clock) else clock, int(np.floor(steps_at))
                    return End(steps, _finish_at((end_session, steps_at)), span, steps_at > steps, stopped=True)
    except BackendError:  # the run itself will report the failure
        pass
    return None


def _finish_at(end: tuple[Followed, float]) -> Finish:
    return lambda here: end
