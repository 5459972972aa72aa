"""The parts of a step of a lattice in C: which loops over sites make which of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from phigen.lanes.lowering import Rows
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Sweep, Sweeps
from phigen.symbolic.special import SPECIAL
from phigen.targets.c import functions
from phigen.targets.c.kernels import members
from phigen.targets.c.lattice.layout import Layout, bounds, layout_of, switches
from phigen.targets.c.lattice.loops import forms_of, has_ends, in_loops, middle_loop, seen_loop, sweep_loop, weights_of
from phigen.targets.c.lattice.partners import gathering, partners
from phigen.targets.rendering import render


def sweeps(program: Program, step: Sweeps, rows: Rows) -> str:
    """All kernels as loops over sites, and which of them make which part of H."""
    layout, name, member, calls = layout_of(program, step), program.name, members(program), in_loops(program)
    found = [*functions.called(program), *functions.phi_lanes(program, set(rows.near))]
    found += functions.near_rows(program, [f for f in rows.near if f not in SPECIAL])
    near = {**calls, **{f: f"{name}_{f}_{'lane' if f in SPECIAL else 'near'}" for f in rows.near}}
    for k, part in enumerate(step.parts, 1):
        two = any(rows.calls_near(sweep.kernel) for sweep in part)
        found += _part(program, layout, k, part, {"_far": calls, "_near": near} if two else {"": calls})
    seen = program.observables
    found += partners(program, layout)
    for kernel in (step.equation.relax, step.equation.advance) if step.equation else ():
        forms = {"_far": calls, "_near": near} if rows.calls_near(kernel) else {"": calls}
        found += _of_equation(program, layout, kernel, forms)
    if step.equation and step.equation.slope and switches(program, step, layout)["STIFF"]:
        found += _of_equation(program, layout, step.equation.slope, {"": calls})
    found += [seen_loop(program, layout, k) for k in (seen.energy, seen.casimirs, seen.vector_field)]
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
            yield from gathering(program, layout, sweep.gather, f"const double *coef, const {program.name}_row *row")
    for form, calls in forms.items():
        for sweep in part:
            for kernel, more in forms_of(program, sweep.kernel):
                yield sweep_loop(program, layout, replace(sweep, kernel=kernel), form + more, calls)
    beside = has_ends(program, [sweep.kernel for sweep in part])
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
        for one, more in forms_of(program, kernel):
            yield middle_loop(program, layout, one, form + more, calls, "+=" if moves else "=")
    beside = has_ends(program, [kernel])
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


def _pieces(program: Program, layout: Layout, loops: Mapping[str, list[str]], *, beside: bool) -> dict[str, object]:
    """What the template of loops over pieces of rows wants, for the calls of each form."""
    conditions = ("if (far) ", "else ") if len(loops) > 1 else ("",)
    last = [bounds(w)[-1] for w in layout.weights]
    return {
        "NAME": program.name,
        "loops": list(zip(conditions, loops.values(), strict=True)),
        "beside": beside,
        "low": max([0, *(-low for low, _ in last)]),
        "high": max([0, *(high for _, high in last)]),
        "skipping": switches(program, layout.step, layout)["BY_HAND"] and len(layout.step.sites.axes) == 1,
        "after": [],
    }


def _calls(name: str, sweep: Sweep, form: str, beside: bool) -> Iterator[str]:
    """The calls of the loops for a piece of a row."""
    for kernel in sweep.gather.kernels if sweep.gather else ():
        yield f"{name}_{kernel.name}(coef, &at.row, at.from, at.to);"
    yield from _kernel_calls(f"{name}_{sweep.kernel.name}{form}", sweep.kernel, beside=beside)


def _kernel_calls(own: str, kernel: Kernel, *, beside: bool) -> Iterator[str]:
    if not beside or not weights_of(kernel):
        yield f"{own}(coef, &at.row, at.from, at.to);"
        return
    yield f"{own}_end(coef, &at.row, at.from, second);"
    yield f"{own}(coef, &at.row, second, third);"
    yield f"{own}_end(coef, &at.row, third, at.to);"
