"""Runs that do not end with a whole step: at a given time, or where a function of the state passes through zero."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from phigen.runtime.crossings import CrossingFinder, Function
from phigen.runtime.interface import BackendError
from phigen.runtime.session import Session
from phigen.runtime.timed import EQUAL, reached, steps_until

#: From a session after the whole steps to one at the end, and how many steps that is from the start.
Finish = Callable[[Session], tuple[Session, float]]


#: Steps within which a zero is that of the start: where a run was stopped, rounding has one beside it.
START = 1e-9


@dataclass(frozen=True)
class End:
    """An end after so many whole ``steps``, and a ``part`` of one, which ``finish`` makes.

    ``span`` is the time from the start. It was ``stopped`` where a function vanishes, not at a time.
    """

    steps: int
    finish: Finish
    span: float
    part: bool
    stopped: bool = False


def at_time(session: Session, h: float, span: float) -> End:
    """The end after a span of time, of a session that stands at its start."""
    steps, left = steps_until(session, h, span)
    part = abs(left) > EQUAL * abs(span)

    def finish(here: Session) -> tuple[Session, float]:
        if not part:
            return here, float(steps)
        there, size = reached(here, h, left)
        return there, steps + size / h

    return End(steps, finish, span, part)


def after_steps(session: Session, h: float, steps: int) -> End:
    """The end after so many whole steps, of a session that tells their time: it stands at its start, and goes on.

    Where one fails, the time is that before it.
    """
    with suppress(BackendError):  # which the run itself will tell
        session.advance(h, steps)
    return End(steps, lambda here: (here, float(steps)), session.time(), part=False)


def where_zero(session: Session, h: float, most: int, g: Function, t0: float, *, timed: bool) -> End | None:
    """Where g passes through zero first after the start, in either direction; None if that is not within so many steps.

    The session stands at its start, and goes on. The end is located by steps of the solver, to round-off.
    """
    finder = CrossingFinder[Session](g, h, t0, timed=timed, direction="both")
    try:
        for _ in finder.follow(session, most, lambda: session.advance(h, 1)):
            for at, there in finder.places:
                if at > START:
                    own = there.time()
                    span, steps = at * h if math.isnan(own) else own, int(np.floor(at))
                    return End(steps, _given((there, at)), span, at > steps, stopped=True)
    except BackendError:  # which the run itself will tell
        pass
    return None


def _given(end: tuple[Session, float]) -> Finish:
    return lambda here: end
