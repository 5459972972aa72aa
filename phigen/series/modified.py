"""Backward error analysis: the modified Hamiltonian, whose exact flow is the step.

A step of size h is the flow, over the time h, of a formal series H̃_h = H_0 + h H_1 + h² H_2 + … with H_0 = H. The
generating function of H̃_h is the solution of the Hamilton–Jacobi equation without truncation. At the time h it must be
S_h = h S_1 + … + h^k S_k, the generating function of the method; the H_j follow from this condition. At the time σh
with 0 ≤ σ ≤ 1, the solution for H̃_h is S(σ) = Σ h^r s_r(σ). The s_r satisfy

    ∂_σ s_r = coefficient of h^(r−1) in H̃_h(α(x, ∇S(σ))) = H_{r−1} + known terms,    s_r(0) = 0.

The condition is s_r(1) = S_r for r ≤ k and s_r(1) = 0 for r > k. This gives a linear equation for each H_{r−1}. The
first correction is −h^k S_{k+1}. In a symmetric bi-realisation H̃_h is even in h. If H depends on a time τ, so does
H̃_h: on the right H̃_h is evaluated at τ − σh/2, and ½ ∂_τ s_(r−1) is added, as in `phigen.series.hamilton_jacobi`. For
canonical structures, see E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, chapter IX.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from phigen.series.hamilton_jacobi import PolynomialSeries, composed, polynomial_series
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import Symbol, momentum
from phigen.symbolic.taylor import Taylor
from phigen.symbolic.tower import Poly, Tower

#: Symbol of σ, the time as a fraction of the step.
FRACTION = Symbol("sigma")

#: Largest number of monomials of a correction H_j; if a correction has more, the computation ends with an error.
MOST_TERMS = 5_000


@dataclass(frozen=True)
class ModifiedSeries:
    """H_0, H_1, … of the modified Hamiltonian H̃_h = Σ h^j H_j, as elements of a tower (ring); ``terms[j]`` is H_j."""

    tower: Tower
    terms: tuple[Poly, ...]


def modified_series(
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    parameters: Sequence[str],
    terms: int,
    power: int,
    *,
    symmetric: bool,
    times: Sequence[str] = (),
) -> ModifiedSeries:
    """Return the coefficients H_0 … H_power of the modified Hamiltonian of the method whose step uses S_1 … S_terms.

    ``alpha`` must be correct up to degree ``power`` in p; ``times`` has the symbol of the time, if H depends on it.
    Raises `OverflowError` if a correction has more than `MOST_TERMS` monomials.
    """
    symbols = [*parameters, FRACTION, *times]
    generating = polynomial_series(
        hamiltonian, alpha, coordinates, symbols, min(terms, power + 1), symmetric=symmetric, times=times
    )
    recursion = _ModifiedRecursion(generating, alpha, coordinates, times)
    for r in range(1, power + 2):
        recursion.advance(r, vanishing=symmetric and r % 2 == 0)
    return ModifiedSeries(generating.tower, tuple(recursion.terms))


class _ModifiedRecursion:
    """The recursion for H_0, H_1, …, with its results so far: ``terms`` are H_0 … H_{r−1}.

    ``slopes`` are the derivatives of s_0 = 0, s_1, …, s_r with respect to the coordinates. The docstring of the module
    defines the s_r.
    """

    def __init__(
        self,
        generating: PolynomialSeries,
        alpha: Sequence[Expression],
        coordinates: Sequence[str],
        times: Sequence[str],
    ) -> None:
        self.tower, self.kept = generating.tower, generating.terms
        self.alpha, self.coordinates, self.times = alpha, coordinates, times
        self.last = self.tower.zero  # the last s_r, at first s_0 = 0
        self.momenta = [momentum(c) for c in coordinates]
        self.terms: list[Poly] = []
        self.slopes: list[list[Poly]] = [[self.tower.zero] * len(coordinates)]
        self.composed: list[tuple[Expression, Taylor] | None] = []
        self.fraction = self.tower.names.index(FRACTION)

    def advance(self, r: int, *, vanishing: bool) -> None:
        """Compute H_{r−1} and s_r, which the docstring of the module defines.

        ``vanishing`` says that H_{r−1} is 0 by symmetry.
        """
        if vanishing:
            self._keep(self.tower.zero, self.tower.zero)
            return
        levels = [self._level(j, r - 1 - j) for j in range(r - 1)]
        half = self.tower.constant(Fraction(1, 2))
        integral = self._integral(
            self.tower.combine([*levels, *(half * self.tower.derivative(self.last, t) for t in self.times)])
        )
        target = self.kept[r - 1] if r <= len(self.kept) else self.tower.zero
        correction = target - self._at_one(integral)
        if len(correction) > MOST_TERMS:
            raise OverflowError(f"{len(correction)} terms of H_{r - 1}")
        self._keep(correction, integral + self.tower.variable(FRACTION) * correction)

    def _keep(self, correction: Poly, s: Poly) -> None:
        self.last = s
        self.terms.append(correction)
        self.slopes.append([self.tower.derivative(s, c) for c in self.coordinates])
        if correction == 0:
            self.composed.append(None)
            return
        target = composed(self.tower.expression(correction), self.coordinates, self.alpha)
        self.composed.append((target, Taylor([target], self.tower, [*self.momenta, *self.times])))

    def _level(self, j: int, level: int) -> Poly:
        """Return the coefficient of h^level in H_j(α(x, ∇S(σ))). The docstring of the module defines σ and S(σ)."""
        pair = self.composed[j]
        if pair is None:
            return self.tower.zero
        target, taylor = pair
        while len(taylor.coefficients(target)) <= level:
            k = len(taylor.coefficients(target))
            taylor.advance(dict(zip(self.momenta, self.slopes[k], strict=True)) | self._beginning(k))
        return taylor.coefficients(target)[level]

    def _beginning(self, k: int) -> dict[str, Poly]:
        """Return {τ: coefficient of h^k in τ − σh/2}, or {} if H does not depend on the time.

        A step of size σh has its middle at the time τ, and begins at τ − σh/2.
        """
        shift = self.tower.variable(FRACTION) * self.tower.constant(Fraction(-1, 2))
        return {t: self.tower.variable(t) if k == 0 else shift if k == 1 else self.tower.zero for t in self.times}

    def _integral(self, element: Poly) -> Poly:
        """Return the integral, from 0 to σ, of an element that is a polynomial in σ."""
        integrated: dict[Any, Any] = {}
        for m, c in element.to_dict().items():
            e = int(m[self.fraction]) + 1
            integrated[(*m[: self.fraction], e, *m[self.fraction + 1 :])] = c / e
        return self.tower.context.from_dict(integrated)

    def _at_one(self, element: Poly) -> Poly:
        """Return the value, at σ = 1, of an element that is a polynomial in σ."""
        collected: dict[Any, Any] = {}
        for m, c in element.to_dict().items():
            key = (*m[: self.fraction], 0, *m[self.fraction + 1 :])
            collected[key] = collected[key] + c if key in collected else c
        return self.tower.context.from_dict(collected)
