"""A model of the cost of steps, to compare schemes: the time of a step, and the step size for a given accuracy.

The time is estimated from the operations of a program. The accuracy is typical for an order: an orbit error of
10^(−order) over a few turns. Step sizes are relative to those of Gauss collocation of the same order. The numbers were
fitted to measurements of twelve systems (rigid bodies, tops, spins, vortices, species) in dimensions 2 to 15 at the
orders 4, 8 and 12, on a processor with vectors of eight doubles. `phigen tune` measures instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

from phigen.scheme import nystrom
from phigen.scheme.lowering import operation_counts
from phigen.scheme.program import Program
from phigen.scheme.step_kinds import GAUSS, NEWTON, PATH, StepKind
from phigen.scheme.steps import Gauss

#: Nanoseconds of an operation in straight-line code, and of a function (from a library, or a polynomial in a lane).
OPERATION, FUNCTION = 0.5, 7.0
#: Nanoseconds of an explicit step in addition to its operations: the sums of coordinates, and the latency of the flows.
EXPLICIT_STEP = 25.0
#: Flows of many coordinates do not all wait for one another. The time of their operations is divided by the dimension
#: over WAITING_COORDINATES, at least 1 and at most MOST_PARALLEL. Without this, the estimates for tops and so(4) were
#: 2.4 times too large.
WAITING_COORDINATES, MOST_PARALLEL = 2.6, 2.4
#: Nanoseconds of an operation in a Newton iteration with several lanes, the number of operations that fit into the
#: caches, and nanoseconds of the operations beyond that number.
NEWTON_OPERATION, CACHED_OPERATIONS, UNCACHED_OPERATION = 0.04, 3000, 0.1
#: Nanoseconds of a step by Newton's method for each entry of its matrix.
NEWTON_ENTRY = 8.0
#: Nanoseconds, in all sweeps of a Gauss step, of an operation at eight stages in lanes and of a function; nanoseconds
#: of the rest of a step, and of a change of frame. With up to four stages, operations take half of the time.
STAGE_OPERATION, STAGE_FUNCTION, GAUSS_STEP, CHANGE_OF_FRAME = 3.0, 70.0, 130.0, 30.0
#: Number of additions that take the time of a division.
DIVISION = 4
#: Number of stages that fill a SIMD vector.
LANES = 8
#: Nanoseconds of a step along paths without its operations, and of one of its operations.
PATH_STEP, PATH_OPERATION = 200.0, 0.3

#: Step sizes for equal accuracy by order, relative to Gauss collocation. Splittings of Nyström type have smaller errors
#: than others.
SERIES_STEPS: Mapping[int, float] = {2: 1.3, 4: 0.63, 6: 0.55, 8: 0.5, 10: 0.43, 12: 0.37, 14: 0.33, 16: 0.3}
SPLITTING_STEPS: Mapping[int, float] = {2: 1.3, 4: 2.5, 6: 1.3, 8: 0.9, 10: 0.7}
NYSTROM_STEPS: Mapping[int, float] = {2: 1.3, 4: 4.0, 6: 2.6, 8: 1.6, 10: 1.3}


def cost(program: Program, grown: float = 1.0) -> float:
    """Return the estimated nanoseconds for a unit of time, at the accuracy of the order; the unit is arbitrary.

    The operations are multiplied by ``grown``, which yields a lower bound for programs of a higher order.
    """
    step, even_order = program.step, program.order + program.order % 2
    return STEP_TIMES.get(step.kind, _explicit)(program, grown) / _steps(program)[even_order]


def series_bound(program: Program, order: int) -> float:
    """Return a lower bound of the cost of a series of a given ``order``, from its program of a lower order."""
    longest = cost(program, order / program.order) * _steps(program)[program.order + program.order % 2]
    return longest / SERIES_STEPS[order + order % 2]


def _steps(program: Program) -> Mapping[int, float]:
    if program.step.kind.collocates:
        return dict.fromkeys(SERIES_STEPS, 1.0)
    schedule = program.step.flow_schedule
    if schedule is not None:
        if len(schedule.flows) == 1 and not program.time:
            return dict.fromkeys(SERIES_STEPS, float("inf"))  # the exact flow of H
        return NYSTROM_STEPS if program.step.method_name in nystrom.NAMES else SPLITTING_STEPS
    return SPLITTING_STEPS if len(program.fractions) > 1 else SERIES_STEPS


def _operations(program: Program) -> tuple[int, int]:
    """Return the number of arithmetic operations, in units of additions, and of function calls."""
    return _counted(program.about.operations)


def _counted(counts: Mapping[str, int]) -> tuple[int, int]:
    return counts["additions"] + counts["multiplications"] + DIVISION * counts["divisions"], counts["functions"]


def _explicit(program: Program, grown: float) -> float:
    operations, functions = _operations(program)
    parallel = min(MOST_PARALLEL, max(1.0, program.dimension / WAITING_COORDINATES))
    return EXPLICIT_STEP + grown * (OPERATION * operations + FUNCTION * functions) / parallel


def _newton(program: Program, grown: float) -> float:
    operations, functions = _operations(program)
    evaluated = grown * (operations + 2 * FUNCTION / OPERATION * functions)
    cache_misses = UNCACHED_OPERATION * max(0.0, evaluated - CACHED_OPERATIONS)
    return len(program.fractions) * (NEWTON_ENTRY * program.dimension**2 + NEWTON_OPERATION * evaluated + cache_misses)


def _gauss(program: Program, grown: float) -> float:
    step = cast(Gauss, program.step)
    counts = operation_counts(step.reduced.slope.roots) if step.reduced else program.about.operations
    operations, functions = _counted(counts)
    lanes = 1.0 if step.tableau.stages > LANES // 2 else 0.5
    once = GAUSS_STEP + (CHANGE_OF_FRAME if step.frame else 0.0)
    return once + lanes * grown * (STAGE_OPERATION * operations + STAGE_FUNCTION * functions)


def _path(program: Program, grown: float) -> float:
    operations, functions = _operations(program)
    return PATH_STEP + PATH_OPERATION * grown * (operations + FUNCTION / OPERATION * functions)


#: Functions that estimate the nanoseconds of a step, for the kinds of steps that are not like explicit steps.
STEP_TIMES: Mapping[StepKind, Callable[[Program, float], float]] = {
    NEWTON: _newton, PATH: _path, GAUSS: _gauss,
}  # fmt: skip
