"""The step of a splitting in C: one function for each flow, and the schedule that calls them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from phigen.ir.passes.forms import OWN
from phigen.lanes.lane_functions import SMALL_ARGUMENT_FUNCTIONS, operations
from phigen.scheme.alternation import Schedule
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.steps import Adjoint, Splitting
from phigen.symbolic.expression import symbols_of
from phigen.targets.c.functions import FLOW_FUNCTIONS
from phigen.targets.c.kernels import function
from phigen.targets.rendering import render


def sizes(step: Splitting) -> list[tuple[str, int, str]]:
    """Return the constants of a splitting: name, value and comment."""
    constants = [("ROWS_OF_FLOWS", len(step.schedule.times), "times of flows in a step, each with its coefficients")]
    constants.append(("ROW", max(1, step.row), "coefficients for one of them"))
    flows = len(step.schedule.flows_of_run)
    said = "in a run of one step" if step.schedule.begin else "in a step"
    constants += [("FLOWS", flows, said)] if step.tangents or step.adjoint else []
    corrected = step.adjoint is not None and bool(step.schedule.begin)
    return constants + [("BEGUN", len(step.schedule.begin), "before the first step, and after the last")] * corrected


def printed(program: Program, step: Splitting) -> str:
    """Return the functions of the flows, and of one step."""
    texts = [function(program, replace(step.prepare, name="prepare_row"))]
    texts += [function(program, step.refresh, name="at_step" if program.noise else "at_time")] if step.refresh else []
    more = f", double element[{program.name}_ELEMENT]" if program.attitude else ""
    for k, flow in enumerate(program.attitude.turns if program.attitude else step.flows, 1):
        kernel, values = _flow(program, flow, k)
        # With an element the function would be too long for compilers to inline it.
        linkage = "static inline" if more else "static"
        texts.append(function(program, kernel, versions=_VERSIONS, linkage=linkage))
        texts.append(render("c", "flow.c", {**values, "more": more}))
    along = _along(program)
    arguments = f"const double *coef, double x[{along}], double moved[{along}], const double start[{along}]"
    passed = _moves(bool(program.attitude))
    stored = f", double (*kept)[{program.dimension}]" if step.adjoint else ""
    texts.append(_steps(program, step, "", "static inline ", arguments + more + stored, passed, stores=bool(stored)))
    texts += [_corrector(program, step.schedule, along, stored)] if step.schedule.begin else []
    return "\n".join(texts)


def _corrector(program: Program, schedule: Schedule, along: int, stored: str) -> str:
    """The flows before the first and after the last step of a run, in alternation."""
    (outer, row), *others = schedule.begin
    (_, last_row), *_ = schedule.end
    inner = others[0][0] + 1 if others else 0
    values = {"n": along, "outer": outer + 1, "inner": inner, "first": row, "last": last_row, "stored": stored}
    return render("c", "corrector.c", {"NAME": program.name, "count": len(schedule.begin), **values})


def in_lanes(program: Program, step: Splitting, form: str, versions: Mapping[str, str]) -> list[str]:
    """Return the step of packs of members, with these ``versions`` of functions; ``form`` is added to the names."""
    texts = []
    for k, flow in enumerate(step.flows, 1):
        kernel, values = _flow(program, flow, k)
        kernel = replace(kernel, name=kernel.name + form)
        texts.append(function(program, kernel, lanes=True, alike=["coef"], versions=versions))
        texts.append(render("c", "flow.c", {**values, "form": f"{form}_lanes"}))
    arguments = f"int row, int own, {program.name}_group *group"
    linkage = f"{program.name}_IN_PLACE static inline "
    return [*texts, _steps(program, step, f"{form}_lanes", linkage, arguments, "own, group")]


def tangent(program: Program, step: Splitting) -> str:
    """Return the derivatives of the flows."""
    count, flows, turned = len(step.flows), step.schedule.flows_of_run, bool(program.attitude)
    values = {
        "turned": turned,
        "moves": _moves(turned),
        "NAME": program.name,
        "n": program.dimension,
        "along": _along(program),
        "n2": program.dimension**2,
        "parts": [*((f"case {k}", k) for k in range(1, count)), ("default", count)],
        "part_of": ", ".join(str(part + 1) for part, _ in flows),
        "row_of": ", ".join(str(row) for _, row in flows),
    }
    texts = [function(program, kernel, versions=_VERSIONS) for kernel in step.tangents]
    return "\n".join([*texts, render("c", "tangent_flows.c", values)])


def adjoint(program: Program, step: Splitting, adjoint: Adjoint) -> str:
    """Return the transposes of the flows."""
    flows, (kernels, values) = step.schedule.flows_of_run, _transposed(program, step, adjoint.steps)
    values["part_of"] = ", ".join(str(part + 1) for part, _ in flows)
    values["row_of"] = ", ".join(str(row) for _, row in flows)
    values["unused"] = not any(kernel.outputs[1].values for kernel in kernels)
    texts = [function(program, kernel, versions=_VERSIONS) for kernel in kernels]
    return "\n".join([*texts, render("c", "adjoint_flows.c", values)])


def adjoint_in_lanes(
    program: Program, step: Splitting, back: Sequence[Kernel], near: Mapping[str, str], far: Mapping[str, str]
) -> list[str]:
    """Return the transposes of the flows of packs, which call the small-argument functions ``near``.

    Flows that call such functions have a second version with the full-range functions ``far``.
    """
    kernels, values = _transposed(program, step, back)
    texts = []
    for kernel in kernels:
        linkage = f"{program.name}_IN_PLACE static inline"
        texts.append(function(program, kernel, lanes=True, versions=near, linkage=linkage))
        if reaches_far(kernel):
            far_kernel = replace(kernel, name=f"{kernel.name}_far")
            linkage = f"{program.name}_APART static"
            texts.append(function(program, far_kernel, lanes=True, versions=far, linkage=linkage))
    values["more"] = ", before" * any(len(kernel.outputs) > 2 for kernel in kernels)
    values["undone"] = any(len(kernel.outputs) > 2 for kernel in kernels)
    values["linear"] = not any(_read(kernel) for kernel in kernels)
    return [*texts, render("c", "adjoint_flows_lanes.c", values)]


def reaches_far(kernel: Kernel) -> bool:
    """Whether a kernel has a second version in lanes, with full-range functions for large arguments."""
    return not operations([kernel]).isdisjoint(SMALL_ARGUMENT_FUNCTIONS)


def _transposed(program: Program, step: Splitting, back: Sequence[Kernel]) -> tuple[list[Kernel], dict[str, object]]:
    """Return the transposes of the flows without outputs that are always zero, and the values of the templates."""
    kernels, parts = [], []
    for k, kernel in enumerate(back, 1):
        reached = [[i for i, e in enumerate(o.values) if not e.is_zero] for o in kernel.outputs]
        outputs = [
            replace(o, values=tuple(o.values[i] for i in i_s)) for o, i_s in zip(kernel.outputs, reached, strict=True)
        ]
        kernels.append(replace(kernel, outputs=tuple(outputs)))
        label = f"case {k}" if k < len(back) else "default"
        far = reaches_far(step.flows[k - 1]), reaches_far(kernels[-1])
        state, row, before = (list(enumerate(i_s)) for i_s in (*reached, [])[:3])
        parts.append((label, k, *far, state, row, _read(kernels[-1]), before))
    return kernels, {"NAME": program.name, "n": program.dimension, "row": max(1, step.row), "parts": parts}


def _read(kernel: Kernel) -> list[tuple[int, int]]:
    """Return the coordinates of the state that a kernel reads, as runs: the first of each, and their number."""
    used = {s for e in kernel.roots for s in symbols_of(e)}
    places = [i for i, s in enumerate(kernel.inputs["state"]) if s in used]
    runs = groupby(places, key=lambda i: i - places.index(i))
    return [(of[0], len(of)) for _, run in runs for of in [list(run)]]


def _moves(turned: bool) -> str:
    """Return the arguments of a flow that it updates."""
    return "x, moved, start" + ", element" * turned


def _along(program: Program) -> int:
    """Return the number of values that flows update: the coordinates, with a monitor also the time and a sum.

    The sum is NaN outside of the domain of the flows.
    """
    return program.dimension + (2 if program.monitor else 0)


#: The versions of functions that flows call, which have a polynomial for small arguments.
_VERSIONS = {f: f + OWN for f in FLOW_FUNCTIONS}


def _flow(program: Program, kernel: Kernel, k: int) -> tuple[Kernel, dict[str, object]]:
    """Return the kernel of a flow without the zero increments, and the values of the template of the flow."""
    moved, increment = _moved(kernel), kernel.outputs[0].values
    output = Output("change", tuple(increment[i] for i in moved))
    values = {"NAME": program.name, "n": _along(program), "k": k, "moved": list(enumerate(moved)), "form": ""}
    change = replace(kernel, name=f"change{k}", outputs=(output, *kernel.outputs[1:]))
    return change, values | {"count": max(1, len(moved))}


def _moved(kernel: Kernel) -> list[int]:
    """Return the indices of the values that a flow changes."""
    return [i for i, e in enumerate(kernel.outputs[0].values) if not e.is_zero]


def _steps(
    program: Program, step: Splitting, form: str, linkage: str, arguments: str, passed: str, *, stores: bool = False
) -> str:
    """Return the functions of the schedule of flows.

    Flows receive the address of their coefficients, in lanes the number of their row. With ``stores``, the argument
    ``kept`` of the step receives the states before each flow, unless it is NULL.
    """
    schedule = step.schedule
    first, row = ("row", "") if form else ("coef", f"{program.name}_ROW")

    def further(rows: int) -> str:
        return f"{rows} * {row}" if row and rows > 1 else row or str(rows)

    pattern = [(part + 1, f"{first} + {further(at)}" if at else first) for part, at in schedule.pattern]
    values: dict[str, object] = {
        "form": form,
        "linkage": linkage,
        "arguments": arguments,
        "passed": passed,
        "pattern": pattern,
    }
    values |= {"kept": stores}
    values |= {"start": first, "next": f"{first} += {further(1)}", "further": f"{first} += {further(schedule.rows)}"}
    return render("c", "flows.c", {"NAME": program.name, "stages": schedule.stages, **values})
