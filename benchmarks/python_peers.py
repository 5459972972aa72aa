"""Peers that Python users would pick: scipy, and heyoka and numba where installed (``pip install -e '.[bench]'``)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sympy

from benchmarks.problems import Problem
from benchmarks.solvers import Method, Run

Field = Callable[[float, np.ndarray], Any]


def available(problem: Problem) -> tuple[list[Method], list[str]]:
    """The methods, and a line for each package that is missing or failed."""
    methods, missing = [], []
    for name, build in (("scipy", _scipy), ("numba", _numba), ("heyoka", _heyoka)):
        try:
            methods.append(build(problem))
        except ImportError:
            missing.append(f"{name} is not installed")
        except Exception as error:  # a peer that breaks is reported; the others still run
            missing.append(f"{name} failed: {error!r}"[:200])
    return methods, missing


def _scipy(problem: Problem) -> Method:
    from scipy.integrate import solve_ivp

    f = sympy.lambdify(problem.symbols, problem.field, "math")
    rhs: Field = lambda t, x: f(*x)  # noqa: E731

    def run(start: Sequence[float], tolerance: float, chunk: float, chunks: int, limit: float) -> Run:
        began = time.thread_time()
        span = float(chunk)  # for adaptive methods a chunk is a time
        states, x, evaluations, status = np.full((chunks, len(start)), np.nan), np.array(start), 0, "ok"
        for c in range(chunks):
            found = solve_ivp(rhs, (0.0, span), x, "DOP853", rtol=tolerance, atol=tolerance)
            states[c] = x = found.y[:, -1]
            evaluations += found.nfev
            if time.thread_time() - began > limit and c + 1 < chunks:
                status = "too slow"
                break
        return Run(states, time.thread_time() - began, evaluations // 12, evaluations, status)

    return Method("scipy DOP853", run, 8, step_based=False)


def _numba(problem: Problem) -> Method:
    import numba

    names = ", ".join(problem.coordinates)
    body = "\n".join(f"    f[{i}] = {sympy.pycode(e)}" for i, e in enumerate(problem.field))
    space: dict[str, Any] = {"math": __import__("math")}
    exec(f"def field(x, f):\n    {names}, = x\n{body}\n".replace(f"{names}, = x", _unpacked(problem)), space)
    field = numba.njit(space["field"])

    @numba.njit
    def rk4(x: Any, h: float, steps: int) -> None:
        k1, k2, k3, k4, y = np.empty_like(x), np.empty_like(x), np.empty_like(x), np.empty_like(x), np.empty_like(x)
        for _ in range(steps):
            field(x, k1)
            for i in range(x.size):
                y[i] = x[i] + 0.5 * h * k1[i]
            field(y, k2)
            for i in range(x.size):
                y[i] = x[i] + 0.5 * h * k2[i]
            field(y, k3)
            for i in range(x.size):
                y[i] = x[i] + h * k3[i]
            field(y, k4)
            for i in range(x.size):
                x[i] += h / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i])

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

    return Method("RK4 with numba", run, 4)


def _unpacked(problem: Problem) -> str:
    return "; ".join(f"{c} = x[{i}]" for i, c in enumerate(problem.coordinates))


def _heyoka(problem: Problem) -> Method:
    import heyoka

    variables = heyoka.make_vars(*problem.coordinates)
    table = dict(zip(problem.symbols, variables, strict=True))
    system = [(v, heyoka.from_sympy(sympy.N(e, 17), table)) for v, e in zip(variables, problem.field, strict=True)]
    solvers: dict[float, Any] = {}

    def run(start: Sequence[float], tolerance: float, chunk: float, chunks: int, limit: float) -> Run:
        if tolerance not in solvers:
            accurate = tolerance < 1e-15
            solvers[tolerance] = heyoka.taylor_adaptive(system, list(start), tol=tolerance, high_accuracy=accurate)
        solver = solvers[tolerance]
        solver.time = 0.0
        solver.state[:] = start
        began = time.thread_time()
        steps = solver.propagate_until(float(chunk * chunks))[3]
        seconds = time.thread_time() - began
        solver.time = 0.0
        solver.state[:] = start
        states = solver.propagate_grid(np.arange(chunks + 1) * float(chunk))[-1][1:]
        return Run(states, seconds, steps, 0, "ok" if np.isfinite(states).all() else "not finite")

    return Method("heyoka", run, 0, step_based=False)
