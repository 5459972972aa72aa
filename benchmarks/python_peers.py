"""Methods that Python users would choose: heyoka and numba, if ``pip install -e '.[bench]'`` has installed them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import sympy

from benchmarks.problems import Problem
from benchmarks.solvers import Method, Run


def available(problem: Problem) -> tuple[list[Method], list[str]]:
    """Return the methods, and a message for each package that is missing or failed."""
    methods, missing = [], []
    for name, build in (("numba", _numba), ("heyoka", _heyoka)):
        try:
            methods += build(problem)
        except ImportError:
            missing.append(f"{name} is not installed")
        except Exception as error:  # a failure of one package is reported, and does not stop the benchmark
            missing.append(f"{name} failed: {error!r}"[:200])
    return methods, missing


def _numba(problem: Problem) -> list[Method]:
    """Return RK4 compiled by numba, with scalars instead of arrays, and with contraction of products and sums as in
    C."""
    import numba

    space: dict[str, Any] = {"math": __import__("math")}
    exec(_rk4_source(problem), space)
    rk4 = numba.njit(fastmath={"contract"})(space["rk4"])
    rk4(np.array(problem.start), 1e-9, 1)

    def run(start: Sequence[float], h: float, chunk: int, chunks: int, limit: float) -> Run:
        x, states, status = np.array(start), np.full((chunks, len(start)), np.nan), "ok"
        began = time.thread_time()
        for c in range(chunks):
            rk4(x, h, chunk)
            states[c] = x
            if not np.isfinite(x).all():
                status = "not finite"
                break
            if time.thread_time() - began > limit and c + 1 < chunks:
                status = "too slow"
                break
        return Run(states, time.thread_time() - began, chunk * chunks, 0, status)

    return [Method("RK4 with numba", run, 4)]


def _rk4_source(problem: Problem) -> str:
    """Return the Python source of RK4, with all loops over coordinates written out."""
    names, body = problem.coordinates, []
    for stage, (before, part) in enumerate((("", 0.0), ("a", 0.5), ("b", 0.5), ("c", 1.0))):
        k = "abcd"[stage]
        at = {n: f"{n} + {part} * h * {before}_{n}" if before else n for n in names}
        body += [f"{n}_ = {at[n]}" for n in names]
        renamed = dict(zip(problem.symbols, (sympy.Symbol(f"{n}_") for n in names), strict=True))
        body += [f"{k}_{n} = {sympy.pycode(e.subs(renamed))}" for n, e in zip(names, problem.field, strict=True)]
    body += [f"{n} += h / 6 * (a_{n} + 2 * (b_{n} + c_{n}) + d_{n})" for n in names]
    steps = "\n".join(f"        {line}" for line in body)
    unpacked, packed = (
        "; ".join(f"{n} = x[{i}]" for i, n in enumerate(names)),
        "; ".join(f"x[{i}] = {n}" for i, n in enumerate(names)),
    )
    return f"def rk4(x, h, steps):\n    {unpacked}\n    for _ in range(steps):\n{steps}\n    {packed}\n"


def _heyoka(problem: Problem) -> list[Method]:
    """Return heyoka's Taylor method, with plain and with compensated sums."""
    import heyoka

    variables = heyoka.make_vars(*problem.coordinates)
    table = dict(zip(problem.symbols, variables, strict=True))
    system = [(v, heyoka.from_sympy(sympy.N(e, 17), table)) for v, e in zip(variables, problem.field, strict=True)]
    solvers: dict[tuple[float, bool], Any] = {}

    def run(
        start: Sequence[float], tolerance: float, chunk: float, chunks: int, limit: float, *, compensated: bool
    ) -> Run:
        key = tolerance, compensated
        if key not in solvers:
            solvers[key] = heyoka.taylor_adaptive(system, list(start), tol=tolerance, high_accuracy=compensated)
        solver = solvers[key]
        solver.time = 0.0
        solver.state[:] = start
        began = time.thread_time()
        steps = solver.propagate_until(float(chunk * chunks))[3]
        seconds = time.thread_time() - began
        solver.time = 0.0
        solver.state[:] = start
        states = solver.propagate_grid(np.arange(chunks + 1) * float(chunk))[-1][1:]
        return Run(states, seconds, steps, 0, "ok" if np.isfinite(states).all() else "not finite")

    return [
        Method("heyoka", partial(run, compensated=False), 0, step_based=False),
        Method("heyoka, high accuracy", partial(run, compensated=True), 0, step_based=False, row="heyoka",
               variant="compensated"),
    ]  # fmt: skip
