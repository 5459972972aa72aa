"""Jacobi's elliptic functions for the free rigid body. All follow from one real number, κ = tan(φ/4)/√P.

For P ≥ Q ≥ 0 the amplitude φ is the increasing solution of φ̇² = P − Q sin²φ with φ(0) = 0. Let S = sin(φ)/√P, C = cos φ
and D = √(1 − QS²). In Jacobi's notation, S = sn/√P, C = cn and D = dn at the argument √P t, with the modulus √(Q/P).
The derivative of S is CD. With κ = tan(φ/4)/√P and z = Pκ²,

    S = 4κ(1 − z)/(1 + z)²,    C = (1 − 6z + z²)/(1 + z)²,    D² = C² + (P − Q)S².

`AMPLITUDE` is κ as a function of (t, P, R) with R = P − Q. Full turns are subtracted from φ, so that |κ|√P ≤ 1. The
argument is R rather than Q because R is small near a separatrix, where the difference P − Q would lose digits. The
derivatives of κ contain the integrals G = ∫ S² dt (`SQUARES`) and I = ∫ S²/D² dt (`RATIOS`) from 0 to t. The formulas
of the derivatives contain no division by P, Q or R:

    ∂κ/∂t = (1 + z)D/4,  ∂κ/∂R = (1 + z)DI/8,  ∂κ/∂P = (1 + z)DG/8 − κ³(5 − 2z + z²)/(1 + z)³.

`THIRD` is ∫ S²/(1 − nS²) dt from 0 to t as a function of (t, P, R, n) with n ≤ 0, an integral of the third kind.

If Pt² ≤ 1, generated code computes S at t/16 by a power series, and doubles the argument four times. Otherwise it
computes φ by the arithmetic–geometric mean of √P and √R (M. Abramowitz, I. A. Stegun, Handbook of Mathematical
Functions, 16.4 and 17.6). The arcsines of this method are written as arctangents, so that there is no cancellation. The
integrals are computed from Carlson's R_D and R_J, by duplication (B. C. Carlson, Numerical computation of real or
complex elliptic integrals, Numerical Algorithms 10, 1995).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

#: Names, in expressions, of the functions κ, G and I, whose arguments are t, P and R. The text at the head of the
#: module defines them.
AMPLITUDE, SQUARES, RATIOS = ELLIPTIC = ("amplitude", "amplitude1", "amplitude2")

#: Name, in expressions, of the elliptic integral of the third kind; its arguments are t, P, R and n. The text at the
#: head of the module defines it.
THIRD = "amplitude3"

#: If Pt² ≤ 1, generated code sums TERMS terms of the power series of S at t/2^DOUBLINGS, and then doubles the time
#: DOUBLINGS times. The head of the module defines P and S. At t/16 the omitted terms are below 10⁻¹⁸.
DOUBLINGS, TERMS = 4, 6

#: The arithmetic–geometric mean is the limit of the iteration a, b → (a + b)/2, √(ab). Let c = (a − b)/2. The iteration
#: ends when c/a is at most MEAN_RATIO. One more iteration would change c/a to (c/a)²/4, which is below rounding.
MEAN_RATIO = 1e-8

#: Number of duplication steps for Carlson's R_D in SIMD code, which has no branches. In SIMD code, the arguments of R_D
#: differ by at most 0.71, so that five steps give double precision.
LANE_DUPLICATIONS = 5


@cache
def series() -> tuple[tuple[Fraction, ...], ...]:
    """Return the coefficients c[j][i] of the power series S/t = Σ c[j][i] xⁱ yʲ, where x = (P + Q)t² and y =
    PQt⁴.

    S is the function of t that the text at the head of the module defines. The coefficients follow from its
    differential equation S̈ = −(P + Q)S + 2PQS³.
    """
    terms = [{(0, 0): Fraction(1)}]  # entry n: the terms of S/t with t²ⁿ, as {(i, j): c[j][i]}
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
    coefficients = {power: c for term in terms for power, c in term.items()}
    return tuple(
        tuple(coefficients[i, j] for i in range(TERMS - 2 * j))
        for j in range((TERMS + 1) // 2)
        if (0, j) in coefficients
    )


def _product(a: dict[tuple[int, int], Fraction], b: dict[tuple[int, int], Fraction]) -> dict[tuple[int, int], Fraction]:
    """Return the product of two polynomials in x and y, which map exponents (i, j) to coefficients."""
    product: dict[tuple[int, int], Fraction] = {}
    for (i, j), c in a.items():
        for (k, m), d in b.items():
            product[i + k, j + m] = product.get((i + k, j + m), Fraction(0)) + c * d
    return product


def functions_of(kappa: Any, p: Any, r: Any) -> tuple[Any, Any, Any]:
    """Return S = sn/√P, C = cn and D² = dn² from κ, by the formulas at the head of the module; P = ``p``, R = ``r``."""
    z = p * kappa**2
    inverse = 1 / (1 + z) ** 2
    s, c = 4 * kappa * (1 - z) * inverse, (1 - 6 * z + z**2) * inverse
    return s, c, c**2 + r * s**2


def slopes(call: Callable[..., Any], kappa: Any, t: Any, p: Any, r: Any) -> tuple[Any, ...]:
    """Return the partial derivatives of κ, the result of `value`, with respect to t, P and R.

    ``kappa`` is κ itself. ``call`` applies a function by its name.
    """
    z = p * kappa**2
    *_, square = functions_of(kappa, p, r)
    along_t = (1 + z) * square ** Fraction(1, 2) / 4
    squares, ratios = call(SQUARES, t, p, r), call(RATIOS, t, p, r)
    explicit = kappa**3 * (5 - 2 * z + z**2) / (1 + z) ** 3
    return along_t, along_t * squares / 2 - explicit, along_t * ratios / 2


def value(library: Any, t: Any, p: Any, r: Any) -> Any:
    """Return κ = tan(φ/4)/√P, where φ is Jacobi's amplitude of √P t with the modulus √(1 − R/P).

    ``library`` is `math`, for double precision, or an mpmath context, for the precision of this context.
    """
    return _reduced(library, t, p, r)[0]


def squares(library: Any, t: Any, p: Any, r: Any) -> Any:
    """Return ∫ S² dt from 0 to t, where S = sn(√P t)/√P with the modulus √(1 − R/P)."""
    return _integral(library, t, p, r, lambda c, d, _: carlson(library, c, d, 1 + 0 * c))


def ratios(library: Any, t: Any, p: Any, r: Any) -> Any:
    """Return ∫ S²/D² dt from 0 to t, where S = sn(√P t)/√P and D = dn(√P t) with the modulus √(1 − R/P)."""
    return _integral(library, t, p, r, lambda c, d, _: carlson(library, c, 1 + 0 * c, d))


def third(library: Any, t: Any, p: Any, r: Any, n: Any) -> Any:
    """Return ∫ S²/(1 − nS²) dt from 0 to t, where S = sn(√P t)/√P with the modulus √(1 − R/P), and n ≤ 0."""
    return _integral(library, t, p, r, lambda c, d, e: carlson_third(library, c, d, 1 - n * e))


def _reduced(library: Any, t: Any, p: Any, r: Any) -> tuple[Any, Any]:
    """Return κ = tan(φ/4)/√P (see `value`) for φ reduced to −π ≤ φ < π, and the number of turns that were removed."""
    if p <= 0:
        return t / 4, 0
    root = library.sqrt(p)
    phi = _amplitude(library, root * t, min(max(r, 0 * r), p) / p)
    turns = library.floor(phi / (2 * library.pi) + 0.5)
    return library.tan((phi - 2 * library.pi * turns) / 4) / root, turns


def _amplitude(library: Any, u: Any, k: Any) -> Any:
    """Return Jacobi's amplitude am(u) by the arithmetic–geometric mean.

    ``k`` is the square of the complementary modulus, 1 − modulus².
    """
    a, b, c = 1 + 0 * u, library.sqrt(k), library.sqrt(1 - k)
    if b == 0:
        return 2 * library.atan(library.tanh(u / 2))
    ratio = MEAN_RATIO if library is math else library.sqrt(library.eps)
    quotients: list[tuple[Any, Any]] = []
    while c > ratio * a:
        a, b, c = (a + b) / 2, library.sqrt(a * b), (a - b) / 2
        quotients.append((c / a, (b / a) ** 2))
    phi = 2 ** len(quotients) * a * u
    for quotient, squared_ratio in reversed(quotients):
        cosine = library.sqrt(squared_ratio + (quotient * library.cos(phi)) ** 2)
        phi = (phi + library.atan2(quotient * library.sin(phi), cosine)) / 2
    return phi


def _integral(library: Any, t: Any, p: Any, r: Any, carlson_of: Callable[[Any, Any, Any], Any]) -> Any:
    """Return ∫ S² f dt from 0 to t, where f is 1, 1/D² or 1/(1 − nS²). The head of the module defines S and D.

    The integral is S³/3 times an elliptic integral of Carlson. ``carlson_of``, which is different for each f, computes
    the elliptic integral from C², D² and S².
    """
    if p <= 0:
        return t**3 / 3
    r = min(max(r, 0 * r), p)
    kappa, turns = _reduced(library, t, p, r)
    s, c, square = functions_of(kappa, p, r)
    halves = 2 * turns
    if c < 0:
        halves, s = halves + (1 if s > 0 else -1), -s
    result = s**3 / 3 * carlson_of(c**2, square, s**2)
    if halves:
        result += 2 * halves * carlson_of(0 * p, r / p, 1 / p) / (3 * p * library.sqrt(p))
    return result


def carlson_third(library: Any, x: Any, y: Any, w: Any) -> Any:
    """Return Carlson's R_J(x, y, 1, w) for x, y ≤ 1 ≤ w."""
    rounding = 2.2e-16 if library is math else library.eps
    z, start = 1 + 0 * x, (x + y + 1 + 2 * w) / 5
    mean, factor, terms = start, 1 + 0 * x, 0 * x
    spread = max(abs(mean - e) for e in (x, y, z, w)) * (rounding / 4) ** (-1 / 6 + 0 * rounding)
    excess = (w - x) * (w - y) * (w - z)
    first = (x, y, z)
    while factor * spread > mean:
        a, b, c, d = (library.sqrt(e) for e in (x, y, z, w))
        common, divisor = a * b + a * c + b * c, (d + a) * (d + b) * (d + c)
        e = library.sqrt(excess * factor**3) / divisor
        terms += factor / divisor * (library.atan(e) / e if e > 0 else 1)
        factor /= 4
        x, y, z, w, mean = ((value + common) / 4 for value in (x, y, z, w, mean))
    a, b, c = (factor * (start - e) / mean for e in first)
    return factor * _third_series(a, b, c) / (mean * library.sqrt(mean)) + 6 * terms


def _third_series(a: Any, b: Any, c: Any) -> Any:
    """Return R_J(x, y, z, w) · mean^(3/2) by a power series, where mean = (x + y + z + 2w)/5 is close to all
    arguments.

    ``a``, ``b`` and ``c`` are the relative differences (mean − x)/mean, (mean − y)/mean and (mean − z)/mean.
    """
    d = -(a + b + c) / 2
    product, dd = a * b * c, d * d
    second = a * b + a * c + b * c - 3 * dd
    third_sum = product + 2 * second * d + 4 * dd * d
    fourth, fifth = (2 * product + second * d + 3 * dd * d) * d, product * dd
    even_terms = -3 * second / 14 + 9 * second**2 / 88 - 3 * fourth / 22
    return 1 + even_terms + third_sum / 6 - 9 * second * third_sum / 52 + 3 * fifth / 26


def carlson(library: Any, x: Any, y: Any, z: Any) -> Any:
    """Return the elliptic integral R_D(x, y, z) of Carlson."""
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
