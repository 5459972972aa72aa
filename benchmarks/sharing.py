"""What a second core brings: ``python -m benchmarks.sharing``, on a machine with two quiet cores.

Runs of 1,000 steps of the rigid body with random starts: by a plain loop over `ensemble`, with one thread and with two,
and by a sweep with one worker and with two. Elapsed times; those of a sweep are beyond what a very small one takes,
which is the start of its processes. Two should be worth 1.8 of one.
"""

from __future__ import annotations

import os
import sys
import time

import numpy as np

import phigen

STEP, STEPS, CHUNK, FEW = 0.1, 1000, 50_000, 100


def looped(solver: phigen.Solver, starts: np.ndarray, threads: int) -> float:
    """Seconds that all members take, a chunk at a time."""
    begun = time.perf_counter()
    for first in range(0, len(starts), CHUNK):
        solver.ensemble(starts[first : first + CHUNK], STEP, STEPS, threads=threads)
    return time.perf_counter() - begun


def swept(members: int, workers: int) -> float:
    """Seconds of a sweep in all."""
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
    swept(FEW, 2)  # files of packages and the compiled solver are in memory from here on
    starting = [swept(FEW, workers) for workers in (1, 2)]
    said("workers of a sweep", *(swept(members, k) - begun for k, begun in zip((1, 2), starting, strict=True)))
    said("starting these", *starting)


def said(what: str, one: float, two: float) -> None:
    """A row of the table."""
    print(f"| {what} | {one:.2f} | {two:.2f} | {one / two:.2f} |", flush=True)


if __name__ == "__main__":
    main()
