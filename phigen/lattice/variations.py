"""Directional derivatives of kernels at a site, along variations of the fields at and around the site.

Newton's method and tangent maps need these derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phigen.lattice.cell import Cell
from phigen.symbolic.expression import Expression, gradient, symbol, symbols_of, total
from phigen.symbolic.symbols import GATHERED, INITIAL, VARIATION, Symbol, kind_of, variation


def along(cell: Cell, values: Sequence[Expression]) -> list[Expression]:
    """Return the directional derivatives of values, as expressions in the symbols of the variations.

    The functions `variation` and `varied_sum` return these symbols, for each field and for each sum over bonds or pairs
    that the values read.
    """
    slots: dict[str, Symbol] = {n: variation(n) for n, (f, _) in cell.places(*values).items() if f in cell.fields}
    slots |= {n: varied_sum(n) for n in symbols_of(*values) if isinstance(n, Symbol) and n.kind == GATHERED}
    slopes = (zip(slots.values(), gradient(e, list(slots)), strict=True) for e in values)
    return [total(d * symbol(v) for v, d in row if not d.is_zero) for row in slopes]


def along_start(values: Sequence[Expression]) -> list[Expression]:
    """Return the derivatives of values along the variations of the fields at the start of a stage."""
    starts = {n: variation(str(n.key[0])) for n in symbols_of(*values) if isinstance(n, Symbol) and n.kind == INITIAL}
    slopes = (zip(starts.values(), gradient(e, list(starts)), strict=True) for e in values)
    return [total(d * symbol(v) for v, d in row if not d.is_zero) for row in slopes]


def varied_sum(name: Symbol) -> Symbol:
    """Return the symbol of the variation of a sum over bonds or pairs."""
    return Symbol(GATHERED, VARIATION, *name.key)


def with_variations(cell: Cell, values: Mapping[str, Expression]) -> dict[str, Expression]:
    """Return ``values`` together with the summands for the variations of the sums.

    ``values`` maps the symbol of each sum over bonds or pairs to its summand. The result is a map of the same form.
    """
    names = [n for n in values if isinstance(n, Symbol) and kind_of(n) == GATHERED]
    assert len(names) == len(values)
    return {**values, **dict(zip(map(varied_sum, names), along(cell, list(values.values())), strict=True))}
