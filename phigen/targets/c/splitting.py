"""The step of a splitting in C: one function for each flow, and the schedule that calls them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.steps import Splitting
from phigen.targets.c.kernels import FUNCTIONS, function
from phigen.targets.c.small import FLOW_FUNCTIONS
from phigen.targets.rendering import render


def pieces(program: Program, step: Splitting, values: Mapping[str, object]) -> list[str]:
    """The functions of the step."""
    own = {**values, **_values(step)}
    prepare = function(program, replace(step.prepare, name="prepare_row")) + "\n"
    found, functions = [prepare, render("c", "add.c", values)], _functions(program)
    for k, flow in enumerate(step.flows, 1):
        kernel, moved = _compact(flow, k)
        found.append(function(program, kernel, functions=functions) + "\n")
        found.append(
            render("c", "flow.c", own | {"k": k, "moved": list(enumerate(moved)), "count": max(1, len(moved))})
        )
    rows = "rows_kicks.c" if step.schedule.multiples else "rows.c"
    calls = _calls(program, step, "", "x, moved, s->x")
    return [*found, render("c", rows, own), render("c", "splitting.c", own | {"step": calls})]


def in_lanes(
    program: Program, step: Splitting, values: Mapping[str, object], form: str, functions: Mapping[str, str]
) -> list[str]:
    """Steps of the members of packs, which call ``functions``; ``form`` is added to the names."""
    found, end = [], f"{form}_lanes"
    for k, flow in enumerate(step.flows, 1):
        kernel, moved = _compact(flow, k)
        kernel = replace(kernel, name=kernel.name + form)
        found.append(function(program, kernel, lanes=True, shared=["coef"], functions=functions) + "\n")
        own = {"k": k, "form": end, "moved": list(enumerate(moved)), "count": max(1, len(moved))}
        found.append(render("c", "flow_lanes.c", {**values, **own}))
    calls = _calls(program, step, end, "pack, packs")
    return [*found, render("c", "splitting_lanes.c", {**values, "form": end, "step": calls})]


def tangent(program: Program, step: Splitting, values: Mapping[str, object]) -> list[str]:
    """The derivative of a step."""
    found = [function(program, kernel, functions=_functions(program)) + "\n" for kernel in step.tangents]
    flows, count = step.schedule.flows, len(step.flows)
    own = {
        **values,
        **_values(step),
        "flows": len(flows),
        "parts": [*((f"case {k}", k) for k in range(1, count)), ("default", count)],
        "part_of": ", ".join(str(part + 1) for part, _ in flows),
        "row_of": ", ".join(str(row) for _, row in flows),
    }
    return [*found, render("c", "tangent_splitting.c", own)]


def _functions(program: Program) -> dict[str, str]:
    """What flows call functions: those that have a version for small arguments."""
    return FUNCTIONS | {f: f"{program.name}_{f}" for f in FLOW_FUNCTIONS}


def _values(step: Splitting) -> dict[str, object]:
    schedule = step.schedule
    return {
        "rows": len(schedule.times),
        "times": ", ".join(repr(t) for t in schedule.times),
        "multiples": ", ".join(repr(m) for m in schedule.multiples),
        "row": max(1, step.row),
    }


def _compact(kernel: Kernel, k: int) -> tuple[Kernel, list[int]]:
    """The kernel without the zero increments, and the coordinates that move."""
    values = kernel.roots
    moved = [i for i, e in enumerate(values) if not e.is_zero]
    output = Output("change", tuple(values[i] for i in moved))
    return replace(kernel, name=f"change{k}", outputs=(output,)), moved


def _calls(program: Program, step: Splitting, end: str, moved: str) -> list[str]:
    """The calls of a step: of functions whose names end so, with what they move."""
    name, row, schedule = program.name, max(1, step.row), step.schedule
    lines = [f"{name}_flow1{end}(coef, {moved});"]
    if schedule.stages:
        lines += [f"coef += {row};", f"for (int k = 0; k < {schedule.stages}; ++k) {{"]
        for part, at in schedule.pattern:
            place = f"coef + {at} * {row}" if at else "coef"
            lines.append(f"    {name}_flow{part + 1}{end}({place}, {moved});")
        lines += [f"    coef += {schedule.rows} * {row};", "}"]
    return lines
