"""Ends of runs that may lie inside a step: at a given time, or at a zero of a function of the state."""

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

#: Function that makes the end of a run. It receives the session after the last whole step. It returns the session at
#: the end, and the number of steps from the start to the end.
Finish = Callable[[Any], tuple[Any, float]]


#: A zero within this number of steps after the start does not end a run. If a run starts at the zero at which an
#: earlier run stopped, rounding may put this zero slightly after the start.
START = 1e-9


@dataclass(frozen=True)
class End:
    """End of a run: ``steps`` whole steps and, if ``part`` is true, one shorter step, which ``finish`` makes.

    ``span`` is the time from the start to the end. ``stopped`` is true if a zero of a function ends the run.
    """

    steps: int
    finish: Finish
    span: float
    part: bool
    stopped: bool = False


def at_time(session: Followed, h: float, span: float) -> End:
    """Return the end of a run that takes the time ``span``; the session is at the start of the run."""
    steps, left = steps_until(session, h, span)
    part = abs(left) > EQUAL * abs(span)

    def finish(last_session: Followed) -> tuple[Followed, float]:
        if not part:
            return last_session, float(steps)
        end_session, size = reached(last_session, h, left)
        return end_session, steps + size / h

    return End(steps, finish, span, part)


def after_steps(session: Followed, h: float, steps: int) -> End:
    """Return the end of a run after a number of whole steps.

    The session, which is at the start of the run, is advanced to measure the time ``span`` of the run. If a step fails,
    ``span`` is the time before this step.
    """
    with suppress(BackendError):  # the run itself fails at this step too, and reports the error
        session.advance(h, steps)
    return End(steps, lambda here: (here, float(steps)), session.time(), part=False)


def where_zero(session: Followed, h: float, limit: int, g: Function, t0: float, *, timed: bool) -> End | None:
    """Return the end of a run at the first zero of g after the start; None if there is no zero within ``limit`` steps.

    The session, which is at the start of the run, is advanced. g may rise or fall through the zero, which is located to
    round-off by steps of the solver.
    """
    finder = CrossingFinder[Followed](g, h, t0, timed=timed, direction="both")
    try:
        for _ in finder.follow(session, limit, lambda: session.advance(h, 1)):
            for steps_at, end_session in finder.places:
                if steps_at > START:
                    clock = end_session.time()
                    span, steps = steps_at * h if math.isnan(clock) else clock, int(np.floor(steps_at))
                    return End(steps, _finish_at((end_session, steps_at)), span, steps_at > steps, stopped=True)
    except BackendError:  # the run itself fails at this step too, and reports the error
        pass
    return None


def _finish_at(end: tuple[Followed, float]) -> Finish:
    return lambda here: end
