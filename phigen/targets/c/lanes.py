"""Blocks of steps and groups of members: where they are worth their code, and the kernels in lanes that they call."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Factorisation, Newton, Path
from phigen.symbolic.expression import topological
from phigen.targets.c import functions, paths
from phigen.targets.c.kernels import FUNCTIONS, LANE_FORMULAS, LANE_FUNCTIONS, LANES, function

#: Bytes that the working arrays of a block, or of a group of members, may take on the stack.
MOST_STACK = 256 * 1024

#: Functions that are instructions, or arithmetic.
INLINE = {"abs", "sqrt", "sign", "inv"}

#: Past values that the fitted recurrence may use, a multiple of 8, and values that it is fitted to; fewer where the
#: solver would grow too large.
WINDOW, FITTED, SMALLEST = 40, 112, 32

#: Values that the history of a solver may hold in all.
MOST_HISTORY = 8_000

#: Values that a recurrence is not fitted to, but has to foresee.
CHECKS = 8


def blocks(program: Program) -> bool:
    """Whether `integrate` takes blocks of steps: not for explicit steps, long paths (`paths.applies`), what would need
    too much stack, or where the spec says no."""
    step = program.step
    able = isinstance(step, Newton) or (isinstance(step, Path) and step.lanes is not None)
    return program.lanes and able and _block_size(program, paths.SLOPE_TERMS[-1]) <= MOST_STACK


def groups(program: Program) -> bool:
    """Whether ensembles are integrated in groups, each with its rows of values and weights on the stack."""
    n, memory = program.dimension, remembered(program)
    stages = len(program.fractions)
    rows = program.step.coefficients + (memory["REMEMBERED"] + memory["WINDOW"]) * n
    values = stages * rows + 7 * n + 3 * n * n + sum(paths.stack(program, slope_terms(program)))
    return 8 * LANES * values <= MOST_STACK


def remembered(program: Program) -> dict[str, int]:
    """How many values the solver keeps, and what recurrences make of them."""
    affordable = MOST_HISTORY // (2 * program.dimension * len(program.fractions))
    values = max(SMALLEST, min(FITTED, affordable))
    window = 8 * (values * WINDOW // FITTED // 8)
    ahead = LANES if blocks(program) else 1
    checks = min(CHECKS, window // 4)
    rows = 2 * ((values - window - ahead - checks + 1) // 2)
    return {"REMEMBERED": rows + checks + window + ahead - 1, "WINDOW": window, "AHEAD": ahead, "CHECKS": checks}


def _block_size(program: Program, most_slope_terms: int) -> int:
    n = program.dimension
    more, once = paths.stack(program, most_slope_terms)
    return 8 * LANES * (len(program.fractions) * (program.step.coefficients + 4 * n + 3 * n * n + more) + once)


def slope_terms(program: Program) -> int:
    """Most terms of the expansion of the derivatives of paths."""
    return next(k for k in paths.SLOPE_TERMS if _block_size(program, k) <= MOST_STACK)


def vectorised(program: Program) -> bool:
    """Whether compilers can make vector instructions of the lanes: not of calls to functions of the library."""
    if not blocks(program):
        return False
    calls = set(FUNCTIONS) - set(LANE_FUNCTIONS) - set(LANE_FORMULAS) - INLINE
    return not calls & operations(program)


def operations(program: Program) -> set[str]:
    """What the kernels that are evaluated in lanes call."""
    match program.step:
        case Newton(linearise=linearise):
            kernels = [linearise]
        case Path() as step if step.lanes:
            kernels = paths.kernels(program, step, step.lanes)
        case _:
            kernels = []
    return {e.op for e in topological([e for kernel in kernels for e in kernel.roots])}


def with_formulas(ops: Set[str]) -> set[str]:
    """These operations, and the functions in lanes that formulas for them call."""
    return {*ops, *(f for f in LANE_FUNCTIONS for op in ops & set(LANE_FORMULAS) if f"{{{f}}}" in LANE_FORMULAS[op])}


def called_in_lanes(program: Program) -> set[str]:
    """The functions that blocks call."""
    return with_formulas(operations(program)) if blocks(program) else set()


def factors_of(program: Program) -> Factorisation | None:
    """The factors of the Newton matrix, if it has so many zeros that they are kept, not its inverse."""
    return program.step.factors if isinstance(program.step, Newton) else None


def printed(program: Program) -> list[str]:
    """The kernels in lanes."""
    found, step = functions.phi_lanes(program, called_in_lanes(program)), program.step
    if isinstance(step, Path) and step.lanes:
        return found + [function(program, kernel, lanes=True) for kernel in paths.kernels(program, step, step.lanes)]
    assert isinstance(step, Newton)
    found.append(function(program, step.linearise, lanes=True, sparse=step.factors is not None))
    found.append(function(program, _without_matrices(step.linearise), lanes=True))
    if step.factors:
        substitute = step.factors.substitute
        found += [function(program, kernel, lanes=True) for kernel in (step.factors.factorise, substitute)]
        found.append(function(program, substitute, lanes=True, single=True, shared=["side"]))
    elif step.invert:
        found.append(function(program, step.invert, lanes=True))
    return found


def _without_matrices(kernel: Kernel) -> Kernel:
    """What a pass needs that goes on with the matrices of the last."""
    outputs = tuple(o for o in kernel.outputs if "jacobian" not in o.name)
    needed = set(topological([v for o in outputs for v in o.values]))
    named = tuple((name, value) for name, value in kernel.named if value in needed)
    return replace(kernel, name="evaluate", outputs=outputs, named=named)
