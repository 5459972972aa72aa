"""Lowering of sweeps to work items of a device: each updates one site of a lattice whose fields are in one array."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.symbolic.symbols import Symbol

#: Number of the site of a work item, and the number of all sites.
SITE, COUNT = ir.fixed("i"), ir.fixed("count")

#: Arrays of a kernel: fields, coefficients of a flow, numbers of neighbours, weights of terms at open ends, parameters
#: at sites, and increments of the noise.
FIELDS, COEFFICIENTS, NEIGHBOURS, WEIGHTS, PARAMETERS, INCREMENTS = map(
    ir.fixed, ("x", "coef", "neighbours", "weights", "at_sites", "dw")
)

#: Names in a kernel that fields and parameters make way for.
KERNEL_NAMES = (
    *("items", "count", "sites", "coefficients", "first", "coef", "neighbours", "weights", "at_sites", "dw", "x"),
    *("i", "k"),
)


def work_items(function: ir.Function, lattice: LatticeLoops) -> ir.Function:
    """Return a sweep as the statements of one work item. Raises `TypeError` for what only some lattices have."""
    items = _WorkItems(lattice)
    loops = (s for s in function.body if isinstance(s, ir.Loop))
    before = (s for s in function.body if not isinstance(s, ir.Loop))
    statements = [*before, *(inner for loop in loops for inner in loop.body)]
    lowered = tuple(new for s in statements for new in items.lowered(s))
    return replace(function, parameters=KERNEL_NAMES, body=lowered)


@dataclass
class _WorkItems:
    """The lowering of one function; ``declared`` are the neighbours that have a name already."""

    lattice: LatticeLoops
    declared: set[int] = field(default_factory=set)

    def lowered(self, s: ir.Statement) -> Iterator[ir.Statement]:
        """Yield the statements on memory for one on the level of sites."""
        match s:
            case ir.Store(array, value, adds):
                yield ir.Assign(self._element(array, SITE), value, adds)
            case ir.Declare(items=((name, ir.Load() as load),)):
                site: ir.Value = SITE
                if any(load.offset):
                    number = self.lattice.neighbours.index(load.offset)
                    site = ir.Name(Symbol("beside", number))
                    if number not in self.declared:
                        self.declared.add(number)
                        yield ir.index(site, ir.Entry(NEIGHBOURS, _of_array(SITE, number)))
                yield ir.real(name, self._element(load.array, site))
            case ir.Declare(items=((name, ir.Coefficient(k)),)):
                yield ir.real(name, ir.Entry(COEFFICIENTS, ir.Constant(k)))
            case ir.Declare(items=((name, ir.Inside(k)),)):
                yield ir.real(name, ir.Entry(WEIGHTS, _of_array(SITE, k)))
            case ir.Declare():
                yield s
            case _:
                raise TypeError(s)

    def _element(self, array: ir.Array, site: ir.Value) -> ir.Value:
        sites, fields = self.lattice.step.sites, self.lattice.program.coordinates
        if array.name in sites.increments:
            return ir.Entry(INCREMENTS, _of_array(site, sites.increments.index(array.name)))
        if array.name in sites.parameters:
            return ir.Entry(PARAMETERS, _of_array(site, sites.parameters.index(array.name)))
        return ir.Entry(FIELDS, _of_array(site, fields.index(array.name)))


def _of_array(site: ir.Value, number: int) -> ir.Value:
    """Return the index of a site in one of several arrays that follow one another."""
    if number == 0:
        return site
    return ir.Binary("+", site, COUNT if number == 1 else ir.Binary("*", ir.Constant(number), COUNT))
