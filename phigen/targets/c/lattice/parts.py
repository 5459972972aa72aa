"""The parts of a step of a lattice in C: which loops over sites make which of them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phigen.ir.lattice_loops import bounds
from phigen.lanes.in_lanes import Rows
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.program import Program
from phigen.scheme.steps import Sweep, Sweeps
from phigen.symbolic.special import SPECIAL
from phigen.targets.c import functions
from phigen.targets.c.kernels import members
from phigen.targets.c.lattice.ends import over_ends
from phigen.targets.c.lattice.layout import Layout, layout_of, switches, wide
from phigen.targets.c.lattice.loops import (
    Loop,
    far_calls,
    forms_of,
    has_ends,
    in_loops,
    middle_loop,
    site_block,
    sweep_loop,
)
from phigen.targets.c.lattice.partners import gathering, partners, told_of_bonds
from phigen.targets.c.lattice.seen import seen_loop
from phigen.targets.c.lattice.turned import orders, other_ways, turned, turned_increments
from phigen.targets.rendering import render


def sweeps(program: Program, step: Sweeps, rows: Rows) -> str:
    """All kernels as loops over sites, and which of them make which part of H."""
    layout = layout_of(program, step)
    texts = [
        *functions.called(program, [step.equation.slope] if step.equation and not layout.slopes else ()),
        *functions.phi_lanes(program, set(rows.small_argument)),
    ]
    texts += functions.near_rows(program, [f for f in rows.small_argument if f not in SPECIAL])
    if step.parts:
        texts += _parts(program, layout, rows, step.parts)
        texts += _parts(program, layout, None, step.tangents) if program.extras.tangent else []
    texts += partners(program, layout)
    if step.equation:
        relax, end = step.equation.relax, step.equation.advance
        forms = call_forms(program, rows, [relax, end])
        texts += _of_equation(program, layout, relax, forms, end=[end], far=bool(rows.limited))
    if step.equation and switches(program, step, layout)["SITE_BLOCKS"]:
        texts += _of_equation(
            program, layout, site_block(program, layout, step.equation.relax), {"": in_loops(program)}
        )
    for kernel in (step.equation.slope, *step.equation.tangents) if step.equation and layout.slopes else ():
        texts += _of_equation(program, layout, kernel, {"": in_loops(program)})
    texts += [seen_loop(program, layout, k) for k in program.observables.kernels if k.roots]
    return "\n".join(texts)


def parameters(program: Program, step: Sweeps) -> str:
    """Print the function that copies parameters at sites and bonds to the arrays that loops read."""
    layout, member = layout_of(program, step), members(program)
    sites = [p for p in program.parameters if p.at == "sites"]
    values = {
        "NAME": program.name,
        "arrays": [(member[p.name], layout.arrays.index(p.name), repr(float(p.value))) for p in sites],
        "at_bonds": [
            (member[p.name], step.sites.at_bonds.index(p.name), repr(float(p.value)))
            for p in program.parameters
            if p.at == "bonds"
        ],
    }
    return render("c", "lattice_parameters.c", values)


def call_forms(program: Program, rows: Rows | None, kernels: Sequence[Kernel]) -> dict[str, Mapping[str, str]]:
    """The forms in which kernels are needed, each with what its functions are called; without rows one for all."""
    calls = in_loops(program)
    if rows is None or not any(rows.calls_limited(kernel) for kernel in kernels):
        return {"": calls}
    lanes = {f: f"{program.name}_{f}_{'lane' if f in SPECIAL else 'near'}" for f in rows.small_argument}
    return {"_near": {**calls, **lanes}, "_far": far_calls(program)}


def _parts(program: Program, layout: Layout, rows: Rows | None, parts: Sequence[Sequence[Sweep]]) -> Iterator[str]:
    """The loops of all parts of H, and which of them make which. Those of equal code are one, whoever needs it.

    Without ``rows`` these are derivatives.
    """
    step = layout.step
    parts_by_form = [_forms_of_part(program, layout, rows, part) for part in parts]
    alike = _alike(parts_by_form)
    names: dict[str, str] = {}
    for code, same in alike.items():
        shared = same[0].loop.shared if len(same) > 1 and same[0].loop.shared not in names.values() else ""
        names[code] = shared or same[0].loop.name
        yield replace(same[0].loop, name=names[code]).text(program, [call.loop.purpose for call in same])
    near = rows is not None and bool(rows.limited)
    unused, varied = ["far"] * (near and all(len(forms) == 1 for forms in parts_by_form)), rows is None
    has = switches(program, step, layout)
    threads = 0 if varied or has["SHARED"] else 512 if has["PAIRS"] else 4096
    flow, what = ("flow", "A flow") if step.by_colour else ("part", "The flow of a part of H")
    head = "tangent_rows" if varied else f"sweep_{'colour' if step.by_colour else 'part'}" if threads else "sweep_rows"
    cases: list[Case | str] = []
    for k, forms in enumerate(parts_by_form):
        if varied or not _has_rows_of_its_own(program, layout):
            cases.append(_case(program, layout, k, parts[k], forms, names))
            continue
        called = [f"{program.name}_rows{k + 1}{form}" for form in sorted(forms)]
        for form in sorted(forms):
            case = _case(program, layout, k, parts[k], {form: forms[form]}, names)
            title = f"The flow of H_{k + 1}" + ", for large arguments of functions" * (form == "_far")
            yield over_rows(
                program, layout, [case], title=title, head=f"rows{k + 1}{form}", arguments="const double *coef"
            )
        cases.append(f"{called[0] if len(called) == 1 else f'(far ? {called[0]} : {called[1]})'}(s, coef, first, end);")
    yield over_rows(
        program,
        layout,
        cases,
        title=f"How {what[0].lower()}{what[1:]} carries a tangent vector" if varied else what,
        head=head,
        arguments=f"int {flow}, const double *coef{', double *const *v' * varied}{', int far' * near}",
        coloured=bool(step.by_colour),
        unused=["part"] * (len(cases) == 1 and not step.by_colour) + ([] if varied else unused),
        threads=threads,
    )


def _has_rows_of_its_own(program: Program, layout: Layout) -> bool:
    """Whether each part of H has a loop over rows of its own, which compilers make faster where these are short."""
    return program.profile == "fast" and len(layout.step.sites.axes) > 1


def _alike(parts_by_form: Sequence[dict[str, list[_Call]]]) -> dict[str, list[_Call]]:
    """The calls of all loops, by the code that is to be printed of them: those that another one can make call that."""
    alike: dict[str, list[_Call]] = {}
    for forms in parts_by_form:
        for called in forms.values():
            for k, call in sorted(enumerate(called), key=_place):
                choices = [call, *call.others]
                called[k] = next((c for c in choices if c.loop.code in alike), call)
                known = alike.setdefault(called[k].loop.code, [])
                if all(c.loop.name != call.loop.name for c in known):
                    known.append(called[k])
    return alike


def _place(numbered: tuple[int, _Call]) -> tuple[str, bool]:
    """Where a loop is printed: that beside open ends behind the one that it is the same as."""
    name = numbered[1].loop.name
    return name.removesuffix("_end"), name.endswith("_end")


def _forms_of_part(
    program: Program, layout: Layout, rows: Rows | None, part: Sequence[Sweep]
) -> dict[str, list[_Call]]:
    """Return the calls for a segment of a row that make the flow of a part of H, in each form.

    Short code has loops that also serve with the fields in another order.
    """
    forms = call_forms(program, rows, [sweep.kernel for sweep in part])
    fields, calls_by_form = program.coordinates, dict[str, list[_Call]]()
    tried = [*orders(fields)] if program.profile == "small" and rows is not None else []
    for form, names in forms.items():
        calls_by_form[form] = []
        for sweep in part:
            calls = [*_calls(program, layout, sweep, form, names)]
            for order in (
                () if sweep.gather and layout.step.adjoint else tried
            ):  # transposes gather by loops of their own
                other = turned(layout.step.sites, fields, order, sweep)
                again = [*_calls(program, layout, other, form, names)] if other else []
                for k, call in enumerate(again):
                    more = (replace(c, order=order) for c in (call, *call.others))
                    calls[k] = replace(calls[k], others=(*calls[k].others, *more))
            calls_by_form[form] += calls
    return calls_by_form


def _case(
    program: Program,
    layout: Layout,
    k: int,
    part: Sequence[Sweep],
    forms: Mapping[str, Sequence[_Call]],
    names: Mapping[str, str],
) -> Case:
    """The statements of a part of H, where the loops have ``names`` by their code."""
    coloured, varied = layout.step.by_colour, any(sweep.is_tangent for sweep in part)
    lines = {form: [*_called(program, called, names)] for form, called in forms.items()}
    moved = sorted({f for sweep in part for f in sweep.moved})
    setup = ["row.varied = v;"] * varied + (["row.chosen = colour;"] if coloured and coloured[k] else [])
    setup += _near_seams(layout, part) if _has_rows_of_its_own(program, layout) else []
    all_called = [call for called in forms.values() for call in called]
    orders = [*_reordered(layout, [call.order for call in all_called])]
    orders += _other_bonds(layout, [call.bonds for call in all_called])
    beside = has_ends(program, [sweep.kernel for sweep in part]) or any(map(beside_seams, part))
    where = "v" if varied else "s->x"
    return Case(either(lines), setup, beside, orders, moved, where)


def _near_seams(layout: Layout, part: Sequence[Sweep]) -> Iterator[str]:
    """Yield the statements that skip rows and sites away from the seams at which the terms of a part begin."""
    window, last = max((s.window or 0 for s in part), default=0), len(layout.step.sites.axes) - 1
    rows = window & ~(1 << last)
    if rows:
        yield f"if ((row.near & {rows}) != {rows}) continue;"
    if window >> last:
        yield "row.near = 0;"


#: The most statements of a case of a switch that are on its line.
MOST_ON_A_LINE = 2


@dataclass(frozen=True)
class Case:
    """Calls for a segment of a row, after its ``setup``; whether there are sites beside open ends; the
    declarations of ``orders`` of the fields; which fields are ``moved``, and where these are."""

    calls: Sequence[str]
    setup: Sequence[str]
    beside: bool
    orders: Sequence[str] = ()
    moved: Sequence[int] = ()
    where: str = "s->x"


@dataclass(frozen=True)
class _Call:
    """A loop for some sites of a piece: their bounds, if not all of them; the ``colour`` that it is told, if any; the
    fields in the ``order`` that it takes for its own, if another one, and where it gathers the parameters at ``bonds``
    likewise; what it is ``told`` of bonds besides; the first kind of its ``window``, if any; ``others`` do the same."""

    loop: Loop
    sites: str = ""
    colour: int | None = None
    order: tuple[str, ...] = ()
    bonds: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    others: tuple[_Call, ...] = ()
    window: int | None = None


def _called(program: Program, called: Sequence[_Call], names: Mapping[str, str]) -> Iterator[str]:
    """The statements that call loops, which have ``names`` by their code, each with the fields in its order."""
    order: tuple[str, ...] = ()
    colour: int | None = 0
    window: int | None = 0
    for call in called:
        assignments = list[str]()
        if call.window not in (window, None):
            window = call.window
            assignments.append(f"row.window = {window}.0")
        if call.colour not in (colour, None):
            colour = call.colour
            assignments.append(f"row.swept = {colour}")
        if call.order != order:
            order = call.order
            assignments.append(f"row.x = {'_'.join(order) or 's->x'}")
        yield from [f"{', '.join(assignments)};"] if assignments else []
        yield f"{program.name}_{names[call.loop.code]}({', '.join(['coef', at(program, call.sites), *call.told])});"


def _other_bonds(layout: Layout, used: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """The parameters at bonds, in other orders that are used."""
    for order in dict.fromkeys(order for order in used if order):
        places = ", ".join(f"s->at_bonds[{layout.step.sites.at_bonds.index(p)}]" for p in order)
        yield f"double *const {'_'.join(order)}[] = {{ {places} }};"


def _reordered(layout: Layout, used: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """The arrays over the sites, with the fields in other orders that are used."""
    for order in dict.fromkeys(order for order in used if order):
        turned = {
            **dict(zip(layout.arrays, order, strict=False)),
            **turned_increments(layout.step.sites, layout.arrays, order),
        }
        arrays = [turned.get(a, a) for a in layout.arrays]
        places = ", ".join(f"s->x[{layout.arrays.index(a)}]" for a in arrays)
        yield f"double *const {'_'.join(order)}[] = {{ {places} }};"


def _calls(program: Program, layout: Layout, sweep: Sweep, form: str, calls: Mapping[str, str]) -> Iterator[_Call]:
    """The loops of a sweep, in the order in which they are called for a piece of a row."""
    meant = over_ends(sweep.gather) if sweep.gather else []

    def said(k: int, bonds: tuple[str, ...], sign: float) -> tuple[str, ...]:
        ends, opposite = meant[k]
        values = {"at_bonds": "_".join(bonds) or "s->at_bonds", "sign": f"{sign!r}"}
        values["across"] = str(int(ends.chosen == "there"))
        return tuple(values[name] for name in told_of_bonds(program, layout, ends, opposite))

    for k, loop in enumerate(gathering(program, layout, sweep.gather, "coef") if sweep.gather else ()):
        others = []
        alone = program.profile == "fast" or layout.step.adjoint
        for gather, bonds, sign in () if alone or not sweep.gather else other_ways(layout.step.sites, sweep.gather):
            again = [*gathering(program, layout, gather, "coef")]
            others.append(_Call(again[k], bonds=bonds, told=said(k, bonds, sign)))
        yield _Call(loop, told=said(k, (), 1.0), others=tuple(others))
    loops = [
        sweep_loop(program, layout, replace(sweep, kernel=kernel), form + more, calls)
        for kernel, more in forms_of(program, sweep.kernel)
    ]
    if len(loops) == 1 and wide(layout, sweep):
        yield _Call(loops[0], "0, (s->length + 7) & ~(ptrdiff_t)7")
    else:
        swept = program.profile == "small" and layout.leaves_out(sweep.colour) and not sweep.is_tangent
        colour = sweep.colour if swept else None
        called = [_Call(loops[0], sites) for sites in beside_seams(sweep)] or calls_over_sites(loops)
        window = first_kind(layout, sweep)
        yield from (replace(call, colour=colour, window=window) for call in called)


def first_kind(layout: Layout, sweep: Sweep) -> int | None:
    """The first of the kinds of sites on the seams that a sweep is for."""
    return None if sweep.window is None else sweep.window * layout.step.sites.colours


def beside_seams(sweep: Sweep) -> tuple[str, ...]:
    """The sites of a piece of a row away from seams, or near them, if a sweep is made there only."""
    near = ("begin, second", "third, stop") if sweep.window is not None else ()
    return ("second, third",) if sweep.inside else near


def calls_over_sites(loops: Sequence[Loop]) -> Iterator[_Call]:
    """One loop for all sites, or two: for those away from open ends, and for those beside them."""
    if len(loops) == 1:
        yield _Call(loops[0])
        return
    inside, end = loops
    yield from (_Call(end, "begin, second"), _Call(inside, "second, third"), _Call(end, "third, stop"))


def at(program: Program, sites: str) -> str:
    """The argument that is a piece of a row, or some sites of it."""
    return f"{program.name}_between(&row, {sites})" if sites else "&row"


def either(lines: Mapping[str, Sequence[str]]) -> list[str]:
    """The calls of each form, for those arguments that it is for."""
    if len(lines) == 1:
        return [line for calls in lines.values() for line in calls]
    return _either("far", lines["_far"], lines["_near"])


def _either(condition: str, first: Sequence[str], other: Sequence[str]) -> list[str]:
    """The first statements if a condition holds, else the others."""
    if len(first) == len(other) == 1:
        return [f"if ({condition}) {first[0]}", f"else {other[0]}"]
    indented = [[f"    {line}" for line in lines] for lines in (first, other)]
    return [f"if ({condition}) {{", *indented[0], "} else {", *indented[1], "}"]


def _copied_ends(program: Program, layout: Layout, fields: Sequence[int | str], case: Case) -> list[str]:
    """Return the statements that copy the ends of a row of fields that were changed."""
    place, swept = layout.at(0, "row."), layout.swept("begin, stop" if case.beside else "row.from, row.to")
    return [f"{program.name}_ends({case.where}[{f}]{place}, s->length, {swept});" for f in fields if layout.halo]


def _of_equation(
    program: Program,
    layout: Layout,
    kernel: Kernel,
    forms: Mapping[str, Mapping[str, str]],
    *,
    end: Sequence[Kernel] = (),
    far: bool = False,
) -> Iterator[str]:
    """The loops of a kernel of the equation of a stage over rows and their sites, in each form, or of that of the
    ``end`` of a stage where this moves x; whether they are told of arguments that are far."""
    name, relaxing, adds = program.name, kernel.role is Role.RELAX, kernel.role is Role.FOLLOW
    varied = kernel.reads_variations
    gathers = over_ends(layout.gathered(kernel)) if kernel.inputs["gathered"] else ()
    gathered = [f"{name}_{ends.kernel.name}(&row);" for ends, _ in gathers]
    lines = {}
    for form, calls in forms.items():
        both = list[list[str]]()
        for printed in (kernel, *end):
            added = "+=" if adds or printed in end else "="
            loops = [
                middle_loop(program, layout, one, form + more, calls, added) for one, more in forms_of(program, printed)
            ]
            yield from (loop.text(program) for loop in loops)
            called = calls_over_sites(loops)
            both.append([f"{name}_{call.loop.name}(coef, {at(program, call.sites)});" for call in called])
        lines[form] = _either("to == s->x", both[1], both[0]) if end else both[0]
    reads = ["row.start = s->x;"] * ("start" in kernel.inputs) + ["row.varied = v;"] * varied
    titles = {
        Role.RELAX: "A sweep, or to x the end of a stage",
        Role.SLOPE: "How a sweep follows y along v",
        Role.OWN_SLOPE: "How a sweep follows y at the site itself",
        Role.SIDE: "How a sweep follows x along v",
        Role.FOLLOW: "How the end of a stage follows y along v, added",
    }
    moved = range(program.dimension) if relaxing or adds else ()
    setup = ["row.x = y;", *reads, "row.out = to;"]
    yield over_rows(
        program,
        layout,
        [Case([*gathered, *either(lines)], setup, has_ends(program, [kernel, *end]), (), moved, "to")],
        title=titles[kernel.role],
        head="stage_piece" if end else f"{kernel.name}_piece",
        arguments=f"const double *coef, {'int far, ' * far}double *const *y, {'double *const *v, ' * varied}"
        "double *const *to",
        unused=["far"] * (far and len(forms) == 1),
        alone=True,
    )


def over_rows(
    program: Program,
    layout: Layout,
    cases: Sequence[Case | str],
    labels: Sequence[int] = (),
    *,
    alone: bool = False,
    threads: int = 0,
    back: bool = False,
    **more: object,
) -> str:
    """A function that goes over pieces of rows, or ``alone`` over one, or over all, by several threads where there are
    more sites than ``threads`` says, if it does; what it does is one of some ``cases``, or what these call.

    They have the numbers 1, 2, …, or those of ``labels``. On the way ``back``, sites beside open ends are whole vectors
    of 8, so that those between are too.
    """
    last = [bounds(w.key)[-1] for w in layout.weights]
    low, one_row = max([0, *(-low for low, _ in last)]), len(layout.step.sites.axes) == 1
    low = (low + 7) // 8 * 8 if back else low
    seamed = bool(layout.step.sites.seams)
    away, end = "s->inside[0]" if seamed else low, f"s->length - {max([0, *(high for _, high in last)])}"
    values: dict[str, Any] = {
        "NAME": program.name,
        "low": away if one_row else f"{'row.near == 0' if seamed else 'row.whole'} ? {away} : s->length",
        "high": "s->inside[1]" if seamed else f"({end}) & ~(ptrdiff_t)7" if back else end,
        "ends": "seams" if seamed else "open ends",
        "skipping": switches(program, layout.step, layout)["BY_HAND"] and one_row,
        "alone": alone,
        "threads": threads,
        "several": not alone and not threads,
    }
    orders = dict.fromkeys(line for case in cases if not isinstance(case, str) for line in case.orders)
    body = ["/* the fields in other orders, in which loops that are for one order serve others */"] * bool(orders)
    body += [*orders, *_over_pieces(program, layout, values, cases, labels or range(1, 1 + len(cases)))]
    indented = [line if line.startswith("#") else f"    {line}" for line in body]
    values |= {"coloured": False, "unused": (), "body": indented, "counted": threads and indented, **more}
    if any(isinstance(case, Case) and not case.calls for case in cases):  # nothing moves, as where brackets are zero
        values["unused"] = _not_read(values)
    return render("c", "sweep_rows.c", values)


def _not_read(values: Mapping[str, Any]) -> list[str]:
    """The arguments of a function over rows that its body does not name."""
    range_names = ["unit"] * values["alone"] + ["first", "end"] * values["several"]
    arguments = ["s", *re.findall(r"(\w+)(?:,|$)", values["arguments"]), *range_names]
    named = " s flow part" if values["coloured"] else ""  # by the lines that find the colour of a flow
    text = "\n".join(values["body"]) + named
    return [name for name in arguments if not re.search(rf"\b{name}\b", text)]


def _over_pieces(
    program: Program, layout: Layout, values: Mapping[str, object], cases: Sequence[Case | str], labels: Sequence[int]
) -> list[str]:
    """The loop over pieces; short code tells the parts of H apart in it, other code has a loop for each.

    What lies beside the open ends of a single row is read by their pieces alone: short code copies it of all fields.
    """
    pieces = [case for case in cases if isinstance(case, Case)]
    ends = [_copied_ends(program, layout, case.moved, case) for case in pieces]
    statements, last = [[*case.calls] for case in pieces], list[str]()
    if layout.step.sites.open == (True,) and any(ends):
        (line,) = _copied_ends(program, layout, ["k"], pieces[0])
        last = [f"for (int k = 0; k < {program.name}_DIM; ++k) {line}"]
    else:
        statements = [[*lines, *copied] for lines, copied in zip(statements, ends, strict=True)]
    if len(statements) > 1 and program.profile == "small":
        calls = ["switch (part) {", *_cases(statements, labels), "}", *last]
        setup = [*dict.fromkeys(line for case in pieces for line in case.setup)]
        return _piece(values, Case(calls, setup, any(case.beside for case in pieces)))
    whole = iter([replace(case, calls=[*case.calls, *copied]) for case, copied in zip(pieces, ends, strict=True)])
    loops = [[case] if isinstance(case, str) else _piece(values, next(whole)) for case in cases]
    return loops[0] if len(loops) == 1 else ["switch (part) {", *_cases(loops, labels), "}"]


def _piece(values: Mapping[str, object], case: Case) -> list[str]:
    if not case.calls:
        return []
    changed = any(re.search(r"\brow\.\w+ = |_between\(", line) for line in (*case.setup, *case.calls))
    lines = render("c", "each_piece.c", {**values, **vars(case), "changed": changed}).splitlines()
    threads = values["threads"]
    first, end = ("0", "units") if threads else ("first", "end")
    begin = ["#ifdef _OPENMP", f"#pragma omp parallel for if (s->sites > {threads})", "#endif"] if threads else []
    begin.append(f"for (size_t unit = {first}; unit < {end}; ++unit) {{")
    return lines if values["alone"] else [*begin, *(f"    {line}" for line in lines), "}"]


def _cases(loops: Sequence[Sequence[str]], labels: Sequence[int]) -> Iterator[str]:
    """The cases of a switch over parts of H, with their statements; each on a line, where all are short."""
    heads = ["default:" if k == labels[-1] else f"case {k}:" for k in labels]
    short = all(len(lines) <= MOST_ON_A_LINE and "for" not in "".join(lines[:1]) for lines in loops)
    for head, lines in zip(heads, loops, strict=True):
        yield " ".join([head, *lines, "break;"]) if short else head
        yield from () if short else (f"    {line}" for line in (*lines, "break;"))
