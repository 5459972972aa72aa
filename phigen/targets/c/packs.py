"""Ensembles of explicit steps and splittings: packs of members, one in each lane."""

from __future__ import annotations

from fractions import Fraction

from phigen.scheme.lowering import expand_powers
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Implicit, Splitting
from phigen.symbolic.expression import Expression, topological
from phigen.targets.c import functions, lanes, splitting
from phigen.targets.c.functions import NEAR_FUNCTIONS
from phigen.targets.c.kernels import FUNCTIONS, LANE_FORMULAS, LANE_FUNCTIONS, LANES, function, lane_calls

#: Packs in a group, as in the runtime.
PACKS = 4

#: Powers that are left after lowering and call no function.
_ARITHMETIC = (Fraction(2), Fraction(-1), Fraction(1, 2))


def packed(program: Program) -> bool:
    """Whether the members of an ensemble are put into packs: where steps are explicit, all members have the same
    coefficients, every function has a version for lanes, and the spec does not say no."""
    explicit = not isinstance(program.step, Implicit) and not program.gauge
    states = 2 * PACKS * LANES * 3 * program.dimension
    return explicit and program.lanes and not _calls(program) and 8 * states <= lanes.MOST_STACK


def _calls(program: Program) -> set[str]:
    """The functions without a version for lanes that a step calls."""
    nodes = topological(expand_powers(_values_of_steps(program)))
    known = {*LANE_FUNCTIONS, *LANE_FORMULAS, *NEAR_FUNCTIONS, *lanes.INLINE}
    powers = {"pow" for e in nodes if e.op == "pow" and e.value not in _ARITHMETIC}
    return ({e.op for e in nodes} & set(FUNCTIONS)) - known | powers


def _values_of_steps(program: Program) -> list[Expression]:
    match program.step:
        case Explicit(increment=kernel):
            return kernel.roots
        case Splitting(flows=flows):
            return [e for flow in flows for e in flow.roots]
    return []


def _operations(program: Program) -> set[str]:
    return {e.op for e in topological(_values_of_steps(program))}


def called_in_lanes(program: Program) -> set[str]:
    """The functions that packs call."""
    return lanes.with_formulas(_operations(program)) if packed(program) else set()


def two_ways(program: Program) -> bool:
    """Whether flows call functions that are polynomials near 0: where these do not reach, there is a longer way."""
    return isinstance(program.step, Splitting) and bool(_operations(program) & set(NEAR_FUNCTIONS))


def printed(program: Program) -> list[str]:
    """The kernels in lanes."""
    found, step = functions.phi_lanes(program, called_in_lanes(program)), program.step
    if isinstance(step, Explicit):
        return [*found, function(program, step.increment, lanes=True, shared=["coef"])]
    assert isinstance(step, Splitting)
    short = {f: f"{program.name}_{f}_near" for f in NEAR_FUNCTIONS}
    found += functions.near(program, _operations(program))
    found += splitting.in_lanes(program, step, "", {**lane_calls(program), **short})
    return found + (splitting.in_lanes(program, step, "_far", lane_calls(program)) if two_ways(program) else [])
