"""The Jacobi identity of a Poisson tensor, proved in the ring that holds its entries."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from phigen.geometry.system import System
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.tower import Poly, Tower
from phigen.symbolic.verdict import Statement, decide_elements


def jacobi_identity(system: System) -> Statement:
    """Σ_a (∂_a π_ij π_ak + ∂_a π_jk π_ai + ∂_a π_ki π_aj) = 0 for all i < j < k, parameters symbolic.

    A refutation names the first failing triple that has a point where the sum is not zero.
    """
    names = system.coordinates
    entries = [e for row in system.poisson for e in row]
    others = [s for s in symbols_of(*entries) if s not in names]
    tower = Tower([*names, *others], entries, names)
    residuals = list(_residuals(system, tower))
    count = len(names) * (len(names) - 1) * (len(names) - 2) // 6
    detail = f"{count} component{'' if count == 1 else 's'}"
    return decide_elements("Jacobi identity", tower, residuals, system.positive, detail)


def _residuals(system: System, tower: Tower) -> Iterator[tuple[str, Poly]]:
    names = system.coordinates
    n = range(len(names))
    images = iter(tower.convert_all([e for row in system.poisson for e in row]))
    pi = [[next(images) for _ in n] for _ in n]
    # Sparse: the derivatives ∂_a π_ij that are not zero, as a → element.
    slopes = {
        (i, j): {a: d for a in n if (d := tower.derivative(pi[i][j], names[a])) != 0} for i in n for j in n if i != j
    }
    for i, j, k in combinations(n, 3):
        residual = tower.zero
        for first, second, third in ((i, j, k), (j, k, i), (k, i, j)):
            for a, slope in slopes[first, second].items():
                if pi[a][third] != 0:
                    residual = residual + slope * pi[a][third]
        if residual != 0:
            yield f"({names[i]}, {names[j]}, {names[k]})", residual
