"""Places in a plane for the sites of a graph: as far from one another as there are bonds between them, nearly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phigen.symbolic.arrays import Floats

#: Most sites that are placed, and rounds in which they move.
MOST_PLACED, ROUNDS = 600, 60


def placed(bonds: NDArray[np.int64], sites: int) -> Floats | None:
    """Places (sites, 2) in a square from 0 to 1, or None of more than `MOST_PLACED` sites.

    They begin at the classical scaling of distances along ``bonds`` (bonds, 2), by the two largest eigenvalues, and
    move by the majorisation of the stress, of which J. de Leeuw, Applications of convex analysis to multidimensional
    scaling (1977). The same for the same bonds.
    """
    if sites > MOST_PLACED:
        return None
    apart = _distances(bonds, sites)
    centred = apart**2 - (apart**2).mean(axis=0)
    values, vectors = np.linalg.eigh(-(centred - centred.mean(axis=1, keepdims=True)) / 2)
    found = np.zeros((sites, 2))
    for k in range(min(2, sites)):
        axis = vectors[:, -1 - k] * np.sqrt(max(values[-1 - k], 0.0))
        found[:, k] = axis * (np.sign(axis[np.argmax(np.abs(axis))]) or 1.0)
    found += 1e-3 * np.random.default_rng(0).normal(size=found.shape)  # so that none lie on one another
    for _ in range(ROUNDS):
        now = np.linalg.norm(found[:, None] - found[None], axis=2)
        pull = apart / np.where(now > 0, now, 1.0)
        found = (pull.sum(axis=1)[:, None] * found - pull @ found) / sites
    found -= found.min(axis=0)
    found /= found.max() or 1.0
    return np.asarray(found + (1.0 - found.max(axis=0)) / 2)


def _distances(bonds: NDArray[np.int64], sites: int) -> Floats:
    """How many bonds are between sites (sites, sites); those without a way are farther than all others."""
    joined = np.eye(sites, dtype=np.float32)
    for a, b in bonds:
        joined[a, b] = joined[b, a] = 1.0
    reached, found = np.eye(sites, dtype=np.float32), np.full((sites, sites), np.inf)
    np.fill_diagonal(found, 0.0)
    for steps in range(1, sites):
        further = np.minimum(reached @ joined, 1.0)
        if (further == reached).all():
            break
        found[(further > 0) & (reached == 0)], reached = steps, further
    known = found[np.isfinite(found)].max()
    return np.where(np.isfinite(found), found, 1.2 * known + 1.0)
