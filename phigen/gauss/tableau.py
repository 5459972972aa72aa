"""Coefficients of Gauss collocation, in a form that is exactly symplectic after rounding.

A step from z solves Z_i = z + Σ_j μ_ij L_j with L_j = h b_j f(Z_j), and ends at z + Σ_j L_j; μ_ij = a_ij/b_j. If μ_ij
+ μ_ji = 1, the step is symplectic and preserves the quadratic first integrals of f, for any b_j. The exact μ_ij
satisfy this (b_i a_ij + b_j a_ji = b_i b_j). Here the μ_ij below the diagonal are rounded to multiples of 2⁻⁵²; then
1 − μ_ij is a floating-point number too, and the identity holds without error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache

#: Decimal digits of the nodes; all coefficients follow from them in exact arithmetic.
DIGITS = 60

#: Largest number of stages, for the orders 2 to 16.
MOST_STAGES = 8

#: The predictor of the stages of the next step is optimal for motions whose frequencies, times h, do not exceed BAND
#: times the number of stages. More stages are used with longer steps.
BAND = Fraction(1, 4)


#: Number of steps that predictors read.
EARLIER = 2

#: Bands of predictors, as `BAND`, and the steps that each reads; vectorised C uses the one that was best recently.
#: Errors of predicted slopes on the Kowalevski top, at steps of 0.1, 0.25, 0.5, 1: 3e-10, 4e-8, 8e-5, 0.1; by `BAND`
#: alone 3e-5, 6e-5, 3e-4, 0.2.
BANDS = ((Fraction(3, 32), EARLIER), (Fraction(3, 16), EARLIER), (Fraction(3, 8), 1))


#: The one of `BANDS` that other solvers use for all steps. At eight stages its errors are 1e-8 for frequencies up to
#: 1.2 divided by h, and 5e-4 at 2/h. Those of `BAND` with one step are 1e-4 and 8e-4.
SOLE_BAND = 1


@dataclass(frozen=True)
class Precision:
    """Floating-point numbers: the ``spacing`` from 1 to 2, whose multiples below 2, and 1 minus them, are exact.

    Predictors assume relative errors ``noise`` of the values, or ``fine_noise`` for errors independent of the step
    size.
    """

    spacing: Fraction
    noise: Fraction
    fine_noise: Fraction


DOUBLE = Precision(Fraction(1, 2**52), Fraction(1, 10**12), Fraction(1, 10**13))
SINGLE = Precision(Fraction(1, 2**23), Fraction(1, 10**5), Fraction(1, 10**5))


@dataclass(frozen=True)
class Tableau:
    """Coefficients of a method: ``nodes`` c_i, ``weights`` b_i, and the matrix ``mixing`` μ.

    μ_ij + μ_ji = 1 holds exactly. Nodes and weights are rounded to floating-point numbers. ``prediction`` gives the
    offsets Z_i − z of the next step as Σ_j prediction[i][j]·L_j of the last one alone. ``doubled`` is
    ν = μ diag(b) μ, which gives their integrals up to the stages by the L_j of the same step, and ``times`` are nodes τ
    with ν_ij − ν_ji = τ_i − τ_j, exactly.
    """

    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    mixing: tuple[tuple[float, ...], ...]
    prediction: tuple[tuple[float, ...], ...]
    doubled: tuple[tuple[float, ...], ...]
    times: tuple[float, ...]

    @property
    def stages(self) -> int:
        """The number of stages; the order is twice this."""
        return len(self.nodes)

    @property
    def defects(self) -> list[Fraction]:
        """The values μ_ij + μ_ji − 1 for i ≤ j, in exact arithmetic: all are zero."""
        mu = [[Fraction(v) for v in row] for row in self.mixing]
        return [mu[i][j] + mu[j][i] - 1 for i in range(self.stages) for j in range(i + 1)]


@cache
def tableau(stages: int, precision: Precision = DOUBLE) -> Tableau:
    """Return the coefficients of the method with this number of stages."""
    nodes = gauss_nodes(stages)
    weights, exact = _exact(stages)
    times = [_nearest(c, precision.spacing / 2) for c in nodes]
    doubled = _skew_by(times, _integrated(weights, exact, exact), precision.spacing / 2)
    return Tableau(
        tuple(map(float, nodes)),
        tuple(map(float, weights)),
        tuple(map(tuple, _rounded(exact, precision.spacing))),
        tuple(map(tuple, _floats(_prediction(nodes, weights, exact, (BAND, 1), precision.noise)))),
        tuple(map(tuple, _floats(doubled))),
        tuple(map(float, times)),
    )


@cache
def predictors(stages: int, precision: Precision = DOUBLE, *, integrated: bool = False) -> list[list[list[float]]]:
    """Return matrices like ``prediction`` of `Tableau`, one for each of `BANDS`; ``integrated``, of integrals.

    Columns belong to the stages of the last step, then to those of the step before.
    """
    nodes = gauss_nodes(stages)
    weights, exact = _exact(stages)
    matrices = [_prediction(nodes, weights, exact, band, precision.fine_noise) for band in BANDS]
    return [_floats(_integrated(weights, exact, m) if integrated else m) for m in matrices]


def _integrated(
    weights: Sequence[Fraction], mixing: Sequence[Sequence[Fraction]], values: Sequence[Sequence[Fraction]]
) -> list[list[Fraction]]:
    """Return μ diag(b) V: integrals up to each stage, in units of the step, of functions with stage values V."""
    columns = list(zip(*values, strict=True))
    return [[sum((m * w * v for m, w, v in zip(row, weights, column, strict=True)), Fraction(0)) for column in columns]
            for row in mixing]  # fmt: skip


def _floats(rows: Sequence[Sequence[Fraction]]) -> list[list[float]]:
    return [[float(v) for v in row] for row in rows]


@cache
def _exact(stages: int) -> tuple[list[Fraction], list[list[Fraction]]]:
    """Return the weights b_j and the matrix μ before rounding."""
    nodes = gauss_nodes(stages)
    basis = _lagrange(nodes)
    weights = [_integral(p, Fraction(1)) for p in basis]
    return weights, [[_integral(p, c) / b for p, b in zip(basis, weights, strict=True)] for c in nodes]


@cache
def gauss_nodes(stages: int) -> tuple[Fraction, ...]:
    """Return the zeros of the Legendre polynomial of this degree on [0, 1], ascending, to more than 50 digits."""
    with localcontext() as context:
        context.prec = DIGITS
        return tuple(sorted((1 - Fraction(_legendre_zero(stages, k))) / 2 for k in range(stages)))


def _legendre_zero(n: int, k: int) -> Decimal:
    """Return a zero on [−1, 1] by Newton's method; no deflation is needed, by the starting values of Tricomi."""
    import math

    x = Decimal((1 - (n - 1) / (8 * n**3)) * math.cos(math.pi * (4 * k + 3) / (4 * n + 2)))
    for _ in range(12):
        previous, value = Decimal(1), x
        for m in range(1, n):
            previous, value = value, ((2 * m + 1) * x * value - m * previous) / (m + 1)
        slope = n * (x * value - previous) / (x * x - 1)
        x -= value / slope
    return x


def _lagrange(nodes: Sequence[Fraction]) -> list[list[Fraction]]:
    """Return the coefficients, from the lowest, of the polynomials that are 1 at one node and 0 at the others."""
    polynomials = []
    for i, c in enumerate(nodes):
        p = [Fraction(1)]
        for d in (d for j, d in enumerate(nodes) if j != i):
            p = [(a - d * b) / (c - d) for a, b in zip([Fraction(0), *p], [*p, Fraction(0)], strict=True)]
        polynomials.append(p)
    return polynomials


def _integral(p: Sequence[Fraction], end: Fraction) -> Fraction:
    return sum((a * end ** (k + 1) / (k + 1) for k, a in enumerate(p)), Fraction(0))


def _rounded(exact: Sequence[Sequence[Fraction]], spacing: Fraction) -> list[list[float]]:
    """Return the matrix μ as floating-point numbers with μ_ij + μ_ji = 1."""
    n = len(exact)
    mu = [[Fraction(1, 2)] * n for _ in range(n)]
    for i in range(n):
        for j in range(i):
            mu[i][j] = round(exact[i][j] / spacing) * spacing
            mu[j][i] = 1 - mu[i][j]
    return [[float(v) for v in row] for row in mu]


def _nearest(value: Fraction, spacing: Fraction) -> Fraction:
    return round(value / spacing) * spacing


def _skew_by(times: Sequence[Fraction], exact: Sequence[Sequence[Fraction]], spacing: Fraction) -> list[list[Fraction]]:
    """Return ν as multiples of the spacing with ν_ij − ν_ji = τ_i − τ_j; all are floating-point numbers."""
    nu = [[_nearest(v, spacing) for v in row] for row in exact]
    for i in range(len(nu)):
        for j in range(i):
            nu[j][i] = nu[i][j] - (times[i] - times[j])
    return nu


def _prediction(
    nodes: Sequence[Fraction],
    weights: Sequence[Fraction],
    mixing: Sequence[Sequence[Fraction]],
    band: tuple[Fraction, int],
    noise: Fraction,
) -> list[list[Fraction]]:
    """Return μ diag(b) W diag(1/b), where W extrapolates f from the stages of some last steps to those of the next."""
    n, (width, step_count) = len(nodes), band
    known_times = [c - steps_back for steps_back in range(1, step_count + 1) for c in nodes]
    extrapolation = _extrapolation(known_times, nodes, width * n, noise)
    return [[v / weights[j % n] for j, v in enumerate(row)] for row in _integrated(weights, mixing, extrapolation)]


def _extrapolation(
    known_times: Sequence[Fraction], times: Sequence[Fraction], band: Fraction, noise: Fraction
) -> list[list[Fraction]]:
    """Return for each time in ``times`` the weights of values at the times ``known_times``.

    They give the best linear prediction of a signal whose spectrum is flat up to a band limit, and zero beyond, from
    values with errors of the size ``noise``.
    """
    rows = [[_sinc(band * (a - b)) + (noise**2 if a == b else 0) for b in known_times] for a in known_times]
    sides = [[_sinc(band * (a - b)) for b in times] for a in known_times]
    weights = _linear_solutions(rows, sides)
    return [[weights[j][i] for j in range(len(known_times))] for i in range(len(times))]


def _sinc(x: Fraction) -> Fraction:
    """Return sin(x)/x to more digits than are needed."""
    term = value = Fraction(1)
    square = Fraction(round(x * x * 10**DIGITS), 10**DIGITS)
    for k in range(1, 40):
        term = Fraction(round(-term * square / (2 * k * (2 * k + 1)) * 10**DIGITS), 10**DIGITS)
        value += term
    return value


def _linear_solutions(rows: Sequence[Sequence[Fraction]], sides: Sequence[Sequence[Fraction]]) -> list[list[Fraction]]:
    """Return the solutions of linear equations for several right-hand sides, by elimination."""
    n = len(rows)
    table = [[*row, *side] for row, side in zip(rows, sides, strict=True)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(table[i][k]))
        table[k], table[pivot] = table[pivot], table[k]
        table[k] = [v / table[k][k] for v in table[k]]
        for i in (i for i in range(n) if i != k):
            factor = table[i][k]
            table[i] = [a - factor * b for a, b in zip(table[i], table[k], strict=True)]
    return [row[n:] for row in table]
