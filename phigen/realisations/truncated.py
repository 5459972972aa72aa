"""Proofs of the axioms for maps α and β that are truncated series in p. Each degree in p is proved by itself.

If α and β are correct up to degree d in p, their brackets are correct up to degree d − 1, since {·, ·} contains one
derivative with respect to p. Let f^(k) be the part of degree k in p of a function f. The axiom for α is proved as

    Σ_{k+l=m+1} {α_i^(k), α_j^(l)} = (π_ij∘α)^(m)    for m = 0 … d − 1.

The other two axioms are proved in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation, covector_names
from phigen.symbolic.expression import ZERO, Expression, substitute, symbols_of
from phigen.symbolic.taylor import Taylor, closure
from phigen.symbolic.tower import Poly, Tower
from phigen.symbolic.verdict import UNDECIDED, Statement, decide_elements

#: Reason, for the user, why steps along paths are Poisson maps although the series are truncated.
EXACT_PATH = "steps follow the exact path, so they are Poisson maps by Karasev's theorem"


class _HomogeneousParts:
    """The homogeneous parts of some expressions in x and p, by degree in p, and the brackets of these parts.

    The parts are computed up to a ``degree``.
    """

    def __init__(self, system: System, expressions: Sequence[Expression], degree: int) -> None:
        self.coordinates, self.covector = system.coordinates, covector_names(system.coordinates)
        at_zero = substitute(closure(expressions), dict.fromkeys(self.covector, ZERO))
        variables = [*self.coordinates, *self.covector]
        parameters = [s for s in symbols_of(*expressions) if s not in variables]
        self.tower = Tower([*variables, *parameters], at_zero, variables)
        taylor = Taylor(expressions, self.tower, self.covector)
        for k in range(degree + 1):
            # In the Taylor series along p ↦ tp, the coefficient of t^k is the homogeneous part of degree k.
            taylor.advance({c: self.tower.variable(c) if k == 1 else self.tower.zero for c in self.covector})
        self.parts = [taylor.coefficients(e) for e in expressions]
        self._slopes: dict[tuple[int, int, str], Poly] = {}

    def _slope(self, e: int, k: int, name: str) -> Poly:
        key = (e, k, name)
        if key not in self._slopes:
            self._slopes[key] = self.tower.derivative(self.parts[e][k], name)
        return self._slopes[key]

    def bracket(self, e: int, f: int, degree: int) -> Poly:
        """Return the part of degree ``degree`` in p of the bracket {E, F}.

        The expressions E and F have the numbers ``e`` and ``f`` in the list of expressions.
        """
        result = self.tower.zero
        for k in range(degree + 2):
            for c, p in zip(self.coordinates, self.covector, strict=True):
                result += self._product(e, k, c, f, degree + 1 - k, p) - self._product(e, k, p, f, degree + 1 - k, c)
        return result

    def _product(self, e: int, k: int, a: str, f: int, m: int, b: str) -> Poly:
        left = self._slope(e, k, a)
        return left * self._slope(f, m, b) if left != 0 else left


def brackets(system: System, realisation: BiRealisation, degree: int) -> Iterator[Statement]:
    """Yield the statements on {α_i, α_j}, {β_i, β_j} and {α_i, β_j}, each up to ``degree`` − 1 in p."""
    n = system.dimension
    maps = [*realisation.alpha, *realisation.beta]
    pairs = [(i, j) for j in range(n) for i in range(j)]
    pulled = [
        e
        for m in (realisation.alpha, realisation.beta)
        for e in substitute([system.poisson[i][j] for i, j in pairs], dict(zip(system.coordinates, m, strict=True)))
    ]
    titles = "{α_i, α_j} = π_ij∘α", "{β_i, β_j} = −π_ij∘β", "{α_i, β_j} = 0"
    suffix = f": all terms up to degree {degree - 1} in p"
    try:
        parts = _HomogeneousParts(system, [*maps, *pulled], degree)
    except OverflowError:
        note = EXACT_PATH if realisation.path else "not checked"
        for title in titles:
            yield Statement(f"bi-realisation: {title}{suffix}", UNDECIDED, f"too many terms to expand; {note}")
        return

    def label(i: int, j: int, m: int) -> str:
        return f"({system.coordinates[i]}, {system.coordinates[j]}) in degree {m}"

    note = EXACT_PATH if realisation.path else "α and β have no terms of higher degree, so the axiom is approximate"

    def decided(name: str, residuals: Iterator[tuple[str, Poly]]) -> Statement:
        title = f"bi-realisation: {name}{suffix}"
        return decide_elements(title, parts.tower, residuals, system.positive, f"each degree by itself; {note}")

    def own(first: int, sign: int) -> Iterator[tuple[str, Poly]]:
        for m in range(degree):
            for k, (i, j) in enumerate(pairs, 2 * n + (len(pairs) if first else 0)):
                yield label(i, j, m), parts.bracket(first + i, first + j, m) - parts.parts[k][m] * sign

    yield decided(titles[0], own(0, 1))
    yield decided(titles[1], own(n, -1))
    mixed_brackets = (
        (label(i, j, m), parts.bracket(i, n + j, m)) for m in range(degree) for i in range(n) for j in range(n)
    )
    yield decided(titles[2], mixed_brackets)
