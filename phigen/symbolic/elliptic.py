"""Jacobi's elliptic functions for the free rigid body, by one real number: the tangent of a quarter of the amplitude.

For P ≥ Q ≥ 0 let φ be the amplitude, φ(0) = 0 with φ̇² = P − Q sin²φ. Then S = sin(φ)/√P, C = cos φ and D = √(1 − QS²)
are sn, cn and dn of √P t with the modulus √(Q/P), and Ṡ = CD. With κ = tan(φ/4)/√P and z = Pκ²,

    S = 4κ(1 − z)/(1 + z)²,    C = (1 − 6z + z²)/(1 + z)²,    D² = C² + (P − Q)S².

`AMPLITUDE` is κ of (t, P, Q), for φ less full turns, so that |κ|√P ≤ 1. Its derivatives have G = ∫ S² dt and
I = ∫ S²/D² dt from 0 to t, `SQUARES` and `RATIOS`; none divides by P, Q or P − Q:

    ∂κ/∂t = (1 + z)D/4,  ∂κ/∂Q = −(1 + z)DI/8,  ∂κ/∂P = (1 + z)D(G + I)/8 − κ³(5 − 2z + z²)/(1 + z)³.

Where Pt² ≤ 1, S is a power series at t/16, doubled four times; elsewhere φ follows from the arithmetic–geometric mean
of √P and √(P − Q) (M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 16.4 and 17.6). G and I are
Carlson's integral R_D, by duplication (B. C. Carlson, Numerical computation of real or complex elliptic integrals,
Numerical Algorithms 10, 1995).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

#: Names of the functions; their arguments are t, P and Q.
AMPLITUDE, SQUARES, RATIOS = ELLIPTIC = ("amplitude", "amplitude1", "amplitude2")

#: Doublings of the series, and its terms: at Pt² ≤ 1 and a 16th of t what is left out is below 10⁻¹⁸.
DOUBLINGS, TERMS = 4, 6

#: c/a of the arithmetic–geometric mean where the next c/a, a quarter of its square, is below rounding.
MEAN_RATIO = 1e-8

#: Duplications of R_D in code without branches; its arguments there differ by 0.71 at most.
LANE_DUPLICATIONS = 5


@cache
def series() -> tuple[tuple[Fraction, ...], ...]:
    """Return the coefficients of S/t = Σ c[j][i] xⁱ yʲ with x = (P + Q)t² and y = PQt⁴: S̈ = −(P + Q)S + 2PQS³."""
    terms = [{(0, 0): Fraction(1)}]  # of t⁰, t², …: coefficients by the powers of x and y
    for n in range(TERMS - 1):
        following: dict[tuple[int, int], Fraction] = {}
        divisor = (2 * n + 2) * (2 * n + 3)
        for (i, j), c in terms[n].items():
            following[i + 1, j] = following.get((i + 1, j), Fraction(0)) - c / divisor
        for a in range(n):
            for b in range(n - a):
                for (i, j), c in _product(_product(terms[a], terms[b]), terms[n - 1 - a - b]).items():
                    following[i, j + 1] = following.get((i, j + 1), Fraction(0)) + 2 * c / divisor
        terms.append(following)
    listed = {power: c for term in terms for power, c in term.items()}
    return tuple(tuple(listed[i, j] for i in range(TERMS - 2 * j)) for j in range((TERMS + 1) // 2) if (0, j) in listed)


def _product(a: dict[tuple[int, int], Fraction], b: dict[tuple[int, int], Fraction]) -> dict[tuple[int, int], Fraction]:
    """Return the product of two polynomials."""
    product: dict[tuple[int, int], Fraction] = {}
    for (i, j), c in a.items():
        for (k, m), d in b.items():
            product[i + k, j + m] = product.get((i + k, j + m), Fraction(0)) + c * d
    return product


def functions_of(kappa: Any, p: Any, q: Any) -> tuple[Any, Any, Any]:
    """Return S, C and D² from κ."""
    z = p * kappa**2
    inverse = 1 / (1 + z) ** 2
    s, c = 4 * kappa * (1 - z) * inverse, (1 - 6 * z + z**2) * inverse
    return s, c, c**2 + (p - q) * s**2


def slopes(call: Callable[..., Any], kappa: Any, t: Any, p: Any, q: Any) -> tuple[Any, ...]:
    """The partial derivatives of κ along t, P and Q."""
    z = p * kappa**2
    *_, square = functions_of(kappa, p, q)
    along = (1 + z) * square ** Fraction(1, 2) / 4
    squares, ratios = call(SQUARES, t, p, q), call(RATIOS, t, p, q)
    explicit = kappa**3 * (5 - 2 * z + z**2) / (1 + z) ** 3
    return along, along * (squares + ratios) / 2 - explicit, -(along * ratios) / 2


def value(library: Any, t: Any, p: Any, q: Any) -> Any:
    """κ, in double precision if the library is `math`, else to that of an mpmath context."""
    return _reduced(library, t, p, q)[0]


def squares(library: Any, t: Any, p: Any, q: Any) -> Any:
    """∫ S² dt from 0 to t."""
    return _integral(library, t, p, q, lambda c, d: (c, d, 1 + 0 * c))


def ratios(library: Any, t: Any, p: Any, q: Any) -> Any:
    """∫ S²/D² dt from 0 to t."""
    return _integral(library, t, p, q, lambda c, d: (c, 1 + 0 * c, d))


def _reduced(library: Any, t: Any, p: Any, q: Any) -> tuple[Any, Any]:
    """κ, and the number of full turns that the amplitude has made."""
    q = min(max(q, 0 * q), p)
    if p <= 0:
        return t / 4, 0
    root = library.sqrt(p)
    phi = _amplitude(library, root * t, q / p)
    turns = library.floor(phi / (2 * library.pi) + 0.5)
    return library.tan((phi - 2 * library.pi * turns) / 4) / root, turns


def _amplitude(library: Any, u: Any, m: Any) -> Any:
    """The amplitude of u for the square m of the modulus, by the arithmetic–geometric mean."""
    a, b, c = 1 + 0 * u, library.sqrt(1 - m), library.sqrt(m)
    if b == 0:
        return 2 * library.atan(library.tanh(u / 2))
    ratio = MEAN_RATIO if library is math else library.sqrt(library.eps)
    quotients: list[Any] = []
    while c > ratio * a:
        a, b, c = (a + b) / 2, library.sqrt(a * b), (a - b) / 2
        quotients.append(c / a)
    phi = 2 ** len(quotients) * a * u
    for quotient in reversed(quotients):
        phi = (phi + library.asin(quotient * library.sin(phi))) / 2
    return phi


def _integral(library: Any, t: Any, p: Any, q: Any, arguments: Callable[[Any, Any], tuple[Any, ...]]) -> Any:
    """An integral of S² over t; ``arguments`` are those of R_D, from C² and D²."""
    q = min(max(q, 0 * q), p)
    kappa, turns = _reduced(library, t, p, q)
    s, c, square = functions_of(kappa, p, q)
    halves = 2 * turns
    if c < 0:
        halves, s = halves + (1 if s > 0 else -1), -s
    result = s**3 / 3 * carlson(library, *arguments(c**2, square))
    if halves:
        whole = carlson(library, *arguments(0 * p, 1 - q / p))
        result += 2 * halves * whole / (3 * p * library.sqrt(p))
    return result


def carlson(library: Any, x: Any, y: Any, z: Any) -> Any:
    """Carlson's R_D(x, y, z)."""
    rounding = 2.2e-16 if library is math else library.eps
    start = mean = (x + y + 3 * z) / 5
    spread = max(abs(mean - x), abs(mean - y), abs(mean - z)) * (rounding / 4) ** (-1 / 6 + 0 * rounding)
    first, factor, terms = (x, y), 1 + 0 * x, 0 * x
    while factor * spread > mean:
        a, b, c = library.sqrt(x), library.sqrt(y), library.sqrt(z)
        common = a * b + a * c + b * c
        terms += factor / (c * (z + common))
        factor /= 4
        x, y, z, mean = (x + common) / 4, (y + common) / 4, (z + common) / 4, (mean + common) / 4
    a, b = (factor * (start - e) / mean for e in first)
    c = -(a + b) / 3
    second, third = a * b - 6 * c**2, (3 * a * b - 8 * c**2) * c
    fourth, fifth = 3 * (a * b - c**2) * c**2, a * b * c**3
    polynomial = 1 - 3 * second / 14 + third / 6 + 9 * second**2 / 88 - 3 * fourth / 22
    polynomial += -9 * second * third / 52 + 3 * fifth / 26
    return factor * polynomial / (mean * library.sqrt(mean)) + 3 * terms
