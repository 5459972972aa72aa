"""Warnings about runs whose energy error is so large that their states mean nothing."""

from __future__ import annotations

import math

from phigen.api import chosen_target
from phigen.compilation import Compilation
from phigen.geometry.conservation import LARGE_ENERGY_ERROR, RELATIVE, SITES, TERMS, Unit
from phigen.runtime.solver import Solver
from phigen.spec.model import Spec
from phigen.study.summary import Drift, Summary
from phigen.tuning.equal_work import rk4_energy_error
from phigen.tuning.problem import Problem
from phigen.tuning.search import rounded_down

#: A warning proposes a step with about this energy error. With an error this small, orbits keep their shape.
TARGET_ENERGY_ERROR = 1e-3

#: Runs with smaller energy errors than this are not compared with RK4, since their orbits keep their shape.
LEAST_COMPARED_ERROR = 1e-3
#: Runs with more steps than this are not compared with RK4, because the comparison would take long. In long runs RK4 is
#: seldom better anyway, since its energy error grows with time.
MOST_STEPS = 1_000_000
#: The warning about RK4 appears if the energy error of RK4 is smaller than that of the solver by more than this factor.
#: A smaller advantage may be an accident, since measured times vary.
LEAST_RK4_ADVANTAGE = 2.0

_SCALES = {RELATIVE: "the energy at the start", TERMS: "the terms of H at the start", SITES: "Σ |energy of a site|"}


def summary_warning(spec: Spec, summary: Summary, h: float, order: int) -> str:
    """Return the warning about the energy error of a run without a lattice; "" if no warning is necessary.

    If forces act or H depends on the time, the energy error is the change of H minus the work done. The work is an
    integral, whose error is estimated. A finite energy error gives no warning if the estimate is larger than half the
    energy error, or larger than `LARGE_ENERGY_ERROR`.
    """
    energy = summary.energy
    uncertain = summary.is_balance and not summary.off < min(energy.error / 2, LARGE_ENERGY_ERROR)
    changes = energy.unit.moves and not summary.is_balance
    return (
        ""
        if (uncertain and math.isfinite(energy.error)) or changes
        else energy_warning(spec, energy.error, energy.unit, h, order)
    )


def energy_warning(spec: Spec, error: float, unit: Unit, h: float, order: int) -> str:
    """Return the warning about an energy error, with a hint; "" if the error is finite and not large."""
    if not math.isfinite(error):
        warning = "H is not a finite number at some states of this run: do not trust the run"
        return f"{warning}\n  hint: the run begins where H is not defined, or reaches such a point"
    if unit.kind not in _SCALES or not error > LARGE_ENERGY_ERROR:
        return ""
    warning = f"the energy error reaches {_multiple(error)} {_SCALES[unit.kind]}: do not trust these states"
    tune = "" if spec.time else f"; phigen tune {spec.file} measures which step is needed"
    return f"{warning}\n  hint: try --step {advised_step(error, h, order):g}{tune}"


def compares_with_rk4(compilation: Compilation, target: str, energy: Drift, steps: int) -> bool:
    """Return whether the energy error of a run is to be compared with that of RK4.

    The system must conserve energy, the steps must be equal in t, and the target must be C. The energy error and the
    number of steps must be within the limits of this module.
    """
    conserved = not compilation.system.driven and energy.unit.kind in _SCALES and not energy.unit.moves
    warnable = LEAST_COMPARED_ERROR < energy.error <= LARGE_ENERGY_ERROR and steps <= MOST_STEPS
    return conserved and warnable and compilation.spec.monitor is None and chosen_target(target) == "c"


def rk4_warning(compilation: Compilation, problem: Problem, solver: Solver, energy: Drift) -> str:
    """Return the warning that RK4 is more accurate with the same processor time; "" if it is not.

    The energy error of RK4 must be smaller by the factor `LEAST_RK4_ADVANTAGE`. The caller checks `compares_with_rk4`
    first.
    """
    spec = compilation.spec
    theirs = rk4_energy_error(compilation, solver.backend, problem)
    if not theirs < energy.error / LEAST_RK4_ADVANTAGE:
        return ""
    finding = f"the energy error reaches {energy.error:.1e} of {_SCALES[energy.unit.kind]}"
    order = f"--order {solver.order + 2 - solver.order % 2}"
    hint = f"try {order}, or --step {advised_step(energy.error, problem.step * problem.direction, solver.order):g}"
    comparison = "RK4 with as much processor time reaches"
    return f"{finding}; {comparison} {theirs:.1e} in this run\n  hint: {hint}; phigen compare {spec.file} --equal work"


def sweep_warning(count: int, members: int, largest: float, h: float, order: int) -> str:
    """Return the warning about ``count`` members of a sweep with large energy errors; "" if ``count`` is 0."""
    if not count:
        return ""
    warning = f"{count} of {members} members have an energy error above {LARGE_ENERGY_ERROR:.0%} of their energy"
    step = f"{advised_step(largest, h, order):g}"
    hint = f"take a smaller step for these members; for the member with the largest error, about {step}"
    return f"{warning}; the largest is {_multiple(largest)} the energy: do not trust their numbers\n  hint: {hint}"


def _multiple(error: float) -> str:
    return f"{error:.0%} of" if error < 10 else f"{error:.1e} times"


def advised_step(error: float, h: float, order: int) -> float:
    """Return an estimate of the step whose energy error is `TARGET_ENERGY_ERROR`.

    The estimate assumes that errors are proportional to h^order. Errors above 1 count as 1, since they only show that
    the step is too large.
    """
    step = abs(h) * (TARGET_ENERGY_ERROR / min(error, 1.0)) ** (1 / order)
    return rounded_down(step, 1) * (1 if h > 0 else -1)
