"""Kernels of observables of a lattice: energy, Casimirs, vector field, and the observables of the spec.

The value of an observable may be one number: the sum, the mean, the maximum or the minimum of a density over the sites.
Targets compute this number from the values of the density. Near an open end, some terms of the density reach beyond the
end. A sum omits only these terms, and so does H. A maximum or minimum omits the whole site.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from fractions import Fraction

from phigen.lattice.cell import PAIRS, Cell
from phigen.lattice.graphs import field_with_sums
from phigen.lattice.site_kernels import site_kernel
from phigen.lattice.site_parts import BondSum, present, summands_of
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.program import Observables
from phigen.spec.names import ADDITIVE
from phigen.symbolic.expression import ONE, Expression, call, number, symbol, total
from phigen.symbolic.symbols import GATHERED, Symbol

#: Weight with which the value of a pair is added at each of its two sites.
_SHARE = number(Fraction(1, 2))


def observables(cell: Cell, *, single: bool = False) -> Observables:
    """Return the kernels of all observables, for generated code in double precision or, with ``single``, in single
    precision.
    """
    origin = [0] * len(cell.axes)
    density = total(present(cell, s.low, s.high, origin) * s.expression for s in summands_of(cell) if not s.bond)
    casimirs = [density for density, _ in cell.casimirs.values()]
    fields = {name: e for name, e in cell.observables.items() if name not in cell.reductions}
    densities = [_density(cell, name, single=single) for name in cell.reductions]
    at_sites = [_within(cell, e) for e in fields.values()]

    def kernel(role: Role, name: str, purpose: str, values: Sequence[Expression]) -> Kernel:
        return site_kernel(cell, name, purpose, values, "out", role=role)

    numbers = kernel(Role.OBSERVABLES, "observables", "the densities of the observables", densities)
    sites = kernel(Role.SITE_OBSERVABLES, "observed_fields", "the observables of sites", at_sites)
    return Observables(
        kernel(Role.ENERGY, "energy", "the density of the Hamiltonian", [density]),
        kernel(Role.CASIMIRS, "casimirs", "the densities of the Casimirs", casimirs),
        kernel(Role.VECTOR_FIELD, "vector_field", "the vector field pi grad H", field_with_sums(cell)),
        numbers if densities else None,
        tuple(cell.reductions.values()),
        sites if fields else None,
        tuple(fields),
    )


def observed_sums(cell: Cell) -> tuple[BondSum, ...]:
    """Return the sums, maxima and minima over bonds or pairs that observables need.

    A bond contributes at the site where it starts. A pair contributes at both its sites.
    """
    names = [name for name, reduction in cell.reductions.items() if reduction.over != "sites"]
    sums: dict[str, Expression] = {Symbol(GATHERED, name): cell.observables[name] for name in names}
    kinds = {name: cell.reductions[name].kind for name in names}
    extremes: dict[str, str] = {Symbol(GATHERED, n): kind for n, kind in kinds.items() if kind not in ADDITIVE}
    return (BondSum(sums, "" if cell.relation == PAIRS else "a", extremes=extremes),) if sums else ()


def _density(cell: Cell, name: str, *, single: bool) -> Expression:
    """Return the density of the observable ``name`` at a site, with symbols for sums and extremes over bonds
    and pairs.

    Where the density reaches beyond an open end, the value of the density must not become the maximum or minimum over
    the sites. There, the result is −L for a maximum and L for a minimum, where L is the largest floating-point number.
    """
    reduction = cell.reductions[name]
    if reduction.over != "sites":
        halved = reduction.over == "pairs" and reduction.kind in ADDITIVE
        return (_SHARE if halved else ONE) * symbol(Symbol(GATHERED, name))
    value = cell.observables[name]
    if reduction.kind in ADDITIVE:
        return _within(cell, value)
    is_present = _present(cell, value)
    if is_present == ONE:
        return value
    largest = (2 - Fraction(1, 2**23)) * 2**127 if single else Fraction(sys.float_info.max)
    return call("choose", is_present, value, number(-largest if reduction.kind == "max" else largest))


def _within(cell: Cell, density: Expression) -> Expression:
    """Return the density with each additive term multiplied by a weight. The weight is 0 where the term reaches beyond
    an open end.
    """
    return total(_present(cell, term) * term for term in cell.additive_terms(density))


def _present(cell: Cell, term: Expression) -> Expression:
    """Return the weight of a term: 1 if all sites that the term reads are on the lattice, else 0."""
    return present(cell, *cell.extent(term), [0] * len(cell.axes)) if cell.axes else ONE
