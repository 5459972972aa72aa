"""A model of the cost of steps, to compare schemes: the time of a step, and the step size for a given accuracy.

The time is estimated from the operations of a program. The accuracy is the typical one of an order: an orbit error
of 10^(−order) over a few turns. Step sizes are relative to Gauss collocation of the same order, which has 1. The
numbers were fitted to twenty measured pairs of system and order, on a processor with vectors of eight doubles: seven
systems, rigid bodies, tops, spins, Toda's chain, in dimensions 3 to 15, at the orders 4, 8 and 12. `phigen tune`
measures instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from phigen.scheme import nystrom
from phigen.scheme.program import Program
from phigen.scheme.step_kinds import GAUSS, NEWTON, PATH, StepKind

#: Nanoseconds of an operation in straight-line code, and of a function: from a library, or by a polynomial in a lane.
OPERATION, FUNCTION = 0.5, 7.0
#: Nanoseconds of an explicit step besides its operations: the sums of coordinates, and the latency of the flows.
EXPLICIT_STEP = 25.0
#: Nanoseconds of an operation in a Newton iteration, with several lanes; the number of operations that still fit the
#: caches.
NEWTON_OPERATION, CACHED_OPERATIONS, UNCACHED_OPERATION = 0.04, 3000, 0.1
#: Nanoseconds of a step by Newton's method for each entry of its matrix.
NEWTON_ENTRY = 8.0
#: Nanoseconds of an operation at a stage, with all stages in lanes and about ten sweeps; of the sums over the stages.
STAGE_OPERATION, SWEEPS_OF_STEP = 2.4, 230.0
#: Additions that take the time of a division.
DIVISION = 4
#: Nanoseconds of a step along paths, and of one of its operations.
PATH_STEP, PATH_OPERATION = 200.0, 0.3

#: Step sizes by order, relative to Gauss collocation. Errors of splittings of Nyström type are smaller.
SERIES_STEPS: Mapping[int, float] = {2: 1.3, 4: 0.75, 6: 0.6, 8: 0.5, 10: 0.43, 12: 0.37, 14: 0.33, 16: 0.3}
SPLITTING_STEPS: Mapping[int, float] = {2: 1.3, 4: 2.0, 6: 1.3, 8: 0.9, 10: 0.7}
NYSTROM_STEPS: Mapping[int, float] = {2: 1.3, 4: 4.0, 6: 2.6, 8: 1.7, 10: 1.3}


def cost(program: Program, grown: float = 1.0) -> float:
    """Return the estimated nanoseconds for a unit of time, at the accuracy of the order; the unit is arbitrary.

    ``grown`` multiplies the operations: it gives a lower bound for programs of a higher order.
    """
    step, even_order = program.step, program.order + program.order % 2
    return STEP_TIMES.get(step.kind, _explicit)(program, grown) / _steps(program)[even_order]


def series_bound(program: Program, order: int) -> float:
    """Return a lower bound of the cost of a series, from its program of a lower order."""
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
    counts = program.about.operations
    return counts["additions"] + counts["multiplications"] + DIVISION * counts["divisions"], counts["functions"]


def _explicit(program: Program, grown: float) -> float:
    operations, functions = _operations(program)
    return EXPLICIT_STEP + grown * (OPERATION * operations + FUNCTION * functions)


def _newton(program: Program, grown: float) -> float:
    operations, functions = _operations(program)
    evaluated = grown * (operations + 2 * FUNCTION / OPERATION * functions)
    cache_misses = UNCACHED_OPERATION * max(0.0, evaluated - CACHED_OPERATIONS)
    return len(program.fractions) * (NEWTON_ENTRY * program.dimension**2 + NEWTON_OPERATION * evaluated + cache_misses)


def _gauss(program: Program, grown: float) -> float:
    operations, functions = _operations(program)
    return SWEEPS_OF_STEP + STAGE_OPERATION * grown * (operations + FUNCTION / OPERATION * functions)


def _path(program: Program, grown: float) -> float:
    operations, functions = _operations(program)
    return PATH_STEP + PATH_OPERATION * grown * (operations + FUNCTION / OPERATION * functions)


#: Nanoseconds of a step, of the kinds whose time is not that of an explicit step.
STEP_TIMES: Mapping[StepKind, Callable[[Program, float], float]] = {
    NEWTON: _newton, PATH: _path, GAUSS: _gauss,
}  # fmt: skip
