"""The energy balance of a driven lattice: H − ∫ P dt is constant along the motion, whereas H is not.

The power P = dH/dt is a sum over sites, bonds and pairs. Each summand is the total time derivative of an energy
density. P is evaluated after every step, also between stored states, and integrated by polynomials through eight
neighbouring values. So the accuracy does not depend on how often states are stored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.lattice.cell import GRID, PAIRS, PERIODIC, Cell
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import Expression, gradient, symbol, symbols_of, total
from phigen.symbolic.neighbours import ENDS, Offset
from phigen.symbolic.symbols import VARIATION, Symbol, variation

#: Numbers of nodes of the polynomials that interpolate the power. The polynomials with FINE_NODES give the integral;
#: its difference from the integral with COARSE_NODES is an estimate of the error.
FINE_NODES, COARSE_NODES = 8, 6


class Power:
    """The power P = dH/dt of states of a lattice: ``power(x, rate, parameters)``.

    ``x`` and its time derivative ``rate`` have the shape (fields, *sizes). ``parameters`` has the parameters of a
    solver, the bonds of a graph, and the time, by name.
    """

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self._terms = [(self._rate(term), cell.extent(term)) for term in cell.terms]
        self._coupled = self._rate(cell.bond_hamiltonian + cell.pair_hamiltonian)

    def __call__(self, x: Floats, rate: Floats, parameters: Mapping[str, Any]) -> float:
        cell, sizes, power = self.cell, x.shape[1:], 0.0
        for term, extent in self._terms:
            values = self._values(term, x, rate, parameters, lambda array, offset: shifted(array, offset))
            power += float(np.broadcast_to(evaluate([term], values)[0], sizes)[inside_ends(cell, extent, sizes)].sum())
        if not self._coupled.is_zero:
            bond_ends = np.transpose(np.triu_indices(sizes[0], 1)) if cell.relation == PAIRS else parameters["bonds"]
            values = self._values(
                self._coupled, x, rate, parameters, lambda array, end: array[bond_ends[:, ENDS.index(str(end[0]))]]
            )
            power += float(np.broadcast_to(evaluate([self._coupled], values)[0], len(bond_ends)).sum())
        return power

    def _rate(self, density: Expression) -> Expression:
        """Return the time derivative of a density, as an expression in the fields and their time derivatives."""
        names = [n for n, (base, _) in self.cell.places(density).items() if base in self.cell.fields]
        slopes = gradient(density, [*names, *self.cell.times])
        along_motion = total(s * symbol(variation(n)) for s, n in zip(slopes, names, strict=False) if not s.is_zero)
        return along_motion + total(slopes[len(names) :])

    def _values(
        self, term: Expression, x: Floats, rate: Floats, parameters: Mapping[str, Any], instant: Any
    ) -> dict[str, Any]:
        values = {n: v for n, v in parameters.items() if n not in self.cell.neighbours.names}
        used_names = {str(n.key[0]) for n in _variations(term)} | set(self.cell.places(term))
        for name in used_names:
            base, offset = self.cell.place(name)
            if base in self.cell.fields:
                k = self.cell.fields.index(base)
                values |= {name: instant(x[k], offset), variation(name): instant(rate[k], offset)}
            else:
                values[name] = instant(np.broadcast_to(parameters[base], x.shape[1:]), offset)
        return values


def _variations(term: Expression) -> Iterator[Symbol]:
    return (n for n in symbols_of(term) if isinstance(n, Symbol) and n.kind == VARIATION)


def shifted(array: Floats, offset: Offset) -> Floats:
    """Return ``array`` shifted by −``offset``: each site gets the entry of the site that is ``offset`` away. Axes wrap
    around.
    """
    return np.roll(array, [-int(o) for o in offset], tuple(range(array.ndim))) if offset else array


def inside_ends(cell: Cell, extent: tuple[Sequence[int], Sequence[int]], sizes: Sequence[int]) -> NDArray[np.bool_]:
    """Return a mask that is true at each site at which a term of a density does not reach beyond open ends.

    The mask has the shape ``sizes``. ``extent`` has the smallest and the largest offset of the sites that the term
    reads, along each axis.
    """
    mask = np.ones(tuple(sizes), dtype=bool)
    if cell.relation != GRID:
        return mask
    low, high = extent
    for axis, boundary in enumerate(cell.boundary):
        if boundary != PERIODIC:
            shape = [-1 if a == axis else 1 for a in range(len(sizes))]
            positions = np.arange(sizes[axis]).reshape(shape)
            mask = mask & (positions + low[axis] >= 0) & (positions + high[axis] < sizes[axis])
    return mask


def integral(values: Floats, h: float, row_positions: Floats | None = None) -> tuple[Floats, float]:
    """Return the integrals of the power P, each from the first time to another time, and an estimate of their
    error.

    ``values`` has P at equidistant times, ``h`` apart. Without ``row_positions``, the upper limits of the integrals are
    these times. Otherwise they are the entries of ``row_positions``, in units of ``h`` from the first time. An entry
    need not be a whole number. Between two times, a polynomial through the nearest values stands for P. After the last
    time, the polynomial through the last values is extrapolated.
    """
    fine, coarse = (_integrals_to(values, count, h, row_positions) for count in (FINE_NODES, COARSE_NODES))
    return fine, float(np.abs(fine - coarse).max())


def _integrals_to(values: Floats, count: int, h: float, row_positions: Floats | None) -> Floats:
    """Return the integrals that `integral` describes, by polynomials through ``count`` neighbouring values."""
    intervals = len(values) - 1
    integrals = np.append(
        0.0, h * np.cumsum(_interval_integrals(values, count, np.arange(intervals), np.ones(intervals)))
    )
    if row_positions is None:
        return integrals
    whole_intervals = np.clip(np.floor(row_positions + 1e-9).astype(int), 0, intervals)
    part = np.where(np.abs(row_positions - whole_intervals) > 1e-9, row_positions - whole_intervals, 0.0)
    return np.asarray(integrals[whole_intervals] + h * _interval_integrals(values, count, whole_intervals, part))


def _interval_integrals(values: Floats, count: int, first_points: NDArray[np.int64], lengths: Floats) -> Floats:
    """Return the integral of a function over each of several intervals.

    ``values`` has the function at equidistant points. Interval k begins at the point with the index
    ``first_points[k]``. The length of the interval is ``lengths[k]`` times the distance between two points. On each
    interval, the polynomial through the ``count`` nearest points is integrated.
    """
    count = min(count, len(values))
    starts = np.clip(first_points - (count // 2 - 1), 0, len(values) - count)
    powers = np.arange(count)
    vandermonde = np.arange(count)[None, :] ** powers[:, None]
    integrals = np.zeros(len(first_points))
    for position, length in {*zip((first_points - starts).tolist(), lengths.tolist(), strict=True)}:
        moments = ((position + length) ** (powers + 1) - float(position) ** (powers + 1)) / (powers + 1)
        weights = np.linalg.solve(vandermonde.astype(np.float64), moments)
        selected = np.flatnonzero((first_points - starts == position) & (lengths == length))
        integrals[selected] = sum(w * values[starts[selected] + k] for k, w in enumerate(weights))
    return integrals
