"""Coordinates, parameters and definitions: the names of a spec, and the expressions that use them."""

# `return reader.error(…)` reports and returns None, the value of what has an error.
# mypy: disable-error-code="func-returns-value"

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from typing import Any

from phigen.spec.grammar import CONSTANTS, Scope, constant, names_in, parse
from phigen.spec.kinds import Reader
from phigen.spec.model import Parameter
from phigen.spec.names import ARGUMENT_HINT, ARGUMENTS, SPEC_FUNCTIONS
from phigen.spec.problems import did_you_mean, shown
from phigen.spec.yaml_source import Node, Scalar
from phigen.symbolic.expression import Expression, symbol, symbols_of

Raw = Mapping[str, Any]
NOTHING = Scope({})


@dataclass
class Declarations:
    """The declared names, and parsing with them.

    ``incomplete`` says that some names could not be read: unknown names then go unreported, since they may
    be the ones that are missing.
    """

    reader: Reader
    coordinates: tuple[str, ...] = ()
    parameters: dict[str, Parameter] = field(default_factory=dict)
    definitions: dict[str, Expression] = field(default_factory=dict)
    varying: set[str] = field(default_factory=set)  # definitions that depend on coordinates
    incomplete: bool = False
    nodes: dict[str, Scalar] = field(default_factory=dict)  # where each name is declared
    within: tuple[Any, ...] = ("poisson",)  # the path of keys to the Poisson structure that is being read
    refused: dict[str, tuple[str, str]] = field(default_factory=dict)  # names that mean nothing there: message, hint

    # --- scopes

    def scope(self, extra: Mapping[str, Expression] | None = None) -> Scope:
        """Everything declared: for functions on phase space."""
        names = {n: symbol(n) for n in (*self.coordinates, *self.parameters)}
        return Scope(names | self.definitions | dict(extra or {}), self.refused, open=self.incomplete)

    def constants(self, what: str, extra: Mapping[str, Expression] | None = None) -> Scope:
        """Parameters and what depends on them alone; ``what`` says for what in the message about others."""
        names = {n: symbol(n) for n in self.parameters}
        names |= {n: e for n, e in self.definitions.items() if n not in self.varying}
        refused = {n: (f"{what} must not depend on the coordinate {n!r}", "") for n in self.coordinates}
        refused |= {n: (f"{what} must not depend on coordinates, as {n!r} does", "") for n in self.varying}
        return Scope(names | dict(extra or {}), refused | self.refused, open=self.incomplete)

    def numbers(self) -> Scope:
        """No declared name at all: for defaults and initial values."""
        declared = (*self.coordinates, *self.parameters, *self.definitions)
        return Scope({}, {n: (f"expected a number; {n!r} stands for something that varies", "") for n in declared})

    def inside(self, within: tuple[Any, ...], coordinates: tuple[str, ...], message: str) -> Declarations:
        """What can be used in a structure that has other coordinates; ``message`` begins the refusal of others."""
        lost = [c for c in self.coordinates if c not in coordinates]
        gone = {n for n, e in self.definitions.items() if any(s in lost for s in symbols_of(e))}
        return replace(
            self,
            within=within,
            coordinates=coordinates,
            definitions={n: e for n, e in self.definitions.items() if n not in gone},
            refused=self.refused | {n: (f"{message} {n!r}", "") for n in [*lost, *sorted(gone)]},
        )

    # --- values

    def formula(self, node: Scalar | None, scope: Scope) -> Expression | None:
        """The expression in a scalar, or ``None`` after reporting its errors at their columns."""
        if node is None:
            return None

        def report(message: str, index: int, hint: str = "", *, limit: bool = False) -> None:
            self.reader.problems.add(message, node.at(index), hint, limit=limit)

        if node.plain and re.fullmatch(r"[-+]?\.(inf|Inf|INF|nan|NaN|NAN)", node.text):
            return report(f"{node.text} is not a finite number", 0)
        return parse(node.text, scope, report)

    def number(self, node: Scalar | None, scope: Scope = NOTHING) -> Fraction | None:
        """The value of a constant expression."""
        expression = self.formula(node, scope)
        if node is None or expression is None:
            return None
        value = constant(expression)
        if value is None:
            self.reader.error(node, f"{shown(node.text)} is not a finite real number")
        return value

    def coordinate(self, node: Scalar) -> int | None:
        """The index of a coordinate that is named."""
        if node.text in self.coordinates:
            return self.coordinates.index(node.text)
        if not self.incomplete:
            hint = did_you_mean(node.text, self.coordinates)
            self.reader.error(node, f"{shown(node.text)} is not a coordinate", hint)
        return None

    # --- declaring

    def declare(self, node: Scalar, what: str) -> bool:
        """Whether a name is free; an error is reported if not."""
        name, first = node.text, self.nodes.get(node.text)
        if name in SPEC_FUNCTIONS:
            self.reader.error(node, f"the {what} {name!r} has the name of a function", "choose another name")
        elif first is not None:
            where = f"line {first.location.line}, column {first.location.column}"
            self.reader.error(node, f"the name {name!r} is declared twice; the first is in {where}")
        elif what == "parameter" and name in ARGUMENTS:
            self.reader.error(node, f"a parameter cannot be called {name!r}", ARGUMENT_HINT)
        else:
            self.nodes[name] = node
            return True
        return False


def declare(raw: Raw, reader: Reader) -> Declarations:
    """Read ``coordinates``, ``parameters`` and ``definitions``."""
    declared = Declarations(reader)
    coordinates = raw.get("coordinates")
    declared.incomplete = coordinates is None or None in coordinates
    declared.coordinates = tuple(
        c.text for c in coordinates or () if c is not None and declared.declare(c, "coordinate")
    )
    _declare_parameters(raw, declared)
    _declare_definitions(raw.get("definitions", {}), declared)
    return declared


def _declare_parameters(raw: Raw, declared: Declarations) -> None:
    others = {*declared.coordinates, *raw.get("parameters", {}), *raw.get("definitions", {})} - {*CONSTANTS}
    why = "the value of a parameter is a number"
    numbers = Scope({}, {n: (why, f"what depends on {n!r} can be a definition") for n in others})
    for name, (key, value) in raw.get("parameters", {}).items():
        if not declared.declare(key, "parameter"):
            continue
        options: dict[str, Any] = {"value": value} if isinstance(value, Scalar) else value or {}
        number = declared.number(options.get("value"), numbers)
        positive = options.get("positive", False)
        if number is not None and positive and number <= 0:
            message = f"the parameter {name!r} is positive by declaration, but its value is {options['value'].text}"
            declared.reader.error(options["value"], message)
        # A value with an error is reported; the name stays declared, so that its uses are not reported too.
        value = Fraction(1) if number is None else number
        declared.parameters[name] = Parameter(name, value, positive, options.get("description", ""))


def _declare_definitions(entries: Mapping[str, tuple[Scalar, Scalar | None]], declared: Declarations) -> None:
    sources = {name: node for name, (key, node) in entries.items() if declared.declare(key, "definition")}
    uses = {name: names_in(node.text) if node else [] for name, node in sources.items()}
    coordinates = set(declared.coordinates)
    # Placeholders first: only the members of a cycle, which is an error, meet one.
    names = {**declared.scope().names, **{name: symbol(name) for name in sources}}
    scope = Scope(names, open=declared.incomplete)
    for name in _in_order(uses, entries, declared.reader):
        if any(u in coordinates or u in declared.varying for u in uses[name]):
            declared.varying.add(name)
        expression = declared.formula(sources[name], scope)
        # After an error the name stays declared, so that its uses are not reported too.
        declared.definitions[name] = names[name] = symbol(name) if expression is None else expression


def _in_order(
    uses: Mapping[str, list[str]], keys: Mapping[str, tuple[Scalar, Node | None]], reader: Reader
) -> list[str]:
    """The definitions, each after those it uses; cycles are reported and broken."""
    graph = {name: [u for u in used if u in uses] for name, used in uses.items()}
    while True:
        try:
            return list(TopologicalSorter(graph).static_order())
        except CycleError as error:
            members: list[str] = error.args[1][:-1][::-1]  # each uses the next
            start = members.index(min(members, key=list(graph).index))
            cycle = [*members[start:], *members[:start], members[start]]
            reader.error(keys[cycle[0]][0], f"definitions in a cycle: {shown(' → '.join(cycle), 200)[1:-1]}")
            graph[cycle[0]] = []
