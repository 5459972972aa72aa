"""Runs that a spec names, for `Solver.run` and `LatticeSolver.run`: their settings, ends and rows.

`changed` returns a run of a spec with other settings. `rows_of` integrates two kinds of runs of ordinary systems, for
which `Solver.integrate` has no arguments: runs that stop at a zero of a function, and runs with rows at given times.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from phigen.runtime import arguments
from phigen.runtime.crossings import Function
from phigen.runtime.ending import End, after_steps, at_time, where_zero
from phigen.runtime.session import Followed, Session
from phigen.runtime.timed import EQUAL, reached, steps_until
from phigen.spec import limits
from phigen.spec.model import Run, Spec
from phigen.spec.problems import did_you_mean
from phigen.spec.runs import with_step


@dataclass(frozen=True)
class Settings:
    """Settings that replace the settings of a run of the spec. A field that is None replaces nothing."""

    step: float | None = None
    steps: int | None = None
    until: float | None = None
    stride: int | None = None
    every: float | None = None
    sizes: Sequence[int] | None = None
    at: Sequence[float] | None = None


def run_named(spec: Spec | None, name: str | None) -> Run:
    """Return the run of the spec with the given name, by default the first run.

    Raises `ValueError` if there is no run of that name, or if the solver was made without a spec.
    """
    if spec is None or not spec.runs:
        raise ValueError("the spec of this solver has no runs; solver.integrate takes a start and a step")
    if name is None:
        return next(iter(spec.runs.values()))
    if name not in spec.runs:
        hint = did_you_mean(name, spec.runs)
        names = ", ".join(spec.runs)
        raise ValueError(f"there is no run {name!r}; the spec has {names}" + (f"; {hint}" if hint else ""))
    return spec.runs[name]


def changed(spec: Spec, run: Run, settings: Settings) -> Run:
    """Return the run with other settings. A setting that is None leaves the setting of the spec as it is.

    Raises `ValueError` for invalid settings, and `TypeError` for settings that exclude each other.
    """
    if settings.steps is not None and settings.until is not None:
        raise TypeError("a run takes either steps or until, not both")
    rows = [n for n in ("stride", "every", "at") if getattr(settings, n) is not None]
    if len(rows) > 1:
        raise TypeError(f"a run takes either {rows[0]} or {rows[1]}, not both")
    if settings.steps is not None:
        steps = arguments.count(settings.steps, "steps", 1, limits.STEPS)
        run = replace(run, steps=steps, stride=min(run.stride, steps), duration=None, until=None)
    if settings.until is not None:
        run = replace(run, until=_number(settings.until, "until"), duration=None)
    if settings.step is not None:
        step = Fraction(arguments.step_size(settings.step))
        run = with_step(run, step, parts=spec.monitor is None)
    if run.until is not None and (run.until - run.start) / run.step <= 0:
        raise ValueError(f"until = {float(run.until)!r} is never reached by steps of {float(run.step)!r}")
    if settings.stride is not None:
        run = replace(run, stride=arguments.count(settings.stride, "stride", 1), every=None, at=())
    if settings.every is not None:
        every = _number(settings.every, "every")
        if every <= 0:
            raise ValueError(f"every = {settings.every!r} is not positive")
        run = replace(run, every=every, at=())
    if settings.at is not None:
        known_end = run.stop is None and (run.until is not None or spec.monitor is None)
        run = replace(run, every=None, at=_row_times(run, settings.at, known_end=known_end))
    return _resized(spec, run, settings.sizes)


def _row_times(run: Run, times: Sequence[float], *, known_end: bool) -> tuple[Fraction, ...]:
    """Return the times at which rows are requested, in the order of the run and without repetitions.

    Raises `ValueError` if there are no times, or if a time is before the start or, with ``known_end``, after the end.
    """
    forwards = run.step > 0
    ordered = sorted((_number(t, "at") for t in times), reverse=not forwards)
    if not ordered:
        raise ValueError("at must have at least one time")
    if (ordered[0] < run.start) if forwards else (ordered[0] > run.start):
        raise ValueError(f"at: {float(ordered[0])!r} is before the start, {float(run.start)!r}")
    if known_end:
        end = run.until if run.until is not None else run.start + run.step * run.steps
        if abs(ordered[-1] - run.start) > abs(end - run.start) * (1 + Fraction(EQUAL)):
            raise ValueError(f"at: {float(ordered[-1])!r} is after the end, {float(end)!r}")
    return tuple(dict.fromkeys(ordered))


def _resized(spec: Spec, run: Run, sizes: Sequence[int] | None) -> Run:
    """Return the run of a lattice with other ``sizes`` (numbers of sites along the axes); None changes nothing."""
    if sizes is None or run.lattice is None or spec.lattice is None:
        return run
    if spec.lattice.graph:
        raise ValueError(f"{spec.name} is a graph: its bonds say how many sites there are")
    if len(sizes) != len(spec.lattice.indices):
        raise ValueError(
            f"sizes must have one number for each axis ({', '.join(spec.lattice.indices)}), not {tuple(sizes)!r}"
        )
    numbers = tuple(arguments.count(size, "sizes", 1, limits.SITES) for size in sizes)
    return replace(run, lattice=replace(run.lattice, sizes=numbers))


def _number(value: float, name: str) -> Fraction:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{name} must be a finite number, not {value!r}")
    return Fraction(value)


def end_of(session: Followed, run: Run, stop: Function | None, *, timed: bool) -> End:
    """Return the end of a run, for a session at the start of the run; the session is not changed.

    ``stop`` is a function of states whose first zero ends the run. If ``timed``, ``stop`` also receives the time.
    """
    h, t0 = float(run.step), float(run.start)
    last = at_time(session.branch(), h, float(run.until) - t0) if run.until is not None else None
    last_step = run.steps if last is None else last.steps + last.part
    zero = where_zero(session.branch(), h, last_step, stop, t0, timed=timed) if stop else None
    if zero and (last is None or abs(zero.span) < abs(last.span)):
        return zero
    if last is not None:
        return last
    if math.isfinite(session.time()):
        return after_steps(session.branch(), h, run.steps)
    return End(run.steps, lambda here: (here, float(run.steps)), h * run.steps, part=False)


def spans_of(interval: float, span: float) -> list[float]:
    """Return the multiples of ``interval`` strictly between 0 and ``span``, with the sign of ``span``."""
    count = math.ceil(abs(span / interval) * (1 - EQUAL))
    return [k * math.copysign(interval, span) for k in range(1, count)]


def spans_of_run(run: Run, span: float) -> list[float]:
    """Return the times of the inner rows of a run with ``every`` or ``at``, counted from the start of the run.

    Inner rows lie strictly between the start and the end. ``span`` is the time from the start to the end of the run.
    """
    if run.every is not None:
        return spans_of(float(run.every), span)
    requested = [float(time - run.start) for time in run.at]
    return [s for s in requested if 0 < s / span < 1 - EQUAL]


def rows_of(session: Session, run: Run, end: End) -> Iterator[tuple[Session, float]]:
    """Yield pairs, one for each row of a run: a session at the row, and the number of steps from the start to
    the row.

    The first row is the start. Rows are at the times that ``run.every`` or ``run.at`` gives; without these keys they
    are at every ``run.stride``-th step. The last row is the end. If the end lies inside a step, the number of steps to
    the last row is not an integer. The caller must read a session before it asks for the next one. Raises
    `BackendError`.
    """
    yield session, 0.0
    yield from _timed_rows(session, run, end) if run.is_timed else _strided_rows(session, run, end)
    session.advance(float(run.step), end.steps - session.steps)
    yield end.finish(session)


def _strided_rows(session: Session, run: Run, end: End) -> Iterator[tuple[Session, float]]:
    """Yield pairs: the session at every ``run.stride``-th step before the end, and the number of this step."""
    for mark in range(run.stride, end.steps + end.part, run.stride):
        session.advance(float(run.step), mark - session.steps)
        yield session, float(mark)


def _timed_rows(session: Session, run: Run, end: End) -> Iterator[tuple[Session, float]]:
    """Yield pairs for rows at given times before the end: a session at the row, and the number of steps to the
    row.

    The times are the multiples of ``run.every``, or the times ``run.at``. A time between two steps is reached by a
    shorter step from the last whole step before the time; the number of steps then has a fraction.
    """
    h = float(run.step)
    for span in spans_of_run(run, end.span):
        elapsed = session.time() if math.isfinite(session.time()) else session.steps * h
        steps, left = steps_until(session, h, span - elapsed)
        session.advance(h, steps)
        if abs(left) <= EQUAL * abs(span):
            yield session, float(session.steps)
        else:
            row_session, size = reached(session, h, left)
            yield row_session, session.steps + size / h
