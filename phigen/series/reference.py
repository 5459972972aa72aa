"""The Hamilton–Jacobi series derived a second time, by sympy alone: a page to be read together with
docs/mathematics.md.

S_t(x) = t S_1 + t² S_2 + … solves ∂_t S_t(x) = H(α(x, ∇S_t(x))), S_0 = 0. Taylor's formula, applied twice, yields

    p(t) = ∇S_t(x)          = Σ_j t^j ∇S_j(x),
    Δ(t) = α(x, p(t)) − x   = Σ_μ a_μ(x) p(t)^μ,    a_μ = ∂_p^μ α(x, 0)/μ!,
    ∂_t S_t = H(x + Δ(t))   = Σ_ν H_ν(x) Δ(t)^ν,    H_ν = ∂_x^ν H(x)/ν!,

with multi-indices μ ≠ 0 and ν. The coefficients of t^i are (i + 1) S_{i+1} on the left, and on the right a polynomial
in a_μ, H_ν and ∇S_1 … ∇S_i with |μ|, |ν| ≤ i, since p(t) and Δ(t) begin with t.

If H depends on a time τ, ∂_t S_t(τ, x) = H(τ − t/2, x + Δ(t)) + ½ ∂_τ S_t: the time is one more variable of Taylor's
formula, with Δ_τ(t) = −t/2.

This derivation shares no code with the compiler: neither the ring, nor derivatives, nor the arithmetic of series.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import sympy

from phigen.series.reference_functions import Functions, derivative, expanded

#: A multi-index, one exponent for each variable.
Index = tuple[int, ...]

#: The coefficients of Taylor's formula.
Coefficients = Mapping[Index, Any]

#: Function that returns the a_μ of α_1 … α_n with 0 < |μ| ≤ a degree.
Source = Callable[[int], Sequence[Coefficients]]


def generating_function(hamiltonian: Any, source: Source, x: Sequence[Any], times: Sequence[Any] = ()) -> Iterator[Any]:
    """Yield S_1, S_2, … without end, as sympy expressions in x and the parameters.

    ``hamiltonian`` is H. ``source`` returns the a_μ, as those of `closed_form` and `phigen.series.reference_paths`.
    ``times`` contains the time, if H depends on it.
    """
    terms: list[Any] = []
    while True:
        i = len(terms)
        terms.append(_coefficient(i, taylor(hamiltonian, [*x, *times], i), source(i), terms, x, times) / (i + 1))
        yield terms[-1]


def closed_form(alpha: Sequence[Any], p: Sequence[Any]) -> Source:
    """Return the a_μ of expressions in x and p that are regular at p = 0 as they are written."""

    @cache
    def source(degree: int) -> list[dict[Index, Any]]:
        return [{m: a for m, a in _at_origin(e, p, degree).items() if 0 < sum(m) <= degree} for e in alpha]

    return source


def _at_origin(f: Any, p: Sequence[Any], degree: int) -> dict[Index, Any]:
    """Return ∂_p^μ f/μ! at p = 0; for a polynomial in p, these are its coefficients."""
    functions = Functions([f, *p])
    if not any(g.has(*p) for g in functions if g not in p):
        return {m: functions.expression(c) for m, c in functions.split(functions.element(f), p).items()}
    return {m: expanded(c.subs(dict.fromkeys(p, sympy.Integer(0)))) for m, c in taylor(f, p, degree).items()}


def taylor(f: Any, variables: Sequence[Any], degree: int) -> dict[Index, Any]:
    """Return ∂^μ f/μ! for |μ| ≤ degree, by μ; zeros are left out."""
    n = len(variables)
    level: dict[Index, Any] = {(0,) * n: f}
    result = dict(level)
    for _ in range(degree):
        raised = {}
        for index, g in level.items():
            last = max((k for k in range(n) if index[k]), default=0)
            for k in range(last, n):  # each multi-index is reached once, along its variables in order
                slope = derivative(g, variables[k]) / (index[k] + 1)
                if slope != 0:
                    raised[_raised(index, k, 1)] = slope
        level = raised
        result |= level
    return result


def _coefficient(
    i: int,
    energy: Coefficients,
    source: Sequence[Coefficients],
    terms: Sequence[Any],
    x: Sequence[Any],
    times: Sequence[Any],
) -> Any:
    """Return the coefficient of t^i in Σ_ν H_ν Δ(t)^ν + ½ ∂_τ S_t.

    Here Δ(t) = Σ_μ a_μ p(t)^μ, p(t) = Σ_j t^j ∇S_j, and Δ_τ(t) = −t/2.
    """
    slopes = [[derivative(s, c) for s in terms] for c in x]
    operands = [*energy.values(), *(a for d in source for a in d.values()), *(g for row in slopes for g in row)]
    rates = [derivative(s, t) / 2 for t in times for s in terms[-1:]]
    functions = Functions([*operands, *rates])
    momentum = Series(functions, lambda k, j: functions.element(slopes[k][j - 1]))
    unit_shift = {1: functions.element(sympy.Rational(-1, 2))}
    displacement = Series(
        functions,
        lambda k, j: momentum.combined(source[k], j) if k < len(x) else unit_shift.get(j, functions.ring.zero),
    )
    coefficient = functions.total([displacement.combined(energy, i), *map(functions.element, rates)])
    zero = functions.seems_zero(coefficient) and functions.vanishes(
        coefficient
    )  # terms of even index vanish in a symmetric bi-realisation
    return sympy.Integer(0) if zero else functions.expression(coefficient)


class Series:
    """Power series u_1, …, u_n that begin with t; ``coefficient(k, j)`` is the coefficient of t^j in u_k."""

    def __init__(self, functions: Functions, coefficient: Callable[[int, int], Any]) -> None:
        self._functions = functions
        self._coefficient = cache(coefficient)
        self._power = cache(self._product)

    def combined(self, coefficients: Coefficients, j: int) -> Any:
        """Return the coefficient of t^j in Σ_μ c_μ u(t)^μ."""
        element = self._functions.element
        return self._functions.total(element(c) * self._power(mu, j) for mu, c in coefficients.items() if sum(mu) <= j)

    def _product(self, mu: Index, j: int) -> Any:
        """Return the coefficient of t^j in u(t)^μ: a sum over the power of t that one factor contributes."""
        if not any(mu):
            return self._functions.ring(int(j == 0))
        k = next(k for k, e in enumerate(mu) if e)
        remainder = _raised(mu, k, -1)
        shares = range(1, j - sum(remainder) + 1)
        return self._functions.total(self._coefficient(k, a) * self._power(remainder, j - a) for a in shares)


def _raised(index: Index, k: int, shift: int) -> Index:
    return (*index[:k], index[k] + shift, *index[k + 1 :])
