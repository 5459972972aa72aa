"""Symplectic correctors for near-integrable systems, H = A + εB: steps of one flow of each part, conjugated by a map C.

With φ = e^{hA/2} e^{hεB} e^{hA/2}, n steps are C φⁿ C⁻¹. To first order in ε, φ is the flow of A + ε f(z) B, where z =
h ad_A and f(z) = (z/2)/sinh(z/2). C = e^{εhG} with an odd series G = g(z) B changes this to A + ε(f(z) − z g(z)) B. If
z g(z) = f(z) − 1 up to z^{2k}, the error of order ε begins at εh^{2k+2}; the error ε²h² remains. C is a product of
flows of A, B, A, B, A over the times c_i, −b_i, −2c_i, b_i, c_i, so that g(z) = Σ 2 b_i sinh(c_i z): for chosen c_i,
the b_1, …, b_k solve a linear system. A product of exact flows is a Poisson map.

The order in which C applies the flows of B adds an error ε²h³. A *balanced* C has each pair with half of b_i, followed
by the pairs in the reverse order with −c_i and −b_i: the flows of B, at their times along A, are the same in reverse,
so the logarithm of C is odd in ε. It is for steps without an error ε²h², with B − h²{B, {B, A}}/24 in place of B.

J. Wisdom, M. Holman, J. Touma, Symplectic correctors, Fields Institute Communications 10 (1996); J. Wisdom, Symplectic
correctors for canonical heliocentric n-body maps, Astronomical Journal 131 (2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import factorial

from phigen.scheme.alternation import Schedule

#: Numbers of the parts of a step: B first, then A.
B, A = 0, 1

#: √(7/40): the spacing of the c_i in other programs; with it results can be compared.
SPACING = Fraction("0.418330013267037773994000")


def corrector(order: int, *, balanced: bool = False) -> tuple[Fraction, ...]:
    """Return the durations of the flows A, B, A, …, A at the end of a run: minus half a flow of A, then C.

    The flows at the start of the run have the opposite sign and the reverse order. Order 1 has no C. A ``balanced`` C
    has twice the flows, and no error ε²h³.
    """
    times, pairs = [-Fraction(1, 2)], _pairs((order - 1) // 2)
    if balanced:
        pairs = (*((c, b / 2) for c, b in pairs), *((-c, -b / 2) for c, b in reversed(pairs)))
    for c, b in pairs:
        times = [*times[:-1], times[-1] + c, -b, -2 * c, b, c]
    return tuple(times)


def schedule(end: Sequence[Fraction]) -> Schedule:
    """Return the schedule of a step, one flow of B and one of A, with the corrector before and after a run of steps."""
    times = (Fraction(1), Fraction(1), *(-t for t in reversed(end)), *end)
    parts = [B if k % 2 else A for k in range(len(end))]
    first, last = (tuple(zip(parts, range(row, row + len(end)), strict=True)) for row in (2, 2 + len(end)))
    return Schedule(tuple(map(float, times)), 1, ((A, 0),), begin=first, end=last)


def _pairs(count: int) -> tuple[tuple[Fraction, Fraction], ...]:
    """Return the pairs (c_i, b_i) for which g is correct up to z^{2·count − 1}."""
    c = [i * SPACING for i in range(count, 0, -1)]
    f = _kernel_series(count + 1)
    rows = [[2 * x ** (2 * k + 1) / factorial(2 * k + 1) for x in c] for k in range(count)]
    return tuple(zip(c, _linear_solution(rows, f[1:]), strict=True))


def _kernel_series(count: int) -> list[Fraction]:
    """Return the coefficients of z^0, z^2, … of (z/2)/sinh(z/2)."""
    sinh = [Fraction(1, 4**k * factorial(2 * k + 1)) for k in range(count)]
    f = [Fraction(1)]
    for k in range(1, count):
        f.append(-sum((sinh[j] * f[k - j] for j in range(1, k + 1)), Fraction(0)))
    return f


def _linear_solution(rows: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Return the solution of linear equations, by elimination without pivoting."""
    work = [[*row, value] for row, value in zip(rows, right, strict=True)]
    for k, pivot in enumerate(work):
        work[k] = [v / pivot[k] for v in pivot]
        for i, row in enumerate(work):
            if i != k:
                work[i] = [v - row[k] * p for v, p in zip(row, work[k], strict=True)]
    return [row[-1] for row in work]
