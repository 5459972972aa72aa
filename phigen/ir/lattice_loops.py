"""Builder of the loops of a lattice: functions that evaluate kernels of a site in loops over sites, bonds or
pairs.

`LatticeLoops.meaning` defines, for all targets, which value each symbol of a kernel stands for. The values that the
functions store are whole expression graphs. Two passes follow. `phigen.ir.passes.temporaries` converts the graphs to
statements. The lowering of the target converts loops over sites to loops over elements of arrays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

from phigen.ir import nodes as ir
from phigen.ir.passes.loop_invariant import loop_invariant
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.reversal import STATE_BEFORE
from phigen.scheme.steps import Ends, Gather, Sweep, Sweeps
from phigen.symbolic import symbols
from phigen.symbolic.expression import Expression, number, symbol
from phigen.symbolic.symbols import Symbol, kind_of

#: Share of the energy of a bond or pair that is assigned to each of its two sites.
_HALF = number(Fraction(1, 2))


@dataclass(frozen=True)
class LatticeLoops:
    """Builder of the functions that evaluate the kernels of a lattice program."""

    program: Program
    step: Sweeps

    def sweep(self, sweep: Sweep) -> ir.Function:
        """Return the function of a sweep: it adds increments to the fields or, for a tangent sweep, to the variations
        of fields.
        """
        storage = ir.Storage.VARIATION if sweep.is_tangent else ir.Storage.STATE
        arrays = (ir.Array(storage, k, self.program.coordinates[k]) for k in sweep.moved)
        stores = [ir.Store(array, e) for array, e in zip(arrays, sweep.kernel.roots, strict=True)]
        parameters = ("coef", "state", *["varied"] * sweep.is_tangent, "sites", *["colour"] * bool(self.step.by_colour))
        return self._over_sites(sweep.kernel, parameters, stores, sweep.gather, self._selection(sweep))

    def _selection(self, sweep: Sweep | None) -> ir.Selection:
        coloured = self.step.sites.colours > 1
        if sweep is None:
            return ir.ALL_SITES
        return ir.Selection(
            sweep.colour if coloured else None, sweep.omits_seams and coloured, sweep.window, sweep.first
        )

    def stage(self, kernel: Kernel) -> ir.Function:
        """Return the function of a kernel of a stage. The function reads the fields of y, the unknown of the stage."""
        gather = self.step.others.varied if kernel.reads_variations else self.step.others.field
        read = gather if kernel.inputs["gathered"] else None
        starts, varied = ["start"] * kernel.reads_start, ["varied"] * kernel.reads_variations
        parameters = ("coef", *starts, "state", *varied, "sites", "out")
        return self._over_sites(kernel, parameters, self._outputs(ir.Storage.OUTPUT, kernel.roots), read)

    def observable(self, kernel: Kernel) -> ir.Function:
        """Return the function that evaluates a kernel at all sites and stores the results for the caller. The kernel
        computes a density, an energy or the vector field.

        The energy at a site includes one half of the energy of each bond or pair to which the site belongs.
        """
        others = self.step.others
        gather = others.sums_of(kernel)
        body: list[ir.Statement] = [*self._outputs(ir.Storage.OBSERVABLE, kernel.roots)]
        if kernel.role.is_energy and gather.names:
            shared, out = Symbol(symbols.GATHERED, "energy"), ir.Array(ir.Storage.OBSERVABLE, 0)
            body.insert(0, ir.real(shared, ir.Load(ir.Array(ir.Storage.SUM, 0))))
            body.append(ir.Store(out, _HALF * symbol(shared)))
        parameters = ("params", "state", *["varied"] * kernel.reads_variations, "sites", "out")
        return self._over_sites(kernel, parameters, body, gather if gather.names else None)

    def sums(self, ends: Ends) -> ir.Function:
        """Return the function that computes sums at each site. The sums are over bonds of the site or, for pairs, over
        all other sites.
        """
        kernel = ends.kernel
        source = "params" if "params" in kernel.inputs else "coef"
        varied = "varied" in kernel.inputs or ends in self.step.others.varied.ends
        colour = source == "coef" and bool(self.step.by_colour)
        parameters = (source, "state", *["varied"] * varied, "sites", *["colour"] * colour)
        sums = self._outputs(ir.Storage.SUM, kernel.roots, adds=True)
        kinds = [ends.extremes.get(k, "") for k in range(len(sums))]
        updates = (replace(s, adds=not kind, extreme=kind) for s, kind in zip(sums, kinds, strict=True))
        return self._over_ends(ends, kernel, parameters, updates)

    def transposed(
        self, kernel: Kernel, gather: Gather | None, sweep: Sweep | None = None, fields: Sequence[str] = ()
    ) -> ir.Function:
        """Return the function of a transposed kernel. The original kernel belongs to a ``sweep`` or, without ``sweep``,
        to a stage.

        ``gather`` has the sums that the transposed kernel reads. The list ``fields`` has names of fields: the function
        also recomputes the values that these fields had before the sweep.
        """
        stores = self._cotangents(kernel, gather.names if gather else (), fields)
        return self._over_sites(kernel, ("coef",), stores, gather, self._selection(sweep))

    def transposed_sums(self, ends: Ends, kernel: Kernel) -> ir.Function:
        """Return the transpose of the function `sums(ends)`. ``kernel`` is the transpose of `ends.kernel`."""
        source = "params" if "params" in kernel.inputs else "coef"
        return self._over_ends(ends, kernel, (source,), self._cotangents(kernel))

    def _over_ends(
        self, ends: Ends, kernel: Kernel, parameters: tuple[str, ...], updates: Iterable[ir.Statement]
    ) -> ir.Function:
        kind = "bonds" if self.step.others.graph else "pairs"
        others = ir.Selection(first=ends.first, massive=ends.massive)
        reads = self._reads(kernel, ())
        loop = ir.Loop(kind, (*reads, *updates), end=ends.end, chosen=ends.chosen, selection=others)
        return _function(kernel, parameters, loop)

    def _cotangents(self, kernel: Kernel, sums: Sequence[str] = (), fields: Sequence[str] = ()) -> Iterator[ir.Update]:
        """Yield the stores of the outputs of a transposed kernel, without outputs that are 0.

        ``sums`` are the names of the sums that the kernel reads, and ``fields`` the fields that it recomputes.
        """
        for output in kernel.outputs:
            array = output.name.removesuffix("_bar")
            names = fields if array == STATE_BEFORE else kernel.inputs.get(array, [""] * len(output.values))
            for k, e in enumerate(output.values):
                if not e.is_zero:
                    yield self._cotangent(array, k, names[k], e, sums)

    def _cotangent(self, array: str, k: int, name: str, value: Expression, sums: Sequence[str]) -> ir.Update:
        storage, fields, key = ir.Storage.COTANGENT, self.program.coordinates, getattr(name, "key", ("",))
        match array:
            case "coef" | "params":
                return ir.Reduce(array, k, name, value)
            case "start":
                number = fields.index(str(key[0]))
                return ir.Store(ir.Array(ir.Storage.START_COTANGENT, number, str(key[0])), value)
            case "gathered":
                return ir.Store(ir.Array(ir.Storage.SUM_COTANGENT, [*sums].index(name)), value, adds=False)
            case "sums":
                return ir.Store(ir.Array(ir.Storage.SUM, k), value, adds=False)
            case "bonds":
                number = len(self.arrays) + self.step.sites.at_bonds.index(name)
                return ir.Store(ir.Array(storage, number, name), value, end="bond")
            case "site":
                place = self._load(name, storage)
                return ir.Store(place.array, value, offset=place.offset, end=place.end)
        return ir.Store(ir.Array(ir.Storage.STATE, self.arrays.index(name), name), value, adds=False)

    def _over_sites(
        self,
        kernel: Kernel,
        parameters: tuple[str, ...],
        updates: Iterable[ir.Statement],
        gather: Gather | None,
        selection: ir.Selection = ir.ALL_SITES,
    ) -> ir.Function:
        gathered = [ir.GatherSums(tuple(k.name for k in gather.kernels), len(gather.names))] if gather else []
        reads = self._reads(kernel, gather.names if gather else ())
        return _function(kernel, parameters, *gathered, ir.Loop("sites", (*reads, *updates), selection=selection))

    def _outputs(self, storage: ir.Storage, values: Sequence[Expression], *, adds: bool = False) -> list[ir.Store]:
        return [ir.Store(ir.Array(storage, k), e, adds) for k, e in enumerate(values)]

    def _reads(self, kernel: Kernel, sums: Sequence[str]) -> Iterator[ir.Statement]:
        """Return the declarations of the values that a kernel reads, in the order of its inputs."""
        return (ir.real(s, self.meaning(s, sums)) for listed in kernel.inputs.values() for s in listed)

    def meaning(self, s: str, sums: Sequence[str] = ()) -> ir.Value:
        """Return the value that a symbol of a kernel stands for; ``sums`` are the names of the sums that the kernel
        reads."""
        sites, fields = self.step.sites, self.program.coordinates
        key = s.key if isinstance(s, Symbol) else ()
        match kind_of(s):
            case symbols.COEFFICIENT:
                return ir.Coefficient(int(key[0]))
            case symbols.PRESENT:
                return ir.Inside(self.weights.index(s), tuple(bounds(key)))
            case symbols.BEGINS:
                return ir.OnSeam(self.seams.index(s), int(key[0]), tuple(int(o) for o in key[1:]))
            case symbols.CHOSEN:
                return ir.HasColour()
            case symbols.GATHERED:
                return ir.Load(ir.Array(ir.Storage.SUM, [*sums].index(s), str(s)))
            case symbols.VARIATION:
                return self._load(str(key[0]), ir.Storage.VARIATION)
            case symbols.INITIAL:
                return ir.Load(ir.Array(ir.Storage.START, fields.index(str(key[0])), str(key[0])))
            case symbols.AROUND:
                offset = tuple(int(o) for o in key[1:])
                return ir.Load(ir.Array(ir.Storage.SEED, int(key[0]), "change_bar"), offset)
            case symbols.HERE | symbols.THERE as kind:
                end = "a" if kind == symbols.HERE else "b"
                return ir.Load(ir.Array(ir.Storage.SEED, int(key[0]), symbols.HERE), end=end)
            case str() as kind if kind.endswith("_bar"):
                return ir.Load(ir.Array(ir.Storage.SEED, int(key[0]), kind))
        if s == self.program.time:
            return ir.Time()
        if s in sites.at_bonds:
            return ir.BondParameter(sites.at_bonds.index(s), s)
        if s in sites.places or s in sites.ends:
            return self._load(s, ir.Storage.STATE)
        return ir.SystemParameter(s)

    def _load(self, place: str, storage: ir.Storage) -> ir.Load:
        sites = self.step.sites
        base, end = sites.ends.get(place, ("", ""))
        offset: tuple[int, ...] = ()
        if not end:
            base, offset = sites.places[place]
        return ir.Load(ir.Array(storage, self.arrays.index(base), base), tuple(offset), end)

    @cached_property
    def arrays(self) -> tuple[str, ...]:
        """The names of the arrays of the state, in order: fields, parameters at sites, increments of noise, derived
        values.
        """
        sites = self.step.sites
        return (*self.program.coordinates, *sites.parameters, *sites.increments, *sites.derived)

    @cached_property
    def derived(self) -> dict[str, str]:
        """The derived values, which solvers compute for each site from parameters: a map from the symbol of a value to
        the name of its array.
        """
        return {symbol: symbol.kind for symbol in self.step.sites.derived}

    @cached_property
    def numbers(self) -> tuple[str, ...]:
        """The names of the parameters with one value for all sites."""
        arrays = {*self.step.sites.parameters, *self.step.sites.at_bonds}
        return tuple(p.name for p in self.program.parameters if p.name not in arrays)

    @cached_property
    def neighbours(self) -> list[tuple[int, ...]]:
        """The offsets of all neighbours whose values kernels read, sorted."""
        return sorted({offset for _, offset in self.step.sites.places.values() if any(offset)})

    @cached_property
    def weights(self) -> tuple[Symbol, ...]:
        """The symbols for the weights of terms near open ends, in the order in which kernels read them."""
        equation = self.step.equation
        kernels = (*(sweep.kernel for sweep in self.step.sweeps), *(equation.kernels if equation else ()))
        return _present((*kernels, *self.program.observables.kernels), symbols.PRESENT)

    @cached_property
    def seams(self) -> tuple[Symbol, ...]:
        """The symbols of the weights of terms near boundary seams, in the order in which kernels read them."""
        return _present((sweep.kernel for sweep in self.step.sweeps), symbols.BEGINS)


def _function(kernel: Kernel, parameters: tuple[str, ...], *body: ir.Statement) -> ir.Function:
    return loop_invariant(ir.Function(kernel.name, kernel.purpose, kernel.role, parameters, body))


def _present(kernels: Iterable[Kernel], kind: str) -> tuple[Symbol, ...]:
    """Return the symbols that kernels read for weights of one ``kind``, in the order of their first use. A weight
    multiplies a term; it is 1 at some sites, and 0 at all others.
    """
    read = (s for kernel in kernels for s in kernel.inputs["present"])
    return tuple(dict.fromkeys(s for s in read if isinstance(s, Symbol) and kind_of(s) == kind))


def bounds(key: Sequence[str | int]) -> list[tuple[int, int]]:
    """Return, for each axis, the least and the largest offset at which a term of H reads values.

    The term has a weight, and the weight has a symbol. ``key`` is the key of this symbol: a list of the offsets.
    """
    ends = [int(k) for k in key]
    return list(zip(ends[::2], ends[1::2], strict=True))
