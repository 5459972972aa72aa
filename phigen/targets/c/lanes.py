"""SIMD lowering in C: blocks of steps, and batches of members.

In the runtime, a batch of members of an ensemble is called a group if steps are implicit, and a pack if they are
explicit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from math import prod

from phigen.ir.passes.forms import NEAR, SIMD
from phigen.lanes.in_lanes import LANES, Blocks, Lanes, Packs, Stages, Traces
from phigen.lanes.lane_functions import SMALL_ARGUMENT_FUNCTIONS, operations
from phigen.scheme.program import Program
from phigen.scheme.steps import Splitting
from phigen.targets.c import functions, splitting
from phigen.targets.c.kernels import function

#: Predictors fit linear recurrences to past solutions. WINDOW is the number of past values from which a recurrence
#: computes the next value; WINDOW is a multiple of 8. FITTED is the number of values to which the recurrence is fitted.
#: For large systems, 112 values would need too much memory; the number is then smaller, but at least SMALLEST.
WINDOW, FITTED, SMALLEST = 40, 112, 32

#: Largest number of past values that a solver stores for its recurrences: 64 kB in double precision.
MOST_HISTORY = 8_000

#: Number of past values on which a recurrence is tested. The recurrence is not fitted to these values.
CHECKS = 8


def remembered(program: Program, lanes: Lanes | None) -> dict[str, int]:
    """Return the sizes of the recurrences of a solver as constants by name.

    The sizes are four numbers of values: those that are stored, those from which a recurrence computes the next value,
    those that a recurrence predicts, and those on which a recurrence is tested.
    """
    affordable = MOST_HISTORY // (2 * program.dimension * len(program.fractions))
    values = max(SMALLEST, min(FITTED, affordable))
    window = 8 * (values * WINDOW // FITTED // 8)
    ahead = LANES if isinstance(lanes, Blocks) else 1
    checks = min(CHECKS, window // 4)
    rows = 2 * ((values - window - ahead - checks + 1) // 2)
    return {"REMEMBERED": rows + checks + window + ahead - 1, "WINDOW": window, "AHEAD": ahead, "CHECKS": checks}


#: Number of values of ẋ from which the increment of a stage is predicted. The times of these values are the end of the
#: present step, the start of this step, and the starts of earlier steps. An explicit method predicts the state at the
#: end of the step.
KNOTS = 4


def travels(fractions: Sequence[float]) -> list[list[float]]:
    """Return, for each stage, the weights w with which h Σ w_k f_k predicts the increment of the stage.

    The f_k are the values of ẋ at the times 2 − `KNOTS` … 1, in units of the step size h. The sum is an integral over
    the time of the stage. The integrand is the polynomial through the f_k. Gauss' rule of three points computes this
    integral exactly.
    """
    knots = range(2 - KNOTS, 2)
    weights = []
    for begin, size in zip(accumulate(fractions[:-1], initial=0.0), fractions, strict=True):
        times = [begin + size * (0.5 + offset) for offset in (-(0.15**0.5), 0.0, 0.15**0.5)]
        bases = [[prod((t - j) / (k - j) for j in knots if j != k) for t in times] for k in knots]
        weights.append([size * (5 * a + 8 * b + 5 * c) / 18 for a, b, c in bases])
    return weights


def grouped(program: Program, lanes: Lanes | None) -> bool:
    """Whether members are integrated in groups (see `Blocks`). A group must fit on the stack, together with the earlier
    values that its predictors store.
    """
    memory = remembered(program, lanes)
    values = len(program.fractions) * (memory["REMEMBERED"] + memory["WINDOW"]) * program.dimension
    return isinstance(lanes, Blocks) and lanes.grouped(values)


def printed(
    program: Program, lanes: Lanes, packed: Callable[[Packs], list[str]], *, batched: bool = False
) -> list[str]:
    """Return the text of the kernels in SIMD lanes.

    ``packed`` prints the kernels for batches of members with explicit steps. ``batched`` adds the kernels for batches
    of members with Gauss steps.
    """
    texts = functions.phi_lanes(program, lanes.calls)
    if isinstance(lanes, Blocks | Stages | Traces):
        of_members = lanes.batched if isinstance(lanes, Stages) and batched else ()
        return texts + [
            function(program, k.kernel, lanes=True, single=k.single, sparse=k.sparse, shared=k.shared)
            for k in (*lanes.kernels, *of_members)
        ]
    return texts + (packed(lanes) if isinstance(lanes, Packs) else [])


def printed_back(program: Program, step: Splitting, packs: Packs) -> str:
    """Return the C functions of the transposed flows of a splitting, for SIMD batches of members."""
    return "\n".join(splitting.adjoint_in_lanes(program, step, packs.transposes, _NEAR, SIMD))


#: The versions of elementary functions that loops over lanes call. Some versions are correct only for small arguments.
_NEAR = {**SIMD, **{f: f + NEAR for f in SMALL_ARGUMENT_FUNCTIONS}}


def packed_kernels(program: Program, packs: Packs) -> list[str]:
    """Return the text of the kernels for batches of members whose step is a single kernel."""
    texts = [function(program, kernel, lanes=True, alike=["coef"]) for kernel in packs.kernels]
    return texts + [function(program, kernel, lanes=True) for kernel in packs.transposes]


def packed_step(program: Program, step: Splitting, packs: Packs) -> list[str]:
    """Return the text of the flows for batches of members, and of the step that consists of these flows."""
    called = operations([*packs.kernels, *packs.transposes])
    texts = functions.near(program, [f for f in SMALL_ARGUMENT_FUNCTIONS if f in called])
    texts += splitting.in_lanes(program, step, "", _NEAR)
    return texts + (splitting.in_lanes(program, step, "_full_range", SIMD) if packs.small_argument else [])
