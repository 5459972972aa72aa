"""Poincaré sections: the zeros of a function g of the state along a trajectory, located by steps of the solver.

The state at a fraction θ of a step of size h, 0 < θ < 1, is computed by one step of size θh from the state before the
step. The crossing is at the θ for which g vanishes to round-off. States are not interpolated, so crossings have the
Casimirs of the trajectory.

If the method has a collocation polynomial, a zero of g is first located on this polynomial. Newton's method then
improves θ: steps of size (θ − 1)h lead back from the state after the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.session import Course
from phigen.runtime.tables import Column, write
from phigen.runtime.trajectory import trajectory_columns

C = TypeVar("C", bound=Course)

#: A function from states (rows, DIM), and their times (rows,) if H depends on the time, to values (rows,).
Function = Callable[..., Floats]

#: Default number of steps in a block. After each block, the function g, whose zeros are the crossings, is evaluated on
#: the array of the states. Until then, a copy of the session is stored for each step.
BLOCK = 64
#: Number of intervals into which a step with a collocation polynomial is divided. The function g, whose zeros are the
#: crossings, is evaluated at the ends of the intervals. Four intervals suffice to find the extrema of a motion that
#: makes half a turn in a step.
SAMPLES = 4
#: The function g, whose zeros are the crossings, is differentiated along a collocation polynomial by a central
#: difference. The two points of the difference lie at this distance before and after the zero, as a fraction of a step.
#: This is about the cube root of the machine epsilon.
_DIFFERENCE = 1e-5
#: Largest number of iterations of Newton's method for a zero; two to four are usual.
_MOST_NEWTON = 8
#: A point inside a step is reached by 1, 2, 4 or 8 equal smaller steps. The first of these numbers with which no step
#: fails is used: a single step without a predictor may not converge.
SUBSTEPS = (1, 2, 4, 8)
#: Tolerance for the position of a zero in a step, as a fraction of the step. A smaller change of the position does not
#: change the state.
_RESOLUTION = 1e-18
_ITERATIONS = 100
#: Direction of a crossing → signs s for which s·g increases through zero as time increases.
SIGNS = {"rising": (1.0,), "falling": (-1.0,), "both": (1.0, -1.0)}
_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class Section:
    """Crossings of a Poincaré section in the order of integration: times ``t`` (rows,) and states ``x`` (rows, DIM)."""

    t: Floats
    x: Floats
    coordinates: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<Section of ({', '.join(self.coordinates)}): {len(self)} crossings>"

    def save(self, path: str | Path) -> None:
        """Write the columns ``t,x1,…`` to a ``.csv`` file, or the arrays ``t``, ``x`` and ``coordinates`` to a ``.npz``
        file.

        Raises `ValueError` for other suffixes.
        """
        rows = np.column_stack([self.t, self.x])
        write(path, section_columns(self.coordinates), rows, {"coordinates": np.array(self.coordinates)})


def section_columns(coordinates: tuple[str, ...]) -> list[Column]:
    """Return the columns of a table of crossings: the time, and the coordinates."""
    return trajectory_columns(coordinates, ())[:2]


@dataclass
class CrossingFinder(Generic[C]):
    """Locates the zeros of g along a session with steps of size h.

    ``direction`` selects the zeros at which g rises, those at which g falls, or both, as time increases. g is evaluated
    at points: at the ends of steps and, with a collocation polynomial, inside steps. At most one crossing is located
    between two neighbouring points. If g has the same sign at three neighbouring points, g may still change its sign
    twice near an extremum between these points. So the extremum is located too. A start with g = 0 counts as a crossing
    if g leaves zero in the requested direction.

    ``latest`` is the session after the latest step. ``past`` has copies of the session, made before the latest step and
    before earlier steps. ``points`` is the number of points in each step. ``values`` are the values of g at the points;
    the first value belongs to the start of step number ``first``. ``t0`` is the time of step 0. If ``timed``, g
    receives the times as well as the states. A block has ``block`` steps; after each block, g is evaluated on arrays.
    ``places`` are the crossings of the latest block. Each is a pair: the number of steps from the start to the
    crossing, and a session at the crossing.
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
    block: int = BLOCK
    points: int = 1
    latest: C | None = None
    _sign: float = 1.0  # 1 in the search for zeros at which g rises, −1 for zeros at which g falls

    def follow(
        self, session: C, steps: int, move: Callable[[], object]
    ) -> Iterator[tuple[Floats, list[tuple[float, Floats]]]]:
        """Make ``steps`` steps, each by a call of ``move``. Yield the states (rows, DIM) and the crossings of each
        block of steps.

        Crossings are pairs (t, x). If a step fails, `BackendError` is raised after the block that ends before this
        step.
        """
        if not self.values:
            self.first = session.steps
            self.values = [self._value(session, 0, 0.0)]
        while steps > 0:
            states, inner, clocks, failure = [], list[Floats](), list[float](), None
            searched = (len(self.values) - 1) // self.points
            for _ in range(min(steps, self.block)):
                start_session = session.branch()
                try:
                    move()
                except BackendError as error:
                    failure = error
                    break
                self.past.append(start_session)
                states.append(session.state())
                inner.append(self._interpolated_states(session))
                clocks.append(self._clock(session, math.nan))
            steps -= len(states)
            if states:
                rows, self.latest, self.points = np.array(states), session, 1 + len(inner[0])
                self.first = session.steps - len(rows) - searched
                point_times = self._time(self.points * searched + np.arange(1, self.points * len(rows) + 1))
                times = point_times if self.points > 1 or math.isnan(clocks[0]) else np.array(clocks)
                points = np.concatenate([np.array(inner), rows[:, np.newaxis]], axis=1) if self.points > 1 else rows
                self.values += self._values(points.reshape(-1, rows.shape[1]), times).tolist()
                yield rows, list(self._crossings(self.points * searched))
                self.past, self.values = self.past[-1:], self.values[-self.points - 1 :]
            if failure:
                raise failure

    def _interpolated_states(self, session: C) -> Floats:
        """Return states (points, DIM) inside the last step, from the collocation polynomial of the method.

        The array is empty if the method has no collocation polynomial. The array is also empty if the spec has a
        monitor, and the function whose zeros are the crossings depends on the time: with a monitor, the times inside a
        step are unknown.
        """
        interpolated = getattr(session, "interpolated", None)
        if interpolated is None or (self.timed and not math.isnan(self._clock(session, math.nan))):
            return np.empty((0, 0))
        states: Floats | None = interpolated([k / SAMPLES for k in range(1, SAMPLES)])
        return np.empty((0, 0)) if states is None else states

    def within(self, session: C, part: float) -> list[tuple[float, Floats]]:
        """Return the crossings (t, x) in the first part of the next step; the session is not advanced.

        ``part`` is the length of this part, as a fraction of the step. The result is empty if the next step fails.
        """
        copy, end = session.branch(), session.steps + part * (1 + 1e-12)
        try:
            for _ in self.follow(copy, 1, lambda: copy.advance(self.h, 1)):
                in_part = [found_place for found_place in self.places if found_place[0] <= end]
        except BackendError:
            return []
        return [
            (self._clock(crossing_session, self.t0 + steps_at * self.h), crossing_session.state())
            for steps_at, crossing_session in in_part
        ]

    def _time(self, j: Any, fraction: float = 0.0) -> Any:
        """Return the time at a fraction of interval j.

        Intervals lie between neighbouring points at which g is evaluated. Interval 0 begins at the point of
        ``values[0]``.
        """
        return self.t0 + (self.first + (j + fraction) / self.points) * self.h

    def _values(self, states: Floats, t: Floats) -> Floats:
        # The direction refers to increasing time, so the sign of g is reversed for negative steps.
        values = self.g(states, t) if self.timed else self.g(states)
        return math.copysign(1.0, self.h) * np.asarray(values, dtype=np.float64)

    def _value(self, session: C, j: int, fraction: float) -> float:
        return float(
            self._values(session.state()[np.newaxis], np.array([self._clock(session, self._time(j, fraction))]))[0]
        )

    def _crossings(self, searched: int) -> Iterator[tuple[float, Floats]]:
        """Yield the crossings (t, x) that were not found in earlier blocks of steps.

        The argument ``searched`` is the number of intervals at the start of ``values`` that belong to an earlier block.
        """
        self.places = []
        for sign in SIGNS[self.direction]:
            self._sign = sign
            self.places += self._rising(searched)
        self.places.sort(key=lambda place: place[0])
        for steps_at, crossing_session in self.places:
            yield self._clock(crossing_session, self.t0 + steps_at * self.h), crossing_session.state()

    def _rising(self, searched: int) -> Iterator[tuple[float, C]]:
        v = [self._sign * value for value in self.values]
        if searched == 0 and v[0] == 0 < v[1]:
            yield self.first, self.past[0]
        for i in range(len(v) - 1):
            if i >= max(1, searched) and (bracket := self._bracket_at_extremum(v, i)):
                yield self._crossing_between(*bracket)
            if i >= searched and v[i] < 0 <= v[i + 1]:
                yield self._crossing_between(i, 0.0, v[i], 1.0, v[i + 1])

    def _bracket_at_extremum(self, v: list[float], i: int) -> tuple[int, float, float, float, float] | None:
        """Look for an extremum of g near point i. Return the part of an interval in which g has a zero next to the
        extremum.

        The result is (j, low, g at low, high, g at high): low and high are fractions of interval j. If there is no
        zero, the result is None. The list v has the values of g at the points.
        """
        a, b, c = v[i - 1 : i + 2]
        peak = a < b >= c and b < 0
        if not (peak or (a > b <= c and b >= 0 and a >= 0)):
            return None
        curvature = a - 2 * b + c
        offset = (a - c) / (2 * curvature) if curvature else 0.0
        gain = abs((a - c) * offset / 4)
        # The extremum is examined if the value b at point i is close to 0. On the parabola through the values at i − 1,
        # i and i + 1, the value at the extremum differs from b by ``gain``. A tenth of the curvature allows for the
        # error of the parabola.
        if not abs(b) <= 2 * gain + 0.1 * abs(curvature):
            return None
        j = i - 1 if offset < 0 else i
        extremum = self._extremum(v, j, -1.0 if peak else 1.0)
        value = self._value_at(j, extremum)
        if (value < 0) == (b < 0):
            return None
        return (j, 0.0, v[j], extremum, value) if peak else (j, extremum, value, 1.0, v[j + 1])

    def _extremum(self, v: list[float], j: int, sign: float) -> float:
        """Return the fraction of interval ``j`` at which sign·g is smallest, by a golden-section search.

        g is the function whose zeros are the crossings, and ``v[j]`` is its value at the start of the interval. The
        search ends early at a fraction where the sign of g differs from that of ``v[j]``.
        """
        low, high = 0.0, 1.0
        left, right = 1 - _GOLDEN, _GOLDEN
        at_left, at_right = self._value_at(j, left), self._value_at(j, right)
        while high - low > 1e-9:
            for fraction, value in ((left, at_left), (right, at_right)):
                if (value < 0) != (v[j] < 0):
                    return fraction
            if sign * at_left < sign * at_right:
                high, right, at_right = right, left, at_left
                left = high - _GOLDEN * (high - low)
                at_left = self._value_at(j, left)
            else:
                low, left, at_left = left, right, at_right
                right = low + _GOLDEN * (high - low)
                at_right = self._value_at(j, right)
        return left if sign * at_left < sign * at_right else right

    def _value_at(self, j: int, fraction: float) -> float:
        """Return the value of the function g, whose zeros are the crossings, at a fraction of interval j.

        Interval j lies between points j and j + 1. The state is computed from the collocation polynomial or, if the
        method has none, by a step.
        """
        step, part = divmod(j, self.points)
        if self.points > 1:
            return self._on_polynomial(step, [(part + fraction) / self.points])[0]
        return self._sign * self._value(self._session_at_fraction(step, fraction, SUBSTEPS), j, fraction)

    def _on_polynomial(self, step: int, fractions: Sequence[float]) -> list[float]:
        """Return the values of the function g, whose zeros are the crossings, at fractions of a step.

        The states are those of the collocation polynomial of this step.
        """
        states = self._session_after(step).interpolated(fractions)
        times = self._time(self.points * (step + np.array(fractions)))
        return [self._sign * float(value) for value in self._values(states, times)]

    def _session_after(self, step: int) -> Any:
        """Return the session after a step of the latest block. The caller must not advance it."""
        return self.past[step + 1] if step + 1 < len(self.past) else self.latest

    def _session_at_fraction(self, step: int, fraction: float, substeps: Sequence[int]) -> C:
        """Return a session at a fraction of a step: a copy of the session before the step, advanced by smaller
        steps.

        ``substeps`` are numbers of equal smaller steps; the first number with which no step fails is used.
        """
        for count in substeps:
            session = self.past[step].branch()
            try:
                session.advance(fraction * self.h / count, count)
            except BackendError:
                if count == substeps[-1]:
                    raise
            else:
                break
        return session

    def _crossing_between(self, j: int, low: float, at_low: float, high: float, at_high: float) -> tuple[float, C]:
        """Return the crossing between two fractions of interval j: the number of steps before the crossing, and a
        session at the crossing.

        Interval j lies between points j and j + 1. ``at_low`` and ``at_high`` are the values of g at the fractions
        ``low`` and ``high``.
        """
        step, part = divmod(j, self.points)
        low, high = (part + low) / self.points, (part + high) / self.points
        if self.points > 1 and (polished := self._refined_on_polynomial(step, low, at_low, high, at_high)):
            fraction, crossing_session = polished
            return self.first + step + fraction, crossing_session

        def value(fraction: float) -> float:
            moved_session = self._session_at_fraction(step, fraction, (count,))
            return self._sign * self._value(moved_session, self.points * step, self.points * fraction)

        for count in SUBSTEPS:
            # The state at each fraction is reached by the same number of substeps, so that ``value`` is a smooth
            # function of the fraction.
            try:
                fraction = root(value, low, at_low, high, at_high)
                crossing_session = self._session_at_fraction(step, fraction, (count,))
            except BackendError:
                if count == SUBSTEPS[-1]:
                    raise
            else:
                break
        return self.first + step + fraction, crossing_session

    def _refined_on_polynomial(
        self, step: int, low: float, at_low: float, high: float, at_high: float
    ) -> tuple[float, C] | None:
        """Return the zero of g in a step as a pair: the fraction of the step, and a session at the zero.

        The result is None if no zero is found. Newton's method starts from the zero on the collocation polynomial. The
        iteration may not converge at a double zero of g.
        """
        fraction = root(lambda at: self._on_polynomial(step, [at])[0], low, at_low, high, at_high)
        value_before, value_after = self._on_polynomial(step, [fraction - _DIFFERENCE, fraction + _DIFFERENCE])
        slope, best = (value_after - value_before) / (2 * _DIFFERENCE), math.inf
        zero: tuple[float, C] | None = None
        for _ in range(_MOST_NEWTON):
            step_end: C = self._session_after(step).branch()
            try:
                if fraction < 1:
                    step_end.advance((fraction - 1) * self.h, 1)
            except BackendError:
                return None
            value = self._sign * self._value(step_end, self.points * step, self.points * fraction)
            if not abs(value) < best:  # only rounding errors are left, or Newton's method has failed
                return zero if best <= abs(slope) * math.sqrt(self._session_after(step).rounding) else None
            best, zero = abs(value), (fraction, step_end)
            following = min(1.0, max(0.0, fraction - value / slope)) if slope else math.nan
            if abs(following - fraction) <= np.finfo(float).eps:
                return zero
            fraction = following
        return None

    def _clock(self, session: C, counted_time: float) -> float:
        """Return the physical time of a session. Without a monitor, this is ``counted_time``, the time computed from
        the number of steps."""
        elapsed = getattr(session, "time", lambda: math.nan)()
        return counted_time if math.isnan(elapsed) else float(elapsed)


def root(f: Callable[[float], float], low: float, at_low: float, high: float, at_high: float) -> float:
    """Return the zero of f between ``low`` and ``high``, as accurately as rounding errors of f allow.

    f has different signs at ``low`` and ``high``. The method is inverse quadratic interpolation where it is safe, else
    bisection: T. R. Chandrupatla, Adv. Eng. Software 28 (1997).
    """
    a, fa, b, fb = high, at_high, low, at_low
    share = fa / (fa - fb)
    for _ in range(_ITERATIONS):
        best, value = (a, fa) if abs(fa) < abs(fb) else (b, fb)
        least = (2 * np.finfo(float).eps * abs(best) + _RESOLUTION) / abs(b - a)
        if value == 0 or least > 0.5:
            break
        trial = a + min(1 - least, max(least, share)) * (b - a)
        f_at = f(trial)
        if (f_at < 0) == (fa < 0):
            c, fc = a, fa
        else:
            c, fc, b, fb = b, fb, a, fa
        a, fa = trial, f_at
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        share = 0.5
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    return best
