"""Decisions of the search for settings, from measured errors: the step for an accuracy, and the next candidates."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from phigen.tuning.settings import Setting, direct, variants
from phigen.tuning.trials import Point

#: A scan measures a method with at most MOST_POINTS step sizes, each smaller than the one before by the factor FINER.
FINER, MOST_POINTS = math.sqrt(2.0), 48
#: Number of times that a scan reduces its first step size if runs with it fail.
FAILURES = 16
#: A scan continues until the error is below this fraction of the accuracy. So figures also show errors below the
#: accuracy.
BEYOND = 1 / 30
#: Step sizes are chosen so that the error is at most this fraction of the largest accepted error. This leaves a margin,
#: since the error of a longer run is slightly larger.
AIM = 0.8
#: The search for a cheaper step continues with smaller steps, which may need fewer iterations. The search ends when the
#: cost exceeds the least cost by this factor.
DEARER = 1.25
#: A method is not tried at other orders if its cost exceeds the least cost by more than this factor.
KEEP = 3.0
#: A scan has reached rounding error if halving the step divides the error by less than GAIN, and if the error is small:
#: below SMALL, or below MANY_ROUNDINGS times the rounding error of one step.
GAIN, SMALL, MANY_ROUNDINGS = 1.5, 1e-9, 1000


@dataclass(frozen=True)
class Curve:
    """Results of one method with several step sizes; ``points`` are sorted from the largest step to the smallest.

    ``setting`` is None for a classical method. ``bounded`` says whether the energy error is bounded in time, as it is
    for Poisson maps. ``seconds`` is the time of the build.
    """

    label: str
    order: int
    points: tuple[Point, ...]
    setting: Setting | None = None
    gauged: bool = False
    symmetric: bool = True
    bounded: bool = True
    stages: int = 1
    composition: str = ""
    seconds: float = 0.0

    @property
    def key(self) -> Setting | str:
        """Key by which the method is stored: its setting, or the label of a classical method."""
        return self.setting or self.label

    @property
    def title(self) -> str:
        """Name of the method in tables for users."""
        return self.setting.described(self.label) if self.setting else self.label

    @property
    def largest(self) -> float:
        """Largest step with which a run over the whole time span succeeded; 0 if there is none."""
        return max((p.step for p in self.points), default=0.0)

    def cost(self, accuracy: float) -> float:
        """Return the cost of the method for an accuracy, in nanoseconds per unit of simulated time.

        If no measured step reaches the accuracy, the cost is extrapolated from the measurement with the smallest step,
        by the order of the method. The cost is infinite if rounding errors make the accuracy impossible.
        """
        return cheapest_step(self.points, accuracy, self.order)[1]


def _index_of_least_error(points: Sequence[Point]) -> int:
    """Return the index of the first point whose error is rounding error; at smaller steps, rounding errors grow.

    If no error is rounding error, the index is that of the last point.
    """
    least = min((p.error for p in points), default=0.0)
    return next(
        (i for i, p in enumerate(points) if p.error <= 2 * least and at_floor(points[: i + 1])), len(points) - 1
    )


def at_floor(points: Sequence[Point]) -> bool:
    """Whether the last point shows rounding error only: its error is small, and halving the step hardly reduced it."""
    if points and points[-1].rounding > points[-1].error / 2:
        return True
    if len(points) < 3:
        return False
    coarser, last = points[-3], points[-1]
    small = max(SMALL, MANY_ROUNDINGS * last.unit)
    return coarser.error < GAIN * last.error and coarser.measured < small


def step_for(points: Sequence[Point], accuracy: float, order: int) -> float | None:
    """Return the largest step whose error is at most ``accuracy``; None if the measurements show no such step.

    The step is interpolated between measured steps. If it is smaller than all of them, it is extrapolated by the order
    of the method.
    """
    points = points[: _index_of_least_error(points) + 1]
    if not points:
        return None
    meeting = [i for i, p in enumerate(points) if p.error <= accuracy]
    if not meeting:
        return _extrapolated_step(points, accuracy, order)
    first = len(points)
    while first > 0 and points[first - 1].error <= accuracy:
        first -= 1
    if first == len(points):  # a large step reaches the accuracy by chance, but the smallest step does not
        return _extrapolated_step(points, accuracy, order)
    if first == 0:
        return points[0].step
    return _interpolated_step(points[first - 1], points[first], accuracy)


def _extrapolated_step(points: Sequence[Point], accuracy: float, order: int) -> float | None:
    """Return the step whose expected error is ``accuracy``; None if rounding errors exceed ``accuracy``.

    The expected error at the step h is e₀ (h/h₀)^``order``, where h₀ is the smallest step in ``points``, and e₀ is its
    error.
    """
    last = points[-1]
    if at_floor(points) or accuracy < max(last.unit, last.rounding):
        return None
    return last.step * math.pow(accuracy / last.error, 1 / order)


def cheapest_step(points: Sequence[Point], accuracy: float, order: int) -> tuple[float, float]:
    """Return the step that reaches the accuracy at the least cost, and this cost in nanoseconds per unit of time.

    If there is no such step, the result is 0 and infinity. The cheapest step need not be the largest: with smaller
    steps the predictor is better, which may save an iteration.
    """
    largest = step_for(points, accuracy, order)
    if largest is None:
        return 0.0, math.inf
    options = [(nanoseconds_at(points, largest) / largest, largest)]
    options += [(p.cost, p.step) for p in points if p.step < largest and p.error <= accuracy]
    cost, step = min(options)
    return step, cost


def _interpolated_step(coarse: Point, fine: Point, accuracy: float) -> float:
    """Return the step for the accuracy, by linear interpolation of log(error) in log(step) between two points."""
    if coarse.error <= fine.error:
        return fine.step
    share = math.log(accuracy / fine.error) / math.log(coarse.error / fine.error)
    return fine.step * math.pow(coarse.step / fine.step, min(max(share, 0.0), 1.0))


def nanoseconds_at(points: Sequence[Point], step: float) -> float:
    """Return the time of one step in nanoseconds, interpolated between measured step sizes.

    Outside the range of measured sizes, the result is the time of the nearest measured step.
    """
    by_step = sorted(points, key=lambda p: p.step)
    for low, high in pairwise(by_step):
        if low.step <= step <= high.step:
            share = math.log(step / low.step) / math.log(high.step / low.step)
            return low.nanoseconds * math.pow(high.nanoseconds / low.nanoseconds, share)
    return min(by_step, key=lambda p: abs(math.log(p.step / step))).nanoseconds


def scan(
    measure: Callable[[float], Point | None],
    first: float,
    largest_step: float,
    accuracy: float,
    order: int,
    worth: float = math.inf,
    patience: Callable[[], bool] = lambda: True,
) -> tuple[Point, ...]:
    """Measure a method with decreasing step sizes, until the accuracy is reached and the cheapest step is known.

    ``measure(h)`` returns the point for a step size, None if a step fails. The scan begins at the largest step that
    succeeds and is at most ``largest_step``; the search for this step begins at ``first``. The scan ends early if the
    accuracy would cost more than ``worth`` nanoseconds per unit of time, if only rounding errors are left, or if
    ``patience()`` is False.
    """
    points = _points_at_largest_step(measure, min(first, largest_step), largest_step, patience)
    while points and len(points) < MOST_POINTS and patience():
        if _is_complete(points, accuracy) or _is_too_costly(points, accuracy, order, worth):
            break
        point = measure(points[-1].step / FINER)
        if point is None:
            break
        points.append(point)
    for _ in range(2):
        points = _refined(points, measure, step_for(points, AIM * accuracy, order), patience)
    cheapest, _ = cheapest_step(points, AIM * accuracy, order)
    for factor in (math.sqrt(FINER), 1 / math.sqrt(FINER)):
        points = _refined(points, measure, cheapest * factor, patience)
    return tuple(points)


def _is_complete(points: Sequence[Point], accuracy: float) -> bool:
    """Whether a scan with these points is complete, so that smaller steps need not be measured.

    A scan is complete if the accuracy is reached and smaller steps cost more, or if only rounding errors are left.
    """
    last = points[-1]
    costs = [p.cost for p in points if p.error <= accuracy]
    if at_floor(points) and not costs:
        return True
    dearer = bool(costs) and last.cost > DEARER * min(costs)
    return dearer and (last.error <= BEYOND * accuracy or at_floor(points))


def _refined(
    points: list[Point], measure: Callable[[float], Point | None], step: float | None, patience: Callable[[], bool]
) -> list[Point]:
    """Return the points, and one more at ``step`` unless that step was measured or is outside their range."""
    if not points or not step or not points[-1].step < step < points[0].step or not patience():
        return points
    if any(abs(math.log(p.step / step)) < 0.02 for p in points):
        return points
    point = measure(step)
    return sorted([*points, point], key=lambda p: -p.step) if point else points


def _points_at_largest_step(
    measure: Callable[[float], Point | None], first: float, largest_step: float, patience: Callable[[], bool]
) -> list[Point]:
    """Return the points with which a scan begins, the largest step first.

    The first run has the step ``first``. If this run succeeds, the step is increased by factors `FINER`, until a run
    fails or the step is ``largest_step``. Otherwise the step is reduced by factors `FINER`, until a run succeeds. If no
    run succeeds, the list is empty.
    """
    step, point = first, measure(first)
    for _ in range(FAILURES):
        if point is not None or not patience():
            break
        step /= FINER
        point = measure(step)
    if point is None:
        return []
    points = [point]
    while points[0].step < 0.97 * largest_step and step == first and patience():
        coarser = measure(min(points[0].step * FINER, largest_step))
        if coarser is None:
            break
        points.insert(0, coarser)
    return points


def _is_too_costly(points: Sequence[Point], accuracy: float, order: int, worth: float) -> bool:
    """Whether the accuracy, by extrapolation of the points, would cost more than ``worth`` nanoseconds per unit of
    time."""
    last = points[-1]
    if last.cost > worth and last.error > accuracy:
        return True
    if len(points) < 4 or last.error > 1e-2 or last.error <= accuracy:
        return False
    gain = math.log(points[-3].error / last.error) / math.log(points[-3].step / last.step)
    step = last.step * math.pow(accuracy / last.error, 1 / max(gain, order, 1))
    return last.nanoseconds / step > worth


def proposals(tried_curves: Mapping[Setting, Curve], refused: Sequence[Setting], accuracy: float) -> list[Setting]:
    """Return the settings to try next, the most promising first. The list is empty if no setting is promising.

    A method whose cost is near the least cost is tried at the next higher order. If the higher order does not reduce
    the cost, the next lower order is tried. The best method is also tried without gauge and as a composition.
    """
    costs = {setting: curve.cost(accuracy) for setting, curve in tried_curves.items()}
    families: dict[Setting, dict[int, float]] = {}
    for setting, cost in costs.items():
        families.setdefault(setting.family, {})[setting.order] = cost
    ranked = sorted(families, key=lambda family: min(families[family].values()))
    least = min(costs.values(), default=math.inf)
    proposed: list[Setting] = []
    for family in ranked:
        orders = families[family]
        best = min(orders, key=lambda order: (orders[order], -order))
        if orders[best] > KEEP * least:
            continue
        setting = next(s for s in tried_curves if s.family == family and s.order == best)
        proposed += _neighbours(setting, orders, refused)
        if family == ranked[0] and family.composition == direct(family):
            curve = tried_curves[setting]
            known_families = {
                (s.chart, s.composition, s.gauge * (s.composition == "none")) for s in (*tried_curves, *refused)
            }
            proposed += [
                v for v in variants(setting, curve.gauged, curve.symmetric)
                if (v.chart, v.composition, v.gauge * (v.composition == "none")) not in known_families
            ]  # fmt: skip
    return list(dict.fromkeys(proposed))


def _neighbours(best: Setting, orders: Mapping[int, float], refused: Sequence[Setting]) -> list[Setting]:
    """Return a list with the setting whose order should be tried next; [] if there is none.

    The setting has the next higher order. If there is no higher order, or if it was tried or refused, the setting has
    the next lower order. If the lower order was tried or refused too, the list is empty. ``orders`` has the costs of
    the orders that were tried.
    """
    higher_orders = [k for k in best.orders if k > best.order]
    lower_orders = [k for k in best.orders if k < best.order]
    closed = {s.order for s in refused if s.family == best.family}
    if (
        higher_orders
        and higher_orders[0] not in orders
        and not any(k <= higher_orders[0] for k in closed if k > best.order)
    ):
        return [replace(best, order=higher_orders[0])]
    if (
        lower_orders
        and lower_orders[-1] not in orders
        and lower_orders[-1] not in closed
        and math.isfinite(orders[best.order])
    ):
        return [replace(best, order=lower_orders[-1])]
    return []


def rounded_down(step: float, digits: int = 3) -> float:
    """Return a step, rounded down to ``digits`` significant digits."""
    exponent = math.floor(math.log10(step)) - digits + 1
    rounded = float(f"{math.floor(step / 10.0**exponent + 1e-9)}e{exponent}")
    return rounded if rounded <= step else step
