"""Lowering to work items of a device, such as a graphics card.

Each work item computes the values of one site; one array contains all fields.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes.sites import COUNT, OTHER, SITE, of_array, over_pairs
from phigen.ir.passes.sums import compensated_sum, limit, updates
from phigen.symbolic.symbols import Symbol

#: Index of a bond among the bonds of a site.
BOND = ir.fixed("b")

#: The first parameters of all kernels; the array parameters follow.
ARGUMENTS = ("items", "count", "sites", "coefficients", "first")

#: Array parameters of kernels, in their order. The comment above the kernels in ``templates/c/device_lattice.h.jinja``
#: explains each of these names.
_ARRAYS = ("neighbours", "weights", "on_seams", "at_sites", "dw", "x", "start", "varied", "out")
_OF_GRAPHS = ("starts", "others", "at_bonds", "colours", "colour")
_OF_SUMS = ("sums", "adds")

#: Names that kernels use; fields and parameters of the spec with these names are renamed.
KERNEL_NAMES = (*ARGUMENTS, *_ARRAYS, *_OF_GRAPHS, *_OF_SUMS, "coef", "i", "j", "b", "k")

#: Names of the arrays in which results are stored, by kind of storage.
_STORED = {ir.Storage.OUTPUT: "out", ir.Storage.OBSERVABLE: "out", ir.Storage.SUM: "sums"}
_STORED |= {ir.Storage.START: "start", ir.Storage.VARIATION: "varied", ir.Storage.STATE: "x"}


def kernel_arrays(lattice: LatticeLoops) -> tuple[str, ...]:
    """Return the names of the array parameters that all kernels of a lattice have, in order."""
    step = lattice.step
    absent = {
        "on_seams": not lattice.seams,
        "at_sites": not step.sites.parameters,
        "dw": not step.sites.increments,
        "weights": not lattice.weights,
        "start": not step.equation,
        "varied": not step.equation,
    }
    arrays = [name for name in _ARRAYS if not absent.get(name)]
    arrays += _OF_GRAPHS if step.others.graph else ()
    return (*arrays, *(_OF_SUMS if step.partners else ()))


def work_items(function: ir.Function, lattice: LatticeLoops) -> ir.Function:
    """Return the statements of one work item for a function with a loop over sites, bonds or pairs. A work item
    computes one site.
    """
    items = _WorkItems(lattice)
    loops = [s for s in function.body if isinstance(s, ir.Loop)]
    head = [s for s in function.body if isinstance(s, ir.Declare)]
    lowered = [new for s in head for new in items.lowered(s)]
    lowered += [new for loop in loops for new in items.loop(loop)]
    return replace(function, parameters=KERNEL_NAMES, body=tuple(lowered))


@dataclass
class _WorkItems:
    """Lowering of one function to work items. For each neighbour that the function reads, a variable holds the number
    of the neighbour's site. The set ``declared`` has the neighbours whose variables are already declared.
    """

    lattice: LatticeLoops
    declared: set[int] = field(default_factory=set)

    def loop(self, loop: ir.Loop) -> Iterator[ir.Statement]:
        """Yield the statements of a work item, which computes one site. A loop over sites is replaced by its body; a
        loop over bonds or pairs becomes a loop over the bonds or pairs of the site.
        """
        if loop.kind == "sites":
            yield from (new for s in loop.body for new in self.lowered(s))
            return
        stores = loop.stores
        totals = [ir.fixed(f"total{s.array.number}") for s in stores]
        for s, total in zip(stores, totals, strict=True):
            before = ir.Select(ir.fixed("adds"), self._element(s.array, SITE), ir.Constant(0.0))
            start = limit(s.extreme, "HUGE_VAL") if s.extreme else before
            yield ir.Declare(ir.Type.REAL, ((total.symbol, start),), mutable=True)
        body: list[ir.Statement] = [new for s in loop.body if isinstance(s, ir.Declare) for new in self.lowered(s)]
        body += (new for s, total in zip(stores, totals, strict=True) for new in updates(s, total, s.value))
        yield _over_bonds(body) if self.lattice.step.others.graph else over_pairs(body)
        yield from (ir.Assign(self._element(s.array, SITE), total) for s, total in zip(stores, totals, strict=True))

    def lowered(self, s: ir.Statement) -> Iterator[ir.Statement]:
        """Yield the lowered form of a statement. A value at an offset from the site becomes an element of an array."""
        match s:
            case ir.Store(array, value, adds):
                yield from self._stored(array, value, adds=adds)
            case ir.Declare(items=((name, ir.Load() as load),)):
                site: ir.Value = OTHER if load.end == "b" else SITE
                if any(load.offset):
                    number = self.lattice.neighbours.index(load.offset)
                    site = ir.Name(Symbol("beside", number))
                    if number not in self.declared:
                        self.declared.add(number)
                        yield ir.index(site, ir.Entry(ir.fixed("neighbours"), of_array(SITE, number)))
                yield ir.real(name, self._element(load.array, site))
            case ir.Declare(items=((name, value),)):
                yield replace(s, items=((name, self._value(value)),))
            case _:
                raise TypeError(s)

    def _stored(self, array: ir.Array, value: ir.Value, *, adds: bool) -> Iterator[ir.Statement]:
        place = self._element(array, SITE)
        if array.storage is ir.Storage.STATE and self.lattice.program.compensated:
            fields = self.lattice.program.dimension
            yield from compensated_sum(array.number, place, _entry("x", SITE, fields + array.number), value)
        else:
            yield ir.Assign(place, value, adds)

    def _value(self, value: ir.Value) -> ir.Value:
        match value:
            case ir.Coefficient(k):
                return _entry("coef", ir.Constant(k))
            case ir.SystemParameter(name):
                return _entry("coef", ir.Constant(self.lattice.numbers.index(name)))
            case ir.Time():
                return _entry("coef", ir.Constant(len(self.lattice.numbers)))
            case ir.BondParameter(number):
                ends = ir.Binary("*", ir.Constant(number), _entry("starts", COUNT))
                return _entry("at_bonds", ir.Binary("+", BOND, ends) if number else BOND)
            case ir.Inside(k):
                return _entry("weights", SITE, k)
            case ir.OnSeam(k):
                return _entry("on_seams", SITE, k)
            case ir.HasColour():
                matches = ir.Binary("==", _entry("colours", SITE), ir.fixed("colour"))
                return ir.Select(matches, ir.Constant(1.0), ir.Constant(0.0))
        return value

    def _element(self, array: ir.Array, site: ir.Value) -> ir.Value:
        sites, fields = self.lattice.step.sites, self.lattice.program.coordinates
        if array.storage is not ir.Storage.STATE or array.name in fields:
            return _entry(_STORED[array.storage], site, array.number)
        if array.name in sites.increments:
            return _entry("dw", site, sites.increments.index(array.name))
        return _entry("at_sites", site, sites.parameters.index(array.name))


def _over_bonds(body: list[ir.Statement]) -> ir.Statement:
    """Return the loop over the bonds of a site."""
    high = ir.Entry(ir.fixed("starts"), ir.Binary("+", SITE, ir.Constant(1)))
    other = ir.index(OTHER, _entry("others", BOND))
    return ir.Loop("plain", (other, *body), "b", _entry("starts", SITE), high)


def _entry(array: str, site: ir.Value, number: int = 0) -> ir.Value:
    return ir.Entry(ir.fixed(array), of_array(site, number))
