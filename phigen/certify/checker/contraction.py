"""Steps by Gauss collocation: fixed-point sweeps over all stages, and where they end."""

from __future__ import annotations

from typing import Any

from flint import arb

from .explicit_steps import Certificate, finished, prepared
from .rounding import BALL, CARRY, ZERO, Ball, Balls, Tape, U, demand, interval, mag, play, square, top


def gauss(c: Certificate, X: Balls, T: Ball, leaf: Certificate) -> tuple[Balls, Balls]:
    """Fixed-point sweeps: a contraction of the box of unknowns, the same at all stages, by q in a scaled norm."""
    Z, mixing = [interval(z) for z in leaf["z"]], [[arb(v) for v in row] for row in zip(*c["mixing"], strict=True)]
    n, stages, moves, errors, slopes = len(Z), len(mixing), [], [], []
    for weight in c["weights"]:
        tape = Tape(c["series"], c["ulps"])
        point = [*(tape.value(x, (), CARRY * mag(x)) for x in X), *([tape.value(T)] if c["timed"] else [])]
        z, w = [tape.value(v) for v in Z], tape.number(c["step"]) * tape.number(weight)
        coef = prepared(c, tape, T, 0)
        out = play(c["kernels"]["stage_field"], tape.number, coef=coef, x=point, z=z, w=[w])["move"]
        back = [tape.derivatives(v) for v in out]
        moves.append([v.x for v in out])
        errors.append([tape.error(v, s) for v, s in zip(out, back, strict=True)])
        slopes.append([[ZERO if s[v.index] is None else mag(s[v.index]) for v in z] for s in back])
    at, all_stages = range(n), range(stages)
    mixed = [[sum((mixing[i][j] * moves[j][k] for j in all_stages), ZERO) for k in at] for i in all_stages]
    rounded = [(stages + 2) * U * top(sum((abs(r[j]) * mag(moves[j][k]) for j in all_stages), ZERO) for r in mixing)
               for k in at]  # fmt: skip
    inside = all(Z[k].contains_interior(m[k] + BALL * rounded[k]) and 0 in Z[k] for m in mixed for k in at)
    demand(inside, "the sweeps over the stages may leave the box of the unknowns")
    norm = sum((square(x) for x in X), ZERO)
    size = [norm.upper().sqrt() if k < c["plain"] else arb(1) for k in at]
    ratio = norm.upper().sqrt() / norm.lower().sqrt() if c["plain"] else arb(1)
    share = [arb(w) / max(c["weights"]) for w in c["weights"]]  # |move of stage j| <= share_j size_k, in the norm
    spread = [sum((abs(v) * s for v, s in zip(row, share, strict=True)), ZERO) for row in mixing]
    turns = [[sum((g[k][m] * size[m] for m in at), ZERO) for k in at] for g in slopes]
    noise = [[e[k] + sum((g[k][m] * rounded[m] for m in at), ZERO) for k in at]
             for e, g in zip(errors, slopes, strict=True)]  # fmt: skip
    q = top(turns[j][k] * spread[j] / (share[j] * size[k]) for j in all_stages for k in at)
    demand(q < 1, f"the sweeps over the stages contract by {float(q):.3g} only")
    shaken = top(noise[j][k] / (share[j] * size[k]) for j in all_stages for k in at)
    contraction = in_stages(slopes, size, mixing, noise, ratio)
    slow, risen = (stalled(contraction, part, most) for part, most in (("0.8", "4.1e-16"), ("1", "2.1e-14")))
    change = top([arb("2.1e-18") / c["rate"], slow, risen])
    change = -change * arb(stages).sqrt() / top(-s for s in share)  # the C measures the mean over the stages
    left = change + (q * change + shaken) / (1 - q)  # distance of the moves of the last sweep but one
    missed = [sum((noise[j][k] + turns[j][k] * spread[j] * left for j in all_stages), ZERO) for k in at]
    tape = Tape(c["series"], c["ulps"])
    point = [*(tape.value(x, (), CARRY * mag(x)) for x in X), *([tape.value(T)] if c["timed"] else [])]
    ends = [sum((m[k] for m in moves), ZERO) for k in at]
    ends = [tape.value(ends[k], (), missed[k] + stages * U * sum((mag(m[k]) for m in moves), ZERO)) for k in at]
    out = play(c["kernels"]["stage_change"], tape.number, coef=prepared(c, tape, T, 0), x=point, z=ends)["change"]
    return finished(tape, X, out)


def in_stages(
    slopes: list[Any], size: Balls, mixing: list[Balls], noise: list[Balls], ratio: Ball
) -> tuple[Ball, Ball]:
    """The contraction by a sweep, and its noise, in the norm of the C: the root of the mean square over stages."""
    n, factors = len(size), []
    for g, row in zip(slopes, mixing, strict=True):
        g = [[g[k][m] * size[m] / size[k] for m in range(n)] for k in range(n)]
        across, down = top(sum(r, ZERO) for r in g), top(sum(r, ZERO) for r in zip(*g, strict=True))
        factors.append((across * down).sqrt() * (len(row) * sum((square(v) for v in row), ZERO)).sqrt())
    return ratio * top(factors), 2 * ratio * top(
        sum((v / s for v, s in zip(e, size, strict=True)), ZERO) for e in noise
    )


def stalled(contraction: tuple[Ball, Ball], part: str, most: str) -> Ball:
    """Largest change by a sweep that changes more than a part of what the one before did, and at most a number."""
    q, noise = contraction
    return (q * noise / (arb(part) - q) + noise).min(arb(most)) if q < arb(part) else arb(most)
