"""Steps of the compiled C beside the exact map, in many digits: how far a bound is from what occurs."""

from __future__ import annotations

import ctypes
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from flint import arb, arb_mat, ctx

from phigen.certify.checker.explicit_steps import beyond, prepared
from phigen.certify.checker.rounding import Tape, play

#: Bits of the exact map.
BITS = 300

#: Newton's iterations, and sweeps over the stages of a Gauss method, that reach that precision.
NEWTON_ITERATIONS, SWEEPS = 12, 250

#: A last correction, or change by a sweep, after which the rest is negligible.
SOLVED = 1e-40

Numbers = Sequence[Any]


@contextmanager
def _precise() -> Iterator[None]:
    before, ctx.prec = ctx.prec, BITS
    try:
        yield
    finally:
        ctx.prec = before


def exact_step(c: Mapping[str, Any], x: Numbers, t: float) -> list[Any]:
    """Return the exact map of a certificate at a point, as balls of `BITS` bits."""
    with _precise():
        tape = Tape(c["series"], c["ulps"], exact=True)
        return _EXACT[c["kind"]](c, tape, [arb(v) for v in x], arb(t))


def _explicit(c: Mapping[str, Any], tape: Tape, x: list[Any], t: Any) -> list[Any]:
    state = [tape.value(v) for v in x]
    out = play(c["kernels"]["explicit"], tape.number, coef=prepared(c, tape, t, 0), state=state)
    return [v + d.x for v, d in zip(x, out["increment"], strict=True)]


def _splitting(c: Mapping[str, Any], tape: Tape, x: list[Any], t: Any) -> list[Any]:
    state = [tape.value(v) for v in x] + [tape.value(arb(0)) for _ in range(beyond(c))]
    for flow, row in c["schedule"]:
        coef = prepared(c, tape, t, row)
        change = play(c["kernels"][f"change{flow}"], tape.number, coef=coef, state=state)["change"]
        for i, j in c["moves"][str(flow)]:
            state[i] = state[i] + change[j]
    return [v.x for v in state[: len(x)]]


def _newton(c: Mapping[str, Any], tape: Tape, x: list[Any], t: Any) -> list[Any]:
    n = len(x)
    for stage in range(len(c["fractions"])):
        y, coef = x, prepared(c, tape, t, stage)
        for _ in range(NEWTON_ITERATIONS):
            out = play(c["kernels"]["linearise"], tape.number, coef=coef, y=[tape.value(v) for v in y])
            residual = [[a - b + d.x] for a, b, d in zip(y, x, out["displacement"], strict=True)]
            matrix = arb_mat(n, n, [arb(v.x.mid()) for v in out["jacobian"]])
            delta = matrix.solve(arb_mat(residual)).entries()
            y = [arb((a - d).mid()) for a, d in zip(y, delta, strict=True)]
            if all(abs(d) < SOLVED for d in delta):
                break
        x = [a + v.x for a, v in zip(x, out["increment"], strict=True)]
    return x


def _gauss(c: Mapping[str, Any], tape: Tape, x: list[Any], t: Any) -> list[Any]:
    stages, n = range(len(c["weights"])), len(c["kernels"]["stage_field"]["outputs"]["move"])
    coef = prepared(c, tape, t, 0)
    point = [*(tape.value(v) for v in x), *([tape.value(t)] if c["timed"] else [])]
    moves = [[arb(0)] * n for _ in stages]
    for _ in range(SWEEPS):
        before, moves = moves, []
        for i in stages:
            z = [sum((arb(c["mixing"][j][i]) * before[j][k] for j in stages), arb(0)) for k in range(n)]
            w = [tape.number(c["step"]) * tape.number(c["weights"][i])]
            sweep = play(
                c["kernels"]["stage_field"], tape.number, coef=coef, x=point, z=[tape.value(v) for v in z], w=w
            )
            moves.append([arb(v.x.mid()) for v in sweep["move"]])
        if all(abs(a - b) < SOLVED for m, p in zip(moves, before, strict=True) for a, b in zip(m, p, strict=True)):
            break
    ends = [tape.value(sum((m[k] for m in moves), arb(0))) for k in range(n)]
    out = play(c["kernels"]["stage_change"], tape.number, coef=coef, x=point, z=ends)
    return [v + d.x for v, d in zip(x, out["change"], strict=True)]


_EXACT: Mapping[str, Callable[[Mapping[str, Any], Tape, list[Any], Any], list[Any]]] = {
    "explicit": _explicit,
    "splitting": _splitting,
    "newton": _newton,
    "gauss": _gauss,
}


def observed(c: Mapping[str, Any], library: Any, count: int, seed: int = 0) -> list[float]:
    """Return the largest distance of each coordinate from the exact map, of steps from random states in the domain.

    Half of the states have a random compensation term too. ``library`` is the compiled C. Raises `RuntimeError` if a
    step fails.
    """
    draw, worst = random.Random(seed), [0.0] * len(c["domain"])
    for k in range(count):
        x = [draw.uniform(*d) for d in c["domain"]]
        carry = [draw.uniform(-0.5, 0.5) * 2.0**-52 * abs(v) * (k % 2) / 2 for v in x]
        t = draw.uniform(*c["time"])
        after = one_step(c, library, x, carry, t)
        with _precise():
            exact = exact_step(c, [arb(a) + arb(b) for a, b in zip(x, carry, strict=True)], t)
            errors = [float(abs(arb(a) + arb(b) - e)) for a, b, e in zip(*after, exact, strict=True)]
        worst = [max(pair) for pair in zip(worst, errors, strict=True)]
    return worst


def one_step(
    c: Mapping[str, Any], library: Any, x: Sequence[float], carry: Sequence[float], t: float
) -> tuple[list[float], list[float]]:
    """Return state and compensation after one step of the compiled C. Raises `RuntimeError` if the step fails."""
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
    solver = (ctypes.c_double * (2 * n)).from_buffer(room)  # begins with the state and its compensation
    solver[n:] = list(carry)
    if status or getattr(library, f"{name}_step")(room, ctypes.c_double(c["step"])):
        raise RuntimeError(f"a step of {name} fails at {list(x)}")
    return list(solver[:n]), list(solver[n:])
