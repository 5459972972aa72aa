"""Writer of a spec as YAML, for specs that phigen makes in memory. Reading the text gives the same system."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from phigen.spec import limits
from phigen.spec.model import DEFAULT_ORDER, MatrixForm, Parameter, Run, Spec, Values
from phigen.symbolic.expression import Expression, neg, number, text
from phigen.symbolic.readable import infix, signed_sum

#: A sum is divided into definitions if it has more than _LENGTH characters, or more than _NODES numbers, names and
#: operators. The bounds are nine tenths of the limits for expressions, since parentheses may be added.
_LENGTH, _NODES = limits.EXPRESSION_LENGTH * 9 // 10, limits.EXPRESSION_NODES * 9 // 10
_WIDTH = 110
_PLAIN = re.compile(r"[A-Za-z0-9_+*/(). ^-]*")
_WORDS = frozenset(["null", "Null", "NULL", "~", "true", "True", "TRUE", "false", "False", "FALSE", ""])


def spec_text(spec: Spec) -> str:
    """Return the YAML text of a spec that was made in memory: its name, title, system, order and runs.

    π must be a `MatrixForm`. Other settings of the spec are not written.
    """
    return "\n".join(_Writer(spec).lines()) + "\n"


class _Writer:
    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.definitions: dict[str, str] = {}
        casimirs, invariants = [*spec.casimirs], [*spec.invariants]
        self.taken = {*spec.coordinates, spec.time, *(p.name for p in spec.parameters), *casimirs, *invariants}

    def lines(self) -> Iterator[str]:
        spec = self.spec
        body = [
            *_folded("hamiltonian", self.short("H", spec.hamiltonian)),
            *self._named("casimirs", spec.casimirs, spec.lattice.kinds if spec.lattice else {}),
            *self._named("invariants", spec.invariants, {}),
            *self._driving(),
        ]
        yield from ["phigen: 1", f"name: {spec.name}"]
        if spec.title:
            yield f"title: {_quoted(spec.title)}"
        if spec.lattice:
            boundary = ", ".join(spec.lattice.boundary)
            yield f"lattice: {{axes: [{', '.join(spec.lattice.axes)}], boundary: [{boundary}]}}"
        if spec.time:
            yield f"time: {spec.time}"
        yield from _wrapped("coordinates: [", spec.coordinates, "]")
        if spec.parameters:
            yield "parameters:"
            yield from (f"  {p.name}: {_parameter(p)}" for p in spec.parameters)
        if self.definitions:
            yield "definitions:"
            for name, value in self.definitions.items():
                yield from _indented(_folded(name, value))
        yield from self._poisson()
        yield from body
        if spec.order not in (None, DEFAULT_ORDER):
            yield f"order: {spec.order}"
        if spec.runs:
            yield "runs:"
            for run in spec.runs.values():
                yield from _indented(_run(run))

    def short(self, name: str, expression: Expression) -> str:
        """Return the text of an expression. A sum that is too long is divided: its parts become definitions.

        ``name`` begins the names of these definitions.
        """
        terms = [(t, _size(t) + 1) for t in map(infix, _terms(expression))]
        groups: list[list[str]] = [[]]
        length = nodes = 0
        for term, size in terms:
            length, nodes = length + len(term) + 3, nodes + size
            if groups[-1] and (length > _LENGTH or nodes > _NODES):
                groups.append([])
                length, nodes = len(term) + 3, size
            groups[-1].append(term)
        if len(groups) == 1:
            return _sum(groups[0])
        names = []
        for k, group in enumerate(groups):
            part = f"{name}_part{k}"
            while part in self.taken:
                part += "_"
            self.taken.add(part)
            names.append(part)
            self.definitions[part] = _sum(group)
        return " + ".join(names)

    def _named(self, key: str, formulas: Mapping[str, Expression], kinds: Mapping[str, str]) -> Iterator[str]:
        if not formulas:
            return
        yield f"{key}:"
        for name, e in formulas.items():
            written = self.short(name, e)
            if name in kinds:
                yield f"  {name}: {{value: {_quoted(written)}, at: {kinds[name]}}}"
            else:
                yield from _indented(_folded(name, written))

    def _driving(self) -> Iterator[str]:
        """Yield the YAML lines of damping, forces and noise."""
        spec = self.spec
        if spec.forces.damping is not None:
            yield from _folded("damping", self.short("damping", spec.forces.damping))
        acting = {"covector": spec.forces.covector, "vector": spec.forces.vector}
        if any(acting.values()):
            yield "forces:"
            for kind, entries in acting.items():
                yield from _indented(self._named(kind, entries, {}))
        if spec.noise:
            yield "noise:"
            for name, source in spec.noise.items():
                yield f"  {name}:"
                yield from _indented(_folded("hamiltonian", self.short(name, source.hamiltonian)), 4)
                yield from _indented(_folded("amplitude", self.short(name, source.amplitude)), 4)

    def _poisson(self) -> Iterator[str]:
        form, names = self.spec.poisson, self.spec.coordinates
        assert isinstance(form, MatrixForm)
        rows: dict[str, list[str]] = {}
        for i, row in enumerate(form.entries):
            for j in range(i + 1, len(row)):
                if not row[j].is_zero:
                    rows.setdefault(names[i], []).append(f"{names[j]}: {_quoted(_flat(row[j]))}")
        for (f, g), value in (self.spec.lattice.brackets if self.spec.lattice else {}).items():
            rows.setdefault(f, []).append(f"{_quoted(g)}: {_quoted(_flat(value))}")
        yield "poisson:"
        yield "  brackets:" if rows else "  brackets: {}"
        for name, entries in rows.items():
            yield from _indented(_wrapped(f"{name}: {{", entries, "}"), 4)


def _size(written: str) -> int:
    """Return the size of an expression: how many numbers, names and operators it has. `_NODES` limits this size."""
    return len(re.findall(r"[\w.]+|\*\*|[-+*/]", written))


def _terms(e: Expression) -> Iterator[Expression]:
    stack = [(e, False)]
    while stack:
        node, minus = stack.pop()
        if node.op in ("add", "sub"):
            stack.append((node.args[1], minus != (node.op == "sub")))
            stack.append((node.args[0], minus))
        elif node.op == "neg":
            stack.append((node.args[0], not minus))
        else:
            yield neg(node) if minus else node


def _flat(e: Expression) -> str:
    """Return an expression as text, in which a sum of sums is written without parentheses."""
    return _sum([infix(t) for t in _terms(e)])


def _sum(terms: Sequence[str]) -> str:
    return signed_sum((t.startswith("-"), t.removeprefix("-")) for t in terms)


def _parameter(p: Parameter) -> str:
    value = _values(p.values) if p.values else _number(p.value)
    more = f", {p.bound}: true" * bool(p.bound) + ", small: true" * p.small + (f", at: {p.at}" if p.at != "all" else "")
    more += f", unit: {_quoted(p.unit)}" if p.unit else ""
    return f"{{value: {value}{more}}}" if more else value


def _values(values: Values) -> str:
    if values.listed:
        return f"[{', '.join(map(_number, values.listed))}]"
    formula = _quoted(infix(values.formula)) if values.formula is not None else ""
    if values.random:
        mean = f", mean: {formula}" if formula else ""
        return f"{{random: {values.random}, seed: {values.seed}, scale: {_number(values.scale)}{mean}}}"
    return values.file or formula


def _run(run: Run) -> Iterator[str]:
    yield f"{run.name}:"
    if run.lattice:
        yield f"  sizes: [{', '.join(map(str, run.lattice.sizes))}]"
        yield from _indented(_wrapped("initial: {", [f"{f}: {_values(v)}" for f, v in run.lattice.state.items()], "}"))
    else:
        yield from _indented(_wrapped("initial: [", [_number(v) for v in run.initial], "]"))
    changed = [f"{n}: {_number(v)}" for n, v in run.parameters.items()]
    changed += [f"{n}: {_values(v)}" for n, v in (run.lattice.arrays if run.lattice else {}).items()]
    if changed:
        yield from _indented(_wrapped("parameters: {", changed, "}"))
    yield f"  step: {_number(run.step)}"
    yield f"  steps: {run.steps}" if run.until is None else f"  until: {_number(run.until)}"
    if run.every is not None:
        yield f"  every: {_number(run.every)}"
    elif run.at:
        yield f"  at: [{', '.join(map(_number, run.at))}]"
    elif run.stride != 1:
        yield f"  stride: {run.stride}"
    if run.start:
        yield f"  start: {_number(run.start)}"
    if run.seed:
        yield f"  seed: {run.seed}"


def _number(value: Fraction) -> str:
    """Return a number as a decimal if that is exact and short, else as a quotient."""
    decimal = repr(float(value))
    return str(value) if value.denominator == 1 else decimal if Fraction(decimal) == value else text(number(value))


def _quoted(value: str) -> str:
    return value if _PLAIN.fullmatch(value) and value not in _WORDS and not value.startswith("*") else f'"{value}"'


def _folded(key: str, value: str) -> list[str]:
    if len(key) + len(value) <= _WIDTH:
        return [f"{key}: {_quoted(value) if '[' not in value else value}"]
    lines = textwrap.wrap(value, _WIDTH, break_long_words=False, break_on_hyphens=False)
    return [f"{key}: >-", *(f"  {line}" for line in lines)]


def _wrapped(head: str, items: Sequence[str], tail: str) -> Iterator[str]:
    whole = head + ", ".join(items) + tail
    if len(whole) <= _WIDTH:
        yield whole
        return
    yield head
    line = "  "
    for k, item in enumerate(items):
        piece = item + (", " if k < len(items) - 1 else "")
        if len(line) + len(piece) > _WIDTH and line.strip():
            yield line.rstrip()
            line = "  "
        line += piece
    yield line.rstrip()
    yield tail


def _indented(lines: Iterable[str], by: int = 2) -> Iterator[str]:
    return (" " * by + line for line in lines)
