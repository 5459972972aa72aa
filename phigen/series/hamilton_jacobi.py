"""The Hamilton–Jacobi series S_t = Σ t^i S_i, plain normalisation.

S_t solves ∂_t S_t(x) = H(α(x, ∇S_t(x))), S_0 = 0, hence S_1 = H and

    (i+1) S_{i+1}(x) = coefficient of t^i in H(α(x, ∇(S_1 t + … + S_i t^i))).

The S_i of the paper (section 4, step 1) carry a further factor i!. In a symmetric bi-realisation,
β(x, p) = α(x, −p), every S_i of even index vanishes; that is used, and `residual` proves it on demand.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from phigen.symbolic.expression import ZERO, Expression, gradient, substitute
from phigen.symbolic.taylor import ExpressionRing, Taylor, closure
from phigen.symbolic.tower import Poly, Tower

#: A term S_i with more monomials than this ends the recursion: the next would take minutes.
MOST_TERMS = 50_000


@dataclass(frozen=True)
class PolynomialSeries:
    """S_1 … S_k as elements of a tower over coordinates and parameters; ``terms[i]`` is S_{i+1}."""

    tower: Tower
    terms: tuple[Poly, ...]


def momentum(name: str) -> str:
    """The symbol of the covector component that belongs to a coordinate."""
    return f"p:{name}"


def composed(hamiltonian: Expression, coordinates: Sequence[str], alpha: Sequence[Expression]) -> Expression:
    """H(α(x, p)) as an expression in the coordinates and the momenta."""
    return substitute([hamiltonian], dict(zip(coordinates, alpha, strict=True)))[0]


def series_tower(target: Expression, coordinates: Sequence[str], parameters: Sequence[str]) -> Tower:
    """The smallest tower that holds the series of H∘α: what is left of its nodes at p = 0."""
    at_zero = substitute(closure([target]), {momentum(c): ZERO for c in coordinates})
    return Tower([*coordinates, *parameters], at_zero, coordinates)


def polynomial_series(
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    parameters: Sequence[str],
    terms: int,
    *,
    symmetric: bool,
) -> PolynomialSeries:
    """S_1 … S_terms in a tower (exact rational arithmetic, parameters symbolic).

    Raises `OverflowError` if a term has more than `MOST_TERMS` monomials.
    """
    target = composed(hamiltonian, coordinates, alpha)
    tower = series_tower(target, coordinates, parameters)

    def slope(s: Poly) -> list[Poly]:
        return [tower.derivative(s, c) for c in coordinates]

    return PolynomialSeries(tower, tuple(_recursion(target, tower, coordinates, terms, symmetric, slope)))


def graph_series(
    hamiltonian: Expression,
    alpha: Sequence[Expression],
    coordinates: Sequence[str],
    terms: int,
    *,
    symmetric: bool,
) -> tuple[Expression, ...]:
    """S_1 … S_terms as one shared expression graph, never expanded."""
    target = composed(hamiltonian, coordinates, alpha)

    def slope(s: Expression) -> list[Expression]:
        return gradient(s, coordinates)

    return tuple(_recursion(target, ExpressionRing(), coordinates, terms, symmetric, slope))


def _recursion(
    target: Expression, ring: Any, coordinates: Sequence[str], terms: int, symmetric: bool, slope: Any
) -> list[Any]:
    momenta = [momentum(c) for c in coordinates]
    taylor = Taylor([target], ring, momenta)
    zero = ring.constant(0)
    taylor.advance(dict.fromkeys(momenta, zero))
    found = [taylor.coefficients(target)[0]]
    while len(found) < terms:
        i = len(found)
        skip = symmetric and i % 2 == 0
        taylor.advance(dict(zip(momenta, [zero] * len(momenta) if skip else slope(found[-1]), strict=True)))
        even = symmetric and i % 2 == 1
        if isinstance(found[-1], Sized) and len(found[-1]) > MOST_TERMS:
            raise OverflowError(f"S_{i} has {len(found[-1])} terms")
        found.append(zero if even else taylor.coefficients(target)[i] * ring.constant(Fraction(1, i + 1)))
    return found


def residual(
    series: PolynomialSeries, hamiltonian: Expression, alpha: Sequence[Expression], coordinates: Sequence[str]
) -> list[Poly]:
    """Coefficients of t^0 … t^(k−1) in ∂_t S_t − H(α(x, ∇S_t)): all 0 if S_1 … S_k solve the equation."""
    target = composed(hamiltonian, coordinates, alpha)
    tower, momenta = series.tower, [momentum(c) for c in coordinates]
    taylor = Taylor([target], tower, momenta)
    slopes = [[tower.zero] * len(momenta)]
    slopes += [[tower.derivative(s, c) for c in coordinates] for s in series.terms]
    result = []
    for i, s in enumerate(series.terms):
        taylor.advance(dict(zip(momenta, slopes[i], strict=True)))
        result.append(s * tower.constant(i + 1) - taylor.coefficients(target)[i])
    return result
