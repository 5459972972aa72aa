"""Gauss collocation in C with the stages in SIMD lanes: coefficients, predictors, and a library for each order."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from functools import cache as cached
from typing import Any

import mpmath
import numpy as np
import sympy

from benchmarks.problems import Problem
from benchmarks.solvers import Method, Run, Runner, field_source, runner_of, texts
from phigen.runtime import cache

ORDERS = (4, 8, 12, 16)
ROW = "Gauss, SIMD, in C"

#: Number of past steps that the predictor uses, the same as in c/gauss_lanes.h.
HISTORY = 2

#: Largest phase in radians by which an oscillation of the stage values L_j may advance in a step; each value gives one
#: predictor.
BANDS = (0.25, 0.5, 1.0, 2.0, 4.0)

#: Relative error of past L_j that the predictor assumes. It is larger than their rounding errors, so that the predictor
#: does not amplify these much.
NOISE = "1e-13"

#: Number of steps of the trial run that chooses the predictor.
TRIAL = 200

#: Error, relative to the state, at which fixed-point sweeps end: too small to show as a drift over 10⁷ steps.
TOLERANCE = "2e-18"


def lanes_methods(problem: Problem) -> list[Method]:
    """Return the Gauss methods of all `ORDERS` for the vector field of a problem; they share one row of a table."""
    return [lanes_method(problem, order) for order in ORDERS]


def lanes_method(problem: Problem, order: int) -> Method:
    run = tuned(lanes_source(field_source(problem, jacobian=False), order), order // 2)
    return Method(f"Gauss {order}, SIMD, in C", run, order, row=ROW, variant=f"order {order}")


def tuned(source: str, stages: int) -> Runner:
    """Return the method in a C source as a function that makes runs.

    For each step size, it uses the predictor that needs the fewest sweeps in a trial run, which is not timed.
    """
    library = cache.load({"main.c": source, **texts()})
    run, set_predictor = runner_of(library, 0), library.set_predictor
    set_predictor.argtypes = (ctypes.c_void_p,)
    chosen: dict[float, int] = {}

    def use(index: int) -> None:
        set_predictor(predictors(stages)[index].ctypes.data)

    def sweeps(index: int, start: Sequence[float], h: float) -> float:
        use(index)
        trial = run(start, h, TRIAL, 1, math.inf)
        return trial.evaluations if trial.status == "ok" else math.inf

    def with_best_predictor(start: Sequence[float], h: float, chunk: int, chunks: int, limit: float) -> Run:
        if h not in chosen:
            chosen[h] = min(range(len(BANDS)), key=lambda index: sweeps(index, start, h))
        use(chosen[h])
        return run(start, h, chunk, chunks, limit)

    return with_best_predictor


def lanes_source(field: str, order: int) -> str:
    """Return the C source of a Gauss method. ``field`` is C that defines DIM and the vector field as a function
    `field`."""
    stages = order // 2
    _, a, b = collocation(stages)
    mu = [a[i][j] / b[j] for i in range(stages) for j in range(stages)]
    return "\n".join(
        [
            f"#define _POSIX_C_SOURCE 199309L\n#define STAGES {stages}\n#define TOLERANCE {TOLERANCE}",
            '#include "vectors.h"\n#include "common.h"\n#include "vector_functions.h"',
            field,
            _table("lanes_mu", mu),
            _table("lanes_b", b),
            '#include "gauss_lanes.h"',
            "static void reset(void) { memset(&gauss, 0, sizeof gauss); }",
            "static void (*const methods[])(double *, double, long) = { gauss_lanes };",
            '#include "run_peers.h"\n',
        ]
    )


def _table(name: str, values: Sequence[Any]) -> str:
    return f"static const double {name}[] = {{ {', '.join(mpmath.nstr(v, 20) for v in values)} }};"


@cached
def collocation(stages: int) -> tuple[list[Any], list[list[Any]], list[Any]]:
    """Return nodes, matrix and weights of a Gauss method with 50 digits."""
    with mpmath.workdps(70):
        t = sympy.Symbol("t")
        legendre = sympy.Poly(sympy.legendre(stages, 2 * t - 1), t)
        found = mpmath.polyroots([int(v) for v in legendre.all_coeffs()], maxsteps=300, extraprec=300)
        nodes = sorted(mpmath.re(root) for root in found)
        powers = mpmath.matrix([[c**k for k in range(stages)] for c in nodes])
        basis = powers**-1  # column j: coefficients of the polynomial that is 1 at node j and 0 at all other nodes

        def integral(j: int, end: Any) -> Any:
            return mpmath.fsum(basis[k, j] * end ** (k + 1) / (k + 1) for k in range(stages))

        matrix = [[integral(j, c) for j in range(stages)] for c in nodes]
        return nodes, matrix, [integral(j, mpmath.mpf(1)) for j in range(stages)]


@cached
def predictors(stages: int) -> list[np.ndarray]:
    """Return arrays [HISTORY, predicted stage, past stage] of the weights of past L_j/b_j, one array for each of
    `BANDS`."""
    return [_predictor(stages, band) for band in BANDS]


def _predictor(stages: int, band: float) -> np.ndarray:
    """Return the weights of the best linear prediction of a random signal from noisy values at the stages of past
    steps.

    The spectrum of the signal is flat up to the angular frequency ``band``, in radians per step.
    """
    with mpmath.workdps(60):
        nodes, _, _ = collocation(stages)
        past = [c - back for back in range(1, HISTORY + 1) for c in nodes]
        n = len(past)
        variance = mpmath.mpf(NOISE) ** 2
        correlation = mpmath.matrix(n, n)
        for i in range(n):
            for j in range(n):
                correlation[i, j] = mpmath.sinc(band * (past[i] - past[j])) + (variance if i == j else 0)
        with_next = mpmath.matrix([[mpmath.sinc(band * (p - c)) for c in nodes] for p in past])
        weights = correlation**-1 * with_next
        values = [float(weights[m, i]) for block in range(HISTORY) for i in range(stages)
                  for m in range(block * stages, (block + 1) * stages)]  # fmt: skip
        return np.array(values)
