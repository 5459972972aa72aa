"""Bi-realisation of π_ij = g_i(x_i) A_ij g_j(x_j) with a constant matrix A.

In the coordinates y_i = ∫ dx_i/g_i(x_i), π is the constant A, and the covector is g_i(x_i)p_i. The bi-realisation of
this constant π is transformed to the coordinates x. With u_i = Σ_j A_ij g_j(x_j)p_j,

    α_i = the flow of ẋ = g_i(x) from x_i for the time −½u_i,    β_i = the same flow for the time ½u_i.

For the following functions g, the flow for the time t is elementary, and the formula has no cancellation:

- g = ax² + bx + c: x + g(x) T/(1 − T(ax + b/2)) with T = tanh(wt)/w and w² = b²/4 − ac. If w² is negative, tan and
  √(−w²) replace tanh and w. If the sign of w² depends on parameters, T = t/(1 − sφ(s)) with s = −4w²t² and φ as in
  `phigen.symbolic.special`
- g = bx + c: x + g(x)(e^{bt} − 1)/b; for c = 0 this gives the log-canonical bi-realisation
- g = c e^{kx}: x − log(1 − kt g(x))/k
- g = c x^r: x(1 + (1 − r)t g(x)/x)^{1/(1−r)}
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from fractions import Fraction

from phigen.geometry.separated import separated
from phigen.geometry.shapes import coordinate_terms
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import PAPER, BiRealisation, covector_symbols, is_symmetric, refuse
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ONE, ZERO, Expression, call, derivative, number, power, sqrt, symbol, symbols_of
from phigen.symbolic.tower import Tower

KIND = "gauged"

_HALF = number(Fraction(1, 2))


@dataclass(frozen=True)
class _Motion:
    """The components of α − x (``early``), β − x (``late``) and β − α (``increment``) for one coordinate.

    All are written without cancellation.
    """

    early: Expression
    late: Expression
    increment: Expression


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the bi-realisation of π_ij = g_i(x_i) A_ij g_j(x_j). The bi-realisation is symmetric.

    Raises `SpecError` if π does not have this form, or if phigen knows no formula for the flow of some g_i.
    """
    separation = separated(system.coordinates, system.poisson)
    if separation is None:
        raise refuse(
            f"birealisation {KIND} needs π_ij = g_i(x_i) A_ij g_j(x_j) with constant A; this π is {system.shape}"
        )
    p = covector_symbols(system.coordinates)
    times = hamiltonian_vector_field(separation.matrix, [g * pi for g, pi in zip(separation.factors, p, strict=True)])
    motions = []
    for c, g, u in zip(system.coordinates, separation.factors, times, strict=True):
        motion = _motion(c, g, u, system.positive)
        if motion is None:
            raise refuse(f"birealisation {KIND}: phigen has no formula for the flow of {c}' = {g}", "try karasev")
        motions.append(motion)
    x = [symbol(c) for c in system.coordinates]
    alpha = tuple(xi + m.early for xi, m in zip(x, motions, strict=True))
    beta = tuple(xi + m.late for xi, m in zip(x, motions, strict=True))
    factors = ", ".join(
        f"{c}: {g}" for c, g in zip(system.coordinates, separation.factors, strict=True) if g is not ONE
    )
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        tuple(m.early for m in motions),
        tuple(m.increment for m in motions),
        is_symmetric(alpha, beta, system.coordinates),
        explanation=f"π is constant in other coordinates, π_ij = g_i A_ij g_j with the factors {factors or '1'}: the "
        "bi-realisation of the midpoint rule in these coordinates; symmetric",
        reference=f"{PAPER}, the quadratic example, with functions g_i(x_i) in place of the coordinates x_i",
    )


def _motion(c: str, g: Expression, u: Expression, positive: Collection[str]) -> _Motion | None:
    """Return the components of α − x, β − x and β − α for the coordinate ``c``.

    The first two are the increments of c along ẋ = g(x) for the times −½u and ½u; the third is their difference.
    Returns None if phigen knows no formula for this flow.
    """
    if u.is_zero:
        return _Motion(ZERO, ZERO, ZERO)
    terms = coordinate_terms([c], [g])
    if terms is not None and max(exponent for (exponent,) in terms[0]) <= 2:
        a, b, constant = (terms[0].get((k,), ZERO) for k in (2, 1, 0))
        if a.is_zero and b.is_number and not b.is_zero:
            return _exponential(g, u, b)
        return _quadratic(symbol(c), g, u, (a, b, constant), positive)
    rate = _constant(derivative(g, c) / g, c)
    if rate is not None and not rate.is_zero:
        backward, forward = (-call("log", 1 + sign * _HALF * rate * u * g) / rate for sign in (1, -1))
        return _Motion(backward, forward, forward - backward)
    degree = _constant(symbol(c) * derivative(g, c) / g, c)
    if degree is not None and degree.is_number and degree.value != 1:
        return _monomial(symbol(c), g, u, degree.value)
    return None


def _exponential(g: Expression, u: Expression, rate: Expression) -> _Motion:
    exponent = _HALF * rate * u
    backward, forward = (g * (call("exp", e) - 1) / rate for e in (-exponent, exponent))
    return _Motion(backward, forward, 2 * g * call("sinh", exponent) / rate)


def _quadratic(
    x: Expression,
    g: Expression,
    u: Expression,
    coefficients: tuple[Expression, Expression, Expression],
    positive: Collection[str],
) -> _Motion:
    a, b, c = coefficients
    squared = _simplified((b**2 - 4 * a * c) / 4)  # w² in the flow of ẋ = ax² + bx + c
    tilt = a * x + b / 2
    if not (squared.is_number or _is_positive(squared, positive)):
        s = -(squared * u**2)
        spread = 1 - s * call("phi0", s)
        slope = _HALF * u * tilt
        backward, forward = -(_HALF * g * u) / (spread + slope), (_HALF * g * u) / (spread - slope)
        return _Motion(backward, forward, g * u * spread / ((spread + slope) * (spread - slope)))
    T = _HALF * u
    if not squared.is_zero:
        turns = squared.is_number and squared.value < 0
        w = sqrt(-squared if turns else squared)
        T = call("tan" if turns else "tanh", w * T) / w
    backward, forward = -(g * T) / (1 + T * tilt), g * T / (1 - T * tilt)
    return _Motion(backward, forward, 2 * g * T / (1 - (T * tilt) ** 2))


def _is_positive(e: Expression, positive: Collection[str]) -> bool:
    match e.op:
        case "number":
            return bool(e.value > 0)
        case "symbol":
            return e.value in positive
        case "add" | "mul" | "pow":
            return all(_is_positive(a, positive) for a in e.args)
    return False


def _monomial(x: Expression, g: Expression, u: Expression, degree: Fraction) -> _Motion:
    complement = 1 - degree
    ratio = _HALF * number(complement) * u * (g / x)
    backward, forward = (x * (power(1 + sign * ratio, 1 / complement) - 1) for sign in (-1, 1))
    return _Motion(backward, forward, forward - backward)


def _constant(e: Expression, c: str) -> Expression | None:
    """Return an expression in a form without the coordinate ``c``; None if the expression depends on ``c``."""
    simple = _simplified(e)
    return None if c in symbols_of(simple) else simple


def _simplified(e: Expression) -> Expression:
    tower = Tower(symbols_of(e), [e])
    element = tower.convert(e)
    return ZERO if tower.is_zero(element) else tower.expression(element)
