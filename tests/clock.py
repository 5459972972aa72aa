"""Limits on processor time that a slow or busy machine does not exceed: seconds of the machine that chose them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

#: Processor seconds that `reference_work` took on that machine with nothing else running (AVX2, 2.5 GHz, Python 3.11).
REFERENCE_SECONDS = 0.050


def reference_work() -> int:
    """Sort, hash and add: some work of the kind that Python does in compilers."""
    table = {str(i * 7919 % 65537): i for i in range(65_000)}
    return sum(table[name] for name in sorted(table))


def slowness() -> float:
    """How many times as long as on that machine processor work takes now; at least 1."""
    begin = time.process_time()
    reference_work()
    return max(1.0, (time.process_time() - begin) / REFERENCE_SECONDS)


@contextmanager
def processor_seconds_below(limit: float) -> Iterator[None]:
    """Fail if the body takes more processor time than `limit`, in seconds of that machine."""
    begin = time.process_time()
    yield
    spent = time.process_time() - begin
    if spent >= limit:
        spent /= slowness()
    assert spent < limit, f"{spent:.2f} s of processor time in place of {limit:g}"
