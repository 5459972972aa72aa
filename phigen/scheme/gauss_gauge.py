"""Multiples λ of Casimirs for Gauss steps: they slow down the group elements, so that fixed-point sweeps converge
faster.

H and H − Σ λ_c C_c have the same flow in the coordinates x. But a Gauss step moves x by the action of a group element,
whose velocity is ∇H in the first case and ∇H − Σ λ_c ∇C_c in the second. For quadratic H and C_c, the second
derivatives of H − Σ λ_c C_c form a constant matrix. The λ_c are chosen such that the norm of this matrix is smallest.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from phigen.gauss.realisation import Realisation
from phigen.geometry.system import System
from phigen.scheme.gauge import Gauge
from phigen.symbolic.expression import ZERO, Expression, as_expression, gradient, number, symbols_of, total

#: The multiples λ are rounded to fractions with at most this denominator. The norm that they minimise is flat near its
#: minimum, so even a much coarser rounding would be sufficient.
LARGEST_DENOMINATOR = 1000


def slowest(system: System, realisation: Realisation) -> Gauge:
    """Return the multiples of quadratic Casimirs for which the group elements of a step move most slowly.

    The gauge is empty if the second derivatives of H are not constant.
    """
    indices = [i for group in realisation.groups for i in group.indices]
    names = [system.coordinates[i] for i in indices]
    if not names or not realisation.exact or system.driven:
        return Gauge()
    second = _hessian(system.hamiltonian, names)
    if any(s in system.coordinates for s in symbols_of(*second)):
        return Gauge()
    hessians = {c: _hessian(e, names) for c, e in system.casimirs.items()}
    numeric = {c: [e.value for e in h] for c, h in hessians.items() if all(e.is_number for e in h)}
    multiples = _projected(second, list(numeric.values()))
    return Gauge(fixed={c: m for c, m in zip(numeric, multiples, strict=True) if not m.is_zero})


def _hessian(e: Expression, names: Sequence[str]) -> list[Expression]:
    return [second for first in gradient(e, names) for second in gradient(first, names)]


def _projected(vector: Sequence[Expression], basis: Sequence[Sequence[Fraction]]) -> list[Expression]:
    """Return the coefficients, in a basis, of the orthogonal projection of a vector onto the span of the basis."""
    orthogonal: list[list[Fraction]] = []
    transform: list[list[Fraction]] = []  # row k: orthogonal vector k as a combination of the basis
    for k, b in enumerate(basis):
        residual, row = list(b), [Fraction(int(i == k)) for i in range(len(basis))]
        for o, t in zip(orthogonal, transform, strict=True):
            factor = _dot(o, b) / _dot(o, o)
            residual = [r - factor * v for r, v in zip(residual, o, strict=True)]
            row = [r - factor * v for r, v in zip(row, t, strict=True)]
        if any(residual):
            orthogonal.append(residual)
            transform.append(row)
    sums = [ZERO] * len(basis)
    for o, t in zip(orthogonal, transform, strict=True):
        component = total(number(a / _dot(o, o)) * v for a, v in zip(o, vector, strict=True) if a)
        sums = [s + number(f) * component for s, f in zip(sums, t, strict=True)]
    return [_rounded(s) for s in sums]


def _dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _rounded(e: Expression) -> Expression:
    return as_expression(Fraction(e.value).limit_denominator(LARGEST_DENOMINATOR)) if e.is_number else e
