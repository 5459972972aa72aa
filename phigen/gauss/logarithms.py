"""Brackets that are constant in the logarithms of some coordinates, such as those of Lotka–Volterra systems and Toda
chains.

Suppose {x_i, x_j} = c_ij x_i^e_i x_j^e_j with constant c_ij and exponents e_i = 0 or 1. Replace x_i by log |x_i|
wherever e_i = 1. Then all brackets are constant. A Gauss method whose unknowns are these logarithms and the remaining
coordinates is a Poisson map. A step multiplies each x_i with e_i = 1 by the exponential of an increment, so signs do
not change, and 0 stays 0.
"""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.shapes import Matrix, coordinate_terms
from phigen.symbolic.expression import Expression, symbol

#: The bracket {log x_i, x_j} = {x_i, x_j}/x_i by the pair (i, j).
Rates = dict[tuple[int, int], Expression]


def logarithmic(coordinates: Sequence[str], poisson: Matrix) -> Rates | None:
    """Return the brackets {log x_i, x_j} = {x_i, x_j}/x_i by (i, j).

    All brackets {x_i, x_j} must have the form c_ij x_i^e_i x_j^e_j, as in the head of the file. The result has the
    brackets for all i with e_i = 1. Returns None if a bracket has another form, or if all e_i are 0.
    """
    pairs = [(i, j) for i, row in enumerate(poisson) for j in range(i) if not row[j].is_zero]
    terms = coordinate_terms(coordinates, [poisson[i][j] for i, j in pairs])
    if terms is None:
        return None
    exponents: dict[int, int] = {}
    factors: dict[tuple[int, int], Expression] = {}
    for (i, j), monomials in zip(pairs, terms, strict=True):
        if not monomials:
            continue
        if len(monomials) > 1:
            return None
        ((powers, factor),) = monomials.items()
        if any(k not in (i, j) and power for k, power in enumerate(powers)):
            return None
        if any(powers[k] > 1 or exponents.setdefault(k, powers[k]) != powers[k] for k in (i, j)):
            return None
        factors[i, j], factors[j, i] = factor, -factor
    if not any(exponents.values()):
        return None
    return {
        (i, j): factor * symbol(coordinates[j]) if exponents[j] else factor
        for (i, j), factor in factors.items()
        if exponents[i]
    }
