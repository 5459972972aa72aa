"""The time of a step in a long run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from phigen.runtime.interface import BackendError
from phigen.tuning.problem import CompiledMethod

#: Least duration of a measurement of time, in seconds.
LEAST_SECONDS = 2e-3
#: Numbers of timed steps: in the first part of a run, in the largest of the parts that double, and in total.
FEW_STEPS, PART_STEPS, TIMED_STEPS = 64, 4096, 32_768


def nanoseconds_per_step(method: CompiledMethod, h: float, steps: int) -> float:
    """Return the CPU time of a step on this thread in nanoseconds, the fastest of several measurements; NaN if steps
    fail.

    Work that is done once, such as the choice of a gauge, and the call from Python are excluded.
    """
    fastest = call = math.inf
    spent = 0.0
    try:
        while spent < LEAST_SECONDS:
            walk = method.walk(h)
            walk(1)
            call = min(call, _seconds(walk, 1))
            seconds, expected = _run_seconds(method.walk(h), steps)
            fastest, spent = min(fastest, expected), spent + seconds
    except BackendError:
        return math.nan
    return 1e9 * max(fastest - call, 0.1 * fastest) / max(steps - 1, 1)


def _run_seconds(walk: Callable[[int], object], steps: int) -> tuple[float, float]:
    """Return the measured seconds, and the seconds that all steps of a run would take.

    Long runs are timed in part, until their steps are as fast as the remaining ones: a solver in C first fits its
    predictor, and then makes blocks of steps, several times as fast.
    """
    seconds, steps_done, part = 0.0, 0, min(FEW_STEPS, steps)
    while True:
        last = _seconds(walk, part)
        seconds, steps_done = seconds + last, steps_done + part
        if steps_done >= min(steps, TIMED_STEPS) or last >= LEAST_SECONDS:
            return seconds, seconds + last * (steps - steps_done) / part
        lasting = int(part * LEAST_SECONDS / last)
        part = min(max(steps_done, min(lasting, PART_STEPS)), steps - steps_done)


def _seconds(walk: Callable[[int], object], steps: int) -> float:
    start = time.thread_time()
    walk(steps)
    return max(time.thread_time() - start, 1e-8)
