"""What is conserved along a run of a lattice: energy, Casimirs, invariants, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from phigen.lattice.cell import PERIODIC, Cell
from phigen.runtime.lattice import LatticeTrajectory
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import Expression


def errors_of(cell: Cell, run: LatticeTrajectory) -> dict[str, Floats]:
    """How far energy, Casimirs and invariants are from their initial values, by name, each (frames,).

    Energy and invariants relative to their size at the start, or to the sum of the magnitudes of their terms where they
    are small; Casimirs of sites by the site where they changed most.
    """
    found = {"energy": _relative(run.energy, run.energy_scale)}
    for name, values in run.casimirs.items():
        changed = np.abs(values - values[0])
        found[name] = changed.reshape(len(run), -1).max(axis=1)
    for name, density in cell.invariants.items():
        sums = np.array([summed(cell, density, x, run.parameters) for x in run.x])
        found[name] = _relative(sums[:, 0], float(sums[0, 1]))
    return found


def _relative(values: Floats, scale: float) -> Floats:
    return np.asarray(np.abs(values - values[0]) / (scale or 1.0))


def summed(cell: Cell, density: Expression, x: Floats, parameters: Mapping[str, Any]) -> tuple[float, float]:
    """The sum of a density over the sites, and that of the magnitudes of its terms."""
    sums = [_term(cell, term, x, parameters) for term in cell.additive_terms(density)]
    return float(sum(values.sum() for values in sums)), float(sum(np.abs(values).sum() for values in sums))


def _term(cell: Cell, term: Expression, x: Floats, parameters: Mapping[str, Any]) -> Floats:
    """A term at all sites, 0 where it reaches beyond an open end."""
    sizes, axes = x.shape[1:], tuple(range(x.ndim - 1))
    values: dict[str, Any] = {n: v for n, v in parameters.items() if np.ndim(v) == 0}
    for name, (base, offset) in cell.places(term).items():
        own = x[cell.fields.index(base)] if base in cell.fields else np.broadcast_to(parameters[base], sizes)
        values[name] = np.roll(own, [-int(o) for o in offset], axes) if offset else own
    there = np.ones(sizes, dtype=bool)
    low, high = cell.extent(term)
    for axis, boundary in enumerate(cell.boundary):
        if boundary != PERIODIC:
            place = np.arange(sizes[axis]).reshape([-1 if a == axis else 1 for a in axes])
            there = there & (place + low[axis] >= 0) & (place + high[axis] < sizes[axis])
    return np.where(there, np.broadcast_to(evaluate([term], values)[0], sizes), 0.0)
