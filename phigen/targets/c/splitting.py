"""The step of a splitting in C: a function for each flow, and a function that calls the flows in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from phigen.ir import nodes as ir
from phigen.ir.flow_functions import FlowFunctions, FlowTransposes, Transposed, group_flow, group_schedule
from phigen.ir.passes.forms import OWN
from phigen.lanes.lane_functions import SMALL_ARGUMENT_FUNCTIONS, operations
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.steps import Adjoint, Splitting
from phigen.symbolic.expression import symbols_of
from phigen.targets.c.functions import FLOW_FUNCTIONS
from phigen.targets.c.kernels import function
from phigen.targets.c.loops import commented, table


def sizes(step: Splitting) -> list[tuple[str, int, str]]:
    """Return the sizes of a splitting as constants: name, value and comment."""
    constants = [
        (
            "ROWS_OF_FLOWS",
            len(step.schedule.times),
            "number of rows of coefficients, one for each flow and its duration",
        )
    ]
    constants.append(("ROW", max(1, step.row), "number of coefficients in a row"))
    flows = len(step.schedule.flows_of_run)
    said = "number of flows in a " + ("run of one step" if step.schedule.begin else "step")
    constants += [("FLOWS", flows, said)] if step.tangents or step.adjoint else []
    corrected = step.adjoint is not None and bool(step.schedule.begin)
    return (
        constants
        + [("BEGUN", len(step.schedule.begin), "flows before the first step of a run, and as many after the last")]
        * corrected
    )


def printed(program: Program, step: Splitting) -> str:
    """Return the C functions of the flows, and the C function of a step."""
    build, schedule = _functions(program, step), step.schedule
    texts = [function(program, replace(step.prepare, name="prepare_row"))]
    texts += [function(program, step.refresh, name="at_step" if program.noise else "at_time")] if step.refresh else []
    # With an attitude, the function of a flow is too long to be inlined.
    linkage = "static inline" if build.turns else "static"
    for k, flow in enumerate(program.attitude.turns if program.attitude else step.flows, 1):
        kernel, updated = _flow(flow, k)
        texts.append(function(program, kernel, versions=_VERSIONS, linkage=linkage))
        texts.append(commented(build.flow(k, updated), program, "static inline"))
    texts.append(commented(build.schedule(schedule), program, "static inline"))
    texts += [commented(build.corrector(schedule), program)] if schedule.begin else []
    return "\n".join(texts)


def _functions(program: Program, step: Splitting) -> FlowFunctions:
    """Return the builder of the functions of flows.

    With a monitor, flows update two more values: the physical time, and a sum that becomes NaN where the logarithms of
    the monitor are not defined.
    """
    along = program.dimension + (2 if program.monitor else 0)
    return FlowFunctions(program.dimension, along, turns=bool(program.attitude), stores=bool(step.adjoint))


def in_lanes(program: Program, step: Splitting, form: str, versions: Mapping[str, str]) -> list[str]:
    """Return the text of the step for batches of members in SIMD lanes.

    The step calls the ``versions`` of elementary functions. ``form`` is appended to the names of the printed functions.
    """
    texts, linkage = list[str](), f"{program.name}_IN_PLACE static inline"
    for k, flow in enumerate(step.flows, 1):
        kernel, updated = _flow(flow, k)
        kernel = replace(kernel, name=kernel.name + form)
        texts.append(function(program, kernel, lanes=True, alike=["coef"], versions=versions))
        texts.append(commented(group_flow(k, form, updated), program, linkage))
    return [*texts, commented(group_schedule(step.schedule, form), program, linkage)]


def _tables(program: Program, step: Splitting, prefix: str, suffix: str) -> str:
    """Return the text of two tables. They have, for each flow of a step, the part of H and the row of coefficients."""
    flows, length = step.schedule.flows_of_run, ir.fixed("FLOWS")
    parts = ir.ConstantTable(f"{prefix}part{suffix}", tuple(part + 1 for part, _ in flows), length)
    rows = ir.ConstantTable(f"{prefix}row{suffix}", tuple(row for _, row in flows), length)
    lines = [table(one, program) for one in (parts, rows)]
    return "\n".join(["/* Flows of one step: the part of H, and the row of coefficients. */", *lines]) + "\n"


def tangent(program: Program, step: Splitting) -> str:
    """Return the C functions that compute the derivatives of the flows: the Jacobian matrices of their increments."""
    texts = [function(program, kernel, versions=_VERSIONS) for kernel in step.tangents]
    applied = commented(_functions(program, step).tangent(len(step.flows)), program)
    return "\n".join([*texts, _tables(program, step, "", "_of"), applied])


def adjoint(program: Program, step: Splitting, adjoint: Adjoint) -> str:
    """Return the C functions that pull a cotangent back through the flows."""
    kernels, build = _transposed(program, step, adjoint.steps)
    texts = [function(program, kernel, versions=_VERSIONS) for kernel in kernels]
    return "\n".join([*texts, _tables(program, step, "flow_", ""), commented(build.back(), program)])


def adjoint_in_lanes(
    program: Program, step: Splitting, back: Sequence[Kernel], near: Mapping[str, str], full_range: Mapping[str, str]
) -> list[str]:
    """Return the text of the transposed flows for SIMD batches of members.

    The transposed flows call the versions ``near`` of elementary functions. Some of these versions are correct only for
    small arguments. A transposed flow that calls one of them is printed a second time, with the versions ``full_range``
    for all arguments.
    """
    kernels, build = _transposed(program, step, back)
    texts = []
    for kernel in kernels:
        linkage = f"{program.name}_IN_PLACE static inline"
        texts.append(function(program, kernel, lanes=True, versions=near, linkage=linkage))
        if reaches_full_range(kernel):
            full_range_kernel = replace(kernel, name=f"{kernel.name}_full_range")
            linkage = f"{program.name}_APART static"
            texts.append(function(program, full_range_kernel, lanes=True, versions=full_range, linkage=linkage))
    texts += [] if build.recomputes else [commented(build.group_flows(), program)]
    return [*texts, commented(build.group_back(), program)]


def reaches_full_range(kernel: Kernel) -> bool:
    """Whether a kernel in lanes needs a second version, in which elementary functions accept all arguments."""
    return not operations([kernel]).isdisjoint(SMALL_ARGUMENT_FUNCTIONS)


def _transposed(program: Program, step: Splitting, back: Sequence[Kernel]) -> tuple[list[Kernel], FlowTransposes]:
    """Return the transposed flows without outputs that are always zero, and the builder of the functions that call
    them.
    """
    kernels, flows = list[Kernel](), list[Transposed]()
    for flow, kernel in zip(step.flows, back, strict=True):
        reached = [[i for i, e in enumerate(o.values) if not e.is_zero] for o in kernel.outputs]
        outputs = [
            replace(o, values=tuple(o.values[i] for i in i_s)) for o, i_s in zip(kernel.outputs, reached, strict=True)
        ]
        kernels.append(replace(kernel, outputs=tuple(outputs)))
        state, row, before = (*reached, [])[:3]
        full_range, full_range_back = reaches_full_range(flow), reaches_full_range(kernels[-1])
        flows.append(Transposed(state, row, before, _read(kernels[-1]), full_range, full_range_back))
    recomputes = any(len(kernel.outputs) > 2 for kernel in kernels)
    return kernels, FlowTransposes(flows, program.dimension, max(1, step.row), recomputes=recomputes)


def _read(kernel: Kernel) -> list[tuple[int, int]]:
    """Return the coordinates of the state that a kernel reads, as ranges (first index, length)."""
    used = {s for e in kernel.roots for s in symbols_of(e)}
    places = [i for i, s in enumerate(kernel.inputs["state"]) if s in used]
    runs = groupby(places, key=lambda i: i - places.index(i))
    return [(of[0], len(of)) for _, run in runs for of in [list(run)]]


#: The versions of elementary functions that flows call. They use a polynomial if the argument is small.
_VERSIONS = {f: f + OWN for f in FLOW_FUNCTIONS}


def _flow(kernel: Kernel, k: int) -> tuple[Kernel, list[int]]:
    """Remove all increments that are zero from the kernel of a flow. Return the new kernel, and the indices of the
    values that the flow updates.
    """
    increment = kernel.outputs[0].values
    updated = [i for i, e in enumerate(increment) if not e.is_zero]
    output = Output("change", tuple(increment[i] for i in updated))
    return replace(kernel, name=f"change{k}", outputs=(output, *kernel.outputs[1:])), updated
