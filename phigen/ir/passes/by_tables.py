"""Lowering by tables: one array contains the fields of all sites, and tables contain the numbers of neighbouring sites.

Functions receive coefficients or parameters, arrays of reals, and the record ``sites``. The runtime of a target fills
the following members of this record:

- ``count``: the number of sites
- ``params``: the parameters, those at sites and at bonds as arrays
- ``t``: the time
- ``near``: for each offset, an array with the number of the neighbour of each site
- ``present``: for each term near open ends, an array that is 1 at sites where the term exists, else 0
- ``coloured``: for each colour, the numbers of its sites
- ``beside``: the numbers of the sites in or near boundary seams
- ``inside``: the numbers of all other sites, as a list for each colour and a list for all colours
- ``colours``: the colour of each site
- ``sums``: a single array: the first sum over bonds or pairs at all sites, then the second sum at all sites, …
- ``dw``: a single array: the increments of the first source of noise at all sites, then those of the second source, …
- an array for each derived value, under its own name; parameters determine these values
- ``massive``: for sums over pairs, the number of sites up to and including the last site with a mass

The runtime also defines the methods ``bonds`` and ``begins`` of ``sites``, and the functions ``fill``, ``placed`` and
``joinSums``. ``templates/js/runtime/sites.mjs`` is a model for other runtimes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes.sites import COUNT, OTHER, SITE, SITES, of_array, over_pairs
from phigen.ir.passes.sums import limit, updates
from phigen.ir.walk import names_in, statements
from phigen.scheme.kernel import Role
from phigen.symbolic.symbols import BEGINS, PRESENT, Symbol

NUMBER, COLOUR = (ir.fixed(name) for name in ("k", "colour"))

#: _ARRAYS has the names of arrays in JavaScript, by kind of storage. _PARAMETERS maps names of parameters to their
#: names in JavaScript, if the two names differ.
_ARRAYS = {ir.Storage.STATE: "x", ir.Storage.VARIATION: "v", ir.Storage.START: "start", ir.Storage.SUM: "sums"}
_PARAMETERS = {"state": "x", "varied": "v"}


def by_tables(function: ir.Function, lattice: LatticeLoops) -> ir.Function:
    """Return the lowered form of a function of a lattice."""
    parameters = tuple(_PARAMETERS.get(p, p) for p in function.parameters)
    if not any(isinstance(s, ir.Store) for s in statements(function.body)):
        return replace(function, parameters=parameters, body=())
    return _Tables(replace(function, parameters=parameters), lattice).lowered()


@dataclass
class _Tables:
    """The lowering of one function.

    ``head`` has the declarations before the loops of the function. ``hoisted`` has the names of the variables declared
    there.
    """

    function: ir.Function
    lattice: LatticeLoops
    head: list[ir.Statement] = field(default_factory=list)
    hoisted: set[str] = field(default_factory=set)

    @property
    def params(self) -> ir.Value:
        """The record of the parameters of the system."""
        return ir.fixed("params") if "params" in self.function.parameters else ir.Member(SITES, "params")

    def lowered(self) -> ir.Function:
        """Return the lowered function."""
        calls: list[ir.Statement] = []
        loops: list[ir.Statement] = []
        for s in self.function.body:
            if isinstance(s, ir.GatherSums):
                calls += self._gather_sums(s)
            elif isinstance(s, ir.Loop):
                loops.append(self._loop(s))
            else:
                self.head += self._lowered(s, ir.Selection())
        counted = [ir.Unpack(("count",), SITES)] if COUNT.symbol in names_in((*self.head, *loops)) else []
        return self.function.with_body(*calls, *counted, *self.head, *loops)

    def _gather_sums(self, s: ir.GatherSums) -> Iterator[ir.Statement]:
        others = [p for p in self.function.parameters if p not in ("coef", "params", "start", "out")]
        role = self.function.role
        source = self.params if role.is_stage or role.is_observable else ir.fixed("coef")
        yield ir.Call("fill", (ir.Constant(0),), ir.Member(SITES, "sums"))
        if not self.lattice.step.relative or role.is_observable:
            yield from (ir.Call(name, (source, *map(ir.fixed, others))) for name in s.functions)
            return
        *arrays, last = map(ir.fixed, others)
        placed = [ir.Called("placed", (array, last)) for array in arrays]
        yield from (ir.Call(name, (source, *placed, last)) for name in s.functions)
        varied = len(arrays) > 1
        first = len(self.lattice.step.relative.axes) if varied else 0
        yield ir.Call("joinSums", (arrays[-1], last, ir.Constant(first)))

    def _loop(self, s: ir.Loop) -> ir.Loop:
        body = tuple(new for inner in s.body for new in self._lowered(inner, s.selection))
        here, chosen = ir.fixed("here"), ir.fixed("chosen")
        if s.kind != "sites":
            self.head.append(ir.Unpack(("sums",), SITES))
            self.head += _cleared(s)
        if s.kind == "pairs":
            return _counted("i", COUNT, (over_pairs(body, s.selection),))
        if s.kind == "bonds":
            bonds = ir.Called("bonds", (ir.Constant(s.end), ir.Constant(s.chosen), *[COLOUR] * bool(s.chosen)), SITES)
            self.head.append(ir.Unpack(("here", "there", "bond"), bonds))
            return _counted(
                "k",
                ir.Member(here, "length"),
                (ir.index(SITE, ir.Entry(here, NUMBER)), ir.index(OTHER, ir.Entry(ir.fixed("there"), NUMBER)), *body),
            )
        sites = _sites_of(s.selection)
        if not sites:
            return ir.Loop("plain", body, "i", ir.Constant(s.selection.first), COUNT)
        self.head.insert(0, ir.Declare(ir.Type.INDICES, ((chosen.symbol, sites),)))
        return _counted("k", ir.Member(chosen, "length"), (ir.index(SITE, ir.Entry(chosen, NUMBER)), *body))

    def _lowered(self, s: ir.Statement, selection: ir.Selection) -> Iterator[ir.Statement]:
        match s:
            case ir.Store(array, value):
                yield from updates(s, self._element(array, SITE), value)
            case ir.Declare(items=((name, ir.Load() as load),)):
                yield from self._neighbour(load)
                in_place = load.array.storage is not ir.Storage.STATE
                yield replace(s, items=((name, self._element(load.array, self._site(load))),), in_place=in_place)
            case ir.Declare(items=((name, value),)):
                yield replace(s, items=((name, self._value(value, selection)),), in_place=_in_place(value))
            case _:
                yield s

    def _value(self, value: ir.Value, selection: ir.Selection) -> ir.Value:
        match value:
            case ir.Coefficient(k):
                return ir.entry(ir.fixed("coef"), k)
            case ir.SystemParameter(name):
                return ir.Member(self.params, name)
            case ir.Time():
                return ir.Member(SITES, "t")
            case ir.BondParameter(_, name):
                return ir.Entry(self._parameter(name), ir.Entry(ir.fixed("bond"), NUMBER))
            case ir.Inside(k):
                return ir.Entry(self._hoisted(Symbol(PRESENT, k), ir.entry(ir.Member(SITES, "present"), k)), SITE)
            case ir.HasColour():
                matches = ir.Binary("==", ir.Entry(ir.Member(SITES, "colours"), SITE), COLOUR)
                return ir.Select(matches, ir.Constant(1), ir.Constant(0))
            case ir.OnSeam(k):
                window = ir.Constant(selection.window or 0)
                return ir.Entry(
                    self._hoisted(Symbol(BEGINS, k), ir.Called("begins", (ir.Constant(k), window), SITES)), SITE
                )
        return value

    def _element(self, array: ir.Array, site: ir.Value) -> ir.Value:
        fields, increments = self.lattice.program.coordinates, self.lattice.step.sites.increments
        if array.storage is not ir.Storage.STATE or array.name in fields:
            whole = ir.fixed(_ARRAYS.get(array.storage, "out"))
            sums = array.storage is ir.Storage.SUM and self.function.role is not Role.GATHER
            return ir.Entry(ir.Member(SITES, "sums") if sums else whole, of_array(site, array.number))
        if array.name in increments:
            increments_array = self._hoisted(Symbol("at", "dw"), ir.Member(SITES, "dw"))
            return ir.Entry(increments_array, of_array(site, increments.index(array.name)))
        if name := self.lattice.derived.get(array.name):
            return ir.Entry(self._hoisted(Symbol("at", name), ir.Member(SITES, name)), site)
        return ir.Entry(self._parameter(array.name), site)

    def _parameter(self, name: str) -> ir.Name:
        """Return the variable for the array of a parameter at sites or bonds, and record its declaration."""
        return self._hoisted(Symbol("at", name), ir.Member(self.params, name))

    def _hoisted(self, name: Symbol, value: ir.Value, kind: ir.Type = ir.Type.ARRAY) -> ir.Name:
        if name not in self.hoisted:
            self.hoisted.add(name)
            self.head.append(ir.Declare(kind, ((name, value),)))
        return ir.Name(name)

    def _site(self, load: ir.Load) -> ir.Value:
        if load.end or not any(load.offset):
            return OTHER if load.end == "b" else SITE
        return ir.Name(Symbol("beside", self.lattice.neighbours.index(load.offset)))

    def _neighbour(self, load: ir.Load) -> Iterator[ir.Statement]:
        """Yield the declaration of the variable with the number of a neighbouring site, unless the variable is declared
        already.
        """
        site = self._site(load)
        if isinstance(site, ir.Name) and site not in (SITE, OTHER) and site.symbol not in self.hoisted:
            number = self.lattice.neighbours.index(load.offset)
            table = self._hoisted(Symbol("near", number), ir.entry(ir.Member(SITES, "near"), number), ir.Type.INDICES)
            self.hoisted.add(site.symbol)
            yield ir.index(site, ir.Entry(table, SITE))


def _counted(variable: str, end: ir.Value, body: ir.Block) -> ir.Loop:
    return ir.Loop("plain", body, variable, ir.Constant(0), end)


def _cleared(loop: ir.Loop) -> Iterator[ir.Statement]:
    """Yield the calls that set maxima and minima to their initial values ∓∞. There are no calls for sums: the code that
    calls the generated function sets sums to 0.
    """
    for s in loop.stores:
        if s.extreme:
            ends = of_array(ir.Constant(0), s.array.number), of_array(ir.Constant(0), s.array.number + 1)
            yield ir.Call("fill", (limit(s.extreme, "Infinity"), *ends), ir.fixed("sums"))


def _sites_of(selection: ir.Selection) -> ir.Value | None:
    """Return the list of the sites that a sweep updates; None if the sweep updates all sites."""
    if selection.window is not None:
        return ir.Member(SITES, "beside")
    if selection.colour is None and not selection.inside:
        return None
    colour = ir.Constant("all" if selection.colour is None else selection.colour)
    return ir.Entry(ir.Member(SITES, "inside" if selection.inside else "coloured"), colour)


def _in_place(value: ir.Value) -> bool:
    return isinstance(value, ir.Inside | ir.HasColour | ir.OnSeam)
