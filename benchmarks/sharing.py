"""Benchmark of a second core: ``python -m benchmarks.sharing``, on a machine with two idle cores.

Many rigid bodies with random initial values make 1,000 steps, once by a loop over `ensemble` with one thread and with
two, and once by a sweep with one worker and with two. Elapsed times are measured. The start of a sweep's processes,
measured by a very small sweep, is subtracted. With two cores, runs should be at least 1.8 times as fast.
"""

from __future__ import annotations

import os
import sys
import time

import numpy as np

import phigen

STEP, STEPS, CHUNK, FEW = 0.1, 1000, 50_000, 100


def looped(solver: phigen.Solver, starts: np.ndarray, threads: int) -> float:
    """Return the seconds in which an ensemble integrates all members, `CHUNK` members at a time."""
    begun = time.perf_counter()
    for first in range(0, len(starts), CHUNK):
        solver.ensemble(starts[first : first + CHUNK], STEP, STEPS, threads=threads)
    return time.perf_counter() - begun


def swept(members: int, workers: int) -> float:
    """Return the seconds of a whole sweep, including the start of its processes."""
    begun = time.perf_counter()
    between = {"from": 0.2, "to": 1.0}
    phigen.sweep(
        "rigid_body", over={"x1": between, "x2": between, "x3": between, "random": members, "seed": 1},
        initial=[1, 1, 1], h=STEP, steps=STEPS, keep=["final"], workers=workers,
    )  # fmt: skip
    return time.perf_counter() - begun


def main() -> None:
    members = 20_000 if "--quick" in sys.argv else 200_000
    solver = phigen.compile("rigid_body", target="c")
    starts = np.random.default_rng(1).uniform(0.2, 1.0, (members, 3))
    head = f"{members:,} members, {STEPS} steps, {os.cpu_count()} cores"
    print(f"| {head} | one, s | two, s | one / two |\n|---|---|---|---|")
    said("threads of one process", *(looped(solver, starts, threads) for threads in (1, 2)))
    swept(FEW, 2)  # not timed: it brings the files of packages and the compiled solver into memory
    starting = [swept(FEW, workers) for workers in (1, 2)]
    said("workers of a sweep", *(swept(members, k) - begun for k, begun in zip((1, 2), starting, strict=True)))
    said("starting these", *starting)


def said(what: str, one: float, two: float) -> None:
    """Print a row of the table: seconds with one and with two threads or workers, and their ratio."""
    print(f"| {what} | {one:.2f} | {two:.2f} | {one / two:.2f} |", flush=True)


if __name__ == "__main__":
    main()
