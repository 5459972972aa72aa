"""Measurement of errors of a solver in single precision, by comparison with the solver in double precision."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from phigen.geometry.conservation import largest_terms, rounding
from phigen.geometry.system import System
from phigen.study.methods import Method, size_of
from phigen.study.summary import summarise
from phigen.symbolic.arrays import Floats

#: Ratio of the rounding units of single precision (24 binary digits) and double precision (53 binary digits).
COARSER = 2.0**29
#: Largest accepted difference between a step in single and in double precision, relative to the state: 32 rounding
#: units of single precision.
ONE_STEP = 2.0**-19

#: Result of a check: its name, the measured value and the limit.
Measured = tuple[str, float, float]
#: Function of a state and a step size that returns the state after a step.
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
    """Yield the results of checks of a solver in single precision.

    Steps of size h from ``states`` are compared with steps in double precision. The Casimirs are checked along a run
    with ``steps`` steps from ``start`` at the time ``t0``.
    """
    apart = farthest(single.step, double.step, states, h)
    yield "single precision: a step against double precision", apart, ONE_STEP
    rows, times = single.rows(start, h, steps, 1), t0 + h * np.arange(steps + 1.0)
    columns = dict(zip(system.coordinates, rows.T, strict=True))
    summary = summarise(single.name, system, None, parameters, times, rows)
    for name, drift in summary.casimirs.items():
        casimir = system.casimirs[name]
        if system.forced_rate_of_casimir(casimir).is_zero:
            terms = largest_terms(casimir, list(columns), {**parameters, **columns})
            yield f"single precision: Casimir {name}", drift.error, COARSER * rounding(steps) * terms / drift.unit.size


def farthest(single: Step, double: Step, states: Sequence[Floats], h: float) -> float:
    """Return the largest difference between steps in single and in double precision, relative to the state.

    Both steps begin at the same state, which is one of ``states``, rounded to single precision.
    """
    worst = 0.0
    for x in states:
        rounded = x.astype(np.float32).astype(np.float64)
        image = double(rounded, h)
        worst = max(worst, float(np.max(np.abs(single(rounded, h) - image))) / size_of(image))
    return worst
