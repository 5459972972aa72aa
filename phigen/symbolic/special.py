"""The function φ of the exponential bi-realisation, and its first two derivatives.

φ(s) = (1 − w cot w)/s with w = ½√s. The function is analytic at s = 0 and for s < 0, where cot becomes coth. Its poles
are s = 4π²n² for n ≥ 1. φ occurs in the even part of z/(1 − e^{−z}), which is (z/2) coth(z/2) = 1 + z² φ(−z²).

- φ(s) = Σ a_n sⁿ with a_n = |B_{2n+2}|/(2n+2)!
- sφ' = 1/8 − (3/2)φ + ½sφ² (Riccati), hence (n + 3/2) a_n = ½ Σ_{i+j=n−1} a_i a_j, a_0 = 1/12
- φ(s) = Σ_{n≥1} 2/(4π²n² − s): after subtraction of the term n = 1, the power series converges for |s| < 16π²

The names of φ and its derivatives as functions of expressions are ``phi0``, ``phi1``, ``phi2``.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache
from typing import Any

#: Names of φ, φ' and φ'' in expressions; the head of the module defines φ. Higher derivatives are not available.
SPECIAL = ("phi0", "phi1", "phi2")

#: Bounds of |s| between three ways to compute φ. For |s| < NEAR it is the sum of a power series. For NEAR ≤ |s| <
#: MIDDLE it is the pole nearest to 0 plus a power series. For larger |s| the closed form is used.
NEAR, MIDDLE = 0.25, 16.0
NEAR_TERMS, MIDDLE_TERMS = 9, 21
POLE = 4 * math.pi**2

#: SIMD code, which has no branches, computes φ, φ' and φ'' by power series with LANE_TERMS terms. The series are
#: accurate for |s| ≤ LANE_REACH.
LANE_REACH, LANE_TERMS = 4.0, 17

_PI = Fraction(31415926535897932384626433832795028841971693993751058209749445923078164062862089986, 10**82)


@cache
def _series(n: int) -> Fraction:
    if n == 0:
        return Fraction(1, 12)
    return sum((_series(i) * _series(n - 1 - i) for i in range(n)), Fraction(0)) / (2 * n + 3)


def order_of(name: str) -> int:
    """Return the number of primes of φ, φ′ or φ″. ``name`` is the name of the function in expressions; `coefficient`
    defines φ.
    """
    return SPECIAL.index(name)


def coefficient(order: int, n: int) -> Fraction:
    """Return the exact coefficient of sⁿ in the Taylor series of φ, φ′ or φ″; ``order`` is the number of primes.

    Here and below, φ(s) = (1 − w cot w)/s with w = ½√s, the function of the exponential bi-realisation.
    """
    return _series(n + order) * (math.factorial(n + order) // math.factorial(n))


def near_coefficients(order: int) -> list[float]:
    """Return the Taylor coefficients that are needed for φ, φ′ or φ″ if |s| < `NEAR`, the constant coefficient
    first.

    ``order`` is the number of primes; `coefficient` defines φ.
    """
    return [float(coefficient(order, n)) for n in range(NEAR_TERMS)]


def lane_coefficients(order: int) -> list[float]:
    """Return the Taylor coefficients that SIMD code needs for φ, φ′ or φ″, the constant coefficient first.

    ``order`` is the number of primes; `coefficient` defines φ.
    """
    return [float(coefficient(order, n)) for n in range(LANE_TERMS)]


@cache
def rest_coefficients(order: int) -> list[float]:
    """Return the Taylor coefficients of φ, φ′ or φ″ without the pole nearest to 0, the constant coefficient first.

    With k = ``order``, the function is φ^(k)(s) − 2·k!/(4π² − s)^{k+1}. The coefficients suffice for |s| < `MIDDLE`.
    """
    differences = []
    for n in range(MIDDLE_TERMS):
        factor = math.factorial(n + order) // math.factorial(n)
        differences.append(float((_series(n + order) - 2 / (4 * _PI**2) ** (n + order + 1)) * factor))
    return differences


def in_double(order: int, s: float) -> float:
    """Return a derivative of φ at s by the algorithm of generated code. ``order`` is the order of the derivative, and
    `coefficient` defines φ.
    """
    if abs(s) < NEAR:
        return _polynomial(near_coefficients(order), s)
    if abs(s) < MIDDLE:
        pole: float = 2.0 * math.factorial(order) / (POLE - s) ** (order + 1)
        return pole + _polynomial(rest_coefficients(order), s)
    w = 0.5 * math.sqrt(abs(s))
    return float(_closed(order, s, w / (math.tan(w) if s > 0 else math.tanh(w))))


def precisely(context: Any, order: int, s: Any) -> Any:
    """Return a derivative of φ at s in an mpmath context. ``order`` is the order of the derivative, and `coefficient`
    defines φ.

    The last two digits may be wrong.
    """
    if abs(s) < 1:
        terms = int(context.dps / 1.5) + 6  # a_n decreases like (4π²)^{−n}
        value = context.zero
        for n in reversed(range(terms)):
            c = coefficient(order, n)
            value = value * s + context.mpf(c.numerator) / c.denominator
        return value
    w = context.sqrt(abs(s)) / 2
    return _closed(order, s, w / (context.tan(w) if s > 0 else context.tanh(w)))


def value(library: Any, order: int, s: Any) -> Any:
    """Return a derivative of φ at s; ``order`` is the order of the derivative, and `coefficient` defines φ.

    ``library`` is `math`, for double precision, or an mpmath context, for the precision of this context.
    """
    return in_double(order, s) if library is math else precisely(library, order, s)


def _closed(order: int, s: Any, c: Any) -> Any:
    """Return φ(s) = (1 − c)/s, or a derivative of φ.

    For s > 0, c is w cot w with w = ½√s. For s < 0, c is w coth w with w = ½√(−s). The derivatives follow from the
    Riccati equation sφ' = 1/8 − (3/2)φ + ½sφ².
    """
    phi0 = (1 - c) / s
    if order == 0:
        return phi0
    phi1 = (s * phi0**2 / 2 - 3 * phi0 / 2 + 0.125) / s
    if order == 1:
        return phi1
    return (phi0**2 / 2 - 5 * phi1 / 2 + s * phi0 * phi1) / s


def _polynomial(coefficients: list[float], s: float) -> float:
    value = 0.0
    for c in reversed(coefficients):
        value = value * s + c
    return value
