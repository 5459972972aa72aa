"""Lattices in C: kernels as loops over the sites of a row, and the tables that the runtime goes by."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.lanes.lowering import Rows
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.steps import Ends, Gather, Partners, Sweep, Sweeps
from phigen.spec.model import Parameter
from phigen.symbolic import functions as elementary
from phigen.symbolic.expression import ONE, substitute
from phigen.symbolic.special import SPECIAL
from phigen.symbolic.symbols import CHOSEN, COEFFICIENT, GATHERED, INITIAL, PRESENT, VARIATION, Symbol, kind_of
from phigen.targets.c import functions
from phigen.targets.c.kernels import function, lane_calls, members, printer
from phigen.targets.c.layout import comment
from phigen.targets.code import Code, lower
from phigen.targets.header import plain
from phigen.targets.names import Scope
from phigen.targets.rendering import render
from phigen.targets.reserved import C_RESERVED

#: What the loops call their own.
_OWN = frozenset({"coef", "params", "row", "from", "to", "out", "apart", "i", "j", "k", "part", "far", "now"})

#: Differences that guesses are extrapolated from, of one stage and of all: more gain little and are arrays over sites.
MOST_DIFFERENCES, MOST_REMEMBERED = 4, 14

#: Diagonals of a matrix beside its own that elimination is for.
MOST_BAND = 64


@dataclass(frozen=True)
class Layout:
    """Where things are: lines are rows beside a row, by their offsets; halo the sites that are copied beside it."""

    step: Sweeps
    lines: tuple[tuple[int, ...], ...]
    halo: int
    weights: tuple[str, ...]
    arrays: tuple[str, ...]

    def line(self, offset: Sequence[int]) -> int:
        """The line of a neighbour."""
        return self.lines.index(tuple(offset[:-1]))

    @property
    def colour_step(self) -> int:
        """The distance in a row from a site to the next of its colour."""
        sites = self.step.sites
        return next(k for k in range(1, sites.colours + 1) if k * sites.weights[-1] % sites.colours == 0)

    @property
    def reach(self) -> int:
        """How far the equation of a stage reaches, of a lattice with one axis."""
        relax = self.step.equation.relax if self.step.equation else None
        places = [self.step.sites.places[s] for s in relax.inputs["site"]] if relax else []
        return max((abs(offset[-1]) for f, offset in places if f not in self.step.sites.parameters), default=0)

    @property
    def band(self) -> int:
        """Diagonals beside that of its matrix, site by site; 0 where it is not solved by elimination."""
        equation, sites = self.step.equation, self.step.sites
        if not equation or not equation.slope or len(sites.axes) > 1:
            return 0
        band = (self.reach + 1) * len(equation.relax.roots) - 1
        return band if band <= MOST_BAND else 0

    @property
    def partners(self) -> Partners:
        """Bonds or pairs; nothing where there are none."""
        return self.step.partners or Partners(Gather((), ()), Gather((), ()))

    @property
    def graph(self) -> bool:
        """Whether bonds are given at run time."""
        return self.partners.graph


def layout_of(program: Program, step: Sweeps) -> Layout:
    """The layout of a lattice."""
    sites = step.sites
    offsets = [offset for _, offset in sites.places.values()]
    lines = dict.fromkeys([(0,) * (len(sites.axes) - 1), *sorted({o[:-1] for o in offsets})])
    used = (w for kernel in _at_sites(program, step) for w in kernel.inputs["present"])
    weights = dict.fromkeys(w for w in used if kind_of(w) == PRESENT)
    halo = max((abs(o[-1]) for o in offsets), default=0)
    return Layout(step, tuple(lines), halo, tuple(weights), (*program.coordinates, *sites.parameters))


def _at_sites(program: Program, step: Sweeps) -> list[Kernel]:
    seen = program.observables
    own = [sweep.kernel for part in step.parts for sweep in part]
    own += step.equation.kernels if step.equation else ()
    return [*own, seen.energy, seen.casimirs, seen.vector_field]


def switches(program: Program, step: Sweeps, layout: Layout) -> dict[str, bool]:
    """The switches of the runtime for lattices."""
    return {
        "OPEN": bool(layout.weights),
        "OPEN_ROWS": step.sites.open[-1],
        "HALO": layout.halo > 0,
        "COLOURS": step.sites.colours > 1,
        "PAIRS": step.partners is not None and not layout.graph,
        "GATHER": step.partners is not None,
        "GRAPH": layout.graph,
        "BY_COLOUR": bool(step.by_colour),
        "BOND_PARAMETERS": bool(step.sites.at_bonds),
        "SITE_PARAMETERS": bool(step.sites.parameters),
        "SERIES": step.equation is not None,
        "STIFF": step.equation is not None and layout.band > 0 and program.offers("recurrences"),
        "BY_HAND": step.is_by_hand and program.offers("by-hand"),
        "ONE_ROW": len(step.sites.axes) == 1,
        "GUESSES": step.equation is not None and program.offers("recurrences"),
    }


def declarations(program: Program, step: Sweeps) -> str:
    """What users see: sizes and parameters."""
    member, layout = members(program), layout_of(program, step)
    listed = [_declared(p, member[p.name]) for p in program.parameters]
    arrays = len(layout.arrays)
    sizes = [
        ("ARRAYS", arrays, "arrays over the sites: fields, then parameters"),
        ("COEFFICIENTS", max(1, step.row * _rows(step)), "numbers that depend on params and h only"),
    ]
    if step.equation:
        stages = len(program.fractions)
        sizes += [("STAGES", stages, "of a step")] if stages > 1 else []
        kept = max(1, min(MOST_DIFFERENCES, MOST_REMEMBERED // stages))
        guesses = switches(program, step, layout)["GUESSES"]
        sizes += [("DIFFERENCES", kept, "that a guess is extrapolated from")] if guesses else []
    if step.partners:
        swept = [sweep.gather for part in step.parts for sweep in part if sweep.gather]
        most = max(len(g.names) for g in (*swept, step.partners.energy, step.partners.field))
        sizes.append(("GATHERED", most, "sums over other sites that are held for each site"))
    if step.sites.at_bonds:
        sizes.append(("BOND_ARRAYS", len(step.sites.at_bonds), "parameters at bonds"))
    values = {
        "NAME": program.name,
        "axes": len(step.sites.axes),
        "axis_names": ", ".join(step.sites.axes),
        "n": program.dimension,
        "order": program.order,
        "casimir_count": len(program.casimirs),
        "version": program.version,
        "sha256": program.about.spec_sha256,
        "coordinates": ", ".join(program.coordinates),
        "casimirs": ", ".join(program.casimirs) or "none",
        "members": listed or [("char unused;", "this system has no parameters")],
        "sizes": sizes,
    }
    return render("c", "lattice.h", values)


def _rows(step: Sweeps) -> int:
    """Rows of coefficients: of a splitting one more, for the last flow of a step and the first of the next together."""
    return len(step.schedule.times) + (0 if step.equation else 1)


def _declared(parameter: Parameter, member: str) -> tuple[str, str]:
    said = plain(parameter.description) or f"default {float(parameter.value)!r}"
    said = said if member == parameter.name else f"{parameter.name}: {said}"
    if parameter.at != "all":
        default = "" if parameter.values else "; NULL for the default at all of them"
        return f"const double *{member};", f"at {parameter.at}: {said}{default}"
    return f"double {member};", said


def model(program: Program, step: Sweeps) -> str:
    """Tables, and what is computed before the steps."""
    member, layout, schedule, sites = members(program), layout_of(program, step), step.schedule, step.sites
    flows = schedule.flows
    joined = schedule.times[flows[0][1]] + schedule.times[flows[-1][1]]
    multiples = [*schedule.multiples, *schedule.multiples[:1]]
    constants = [
        ("HALO", layout.halo, "sites that are copied beside a row"),
        ("LINES", len(layout.lines), "rows that kernels read: the row itself and those beside it"),
        ("ROW", max(1, step.row), "coefficients of one flow"),
        ("ROWS_OF_FLOWS", _rows(step), "rows of coefficients"),
    ]
    if step.equation:
        constants += [("MOST_SWEEPS", step.equation.most_sweeps, "that a stage may take")]
        if switches(program, step, layout)["STIFF"]:
            constants += [("REACH", layout.reach, "sites that y at a site depends on, to each side")]
            constants += [("BAND", layout.band, "diagonals beside that of the matrix of Newton's method")]
    else:
        constants += [
            ("FLOWS", len(flows), "in a step"),
            ("JOINED", len(schedule.times), "the row of the last flow of a step and the first of the next together"),
        ]
    constants += [("WEIGHTS", len(layout.weights), "kinds of terms that open ends take away")] * bool(layout.weights)
    if sites.colours > 1:
        constants += [("COLOUR_COUNT", sites.colours, "colours of sites")]
        constants += [("COLOUR_STRIDE", sites.weights[-1], "what a step along a row adds to the colour")]
    numbers = [p for p in program.parameters if p.at == "all"]
    asked = [
        f"isfinite(params->{member[p.name]})" + f" && params->{member[p.name]} > 0.0" * p.positive for p in numbers
    ]
    arrays = [(member[p.name], p.positive, p.values is not None, p.at) for p in program.parameters if p.at != "all"]
    values = {
        "NAME": program.name,
        "defaults": ", ".join("NULL" if p.at != "all" else repr(float(p.value)) for p in program.parameters) or "0",
        "constants": constants,
        "least": ", ".join(map(str, sites.least)),
        "periods": ", ".join(map(str, sites.periods)),
        "open": ", ".join(str(int(o)) for o in sites.open),
        "lines": ", ".join(_braced([*line, 0]) for line in layout.lines),
        "weights": ", ".join(_braced([_braced(pair) for pair in _bounds(w)]) for w in layout.weights),
        "colours": ", ".join(map(str, sites.weights)) if sites.colours > 1 else "",
        "times": ", ".join(map(repr, [*schedule.times, joined][: _rows(step)])),
        "split": step.equation is None,
        "multiples": ", ".join(map(repr, multiples)) if schedule.multiples else "",
        "parts": ", ".join(str(part + (not step.by_colour)) for part, _ in flows),
        "by_colour": ", ".join(str(int(c)) for c in step.by_colour),
        "part_count": len(step.by_colour),
        "graph": layout.graph,
        "rows": ", ".join(str(row) for _, row in flows),
        "allowed": [*_allowed(asked, arrays)],
        "stages": ", ".join(_braced(step.stage(k, program.coordinates)) for k in range(len(step.parts)))
        if switches(program, step, layout)["BY_HAND"]
        else "",
    }
    prepare = function(program, step.prepare)
    return render("c", "lattice.c", values) + render("c", "lattice_allowed.c", values) + prepare


def _allowed(asked: Sequence[str], arrays: Sequence[tuple[str, bool, bool, str]]) -> Iterator[str]:
    """The statements that return 0 for parameters that are not allowed."""
    if asked:
        yield f"if (!({' && '.join(asked)})) return 0;"
    for member, positive, required, at in arrays:
        if required:
            yield f"if (params->{member} == NULL) return 0;"
        wrong = f"!isfinite(params->{member}[k])" + f" || params->{member}[k] <= 0.0" * positive
        yield f"for (size_t k = 0; params->{member} != NULL && k < {at}; ++k)"
        yield f"    if ({wrong}) return 0;"
    unused = ["params"] * (not asked and not arrays) + ["sites"] * all(at != "sites" for *_, at in arrays)
    if unused:
        yield ", ".join(f"(void){u}" for u in unused) + ";"


def _braced(items: Sequence[object]) -> str:
    return "{ " + ", ".join(map(str, items)) + " }"


def _bounds(weight: str) -> list[tuple[int, int]]:
    """The least and the largest offset of a term along each axis."""
    assert isinstance(weight, Symbol)
    bounds = [int(k) for k in weight.key]
    return list(zip(bounds[::2], bounds[1::2], strict=True))


def sweeps(program: Program, step: Sweeps, rows: Rows) -> str:
    """All kernels as loops over sites, and which of them make which part of H."""
    layout, name, member, calls = layout_of(program, step), program.name, members(program), _functions(program)
    found = [*functions.called(program), *functions.phi_lanes(program, set(rows.near))]
    found += functions.near_rows(program, [f for f in rows.near if f not in SPECIAL])
    near = {**calls, **{f: f"{name}_{f}_{'lane' if f in SPECIAL else 'near'}" for f in rows.near}}
    for k, part in enumerate(step.parts, 1):
        two = any(rows.calls_near(sweep.kernel) for sweep in part)
        found += _part(program, layout, k, part, {"_far": calls, "_near": near} if two else {"": calls})
    seen = program.observables
    found += _partners(program, layout)
    for kernel in (step.equation.relax, step.equation.advance) if step.equation else ():
        forms = {"_far": calls, "_near": near} if rows.calls_near(kernel) else {"": calls}
        found += _of_equation(program, layout, kernel, forms)
    if step.equation and step.equation.slope and switches(program, step, layout)["STIFF"]:
        found += _of_equation(program, layout, step.equation.slope, {"": calls})
    found += [_seen(program, layout, k) for k in (seen.energy, seen.casimirs, seen.vector_field)]
    sites = [p for p in program.parameters if p.at == "sites"]
    numbers = range(1, len(step.parts) + 1)
    values = {
        "NAME": name,
        "arrays": [(member[p.name], layout.arrays.index(p.name), repr(float(p.value))) for p in sites],
        "at_bonds": [
            (member[p.name], step.sites.at_bonds.index(p.name), repr(float(p.value)))
            for p in program.parameters
            if p.at == "bonds"
        ],
        "by_colour": bool(step.by_colour),
        "what": "flow" if step.by_colour else "part",
        "labels": [("default" if k == len(step.parts) else f"case {k}", k) for k in numbers],
    }
    return "\n".join([*found, render("c", "sweeps.c", values)])


def _part(
    program: Program, layout: Layout, k: int, part: Sequence[Sweep], forms: Mapping[str, Mapping[str, str]]
) -> Iterator[str]:
    """The loops of a part of H over rows and their sites, in each form: by different functions."""
    for sweep in part:
        if sweep.gather:
            yield from _gathering(program, layout, sweep.gather, f"const double *coef, const {program.name}_row *row")
    for form, calls in forms.items():
        for sweep in part:
            for kernel, more in _forms(program, sweep.kernel):
                yield _sweep(program, layout, replace(sweep, kernel=kernel), form + more, calls)
    beside = _is_split(program, [sweep.kernel for sweep in part])
    loops = {form: [line for sweep in part for line in _calls(program.name, sweep, form, beside)] for form in forms}
    coloured = layout.step.by_colour
    values = _pieces(program, layout, loops, beside=beside) | {
        "title": f"The flow of H_{k}",
        "head": f"part{k}",
        "more": ", int colour" * bool(coloured),
        "setup": ["at.row.chosen = colour;"] if coloured and coloured[k - 1] else [],
        "moved": [f"s->x[{f}]" for f in sorted({f for sweep in part for f in sweep.moved})] if layout.halo else [],
    }
    values["unused"] = ["colour"] * bool(coloured and not coloured[k - 1]) + ["far"] * (len(forms) == 1)
    yield render("c", "sweep_part.c", values)


def _of_equation(
    program: Program, layout: Layout, kernel: Kernel, forms: Mapping[str, Mapping[str, str]]
) -> Iterator[str]:
    """The loops of a kernel of the equation of a stage over rows and their sites, in each form."""
    name, relaxing, moves = program.name, kernel.name == "relax", kernel.name == "increment"
    for form, calls in forms.items():
        for one, more in _forms(program, kernel):
            yield _at_middle(program, layout, one, form + more, calls, "+=" if moves else "=")
    beside = _is_split(program, [kernel])
    gathers = layout.partners.field.kernels if kernel.inputs["gathered"] else ()
    gathered = [f"{name}_{own.name}(&s->params, &at.row, at.from, at.to);" for own in gathers]
    loops = {form: [*gathered, *_kernel_calls(f"{name}_{kernel.name}{form}", kernel, beside=beside)] for form in forms}
    out = "s->x" if moves else "s->y[1 - now]"
    reads = ["at.row.start = s->x;"] * ("start" in kernel.inputs) + ["at.row.varied = s->v;"] * (
        "varied" in kernel.inputs
    )
    setup = ["at.row.x = s->y[now];", *reads, f"at.row.out = {out};"]
    titles = {"relax": "A sweep, from s->y[now] to the other", "increment": "The end of a stage"}
    values = _pieces(program, layout, loops, beside=beside) | {
        "title": titles.get(kernel.name, "How a sweep follows s->y[now] along s->v, to the other"),
        "head": f"{kernel.name}_rows",
        "more": ", int now" + f", {name}_extent *extent" * relaxing,
        "setup": setup,
        "moved": [f"{out}[{f}]" for f in range(program.dimension)] if layout.halo and (relaxing or moves) else [],
        "after": [f"{name}_measure(s, &at, now, extent);"] if relaxing else [],
        "unused": ["far"] * (len(forms) == 1),
    }
    yield render("c", "sweep_part.c", values)


def _is_split(program: Program, kernels: Sequence[Kernel]) -> bool:
    """Whether sites beside open ends have loops of their own."""
    return program.profile == "fast" and any(_weights(kernel) for kernel in kernels)


def _weights(kernel: Kernel) -> list[str]:
    """The symbols of terms that open ends take away."""
    return [s for s in kernel.inputs["present"] if kind_of(s) == PRESENT]


def _pieces(program: Program, layout: Layout, loops: Mapping[str, list[str]], *, beside: bool) -> dict[str, object]:
    """What the template of loops over pieces of rows wants, for the calls of each form."""
    conditions = ("if (far) ", "else ") if len(loops) > 1 else ("",)
    last = [_bounds(w)[-1] for w in layout.weights]
    return {
        "NAME": program.name,
        "loops": list(zip(conditions, loops.values(), strict=True)),
        "beside": beside,
        "low": max([0, *(-low for low, _ in last)]),
        "high": max([0, *(high for _, high in last)]),
        "skipping": switches(program, layout.step, layout)["BY_HAND"] and len(layout.step.sites.axes) == 1,
        "after": [],
    }


def _functions(program: Program) -> dict[str, str]:
    """What the loops call for any argument: versions for lanes where there are such, else phigen's own or libm's."""
    own = {f: f"{program.name}_{f}" for f in elementary.FUNCTIONS}
    return own | dict(lane_calls(program)) | {f: own[f] for f in SPECIAL}


def _forms(program: Program, kernel: Kernel) -> Iterator[tuple[Kernel, str]]:
    """The kernel for the loop, and for that beside open ends; short code has one for both."""
    if _is_split(program, [kernel]):
        yield _inside(kernel), ""
        yield kernel, "_end"
    else:
        yield kernel, ""


def _inside(kernel: Kernel) -> Kernel:
    """The kernel away from open ends."""
    weights = _weights(kernel)
    values = substitute(kernel.roots, dict.fromkeys(weights, ONE))
    output, others = kernel.outputs[0].name, tuple(s for s in kernel.inputs["present"] if s not in weights)
    return replace(kernel, inputs={**kernel.inputs, "present": others}, outputs=(Output(output, tuple(values)),))


def _calls(name: str, sweep: Sweep, form: str, beside: bool) -> Iterator[str]:
    """The calls of the loops for a piece of a row."""
    for kernel in sweep.gather.kernels if sweep.gather else ():
        yield f"{name}_{kernel.name}(coef, &at.row, at.from, at.to);"
    yield from _kernel_calls(f"{name}_{sweep.kernel.name}{form}", sweep.kernel, beside=beside)


def _kernel_calls(own: str, kernel: Kernel, *, beside: bool) -> Iterator[str]:
    if not beside or not _weights(kernel):
        yield f"{own}(coef, &at.row, at.from, at.to);"
        return
    yield f"{own}_end(coef, &at.row, at.from, second);"
    yield f"{own}(coef, &at.row, second, third);"
    yield f"{own}_end(coef, &at.row, third, at.to);"


def _sweep(program: Program, layout: Layout, sweep: Sweep, form: str, calls: Mapping[str, str]) -> str:
    """A kernel as a loop that changes some fields of the sites of a row."""
    kernel, name = sweep.kernel, program.name
    code = lower(kernel)
    moved, sums = {program.coordinates[i] for i in sweep.moved}, sweep.gather.names if sweep.gather else ()
    names = _Names(program, layout, kernel, code, moved, calls, sums)
    head = _head(program, kernel, code, form)
    body = names.loaded()
    body += [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    stores = [(program.coordinates[sweep.moved[s.index]], names.show(s.value)) for s in code.stores]
    changes = [f"const double change{k} = {value};" for k, (_, value) in enumerate(stores)]
    if len(stores) > 1:
        body += changes
        stores = [(f, f"change{k}") for k, (f, _) in enumerate(stores)]
    body += [f"{names.pointer(f, 0)}[i] {_added(names.scope[f], f in code.used, value)};" for f, value in stores]
    colours = layout.step.sites.colours
    start = f"{name}_first(row, {sweep.colour}, from)" if colours > 1 else "from"
    onward = f"i += {layout.colour_step}" if colours > 1 else "++i"
    return _looped(head, names, body, name, f"ptrdiff_t i = {start}; i < to; {onward}")


def _head(program: Program, kernel: Kernel, code: Code, form: str) -> list[str]:
    """The beginning of a loop over sites."""
    name = program.name
    purpose = {"_far": "the same for large arguments of functions", "_end": "the same beside open ends"}
    said = next((text for key, text in purpose.items() if form.endswith(key)), kernel.purpose)
    head = [*comment(f"/* {plain(said)} */", "")]
    head.append(
        f"static inline void {name}_{kernel.name}{form}("
        f"const double *coef, const {name}_row *row, ptrdiff_t from, ptrdiff_t to)\n{{"
    )
    return head if any(kind_of(s) == COEFFICIENT for s in code.used) else [*head, "    (void)coef;"]


def _at_middle(
    program: Program, layout: Layout, kernel: Kernel, form: str, calls: Mapping[str, str], assign: str
) -> str:
    """A kernel as a loop from y, of which rows are told, into or onto what they call out."""
    code = lower(kernel)
    names = _Names(program, layout, kernel, code, set(), calls, layout.partners.field.names)
    pointers = [names.scope[Symbol("out", f)] for f in program.coordinates]
    head = _head(program, kernel, code, form)
    head += [f"    double *restrict {p} = row->out[{k}] + row->at[0];" for k, p in enumerate(pointers)]
    body = names.loaded()
    body += [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    body += [f"{pointers[s.index]}[i] {assign} {names.show(s.value)};" for s in code.stores]
    return _looped(head, names, body, program.name, "ptrdiff_t i = from; i < to; ++i")


def _added(name: str, read: bool, value: str) -> str:
    """What is added to a field, which may have been read before."""
    return f"= {name} + {value}" if read else f"+= {value}"


def _partners(program: Program, layout: Layout) -> Iterator[str]:
    """What bonds or pairs add to energies, and to what moves sites, from the parameters."""
    arguments = f"const {program.name}_params *params, const {program.name}_row *row"
    for gather in (layout.partners.field, layout.partners.energy):
        yield from _gathering(program, layout, gather, arguments)


def _gathering(program: Program, layout: Layout, gather: Gather, arguments: str) -> Iterator[str]:
    """What all bonds, or pairs with other sites, add up at some sites."""
    for number, ends in enumerate(gather.ends):
        if layout.graph:
            yield _over_bonds(program, layout, ends, arguments, first=number == 0)
        else:
            targets = [f"g{k}" for k in range(len(gather.names))]
            pointers = [f"double *restrict {t} = row->gathered[{k}];" for k, t in enumerate(targets)]
            body = [f"{t}[i] += i == j ? 0.0 : {{{k}}};" for k, t in enumerate(targets)]
            begin = [f"for (ptrdiff_t i = from; i < to; ++i) {' = '.join(f'{t}[i]' for t in targets)} = 0.0;"]
            head = f"{arguments}, ptrdiff_t from, ptrdiff_t to"
            yield _over_pairs(program, layout, ends.kernel, head, [*pointers, *begin], body)


#: The bonds of a site i, by the end that it has; and which of them are passed over.
_BONDS = {"": "row->bonds[i]; k < row->bonds[i + 1]", "a": "row->bonds[i]; k < row->middle[i]",
          "b": "row->middle[i]; k < row->bonds[i + 1]"}  # fmt: skip
_PASSED = {"there": "row->colours[row->other[k]] != row->chosen"}


def _over_bonds(program: Program, layout: Layout, ends: Ends, arguments: str, *, first: bool) -> str:
    """A loop over sites a, in it one over the bonds that they have to sites b."""
    name, kernel = program.name, ends.kernel
    code = lower(kernel)
    names = _Names(program, layout, kernel, code, set(), _functions(program))
    other, own = names.of_pair()
    count = len(code.stores)
    sums = [f"double {', '.join(f'sum{k} = 0.0' for k in range(count))};"]
    values = [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    added = [f"sum{s.index} += {names.show(s.value)};" for s in code.stores]
    out = [f"row->gathered[{k}][i] {'' if first else '+'}= sum{k};" for k in range(count)]
    wanted = "row->colours[i] == row->chosen && " if ends.chosen == "here" else ""
    bounds = _BONDS[ends.end].replace("; ", f"; {wanted}", 1)
    coefficients = "params" if arguments.startswith(f"const {name}_params") else "coef"
    used = any(s in code.used for s in kernel.inputs[coefficients])
    passed = [f"if ({_PASSED[ends.chosen]}) continue;"] if ends.chosen in _PASSED else []
    reads = [f"{'const ptrdiff_t j = row->other[k];'}"] if other else []
    inner = [*passed, *reads, *other, *values, *added]
    return "\n".join(
        [
            *comment(f"/* {plain(kernel.purpose)} */", ""),
            f"static inline void {name}_{kernel.name}({arguments}, ptrdiff_t from, ptrdiff_t to)",
            "{",
            *(f"    {line}" for line in [*([] if used else [f"(void){coefficients};"]), *names.pointers()]),
            "    for (ptrdiff_t i = from; i < to; ++i) {",
            *(f"        {line}" for line in [*own, *sums]),
            f"        for (ptrdiff_t k = {bounds}; ++k) {{",
            *(f"            {line}" for line in inner),
            "        }",
            *(f"        {line}" for line in out),
            "    }",
            "}\n",
        ]
    )


def _over_pairs(
    program: Program, layout: Layout, kernel: Kernel, arguments: str, begin: Sequence[str], body: Sequence[str]
) -> str:
    """A loop over all sites b, in it one over the sites a of a piece; statements with the values of the kernel."""
    name, code = program.name, lower(kernel)
    names = _Names(program, layout, kernel, code, set(), _functions(program))
    other, own = names.of_pair()
    lines = [*own, *(f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments)]
    lines += [text.format(*(names.show(s.value) for s in code.stores)) for text in body]
    first = "params" if arguments.startswith(f"const {name}_params") else "coef"
    used = any(s in code.used for s in kernel.inputs[first])
    return "\n".join(
        [
            *comment(f"/* {plain(kernel.purpose)} */", ""),
            f"static inline void {name}_{kernel.name}({arguments})",
            "{",
            *(f"    {line}" for line in [*([] if used else [f"(void){first};"]), *names.pointers(), *begin]),
            "    for (ptrdiff_t j = 0; j < row->length; ++j) {",
            *(f"        {line}" for line in other),
            f"        {name}_EACH_SITE",
            "        for (ptrdiff_t i = from; i < to; ++i) {",
            *(f"            {line}" for line in lines),
            "        }",
            "    }",
            "}\n",
        ]
    )


def _seen(program: Program, layout: Layout, kernel: Kernel) -> str:
    """A kernel as a loop that fills arrays over the sites."""
    name, code, partners = program.name, lower(kernel), layout.partners
    names = _Names(program, layout, kernel, code, set(), _functions(program), partners.field.names)
    head = [*comment(f"/* {plain(kernel.purpose)}, of the sites of a row: out[k * apart + i - from] */", "")]
    head.append(
        f"static void {name}_{kernel.name}_row(const {name}_params *params, const {name}_row *row, ptrdiff_t from, "
        f"ptrdiff_t to, double *restrict out, size_t apart)\n{{"
    )
    body = names.loaded()
    body += [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    for s in code.stores:
        place = {0: "i - from", 1: "(ptrdiff_t)apart + i - from"}.get(
            s.index, f"{s.index} * (ptrdiff_t)apart + i - from"
        )
        body.append(f"out[{place}] = {names.show(s.value)};")
    early, late = list[str](), list[str]()
    gather = {"energy": partners.energy, "vector_field": partners.field}.get(kernel.name)
    for own in gather.kernels if gather else ():
        early.append(f"    {name}_{own.name}(params, row, from, to);")
    if kernel.name == "energy" and early:
        late = ["    for (ptrdiff_t i = from; i < to; ++i) out[i - from] += 0.5 * row->gathered[0][i];"]
    unused = [] if early or late or any(s in code.used for s in kernel.inputs["params"]) else ["params"]
    unused += [] if len(code.stores) > 1 else ["apart"]
    if not code.stores:
        unused += ["row", "from", "to", "out"]
        return "\n".join([*head, *(f"    (void){u};" for u in unused), "}"]) + "\n"
    head += ["    " + ", ".join(f"(void){u}" for u in unused) + ";"] if unused else []
    text = _looped([*head, *early], names, body, name, "ptrdiff_t i = from; i < to; ++i")
    return text.removesuffix("}\n") + "\n".join([*late, "}\n"])


def _looped(head: list[str], names: _Names, body: list[str], name: str, loop: str) -> str:
    lines = [*head, *(f"    {line}" for line in names.pointers())]
    lines += [f"    {name}_EACH_SITE", f"    for ({loop}) {{", *(f"        {line}" for line in body), "    }", "}"]
    return "\n".join(lines) + "\n"


def _beside(pointer: str, offset: int) -> str:
    """A value of a row at an offset from the site i."""
    return f"{pointer}[i{offset:+d}]".replace("+", " + ").replace("-", " - ").replace(" + 0", "")


def _together(values: Sequence[str]) -> list[str]:
    """One declaration of several constants."""
    return [f"const double {', '.join(values)};"] if values else []


class _Names:
    """What the symbols of a kernel are called in a loop over sites."""

    def __init__(
        self,
        program: Program,
        layout: Layout,
        kernel: Kernel,
        code: Code,
        moved: set[str],
        calls: Mapping[str, str],
        sums: Sequence[str] = (),
    ) -> None:
        self.layout, self.moved, self.code = layout, moved, code
        called = {word.strip("({") for text in calls.values() for word in text.split("(")}
        self.scope = Scope(C_RESERVED | _OWN | called | {"change0", "change1", "change2"})
        self.show = printer(self.scope, calls)
        self._pointers: dict[tuple[str, int], str] = {}
        self._loaded: list[str] = []
        self._weights: list[str] = []
        self._at_a: list[str] = []
        self._at_b: list[str] = []
        self._first: list[str] = []
        self._starts: list[str] = []
        member = members(program)
        for s in (s for symbols in kernel.inputs.values() for s in symbols if s in code.used):
            if isinstance(s, Symbol) and s.kind == COEFFICIENT:
                named = f"c{s.key[0]}"
                self.scope.bind(s, named)
                self._first.append(f"{named} = coef[{s.key[0]}]")
            elif isinstance(s, Symbol) and s.kind == GATHERED:
                self.scope.bind(s, f"row->gathered[{list(sums).index(s)}][i]")
            elif isinstance(s, Symbol) and s.kind == CHOSEN:
                self.scope.bind(s, "(row->colours[i] == row->chosen ? 1.0 : 0.0)")
            elif isinstance(s, Symbol) and s.kind == VARIATION:
                field, offset = layout.step.sites.places[str(s.key[0])]
                line, number = layout.line(offset), program.coordinates.index(field)
                pointer = self.scope[Symbol("varied", field, line)]
                self._starts.append(f"const double *restrict {pointer} = row->varied[{number}] + row->at[{line}];")
                self.scope.bind(s, _beside(pointer, offset[-1]))
            elif isinstance(s, Symbol) and s.kind == INITIAL:
                pointer, number = self.scope[Symbol("start", str(s.key[0]))], program.coordinates.index(str(s.key[0]))
                self._starts.append(f"const double *restrict {pointer} = row->start[{number}] + row->at[0];")
                self.scope.bind(s, f"{pointer}[i]")
            elif isinstance(s, Symbol):
                self._bind_weight(s)
            elif s in layout.step.sites.ends:
                self._bind_end(s)
            elif s in layout.step.sites.places:
                self._bind_site(s)
            elif s in layout.step.sites.at_bonds:
                self._at_b.append(f"{self.scope[s]} = row->at_bonds[{layout.step.sites.at_bonds.index(s)}][k]")
            else:
                self._first.append(f"{self.scope[s]} = params->{member[s]}")

    def _bind_end(self, s: str) -> None:
        base, end = self.layout.step.sites.ends[s]
        pointer = self.pointer(base, 0)
        named = self.scope[s]
        (self._at_a if end == "a" else self._at_b).append(f"{named} = {pointer}[{'i' if end == 'a' else 'j'}]")

    def of_pair(self) -> tuple[list[str], list[str]]:
        """What is read at a site b, and at a site a."""
        return _together(self._at_b), _together(self._at_a)

    def _bind_weight(self, s: Symbol) -> None:
        k = self.layout.weights.index(s)
        named = f"w{k}"
        self.scope.bind(s, named)
        low, high = _bounds(s)[-1]
        tests = [f"i + {-low * -1} >= 0".replace("+ -", "- ")] * (low < 0) + [f"i + {high} < row->length"] * (high > 0)
        if tests:
            self._weights.append(f"const double {named} = {' && '.join(tests)} ? row->present[{k}] : 0.0;")
        else:
            self._first.append(f"{named} = row->present[{k}]")

    def _bind_site(self, s: str) -> None:
        base, offset = self.layout.step.sites.places[s]
        pointer = self.pointer(base, self.layout.line(offset))
        if offset[-1] == 0 and not any(offset):
            self._loaded.append(f"{self.scope[s]} = {pointer}[i]")
        else:
            self.scope.bind(s, _beside(pointer, offset[-1]))

    def pointer(self, base: str, line: int) -> str:
        """The name of the row of an array at a line."""
        key = (base, line)
        if key not in self._pointers:
            self._pointers[key] = self.scope[f"{base}_row{line or ''}"]
        return self._pointers[key]

    def loaded(self) -> list[str]:
        """What is read at the beginning of the loop."""
        return [*_together(self._loaded), *self._weights]

    def pointers(self) -> list[str]:
        """What is read before the loop."""
        lines = [*_together(self._first), *dict.fromkeys(self._starts)]
        for f in sorted(self.moved):
            self.pointer(f, 0)
        for (base, line), named in self._pointers.items():
            mine = base in self.moved and line == 0
            constant = "" if mine else "const "
            alone = "" if base in self.moved else "restrict "
            place = self.layout.arrays.index(base)
            lines.append(f"{constant}double *{alone}{named} = row->x[{place}] + row->at[{line}];")
        return lines
