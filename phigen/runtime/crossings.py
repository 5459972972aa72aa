"""Poincaré sections: where a function g of the state passes through zero, found by the integrator itself.

Between two steps of size h the solution is followed by single steps of size θh, 0 < θ < 1, from the state before: the
crossing is the θ for which g vanishes there, to round-off. So the points lie on the leaf, and nothing is interpolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.session import Course
from phigen.runtime.tables import Column, write
from phigen.runtime.trajectory import trajectory_columns

C = TypeVar("C", bound=Course)

#: A function of states (rows, DIM), and of their times (rows,) where there is a time: shape (rows,).
Function = Callable[..., Floats]

#: Steps whose solvers are kept at a time.
BLOCK = 64
#: Numbers of equal steps that reach a point between two steps: more where one step does not converge from scratch.
SUBSTEPS = (1, 2, 4, 8)
#: Fractions of a step closer than this give the same state.
_RESOLUTION = 1e-18
_ITERATIONS = 100
#: The signs that g changes with, by the direction in which it passes through zero.
SIGNS = {"rising": (1.0,), "falling": (-1.0,), "both": (1.0, -1.0)}
_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class Section:
    """Crossings in the order they were met: times ``t`` (rows,) and states ``x`` (rows, DIM)."""

    t: Floats
    x: Floats
    coordinates: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<Section of ({', '.join(self.coordinates)}): {len(self)} crossings>"

    def save(self, path: str | Path) -> None:
        """Write ``t,x1,…`` to a ``.csv`` file, or arrays t, x and coordinates to a ``.npz``; raises `ValueError`."""
        rows = np.column_stack([self.t, self.x])
        write(path, section_columns(self.coordinates), rows, {"coordinates": np.array(self.coordinates)})


def section_columns(coordinates: tuple[str, ...]) -> list[Column]:
    """The columns of a table of crossings."""
    return trajectory_columns(coordinates, ())[:2]


@dataclass
class CrossingFinder(Generic[C]):
    """Follows a session in steps of size h and finds where g passes through zero as time increases, in a ``direction``.

    An interval between two steps has one crossing at most. Where g has an extremum near a step and one sign around it,
    it is looked up whether the sign changes twice there. A start on the section counts if g leaves it in the direction.

    ``past`` holds solvers that stand at the last steps but the latest; ``values`` is g there and at the latest, and
    ``first`` the number of the first of them. ``t0`` is the time of step 0; g is told times if it is ``timed``.
    ``places`` are the solvers at the crossings of the latest block, and how many steps these are from the start.
    """

    g: Function
    h: float
    t0: float = 0.0
    timed: bool = False
    past: list[C] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    first: int = 0
    direction: str = "rising"
    places: list[tuple[float, C]] = field(default_factory=list)
    _sign: float = 1.0  # of g where a crossing is looked for: those that fall are the rising ones of -g

    def follow(
        self, session: C, steps: int, move: Callable[[], object]
    ) -> Iterator[tuple[Floats, list[tuple[float, Floats]]]]:
        """Blocks of the states (rows, DIM) after each step that ``move`` made, and the crossings (t, x) before them.

        Raises `BackendError` after the last state that there is.
        """
        if not self.values:
            self.first = session.steps
            self.values = [self._value(session, 0, 0.0)]
        while steps > 0:
            states, clocks, failure, known = [], list[float](), None, len(self.values) - 1
            for _ in range(min(steps, BLOCK)):
                before = session.branch()
                try:
                    move()
                except BackendError as error:
                    failure = error
                    break
                self.past.append(before)
                states.append(session.state())
                clocks.append(self._clock(session, math.nan))
            steps -= len(states)
            if states:
                rows = np.array(states)
                self.first = session.steps - len(rows) - known
                counted = self._time(known + 1 + np.arange(len(rows)))
                times = counted if math.isnan(clocks[0]) else np.array(clocks)
                self.values += self._values(rows, times).tolist()
                yield rows, list(self._crossings(known))
                self.past, self.values = self.past[-1:], self.values[-2:]
            if failure:
                raise failure

    def within(self, session: C, part: float) -> list[tuple[float, Floats]]:
        """The crossings (t, x) in the first ``part`` of the step that a followed session would make next.

        A step that cannot be made as a whole has none.
        """
        copy, end = session.branch(), session.steps + part * (1 + 1e-12)
        try:
            for _ in self.follow(copy, 1, lambda: copy.advance(self.h, 1)):
                inside = [place for place in self.places if place[0] <= end]
        except BackendError:
            return []
        return [(self._clock(there, self._time(at - self.first)), there.state()) for at, there in inside]

    def _time(self, j: Any, fraction: float = 0.0) -> Any:
        """The time in interval j, counted from the first of the values."""
        return self.t0 + (self.first + j + fraction) * self.h

    def _values(self, states: Floats, t: Floats) -> Floats:
        # A section is crossed where g rises in time, whether time goes forwards or backwards.
        found = self.g(states, t) if self.timed else self.g(states)
        return math.copysign(1.0, self.h) * np.asarray(found, dtype=np.float64)

    def _value(self, session: C, j: int, fraction: float) -> float:
        return float(
            self._values(session.state()[np.newaxis], np.array([self._clock(session, self._time(j, fraction))]))[0]
        )

    def _crossings(self, known: int) -> Iterator[tuple[float, Floats]]:
        """The crossings of this block, whose first ``known`` intervals are those of an earlier one."""
        self.places = []
        for sign in SIGNS[self.direction]:
            self._sign = sign
            self.places += self._rising(known)
        self.places.sort(key=lambda place: place[0])
        for at, there in self.places:
            yield self._clock(there, self._time(at - self.first)), there.state()

    def _rising(self, known: int) -> Iterator[tuple[float, C]]:
        v = [self._sign * value for value in self.values]
        if known == 0 and v[0] == 0 < v[1]:
            yield self.first, self.past[0]
        for i in range(len(v) - 1):
            if i >= 1 and (found := self._hidden(v, i)):
                yield self._located(*found)
            if i >= known and v[i] < 0 <= v[i + 1]:
                yield self._located(i, 0.0, v[i], 1.0, v[i + 1])

    def _hidden(self, v: list[float], i: int) -> tuple[int, float, float, float, float] | None:
        """An interval before or after step i, and a bracket in it, where an extremum near step i changes the sign."""
        a, b, c = v[i - 1 : i + 2]
        peak = a < b >= c and b < 0
        if not (peak or (a > b <= c and b >= 0 and a >= 0)):
            return None
        curvature = a - 2 * b + c
        offset = (a - c) / (2 * curvature) if curvature else 0.0
        gain = abs((a - c) * offset / 4)
        # The parabola through three values is off by a fraction of its curvature.
        if not abs(b) <= 2 * gain + 0.1 * abs(curvature):
            return None
        j = i - 1 if offset < 0 else i
        at = self._extremum(v, j, -1.0 if peak else 1.0)
        value = self._at(j, at)
        if (value < 0) == (b < 0):
            return None
        return (j, 0.0, v[j], at, value) if peak else (j, at, value, 1.0, v[j + 1])

    def _extremum(self, v: list[float], j: int, sign: float) -> float:
        """Where sign·g is smallest in interval j, or where it is negative enough to have changed its sign."""
        low, high = 0.0, 1.0
        left, right = 1 - _GOLDEN, _GOLDEN
        at_left, at_right = self._at(j, left), self._at(j, right)
        while high - low > 1e-9:
            for at, value in ((left, at_left), (right, at_right)):
                if (value < 0) != (v[j] < 0):
                    return at
            if sign * at_left < sign * at_right:
                high, right, at_right = right, left, at_left
                left = high - _GOLDEN * (high - low)
                at_left = self._at(j, left)
            else:
                low, left, at_left = left, right, at_right
                right = low + _GOLDEN * (high - low)
                at_right = self._at(j, right)
        return left if sign * at_left < sign * at_right else right

    def _at(self, j: int, fraction: float, substeps: Sequence[int] = SUBSTEPS) -> float:
        return self._sign * self._value(self._moved(j, fraction, substeps), j, fraction)

    def _moved(self, j: int, fraction: float, substeps: Sequence[int]) -> C:
        """A solver that went a fraction of step j, in the first number of equal steps that works."""
        for count in substeps:
            session = self.past[j].branch()
            try:
                session.advance(fraction * self.h / count, count)
            except BackendError:
                if count == substeps[-1]:
                    raise
            else:
                break
        return session

    def _located(self, j: int, low: float, at_low: float, high: float, at_high: float) -> tuple[float, C]:
        """The crossing in interval j between two fractions of the step: its number of steps, and a solver there."""
        for count in SUBSTEPS:
            # The same number for all fractions: g is a smooth function of the fraction then.
            try:
                fraction = root(partial(self._at, j, substeps=(count,)), low, at_low, high, at_high)
                there = self._moved(j, fraction, (count,))
            except BackendError:
                if count == SUBSTEPS[-1]:
                    raise
            else:
                break
        return self.first + j + fraction, there

    def _clock(self, session: C, counted: float) -> float:
        """The time of a session: its own where steps are equal in τ, else what was counted."""
        own = getattr(session, "time", lambda: math.nan)()
        return counted if math.isnan(own) else float(own)


def root(f: Callable[[float], float], low: float, at_low: float, high: float, at_high: float) -> float:
    """The zero of f between two points with values of different sign, to the last bit that f tells apart.

    Inverse quadratic interpolation where it is safe, else bisection: T. R. Chandrupatla, Adv. Eng. Software 28 (1997).
    """
    a, fa, b, fb = high, at_high, low, at_low
    share = fa / (fa - fb)
    for _ in range(_ITERATIONS):
        best, value = (a, fa) if abs(fa) < abs(fb) else (b, fb)
        least = (2 * np.finfo(float).eps * abs(best) + _RESOLUTION) / abs(b - a)
        if value == 0 or least > 0.5:
            break
        at = a + min(1 - least, max(least, share)) * (b - a)
        f_at = f(at)
        if (f_at < 0) == (fa < 0):
            c, fc = a, fa
        else:
            c, fc, b, fb = b, fb, a, fa
        a, fa = at, f_at
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        share = 0.5
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    return best
