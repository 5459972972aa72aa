"""Exponentials of matrices with at most four rows, by Cayley and Hamilton: e^{tA} = 1 + Σ F_k A^k for k < 4.

If A⁴ = a_0 + a_1 A + a_2 A² + a_3 A³, the remainder of e^{tx} at division by p = x⁴ − a_3 x³ − a_2 x² − a_1 x − a_0 is
1 + Σ F_k x^k. `REMAINDERS` are the F_k, functions of t, a_0, …, a_3; matrices with three rows have a_0 = 0. They are
entire: eigenvalues, which may be complex or coincide, do not occur. With g = Σ G_k x^k the remainder of the quotient
(e^{tx} − 1 − Σ F_k x^k)/p at division by p, whose coefficients are `QUOTIENTS`,

    ∂F_k/∂t = F_{k−1} + a_k F_3 (with F_{−1} = 0, and F_0 + 1 for F_0),   Σ ∂F_k/∂a_j x^k = x^j g mod p.

With y = ux, where u is t halved until the roots of p in y are small, remainders of powers of y are a recurrence, their
sums are those of e^y, and squares modulo p lead back to t: (1 + F)² − 1 = 2F + F².
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

#: Names of the functions; their arguments are t, a_0, …, a_3.
REMAINDERS = tuple(f"exprem{k}" for k in range(4))
QUOTIENTS = tuple(f"expquo{k}" for k in range(4))

#: The largest bound of the roots, halved, for the series of e^y, and its terms: the rest is below 10⁻¹⁷.
MAX_ROOT, TERMS = 0.25, 18

#: Doublings in code without branches: t is that of four times `MAX_ROOT`.
LANE_DOUBLINGS = 2


def slopes(k: int) -> Callable[..., tuple[Any, ...]]:
    """Return the rule for the partial derivatives of F_k along t, a_0, …, a_3."""

    def rule(call: Callable[..., Any], f: Any, t: Any, *a: Any) -> tuple[Any, ...]:
        last = call(REMAINDERS[3], t, *a)
        vanishing = k == 0 or (k == 1 and getattr(a[0], "is_zero", a[0] == 0))  # F_0 is 0 with a_0
        previous = 0 if vanishing else call(REMAINDERS[k - 1], t, *a)
        slope = (previous + 1 if k == 1 else previous) + a[k] * last
        quotient = [call(name, t, *a) for name in QUOTIENTS]
        partial = []
        for _ in range(4):
            partial.append(quotient[k])
            quotient = times_x(quotient, a)
        return slope, *partial

    return rule


def times_x(coefficients: Any, a: Any) -> list[Any]:
    """Return x times a polynomial of degree 3 modulo p."""
    *lower, top = coefficients
    return [c * top + e for c, e in zip(a, [0, *lower], strict=True)]


def value(k: int, library: Any, t: Any, *a: Any) -> Any:
    """F_k, in double precision if the library is `math`, else to that of an mpmath context."""
    return _coefficients(library, t, a)[0][k]


def quotient(k: int, library: Any, t: Any, *a: Any) -> Any:
    """Return G_k (module docstring), in the precision of the library as `value`."""
    return _coefficients(library, t, a)[1][k]


def _coefficients(library: Any, t: Any, a: Any) -> tuple[list[Any], list[Any]]:
    """The F_k and the G_k."""
    root_bound = max(abs(c * t ** (4 - j)) ** (1 / (4 - j) + 0 * t) for j, c in enumerate(a))
    halvings = 0
    while root_bound > MAX_ROOT:
        root_bound, halvings = root_bound / 2, halvings + 1
    u = t / 2**halvings
    c = [e * u ** (4 - j) for j, e in enumerate(a)]
    zero = 0 * t
    f, g, r, q, factor = [zero] * 4, [zero] * 4, [zero + 1, zero, zero, zero], [zero] * 4, zero + 1
    for n in range(1, 1 + (TERMS if library is math else TERMS + 2 * library.dps)):
        top = r[3]
        q, r = times_x(q, c), times_x(r, c)
        q[0], factor = q[0] + top, factor / n
        f = [x + factor * y for x, y in zip(f, r, strict=True)]
        g = [x + factor * y for x, y in zip(g, q, strict=True)]
    for _ in range(halvings):
        upper, square = _divided_by_quadric(_product(f, f), c)
        _, remainder = _divided_by_quadric(_product(f, g), c)
        f = [2 * x + y for x, y in zip(f, square, strict=True)]
        g = [2 * (x + y) + e for x, y, e in zip(g, remainder, [*upper, zero], strict=True)]
    return [e * u**k for k, e in enumerate(f)], [e * u ** (4 + k) for k, e in enumerate(g)]


def _product(a: Any, b: Any) -> list[Any]:
    """Return the product of two polynomials of degree 3."""
    return [sum(a[i] * b[n - i] for i in range(max(0, n - 3), min(n, 3) + 1)) for n in range(7)]


def _divided_by_quadric(d: list[Any], c: Any) -> tuple[list[Any], list[Any]]:
    """Return quotient and remainder of a polynomial of degree 6 at division by p."""
    d = [*d]
    for k in (6, 5, 4):
        for j in range(4):
            d[k - 4 + j] += d[k] * c[j]
    return d[4:], d[:4]
