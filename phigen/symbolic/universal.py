"""The universal anomaly of a Kepler motion: s with ds = dt/|q|, for ellipses, parabolas, hyperbolas and radial motions.

For q̈ = −μq/|q|³, let r = |q|, η = q·q̇ and β = 2μ/r − q̇² at the start. After the time t, s is the solution of

    r G1 + η G2 + μ G3 = t,    G1 = s sinroot(βs²),  G2 = s² sinroot(βs²/4)²/2,  G3 = s³ arcroot(βs²)

(E. Stiefel, G. Scheifele, Linear and Regular Celestial Mechanics, 1971). Here sinroot(u) = sin(√u)/√u, cosroot(u) = cos
√u and arcroot(u) = (√u − sin √u)/√u³; these functions are analytic for all u. The G_n are functions of Stumpff: G0 is
cosroot(βs²), G0' = −βG1 and G_n' = G_{n−1}. The derivative of the left-hand side with respect to s is the distance at
s, r G0 + η G1 + μ G2 > 0, so there is one solution. The derivatives of s follow by differentiating the equation; no
formula divides by β.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

#: Name of the universal anomaly in expressions: a function of t, r, η, β, μ and |q × q̇|². The head of the module
#: defines the arguments.
ANOMALY = "anomaly"

#: Largest number of iterations for the equation of s; if they do not suffice, s has no value. Bisection alone takes 53
#: iterations for double precision.
MOST_ITERATIONS = 100

#: A motion counts as radial if |q × q̇|² is at most this fraction of η² + |μ|r, where η = q·q̇ and r = |q|. The
#: relative rounding error of q × q̇ is about 10⁻¹⁵; its square is 10⁻³⁰.
RADIAL = 1e-30


def slopes(
    call: Callable[..., Any], s: Any, t: Any, r: Any, eta: Any, beta: Any, mu: Any, spin: Any
) -> tuple[Any, ...]:
    """Return the partial derivatives of the universal anomaly s with respect to t, r, η, β, μ and |q × q̇|².

    ``call`` applies a function by its name. The derivative with respect to |q × q̇|² is 0, since this argument only
    decides whether s has a value.
    """
    square = s**2
    z = beta * square
    half_sine, slope = call("sinroot", z / 4), call("sinroot1", z / 4)
    g1, g2, g3 = s * call("sinroot", z), square * half_sine**2 / 2, square * s * call("arcroot", z)
    inverse = 1 / (r * call("cosroot", z) + eta * g1 + mu * g2)
    # s·along_t is the derivative, with respect to z = βs² at constant s, of the left-hand side of the equation at the
    # head of the module. The derivative of sinroot(z/4)²/2, a factor of G2, is sinroot(z/4) sinroot1(z/4)/4.
    along_t = r * call("sinroot1", z) + eta * s * (half_sine * slope / 4) + mu * square * call("arcroot1", z)
    return inverse, -(g1 * inverse), -(g2 * inverse), -(square * s * along_t * inverse), -(g3 * inverse), 0


def value(library: Any, t: Any, r: Any, eta: Any, beta: Any, mu: Any, spin: Any) -> Any:
    """Return the universal anomaly s of a Kepler motion q̈ = −μq/|q|³ after the time t.

    The arguments are r = |q|, η = q·q̇, β = 2μ/r − q̇² and ``spin`` = |q × q̇|² at the start. ``library`` is `math`,
    for double precision, or an mpmath context, for the precision of this context. Raises `ValueError` if there is no
    value: at r = 0, and after a collision of a radial motion.
    """
    if not r > 0:
        raise ValueError("the distance of a Kepler motion is not positive")
    if t == 0:
        return t * 0
    sign = 1 if t > 0 else -1
    s = _solution(library, sign * t, r, sign * eta, beta, mu)
    if spin <= RADIAL * (eta**2 + abs(mu) * r) and _collides(library, s, r, sign * eta, beta):
        raise ValueError("a radial Kepler motion ends in a collision")
    return sign * s


def _solution(library: Any, t: Any, r: Any, eta: Any, beta: Any, mu: Any) -> Any:
    """Return the universal anomaly s for t > 0: the solution of the equation at the head of the module.

    The iteration is Laguerre's method. If a step leaves the interval that is known to contain the solution, bisection
    replaces it.
    """
    rounding = 2.3e-16 if library is math else library.eps
    low, high, s = 0 * t, None, _guess(library, t, r, eta, beta, mu)
    for k in range(MOST_ITERATIONS + (0 if library is math else 10 * library.dps)):
        residual, scale, slope, bend = _equation(library, s, t, r, eta, beta, mu)
        if residual <= 0:
            low = s
        else:
            high = s
        step = 5 * residual / (slope + library.sqrt(abs(16 * slope**2 - 20 * residual * bend)))
        if abs(residual) <= rounding * scale or abs(step) <= rounding * s:
            return s - step
        s -= step
        if high is None:
            s = s if low < s < 2 * low else 2 * low
        elif not low < s < high or k % 4 == 3:
            s = (low + high) / 2
    raise ValueError("the iteration for a Kepler motion does not end")


def _guess(library: Any, t: Any, r: Any, eta: Any, beta: Any, mu: Any) -> Any:
    """Return an initial value for the iteration that computes the universal anomaly s after the time t.

    For a small part of an orbit the initial value is a power series in t, or the first term t/r of the series. For a
    larger part of an elliptic orbit it is βt/μ, since the average rate of s is β/μ. For a larger part of a hyperbolic
    orbit it is 1/√(−β); the iteration doubles s as long as s is too small.
    """
    u = t / r
    if abs(beta) * u**2 > 1:
        return beta * t / mu if beta > 0 else 1 / library.sqrt(-beta)
    first, second = eta * u / (2 * r), (mu - beta * r) * u**2 / (6 * r)
    if abs(first) + abs(second) > 0.25:
        return u
    return u * (1 - first + 2 * first**2 - second)


def _equation(library: Any, s: Any, t: Any, r: Any, eta: Any, beta: Any, mu: Any) -> tuple[Any, Any, Any, Any]:
    """Return (residual, scale, slope, bend) for the equation of the universal anomaly s.

    The scale is the sum of |T| over the terms T of the equation. Slope and bend are the first two
    derivatives of the residual with respect to s.
    """
    from phigen.symbolic import entire

    z = beta * s**2
    half_sine, c3 = entire.value(library, "sinroot", z / 4), entire.value(library, "arcroot", z)
    g1, g2, g3 = s * (1 - z * c3), s**2 * half_sine**2 / 2, s**3 * c3
    g0 = 1 - beta * g2
    scale = t + abs(r * g1) + abs(eta * g2) + abs(mu * g3)
    return (
        r * g1 + eta * g2 + mu * g3 - t,
        scale,
        r * g0 + eta * g1 + mu * g2,
        eta * g0 + (mu - beta * r) * g1,
    )


def _collides(library: Any, s: Any, r: Any, eta: Any, beta: Any) -> bool:
    """Whether a radial motion reaches r = 0 before its universal anomaly is s.

    Along a radial motion, the second derivative of √r with respect to the anomaly is −(β/4)√r. So √r is known in closed
    form.
    """
    from phigen.symbolic import entire

    z = beta * s**2 / 4
    root = r * entire.value(library, "cosroot", z) + eta * s / 2 * entire.value(library, "sinroot", z)
    return bool(root <= 0 or z >= math.pi**2)
