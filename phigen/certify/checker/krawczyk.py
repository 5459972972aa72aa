"""Implicit steps by Newton's method: Krawczyk's test, and what the last correction leaves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from flint import arb, arb_mat, ctx

from .explicit_steps import Certificate, advanced, prepared
from .rounding import BALL, CARRY, ZERO, Ball, Balls, Tape, U, Value, demand, interval, mag, play, top

POINTS = (0.318309886, 0.577215665, 0.869604401)  # where derivatives are compared with the kernels of Jacobians
ROUNDED = arb("1.000001")  # of a size or a change that the C compares

#: Outputs of the kernel of a stage.
LINEARISED = ("displacement", "increment", "jacobian", "increment_jacobian")
KRAWCZYK = "Krawczyk's test does not show that the equation of a step has one solution"

Matrix = Any  # a flint.arb_mat


def column(values: Iterable[Ball]) -> Matrix:
    """A matrix of one column."""
    return arb_mat([[v] for v in values])


def mags(matrix: Matrix) -> Matrix:
    """The largest absolute values of the entries of a matrix."""
    return arb_mat(matrix.nrows(), matrix.ncols(), [mag(v) for v in matrix.entries()])


def identity(n: int) -> Matrix:
    """The identity matrix."""
    return arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def newton(c: Certificate, X: Balls, T: Ball, leaf: Certificate) -> tuple[Balls, Balls]:
    """Bounds and image of a step of some stages."""
    total = column([ZERO] * len(X))
    for stage, Y in enumerate(leaf["y"]):
        bound, slope, X = newton_stage(c, X, T, [interval(y) for y in Y], stage)
        total = bound + mags(slope) * total
        X = [x + BALL * e for x, e in zip(X, total.entries(), strict=True)]
    return total.entries(), X


def newton_stage(c: Certificate, X: Balls, T: Ball, Y: Balls, stage: int) -> tuple[Matrix, Matrix, Balls]:
    """Bound, derivative and image of a stage, whose solution y and iterates are in Y."""
    expect_derivatives(c, Y, T, stage)
    X = [x + BALL * CARRY * mag(x) for x in X]
    at_centre = linearised(c, [arb(v.mid()) for v in Y], T, stage)[2]["displacement"]
    correction = Correction(*linearised(c, Y, T, stage))
    correction.expect_one_solution(column(X), column(v.x for v in at_centre))
    e = correction.accepted(c)
    rest = correction.missed(e)
    small = mags(correction.S) * (e + rest)
    image = [x + v for x, v in zip(X, correction.increment.entries(), strict=True)]
    bound = correction.change_error(e, rest)
    lost = [advanced(x, v) + U * CARRY * mag(x) for x, v in zip(image, small.entries(), strict=True)]
    return bound + column(lost), identity(len(X)) + correction.S * correction.A.inv(), image


class Correction:
    """The last correction of Newton's method: of y by M delta = residual, and of the increment by S delta.

    A is the Jacobian of (y - x) + displacement(y) over the box of y, M that matrix as it is computed, with the backward
    error of elimination with partial pivoting (Higham, Accuracy and Stability, theorem 9.4, with growth 2^(n-1)).
    """

    def __init__(self, tape: Tape, y: Sequence[Value], out: dict[str, list[Value]]) -> None:
        n = self.n = len(y)
        displacement, increment, jacobian, slope = (out[name] for name in LINEARISED)
        self.y, self.Y = column(v.x for v in y), mags(column(v.x for v in y))
        self.increment, self.d = column(v.x for v in increment), mags(column(v.x for v in displacement))
        error, gradient = gradients(tape, y, displacement)
        self.displacement_error, self.A = column(error), identity(n) + gradient
        self.increment_error = column(gradients(tape, y, increment)[0])
        error, self.jacobian_bends = gradients(tape, y, jacobian)
        self.J, self.jacobian_error = arb_mat(n, n, [v.x for v in jacobian]), arb_mat(n, n, error)
        error, self.slope_bends = gradients(tape, y, slope)
        self.S, self.slope_error = arb_mat(n, n, [v.x for v in slope]), arb_mat(n, n, error)
        pivots = top(mags(self.J).entries()) * 4 * n * n * 2 ** (n - 1) * U
        self.jacobian_error += arb_mat(n, n, [pivots] * n * n)
        M = arb_mat(n, n, [v + BALL * pivots for v in self.J.entries()])
        self.M, self.inverse_M, self.inverse_A = mags(M), mags(M.inv()), mags(self.A.inv())

    def expect_one_solution(self, X: Matrix, at_centre: Matrix) -> None:
        """Krawczyk's test for all X, and that no iterate leaves the box, within ``reach`` of the solution."""
        n, centre = self.n, column(arb(v.mid()) for v in self.y.entries())
        inverse = arb_mat(n, n, [v.mid() for v in self.A.entries()]).inv()
        C = arb_mat(n, n, [v.mid() for v in inverse.entries()])
        K = centre - C * (centre - X + at_centre) + (identity(n) - C * self.A) * (self.y - centre)
        self.reach = self.d + CARRY * mags(X) + arb(2) ** -30 * self.Y  # y = x is nearer
        triples = zip(self.y.entries(), K.entries(), self.reach.entries(), strict=True)
        demand(all(y.contains_interior(k + BALL * r) for y, k, r in triples), KRAWCZYK)
        after = self.missed(self.reach) + U * self.Y
        pairs = zip(after.entries(), self.reach.entries(), strict=True)
        demand(all(left < r for left, r in pairs), "Newton's method may diverge")

    def changed(self, bends: Matrix, e: Matrix) -> Matrix:
        """Largest change of a Jacobian on average over the way from y to the solution, with second derivatives."""
        return arb_mat(self.n, self.n, (mags(bends) * e * arb(0.5)).entries())

    def residual_error(self, e: Matrix) -> Matrix:
        """Rounding errors of the residual ((y - x) + displacement) - carry, at a distance e from the solution."""
        first = self.displacement_error + U * (self.d + e + CARRY * self.Y)
        return first + 2 * U * (mags(self.A) * e + first + U * self.d + CARRY * self.Y)

    def missed(self, e: Matrix) -> Matrix:
        """The rest that a correction leaves of an error e of y."""
        bent = self.changed(self.jacobian_bends, e) + self.jacobian_error
        return self.inverse_M * (bent * e + self.residual_error(e))

    def accepted(self, c: Certificate) -> Matrix:
        """The largest error of y before a correction at which the iteration stops: a small one, or a stalled one."""
        floor = c["floor"] * top(self.Y.entries()) + arb(2) ** -1022
        scale, known = self.Y + column([floor] * self.n), self.residual_error(self.reach)
        solved = self.inverse_A * (self.M * scale * (arb(c["tolerance"]).sqrt() * ROUNDED) + known)
        before = self.inverse_A * (self.M * scale * (c["nearly_solved"] * ROUNDED) + known)
        stalled = self.missed(before) + U * self.Y
        return column(top(pair) for pair in zip(solved.entries(), stalled.entries(), strict=True))

    def change_error(self, e: Matrix, rest: Matrix) -> Matrix:
        """The error of increment - S delta, where delta misses the error e of y by ``rest``."""
        S, bent = mags(self.S), self.changed(self.slope_bends, e)
        rounded = self.slope_error * (e + rest) + (self.n + 2) * U * S * (e + rest)
        return self.increment_error + bent * e + S * rest + rounded


def linearised(
    c: Certificate, Y: Balls, T: Ball, stage: int, exact: bool = False
) -> tuple[Tape, list[Value], dict[str, list[Value]]]:
    """The kernel of a stage at points in Y."""
    tape = Tape(c["series"], c["ulps"], exact)
    y, coef = [tape.value(v) for v in Y], prepared(c, tape, T, stage)
    return tape, y, play(c["kernels"]["linearise"], tape.number, coef=coef, y=y)


def gradients(tape: Tape, y: Sequence[Value], values: Sequence[Value]) -> tuple[Any, Matrix]:
    """Bounds for the errors of values, and their derivatives by y."""
    slopes = [tape.derivatives(v) for v in values]
    errors = [tape.error(v, s) for v, s in zip(values, slopes, strict=True)]
    return errors, arb_mat([[ZERO if s[v.index] is None else s[v.index] for v in y] for s in slopes])


def expect_derivatives(c: Certificate, Y: Balls, T: Ball, stage: int) -> None:
    """The Jacobians that the C computes are those of its displacement and increment, to 20 digits at some points."""
    precision, ctx.prec = ctx.prec, 300
    try:
        for point in POINTS:
            at = [arb((v.lower() + (v.upper() - v.lower()) * point).mid()) for v in Y]
            tape, y, out = linearised(c, at, arb(T.mid()), stage, exact=True)
            (_, slope_d), (_, slope_i) = (gradients(tape, y, out[name]) for name in LINEARISED[:2])
            printed = [v.x for name in LINEARISED[2:] for v in out[name]]
            pairs = zip((identity(len(Y)) + slope_d).entries() + slope_i.entries(), printed, strict=True)
            demand(all(abs(a - b) < 1e-20 * (1 + abs(a)) for a, b in pairs), "a Jacobian is not the derivative")
    finally:
        ctx.prec = precision
