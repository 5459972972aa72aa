"""What is computed in lanes, in C: blocks of steps, groups of members, and packs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from math import prod

from phigen.lanes.in_lanes import LANES, Blocks, Lanes, Packs, Stages, Traces
from phigen.lanes.lane_functions import SMALL_ARGUMENT_FUNCTIONS, operations
from phigen.scheme.program import Program
from phigen.scheme.steps import Splitting
from phigen.targets.c import functions, splitting
from phigen.targets.c.kernels import function, lane_calls

#: Past values that the fitted recurrence may use, a multiple of 8, and values that it is fitted to; fewer where the
#: solver would grow too large.
WINDOW, FITTED, SMALLEST = 40, 112, 32

#: Values that the history of a solver may hold in all.
MOST_HISTORY = 8_000

#: Values that a recurrence is not fitted to, but has to foresee.
CHECKS = 8


def remembered(program: Program, lanes: Lanes | None) -> dict[str, int]:
    """How many values the solver keeps, and what recurrences make of them."""
    affordable = MOST_HISTORY // (2 * program.dimension * len(program.fractions))
    values = max(SMALLEST, min(FITTED, affordable))
    window = 8 * (values * WINDOW // FITTED // 8)
    ahead = LANES if isinstance(lanes, Blocks) else 1
    checks = min(CHECKS, window // 4)
    rows = 2 * ((values - window - ahead - checks + 1) // 2)
    return {"REMEMBERED": rows + checks + window + ahead - 1, "WINDOW": window, "AHEAD": ahead, "CHECKS": checks}


#: Beginnings of steps whose slopes tell what a stage moves by: that of the next one, that of its own, and those before.
KNOTS = 4


def travels(fractions: Sequence[float]) -> list[list[float]]:
    """For each stage what it moves by, in steps, as a sum of the slopes at the times 2 − `KNOTS` … 1, in steps too.

    It is the integral of the polynomial through them, by Gauss' rule of three points, which is exact.
    """
    knots = range(2 - KNOTS, 2)
    found = []
    for begin, size in zip(accumulate(fractions[:-1], initial=0.0), fractions, strict=True):
        times = [begin + size * (0.5 + offset) for offset in (-(0.15**0.5), 0.0, 0.15**0.5)]
        bases = [[prod((t - j) / (k - j) for j in knots if j != k) for t in times] for k in knots]
        found.append([size * (5 * a + 8 * b + 5 * c) / 18 for a, b, c in bases])
    return found


def grouped(program: Program, lanes: Lanes | None) -> bool:
    """Whether ensembles are integrated in groups, each with its rows of values and weights on the stack."""
    memory = remembered(program, lanes)
    values = len(program.fractions) * (memory["REMEMBERED"] + memory["WINDOW"]) * program.dimension
    return isinstance(lanes, Blocks) and lanes.grouped(values)


def printed(program: Program, lanes: Lanes, packed: Callable[[Packs], list[str]]) -> list[str]:
    """The kernels in lanes; ``packed`` prints those of packs."""
    found = functions.phi_lanes(program, lanes.calls)
    if isinstance(lanes, Blocks | Stages | Traces):
        return found + [
            function(program, k.kernel, lanes=True, single=k.single, sparse=k.sparse, shared=k.shared)
            for k in lanes.kernels
        ]
    return found + (packed(lanes) if isinstance(lanes, Packs) else [])


def printed_back(program: Program, step: Splitting, packs: Packs) -> str:
    """The transposes of the flows of packs."""
    return "\n".join(splitting.adjoint_in_lanes(program, step, packs.transposes, _short(program), lane_calls(program)))


def _short(program: Program) -> dict[str, str]:
    """What loops over lanes call where arguments are small."""
    return {**lane_calls(program), **{f: f"{program.name}_{f}_near" for f in SMALL_ARGUMENT_FUNCTIONS}}


def packed_kernels(program: Program, packs: Packs) -> list[str]:
    """The kernels of packs whose step is one kernel."""
    found = [function(program, kernel, lanes=True, alike=["coef"]) for kernel in packs.kernels]
    return found + [function(program, kernel, lanes=True) for kernel in packs.transposes]


def packed_step(program: Program, step: Splitting, packs: Packs) -> list[str]:
    """The flows of packs, and the step that they are composed to."""
    called = operations([*packs.kernels, *packs.transposes])
    found = functions.near(program, [f for f in SMALL_ARGUMENT_FUNCTIONS if f in called])
    found += splitting.in_lanes(program, step, "", _short(program))
    return found + (splitting.in_lanes(program, step, "_far", lane_calls(program)) if packs.small_argument else [])
