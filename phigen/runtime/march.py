"""Long integrations in pieces: what came after each piece can be stored, drawn or interrupted."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from phigen.runtime.crossings import CrossingFinder
from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.session import Session
from phigen.runtime.timed import EQUAL, reached, steps_until

#: Seconds, steps and rows that a piece has at most, about.
_SECONDS = 0.2
_MOST_STEPS, _MOST_ROWS = 1 << 20, 1 << 12


@dataclass(frozen=True)
class Piece:
    """What a piece of an integration gave: the stored steps and their states, and crossings of the section.

    ``numbers`` (rows,), of steps, with a fraction between two; ``x`` (rows, DIM), ``crossings`` as pairs of time and
    state (DIM,). ``passed`` (rows,) is the physical time of each where the solver keeps it, NaN elsewhere. ``turned``
    (rows, numbers) are their attitudes.
    """

    numbers: Floats
    x: Floats
    crossings: list[tuple[float, Floats]]
    passed: Floats
    turned: Floats


#: The physical time of a row, and the numbers of its attitude.
Mark = tuple[float, Floats]


def march(
    session: Session,
    h: float,
    steps: int,
    stride: int,
    finder: CrossingFinder[Session] | None = None,
    see_tangent: Callable[[Floats], None] | None = None,
    *,
    begun: bool = False,
) -> Iterator[Piece]:
    """Go on with a session until ``steps`` steps of size h are made, storing every ``stride``-th state and the last.

    Pieces end somewhere; the rows do not depend on where. With ``see_tangent``, the derivative (DIM, DIM) of each step
    is told; ``begun`` says that the initial state has been given before. Raises `BackendError` after a piece that ends
    with the last good state.
    """
    size = 1
    if not begun:
        yield standing(session, 0.0)
    while session.steps < steps:
        start = time.perf_counter()
        rows: dict[int, tuple[Floats, Mark]] = {}
        crossings: list[tuple[float, Floats]] = []
        failure = None
        try:
            for number, states, marks, found in _states(
                session, h, min(steps, session.steps + size), stride, finder, see_tangent
            ):
                crossings += found
                here = zip(states, marks, strict=False)
                rows |= {number + k: row for k, row in enumerate(here) if (number + k) % stride == 0}
        except BackendError as error:
            failure = error
        if session.steps == steps or (failure and session.steps):
            rows[session.steps] = session.state(), (session.time(), session.element())
        x = np.array([state for state, _ in rows.values()]).reshape(len(rows), len(session.state()))
        passed = np.array([time for _, (time, _) in rows.values()])
        turned = np.array([element for _, (_, element) in rows.values()]).reshape(len(rows), len(session.element()))
        yield Piece(np.array(list(rows), dtype=np.float64), x, crossings, passed, turned)
        if failure:
            raise failure
        quick = time.perf_counter() - start < _SECONDS
        size = min(2 * size, _MOST_STEPS, _MOST_ROWS * stride) if quick else max(1, size // 2)


def standing(session: Session, number: float) -> Piece:
    """A piece of one row, where a session stands, so many steps from the start."""
    return _piece([(session, number)], len(session.state()), len(session.element()))


def _piece(
    rows: Sequence[tuple[Session, float]], width: int, element: int, crossings: Sequence[tuple[float, Floats]] = ()
) -> Piece:
    x = np.array([here.state() for here, _ in rows]).reshape(-1, width)
    turned = np.array([here.element() for here, _ in rows]).reshape(len(rows), element)
    passed = np.array([here.time() for here, _ in rows])
    return Piece(np.array([n for _, n in rows]), x, list(crossings), passed, turned)


def march_at(
    session: Session,
    h: float,
    steps: int,
    spans: Sequence[float],
    finder: CrossingFinder[Session] | None = None,
    see_tangent: Callable[[Floats], None] | None = None,
) -> Iterator[Piece]:
    """Go on with a session, storing the states at given times after the start in place of every ``stride``-th.

    Each is one further step, part of a whole one, from the session, which makes whole steps only; ``see_tangent`` is
    told the derivatives of these. ``spans`` are those still to come; whole steps beyond the last are made without a
    row. Raises `BackendError` after a piece.
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
            for _, found in finder.follow(session, count, move):
                crossings.extend(found)
        elif see_tangent:
            for _ in range(count):
                move()
        else:
            session.advance(h, count)

    begun, failure = time.perf_counter(), None
    for span in spans:
        try:
            here, number = _there(session, h, steps, span, advance)
        except BackendError as error:
            failure = error
            break
        rows.append((here.branch(), number))
        if time.perf_counter() - begun > _SECONDS or len(rows) == _MOST_ROWS:
            yield _piece(rows, *sizes, crossings)
            begun, rows = time.perf_counter(), []
            crossings.clear()
    yield _piece(rows, *sizes, crossings)
    if failure:
        raise failure
    while session.steps < steps:
        crossings.clear()
        advance(min(_MOST_STEPS, steps - session.steps))
        yield _piece([], *sizes, crossings)


def _there(
    session: Session, h: float, steps: int, span: float, advance: Callable[[int], object]
) -> tuple[Session, float]:
    """A session at a time after the start, and how many steps that is; the given one makes the whole steps before."""
    own = session.time()
    passed = session.steps * h if np.isnan(own) else own
    count, _ = steps_until(session, h, span - passed)
    advance(min(count, steps - session.steps))
    left = span - (session.steps * h if np.isnan(own) else session.time())
    if abs(left) <= EQUAL * abs(span):
        return session, float(session.steps)
    there, size = reached(session, h, left)
    return there, session.steps + size / h


def _states(
    session: Session,
    h: float,
    target: int,
    stride: int,
    finder: CrossingFinder[Session] | None,
    see_tangent: Callable[[Floats], None] | None,
) -> Iterator[tuple[int, Sequence[Floats] | Floats, Sequence[Mark], list[tuple[float, Floats]]]]:
    """The number of a step, its state and mark and those of the steps after it, and crossings; nothing is left out."""
    marks: list[Mark] = []

    def move() -> None:
        if see_tangent:
            see_tangent(session.advance_tangent(h))
        else:
            session.advance(h, 1)
        marks.append((session.time(), session.element()))

    if finder:
        for states, found in finder.follow(session, target - session.steps, move):
            yield session.steps - len(states) + 1, states, marks, found
            marks.clear()
        return
    done = session.steps
    while done < target:
        count = 1 if see_tangent else min(target, done + stride - done % stride) - done
        if see_tangent:
            move()
        else:
            session.advance(h, count)
        done += count
        yield done, [session.state()], [(session.time(), session.element())], []
