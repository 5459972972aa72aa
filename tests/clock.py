"""Limits on processor time that do not depend on the speed or load of the machine: seconds are those of a reference
machine, and measured times are scaled by the time that a fixed task takes here.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

#: Processor seconds that `reference_work` takes on the idle reference machine (AVX2, 2.5 GHz, Python 3.11).
REFERENCE_SECONDS = 0.050


def reference_work() -> int:
    """Sort, hash and add: a fixed task that resembles the work of the phigen compiler."""
    table = {str(i * 7919 % 65537): i for i in range(65_000)}
    return sum(table[name] for name in sorted(table))


def slowness() -> float:
    """Return the factor by which this machine is slower at present than the reference machine, at least 1: the ratio of
    the processor times of `reference_work`.
    """
    begin = time.process_time()
    reference_work()
    return max(1.0, (time.process_time() - begin) / REFERENCE_SECONDS)


@contextmanager
def processor_seconds_below(limit: float) -> Iterator[None]:
    """Fail if the body of the ``with`` takes more processor time than `limit`, in seconds of the reference machine."""
    begin = time.process_time()
    yield
    spent = time.process_time() - begin
    if spent >= limit:
        spent /= slowness()
    assert spent < limit, f"{spent:.2f} s of processor time; the limit is {limit:g} s"
