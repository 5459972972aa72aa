"""The balance of energy of a lattice that is driven: H − ∫ P dt is constant along the motion, H is not.

P = dH/dt is the sum over sites, bonds and pairs of the change of their densities as the state moves, and of their
derivatives along the time: what the Hamiltonian field itself adds cancels. It is looked at after every step, and
integrated by the polynomials through eight neighbouring values, so that frames may be any number of steps apart.
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

#: Values that a polynomial goes through, and those of a coarser one, which tells how good it is.
FINE, COARSE = 8, 6


class Power:
    """P of the states of a lattice: ``power(x, rate, parameters)``.

    ``x`` and its ``rate`` of change have the shape (fields, *sizes); ``parameters`` are those of a solver, with the
    bonds of a graph, and the time by its name.
    """

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self._terms = [(self._rate(term), cell.extent(term)) for term in cell.terms]
        self._coupled = self._rate(cell.bond_hamiltonian + cell.pair_hamiltonian)

    def __call__(self, x: Floats, rate: Floats, parameters: Mapping[str, Any]) -> float:
        cell, sizes, found = self.cell, x.shape[1:], 0.0
        for term, extent in self._terms:
            values = self._values(term, x, rate, parameters, lambda array, offset: shifted(array, offset))
            found += float(np.broadcast_to(evaluate([term], values)[0], sizes)[there(cell, extent, sizes)].sum())
        if not self._coupled.is_zero:
            ends = np.transpose(np.triu_indices(sizes[0], 1)) if cell.relation == PAIRS else parameters["bonds"]
            values = self._values(
                self._coupled, x, rate, parameters, lambda array, end: array[ends[:, ENDS.index(str(end[0]))]]
            )
            found += float(np.broadcast_to(evaluate([self._coupled], values)[0], len(ends)).sum())
        return found

    def _rate(self, density: Expression) -> Expression:
        """How a density changes, with the rates of what it mentions."""
        names = [n for n, (base, _) in self.cell.places(density).items() if base in self.cell.fields]
        slopes = gradient(density, [*names, *self.cell.times])
        moved = total(s * symbol(variation(n)) for s, n in zip(slopes, names, strict=False) if not s.is_zero)
        return moved + total(slopes[len(names) :])

    def _values(
        self, term: Expression, x: Floats, rate: Floats, parameters: Mapping[str, Any], at: Any
    ) -> dict[str, Any]:
        values = {n: v for n, v in parameters.items() if n not in self.cell.neighbours.names}
        named = {str(n.key[0]) for n in _variations(term)} | set(self.cell.places(term))
        for name in named:
            base, offset = self.cell.place(name)
            if base in self.cell.fields:
                k = self.cell.fields.index(base)
                values |= {name: at(x[k], offset), variation(name): at(rate[k], offset)}
            else:
                values[name] = at(np.broadcast_to(parameters[base], x.shape[1:]), offset)
        return values


def _variations(term: Expression) -> Iterator[Symbol]:
    return (n for n in symbols_of(term) if isinstance(n, Symbol) and n.kind == VARIATION)


def shifted(array: Floats, offset: Offset) -> Floats:
    """The values of the sites that lie so far away on a grid, as if it were periodic."""
    return np.roll(array, [-int(o) for o in offset], tuple(range(array.ndim))) if offset else array


def there(cell: Cell, extent: tuple[Sequence[int], Sequence[int]], sizes: Sequence[int]) -> NDArray[np.bool_]:
    """Where a term of a grid that reaches so far is on the lattice (*sizes)."""
    found = np.ones(tuple(sizes), dtype=bool)
    if cell.relation != GRID:
        return found
    low, high = extent
    for axis, boundary in enumerate(cell.boundary):
        if boundary != PERIODIC:
            shape = [-1 if a == axis else 1 for a in range(len(sizes))]
            place = np.arange(sizes[axis]).reshape(shape)
            found = found & (place + low[axis] >= 0) & (place + high[axis] < sizes[axis])
    return found


def integral(values: Floats, h: float) -> tuple[Floats, float]:
    """∫ from the first of ``values`` (steps + 1,), h apart, to each of them; and how far the last may be off."""
    fine, coarse = (np.append(0.0, h * np.cumsum(_pieces(values, count))) for count in (FINE, COARSE))
    return fine, float(np.abs(fine - coarse).max())


def _pieces(values: Floats, count: int) -> Floats:
    """The integrals between neighbours, by polynomials through so many values around each piece."""
    count = min(count, len(values))
    pieces = len(values) - 1
    starts = np.clip(np.arange(pieces) - (count // 2 - 1), 0, len(values) - count)
    powers = np.arange(count)
    vandermonde = np.arange(count)[None, :] ** powers[:, None]
    found = np.zeros(pieces)
    for place in np.unique(np.arange(pieces) - starts).tolist():
        moments = ((place + 1.0) ** (powers + 1) - float(place) ** (powers + 1)) / (powers + 1)
        weights = np.linalg.solve(vandermonde.astype(np.float64), moments)
        chosen = np.flatnonzero(np.arange(pieces) - starts == place)
        found[chosen] = sum(w * values[starts[chosen] + k] for k, w in enumerate(weights))
    return found
