"""Measurement of the time that one step takes in a long run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from phigen.runtime.interface import BackendError
from phigen.tuning.problem import CompiledMethod

#: Least duration of a measurement of time, in seconds.
LEAST_SECONDS = 2e-3
#: A run is timed in parts. The first part has FEW_STEPS steps. Each further part has at least as many steps as all
#: parts before it together. A part that would take less than LEAST_SECONDS has more steps, up to PART_STEPS. No part
#: begins after TIMED_STEPS steps.
FEW_STEPS, PART_STEPS, TIMED_STEPS = 64, 4096, 32_768


def nanoseconds_per_step(method: CompiledMethod, h: float, steps: int) -> float:
    """Return the processor time of a step of size ``h`` in nanoseconds, in a run of ``steps`` steps; NaN if steps fail.

    The result is the smallest of several measurements. It does not contain the call from Python, nor work that is done
    once for a run, such as the choice of a gauge.
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
    """Time the beginning of a run; return the measured seconds, and the estimated seconds of all ``steps``
    steps.

    The first steps of a solver in C are slower than later ones, for two reasons: the predictor is not fitted yet, and
    steps are not made in blocks yet. So the run is timed in parts of increasing length, until a part takes long enough.
    The time of the remaining steps is estimated from the last part.
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
