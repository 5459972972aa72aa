"""Recognition of π_ij = g_i(x_i) A_ij g_j(x_j) with a constant matrix A.

Such a π is constant in the coordinates ∫ dx_i/g_i(x_i).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phigen.geometry.shapes import Matrix, skew
from phigen.symbolic.expression import ONE, Expression, product, symbols_of
from phigen.symbolic.tower import Poly, Tower


@dataclass(frozen=True)
class Separated:
    """The factors of π_ij = g_i(x_i) A_ij g_j(x_j): ``factors[i]`` is g_i, and ``matrix`` is A."""

    factors: tuple[Expression, ...]
    matrix: Matrix


def separated(coordinates: Sequence[str], poisson: Matrix) -> Separated | None:
    """Return the functions g_i and the matrix A with π_ij = g_i(x_i) A_ij g_j(x_j); None if π does not have this form.

    Constant factors belong to A. Each entry is factored into irreducible polynomials over Q in coordinates, parameters
    and function values.
    """
    upper = {(i, j): poisson[i][j] for j in range(len(coordinates)) for i in range(j)}
    parameters = [s for s in symbols_of(*upper.values()) if s not in coordinates]
    tower = Tower([*coordinates, *parameters], upper.values())
    entries = {ij: tower.simplified(e) for ij, e in zip(upper, tower.convert_all(list(upper.values())), strict=True)}
    factor_parts: dict[int, list[tuple[Poly, int]]] = {}
    constants = {}
    for (i, j), element in entries.items():
        if tower.is_zero(element):
            continue
        parts = _parts(tower, element, coordinates)
        if parts is None or set(parts) - {i, j, -1}:
            return None
        for k in (i, j):
            if factor_parts.setdefault(k, parts.get(k, [])) != parts.get(k, []):
                return None
        constants[i, j] = _product(tower, parts[-1])
    factors = tuple(_product(tower, factor_parts.get(i, [])) for i in range(len(coordinates)))
    return Separated(factors, skew(constants, len(coordinates)))


def _parts(tower: Tower, element: Poly, coordinates: Sequence[str]) -> dict[int, list[tuple[Poly, int]]] | None:
    """Return the irreducible factors of an entry of π as pairs (factor, multiplicity), by the index of their
    coordinate.

    Constant factors have the index −1. Returns None if a factor depends on several coordinates.
    """
    content, factors = element.factor()
    parts: dict[int, list[tuple[Poly, int]]] = {-1: [(tower.context.constant(content), 1)]}
    for factor, multiplicity in factors:
        indices = [i for i, c in enumerate(coordinates) if tower.depends_on(factor, [c])]
        if len(indices) > 1:
            return None
        parts.setdefault(indices[0] if indices else -1, []).append((factor, int(multiplicity)))
    return {k: sorted(p, key=lambda item: (str(item[0]), item[1])) for k, p in parts.items()}


def _product(tower: Tower, factors: Sequence[tuple[Poly, int]]) -> Expression:
    return product(tower.expression(f) ** m for f, m in factors) if factors else ONE
