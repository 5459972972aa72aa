"""Symplectic correctors for near-integrable systems H = A + εB. A corrector is a map C for which C φⁿ C⁻¹, with n
simple steps φ, is more accurate than φⁿ.

A step is φ = e^{hA/2} e^{hεB} e^{hA/2}. To first order in ε, φ is the flow of A + ε f(z) B, where z = h ad_A and f(z) =
(z/2)/sinh(z/2). Let C = e^{εhG}, with an odd series G = g(z) B. Then, to first order in ε, C φ C⁻¹ is the flow of A +
ε(f(z) − z g(z)) B. If z g(z) = f(z) − 1 up to z^{2k}, the error of first order in ε begins at εh^{2k+2}; the error ε²h²
remains.

C is a product of k factors. Factor i is the product of five flows: of A, B, A, B, A over the times c_i, −b_i, −2c_i,
b_i, c_i. Then g(z) = Σ 2 b_i sinh(c_i z). For chosen c_i, the b_1, …, b_k solve a linear system. C is a Poisson map, as
a product of exact flows.

The sequence of the flows of B in this C causes an error ε²h³. A *balanced* C avoids this error. It has first the
factors for the pairs (c_i, b_i/2), then the factors for the pairs (−c_i, −b_i/2) in reverse order. Its logarithm is odd
in ε. The balanced C is used with steps that have B − h²{B, {B, A}}/24 in place of B, and hence no error ε²h².

J. Wisdom, M. Holman, J. Touma, Symplectic correctors, Fields Institute Communications 10 (1996); J. Wisdom, Symplectic
correctors for canonical heliocentric n-body maps, Astronomical Journal 131 (2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import factorial

from phigen.scheme.alternation import Schedule

#: Numbers of the parts of H = A + εB in the schedule of a step, which applies the flow of B first.
B, A = 0, 1

#: √(7/40): the times c_i of a corrector are multiples of this number. Other programs use the same number, so their
#: results can be compared with those of phigen.
SPACING = Fraction("0.418330013267037773994000")


def corrector(order: int, *, balanced: bool = False) -> tuple[Fraction, ...]:
    """Return the durations of the flows at the end of a run for H = A + εB, in units of a step.

    The flows of A and of B alternate. The first one is a flow of A over minus half a step, merged with the first flow
    of the corrector C, which is a flow of A too. The other flows of C follow. A run starts with the inverses of these
    flows, in reverse order. At order 1 there is no C. A ``balanced`` C has twice as many flows, and causes no error
    ε²h³.
    """
    times, pairs = [-Fraction(1, 2)], _pairs((order - 1) // 2)
    if balanced:
        pairs = (*((c, b / 2) for c, b in pairs), *((-c, -b / 2) for c, b in reversed(pairs)))
    for c, b in pairs:
        times = [*times[:-1], times[-1] + c, -b, -2 * c, b, c]
    return tuple(times)


def schedule(end: Sequence[Fraction]) -> Schedule:
    """Return the schedule of a method with a corrector for H = A + εB: a step is one flow of B and one flow of
    A.

    ``end`` has the durations of the corrector's flows at the end of a run. The inverses of these flows start the run.
    """
    times = (Fraction(1), Fraction(1), *(-t for t in reversed(end)), *end)
    parts = [B if k % 2 else A for k in range(len(end))]
    first, last = (tuple(zip(parts, range(row, row + len(end)), strict=True)) for row in (2, 2 + len(end)))
    return Schedule(tuple(map(float, times)), 1, ((A, 0),), begin=first, end=last)


def _pairs(count: int) -> tuple[tuple[Fraction, Fraction], ...]:
    """Return the pairs (c_i, b_i) for which z g(z) = f(z) − 1 holds up to z^{2·count}, with f and g as defined in this
    module.
    """
    c = [i * SPACING for i in range(count, 0, -1)]
    f = _kernel_series(count + 1)
    rows = [[2 * x ** (2 * k + 1) / factorial(2 * k + 1) for x in c] for k in range(count)]
    return tuple(zip(c, _linear_solution(rows, f[1:]), strict=True))


def _kernel_series(count: int) -> list[Fraction]:
    """Return the first ``count`` coefficients, those of z^0, z^2, …, of the power series of (z/2)/sinh(z/2)."""
    sinh = [Fraction(1, 4**k * factorial(2 * k + 1)) for k in range(count)]
    f = [Fraction(1)]
    for k in range(1, count):
        f.append(-sum((sinh[j] * f[k - j] for j in range(1, k + 1)), Fraction(0)))
    return f


def _linear_solution(rows: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Return the solution of linear equations with the right-hand side ``right``, by elimination without pivoting."""
    work = [[*row, value] for row, value in zip(rows, right, strict=True)]
    for k, pivot in enumerate(work):
        work[k] = [v / pivot[k] for v in pivot]
        for i, row in enumerate(work):
            if i != k:
                work[i] = [v - row[k] * p for v, p in zip(row, work[k], strict=True)]
    return [row[-1] for row in work]
