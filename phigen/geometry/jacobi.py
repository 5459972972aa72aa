"""Decision whether a Poisson tensor satisfies the Jacobi identity, in the ring that contains its entries."""

from __future__ import annotations

from collections.abc import Iterator

from phigen import progress
from phigen.geometry.system import System
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.tower import Poly, Tower
from phigen.symbolic.verdict import Statement, decide_elements


def jacobi_identity(system: System) -> Statement:
    """Decide whether Σ_a (∂_a π_ij π_ak + ∂_a π_jk π_ai + ∂_a π_ki π_aj) = 0 for all i < j < k.

    The parameters are symbols. If the identity is refuted, the statement names the first triple i, j, k, with a point
    where the sum is not 0.
    """
    names = system.coordinates
    entries = [e for row in system.poisson for e in row]
    parameters = [s for s in symbols_of(*entries) if s not in names]
    tower = Tower([*names, *parameters], entries, names)
    residuals = list(_residuals(system, tower))
    count = len(names) * (len(names) - 1) * (len(names) - 2) // 6
    detail = f"{count} component{'' if count == 1 else 's'}"
    return decide_elements("Jacobi identity", tower, residuals, system.positive, detail)


def _residuals(system: System, tower: Tower) -> Iterator[tuple[str, Poly]]:
    """Yield the nonzero cyclic sums of the Jacobi identity, with the names of their three coordinates.

    Products with a factor 0 are skipped, so few products are computed even for large structures.
    """
    names = system.coordinates
    n = range(len(names))
    images = iter(tower.convert_all([e for row in system.poisson for e in row]))
    rows: list[dict[int, Poly]] = [{j: image for j in n if (image := next(images)) != 0} for _ in n]
    index = {name: i for i, name in enumerate(names)}
    sums: dict[tuple[int, int, int], Poly] = {}
    with progress.stage("Jacobi identity", len(names)) as running:
        for i, row in enumerate(rows):
            running.done = i
            for j, entry in row.items():
                for a in sorted(index[s] for s in tower.names_in(entry) if s in index):
                    slope = tower.derivative(entry, names[a])
                    for k, second_factor in rows[a].items() if slope != 0 else ():
                        # Only the cyclic permutations of an increasing triple are used. The other permutations give the
                        # same sum with the opposite sign.
                        if k not in (i, j) and (i < j < k or j < k < i or k < i < j):
                            indices = (min(i, j, k), i + j + k - min(i, j, k) - max(i, j, k), max(i, j, k))
                            sums[indices] = sums.get(indices, tower.zero) + tower.product(slope, second_factor)
    for (i, j, k), residual in sorted(sums.items(), key=lambda item: item[0]):
        if residual != 0:
            yield f"({names[i]}, {names[j]}, {names[k]})", residual
