"""Choice of steps and candidates from measured points: the step for an accuracy, the next candidates, the cheapest."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from phigen.tuning.settings import Setting, direct, variants
from phigen.tuning.trials import ROUNDING, Point

#: Factor between the step sizes of a scan, and largest number of step sizes.
FINER, MOST_POINTS = math.sqrt(2.0), 48
#: Number of steps below the first guess that may fail.
FAILURES = 16
#: Fraction of the accuracy down to which a scan continues, for the figure.
BEYOND = 1 / 30
#: Fraction of the accuracy for which the step is chosen, since the largest error of a longer run is slightly larger.
AIM = 0.8
#: Cost, relative to the cheapest step, at which the search for cheaper smaller steps ends. Smaller steps may need fewer
#: iterations.
DEARER = 1.25
#: Cost, relative to the best, above which a bi-realisation is not tried at other orders.
KEEP = 3.0
#: Least factor by which errors decrease when the step is halved twice, unless they are rounding errors.
GAIN = 1.5


@dataclass(frozen=True)
class Curve:
    """Measurements of one method: points from coarse to fine. ``setting`` is None for a classical method.

    ``bounded`` says whether its energy error is bounded, which is true only of Poisson maps.
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
        """The key of the method: its setting, or its label if it is classical."""
        return self.setting or self.label

    @property
    def title(self) -> str:
        """The title of the method in tables."""
        return self.setting.described(self.label) if self.setting else self.label

    @property
    def largest(self) -> float:
        """The largest step with which the whole time span was integrated; 0 if there is none."""
        return max((p.step for p in self.points), default=0.0)

    def cost(self, accuracy: float) -> float:
        """Return nanoseconds per unit of time at an accuracy: measured, or extrapolated by the order from the finest
        step.

        Infinity if neither is possible.
        """
        return cheapest_step(self.points, accuracy, self.order)[1]


def _index_of_least_error(points: Sequence[Point]) -> int:
    """Return the index of the first point whose error consists of rounding: finer steps have more of it.

    If there is no such point, return the index of the last point.
    """
    least = min((p.error for p in points), default=0.0)
    return next(
        (i for i, p in enumerate(points) if p.error <= 2 * least and at_floor(points[: i + 1])), len(points) - 1
    )


def at_floor(points: Sequence[Point]) -> bool:
    """Whether the last points show rounding errors only: errors are small, and halving the step hardly reduced them."""
    if points and points[-1].rounding > points[-1].error / 2:
        return True
    if len(points) < 3:
        return False
    coarser, last = points[-3], points[-1]
    return coarser.error < GAIN * last.error and coarser.measured < 1e-9


def step_for(points: Sequence[Point], accuracy: float, order: int) -> float | None:
    """Return the largest step that meets the accuracy.

    It is interpolated or, below the finest measured step, extrapolated by the order. None if the measured points show
    no such step.
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
    if first == len(points):  # a coarse step meets the accuracy by chance, but the finest does not
        return _extrapolated_step(points, accuracy, order)
    if first == 0:
        return points[0].step
    return _interpolated_step(points[first - 1], points[first], accuracy)


def _extrapolated_step(points: Sequence[Point], accuracy: float, order: int) -> float | None:
    """Return a step below the finest, extrapolated to the accuracy; None if rounding errors exceed the accuracy."""
    last = points[-1]
    if at_floor(points) or accuracy < max(ROUNDING, last.rounding):
        return None
    return last.step * math.pow(accuracy / last.error, 1 / order)


def cheapest_step(points: Sequence[Point], accuracy: float, order: int) -> tuple[float, float]:
    """Return the step that meets the accuracy at the least cost, and its nanoseconds per unit of time.

    The result is 0 and infinity if there is no such step. The cheapest step need not be the largest: smaller steps have
    better predictors, and may save an iteration.
    """
    largest = step_for(points, accuracy, order)
    if largest is None:
        return 0.0, math.inf
    options = [(nanoseconds_at(points, largest) / largest, largest)]
    options += [(p.cost, p.step) for p in points if p.step < largest and p.error <= accuracy]
    cost, step = min(options)
    return step, cost


def _interpolated_step(coarse: Point, fine: Point, accuracy: float) -> float:
    """Return the step that meets the accuracy on a straight line through two points in log–log scale."""
    if coarse.error <= fine.error:
        return fine.step
    share = math.log(accuracy / fine.error) / math.log(coarse.error / fine.error)
    return fine.step * math.pow(coarse.step / fine.step, min(max(share, 0.0), 1.0))


def nanoseconds_at(points: Sequence[Point], step: float) -> float:
    """Return the time of one step, interpolated between measured steps; outside their range, that of the nearest
    step."""
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
    """Return points measured from the largest possible step down to the accuracy and to the cheapest step.

    The first step is at most ``largest_step``. The scan ends early if the accuracy would cost more than ``worth``
    nanoseconds per unit of time, if only rounding errors are left, or if ``patience`` returns False.
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
    """Whether the scan is complete.

    It is, if the accuracy is reached and finer steps cost more, or if only rounding errors are left.
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
    """Return the points with one more measured point, unless the step was measured before."""
    if not points or not step or not points[-1].step < step < points[0].step or not patience():
        return points
    if any(abs(math.log(p.step / step)) < 0.02 for p in points):
        return points
    point = measure(step)
    return sorted([*points, point], key=lambda p: -p.step) if point else points


def _points_at_largest_step(
    measure: Callable[[float], Point | None], first: float, largest_step: float, patience: Callable[[], bool]
) -> list[Point]:
    """Return points up to the largest possible step, found to a factor `FINER` from a first guess; [] if there is
    none near it."""
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
    """Whether the accuracy, extrapolated by the order, would cost more than ``worth``."""
    last = points[-1]
    if last.cost > worth and last.error > accuracy:
        return True
    if len(points) < 4 or last.error > 1e-2 or last.error <= accuracy:
        return False
    gain = math.log(points[-3].error / last.error) / math.log(points[-3].step / last.step)
    step = last.step * math.pow(accuracy / last.error, 1 / max(gain, order, 1))
    return last.nanoseconds / step > worth


def proposals(tried_curves: Mapping[Setting, Curve], refused: Sequence[Setting], accuracy: float) -> list[Setting]:
    """Return the settings to try next, the most promising first; empty if none is promising.

    A bi-realisation whose cost is near the best is tried at the next higher order while the cost decreases, then at the
    next lower one. The best one is also tried without gauge and as a composition.
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
    """Return the next higher order if it was neither tried nor refused, else the next lower one."""
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
    """Return a step rounded down to few digits."""
    exponent = math.floor(math.log10(step)) - digits + 1
    rounded = float(f"{math.floor(step / 10.0**exponent + 1e-9)}e{exponent}")
    return rounded if rounded <= step else step
