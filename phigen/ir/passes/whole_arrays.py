"""Lowering to whole arrays, for NumPy: each statement works on the arrays of all sites, bonds or pairs, without
loops.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.nodes import Storage
from phigen.ir.passes.sums import limit
from phigen.scheme.kernel import Role
from phigen.symbolic.symbols import HERE

X, V, SITES, NP, BAR, COLOUR, BOND, SUMS, MOVED, OUT, AXIS = (
    ir.fixed(n) for n in ("x", "v", "sites", "np", "bar", "colour", "bond", "sums", "moved", "out", ":, None")
)
#: Names of the parameters that contain the arrays of each kind of storage.
_ARRAYS = {Storage.STATE: "x", Storage.VARIATION: "v", Storage.START: "start", Storage.SUM: "gathered"}
_ARRAYS |= {Storage.COTANGENT: "bar", Storage.START_COTANGENT: "start_bar"}

#: Values that get no variable; they are printed where they are used.
_IN_PLACE = ir.Coefficient | ir.Time | ir.Inside | ir.HasColour | ir.OnSeam
_READ_IN_PLACE = (Storage.START, Storage.SUM, Storage.SEED)

#: Further parameters of transposed functions: the cotangents, the sites, and the results to which derivatives are
#: added.
_TRANSPOSED = ("bar", "sites", "coef_bar", "parameters_bar")


def sums_name(kernel: str) -> str:
    """Return the name of the function that computes all sums over bonds or pairs.

    ``kernel`` is the name of the kernel that computes these sums at one end of the bonds.
    """
    base = kernel.removesuffix("_a").removesuffix("_b")
    plain = base.removeprefix("bond_").removeprefix("pair_")
    return {"energy": "energies"}.get(plain, plain)


def transposed_sums_name(kernel: str) -> str:
    """Return the name of the transpose of the function that computes all sums over bonds or pairs.

    ``kernel`` is the name of the kernel that computes these sums at one end of the bonds.
    """
    return kernel.removesuffix("_a").removesuffix("_b") + "_back"


@dataclass(frozen=True)
class WholeArrays:
    """The lowering of the functions of a lattice to operations on whole arrays.

    The pass `phigen.ir.passes.temporaries` comes before this lowering.
    """

    lattice: LatticeLoops

    def sweep(self, function: ir.Function) -> ir.Function:
        """Return a sweep as a function that returns a new state or, for a tangent sweep, a new variation."""
        loop, array = function.loop, V if function.role is Role.SWEEP_TANGENT else X
        body = [*_unless_beside(loop, array), *self._sums(function), *self._reads(function), *_copied(MOVED, array)]
        for s in loop.stores:
            old = ir.entry(array, s.array.number)
            new = _chosen(loop.selection, ir.Binary("+", old, ir.Grouped(s.value)), old)
            body.append(ir.Assign(ir.entry(MOVED, s.array.number), new))
        varied = ("v",) if array is V else ()
        parameters = ("coef", "x", *varied, "sites", *_argument(loop.selection))
        return replace(function, parameters=parameters, body=(*body, ir.Return(MOVED)))

    def stage(self, function: ir.Function) -> ir.Function:
        """Return a kernel of a stage as a function of the unknown y and of the state at the start of the stage.

        The parameter for y has the name x.
        """
        shape = ir.Member(SITES, "sizes")
        values = (ir.Called("broadcast_to", (s.value, shape), NP) for s in function.loop.stores)
        result = ir.Return(ir.Called("array", (ir.Listed(tuple(values)),), NP))
        varied = ("v",) if "varied" in function.parameters else ()
        parameters = ("coef", "start", "x", *varied, "sites")
        return replace(function, parameters=parameters, body=(*self._sums(function), *self._reads(function), result))

    def observable(self, function: ir.Function) -> ir.Function:
        """Return a density, an energy or the vector field as a function of the state."""
        values, added = _split(function.loop.stores)
        sums = () if added else self._sums(function)
        empty = ir.Called("empty", (ir.fixed(f"({len(values)}, *sites.sizes)"),), NP)
        body = [*sums, *self._reads(function), ir.real(OUT, empty)]
        body += [ir.Assign(ir.entry(OUT, s.array.number), s.value) for s in values]
        body += [ir.Assign(OUT, s.value, adds=True) for s in added]
        varied = ("v",) if "varied" in function.parameters else ()
        return replace(function, parameters=("parameters", "x", *varied, "sites"), body=(*body, ir.Return(OUT)))

    def sums(self, functions: Sequence[ir.Function]) -> ir.Function:
        """Combine ``functions`` into one function, whose result is the sum of their results.

        Each of the ``functions`` computes sums over bonds or pairs; for bonds there may be one function for each end.
        """
        body: list[ir.Statement] = []
        for function in functions:
            loop = function.loop
            added = (self._summed(s, loop.selection) for s in loop.stores)
            total = ir.Binary("+", SUMS, ir.Called("array", (ir.Listed(tuple(added)),), NP))
            body += [*self._bonds(loop), *self._reads(function), ir.Assign(SUMS, total)]
        quiet = ir.Within(ir.Called("errstate", (ir.fixed('all="ignore"'),), NP), tuple(body))
        varied = ("v",) if "varied" in functions[0].parameters else ()
        parameters = (_source(functions[0]), "x", *varied, "sites")
        statements = (ir.real(SUMS, ir.Constant(0.0)), quiet, ir.Return(SUMS))
        return replace(functions[0], name=sums_name(functions[0].name), parameters=parameters, body=statements)

    # ---- transposes

    def transposed_sweep(self, function: ir.Function, updated: Sequence[int]) -> ir.Function:
        """Return the transpose of a sweep: a function from the cotangent after the sweep to the cotangent before it.

        The parameter ``x`` is the state before the sweep.
        """
        loop = function.loop
        seeds = (_chosen(loop.selection, ir.entry(BAR, k), ir.Constant(0.0)) for k in updated)
        body = [*_unless_beside(loop, BAR), ir.real(ir.fixed("change_bar"), ir.Listed(tuple(seeds)))]
        body += [*self._sums(function), *self._reads(function), *_copied(BAR, BAR)]
        body += self._added_cotangents(loop)
        body += self._transposed_sums(function, ir.fixed("coef"))
        parameters = ("coef", "x", *_TRANSPOSED, *_argument(loop.selection))
        return replace(function, parameters=parameters, body=(*body, ir.Return(BAR)))

    def transposed_stage(self, function: ir.Function, seed: str) -> ir.Function:
        """Return the transpose of a kernel of a stage.

        It is a function of the cotangent ``seed``. It returns two cotangents: of the unknown y of the stage, and of the
        state at the start of the stage.
        """
        zeros, both = ir.Called("zeros_like", (X,), NP), (BAR, ir.fixed("start_bar"))
        body = [
            *self._sums(function),
            *self._reads(function),
            ir.Unpack(("bar", "start_bar"), ir.Several((zeros, zeros))),
        ]
        body += self._added_cotangents(function.loop)
        body += self._transposed_sums(function, ir.Member(SITES, "parameters"))
        parameters = ("coef", "start", "x", seed, "sites", "coef_bar", "parameters_bar")
        return replace(function, parameters=parameters, body=(*body, ir.Return(ir.Several(both))))

    def transposed_sums(self, functions: Sequence[ir.Function], name: str) -> ir.Function:
        """Return the transpose of ``functions``, which compute sums, as one function with the name ``name``.

        The result maps cotangents of the sums to cotangents of the state.
        """
        end = "here" if self.lattice.step.others.graph else AXIS.text
        body: list[ir.Statement] = []
        for function in functions:
            loop = function.loop
            seeds = ir.real(ir.fixed(HERE), ir.fixed(f"[g[{end}] for g in gathered_bar]"))
            body += [*self._bonds(loop), seeds, *self._reads(function), *self._added_cotangents(loop)]
        parameters = (_source(functions[0]), "x", "gathered_bar", *_TRANSPOSED)
        return replace(functions[0], name=name, parameters=parameters, body=(*body, ir.Return(BAR)))

    def _transposed_sums(self, function: ir.Function, source: ir.Value) -> Iterator[ir.Statement]:
        """Yield the call that turns cotangents of sums over bonds or pairs into cotangents of the state. Yield nothing
        if ``function`` reads no sums.
        """
        for s in function.body:
            if isinstance(s, ir.GatherSums):
                stores = [c for c in function.loop.stores if c.array.storage is Storage.SUM_COTANGENT]
                values = {c.array.number: c.value for c in stores}
                listed = (ir.Called("filled", (values.get(k, ir.Constant(0.0)),), SITES) for k in range(s.count))
                rest = (BAR, SITES, ir.fixed("coef_bar"), ir.fixed("parameters_bar"))
                called = f"_{transposed_sums_name(s.functions[0])}"
                yield ir.Assign(BAR, ir.Called(called, (source, X, ir.Listed(tuple(listed)), *rest)))

    def _added_cotangents(self, loop: ir.Loop) -> Iterator[ir.Statement]:
        """Yield the statements that add contributions to cotangents. A contribution is added at the site whose value
        was read.
        """
        for s in loop.body:
            match s:
                case ir.Reduce(source, number, name, value):
                    into = ir.entry(ir.fixed("coef_bar"), number)
                    into = into if source == "coef" else ir.entry(ir.fixed("parameters_bar"), name)
                    yield ir.Assign(into, ir.Called("sum", (), self._everywhere(loop, value)), adds=True)
                case ir.Store(array, value, end="bond"):
                    place = ir.entry(ir.fixed("parameters_bar"), array.name)
                    yield ir.Call("add.at", (place, BOND, value), NP)
                case ir.Store(array, value) if array.storage in (Storage.COTANGENT, Storage.START_COTANGENT):
                    into = ir.entry(ir.fixed(_ARRAYS[array.storage]), array.number)
                    if array.number >= self.lattice.program.dimension:
                        into = ir.entry(ir.fixed("parameters_bar"), array.name)
                    yield ir.Assign(into, self._returned(loop, s, value), adds=True)

    def _returned(self, loop: ir.Loop, s: ir.Store, value: ir.Value) -> ir.Value:
        """Return a contribution to a cotangent. The contribution is an array over the sites whose values were read.

        If the values were read at an offset, the array is shifted by this offset. If they were read at an end of bonds
        or pairs, the contributions to each site are summed over its bonds or pairs.
        """
        if s.end and loop.kind == "bonds":
            return ir.Called("summed", (value, ir.fixed("here" if s.end == "a" else "there")), SITES)
        if s.end:
            axis = ir.fixed(f"axis={1 if s.end == 'a' else 0}")
            return ir.Called("sum", (axis,), self._everywhere(loop, value))
        if any(s.offset):
            return ir.Called("returned", (value, *map(ir.Constant, s.offset)), SITES)
        return value

    def _everywhere(self, loop: ir.Loop, value: ir.Value) -> ir.Value:
        """Return a value as an array over all sites, bonds or pairs; the value may be a single number."""
        match loop.kind:
            case "bonds":
                return ir.Called("broadcast_to", (value, ir.Member(ir.fixed("here"), "shape")), NP)
            case "pairs":
                return ir.Called("_apart", (value, SITES))
        return ir.Called("filled", (value,), SITES)

    # ---- reads

    def _sums(self, function: ir.Function) -> Iterator[ir.Statement]:
        """Yield the statement that computes the sums over bonds or pairs that a function reads."""
        for s in function.body:
            if isinstance(s, ir.GatherSums):
                yield ir.real(ir.fixed("gathered"), self._sums_value(function, s))

    def _sums_value(self, function: ir.Function, s: ir.GatherSums) -> ir.Value:
        varied = (V,) if "varied" in function.parameters else ()
        source: ir.Value = ir.fixed("parameters" if function.role.is_observable else "coef")
        if function.role.is_stage or function.role.is_transposed_stage:
            source = ir.Member(SITES, "parameters")
        called = f"_{sums_name(s.functions[0])}"
        if not self.lattice.step.relative or function.role.is_observable:
            return ir.Called(called, (source, X, *varied, SITES))
        placed = (ir.Called("_placed", (SITES, array)) for array in (X, *varied))
        sums = ir.Called(called, (source, *placed, SITES))
        return ir.Called("_joined", (SITES, varied[0] if varied else X, sums))

    def _bonds(self, loop: ir.Loop) -> Iterator[ir.Statement]:
        if loop.kind == "bonds":
            which = (ir.fixed(repr(loop.end)), ir.fixed(repr(loop.chosen)))
            yield ir.Unpack(("here", "there", "bond"), ir.Called("bonds", which, SITES))

    def _summed(self, s: ir.Store, selection: ir.Selection) -> ir.Value:
        """Return the sum, the maximum or the minimum of a value over the bonds or pairs of each site."""
        graph = self.lattice.step.others.graph
        if s.extreme:
            choose = ir.fixed({"max": "np.maximum", "min": "np.minimum"}[s.extreme])
            start = limit(s.extreme, "np.inf")
            if graph:
                return ir.Called("extreme", (choose, start, s.value, ir.fixed("here")), SITES)
            return ir.Called("_extreme_of_others", (choose, start, s.value, SITES))
        if graph:
            return ir.Called("summed", (s.value, ir.fixed("here")), SITES)
        if selection.massive:
            return ir.Called("_over_sources", (s.value, SITES, ir.Constant(selection.first)))
        return ir.Called("_over_others", (s.value, SITES))

    def _reads(self, function: ir.Function) -> Iterator[ir.Statement]:
        """Yield the lowered declarations of a function: first those before its loop, then those inside its loop."""
        for s in (*function.body, *function.loop.body):
            match s:
                case ir.Declare(items=((name, value),)):
                    load = isinstance(value, ir.Load) and value.array.storage in _READ_IN_PLACE
                    yield replace(
                        s, items=((name, self._value(function, value)),), in_place=load or isinstance(value, _IN_PLACE)
                    )

    def _value(self, function: ir.Function, value: ir.Value) -> ir.Value:
        match value:
            case ir.Coefficient(k):
                return ir.entry(ir.fixed("coef"), k)
            case ir.SystemParameter(name):
                return ir.entry(ir.fixed("parameters"), name)
            case ir.Time():
                return ir.Member(SITES, "t")
            case ir.BondParameter(_, name):
                return ir.Entry(ir.entry(ir.Member(SITES, "parameters"), name), BOND)
            case ir.Inside(_, bounds):
                return ir.Called("present", tuple(ir.Constant(k) for pair in bounds for k in pair), SITES)
            case ir.HasColour():
                return ir.Called("chosen", (), SITES)
            case ir.OnSeam(_, colour, offset):
                return ir.Called("begins", (ir.fixed("window"), *map(ir.Constant, (colour, *offset))), SITES)
            case ir.Load(array, offset, end):
                if function.role.is_energy and array.storage is Storage.SUM:
                    return next(self._sums_value(function, s) for s in function.body if isinstance(s, ir.GatherSums))
                loaded = self._load(array, offset, end)
                others = function.loop.selection
                if end == "b" and others.massive:
                    first = others.first or ""
                    loaded = ir.Entry(loaded, ir.fixed(f"{first}:sites.massive"))
                return loaded
        return value

    def _load(self, array: ir.Array, offset: Sequence[int], end: str) -> ir.Value:
        """Return the values of a field: at all sites, shifted by an offset, or at one end of all bonds or pairs."""
        fields, increments = self.lattice.program.coordinates, self.lattice.step.sites.increments
        storage, number = ir.fixed(_ARRAYS.get(array.storage, array.name)), ir.Constant(array.number)
        whole: ir.Value = ir.Entry(storage, number)
        if array.storage is Storage.STATE and array.name in increments:
            whole = ir.entry(ir.Member(SITES, "dw"), increments.index(array.name))
        elif array.storage is Storage.STATE and array.name in self.lattice.derived:
            whole = ir.Member(SITES, self.lattice.derived[array.name])
        elif array.storage is Storage.STATE and array.name not in fields:
            whole = ir.entry(ir.Member(SITES, "parameters"), array.name)
        if end and self.lattice.step.others.graph and array.storage is not Storage.SEED:
            return ir.Entry(whole, ir.fixed("here" if end == "a" else "there"))
        if end == "a" and array.storage is not Storage.SEED:
            return ir.Entry(whole, AXIS)
        return ir.Called("shifted", (whole, *map(ir.Constant, offset)), SITES) if any(offset) else whole


def identical(functions: Sequence[ir.Function]) -> Iterator[ir.Function]:
    """Yield the functions. If a function has the same body as an earlier one, the body is replaced by a call of the
    earlier function.
    """
    first: dict[ir.Block, ir.Function] = {}
    for function in functions:
        known = first.setdefault(function.body, function)
        if known is function:
            yield function
        else:
            plain = tuple(p for p in function.parameters if "=" not in p)
            called = ir.Called(f"_{known.name}", tuple(map(ir.fixed, function.parameters)))
            yield replace(function, parameters=plain, body=(ir.Return(called),))


def _split(stores: Sequence[ir.Store]) -> tuple[list[ir.Store], list[ir.Store]]:
    """Return two lists: the stores that assign, and the stores that add."""
    return [s for s in stores if not s.adds], [s for s in stores if s.adds]


def _source(function: ir.Function) -> str:
    return "coef" if "coef" in function.parameters else "parameters"


def _copied(name: ir.Name, value: ir.Value) -> Iterator[ir.Statement]:
    yield ir.real(name, ir.Called("copy", (), value))


def _unless_beside(loop: ir.Loop, unchanged: ir.Value) -> Iterator[ir.Statement]:
    """Yield the first statement of a sweep over boundary seams. If the lattice has no seams, the statement returns the
    values unchanged. Lattices have no seams if their sizes are multiples of the periods of the colours.
    """
    if loop.selection.window is not None:
        beside = ir.Called("any", (), ir.Member(SITES, "beside"))
        yield ir.If(ir.Prefix("not", beside), (ir.Return(unchanged),))


def _chosen(selection: ir.Selection, new: ir.Value, old: ir.Value) -> ir.Value:
    """Return an array that is ``new`` at the sites of a selection, and ``old`` at all other sites."""
    if selection.window is not None:
        return ir.Select(ir.Member(SITES, "beside"), new, old)
    if selection.first:
        return ir.Called("where", (ir.Member(SITES, "orbiting"), new, old), NP)
    colour = ir.Constant(None) if selection.colour is None else COLOUR
    if selection.inside:
        return ir.Called("inside", (colour, new, old), SITES)
    return new if selection.colour is None else ir.Called("coloured", (COLOUR, new, old), SITES)


def _argument(selection: ir.Selection) -> tuple[str, ...]:
    """Return the parameter that selects the sites of a sweep, with its default; () if the sweep updates all sites."""
    if selection.window is not None:
        return (f"window={selection.window}",)
    return () if selection.colour is None else (f"colour={selection.colour}",)
