"""States at given times, each reached by one shorter step of the same method from a nearby state.

A step of any size is a Poisson map and keeps the Casimirs. With a monitor (rescaled time: dt = g dτ), steps have a
given size in τ; the secant method finds the size in τ of the step that ends at a given time t, up to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self, TypeVar

import numpy as np

from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.session import Session


class Clocked(Protocol):
    """Interface of sessions that this module needs; `phigen.runtime.session.Followed` documents the methods."""

    @property
    def steps(self) -> int: ...
    @property
    def rounding(self) -> float: ...
    def state(self) -> Floats: ...
    def time(self) -> float: ...
    def advance(self, h: float, steps: int) -> None: ...
    def branch(self) -> Self: ...


C = TypeVar("C", bound=Clocked)

#: Largest number of iterations of the secant method for a step size; four to seven are usual.
MAX_SECANTS = 30
#: Two times count as equal if their relative difference is at most this number of machine epsilons.
_ROUNDINGS = 8
EQUAL = float(_ROUNDINGS * np.finfo(float).eps)


def reached(session: C, h: float, span: float) -> tuple[C, float]:
    """Return a copy of a session after one step that takes the time ``span``, and the size of this step.

    The size is in τ if a monitor rescales the time. The search for the size begins with ``h``, the size of a usual
    step. Raises `BackendError`.
    """
    if not np.isfinite(session.time()):
        return _moved(session, span), span
    begin = session.time()
    target = begin + span
    rounded = _ROUNDINGS * session.rounding * max(abs(begin), abs(span))
    size, lower_size, missed_before = h, 0.0, -span
    while True:  # the step is halved until it succeeds
        try:
            copy = _moved(session, size)
            break
        except BackendError:
            size /= 2
            if abs(size) < 1e-3 * abs(h):
                raise
    missed = copy.time() - target
    for _ in range(MAX_SECANTS):
        if missed == 0 or size == lower_size or missed == missed_before:
            break
        following = size - missed * (size - lower_size) / (missed - missed_before)
        if abs(following - size) <= 1e-16 * abs(size):
            break
        try:
            candidate = _moved(session, following)
        except BackendError:
            break
        ahead = candidate.time() - target
        if abs(ahead) >= abs(missed) and abs(missed) <= rounded:
            break
        lower_size, missed_before = size, missed
        size, missed, copy = following, ahead, candidate
    if abs(missed) > max(1e-9 * max(abs(begin), abs(span)), rounded):
        raise BackendError("NO_CONVERGENCE", session.steps, session.state()[np.newaxis])
    return copy, size


def steps_until(session: Clocked, h: float, span: float) -> tuple[int, float]:
    """Return the number of whole steps of size h that fit into the time ``span``, and the remaining time.

    If a step within the span fails, the number includes this step. So the step fails again when the caller makes it.
    """
    if not np.isfinite(session.time()):
        whole_count = whole_steps(h, span)
        return whole_count, span - whole_count * h
    target, steps_done, chunk, growing, last_session = session.time() + span, 0, 1, True, session
    while chunk:
        copy = last_session.branch()
        try:
            copy.advance(h, chunk)
        except BackendError:
            if chunk == 1:
                return steps_done + 1, 0.0
            overshoots = True
        else:
            overshoots = (target - copy.time()) * np.sign(span) < 0
        if overshoots:
            chunk, growing = chunk // 2, False
        else:
            last_session, steps_done = copy, steps_done + chunk
            chunk = 2 * chunk if growing else chunk
    return steps_done, target - last_session.time()


def along_until(session: C, h: float, span: float, stride: int, see: Callable[[C, float], object]) -> None:
    """Advance a session by the time ``span``, in steps of size h; the last step is shortened.

    ``see`` is called at the start, at every stride-th step, and at the end. Its arguments are the session, and h times
    the number of steps made so far. Raises `BackendError`.
    """
    see(session, 0.0)
    steps_done = 0
    if not np.isfinite(session.time()):
        whole_count = whole_steps(h, span)
        while steps_done < whole_count:
            count = min(stride - steps_done % stride, whole_count - steps_done)
            session.advance(h, count)
            steps_done += count
            if steps_done % stride == 0:
                see(session, steps_done * h)
        left = span - steps_done * h
    else:
        chunk, growing = 1, True
        while chunk:
            chunk = min(chunk, stride - steps_done % stride)
            copy = session.branch()
            copy.advance(h, chunk)
            if (span - copy.time()) * np.sign(span) < 0:  # the copy is past the end
                chunk, growing = chunk // 2, False
                continue
            session, steps_done = copy, steps_done + chunk
            chunk = 2 * chunk if growing else chunk
            if steps_done % stride == 0:
                see(session, steps_done * h)
        left = span - session.time()
    if abs(left) <= EQUAL * abs(span):
        if steps_done % stride:
            see(session, steps_done * h)
        return
    end, size = reached(session, h, left)
    see(end, steps_done * h + size)


def states_at(session_at: Callable[[int], Session], t: Floats, x: Floats, h: float, times: Floats) -> Floats:
    """Return the states (times, DIM) of a trajectory at the given ``times``.

    The rows of the trajectory have the times ``t`` and the states ``x``. Each state is computed from the nearest row,
    by steps of size h or −h and a shorter last step. ``session_at(k)`` returns a session at row k. Raises
    `BackendError`.
    """
    states = np.empty((len(times), x.shape[1]))
    for k, time in enumerate(np.asarray(times, dtype=np.float64).tolist()):
        row = int(np.argmin(np.abs(t - time)))
        span = time - float(t[row])
        states[k] = x[row]
        if span:
            states[k] = moved_on(session_at(row), h, span).state()
    return states


def advance_by(span: float, h: float, advance: Callable[[float, int], object]) -> None:
    """Make steps over the time ``span``: whole steps of size h, then a shorter step.

    The steps must be equal in time, as they are without a monitor.
    """
    step = float(np.copysign(h, span))
    whole_count = whole_steps(step, span)
    advance(step, whole_count)
    left = span - whole_count * step
    if abs(left) > EQUAL * abs(span):
        advance(left, 1)


def moved_on(session: C, h: float, span: float) -> C:
    """Return a session at the time ``span`` after the state of ``session``, by whole steps and a shorter last
    step.

    Raises `BackendError`.
    """
    step = np.copysign(h, span)
    if not np.isfinite(session.time()):
        advance_by(span, h, session.advance)
        return session
    while True:
        copy = session.branch()
        try:
            copy.advance(step, 1)
        except BackendError:
            break
        if abs(copy.time()) > abs(span):
            break
        session = copy
    left = span - session.time()
    return reached(session, step, left)[0] if left else session


def whole_steps(h: float, span: float) -> int:
    """Return the number of whole steps that fit into a span of time. The last step may exceed the span by rounding
    errors.
    """
    ratio = span / h
    return round(ratio) if abs(ratio - round(ratio)) <= 1e-12 * max(1.0, abs(ratio)) else max(0, int(np.floor(ratio)))


def _moved(session: C, size: float) -> C:
    copy = session.branch()
    copy.advance(size, 1)
    return copy
