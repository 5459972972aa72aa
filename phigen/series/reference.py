"""Second derivation of the Hamilton–Jacobi series, by sympy alone, to check the compiler.

S_t(x) = t S_1 + t² S_2 + … solves ∂_t S_t(x) = H(α(x, ∇S_t(x))), S_0 = 0. Taylor's formula, applied twice, yields

    p(t) = ∇S_t(x)          = Σ_j t^j ∇S_j(x),
    Δ(t) = α(x, p(t)) − x   = Σ_μ a_μ(x) p(t)^μ,    a_μ = ∂_p^μ α(x, 0)/μ!,
    ∂_t S_t = H(x + Δ(t))   = Σ_ν H_ν(x) Δ(t)^ν,    H_ν = ∂_x^ν H(x)/ν!,

with multi-indices μ ≠ 0 and ν. The coefficient of t^i in the last equation is (i + 1) S_{i+1} on the left. On the right
it is a polynomial in a_μ, H_ν and ∇S_1 … ∇S_i with |μ|, |ν| ≤ i, since the series p(t) and Δ(t) begin with t.

If H depends on a time τ, the equation is ∂_t S_t(τ, x) = H(τ − t/2, x + Δ(t)) + ½ ∂_τ S_t. The time is then one more
variable of Taylor's formula, with Δ_τ(t) = −t/2.

This derivation shares no code with the compiler: it has its own ring, derivatives and arithmetic of series. The
notation is that of docs/mathematics.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import sympy

from phigen.series.reference_functions import Functions, derivative, expanded

#: A multi-index, a tuple with one exponent for each variable.
Index = tuple[int, ...]

#: Coefficients of a polynomial or a Taylor expansion in several variables, by multi-index.
Coefficients = Mapping[Index, Any]

#: Function of a degree d that returns, for each component of α, the coefficients a_μ with 0 < |μ| ≤ d.
Source = Callable[[int], Sequence[Coefficients]]


def generating_function(hamiltonian: Any, source: Source, x: Sequence[Any], times: Sequence[Any] = ()) -> Iterator[Any]:
    """Yield S_1, S_2, … without end, as sympy expressions in x and the parameters.

    ``source`` returns the coefficients a_μ of the Taylor series of α in p. ``source`` is the result of `closed_form` or
    of `phigen.series.reference_paths.source_of_paths`. ``times`` has the symbol of the time, if H depends on it.
    """
    terms: list[Any] = []
    while True:
        i = len(terms)
        terms.append(_coefficient(i, taylor(hamiltonian, [*x, *times], i), source(i), terms, x, times) / (i + 1))
        yield terms[-1]


def closed_form(alpha: Sequence[Any], p: Sequence[Any]) -> Source:
    """Return a `Source` for the map ``alpha``, which is given in closed form.

    The components of ``alpha`` are expressions in x and p. They must be defined at p = 0 as they are written: they may
    contain no quotient such as sin(p)/p.
    """

    @cache
    def source(degree: int) -> list[dict[Index, Any]]:
        return [{m: a for m, a in _at_origin(e, p, degree).items() if 0 < sum(m) <= degree} for e in alpha]

    return source


def _at_origin(f: Any, p: Sequence[Any], degree: int) -> dict[Index, Any]:
    """Return the Taylor coefficients ∂_p^μ f/μ! at p = 0 for |μ| ≤ degree.

    If f is a polynomial in p, all of its coefficients are returned.
    """
    functions = Functions([f, *p])
    if not any(g.has(*p) for g in functions if g not in p):
        return {m: functions.expression(c) for m, c in functions.split(functions.element(f), p).items()}
    return {m: expanded(c.subs(dict.fromkeys(p, sympy.Integer(0)))) for m, c in taylor(f, p, degree).items()}


def taylor(f: Any, variables: Sequence[Any], degree: int) -> dict[Index, Any]:
    """Return the Taylor coefficients ∂^μ f/μ! for |μ| ≤ degree, as expressions, by μ; zeros are left out."""
    n = len(variables)
    level: dict[Index, Any] = {(0,) * n: f}
    result = dict(level)
    for _ in range(degree):
        raised = {}
        for index, g in level.items():
            last = max((k for k in range(n) if index[k]), default=0)
            for k in range(last, n):  # no variable before the last one of the index, so that each index occurs once
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
    """Return the coefficient of t^i in Σ_ν H_ν Δ(t)^ν + ½ ∂_τ S_t, in the notation of the head of the file.

    ``energy`` has the H_ν, ``source`` has the a_μ of each component of α, and ``terms`` has S_1 … S_i.
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
    # If the bi-realisation is symmetric, this coefficient is 0 for even i, but its terms may cancel only by relations
    # between functions, such as sin² + cos² = 1.
    zero = functions.seems_zero(coefficient) and functions.vanishes(coefficient)
    return sympy.Integer(0) if zero else functions.expression(coefficient)


class Series:
    """Power series u_0(t), …, u_{n−1}(t) without constant term, with coefficients in the ring ``functions``.

    ``coefficient(k, j)`` returns the coefficient of t^j in u_k(t).
    """

    def __init__(self, functions: Functions, coefficient: Callable[[int, int], Any]) -> None:
        self._functions = functions
        self._coefficient = cache(coefficient)
        self._power = cache(self._product)

    def combined(self, coefficients: Coefficients, j: int) -> Any:
        """Return the coefficient of t^j in Σ_μ c_μ u(t)^μ, where ``coefficients`` has the c_μ."""
        element = self._functions.element
        return self._functions.total(element(c) * self._power(mu, j) for mu, c in coefficients.items() if sum(mu) <= j)

    def _product(self, mu: Index, j: int) -> Any:
        """Return the coefficient of t^j in u(t)^μ.

        One factor u_k is split off: the sum is over the power of t that this factor contributes.
        """
        if not any(mu):
            return self._functions.ring(int(j == 0))
        k = next(k for k, e in enumerate(mu) if e)
        remainder = _raised(mu, k, -1)
        shares = range(1, j - sum(remainder) + 1)
        return self._functions.total(self._coefficient(k, a) * self._power(remainder, j - a) for a in shares)


def _raised(index: Index, k: int, shift: int) -> Index:
    return (*index[:k], index[k] + shift, *index[k + 1 :])
