"""Lattices in JavaScript: kernels as loops over the sites, and the tables that the runtime goes by."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import VARIED, Ends, Gather, Sweep, Sweeps
from phigen.symbolic.symbols import BEGINS, CHOSEN, COEFFICIENT, GATHERED, INITIAL, PRESENT, VARIATION, Symbol
from phigen.targets import lattice
from phigen.targets.code import lower
from phigen.targets.features import switches
from phigen.targets.header import facts
from phigen.targets.js.printing import LANGUAGE, camel, comment, key, properties, wrapped
from phigen.targets.names import Scope
from phigen.targets.rendering import render

#: What the loops call their own.
_OWN = frozenset({"coef", "params", "start", "x", "v", "sites", "count", "near", "present", "sums", "out"})
_OWN |= {"i", "j", "k", "bond", "here", "there", "colour", "colours", "chosen"}

#: A space at which no line is broken.
_FIXED = "\N{NO-BREAK SPACE}"

#: Of the sites a and b of a bond or a pair.
_INDEX = {"a": "i", "b": "j"}

#: The runtime of lattices; after it what makes a step.
MODULES = ("errors", "march", "lattice", "sites")


def modules(program: Program, step: Sweeps) -> list[str]:
    """The modules of the runtime."""
    noise = ["philox", "site_noise"] if program.noise else []
    if step.equation is None:
        return [*MODULES, *noise, "flows"]
    return [*MODULES, *noise, "sweeps", "krylov", *["site_tangent"] * program.extras.tangent]


def features(program: Program, step: Sweeps) -> dict[str, bool]:
    """The switches of the runtime, those of lattices among them."""
    return switches(program) | lattice.switches(step) | {"SPLIT": step.equation is None}


def tables(program: Program, step: Sweeps) -> str:
    """What is printed of the system beside its kernels."""
    found = _tables(program, step)
    listed = [render("js", "lattice.mjs", _facts(program, step))]
    listed += [render("js", f"{part}.mjs", found) for part in ("lattice_tables", "lattice_schedule")]
    lines = "\n".join(listed).splitlines()
    broken = [wrapped(line, "") if line.startswith("const") else [line] for line in lines]
    return "\n".join(part for parts in broken for part in parts).replace(_FIXED, " ")


def _facts(program: Program, step: Sweeps) -> dict[str, object]:
    """What users see."""
    return {
        "contents": [f" * {line}".rstrip() for line in _contents(program, step)],
        **facts(program, json.dumps, key),
        **lattice.tables(program, step, json.dumps),
        "kinds": json.dumps(step.casimir_kinds),
        "properties": properties(program.parameters),
    }


def _tables(program: Program, step: Sweeps) -> dict[str, object]:
    """What the runtime goes by."""
    return {
        **lattice.tables(program, step, json.dumps),
        "near": json.dumps(_near(step)),
        "bounds": json.dumps([lattice.bounds(w) for w in lattice.weights(program, step)]),
        "wanted": json.dumps([[s.key[0], list(s.key[1:])] for s in lattice.begins(step)]),
        "sums": step.sums,
        "unit": "stages" if step.equation else "flows",
        "schedule": f"[{', '.join(f'[{part},{_FIXED}{row}]' for part, row in step.schedule.flows)}]",
        "flows": f"[{', '.join(map(_listed, step.parts))}]",
        "tangents": f"[{', '.join(map(_listed, step.tangents))}]" if step.tangents else "",
    }


def kernels(program: Program, step: Sweeps) -> Iterator[str]:
    """All kernels as loops over sites."""
    printed = _Printed(program, step)
    for sweep in step.sweeps:
        yield from (printed.gathering(ends, "coef") for ends in _ends(sweep.gather))
        yield printed.sweep(sweep)
    for gather in (step.others.energy, step.others.field, step.others.varied):
        yield from (printed.gathering(ends, "params") for ends in gather.ends)
    if step.equation:
        yield from (printed.of_equation(kernel) for kernel in step.equation.kernels)
    yield from (printed.seen(kernel) for kernel in program.observables.kernels)


def _near(step: Sweeps) -> list[tuple[int, ...]]:
    """The offsets of all neighbours."""
    return sorted({offset for _, offset in step.sites.places.values() if any(offset)})


def _contents(program: Program, step: Sweeps) -> list[str]:
    sizes = ", ".join(f"N_{axis}" for axis in step.sites.axes)
    given = [
        "x0: [...]",
        *(["t0"] if program.time else []),
        f"sizes: [{sizes}]",
        *(["bonds: [...]"] if step.others.graph else []),
        "params: { ... }",
    ]
    how = "stages, each solved by sweeps over the sites" if step.equation else "flows of parts of H"
    return [
        f"import {{ Solver, StepError }} from './{program.name}.mjs';",
        f"const solver = new Solver({{ {', '.join(given)} }});",
        "solver.integrate(h, steps); then solver.x, .field(name), .t, .hamiltonian(), .density(), .casimirs()",
        "",
        f"Contents: the system, with its kernels; the class Solver; the sites; the step, by {how}.",
    ]


def _listed(part: Sequence[Sweep]) -> str:
    return f"[{', '.join(camel(sweep.kernel.name) for sweep in part)}]"


class _Printed:
    """Kernels of one program as functions."""

    def __init__(self, program: Program, step: Sweeps) -> None:
        self.program, self.step = program, step
        self.graph = step.others.graph
        self.names = {camel(kernel.name) for kernel in step.kernels}
        self.near, self.weights = _near(step), lattice.weights(program, step)

    def sweep(self, sweep: Sweep) -> str:
        """A sweep: it changes x in place, since it reads elsewhere only what stands still; its derivative changes v."""
        varied = sweep.kernel.name.startswith("tangent")
        more = ["v"] * varied
        body = _Body(self, sweep.kernel, sweep.gather.names if sweep.gather else (), window=sweep.window or 0)
        changed = "v" if varied else "x"
        stores = [(self._entry(changed, sweep.moved[s.index]), body.show(s.value)) for s in body.code.stores]
        if len(stores) > 1:
            body.lines += [f"const change{k} = {value};" for k, (_, value) in enumerate(stores)]
            stores = [(place, f"change{k}") for k, (place, _) in enumerate(stores)]
        body.lines += [f"{place} += {value};" for place, value in stores]
        by_colour = ["colour"] if self.step.by_colour else []
        given = ", ".join(["coef", "x", *more, "sites", *by_colour])
        before = [f"{camel(e.kernel.name)}({given});" for e in _ends(sweep.gather)]
        clear = ["sites.sums.fill(0);"] if before else []
        loop = "for (let i = 0; i < count; i++) {"
        chosen = self._chosen(sweep)
        if chosen:
            body.lines.insert(0, "const i = chosen[k];")
            body.first.insert(0, f"const chosen = {chosen};")
            loop = "for (let k = 0; k < chosen.length; k++) {"
        arguments = ["coef", "x", *more, "sites", *by_colour]
        return self._function(sweep.kernel, arguments, [*clear, *before], body, [loop])

    def _chosen(self, sweep: Sweep) -> str:
        """The list of the sites where a sweep is made; nothing where that is at all."""
        if sweep.window is not None:
            return "sites.beside"
        if self.step.sites.colours == 1 or (sweep.colour is None and not sweep.inside):
            return ""
        colour = "all" if sweep.colour is None else sweep.colour
        return f"sites.{'inside' if sweep.inside else 'coloured'}[{json.dumps(colour)}]"

    def of_equation(self, kernel: Kernel) -> str:
        """A kernel of the equation of a stage, at the y that is its x."""
        starts, varied = kernel.name in ("relax", "slope", "side"), kernel.name in VARIED
        arguments = ["coef", *["start"] * starts, "x", *["v"] * varied]
        gather = self.step.others.varied if varied else self.step.others.field
        body = _Body(self, kernel, gather.names)
        body.lines += [f"{self._entry('out', s.index)} = {body.show(s.value)};" for s in body.code.stores]
        before = self._forces("sites.params", gather, ", v" * varied) if kernel.inputs["gathered"] else []
        return self._function(kernel, [*arguments, "sites", "out"], before, body)

    def seen(self, kernel: Kernel) -> str:
        """A kernel that fills arrays over the sites."""
        partners = self.step.others
        body = _Body(self, kernel, partners.field.names)
        body.lines += [f"{self._entry('out', s.index)} = {body.show(s.value)};" for s in body.code.stores]
        before: list[str] = []
        if kernel.name == "vector_field" and partners.field.names:
            before = self._forces("params", partners.field)
        if kernel.name == "energy" and partners.energy.names:
            before = ["sites.sums.fill(0);"]
            before += [f"{camel(e.kernel.name)}(params, x, sites);" for e in partners.energy.ends]
            body.lines.append("out[i] += 0.5 * sites.sums[i];")
        return self._function(kernel, ["params", "x", "sites", "out"], before, body)

    def gathering(self, ends: Ends, first: str) -> str:
        """What bonds or pairs add up at each site."""
        body = _Body(self, ends.kernel, (), "sites.params" if first == "coef" else "params")
        body.lines += [f"{self._entry('sums', s.index)} += {body.show(s.value)};" for s in body.code.stores]
        by_colour = ["colour"] if first == "coef" and self.step.by_colour else []
        body.first.append("const { sums } = sites;")
        if self.graph:
            chosen = json.dumps(ends.chosen) + (", colour" if ends.chosen else "")
            body.first.append(f"const {{ here, there, bond }} = sites.bonds({json.dumps(ends.end)}, {chosen});")
            body.lines[:0] = ["const i = here[k];", "const j = there[k];"]
            loops = ["for (let k = 0; k < here.length; k++) {"]
        else:
            body.lines.insert(0, "if (j === i) continue;")
            loops = ["for (let i = 0; i < count; i++) {", "  for (let j = 0; j < count; j++) {"]
        varied = ["v"] if "varied" in ends.kernel.inputs or ends in self.step.others.varied.ends else []
        return self._function(ends.kernel, [first, "x", *varied, "sites", *by_colour], [], body, loops)

    def _forces(self, params: str, gather: Gather, more: str = "") -> list[str]:
        called = [f"{camel(e.kernel.name)}({params}, x{more}, sites);" for e in gather.ends]
        return ["sites.sums.fill(0);", *called]

    def _entry(self, array: str, field: int) -> str:
        return f"{array}[{at_field('i', field)}]"

    def _function(
        self,
        kernel: Kernel,
        arguments: Sequence[str],
        before: Sequence[str],
        body: _Body,
        loops: Sequence[str] = ("for (let i = 0; i < count; i++) {",),
    ) -> str:
        deep = "  " * len(loops)
        lines = [*comment(kernel.purpose), f"function {camel(kernel.name)}({', '.join(arguments)}) {{"]
        if not body.code.stores:
            return "\n".join([lines[0], *lines[1:-1], lines[-1].removesuffix("{") + "{}"])
        text = "\n".join([*loops, *body.lines])
        declared = ["const { count } = sites;"] if re.search(r"\bcount\b", text) else []
        for statement in (*before, *declared, *body.first):
            lines += wrapped(statement, "  ")
        lines += [f"  {loop}" for loop in loops]
        for statement in body.lines:
            lines += wrapped(statement, f"  {deep}")
        lines += [f"  {'  ' * k}}}" for k in reversed(range(len(loops)))]
        return "\n".join([*lines, "}"])


def _ends(gather: Gather | None) -> tuple[Ends, ...]:
    return gather.ends if gather else ()


def at_field(site: str, field: int) -> str:
    """The place of a field at a site in an array of all fields."""
    return site if field == 0 else f"{site} + count" if field == 1 else f"{site} + {field} * count"


class _Body:
    """The statements of a kernel at a site i, and at another, j: those before the loop are ``first``."""

    def __init__(
        self, printed: _Printed, kernel: Kernel, sums: Sequence[str] = (), params: str = "", window: int = 0
    ) -> None:
        self.printed, self.code, self.window = printed, lower(kernel), window
        self.params = params or ("params" if "params" in kernel.inputs else "sites.params")
        own = _OWN | printed.names | set(LANGUAGE.functions.values()) | {f"change{k}" for k in range(9)}
        self.scope = Scope(LANGUAGE.reserved | own)
        self.show = LANGUAGE.printer(self.scope)
        self.first: list[str] = []
        self.lines: list[str] = []
        self._bound: dict[str, str] = {}
        used = ((array, s) for array, symbols in kernel.inputs.items() for s in symbols if s in self.code.used)
        for array, s in used:
            if array == "t":
                self.first.append(f"const {self.scope[s]} = sites.t;")
            elif isinstance(s, Symbol) and s not in printed.step.sites.places:
                self._bind(s, list(sums))
            else:
                self._read(s)
        show = self.show
        self.lines += [f"const {self.scope[a.target]} = {show(a.value)};" for a in self.code.assignments]

    def _bind(self, s: Symbol, sums: Sequence[str]) -> None:
        fields = self.printed.program.coordinates
        if s.kind == COEFFICIENT:
            self.first.append(f"const {self.scope[s]} = coef[{s.key[0]}];")
        elif s.kind == GATHERED:
            self.scope.bind(s, f"sites.sums[{at_field('i', sums.index(s))}]")
        elif s.kind == CHOSEN:
            self.scope.bind(s, "(sites.colours[i] === colour ? 1 : 0)")
        elif s.kind == BEGINS:
            number = lattice.begins(self.printed.step).index(s)
            self.scope.bind(s, f"{self._array(f'sites.begins({number}, {self.window})', Symbol(BEGINS, number))}[i]")
        elif s.kind == INITIAL:
            self.scope.bind(s, f"start[{at_field('i', fields.index(str(s.key[0])))}]")
        elif s.kind == VARIATION:
            sites, place = self.printed.step.sites, str(s.key[0])
            if place in sites.ends:
                field, end = sites.ends[place]
                site = _INDEX[end]
            else:
                field, offset = sites.places[place]
                site = self._site(offset)
            self.scope.bind(s, f"v[{at_field(site, fields.index(field))}]")
        else:
            number = self.printed.weights.index(s)
            table = self._array(f"sites.present[{number}]", Symbol(PRESENT, number))
            self.scope.bind(s, f"{table}[i]")

    def _read(self, s: str) -> None:
        sites = self.printed.step.sites
        if s in sites.at_bonds:
            self.lines.append(f"const {self.scope[s]} = {self._at(s)}[bond[k]];")
        elif s in sites.ends:
            base, end = sites.ends[s]
            self.lines.append(f"const {self.scope[s]} = {self._value(base, _INDEX[end])};")
        elif s in sites.places:
            base, offset = sites.places[s]
            self.lines.append(f"const {self.scope[s]} = {self._value(base, self._site(offset))};")
        else:
            self.first.append(f"const {self.scope[s]} = {self.params}.{s};")

    def _value(self, base: str, site: str) -> str:
        fields = self.printed.program.coordinates
        if base in fields:
            return f"x[{at_field(site, fields.index(base))}]"
        if base in self.printed.step.sites.increments:
            number = self.printed.step.sites.increments.index(base)
            return f"{self._array('sites.dw', Symbol('at', 'dw'))}[{at_field(site, number)}]"
        return f"{self._at(base)}[{site}]"

    def _at(self, parameter: str) -> str:
        """The array of a parameter at sites or at bonds."""
        return self._array(f"{self.params}.{parameter}", Symbol("at", parameter))

    def _array(self, place: str, name: Symbol) -> str:
        """The name of an array that is got before the loop."""
        if place not in self._bound:
            self._bound[place] = self.scope[name]
            self.first.append(f"const {self._bound[place]} = {place};")
        return self._bound[place]

    def _site(self, offset: tuple[int, ...]) -> str:
        """The neighbour of the site i."""
        if not any(offset):
            return "i"
        number = self.printed.near.index(offset)
        if f"j{number}" not in self._bound:
            table = self._array(f"sites.near[{number}]", Symbol("near", number))
            self._bound[f"j{number}"] = self.scope[Symbol("beside", number)]
            self.lines.append(f"const {self._bound[f'j{number}']} = {table}[i];")
        return self._bound[f"j{number}"]
