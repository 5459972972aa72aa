"""Checker of certificates: a script that needs python-flint, but nothing of phigen.

Usage: python checker.py NAME.bounds.json NAME.c. Numbers with uncertainty are balls (midpoint and radius) of flint.

In arguments, c is the certificate. X and T are intervals for the state and the time. ``leaf`` contains the boxes and
bounds that the certificate has for X and T. u and ``box`` are intervals for the unknowns of a stage.
"""

from __future__ import annotations

import hashlib
import json
import math
import operator
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from pathlib import Path
from typing import Any, TypeAlias

from flint import arb, arb_mat, ctx, fmpq, fmpq_poly

Ball: TypeAlias = Any  # flint.arb: an interval, given by midpoint and radius
Balls: TypeAlias = Any  # sequences of flint.arb
Matrix: TypeAlias = Any  # flint.arb_mat
BITS = 80  # precision of interval arithmetic in bits; doubles have 53
U, TINY, BALL, ZERO, ONE, HALF = arb(2) ** -53, arb(2) ** -1074, arb(0, 1), arb(0), arb(1), arb(0.5)
ROUNDED = arb("1.000001")  # safety factor for rounding errors in norms that the C computes
KRAWCZYK = "Krawczyk's test does not show that the equation of a step has one solution"
# Each number determines a point of a box, at which derivatives are compared.
POINTS = (0.318309886, 0.577215665, 0.869604401)
LESS_ACCURATE = ("sinh", "cosh", "tanh")  # glibc documents errors twice as large as those of the other functions
# the functions of libm that certificates cover: each with its derivative, in interval arithmetic
LIBM: Mapping[str, tuple[Callable[[Ball], Ball], Callable[[Ball], Ball]]] = {
    "sqrt": (arb.sqrt, lambda x: 1 / (2 * x.sqrt())), "exp": (arb.exp, arb.exp), "expm1": (arb.expm1, arb.exp),
    "log": (arb.log, lambda x: 1 / x), "log1p": (arb.log1p, lambda x: 1 / (1 + x)), "sin": (arb.sin, arb.cos),
    "cos": (arb.cos, lambda x: -x.sin()), "tan": (arb.tan, lambda x: 1 + square(x.tan())), "sinh": (arb.sinh, arb.cosh),
    "cosh": (arb.cosh, arb.sinh), "tanh": (arb.tanh, lambda x: 1 - square(x.tanh())),
}  # fmt: skip
EXACT = {"add": operator.add, "sub": operator.sub, "mul": operator.mul}
OPERATIONS: Mapping[str, Callable[..., tuple[Ball, ...]]] = {  # name → value and partial derivatives
    "add": lambda x, y: (x + y, ONE, ONE), "sub": lambda x, y: (x - y, ONE, -ONE), "neg": lambda x: (-x, -ONE),
    "mul": lambda x, y: (x * y, y, x), "square": lambda x, _: (square(x), x, x), "max": lambda x, y: (x.max(y),),
    "div": lambda x, y: (x / y, 1 / y, -x / (y * y)), "abs": lambda x: (x.abs_lower().union(x.abs_upper()),),
}  # fmt: skip
# Number of terms of the power series below. The coefficient of s^n is at most 2^(1-n). So for |s| < ROUNDED the sum of
# all further terms is at most 2^(3-TERMS).
TERMS = 90
SERIES: Mapping[str, Callable[[int], fmpq]] = {  # functions that the C computes by polynomials → Taylor coefficient n
    "cosroot": lambda n: fmpq((-1) ** n, math.factorial(2 * n)),
    "sinroot": lambda n: fmpq((-1) ** n, math.factorial(2 * n + 1)),
    "arcroot": lambda n: fmpq((-1) ** n, math.factorial(2 * n + 3)),
    "exprel": lambda n: fmpq(1, math.factorial(n + 1)),
    "expm1": lambda n: fmpq(min(n, 1), math.factorial(n)),
    "sin": lambda n: fmpq((-1) ** (n // 2) * (n % 2), math.factorial(n)),
    "versin": lambda n: fmpq((-1) ** (n // 2 + 1) * (n > 0 and 1 - n % 2), math.factorial(n)),
    "phi0": lambda n: abs(fmpq.bernoulli(2 * n + 2)) / math.factorial(2 * n + 2),
    "phi1": lambda n: (n + 1) * SERIES["phi0"](n + 1),
    "phi2": lambda n: (n + 1) * SERIES["phi1"](n + 1),
}
COEFFICIENTS = {name: [coefficient(n) for n in range(TERMS)] for name, coefficient in SERIES.items()}


class RefusedError(Exception):
    """Refusal of a certificate that is wrong, or of a step for which no bound can be proved."""


def demand(condition: bool, message: str) -> None:
    """Raise `RefusedError` unless a condition holds."""
    if not condition:
        raise RefusedError(message)


def mag(x: Ball) -> Ball:
    """Return an upper bound for the absolute values in an interval, as an exact number.

    Raises `RefusedError` if the interval is not bounded.
    """
    demand(x.is_finite(), "a value is not bounded")
    return x.abs_upper()


def square(x: Ball) -> Ball:
    """Return an interval that contains the squares of all numbers in an interval, but no negative numbers."""
    return (x.abs_lower() * x.abs_lower()).union(x.abs_upper() * x.abs_upper())


def top(values: Iterable[Ball]) -> Ball:
    """Return an interval that contains the maximum of x_1, x_2, … if each x_i lies in interval number i."""
    return reduce(arb.max, values)


def middle(x: Ball) -> Ball:
    """Return the midpoint of an interval, as an exact number."""
    return arb(x.mid())


def below(a: Matrix, b: Matrix) -> bool:
    """Return whether each entry of the matrix a is certainly less than the entry of b at the same place."""
    return all(v < w for v, w in zip(a.entries(), b.entries(), strict=True))


def interval(ends: Sequence[float]) -> Ball:
    """Return the interval (a ball of flint) between two doubles."""
    return arb(ends[0]).union(arb(ends[1]))


def column(values: Iterable[Ball]) -> Matrix:
    """Return a matrix with one column, which has the given entries."""
    return arb_mat([[v] for v in values])


def each(f: Callable[..., Ball], *matrices: Matrix) -> Matrix:
    """Return the matrix with the entries f(a_ij, b_ij, …), for matrices a, b, … of one shape."""
    entries = [f(*v) for v in zip(*(m.entries() for m in matrices), strict=True)]
    return arb_mat(matrices[0].nrows(), matrices[0].ncols(), entries)


def identity(n: int) -> Matrix:
    """Return the identity matrix."""
    return arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


class Evaluation:
    """Evaluation of a list of operations in interval arithmetic, with bounds for the rounding error of each operation.

    Each value is an interval that contains the exact and the computed result. The derivatives of each operation with
    respect to its operands are stored for `outputs`. ``inputs`` maps the name of an array to the intervals of its
    entries; an operation with this name reads one entry.
    """

    def __init__(self, c: Any, operations: Any, inputs: Mapping[str, Any], exact: bool = False) -> None:
        self.x: list[Ball] = []
        self.inputs = dict[tuple[str, int], int]()
        self.error, self.slopes = list[Ball](), list[list[tuple[int, Ball]]]()
        self.kinks = [k for k, (op, *_) in enumerate(operations) if op in ("abs", "max")]
        powers, v = set[int](), self.x
        for k, (op, *a) in enumerate(operations):
            error, slopes = ZERO, list[tuple[int, Ball]]()
            # "number" is a decimal literal of the C, rounded to a double; "constant" is a value in the certificate
            if op in ("number", "exact", "constant"):
                value = a[0] if op != "constant" else c[a[0]] if len(a) == 1 else c[a[0]][a[1]]
                x, error = arb(value), U * abs(value) * (op == "number" and Fraction(repr(value)) != value)
                powers |= {k} if abs(math.frexp(value)[0]) == 0.5 else set()  # multiplication by a power of 2 is exact
            elif op in inputs:
                demand((op, a[0]) not in self.inputs, "an input is read twice")
                x, self.inputs[op, a[0]] = inputs[op][a[0]], k
                error = c["carry"] * U * mag(x) if op == "x" else ZERO  # the C reads x without its compensation term
            elif op in OPERATIONS:
                x, *by = OPERATIONS["square" if op == "mul" and a[0] == a[1] else op](*(v[i] for i in a))
                rounds = op in ("add", "sub", "mul", "div") and not (op == "mul" and powers & set(a))
                error, slopes = U * mag(x) * rounds + TINY, [*zip(a, by, strict=False)]
            # "rest" adds an error for the terms that the C leaves out of a Taylor series. The operand a[0] is the sum
            # of the terms that the C always adds. The operands a[3:] are the next terms of the series: the C may add
            # some of them, and adds no later terms. The sum of the terms a[3:] and all later terms is at most ``tail``,
            # by Lagrange's form of the remainder. The sum of those that the C adds is at most Σ |a[3:]|. If the series
            # is the mean of a path, the terms from a[3] on are divided by a[2] or more; otherwise a[2] is 1. The bound
            # is 3 (tail + 2 Σ |a[3:]|)/a[2]. It has the factors 3 and 2 to hold for derivatives of the series, too.
            elif op == "rest":
                x, slopes = v[a[0]], [(a[0], ONE)]
                error = 3 * (inputs["tail"][a[1]] + 2 * sum((mag(v[i]) for i in a[3:]), ZERO)) / a[2]
            elif op in LIBM:
                x, slopes = LIBM[op][0](v[a[0]]), [(a[0], LIBM[op][1](v[a[0]]))]
                ulps = 0.5 if op == "sqrt" else c["ulps"] * (2 if op in LESS_ACCURATE else 1) * (1 + 9 * U)
                error = U * mag(x) * 2 * ulps + 2 * ulps * TINY
            else:
                x, slope, error = polynomial(c, c["series"][op], v[a[0]])
                slopes = [(a[0], slope)]
            self.slopes.append(slopes)
            self.error.append(ZERO if exact else error)
            v.append(x if exact else x + BALL * error)

    def outputs(self, indices: Sequence[int], by: Mapping[str, int]) -> tuple[Matrix, ...]:
        """Return the values of the operations ``indices``, bounds for the rounding errors of the values, and Jacobians
        of the values.

        All results are matrices of intervals. The error bounds use the mean value theorem. ``by`` maps the name of an
        input array to its size; there is one Jacobian with respect to each of these arrays.
        """
        errors, rows = list[Ball](), list[list[Ball]]()
        for output in indices:  # reverse-mode differentiation from this output back to all operations
            row = [ZERO] * output + [arb(1)] + [ZERO] * (len(self.x) - output)
            for k in range(output, -1, -1):
                for i, slope in self.slopes[k] if not row[k].is_zero() else ():
                    row[i] += row[k] * slope
            demand(all(row[k].is_zero() for k in self.kinks), "the derivative of an absolute value or maximum is used")
            rows.append(row)
            errors.append(sum((mag(d) * e for d, e in zip(row, self.error, strict=False) if not e.is_zero()), ZERO))
        read = [[self.inputs.get((name, i), len(self.x)) for i in range(count)] for name, count in by.items()]
        jacobians = [arb_mat([[row[k] for k in inputs] for row in rows]) for inputs in read]
        return column(self.x[i] for i in indices), column(errors), *jacobians


def polynomial(c: Any, series: Any, s: Ball) -> tuple[Ball, Ball, Ball]:
    """Return the value and the derivative at s of a function that the C computes by a polynomial, and an error bound.

    The bound is for the error of the value in the C, rounding errors included. ``series`` describes the polynomial.
    """
    name, beyond = series["name"], series["beyond"]
    if beyond and mag(s) >= series["radius"]:  # for |s| ≥ radius, the C calls libm
        x, slope, ulps = LIBM[name][0](s), LIBM[name][1](s), c["ulps"] * (1 + 9 * U)
        inside = s.intersection(BALL * arb(series["radius"])) if s.overlaps(BALL * arb(series["radius"])) else None
        error = polynomial(c, {**series, "beyond": False, "inside": True}, inside)[2] if inside is not None else ZERO
        return x, slope, error.max(2 * U * ulps * mag(x) + TINY)
    r, exact, rest, v = mag(s), COEFFICIENTS[name], arb(2) ** (3 - TERMS), list[Any]()
    accurate = r < ROUNDED and (r < series["radius"] or "inside" in series)
    demand(accurate, f"the argument of {name} reaches {float(r):.3g}")
    for op, *a in series["operations"]:
        literal = [0, 1] if op == "s" else [fmpq(*a[0].as_integer_ratio())] if op == "number" else None
        v.append(fmpq_poly(literal) if literal else -v[a[0]] if op == "neg" else EXACT[op](v[a[0]], v[a[1]]))
    _, rounding = Evaluation(c, series["operations"], {"s": {0: s}}).outputs([len(v) - 1], {})
    sums = [ZERO] * 3
    for n in reversed(range(TERMS)):
        terms = (arb(exact[n]), arb((n + 1) * exact[n + 1]) if n + 1 < TERMS else ZERO, arb(abs(v[-1][n] - exact[n])))
        sums = [total * at + term for total, at, term in zip(sums, (s, s, r), terms, strict=True)]
    return sums[0] + BALL * rest, sums[1] + BALL * (TERMS + 1) * rest, rounding[0, 0] + sums[2] + rest


def carries(c: Any, X: Iterable[Ball]) -> list[Ball]:
    """Return upper bounds for the compensation terms of the coordinates, for states in the intervals X."""
    return [c["carry"] * U * mag(x) for x in X]


def run_of(c: Any, stage: Any, X: Balls, T: Ball, leaf: Any, u: Balls = (), exact: bool = False) -> Evaluation:
    """Evaluate the operations of a stage of the step, for all states in X, times in T and unknowns in u.

    If the stage follows paths, ``leaf["path"]`` is a box that contains the paths. On this box the omitted terms of
    Taylor series are bounded. With ``exact``, omitted terms and rounding errors count as 0.
    """
    rests = [op[3] for op in stage["operations"] if op[0] == "rest"]
    demand("path" in stage or not rests, "a Taylor series has no path")
    carry, tail, along = [BALL * r for r in carries(c, X)], [ZERO] * len(X), "path" in stage and not exact
    if along:  # all paths of dm/dt = field from X must stay in the box P
        P, path = [interval(p) for p in leaf["path"]], stage["path"]
        run = Evaluation(c, path["operations"], {"m": P, "u": u, "t": [T]})
        reached = [x + r + ZERO.union(run.x[k]) for x, r, k in zip(X, carry, path["field"], strict=True)]
        demand(all(p.contains_interior(v) for p, v in zip(P, reached, strict=True)), "a path may leave its box")
        tail = [mag(run.x[k]) for k in path["next"]]
    inputs = {"x": X, "start": X, "carry": carry, "t": [T], "u": u, "tail": tail}
    run = Evaluation(c, stage["operations"], inputs, exact)
    if along:  # the C ends a series after two negligible terms in a row
        demand(bool(stage["seen"]) or max(rests) <= 4, "a Taylor series may end early")
        hidden = [mag(run.x[a]) < run.x[b].abs_lower() / ROUNDED for a, b in stage["hidden"]]
        demand(len(hidden) == 2 * len(X) and all(hidden), "a Taylor series may end late")
    return run


def centred(c: Any, stage: Any, X: Balls, T: Ball, leaf: Any, box: Balls, run: Evaluation, key: str) -> Matrix:
    """Return intervals for the outputs with the indices ``stage[key]``, rounding errors included.

    X contains the states, and ``box`` the unknowns. The mean value theorem is applied at the midpoints of X and of
    ``box``. For small boxes the intervals are narrower than those in ``run``, the result of `run_of`.
    """
    _, error, by_u, by_x = run.outputs(stage[key], {"u": len(box), "x": len(X)})
    x, u = ([arb(v.mid()) for v in values] for values in (X, box))
    at = run_of(c, stage, x, T, leaf, u, exact=True)
    values = column(at.x[k] for k in stage[key]) + by_u * (column(box) - column(u)) + by_x * (column(X) - column(x))
    return each(lambda v, e: v + BALL * e, values, error)


def expect_derivatives(c: Any, stage: Any, X: Balls, T: Ball, leaf: Any, box: Balls) -> None:
    """Raise `RefusedError` unless the Jacobians in the C agree with exact derivatives to 20 digits at three points."""
    precision, ctx.prec = ctx.prec, 300
    for point in POINTS:
        *at, t = (
            arb((v.lower() + (v.upper() - v.lower()) * (point * k % 1)).mid()) for k, v in enumerate((*box, T), 1)
        )
        run = run_of(c, stage, X, t, leaf, at, exact=True)
        A, S = (run.outputs(stage[name], {"u": len(box)})[2] for name in ("equation", "change"))
        printed = [run.x[k] for k in (*stage["matrix"], *stage["gain"])]
        pairs = zip((identity(len(box)) + A).entries() + S.entries(), printed, strict=True)
        demand(all(abs(a - b) < 1e-20 * (1 + abs(a)) for a, b in pairs), "a Jacobian is not the derivative")
    ctx.prec = precision


def solved(c: Any, stage: Any, X: Balls, T: Ball, leaf: Any) -> tuple[Matrix, ...]:
    """Return bounds for an implicit stage: change of the state, error, and derivative of the new state by the old one.

    The unknowns u solve u - base + d(u) = 0, where ``stage["equation"]`` is d, and base is the state or 0. The C solves
    the equation by repeated corrections: M^-1 times the residual, with a matrix M. A part of the change is added to the
    compensation term; the fourth result is a bound for this part.
    """
    box = [interval(v) for v in leaf["u"]]
    m, n, Y, centre = len(box), len(X), column(map(mag, box)), column(arb(v.mid()) for v in box)
    run, based, matrix, derived = run_of(c, stage, X, T, leaf, box), stage["based"], stage["matrix"], stage["derived"]
    d, d_error, d_u, d_x = run.outputs(stage["equation"], {"u": m, "x": n})
    change, error, change_u, change_x = run.outputs(stage["change"], {"u": m, "x": n})
    A, scale, solves = identity(m) + d_u, column(run.x[k] for k in stage["scale"]), bool(matrix)
    A_size, size, high, M, M_error = each(mag, A), each(mag, d), each(mag, scale), identity(m), arb_mat(m, m)
    bends, reach, low = arb_mat(m * m, m), column(map(arb, leaf["reach"])), each(arb.abs_lower, scale)
    if solves:
        J, errors, bends = run.outputs(matrix, {"u": m})
        # bound for the rounding errors of the C when it solves linear equations with the matrix M by elimination
        pivots = top(map(mag, (*J.entries(), *A.entries()))) * 4 * m * m * 2 ** (m - 1) * U
        M, M_error = arb_mat(m, m, J.entries()), each(lambda e: e + pivots, arb_mat(m, m, errors.entries()))
    if derived:
        expect_derivatives(c, stage, X, T, leaf, box)
    elif solves:  # the C may compute the matrix M by finite differences
        least = -top(-v for v in low.entries())
        demand(least > 0, "the unknowns, in whose sizes residuals are measured, may be 0")
        noise = (d_error + U * Y) * (2 / (stage["difference"] * least))
        M_error += each(mag, M - A) + arb_mat([[v] * m for v in noise.entries()])
    M = each(lambda v, e: v + BALL * e, M, M_error)
    inverse, measured = each(mag, M.inv()), each(mag, M) * high if derived else high

    def residual_error(e: Matrix) -> Matrix:
        """Return bounds for the rounding errors of the residual, if the unknowns differ from the solution by at
        most e.
        """
        first = d_error + U * (size + e + c["carry"] * U * Y) * based
        return first + 2 * U * (A_size * e + first + U * size + c["carry"] * U * Y * based) if solves else first

    def missed(e: Matrix) -> Matrix:
        """Return bounds for the distance between the unknowns and the solution after a correction. Before the
        correction, this distance is at most e.
        """
        bent = arb_mat(m, m, (each(mag, bends) * e * HALF).entries()) + M_error if derived else each(mag, M - A)
        return inverse * (bent * e + residual_error(e))

    def worst_of(size: Ball) -> Matrix:
        """Return bounds for the distance between the unknowns and the solution, if the C measures a correction or a
        residual of at most ``size``.
        """
        return each(mag, A.inv()) * (measured * (size * ROUNDED) + residual_error(reach))

    C = each(middle, each(middle, A).inv())
    values = run_of(c, stage, X, T, leaf, centre.entries()).x
    at = column(values[k] for k in stage["equation"])
    base = column(x + BALL * r for x, r in zip(X, carries(c, X), strict=True)) if based else column([ZERO] * m)
    K = centre - C * (centre - base + at) + (identity(m) - C * A) * (column(box) - centre)
    away = each(mag, centred(c, stage, X, T, leaf, box, run, "away")) + (2 * c["carry"] * U + arb(2) ** -30) * Y
    demand(below(away, reach), "the first iterate may be out of reach of the solution")
    beyond = reach + each(mag, C) * d_error + high * stage.get("difference", 0)
    inside = zip(box, K.entries(), beyond.entries(), strict=True)
    demand(all(v.contains_interior(k + BALL * r) for v, k, r in inside), KRAWCZYK)
    demand(below(missed(reach) + U * Y * solves, reach), "the iteration may diverge")
    if stage.get("seen"):  # the C cannot end a series before a large term
        (seen,) = centred(c, stage, X, T, leaf, box, run, "seen").entries()
        demand(seen.abs_lower() > ROUNDED * mag(run.x[stage["seen_above"]]), "a Taylor series may end early")

    noise = 2 * (residual_error(reach) + A_size * Y * U * solves)
    q, shaken, share = stalling(stage, each(mag, identity(m) - A * M.inv()), noise, low, high)
    e, rest = column([ZERO] * m), column([ZERO] * m)
    # A rule that ends the iteration limits the last correction ("now"), the last correction but one ("before"), or the
    # quotient of the last correction by the last but one ("part").
    for stop in stage["stops"]:
        errors = [worst_of(share * stop["now"] / stop.get("rate", 1))] if "now" in stop else []
        before = [share * stop["before"]] if "before" in stop else []
        before += [share * shaken / (stop["part"] - q)] if q < arb(stop.get("part", 0)) else []
        errors += [missed(worst_of(v)) + U * Y * solves for v in before]
        demand(bool(errors), "an iteration may end with an error of any size")
        e = each(arb.max, e, reduce(lambda a, b: each(arb.min, a, b), errors))
    rest, small, x_u = missed(e), column([ZERO] * n), A.inv() * (d_x - based * identity(m) if based else d_x)
    if stage["gain"]:
        S, S_error, S_bends = run.outputs(stage["gain"], {"u": m})
        S, small = each(mag, arb_mat(n, m, S.entries())), each(mag, arb_mat(n, m, S.entries())) * (e + rest)
        error += arb_mat(n, m, (each(mag, S_bends) * e * HALF).entries()) * e + S * rest + (m + 2) * U * small
        error += arb_mat(n, m, S_error.entries()) * (e + rest)
    else:
        error += each(mag, change_u) * (rest if stage["last"] else e)
    return change, error, identity(n) + change_x - change_u * x_u, small


def stalling(stage: Any, factor: Matrix, noise: Matrix, low: Matrix, high: Matrix) -> tuple[Ball, Ball, Ball]:
    """Return bounds for the contraction rate and the rounding errors of the corrections of an implicit stage.

    The bounds are in the norm by which the C measures corrections: for a Gauss method the root mean square over the
    stages of the method, otherwise the maximum. For a Gauss method, the third result is the square root of the number
    of stages: the quotient of 2-norm and root mean square. Otherwise the third result is 1. ``factor`` is a matrix:
    |correction| ≤ factor · |previous correction|, apart from the rounding errors ``noise``. ``low`` and ``high`` are
    bounds for the sizes by which corrections are divided.
    """
    m, share = len(stage["equation"]), arb(stage["share"] or 1).sqrt()
    scaled = [[factor[i, j] * high[j, 0] / high[i, 0] for j in range(m)] for i in range(m)]
    across, down = (top(sum(r, ZERO) for r in rows) for rows in (scaled, zip(*scaled, strict=True)))
    q = top(b / a for a, b in zip(low.entries(), high.entries(), strict=True)) * ROUNDED
    noises = [v / s for v, s in zip(noise.entries(), low.entries(), strict=True)]
    if stage["share"]:
        demand(all(v > 0 for v in low.entries()), "the unknowns, in whose sizes changes are measured, may be 0")
        return q * (across * down).sqrt(), sum((v * v for v in noises), ZERO).sqrt() / share, share
    return q * across, top(noises), share


def step(c: Any, X: Balls, T: Ball, leaf: Any) -> tuple[Balls, Balls]:
    """Return bounds for the errors of a step from states in X, and intervals that contain the states after the
    step.

    The stages of the step are treated one after another; ``leaf`` has the boxes for the unknowns of each stage.
    """
    total, n = column([ZERO] * len(X)), len(X)
    for stage, part in zip(c["stages"], leaf["stages"], strict=True):
        if "equation" in stage:
            change, error, slope, small = solved(c, stage, X, T, part)
        else:
            change, error, by_x, by_start = run_of(c, stage, X, T, part).outputs(stage["change"], {"x": n, "start": n})
            slope, small = identity(n) + by_x + by_start, column([ZERO] * n)
        parts = [*zip(X, change.entries(), small.entries(), carries(c, X), strict=True)]
        lost = column(8 * U * (U * mag(x + v) + w + r) for x, v, w, r in parts)  # rounding of the compensated sum
        total = error + lost + each(mag, slope) * total
        X = [x + v + BALL * (e + r) for (x, v, _, r), e in zip(parts, total.entries(), strict=True)]
    return total.entries(), X


def check(c: Any, domain: Sequence[Sequence[float]], node: Any) -> tuple[int, list[float]]:
    """Check the certificate on all boxes of a tree. The tree divides the domain into boxes.

    Return the number of boxes, and the largest absolute value of each coordinate. Raises `RefusedError`.
    """
    if "at" in node:
        low, high = [list(d) for d in domain], [list(d) for d in domain]
        demand(domain[node["axis"]][0] < node["at"] < domain[node["axis"]][1], "a box is divided outside of itself")
        low[node["axis"]][1] = high[node["axis"]][0] = node["at"]
        (m, a), (n, b) = (check(c, part, below) for part, below in zip((low, high), node["parts"], strict=True))
        return m + n, [max(pair) for pair in zip(a, b, strict=True)]
    *X, T = [interval(d) for d in domain]
    bounds, image = step(c, X, T, node)
    for bound, claim in zip(bounds, c["bound"], strict=True):
        demand(bound <= arb(claim), f"the bound is {float(bound):.4g}, but {claim:.4g} is claimed")
    return 1, [max(float(mag(x)), float(mag(y))) for x, y in zip(X, image, strict=True)]


def digest(c: Mapping[str, Any]) -> str:
    """Return the SHA-256 hash of a certificate without its entry "sha256", in which the hash is stored."""
    text = json.dumps({k: v for k, v in c.items() if k != "sha256"}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def replayed(c: Any, text: bytes) -> str:
    """Check a certificate for a C file with the content ``text``, and return the proved statement. Raises
    `RefusedError`.
    """
    demand(digest(c) == c["sha256"], "the certificate was changed")
    demand(hashlib.sha256(text).hexdigest() == c["c_sha256"], "the certificate is about another C file")
    boxes, largest = check(c, [*c["domain"], c["time"]], c["tree"])
    ulps = [b / math.ulp(x) for b, x in zip(c["bound"], largest, strict=True)]
    number = f"{boxes} box{'es' * (boxes > 1)}"
    return f"{c['name']}: {number}; a step is within {max(ulps):.3g} ulp of the exact map in each coordinate"


if __name__ == "__main__":
    ctx.prec = BITS
    try:
        print(replayed(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]).read_bytes()))
    except (RefusedError, ArithmeticError, LookupError, TypeError, ValueError) as refusal:
        sys.exit(f"refused: {refusal}")
