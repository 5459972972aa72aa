"""Explicit steps and splittings, and what the theorems of all kinds of steps share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .rounding import CARRY, ZERO, Ball, Balls, Tape, U, Value, mag, play

Certificate = Mapping[str, Any]


def prepared(c: Certificate, tape: Tape, T: Ball, stage: int) -> list[Value]:
    """The coefficients of a stage or row, from parameters, step and time."""
    h = tape.number(c["step"])
    if len(c["fractions"]) > 1:
        h = tape.number(c["fractions"][stage]) * h
    params = {name: tape.number(p) for name, p in c["parameters"].items()}
    gauge = [tape.number(g) for g in c["gauge"]]
    kick = list[Value]()
    if c.get("multiples"):  # of the modified potential, in units of the square of the whole step
        kick = [tape.number(c["multiples"][stage]) * (tape.number(c["step"]) * tape.number(c["step"]))]
    coef: list[Value] = play(c["kernels"]["prepare"], tape.number, params=params, gauge=gauge, h=[h], kick=kick)["coef"]
    if "at_time" in c["kernels"]:
        t = tape.value(T) + tape.number(c["middles"][stage]) * tape.number(c["step"])
        coef = coef + play(c["kernels"]["at_time"], tape.number, coef=coef, t=[t])["now"]
    return coef


def advanced(x: Ball, small: Ball) -> Ball:
    """Bound for the rounding of a compensated sum: of the part that is lost, of x, and of the new compensation."""
    return 8 * U * (U * mag(x) + small)


def finished(tape: Tape, X: Balls, change: Sequence[Value]) -> tuple[Balls, Balls]:
    """Bounds and image of x + change in compensated arithmetic."""
    image = [x + v.x for x, v in zip(X, change, strict=True)]
    lost = [advanced(y, CARRY * mag(x)) for x, y in zip(X, image, strict=True)]
    return [tape.error(v) + e for v, e in zip(change, lost, strict=True)], image


def explicit(c: Certificate, X: Balls, T: Ball, leaf: Certificate) -> tuple[Balls, Balls]:
    """Bounds and image of a step by a formula."""
    tape = Tape(c["series"], c["ulps"])
    state = [tape.value(x, (), CARRY * mag(x)) for x in X]  # kernels read x, not x + carry
    out = play(c["kernels"]["explicit"], tape.number, coef=prepared(c, tape, T, 0), state=state)["increment"]
    return finished(tape, X, out)


def beyond(c: Certificate) -> int:
    """The number of values beside the coordinates that flows change: with a monitor, the time and a logarithm."""
    last: int = max(i for pairs in c["moves"].values() for i, _ in pairs)
    return max(0, 1 + last - len(c["domain"]))


def splitting(c: Certificate, X: Balls, T: Ball, leaf: Certificate) -> tuple[Balls, Balls]:
    """Bounds and image of a step by flows, which add their changes to a sum."""
    tape = Tape(c["series"], c["ulps"])
    rows = [prepared(c, tape, T, row) for row in range(len(c["fractions"]))]
    base = [tape.value(x) for x in X] + [tape.value(ZERO) for _ in range(beyond(c))]
    moved = [tape.value(ZERO) for _ in base]
    state = [tape.value(b.x, ((b.index, 1),), CARRY * mag(b.x)) for b in base]
    for flow, row in c["schedule"]:
        change = play(c["kernels"][f"change{flow}"], tape.number, coef=rows[row], state=state)["change"]
        for i, j in c["moves"][str(flow)]:
            m, d, b = moved[i], change[j], base[i]
            rounding = U * (mag(m.x + d.x) + CARRY * mag(b.x))  # the sum begins with the carry
            moved[i] = m = tape.value(m.x + d.x, ((m.index, 1), (d.index, 1)), rounding)
            state[i] = tape.value(b.x + m.x, ((b.index, 1), (m.index, 1)), CARRY * mag(b.x + m.x))
    return [tape.error(m) for m in moved[: len(X)]], [v.x for v in state[: len(X)]]
