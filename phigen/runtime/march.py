"""Long integrations that yield their rows in pieces. After each piece the caller can store or draw rows, or end the
run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from phigen.runtime.crossings import CrossingFinder
from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.session import Session
from phigen.runtime.timed import EQUAL, reached, steps_until

#: The rows of a run are yielded in pieces. A piece ends after about _SECONDS seconds, so that the user sees progress. A
#: piece ends earlier if it has _MOST_STEPS steps or _MOST_ROWS rows.
_SECONDS = 0.2
_MOST_STEPS, _MOST_ROWS = 1 << 20, 1 << 12

#: Largest number of steps that one call makes. A call takes some microseconds more than its steps, so calls of a few
#: hundred cheap steps would cost time; during a call, a run cannot be interrupted.
_CALL_STEPS = 1 << 12


@dataclass(frozen=True)
class Piece:
    """A piece of an integration: its rows, and the crossings of a section that occurred in it.

    ``numbers`` (rows,) are the numbers of steps since the start, with a fraction for a state inside a step. ``x``
    (rows, DIM) are the states. ``crossings`` are pairs of a time and a state (DIM,). ``passed`` (rows,) is the physical
    time since the start if there is a monitor, and NaN otherwise. A row of ``turned`` has the components of an attitude
    and a position.
    """

    numbers: Floats
    x: Floats
    crossings: list[tuple[float, Floats]]
    passed: Floats
    turned: Floats


#: Data of a row besides the state: the physical time since the start (NaN without a monitor), and the components of the
#: reconstructed attitude and position.
Mark = tuple[float, Floats]


def march(
    session: Session,
    h: float,
    steps: int,
    stride: int,
    finder: CrossingFinder[Session] | None = None,
    see_tangent: Callable[[Floats], None] | None = None,
    *,
    is_started: bool = False,
    goes_on: bool = False,
) -> Iterator[Piece]:
    """Advance a session until it has made ``steps`` steps of size h. Yield every ``stride``-th state and the last, in
    pieces.

    The length of a piece depends on the speed of the machine. The rows do not depend on the speed: `_call_end` chooses
    the ends of calls by step numbers alone. ``is_started`` is true if the initial state was yielded before. ``goes_on``
    is true if a shorter step will follow. Then the state after the last whole step is yielded only if it is a
    ``stride``-th state. ``see_tangent`` receives the derivative (DIM, DIM) of each step. If a step fails,
    `BackendError` is raised after a piece that ends with the state before that step.
    """
    size = 1
    if not is_started:
        yield standing(session, 0.0)
    while session.steps < steps:
        start = time.perf_counter()
        rows: dict[int, tuple[Floats, Mark]] = {}
        crossings: list[tuple[float, Floats]] = []
        failure = None
        try:
            for number, states, marks, met in _states(
                session, h, steps, min(steps, session.steps + size), stride, finder, see_tangent
            ):
                crossings += met
                marked_states = zip(states, marks, strict=False)
                rows |= {number + k: row for k, row in enumerate(marked_states) if (number + k) % stride == 0}
        except BackendError as error:
            failure = error
        if (session.steps == steps and not goes_on) or (failure and session.steps):
            rows[session.steps] = session.state(), (session.time(), session.element())
        x = np.array([state for state, _ in rows.values()]).reshape(len(rows), len(session.state()))
        times = np.array([time for _, (time, _) in rows.values()])
        turned = np.array([element for _, (_, element) in rows.values()]).reshape(len(rows), len(session.element()))
        yield Piece(np.array(list(rows), dtype=np.float64), x, crossings, times, turned)
        if failure:
            raise failure
        quick = time.perf_counter() - start < _SECONDS
        size = min(2 * size, _MOST_STEPS, _MOST_ROWS * stride) if quick else max(1, size // 2)


def standing(session: Session, number: float) -> Piece:
    """Return a `Piece` with one row: the present state of a session, ``number`` steps after the start."""
    return _piece_of_rows([(session, number)], len(session.state()), len(session.element()))


def _piece_of_rows(
    rows: Sequence[tuple[Session, float]], width: int, element: int, crossings: Sequence[tuple[float, Floats]] = ()
) -> Piece:
    x = np.array([session.state() for session, _ in rows]).reshape(-1, width)
    turned = np.array([session.element() for session, _ in rows]).reshape(len(rows), element)
    times = np.array([session.time() for session, _ in rows])
    return Piece(np.array([n for _, n in rows]), x, list(crossings), times, turned)


def march_at(
    session: Session,
    h: float,
    steps: int,
    spans: Sequence[float],
    finder: CrossingFinder[Session] | None = None,
    see_tangent: Callable[[Floats], None] | None = None,
) -> Iterator[Piece]:
    """Advance a session until it has made ``steps`` steps. Yield the states at the times ``spans`` after the start, in
    pieces.

    The session makes whole steps. To reach a state inside a step, a copy of the session makes a shorter step.
    ``see_tangent`` receives the derivatives of the whole steps. Steps after the last time yield pieces without rows. If
    a step fails, `BackendError` is raised after the piece with the states before that step.
    """
    sizes = len(session.state()), len(session.element())
    rows: list[tuple[Session, float]] = []
    crossings: list[tuple[float, Floats]] = []

    def move() -> None:
        if see_tangent:
            see_tangent(session.advance_tangent(h))
        else:
            session.advance(h, 1)

    def advance(count: int) -> None:
        if finder:
            for _, met in finder.follow(session, count, move):
                crossings.extend(met)
        elif see_tangent:
            for _ in range(count):
                move()
        else:
            session.advance(h, count)

    started_at, failure = time.perf_counter(), None
    for span in spans:
        try:
            row_session, number = _session_at_time(session, h, steps, span, advance)
        except BackendError as error:
            failure = error
            break
        rows.append((row_session.branch(), number))
        if time.perf_counter() - started_at > _SECONDS or len(rows) == _MOST_ROWS:
            yield _piece_of_rows(rows, *sizes, crossings)
            started_at, rows = time.perf_counter(), []
            crossings.clear()
    yield _piece_of_rows(rows, *sizes, crossings)
    if failure:
        raise failure
    while session.steps < steps:
        crossings.clear()
        advance(min(_MOST_STEPS, steps - session.steps))
        yield _piece_of_rows([], *sizes, crossings)


def _session_at_time(
    session: Session, h: float, steps: int, span: float, advance: Callable[[int], object]
) -> tuple[Session, float]:
    """Return a session at the time ``span`` after the start, and the number of steps from the start to this time, with
    a fraction if the time is inside a step.

    ``advance(n)`` makes n whole steps with ``session``; it is called for the whole steps before that time.
    """
    clock = session.time()
    elapsed = session.steps * h if np.isnan(clock) else clock
    count, _ = steps_until(session, h, span - elapsed)
    advance(min(count, steps - session.steps))
    left = span - (session.steps * h if np.isnan(clock) else session.time())
    if abs(left) <= EQUAL * abs(span):
        return session, float(session.steps)
    row_session, size = reached(session, h, left)
    return row_session, session.steps + size / h


def _call_end(steps_done: int, stride: int, steps: int) -> int:
    """Return the number of steps after the call that follows ``steps_done`` steps, in a run of ``steps`` steps.

    The C solves blocks of successive steps together, and the number of steps in a call decides which steps form a
    block. So the rounding errors of the states depend on the ends of calls. These ends are functions of the step
    numbers only: multiples of ``stride``, and points between them at distances of `_CALL_STEPS` steps.
    """
    since_row = steps_done % stride
    return min(steps, steps_done + min(stride - since_row, _CALL_STEPS - since_row % _CALL_STEPS))


def _states(
    session: Session,
    h: float,
    steps: int,
    target: int,
    stride: int,
    finder: CrossingFinder[Session] | None,
    see_tangent: Callable[[Floats], None] | None,
) -> Iterator[tuple[int, Sequence[Floats] | Floats, Sequence[Mark], list[tuple[float, Floats]]]]:
    """Advance a session until it has made at least ``target`` steps of a run of ``steps`` steps. For each block, yield
    (number, states, marks, crossings).

    There are more than ``target`` steps only if `_call_end` requires it.

    The number is the step number of the first state. There is one `Mark` for each state. With a finder or with
    ``see_tangent``, the state after each step is yielded. Otherwise only the states after every ``stride``-th step and
    after the last step are yielded.
    """
    marks: list[Mark] = []

    def move() -> None:
        if see_tangent:
            see_tangent(session.advance_tangent(h))
        else:
            session.advance(h, 1)
        marks.append((session.time(), session.element()))

    if finder:
        for states, met in finder.follow(session, target - session.steps, move):
            yield session.steps - len(states) + 1, states, marks, met
            marks.clear()
        return
    steps_done = session.steps
    while steps_done < target:
        count = 1 if see_tangent else _call_end(steps_done, stride, steps) - steps_done
        if see_tangent:
            move()
        else:
            session.advance(h, count)
        steps_done += count
        yield steps_done, [session.state()], [(session.time(), session.element())], []
