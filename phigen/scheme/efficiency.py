"""A model of computing times, to compare schemes: the time of a step, and the step size for a given accuracy.

The time is estimated from the number of operations in a program. The accuracy depends on the order only: an orbit error
of 10^(−order) after a few revolutions. Step sizes are relative to those of Gauss collocation with the same order. The
numbers were fitted to measurements of twelve systems (rigid bodies, tops, spins, vortices, species) in dimensions 2 to
15 at the orders 4, 8 and 12, on a processor with vectors of eight doubles. `phigen tune` measures times instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

from phigen.scheme import nystrom
from phigen.scheme.lowering import operation_counts
from phigen.scheme.program import Program
from phigen.scheme.step_kinds import GAUSS, NEWTON, PATH, StepKind
from phigen.scheme.steps import Gauss

#: Nanoseconds of an arithmetic operation in straight-line code, and of a call of an elementary function.
OPERATION, FUNCTION = 0.5, 7.0
#: Nanoseconds of an explicit step in addition to its operations: the compensated sums of the coordinates, and the time
#: for which each flow waits for the results of the preceding flow.
EXPLICIT_STEP = 25.0
#: Flows that change different coordinates need not wait for one another. So the time of the operations is divided by
#: n/WAITING_COORDINATES in dimension n. This divisor is at least 1 and at most MOST_PARALLEL. Without the division, the
#: estimates for tops and so(4) were 2.4 times too large.
WAITING_COORDINATES, MOST_PARALLEL = 2.6, 2.4
#: Three numbers. First: nanoseconds of an operation in a Newton iteration with several SIMD lanes. Second: the number
#: of operations whose code fits into the caches. Third: additional nanoseconds of each operation beyond this number.
NEWTON_OPERATION, CACHED_OPERATIONS, UNCACHED_OPERATION = 0.04, 3000, 0.1
#: Nanoseconds of a step by Newton's method for each entry of its matrix.
NEWTON_ENTRY = 8.0
#: Nanoseconds of a Gauss step with eight stages in SIMD lanes, summed over all sweeps: for each arithmetic operation in
#: the vector field, for each elementary function in the vector field, for all other work of a step, and for the change
#: to the frame of the next step. With at most four stages, each operation and each elementary function takes half as
#: long.
STAGE_OPERATION, STAGE_FUNCTION, GAUSS_STEP, CHANGE_OF_FRAME = 3.0, 70.0, 130.0, 30.0
#: Time of a division, in units of an addition.
DIVISION = 4
#: Number of Gauss stages that fill a SIMD vector: eight doubles.
LANES = 8
#: Nanoseconds of a step along paths in addition to its operations, and nanoseconds of each operation.
PATH_STEP, PATH_OPERATION = 200.0, 0.3

#: Step sizes with which methods have equal accuracy, by order, in units of the step size of Gauss collocation. The
#: tables are those of the series, of splittings, and of splittings of Nyström type. Splittings of Nyström type have
#: smaller errors than other splittings.
SERIES_STEPS: Mapping[int, float] = {2: 1.3, 4: 0.63, 6: 0.55, 8: 0.5, 10: 0.43, 12: 0.37, 14: 0.33, 16: 0.3}
SPLITTING_STEPS: Mapping[int, float] = {2: 1.3, 4: 2.5, 6: 1.3, 8: 0.9, 10: 0.7}
NYSTROM_STEPS: Mapping[int, float] = {2: 1.3, 4: 4.0, 6: 2.6, 8: 1.6, 10: 1.3}


def cost(program: Program, grown: float = 1.0) -> float:
    """Return the estimated computing time of a trajectory of fixed length, at the accuracy that this module assumes for
    the order.

    The unit of the result is arbitrary, but equal for all schemes. The number of operations in the program is
    multiplied by ``grown``; `series_bound` uses this factor to estimate programs of higher order.
    """
    step, even_order = program.step, program.order + program.order % 2
    return STEP_TIMES.get(step.kind, _explicit)(program, grown) / _steps(program)[even_order]


def series_bound(program: Program, order: int) -> float:
    """Return a lower bound for the `cost` of a series of the given ``order``; ``program`` is the series with a lower
    order.
    """
    longest = cost(program, order / program.order) * _steps(program)[program.order + program.order % 2]
    return longest / SERIES_STEPS[order + order % 2]


def _steps(program: Program) -> Mapping[int, float]:
    if program.step.kind.collocates:
        return dict.fromkeys(SERIES_STEPS, 1.0)
    schedule = program.step.flow_schedule
    if schedule is not None:
        if len(schedule.flows) == 1 and not program.time:
            return dict.fromkeys(SERIES_STEPS, float("inf"))  # one flow is exact for any step size
        return NYSTROM_STEPS if program.step.method_name in nystrom.NAMES else SPLITTING_STEPS
    return SPLITTING_STEPS if len(program.fractions) > 1 else SERIES_STEPS


def _operations(program: Program) -> tuple[int, int]:
    """Return two numbers for a step: the cost of its arithmetic operations in units of an addition, and the number of
    its function calls.
    """
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


#: Functions that estimate the nanoseconds of a step; kinds of steps that are absent are estimated as explicit steps.
STEP_TIMES: Mapping[StepKind, Callable[[Program, float], float]] = {
    NEWTON: _newton, PATH: _path, GAUSS: _gauss,
}  # fmt: skip
