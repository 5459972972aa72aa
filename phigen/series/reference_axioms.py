"""The axioms of a bi-realisation, up to a degree in p, proved a second time by sympy.

Let α = x + Σ_μ a_μ(x) p^μ and β = x + Σ_μ b_μ(x) p^μ, with the canonical brackets {x_i, p_j} = δ_ij. The parts of
degree m < d in p of

    {α_i, α_j} − π_ij∘α,    {β_i, β_j} + π_ij∘β,    {α_i, β_j}

must vanish. They are polynomials in the a_μ and b_μ with |μ| ≤ d, in their derivatives, and in the Taylor coefficients
∂^ν π/ν! of π.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import prod
from typing import Any

from phigen.series.reference import Coefficients, Index, Series, taylor
from phigen.series.reference_functions import Functions, derivative


def defects(
    poisson: Any,
    alpha: Sequence[Coefficients],
    beta: Sequence[Coefficients],
    x: Sequence[Any],
    p: Sequence[Any],
    d: int,
) -> Iterator[tuple[str, Any]]:
    """Yield the nonzero residuals of the axioms, as pairs of a name and an expression.

    ``poisson`` is the matrix π(x). ``alpha`` has the Taylor coefficients a_μ with 0 < |μ| ≤ d for each component of α.
    ``beta`` has the coefficients b_μ for each component of β.
    """
    n = len(x)
    tensor = {(i, j): taylor(poisson[i, j], x, d - 1) for i in range(n) for j in range(i)}
    parts = _Parts([*alpha, *beta], [c for entry in tensor.values() for c in entry.values()], x, p)
    functions, at_alpha, at_beta = parts.functions, parts.deviation(0), parts.deviation(n)
    for m in range(d):
        residuals = {}
        for (i, j), entry in tensor.items():
            residuals[f"{{α_{x[i]}, α_{x[j]}}}"] = parts.bracket(i, j, m) - at_alpha.combined(entry, m)
            residuals[f"{{β_{x[i]}, β_{x[j]}}}"] = parts.bracket(n + i, n + j, m) + at_beta.combined(entry, m)
        residuals |= {f"{{α_{x[i]}, β_{x[j]}}}": parts.bracket(i, n + j, m) for i in range(n) for j in range(n)}
        for name, residual in residuals.items():
            if not functions.vanishes(residual):
                yield f"{name} in degree {m}", functions.expression(residual)


class _Parts:
    """The components of α and β, split into parts by degree in p, and their derivatives, as elements of one ring."""

    def __init__(
        self, maps: Sequence[Coefficients], parameters: Sequence[Any], x: Sequence[Any], p: Sequence[Any]
    ) -> None:
        n = len(x)
        self._maps = [{(0,) * n: x[k % n], **{mu: a for mu, a in f.items() if any(mu)}} for k, f in enumerate(maps)]
        self._slopes = [[{mu: derivative(a, c) for mu, a in f.items()} for c in x] for f in self._maps]
        self._p = p
        operands = [*self._maps, *(s for slopes in self._slopes for s in slopes)]
        self.functions = Functions([*p, *parameters, *(e for f in operands for e in f.values())])
        self._known: dict[tuple[int, int, int | None], Any] = {}

    def deviation(self, first: int) -> Series:
        """Return α − x for ``first`` = 0, or β − x for ``first`` = n, as power series in t along p ↦ tp.

        The coefficient of t^k is the part of degree k in p.
        """
        return Series(self.functions, lambda k, m: self._part(first + k, m))

    def bracket(self, f: int, g: int, degree: int) -> Any:
        """Return those terms of {f, g} that have the degree ``degree`` in p.

        The bracket is {f, g} = Σ_c ∂f/∂x_c ∂g/∂p_c − ∂f/∂p_c ∂g/∂x_c. The arguments ``f`` and ``g`` are indices
        of components. The components of α have the first indices, and those of β the next.
        """
        splits = [(k, degree + 1 - k) for k in range(degree + 2)]
        terms = (
            self._part(f, k, c) * self._covector_slope(g, m, c) - self._covector_slope(f, k, c) * self._part(g, m, c)
            for k, m in splits
            for c in range(len(self._p))
        )
        return self.functions.total(terms)

    def _part(self, f: int, degree: int, c: int | None = None) -> Any:
        """Return those terms of the component ``f`` of (α, β) that have the degree ``degree`` in p.

        With ``c``, the component is first differentiated with respect to x_c.
        """
        key = (f, degree, c)
        if key not in self._known:
            series_of_component = self._maps[f] if c is None else self._slopes[f][c]
            element = self.functions.element
            terms = (element(a) * self._monomial(mu) for mu, a in series_of_component.items() if sum(mu) == degree)
            self._known[key] = self.functions.total(terms)
        return self._known[key]

    def _monomial(self, mu: Index) -> Any:
        powers = (self.functions.element(pk) ** e for pk, e in zip(self._p, mu, strict=True) if e)
        return prod(powers, start=self.functions.ring(1))

    def _covector_slope(self, f: int, degree: int, c: int) -> Any:
        """Return the derivative of `_part(f, degree)` with respect to p_c."""
        return self._part(f, degree).diff(self.functions.element(self._p[c]))
