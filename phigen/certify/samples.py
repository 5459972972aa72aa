"""Measurement of rounding errors: steps of the compiled C are compared with the exact map, which is computed in high
precision.

The measured errors show how much larger the certified bounds are.
"""

from __future__ import annotations

import ctypes
import random
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from flint import arb, arb_mat, ctx

from phigen import progress
from phigen.certify.checker import identity, run_of

#: Precision in bits for the computation of the exact map.
BITS = 300

#: Largest number of corrections that solve the equation of a stage. Convergence is only linear, since the matrix is
#: computed once.
CORRECTIONS = 400

#: The equation of a stage counts as solved if all corrections of the unknowns are smaller than this number.
SOLVED = 1e-40

Numbers = Sequence[Any]


@contextmanager
def _precise() -> Iterator[None]:
    previous_precision, ctx.prec = ctx.prec, BITS
    try:
        yield
    finally:
        ctx.prec = previous_precision


class ExactMap:
    """The map that a step of a solver approximates, computed in high precision.

    ``c`` is the result of `phigen.certify.prove.described` with ``exact``.
    """

    def __init__(self, c: Mapping[str, Any]) -> None:
        self._c = c
        self._inverses: dict[int, Any] = {}

    def __call__(self, x: Numbers, t: float) -> list[Any]:
        """Return the state after a step from the state x at the time t, in `BITS` bits."""
        with _precise():
            x, t = [arb(v) for v in x], arb(t)
            for number, stage in enumerate(self._c["stages"]):
                u = self._solve_stage(number, stage, x, t) if "equation" in stage else []
                run = run_of(self._c, stage, x, t, {}, u, exact=True)
                x = [arb((v + run.x[k]).mid()) for v, k in zip(x, stage["change"], strict=True)]
            return x

    def _solve_stage(self, number: int, stage: Mapping[str, Any], x: Numbers, t: Any) -> list[Any]:
        """Return the unknowns of an implicit stage, by Newton's method with a matrix that is computed once."""
        base = x if stage["based"] else [arb(0)] * len(stage["equation"])
        start = run_of(self._c, stage, x, t, {}, base, exact=True)
        u = [arb(start.x[k].mid()) for k in stage["start"]]
        for _ in range(CORRECTIONS):
            run = run_of(self._c, stage, x, t, {}, u, exact=True)
            residual = [[v - b + run.x[k]] for v, b, k in zip(u, base, stage["equation"], strict=True)]
            if number not in self._inverses:
                jacobian = run.outputs(stage["equation"], {"u": len(u)})[2]
                matrix = identity(len(u)) + jacobian
                self._inverses[number] = arb_mat(len(u), len(u), [arb(v.mid()) for v in matrix.entries()]).inv()
            delta = (self._inverses[number] * arb_mat(residual)).entries()
            u = [arb((v - d).mid()) for v, d in zip(u, delta, strict=True)]
            if all(abs(d.mid()) < SOLVED for d in delta):
                return u
        raise RuntimeError(f"Newton's method does not solve the equation of the exact map at {[float(v) for v in x]}")


def observed(c: Mapping[str, Any], exact: Mapping[str, Any], library: Any, count: int, seed: int = 0) -> list[float]:
    """Return the largest error of each coordinate in ``count`` steps of the compiled C from random states in the
    domain.

    ``c`` is the certificate. Errors are differences from the exact map, which ``exact`` describes. ``library`` is the
    compiled C. Every second state also has a random compensation term. Raises `RuntimeError` if a step fails.
    """
    exact_step = ExactMap(exact)
    draw, worst = random.Random(seed), [0.0] * len(c["domain"])
    with progress.stage(f"{c['name']}: steps compared with the exact map", count) as running:
        for k in range(count):
            x = [draw.uniform(*d) for d in c["domain"]]
            carry = [draw.uniform(-0.5, 0.5) * 2.0**-52 * abs(v) * (k % 2) / 2 for v in x]
            t = draw.uniform(*c["time"])
            computed = one_step(c, library, x, carry, t)
            with _precise():
                exact_image = exact_step([arb(a) + arb(b) for a, b in zip(x, carry, strict=True)], t)
                errors = [float(abs(arb(a) + arb(b) - e)) for a, b, e in zip(*computed, exact_image, strict=True)]
            worst = [max(pair) for pair in zip(worst, errors, strict=True)]
            running.done = k + 1
    return worst


def one_step(
    c: Mapping[str, Any], library: Any, x: Sequence[float], carry: Sequence[float], t: float
) -> tuple[list[float], list[float]]:
    """Return state and compensation term after one step of the compiled C. Raises `RuntimeError` if the step fails."""
    n, name = len(x), c["name"]
    numbers = ctypes.c_double * n
    size = getattr(library, f"{name}_solver_size")
    size.restype = ctypes.c_size_t
    room = ctypes.create_string_buffer(size())
    values = list(c["parameters"].values())
    parameters = (ctypes.c_double * max(1, len(values)))(*values)
    start: list[Any] = [room, parameters, numbers(*x)]
    if c["timed"]:
        status = getattr(library, f"{name}_init_at")(*start, ctypes.c_double(t))
    elif c["gauge"]:
        gauge = (ctypes.c_double * len(c["gauge"]))(*c["gauge"])
        status = getattr(library, f"{name}_init_gauge")(*start, gauge)
    else:
        status = getattr(library, f"{name}_init")(*start)
    # the first members of the struct are the state and its compensation term
    solver = (ctypes.c_double * (2 * n)).from_buffer(room)
    solver[n:] = list(carry)
    if status or getattr(library, f"{name}_step")(room, ctypes.c_double(c["step"])):
        raise RuntimeError(f"a step of {name} fails at {list(x)}")
    return list(solver[:n]), list(solver[n:])
