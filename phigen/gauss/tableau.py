"""Coefficients of Gauss collocation, in a form that remains exactly symplectic after rounding.

Let a_ij and b_j be the coefficients of the Runge–Kutta method, and μ_ij = a_ij/b_j. A step of ż = f(z) from z solves
Z_i = z + Σ_j μ_ij L_j with L_j = h b_j f(Z_j), and ends at z + Σ_j L_j. If μ_ij + μ_ji = 1, the step is symplectic and
preserves the quadratic first integrals of f, for any b_j. The exact μ_ij satisfy this condition, since b_i a_ij + b_j
a_ji = b_i b_j. Here the μ_ij below the diagonal are rounded to multiples of 2⁻⁵². Then 1 − μ_ij is a floating-point
number too, and the condition holds without error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache

#: Decimal digits of the nodes. All other coefficients are computed from the nodes in exact arithmetic.
DIGITS = 60

#: Largest number of stages; a method of s stages has order 2s.
MOST_STAGES = 8

#: Width of the frequency band for which the predictor of a Gauss step is optimal: the band has the angular frequencies
#: up to BAND·s/h, with s stages and the step size h. Methods with more stages are used with longer steps, so their band
#: is wider.
BAND = Fraction(1, 4)


#: Largest number of previous steps that a predictor reads, in C that computes the stages of a step in SIMD lanes.
EARLIER = 2

#: Several predictors: the width of the frequency band in the unit of `BAND`, and the number of previous steps that the
#: predictor reads. C that computes the stages of a step in SIMD lanes uses the predictor that was best in recent steps.
#: For the Kowalevski top with steps of 0.1, 0.25, 0.5 and 1, the errors of predicted derivatives are 3e-10, 4e-8, 8e-5
#: and 0.1. With `BAND` as the only band, the errors are 3e-5, 6e-5, 3e-4 and 0.2.
BANDS = ((Fraction(3, 32), EARLIER), (Fraction(3, 16), EARLIER), (Fraction(3, 8), 1))


@dataclass(frozen=True)
class Precision:
    """Floating-point format to which coefficients are rounded.

    ``spacing`` is the distance between neighbouring numbers of the format in [1, 2]. If a < 2 is a multiple of
    ``spacing``, then a and 1 − a are numbers of the format. Predictors are optimal for a certain relative error of the
    values that they read: ``noise`` for ``prediction`` of `Tableau`, and ``fine_noise`` for the matrices of
    `predictors`.
    """

    spacing: Fraction
    noise: Fraction
    fine_noise: Fraction


DOUBLE = Precision(Fraction(1, 2**52), Fraction(1, 10**12), Fraction(1, 10**13))
SINGLE = Precision(Fraction(1, 2**23), Fraction(1, 10**5), Fraction(1, 10**5))


@dataclass(frozen=True)
class Tableau:
    """Rounded coefficients of a Gauss method: ``nodes`` c_i, ``weights`` b_i, and the matrix ``mixing`` with the
    entries μ_ij = a_ij/b_j.

    A step of ż = f(z) with the size h from z solves Z_i = z + Σ_j μ_ij L_j with L_j = h b_j f(Z_j). μ_ij + μ_ji = 1
    holds exactly. ``prediction`` is a matrix for the next step: if L_j are the values of the last step, Σ_j
    prediction[i][j]·L_j approximates the offset Z_i − z of the next step. ``doubled`` is ν = μ diag(b) μ: h Σ_j ν_ij
    L_j is the integral of the offsets from the start of the step to stage i. ``times`` are rounded nodes τ_i such that
    ν_ij − ν_ji = τ_i − τ_j holds exactly.
    """

    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    mixing: tuple[tuple[float, ...], ...]
    prediction: tuple[tuple[float, ...], ...]
    doubled: tuple[tuple[float, ...], ...]
    times: tuple[float, ...]

    @property
    def stages(self) -> int:
        """The number of stages, half the order."""
        return len(self.nodes)

    @property
    def defects(self) -> list[Fraction]:
        """The values μ_ij + μ_ji − 1 for j ≤ i in exact arithmetic. All values are 0, so that the method is
        symplectic.
        """
        mu = [[Fraction(v) for v in row] for row in self.mixing]
        return [mu[i][j] + mu[j][i] - 1 for i in range(self.stages) for j in range(i + 1)]


@cache
def tableau(stages: int, precision: Precision = DOUBLE) -> Tableau:
    """Return the coefficients of the Gauss method with ``stages`` stages, rounded for a floating-point format."""
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
def continuation(stages: int) -> list[list[float]]:
    """Return the matrix that predicts the stages of a step by the collocation polynomial of the last step.

    The matrix has the form of ``prediction`` of `Tableau`. Solvers with loops over the stages use this matrix, in C,
    JavaScript and NumPy. In ten systems at orders 4 to 16, a step took as many iterations as with the second predictor
    of `BANDS`, within 6 %; small steps took up to 25 % fewer. The second predictor of `BANDS` also reads the step
    before the last one: the derivatives of that step must be transformed to the present frame, and a kick between the
    two steps spoils the prediction. Neither is the case for the matrix of this function.
    """
    weights, _ = _exact(stages)
    nodes = gauss_nodes(stages)
    basis = _lagrange(nodes)
    return _floats([[_integral(p, 1 + c) / b - 1 for p, b in zip(basis, weights, strict=True)] for c in nodes])


@cache
def predictors(stages: int, precision: Precision = DOUBLE, *, integrated: bool = False) -> list[list[list[float]]]:
    """Return the matrix of each predictor in `BANDS`, in the form of ``prediction`` of `Tableau`.

    The first columns are for the stage increments L_j of the last step. Further columns are for the preceding step, if
    the predictor reads it. If ``integrated``, the matrices predict the integrals that the field ``doubled`` of
    `Tableau` defines.
    """
    nodes = gauss_nodes(stages)
    weights, exact = _exact(stages)
    matrices = [_prediction(nodes, weights, exact, band, precision.fine_noise) for band in BANDS]
    return [_floats(_integrated(weights, exact, m) if integrated else m) for m in matrices]


def _integrated(
    weights: Sequence[Fraction], mixing: Sequence[Sequence[Fraction]], values: Sequence[Sequence[Fraction]]
) -> list[list[Fraction]]:
    """Return the integrals of functions from the start of a step to each stage, in units of the step.

    Column k of ``values`` has function k at the stages. The integrals are μ diag(b) V with V = ``values``, the
    ``weights`` b and the matrix ``mixing`` μ of the Gauss method.
    """
    columns = list(zip(*values, strict=True))
    return [[sum((m * w * v for m, w, v in zip(row, weights, column, strict=True)), Fraction(0)) for column in columns]
            for row in mixing]  # fmt: skip


def _floats(rows: Sequence[Sequence[Fraction]]) -> list[list[float]]:
    return [[float(v) for v in row] for row in rows]


@cache
def _exact(stages: int) -> tuple[list[Fraction], list[list[Fraction]]]:
    """Return the weights b_j and the matrix μ_ij = a_ij/b_j of the Gauss method in exact arithmetic."""
    nodes = gauss_nodes(stages)
    basis = _lagrange(nodes)
    weights = [_integral(p, Fraction(1)) for p in basis]
    return weights, [[_integral(p, c) / b for p, b in zip(basis, weights, strict=True)] for c in nodes]


@cache
def gauss_nodes(stages: int) -> tuple[Fraction, ...]:
    """Return the zeros of the Legendre polynomial of degree ``stages`` on [0, 1], ascending, to more than 50 digits."""
    with localcontext() as context:
        context.prec = DIGITS
        return tuple(sorted((1 - Fraction(_legendre_zero(stages, k))) / 2 for k in range(stages)))


def _legendre_zero(n: int, k: int) -> Decimal:
    """Return zero number k of the Legendre polynomial of degree n on [−1, 1], in descending order from k = 0, by
    Newton's method.

    Tricomi's starting values are so close to the zeros that each iteration converges to its own zero.
    """
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
    """Return the Lagrange polynomial of each node, which is 1 at its node and 0 at all other nodes.

    A polynomial is the list of its coefficients, the constant term first.
    """
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
    """Return the matrix μ of a Gauss method, rounded to multiples of ``spacing`` such that μ_ij + μ_ji = 1 exactly."""
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
    """Return the matrix ν of a `Tableau`, rounded such that ν_ij − ν_ji = τ_i − τ_j exactly.

    ``exact`` is ν before rounding, and ``times`` are the rounded nodes τ_i. The entries of the result are multiples of
    ``spacing``.
    """
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
    """Return the matrix of a predictor for the stages of a Gauss step, from the stage increments of previous
    steps.

    The matrix is μ diag(b) W diag(1/b), with the coefficients μ and b of the method. W extrapolates derivatives from
    the previous steps to the next step. ``band`` is an entry of `BANDS`, and ``noise`` is the relative error of known
    derivatives.
    """
    n, (width, step_count) = len(nodes), band
    known_times = [c - steps_back for steps_back in range(1, step_count + 1) for c in nodes]
    extrapolation = _extrapolation(known_times, nodes, width * n, noise)
    return [[v / weights[j % n] for j, v in enumerate(row)] for row in _integrated(weights, mixing, extrapolation)]


def _extrapolation(
    known_times: Sequence[Fraction], times: Sequence[Fraction], band: Fraction, noise: Fraction
) -> list[list[Fraction]]:
    """Return the weights W with which Σ_j W[i][j]·f(known_times[j]) predicts f(times[i]).

    This prediction is the best linear one for signals with a spectrum that is flat up to the angular frequency ``band``
    and 0 beyond. Known values have errors of relative size ``noise``.
    """
    rows = [[_sinc(band * (a - b)) + (noise**2 if a == b else 0) for b in known_times] for a in known_times]
    sides = [[_sinc(band * (a - b)) for b in times] for a in known_times]
    weights = _linear_solutions(rows, sides)
    return [[weights[j][i] for j in range(len(known_times))] for i in range(len(times))]


def _sinc(x: Fraction) -> Fraction:
    """Return sin(x)/x to about `DIGITS` digits."""
    term = value = Fraction(1)
    square = Fraction(round(x * x * 10**DIGITS), 10**DIGITS)
    for k in range(1, 40):
        term = Fraction(round(-term * square / (2 * k * (2 * k + 1)) * 10**DIGITS), 10**DIGITS)
        value += term
    return value


def _linear_solutions(rows: Sequence[Sequence[Fraction]], sides: Sequence[Sequence[Fraction]]) -> list[list[Fraction]]:
    """Return the solutions of a system of linear equations for several right-hand sides, by Gaussian
    elimination.

    ``rows`` is the matrix of the equations. ``sides[k]`` has the right-hand sides of equation k, one for each solution.
    Row k of the result has unknown k of each solution.
    """
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
