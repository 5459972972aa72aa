"""Coordinates, time, parameters and definitions: the names of a spec, and the expressions that use them."""

# `return reader.error(…)` reports an error and returns None, which stands for a value that could not be read.
# mypy: disable-error-code="func-returns-value"

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from typing import Any

from phigen.spec.grammar import CONSTANTS, AllowedNames, constant, names_in, parse
from phigen.spec.indices import Indices
from phigen.spec.kinds import Reader
from phigen.spec.model import Lattice, Parameter
from phigen.spec.names import ARGUMENTS, NOISY_ARGUMENTS, SPEC_FUNCTIONS, TIMED_ARGUMENTS, argument_hint
from phigen.spec.problems import counted, did_you_mean, one_of, shown
from phigen.spec.values import values
from phigen.spec.yaml_source import Node, Scalar
from phigen.symbolic.expression import Expression, symbol, symbols_of
from phigen.symbolic.neighbours import ENDS, Neighbours, Offset

Raw = Mapping[str, Any]
NOTHING = AllowedNames({})
RENAME = "choose another name"

#: Largest number of coordinates that a hint lists.
_MOST_LISTED = 12


@dataclass
class Declarations:
    """The declared names of a spec, and methods that parse expressions with these names.

    ``incomplete`` says that some coordinates could not be read. Then an unknown name is not reported, since it may be
    one of these coordinates.
    """

    reader: Reader
    coordinates: tuple[str, ...] = ()
    parameters: dict[str, Parameter] = field(default_factory=dict)
    definitions: dict[str, Expression] = field(default_factory=dict)
    varying: set[str] = field(default_factory=set)  # definitions that depend on coordinates
    time: str = ""  # the name of the time; "" if the spec has none
    dated: set[str] = field(default_factory=set)  # definitions that depend on the time
    noisy: bool = False
    incomplete: bool = False
    nodes: dict[str, Scalar] = field(default_factory=dict)  # where each name is declared
    within: tuple[Any, ...] = ("poisson",)  # the keys on the path to the Poisson structure that is being read
    # names that expressions must not use; each with the message and the hint of the error
    refused: dict[str, tuple[str, str]] = field(default_factory=dict)
    lattice: Lattice | None = None
    indexed: bool = True  # whether expressions may contain names with an index, such as x[i+1]

    # --- lattices

    @property
    def relation(self) -> str:
        """Relation between the sites: ``grid``, ``graph`` or ``pairs``; "" if the spec has no lattice."""
        return self.lattice.relation if self.lattice else ""

    @property
    def neighbours(self) -> Neighbours:
        """The object that creates the symbols of coordinates and parameters at a site and at its neighbours."""
        at_sites = (n for n, p in self.parameters.items() if p.at == "sites")
        return Neighbours((*self.coordinates, *at_sites), self.lattice.axes if self.lattice else ())

    def _at_bonds(self, names: Mapping[str, Expression]) -> dict[str, tuple[str, str]]:
        """Return those of the ``names`` that have values at bonds only, each with an error (message, hint).

        The error is reported if a formula at a site contains the name.
        """
        bond_parameters = {n for n, p in self.parameters.items() if p.at == "bonds"}
        bond_names = (
            {n for n, e in names.items() if bond_parameters.intersection(symbols_of(e))} if bond_parameters else set()
        )
        return {n: (f"{n!r} has a value at every bond, not at sites", "use it in bonds:") for n in bond_names}

    def _counters(self) -> dict[str, tuple[str, str]]:
        """Return the names of indices and sizes, such as i and N_i, each with an error (message, hint).

        The error is reported if a formula that must be the same at all sites contains the name.
        """
        reason = "this expression must be the same for all sites"
        hint = "to use a value for each site, declare a parameter {value: …, at: sites}"
        index_names = [n for i in self.lattice.indices for n in (i, f"N_{i}")] if self.lattice else []
        return {
            n: (f"{reason}; {n!r} depends on the site" if n[:2] != "N_" else f"{reason} and sizes", hint)
            for n in index_names
        }

    def indices(self, names: Mapping[str, Expression], ends: tuple[str, ...] = ()) -> Indices | None:
        """Return the ``names`` that may have an index, because their values differ from site to site.

        An index is an offset on a grid, or one of the ``ends`` of a bond. The result is None if the spec has no
        lattice, or if expressions must not contain an index.
        """
        if self.lattice is None or not self.indexed:
            return None
        neighbours = self.neighbours
        varying = {n: e for n, e in names.items() if neighbours.places(e)}
        hint = "to give a parameter a value at each site, declare it as {value: …, at: sites}"
        same = {n: (f"{n!r} is the same at all sites", hint) for n in names if n not in varying}
        bonds = {
            n: (f"{n!r} belongs to the bond, not to its ends", f"write {n} without an index") for n in same if ends
        }
        at_bonds = {n: bonds.get(n, reason) for n, reason in self._at_bonds(names).items()}
        return Indices(neighbours, varying, {**same, **at_bonds}, ends)

    def bond_scope(self, *, dated: bool = False) -> AllowedNames:
        """Return the names that a formula of a bond or a pair may use.

        A bond or pair has the ends a and b, where a coordinate x has the values ``x[a]`` and ``x[b]``. If ``dated``,
        the formula may use the time: densities of H may depend on the time, but brackets may not.
        """
        scope = self.dated_scope() if dated else self.scope()
        names = scope.names
        indices = self.indices(names, ENDS)
        local = indices.names if indices else {}
        domain = "a pair" if self.relation == "pairs" else "a bond"
        messages = {n: (f"{n!r} has two values, one at each end of {domain}", f"write {n}[a] or {n}[b]") for n in local}
        common_names = {n: e for n, e in names.items() if n not in local}
        common_names |= {n: symbol(n) for n, p in self.parameters.items() if p.at == "bonds"}
        refused = self.refused | self._counters() | messages | ({} if dated else self._timeless())
        return AllowedNames(common_names, refused, open=self.incomplete, indices=indices)

    def site_numbers(self) -> AllowedNames:
        """Return the names for formulas of values at sites: indices (i, counted from 0) and sizes (N_i)."""
        indices = self.lattice.indices if self.lattice and self.relation != "graph" else ()
        names = {n: symbol(n) for i in indices for n in (i, f"N_{i}")}
        return AllowedNames(names, self.numbers().refused)

    def neighbour(self, node: Scalar, ends: tuple[str, ...] = ()) -> tuple[str, Offset] | None:
        """Return the coordinate that a key such as ``x[i+1]`` names, and its offset; None after a reported error."""
        if "[" not in node.text:
            index = self.coordinate(node)
            return None if index is None else (self.coordinates[index], self.neighbours.origin)
        symbols_of_coordinates = {c: symbol(c) for c in self.coordinates}
        scope = AllowedNames(
            {},
            {
                c: (f"{c!r} has two values, one at each end of a bond", f"write {c}[a] or {c}[b]")
                for c in symbols_of_coordinates
            },
        )
        if self.lattice is not None:
            refused = {n: (f"{n!r} is not a coordinate", "") for n in (*self.parameters, *self.definitions)}
            scope = AllowedNames(
                symbols_of_coordinates,
                open=self.incomplete,
                indices=Indices(self.neighbours, symbols_of_coordinates, refused, ends),
            )
        value = self.formula(node, scope)
        if value is None or value.op != "symbol" or self.lattice is None:
            return None
        return self.neighbours.place(value.value)

    # --- scopes

    def scope(self, extra: Mapping[str, Expression] | None = None) -> AllowedNames:
        """Return the names that are allowed in functions on phase space, and in densities of sites. The time is not
        allowed.

        ``extra`` has further names with their expressions.
        """
        names = {n: symbol(n) for n in (*self.coordinates, *self.parameters)}
        names |= {n: e for n, e in self.definitions.items() if n not in self.dated} | dict(extra or {})
        bonds = self._at_bonds(names)
        allowed_names = {n: e for n, e in names.items() if n not in bonds}
        refused = self._timeless() | self.refused | self._counters() | bonds
        return AllowedNames(allowed_names, refused, open=self.incomplete, indices=self.indices(allowed_names))

    def dated_scope(self) -> AllowedNames:
        """Return the names that `scope` returns, and also the time and definitions that depend on the time."""
        scope = self.scope()
        dated = {n: self.definitions[n] for n in self.dated} | ({self.time: symbol(self.time)} if self.time else {})
        bonds = self._at_bonds(dated)
        dated = {n: e for n, e in dated.items() if n not in bonds}
        refused = {n: reason for n, reason in scope.refused.items() if n not in dated} | bonds
        names = {**scope.names, **dated}
        return replace(scope, names=names, refused=refused, indices=self.indices(names))

    def _timeless(self) -> dict[str, tuple[str, str]]:
        """Return the names of the time and of definitions that depend on it, each with an error (message, hint).

        The error is reported if a formula that must not depend on the time contains the name.
        """
        hint = "the time is allowed in H, forces, noise, invariants, observables, sections, stop and exact solutions"
        refused = {
            n: (f"this expression must not depend on the time, but {n!r} does", hint) for n in sorted(self.dated)
        }
        return refused | (
            {self.time: (f"this expression must not depend on the time {self.time!r}", hint)} if self.time else {}
        )

    def constants(self, value_name: str, extra: Mapping[str, Expression] | None = None) -> AllowedNames:
        """Return the names that a constant may use: parameters, and definitions that depend on parameters only.

        ``value_name`` is the name of the constant in messages. ``extra`` has further names with their expressions.
        """
        names = {n: symbol(n) for n in self.parameters}
        names |= {n: e for n, e in self.definitions.items() if n not in self.varying | self.dated}
        bonds = self._at_bonds(names)
        names = {n: e for n, e in names.items() if n not in bonds}
        refused = self._timeless()
        refused |= {n: (f"{value_name} must not depend on the coordinate {n!r}", "") for n in self.coordinates}
        refused |= {
            n: (f"{value_name} must not depend on coordinates, as {n!r} does", "") for n in self.varying
        } | bonds
        return AllowedNames(names | dict(extra or {}), refused | self.refused, open=self.incomplete)

    def dated_constants(self, value_name: str) -> AllowedNames:
        """Return the names that `constants` returns, and also the time and definitions that depend on the time.

        These definitions may depend on parameters too, but not on coordinates.
        """
        scope = self.constants(value_name)
        dated = {n: self.definitions[n] for n in self.dated - self.varying}
        dated |= {self.time: symbol(self.time)} if self.time else {}
        refused = {n: reason for n, reason in scope.refused.items() if n not in dated}
        return replace(scope, names={**scope.names, **dated}, refused=refused)

    def numbers(self) -> AllowedNames:
        """Return the names that defaults and initial values may use: pi and E, but nothing that the spec declares."""
        declared = (*self.coordinates, *self.parameters, *self.definitions, *filter(None, [self.time]))
        hint = "formulas of values may contain indices and sizes, such as i and N_i" if self.lattice else ""
        return AllowedNames({}, {n: (f"expected a number; {n!r} is not constant", hint) for n in declared})

    def inside(self, within: tuple[Any, ...], coordinates: tuple[str, ...], message: str) -> Declarations:
        """Return the declarations for a Poisson structure inside another: a block of a product, or a pull-back.

        ``within`` is the path of keys to the inner structure, and ``coordinates`` are the coordinates of the inner
        structure. If the inner structure uses another coordinate, the error is ``message``, followed by the name.
        """
        excluded = [c for c in self.coordinates if c not in coordinates]
        gone = {n for n, e in self.definitions.items() if any(s in excluded for s in symbols_of(e))}
        return replace(
            self,
            within=within,
            coordinates=coordinates,
            definitions={n: e for n, e in self.definitions.items() if n not in gone},
            refused=self.refused | {n: (f"{message} {n!r}", "") for n in [*excluded, *sorted(gone)]},
        )

    # --- values

    def formula(self, node: Scalar | None, scope: AllowedNames) -> Expression | None:
        """Return the expression that a scalar contains; None if it has errors, which are reported at their columns."""
        if node is None:
            return None

        def report(message: str, index: int, hint: str = "", *, limit: bool = False) -> None:
            line = self.reader.problems.lines[node.location.line - 1 : node.location.line]
            if "never closed" in message and node.plain and any("{" in text[: node.location.column] for text in line):
                hint = hint or "inside { } a comma ends an expression: write an expression with commas between quotes"
            self.reader.problems.add(message, node.at(index), hint, limit=limit)

        if node.plain and re.fullmatch(r"[-+]?\.(inf|Inf|INF|nan|NaN|NAN)", node.text):
            return report(f"{node.text} is not a finite number", 0)
        return parse(node.text, scope, report)

    def number(self, node: Scalar | None, scope: AllowedNames = NOTHING) -> Fraction | None:
        """Return the value of a constant expression; None after errors, which are reported."""
        expression = self.formula(node, scope)
        if node is None or expression is None:
            return None
        value = constant(expression)
        if value is None:
            self.reader.error(node, f"{shown(node.text)} is not a finite real number")
        return value

    def coordinate(self, node: Scalar) -> int | None:
        """Return the index of the coordinate that a scalar names; None after an error, which is reported."""
        if node.text in self.coordinates:
            return self.coordinates.index(node.text)
        if not self.incomplete:
            self.reader.error(node, f"{shown(node.text)} is not a coordinate", self.coordinate_hint(node.text))
        return None

    def coordinate_hint(self, name: str) -> str:
        """Return the hint for a name that is not a coordinate: a similar coordinate, or all if they are few."""
        similar = did_you_mean(name, self.coordinates)
        return similar or (one_of(self.coordinates) if 0 < len(self.coordinates) <= _MOST_LISTED else "")

    # --- declaring

    @property
    def arguments(self) -> frozenset[str]:
        """The names of arguments of the generated functions."""
        return (TIMED_ARGUMENTS if self.time else ARGUMENTS) | (NOISY_ARGUMENTS if self.noisy else frozenset())

    def declare(self, node: Scalar, kind: str) -> bool:
        """Declare a name of this ``kind`` (coordinate, parameter, …); report an error if the name is not free.

        Returns whether expressions may use the name.
        """
        name, first = node.text, self.nodes.get(node.text)
        if name in SPEC_FUNCTIONS:
            self.reader.error(node, f"the {kind} {name!r} has the name of a function", RENAME)
        elif first is not None:
            first_place = f"line {first.location.line}, column {first.location.column}"
            self.reader.error(node, f"the name {name!r} is declared twice; the first is in {first_place}")
        elif kind == "parameter" and name in self.arguments:
            self.reader.error(node, f"a parameter cannot be called {name!r}", argument_hint(name))
            # the name is declared in spite of the error, so that expressions with this name are not reported too
            self.nodes[name] = node
            return True
        elif self.lattice and name in (*self.lattice.indices, *(f"N_{i}" for i in self.lattice.indices)):
            self.reader.error(node, f"the {kind} {name!r} has the name of an index or size of the lattice", RENAME)
        # "bonds" is the name of an argument of generated solvers
        elif self.lattice and self.lattice.graph and name in (self.lattice.graph, "bonds"):
            self.reader.error(node, f"the {kind} {name!r} has the name of the bonds of the lattice", RENAME)
        else:
            self.nodes[name] = node
            return True
        return False


def declare(raw: Raw, reader: Reader) -> Declarations:
    """Return the names that ``coordinates``, ``time``, ``parameters`` and ``definitions`` declare; report errors."""
    declared = Declarations(reader, lattice=_lattice(raw.get("lattice"), reader), noisy="noise" in raw)
    coordinates = raw.get("coordinates")
    declared.incomplete = coordinates is None or None in coordinates
    declared.coordinates = tuple(
        c.text for c in coordinates or () if c is not None and declared.declare(c, "coordinate")
    )
    time = raw.get("time")
    if time is not None and declared.declare(time, "time"):
        declared.time = time.text
    _declare_parameters(raw, declared)
    _declare_definitions(raw.get("definitions", {}), declared)
    return declared


def _lattice(raw: Raw | None, reader: Reader) -> Lattice | None:
    """Return the relation between sites that ``lattice:`` declares; None if the spec has no lattice."""
    if raw is None:
        return None
    nodes = [node for node in raw.get("axes", ()) if node is not None]
    axes = tuple(dict.fromkeys(node.text for node in nodes))
    for index, node in enumerate(nodes):
        if node.text in axes[:index] and nodes[index].text in [n.text for n in nodes[:index]]:
            reader.error(node, f"lattice: the axis {node.text!r} is given twice")
        elif node.text in SPEC_FUNCTIONS or node.text in CONSTANTS:
            reader.error(node, f"lattice: {node.text!r} is the name of a function or a constant", RENAME)
    boundary = raw.get("boundary", "periodic")
    if "boundary" in raw and not axes and ("graph" in raw or "pairs" in raw):
        reader.problems.add("lattice: boundary needs axes", reader.locations["lattice", "boundary"])
    if isinstance(boundary, str):
        boundary = [boundary] * len(axes)
    if len(boundary) != len(nodes) and axes:
        message = (
            f"lattice: {counted(len(boundary), 'boundary', 'boundaries')} for {counted(len(nodes), 'axis', 'axes')}"
        )
        reader.problems.add(
            message,
            reader.locations["lattice", "boundary"],
            "give one word for all axes, or a list with one word for each axis",
        )
    graph = raw.get("graph")
    if not (axes or graph or "pairs" in raw):  # after an error, which was reported when the key was read
        return Lattice(("i",), ("periodic",))
    return Lattice(axes, tuple(b or "periodic" for b in boundary), graph.text if graph else "", "pairs" in raw)


def _declare_parameters(raw: Raw, declared: Declarations) -> None:
    reserved = {
        *declared.coordinates,
        *filter(None, [declared.time]),
        *raw.get("parameters", {}),
        *raw.get("definitions", {}),
    } - {*CONSTANTS}
    hint_text = "the value of a parameter must be a number"
    numbers = AllowedNames({}, {n: (hint_text, f"write what depends on {n!r} under definitions") for n in reserved})
    for name, (key, value) in raw.get("parameters", {}).items():
        if not declared.declare(key, "parameter"):
            continue
        options: dict[str, Any] = {"value": value} if isinstance(value, Scalar) else value or {}
        domain, entry, array = options.get("at", "all"), options.get("value"), None
        _expect_place(name, domain, declared)
        if domain != "all" and not (isinstance(entry, Scalar) and entry.is_numeric):
            number, array = None, values(entry, declared)
        elif entry is not None and not isinstance(entry, Scalar):
            number = declared.reader.problems.add(
                f"the value of the parameter {name!r} must be a number",
                key.location,
                "for a value at each site or bond, add at: sites or at: bonds",
            )
        else:
            number = declared.number(entry, numbers)
        positive, nonnegative = options.get("positive", False), options.get("nonnegative", False)
        if positive and nonnegative:
            declared.reader.error(
                key, f"the parameter {name!r} is positive, so it is nonnegative too", "give only one of them"
            )
        bounded = Parameter(name, Fraction(1), positive, nonnegative=nonnegative)
        if number is not None and bounded.refuses(number):
            message = f"is {bounded.bound} by declaration, but its value is {options['value'].text}"
            declared.reader.error(options["value"], f"the parameter {name!r} {message}")
        # A wrong value was reported. The parameter gets the value 1, so that expressions with it are not reported too.
        value = Fraction(1) if number is None else number
        description, unit = options.get("description", ""), options.get("unit", "")
        is_small = options.get("small", False)
        declared.parameters[name] = Parameter(
            name, value, positive, description, domain, array, unit, is_small, nonnegative
        )


def _expect_place(name: str, domain: str, declared: Declarations) -> None:
    """Report a parameter at sites if there is no lattice, and a parameter at bonds if the lattice has no graph.

    ``domain`` is ``sites``, ``bonds`` or ``all``.
    """
    relations = {"sites": ("grid", "graph", "pairs"), "bonds": ("graph",)}.get(domain)
    if relations and declared.relation not in relations:
        needs = "a lattice with a graph" if domain == "bonds" and declared.relation else "specs with lattice:"
        place = declared.reader.locations["parameters", name, "at"]
        declared.reader.problems.add(f"parameters: at: {domain} is for {needs}", place)


def _declare_definitions(entries: Mapping[str, tuple[Scalar, Scalar | None]], declared: Declarations) -> None:
    sources = {name: node for name, (key, node) in entries.items() if declared.declare(key, "definition")}
    uses = {name: names_in(node.text) if node else [] for name, node in sources.items()}
    coordinates = set(declared.coordinates)
    # At first, the name of each definition stands for a symbol. When the definition has been read, its name stands for
    # its expression. Each definition is read after the definitions that it uses. So symbols of definitions remain in
    # expressions only after an error, such as a cycle of definitions.
    scope = declared.dated_scope()
    names = {**scope.names, **{name: symbol(name) for name in sources}}
    for name in _in_order(uses, entries, declared.reader):
        if any(u in coordinates or u in declared.varying for u in uses[name]):
            declared.varying.add(name)
        if any(u == declared.time or u in declared.dated for u in uses[name]):
            declared.dated.add(name)
        definition_scope = replace(scope, names=names, indices=declared.indices(names))
        expression = declared.formula(sources[name], definition_scope)
        # After an error a symbol stands for the definition, so that expressions with its name are not reported too.
        declared.definitions[name] = names[name] = symbol(name) if expression is None else expression


def _in_order(
    uses: Mapping[str, list[str]], keys: Mapping[str, tuple[Scalar, Node | None]], reader: Reader
) -> list[str]:
    """Return the names of the definitions, sorted so that each comes after the definitions that it uses.

    ``uses`` has the names that the expression of each definition contains. ``keys`` has the key of each definition in
    the file. A cycle is reported; then the first definition of the cycle counts as one that uses no other.
    """
    graph = {name: [u for u in used_names if u in uses] for name, used_names in uses.items()}
    while True:
        try:
            return list(TopologicalSorter(graph).static_order())
        except CycleError as error:
            members: list[str] = error.args[1][:-1][::-1]  # in this order, each definition uses the next one
            start = members.index(min(members, key=list(graph).index))
            cycle = [*members[start:], *members[:start], members[start]]
            reader.error(keys[cycle[0]][0], f"definitions in a cycle: {shown(' → '.join(cycle), 200)[1:-1]}")
            graph[cycle[0]] = []
