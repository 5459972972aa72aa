"""Positions in a plane for the sites of a graph, for drawing: distances approximate the numbers of bonds between
sites.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phigen.symbolic.arrays import Floats

#: Largest number of sites for which positions are computed. Time and memory grow with the square of the number of
#: sites, and 600 sites take some seconds.
MOST_PLACED = 600
#: Number of iterations of stress majorisation. Each iteration decreases the deviation of distances in the plane from
#: numbers of bonds.
ROUNDS = 60


def placed(bonds: NDArray[np.int64], sites: int) -> Floats | None:
    """Return positions of the sites in the unit square, of shape (sites, 2), or None for more than `MOST_PLACED` sites.

    The distance of two sites is the number of bonds between them. Classical multidimensional scaling of these distances
    gives the starting positions. Iterations of stress majorisation improve the positions: J. de Leeuw, Applications of
    convex analysis to multidimensional scaling (1977). The same bonds always give the same positions.
    """
    if sites > MOST_PLACED:
        return None
    distances = _distances(bonds, sites)
    centred = distances**2 - (distances**2).mean(axis=0)
    values, vectors = np.linalg.eigh(-(centred - centred.mean(axis=1, keepdims=True)) / 2)
    positions = np.zeros((sites, 2))
    for k in range(min(2, sites)):
        axis = vectors[:, -1 - k] * np.sqrt(max(values[-1 - k], 0.0))
        positions[:, k] = axis * (np.sign(axis[np.argmax(np.abs(axis))]) or 1.0)
    positions += 1e-3 * np.random.default_rng(0).normal(size=positions.shape)  # no two sites may coincide
    for _ in range(ROUNDS):
        lengths = np.linalg.norm(positions[:, None] - positions[None], axis=2)
        weights = distances / np.where(lengths > 0, lengths, 1.0)
        positions = (weights.sum(axis=1)[:, None] * positions - weights @ positions) / sites
    positions -= positions.min(axis=0)
    positions /= positions.max() or 1.0
    return np.asarray(positions + (1.0 - positions.max(axis=0)) / 2)


def _distances(bonds: NDArray[np.int64], sites: int) -> Floats:
    """Return the least number of bonds on a path between any two sites, as a matrix (sites, sites).

    Sites that no path connects get a distance larger than all others.
    """
    connected = np.eye(sites, dtype=np.float32)
    for a, b in bonds:
        connected[a, b] = connected[b, a] = 1.0
    reached, distances = np.eye(sites, dtype=np.float32), np.full((sites, sites), np.inf)
    np.fill_diagonal(distances, 0.0)
    for steps in range(1, sites):
        further = np.minimum(reached @ connected, 1.0)
        if (further == reached).all():
            break
        distances[(further > 0) & (reached == 0)], reached = steps, further
    largest = distances[np.isfinite(distances)].max()
    return np.where(np.isfinite(distances), distances, 1.2 * largest + 1.0)
