"""Errors of single precision, by comparison with a solver in double precision."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from phigen.geometry.conservation import largest_terms, rounding
from phigen.geometry.system import System
from phigen.study.methods import Method
from phigen.study.summary import summarise
from phigen.symbolic.arrays import Floats

#: Rounding unit of single precision (24 binary digits) in rounding units of double precision (53 binary digits).
COARSER = 2.0**29
#: Limit for the difference between steps in single and in double precision, relative to the state.
ONE_STEP = 2.0**-19

#: Name, value and limit.
Measured = tuple[str, float, float]
#: Function that makes a step of size h from a state.
Step = Callable[[Floats, float], Floats]


def measured(
    system: System,
    single: Method,
    double: Method,
    states: Sequence[Floats],
    start: Floats,
    h: float,
    steps: int,
    parameters: Mapping[str, float],
    t0: float,
) -> Iterator[Measured]:
    """Yield the differences of steps in single from steps in double precision, and the Casimir errors of a run."""
    apart = farthest(single.step, double.step, states, h)
    yield "single precision: a step, beside double", apart, ONE_STEP
    rows, times = single.rows(start, h, steps, 1), t0 + h * np.arange(steps + 1.0)
    columns = dict(zip(system.coordinates, rows.T, strict=True))
    summary = summarise(single.name, system, None, parameters, times, rows)
    for name, drift in summary.casimirs.items():
        casimir = system.casimirs[name]
        if system.forced_rate_of_casimir(casimir).is_zero:
            terms = largest_terms(casimir, list(columns), {**parameters, **columns})
            yield f"single precision: Casimir {name}", drift.error, COARSER * rounding(steps) * terms / drift.unit.size


def farthest(single: Step, double: Step, states: Sequence[Floats], h: float) -> float:
    """Return the largest relative difference of steps in single precision from the same states, rounded to single
    precision."""
    worst = 0.0
    for x in states:
        rounded = x.astype(np.float32).astype(np.float64)
        image = double(rounded, h)
        worst = max(worst, float(np.max(np.abs(single(rounded, h) - image)) / np.max(np.abs(image))))
    return worst
