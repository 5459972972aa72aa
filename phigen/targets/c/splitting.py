"""The step of a splitting in C: one function for each flow, and the schedule that calls them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from phigen.scheme.alternation import Schedule
from phigen.scheme.program import Kernel, Output, Program
from phigen.targets.c.kernels import FUNCTIONS, function
from phigen.targets.c.small import FLOW_FUNCTIONS
from phigen.targets.rendering import render


def pieces(program: Program, values: Mapping[str, object]) -> list[str]:
    """The functions of the driver."""
    kernels, schedule, own = program.kernels, schedule_of(program), {**values, **_values(program)}
    prepare = function(program, replace(kernels["prepare"], name="prepare_row")) + "\n"
    found, functions = [prepare, render("c", "add.c", values)], _functions(program)
    for k, name in enumerate(_flows(program), 1):
        kernel, moved = _compact(kernels[name], k)
        found.append(function(program, kernel, functions=functions) + "\n")
        found.append(
            render("c", "flow.c", own | {"k": k, "moved": list(enumerate(moved)), "count": max(1, len(moved))})
        )
    rows = "rows_kicks.c" if schedule.multiples else "rows.c"
    step = _step(program, schedule, "", "x, moved, s->x")
    return [*found, render("c", rows, own), render("c", "splitting.c", own | {"step": step})]


def in_lanes(program: Program, values: Mapping[str, object], form: str, functions: Mapping[str, str]) -> list[str]:
    """Steps of the members of packs, which call ``functions``; ``form`` is added to the names."""
    found, end = [], f"{form}_lanes"
    for k, name in enumerate(_flows(program), 1):
        kernel, moved = _compact(program.kernels[name], k)
        kernel = replace(kernel, name=kernel.name + form)
        found.append(function(program, kernel, lanes=True, shared=["coef"], functions=functions) + "\n")
        own = {"k": k, "form": end, "moved": list(enumerate(moved)), "count": max(1, len(moved))}
        found.append(render("c", "flow_lanes.c", {**values, **own}))
    step = _step(program, schedule_of(program), end, "pack, packs")
    return [*found, render("c", "splitting_lanes.c", {**values, "form": end, "step": step})]


def tangent(program: Program, values: Mapping[str, object]) -> list[str]:
    """The derivative of a step."""
    kernels = [program.kernels[f"tangent{k}"] for k, _ in enumerate(_flows(program), 1)]
    found = [function(program, kernel, functions=_functions(program)) + "\n" for kernel in kernels]
    flows, count = schedule_of(program).flows, len(_flows(program))
    own = {
        **values,
        **_values(program),
        "flows": len(flows),
        "parts": [*((f"case {k}", k) for k in range(1, count)), ("default", count)],
        "part_of": ", ".join(str(part + 1) for part, _ in flows),
        "row_of": ", ".join(str(row) for _, row in flows),
    }
    return [*found, render("c", "tangent_splitting.c", own)]


def schedule_of(program: Program) -> Schedule:
    """The schedule of a splitting."""
    if program.schedule is None:
        raise ValueError(f"{program.name} is no splitting")
    return program.schedule


def _functions(program: Program) -> dict[str, str]:
    """What flows call functions: those that have a version for small arguments."""
    return FUNCTIONS | {f: f"{program.name}_{f}" for f in FLOW_FUNCTIONS}


def _flows(program: Program) -> list[str]:
    return [name for name in program.kernels if name.startswith("flow")]


def _values(program: Program) -> dict[str, object]:
    schedule = schedule_of(program)
    times = schedule.times
    return {
        "rows": len(times),
        "times": ", ".join(repr(t) for t in times),
        "multiples": ", ".join(repr(m) for m in schedule.multiples),
        "row": max(1, program.coefficients // len(times)),
    }


def _compact(kernel: Kernel, k: int) -> tuple[Kernel, list[int]]:
    """The kernel without the zero increments, and the coordinates that move."""
    values = kernel.roots
    moved = [i for i, e in enumerate(values) if not e.is_zero]
    output = Output("change", tuple(values[i] for i in moved))
    return replace(kernel, name=f"change{k}", outputs=(output,)), moved


def _step(program: Program, schedule: Schedule, end: str, moved: str) -> list[str]:
    """The calls of a step: of functions whose names end so, with what they move."""
    name, row = program.name, _values(program)["row"]
    lines = [f"{name}_flow1{end}(coef, {moved});"]
    if schedule.stages:
        lines += [f"coef += {row};", f"for (int k = 0; k < {schedule.stages}; ++k) {{"]
        for part, at in schedule.pattern:
            place = f"coef + {at} * {row}" if at else "coef"
            lines.append(f"    {name}_flow{part + 1}{end}({place}, {moved});")
        lines += [f"    coef += {schedule.rows} * {row};", "}"]
    return lines
