"""Exponentials of matrices with at most four rows, by the theorem of Cayley and Hamilton.

Let A⁴ = a_0 + a_1 A + a_2 A² + a_3 A³ and p = x⁴ − a_3 x³ − a_2 x² − a_1 x − a_0. Division of e^{tx} by p leaves a
remainder of degree at most 3, written as 1 + Σ F_k x^k. Then e^{tA} = 1 + Σ F_k A^k. `REMAINDERS` are the names of the
functions F_0, …, F_3. Their arguments are t, a_0, …, a_3; for matrices with three rows, a_0 = 0. The functions are
entire, and their formulas contain no eigenvalues, which may be complex or equal. Let g = Σ G_k x^k be the remainder of
the quotient (e^{tx} − 1 − Σ F_k x^k)/p on a further division by p. `QUOTIENTS` are the names of the G_k.

The derivatives of the F_k are

    ∂F_k/∂t = F_{k−1} + a_k F_3 (for k = 1, F_0 + 1 replaces F_0; F_{−1} = 0),   Σ_k (∂F_k/∂a_j) x^k = x^j g mod p.

The computation first replaces t by u = t/2ⁿ, where n is so large that p, as a polynomial in y = ux, has only small
roots. A recurrence gives the remainders of the powers of y, and hence the remainder of e^y. Then n squarings modulo p
lead back to t: if 1 + F is the remainder for u, the remainder for 2u is (1 + F)² = 1 + 2F + F² modulo p.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

#: Names, in expressions, of the functions F_0, …, F_3 and G_0, …, G_3. The head of the module defines these functions.
REMAINDERS = tuple(f"exprem{k}" for k in range(4))
QUOTIENTS = tuple(f"expquo{k}" for k in range(4))

#: The head of the module explains t, p and y. The number t is halved until a bound for the roots of p is at most
#: MAX_ROOT. Then TERMS terms of the series of e^y are summed; the omitted terms are below 10⁻¹⁷.
MAX_ROOT, TERMS = 0.25, 18

#: Number of halvings of t in SIMD code. The number is constant, since SIMD code has no branches. Two halvings suffice
#: if the bound for the roots of p is at most 4 `MAX_ROOT` at first.
LANE_DOUBLINGS = 2


def slopes(k: int) -> Callable[..., tuple[Any, ...]]:
    """Return the function that computes the partial derivatives of F_k (see `value`) with respect to t, a_0, …,
    a_3.

    Its first argument, ``call``, applies a function by its name.
    """

    def rule(call: Callable[..., Any], f: Any, t: Any, *a: Any) -> tuple[Any, ...]:
        last = call(REMAINDERS[3], t, *a)
        # Whether F_{k−1} = 0: this holds for F_{−1}, and if a_0 = 0 also for F_0.
        vanishing = k == 0 or (k == 1 and getattr(a[0], "is_zero", a[0] == 0))
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
    """Return the product of x and a polynomial of degree 3, modulo p = x⁴ − a_3 x³ − a_2 x² − a_1 x − a_0.

    The constant coefficient is the first one in the argument and in the result.
    """
    *lower, top = coefficients
    return [c * top + e for c, e in zip(a, [0, *lower], strict=True)]


def value(k: int, library: Any, t: Any, *a: Any) -> Any:
    """Return F_k: 1 + Σ F_k x^k is the remainder of e^{tx} on division by x⁴ − a_3 x³ − a_2 x² − a_1 x − a_0.

    ``library`` is `math`, for double precision, or an mpmath context, for the precision of this context.
    """
    return _coefficients(library, t, a)[0][k]


def quotient(k: int, library: Any, t: Any, *a: Any) -> Any:
    """Return the coefficient G_k of x^k in the remainder of Q on division by p.

    Here p = x⁴ − a_3 x³ − a_2 x² − a_1 x − a_0 and Q = (e^{tx} − 1 − Σ F_k x^k)/p. `value` computes F_k; its docstring
    explains ``library``.
    """
    return _coefficients(library, t, a)[1][k]


def _coefficients(library: Any, t: Any, a: Any) -> tuple[list[Any], list[Any]]:
    """Return the lists of all F_k (see `value`) and of all G_k (see `quotient`), in the precision of the library."""
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
    """Return the product of two polynomials of degree 3, as its seven coefficients, the constant first."""
    return [sum(a[i] * b[n - i] for i in range(max(0, n - 3), min(n, 3) + 1)) for n in range(7)]


def _divided_by_quadric(d: list[Any], c: Any) -> tuple[list[Any], list[Any]]:
    """Return quotient and remainder of a polynomial of degree 6 on division by x⁴ − c_3 x³ − c_2 x² − c_1 x − c_0."""
    d = [*d]
    for k in (6, 5, 4):
        for j in range(4):
            d[k - 4 + j] += d[k] * c[j]
    return d[4:], d[:4]
