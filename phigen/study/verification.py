"""Verification: properties of a generated solver, measured on a run and judged by limits.

Exact properties must hold to round-off: constant Casimirs, the identity of Poisson maps, reversibility, agreement of
the targets. The order must be the stated one, and the energy must not drift. With an approximate bi-realisation, a step
is a Poisson map only up to a stated power of h, and that power is checked.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from phigen import progress
from phigen.compilation import Compilation
from phigen.errors import StepError
from phigen.geometry.checks import commuting
from phigen.geometry.conservation import Unit, largest_terms, rounding, units_of
from phigen.runtime.solver import Solver
from phigen.study import backward, gradients, measures, single_precision
from phigen.study.methods import Method, field_of, of_classical, of_solver, size_of, without_noise
from phigen.study.monitored import field_in_tau, with_time
from phigen.study.stochastic import failures, strong_order
from phigen.study.summary import Drift, Summary, summarise
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import Expression

#: Largest accepted difference by which an observed order may be smaller than the stated order.
ORDER_SLACK = 0.3
#: Largest accepted difference by which an observed strong order may be smaller than the stated order. Few Wiener paths
#: are used, so observed strong orders are uncertain.
STRONG_SLACK = 0.2
#: Each correction of the modified Hamiltonian H̃ should raise the power of h with which the changes of H̃ decrease. The
#: observed power may be too small by at most this fraction of the rise due to the last correction.
MODIFIED_SLACK = 0.6
#: Largest accepted error in three checks of single steps: of the identity DΦ π DΦᵀ = π∘Φ, of reversibility, and of the
#: agreement of targets. Errors are relative to the size of the compared values.
ONE_STEP = 1e-13
#: Largest accepted deviation of the tangent map from finite differences of a step; errors of the finite differences
#: contribute to the deviation.
DIFFERENCES = 1e-7
#: Largest accepted ratio of the largest energy error in the last tenth of a run to that in the first tenth.
GROWTH = 4.0
#: Largest number of steps of a run: without the option --quick, and with it.
MOST_STEPS, FEW_STEPS = 20_000, 2_000
#: Number of states of the run from which single steps are checked.
STATES = 4


def order_limit(stated: float, slack: float = ORDER_SLACK) -> str:
    """Return the limit of an observed order as text: ``at least 3.7, stated 4``."""
    return f"at least {stated - slack:.1f}, stated {stated:g}"


@dataclass(frozen=True)
class Check:
    """Result of the check of one property: the measured ``value``, and whether the check ``passed``.

    ``limit`` is the limit of the value as text, "" if there is none. ``reason`` is the text for a failure. ``others``
    has the values of the same property for the methods with which the solver is compared.
    """

    name: str
    value: float
    limit: str = ""
    passed: bool = True
    reason: str = ""
    others: Mapping[str, float] = dataclasses.field(default_factory=dict)


@dataclass(frozen=True)
class Verification:
    """Results of all checks of one spec on one run.

    ``label`` describes the method with its order. ``units`` maps quantities to the units of their errors. For lattices,
    ``units`` is empty, and the units are stated in the text ``said``. ``clock`` is the variable in which steps have
    equal size, t or τ.
    """

    name: str
    run: str
    label: str
    step: float
    steps: int
    targets: tuple[str, ...]
    compared: tuple[str, ...]
    checks: tuple[Check, ...]
    units: Mapping[str, Unit]
    said: str = ""
    clock: str = "t"

    @property
    def made(self) -> str:
        """Number and size of the steps as text, such as ``2000 steps of 0.1``."""
        return f"{self.steps} steps of {self.step:.9g}" + " in τ" * (self.clock == "τ")

    @property
    def failures(self) -> list[str]:
        """The name of each check that failed, with the reason."""
        return [f"{c.name}: {c.reason}" for c in self.checks if not c.passed]


@dataclass(frozen=True)
class Subject:
    """Subject of a verification: the methods of all targets (``own``), methods for comparison (``others``), and a
    run."""

    compilation: Compilation
    solvers: Mapping[str, Solver]
    own: Mapping[str, Method]
    others: Mapping[str, Method]
    parameters: Mapping[str, float]
    start: Floats
    h: float
    steps: int
    t0: float
    field: Callable[[Floats], Floats]  # vector field of the motion in t or, with a monitor, in τ

    @property
    def solver(self) -> Solver:
        """The solver of the first target, C if available."""
        return next(iter(self.solvers.values()))

    @property
    def main(self) -> Method:
        """The solver of the first target (C if available) as a `Method`, for measurements that need only one target."""
        return next(iter(self.own.values()))

    @property
    def exact(self) -> bool:
        """Whether a step is a Poisson map to round-off."""
        return self.compilation.exact


def verify(
    compilation: Compilation,
    solvers: Mapping[str, Solver],
    run: str,
    start: Sequence[float],
    parameters: Mapping[str, float],
    h: float,
    steps: int,
    compare: Sequence[str] = ("rk4",),
    *,
    t0: float = 0.0,
    quick: bool = False,
    single: Solver | None = None,
) -> Verification:
    """Measure properties of the solvers of a compilation on a run, and judge them.

    ``solvers`` maps targets to solvers with tangent maps; ``compare`` names classical methods. Single steps are made
    from states along the run, but all of them begin at the time ``t0``. ``single`` is the solver in single precision,
    if there is one; it is compared with the others. Raises `StepError` if a step of the run fails.
    """
    x = np.array(start, dtype=np.float64)
    gauge = gauge_at(compilation, x, parameters)
    methods = {target: of_solver(solver, parameters, gauge, t0) for target, solver in solvers.items()}
    solver = next(iter(solvers.values()))
    field = field_in_tau(solver, parameters) if compilation.program.monitor else field_of(solver, parameters)
    noisy = bool(compilation.system.noise)
    classical = {name: of_classical(name, solver, parameters, t0, field) for name in (() if noisy else compare)}
    step_count = min(steps, FEW_STEPS if quick else MOST_STEPS)
    subject = Subject(compilation, solvers, methods, classical, parameters, x, h, step_count, t0, field)
    rows = subject.main.rows(x, h, step_count, 1)
    # With noise, runs may start at rest in the origin, where errors of single steps cannot be relative to the state. So
    # the initial state is not used.
    first = step_count // STATES if noisy else 0
    states = [rows[i] for i in np.linspace(first, step_count, STATES, dtype=int)] if step_count >= STATES else [x]
    symmetry = "symmetric" if compilation.symmetric else "not symmetric"
    return Verification(
        compilation.spec.name,
        run,
        f"{compilation.method}, {symmetry}",
        h,
        step_count,
        tuple(methods),
        tuple(classical),
        _measured(
            compilation.spec.name,
            {
                "order": lambda: [order_check(subject, states[-1], quick=quick)],
                "time": lambda: time_checks(subject, gauge, quick=quick),
                "noise": lambda: noise_checks(subject, states),
                "conservation": lambda: conservation_checks(subject, rows),
                "single steps": lambda: one_step_checks(subject, states),
                "gradients": lambda: gradient_checks(subject, gauge, states),
                "agreement": lambda: [agreement_check(subject, states)],
                "largest step": lambda: [step_check(subject, states)],
                "modified Hamiltonian": lambda: modified_checks(subject, gauge),
                "single precision": lambda: single_checks(subject, single, gauge, states),
            },
        ),
        units_of(compilation.system, {**parameters, **dict.fromkeys(compilation.system.times, t0)}, x),
        clock="t" if compilation.program.monitor is None else "τ",
    )


def _measured(name: str, groups: Mapping[str, Callable[[], Iterable[Check]]]) -> tuple[Check, ...]:
    """Run the groups of checks, and return all results.

    ``groups`` maps titles to functions that make the checks. While a group runs, the progress display shows its title.
    """
    results: list[Check] = []
    with progress.stage(f"{name}: measurements", len(groups)) as running:
        for title, checks in groups.items():
            with progress.stage(title):
                results += checks()
            running.done += 1
    return tuple(results)


def gauge_at(compilation: Compilation, x: Floats, parameters: Mapping[str, float]) -> Floats | None:
    """Return the constants that a solver chooses for the trajectory from x: multiples of Casimirs, or e = −H(x).

    The result is None if the solver has no such constants.
    """
    if not compilation.program.held:
        return None
    from phigen.api import solver_of

    gauge: Floats = solver_of(compilation, "numpy").backend.module.gauge(x, **parameters)  # type: ignore[attr-defined]
    return gauge


def order_check(subject: Subject, state: Floats, *, quick: bool = False) -> Check:
    """Return the check of the observed order.

    For a system with noise, the order is measured with the noise set to 0, from the state ``state`` of the run.
    """
    if not subject.compilation.system.noise:
        return _order_check("observed order", subject, quick=quick)
    noiseless = without_noise(subject.solver, subject.parameters, subject.t0)
    quiet = replace(subject, own={noiseless.name: noiseless}, others={}, start=state)
    return _order_check("observed order, without the noise", quiet, quick=quick)


def noise_checks(subject: Subject, states: Sequence[Floats]) -> Iterator[Check]:
    """Yield two checks for systems with noise.

    The first check tests the strong order. The second counts the steps that fail if the increments of the noise are as
    large as possible.
    """
    system = subject.compilation.system
    if not system.noise:
        return
    stated = 1.0 if commuting(system) else 0.5
    arguments = subject.solver, subject.start, subject.parameters, subject.t0
    observed_order = strong_order(*arguments, subject.h, min(subject.steps, 8))
    reason, limit = (
        f"{observed_order:.2f} instead of {stated:g}",
        order_limit(stated, STRONG_SLACK),
    )
    yield Check(
        "strong order, along common paths", observed_order, limit, observed_order >= stated - STRONG_SLACK, reason
    )
    failed = failures(subject.solver, states, subject.parameters, subject.t0, subject.h)
    name, reason = "steps that fail with the largest increments", f"{failed} fail; a smaller step helps"
    yield Check(name, failed, "none", failed == 0, reason)


def time_checks(subject: Subject, gauge: Floats | None, *, quick: bool = False) -> Iterator[Check]:
    """Yield a check for systems with a monitor: the observed order, from errors of the state and of the time."""
    if subject.compilation.program.monitor is None or gauge is None:
        return
    main = with_time(subject.solver, subject.parameters, gauge)
    timed = replace(subject, own={main.name: main}, others={}, start=np.append(subject.start, 0.0))
    yield _order_check("observed order, with the time", timed, quick=quick)


def _order_check(title: str, subject: Subject, *, quick: bool) -> Check:
    solver, stated = subject.main, subject.compilation.order.order
    span = min(subject.steps, 32 if quick else 64)
    reference = _reference(subject)
    for length in (span, max(1, span // 8)):
        observation = measures.observed_order(solver, reference, subject.start, length * subject.h)
        if observation.exact or observation.order >= stated - ORDER_SLACK:
            break
    limit = order_limit(stated)
    other_orders = {
        name: measures.observed_order(m, reference, subject.start, length * subject.h).order
        for name, m in subject.others.items()
    }
    if observation.exact:
        return Check(f"{title} (errors at round-off)", math.inf, limit, True, "", other_orders)
    if math.isnan(observation.order):
        reason = "no two steps have errors between round-off and 2 %"
        worst = max((e for _, e in observation.pairs), default=math.inf)
        return Check(title, math.nan, limit, worst < 1e-6, reason, other_orders)
    is_passed = observation.order >= stated - ORDER_SLACK
    return Check(
        title, observation.order, limit, is_passed, f"{observation.order:.2f} instead of {stated}", other_orders
    )


def _reference(subject: Subject) -> Callable[[float], tuple[Floats, float]]:
    """Return a function that maps a time to a pair: the solution at this time, and the estimated relative error of the
    solution.

    The solution is computed by DOP853, with steps that are halved until two results agree.
    """
    solver = of_classical("dop853", subject.solver, subject.parameters, subject.t0, subject.field)
    solutions: dict[float, tuple[Floats, float]] = {}

    def reference(t: float) -> tuple[Floats, float]:
        if t not in solutions:
            best: tuple[Floats, float] | None = None
            last: Floats | None = None
            for n in (128, 256, 512, 1024, 2048):
                try:
                    state = solver.rows(subject.start, t / n, n, n)[-1]
                except StepError:
                    last = None
                    continue
                if last is not None:
                    error = float(np.max(np.abs(state - last))) / size_of(state)
                    if best is None or error < best[1]:
                        best = (state, error)
                    if error <= 4 * measures.ROUNDING:
                        break
                last = state
            solutions[t] = best or (np.full_like(subject.start, np.nan), math.inf)
        return solutions[t]

    return reference


def conservation_checks(subject: Subject, rows: Floats) -> Iterator[Check]:
    """Yield the checks that Casimirs are constant to round-off, and that the energy does not drift, along a run.

    ``rows`` (rows, DIM) are the states of the run.
    """
    system, steps = subject.compilation.system, subject.steps
    compared = subject.others
    times: Floats = subject.t0 + subject.h * np.arange(len(rows), dtype=np.float64)
    # With forces, the work is an integral over the physical time t. Classical methods in τ do not compute t, so they
    # are not compared.
    if system.forces and subject.compilation.monitor:
        trajectory = subject.solver.integrate(subject.start, subject.h, len(rows) - 1, 1, parameters=subject.parameters)
        times, compared = trajectory.t, {}
    summary = _summary(subject, subject.main.name, rows, times)
    other_summaries = {name: _summary_of(subject, m, times) for name, m in compared.items()}
    for name, drift in summary.casimirs.items():
        allowed_error = rounding(steps) * _terms(subject, system.casimirs[name], rows) / drift.unit.size
        judged = subject.exact and system.forced_rate_of_casimir(system.casimirs[name]).is_zero
        limit = f"at most {allowed_error:.1e}" if judged else ""
        is_passed = drift.error <= allowed_error or not judged
        reason = f"changed by {drift.error:.1e} in {steps} steps"
        drifts = {m: s.casimirs[name] if s else None for m, s in other_summaries.items()}
        yield Check(f"Casimir {name}: largest error", drift.error, limit, is_passed, reason, _errors(drifts))
        yield Check(f"Casimir {name}: last/first window", drift.growth, others=_growths(drifts))
    energy, drifts = summary.energy, {m: s.energy if s else None for m, s in other_summaries.items()}
    if system.noise:
        yield Check("energy: largest change", energy.error)
        return
    quantity = "energy balance" if system.driven else "energy"
    yield Check(f"{quantity}: largest error", energy.error, others=_errors(drifts))
    judged = math.isfinite(energy.growth) and subject.compilation.poisson and _recurrent(rows)
    is_passed = not judged or energy.growth <= GROWTH
    reason = f"the error of the last tenth is {energy.growth:.1f} times that of the first"
    limit = f"at most {GROWTH:g}" if judged else ""
    yield Check(f"{quantity}: last/first window", energy.growth, limit, is_passed, reason, _growths(drifts))


def _errors(drifts: Mapping[str, Drift | None]) -> dict[str, float]:
    return {m: d.error if d else math.inf for m, d in drifts.items()}


def _growths(drifts: Mapping[str, Drift | None]) -> dict[str, float]:
    return {m: d.growth if d else math.nan for m, d in drifts.items()}


def _terms(subject: Subject, quantity: Expression, rows: Floats) -> float:
    columns = dict(zip(subject.compilation.system.coordinates, rows.T, strict=True))
    return largest_terms(quantity, list(columns), {**subject.parameters, **columns})


def _summary(subject: Subject, name: str, rows: Floats, times: Floats) -> Summary:
    return summarise(name, subject.compilation.system, None, subject.parameters, times, rows)


def _summary_of(subject: Subject, method: Method, times: Floats) -> Summary | None:
    """Return the errors of a method on the run; None if one of its steps fails."""
    try:
        return _summary(subject, method.name, method.rows(subject.start, subject.h, subject.steps, 1), times)
    except StepError:
        return None


def _recurrent(rows: Floats) -> bool:
    """Whether each coordinate stays, up to a margin, in the range that it has in the first half of a run.

    The margin is 20 % of the largest range. If a coordinate leaves its range, errors in the first and in the last tenth
    of the run cannot be compared.
    """
    half_count = len(rows) // 2
    low, high = rows[:half_count].min(axis=0), rows[:half_count].max(axis=0)
    margin = 0.2 * np.max(high - low)
    return bool(((rows[half_count:] >= low - margin) & (rows[half_count:] <= high + margin)).all())


def one_step_checks(subject: Subject, states: Sequence[Floats]) -> Iterator[Check]:
    """Yield the checks of single steps from ``states``: of DΦ π DΦᵀ = π∘Φ, of the tangent map, and of reversibility."""
    system, parameters = subject.compilation.system, subject.parameters
    settings = [(x, f * subject.h) for x in states for f in (1.0, 0.5, -1.0)]

    def worst(measure: Callable[[Method, Floats, float], float], method: Method) -> float:
        return max(_or_infinite(measure, method, x, h) for x, h in settings)

    def defect(method: Method, x: Floats, h: float) -> float:
        return measures.poisson_defect(system, parameters, method, x, h)

    largest = max(worst(defect, m) for m in subject.own.values())
    compared = {name: worst(defect, m) for name, m in subject.others.items()}
    if system.forces:
        limit, is_passed, reason = "", True, ""
    elif subject.exact:
        limit, is_passed, reason = f"at most {ONE_STEP:g}", largest <= ONE_STEP, f"{largest:.1e} is not round-off"
    else:
        limit, is_passed, reason = _approximate(subject, states, defect, largest)
    yield Check("Poisson defect, exact tangent", largest, limit, is_passed, reason, compared)
    slip = max(worst(measures.tangent_error, m) for m in subject.own.values())
    reason = f"the tangent map differs from finite differences of the step by {slip:.1e}"
    yield Check("tangent map against differences", slip, f"at most {DIFFERENCES:g}", slip <= DIFFERENCES, reason)
    reversal_error = max(worst(measures.reversal, m) for m in subject.own.values())
    symmetric = subject.compilation.symmetric
    yield Check(
        "reversibility: a step there and back",
        reversal_error,
        f"at most {ONE_STEP:g}" if symmetric else "",
        reversal_error <= ONE_STEP or not symmetric,
        f"a step of h and a step of −h miss the start by {reversal_error:.1e}",
        {name: worst(measures.reversal, m) for name, m in subject.others.items()},
    )


def gradient_checks(subject: Subject, gauge: Floats | None, states: Sequence[Floats]) -> Iterator[Check]:
    """Yield the checks of gradients of short runs.

    Gradients are compared with tangent maps and with finite differences. Gradients of an ensemble are compared with
    those of single runs. Multiples of Casimirs are held fixed, since gradients treat them as constants. In systems with
    a monitor, gradients include the dependence of e = −H(x₀) on the initial state, but tangent maps treat e as a
    constant.
    """
    program = subject.compilation.program
    if not program.extras.adjoint:
        return
    size = np.max(np.abs(states), axis=0)
    units = np.maximum(size, 0.1 * (float(np.max(size)) or 1.0))
    arguments = units, subject.h, subject.parameters, subject.t0
    solvers = list(subject.solvers.values())
    fixed_solvers = [s if gauge is None else Solver(s.backend.with_gauge(gauge), s.interface) for s in solvers]
    fixed_level_runs, free_level_runs = (
        [gradients.of_solver(s, x, *arguments) for s in solver_group for x in (states[0], states[-1])]
        for solver_group in (fixed_solvers, solvers if program.monitor else fixed_solvers)
    )
    apart = max(gradients.members_error(s, np.array(states), *arguments) for s in fixed_solvers)
    members_reason = f"gradients of members differ from those of single runs by {apart:.1e}"
    members = "gradients of members against single runs", apart, gradients.TRANSPOSED, members_reason
    for name, value, limit, reason in (*gradients.measured(fixed_level_runs, free_level_runs), members):
        yield Check(name, value, f"at most {limit:g}", value <= limit, reason)


def _approximate(
    subject: Subject, states: Sequence[Floats], defect: Callable[[Method, Floats, float], float], largest: float
) -> tuple[str, bool, str]:
    """Check the Poisson defect of an approximate bi-realisation; return limit, verdict, and reason for a failure.

    If the series of the bi-realisation ends at degree d in p, the defect must decrease like h^(d+1). ``largest`` is the
    largest measured defect.
    """
    degree = subject.compilation.degree
    if degree is None:
        return "", True, ""
    fine = max(_or_infinite(defect, subject.main, x, subject.h / 2) for x in states)
    coarse = max(_or_infinite(defect, subject.main, x, subject.h) for x in states)
    power = math.log2(coarse / fine) if fine > 0 else math.inf
    is_passed = largest <= ONE_STEP or fine <= ONE_STEP or power >= degree + 1 - 2 * ORDER_SLACK
    return f"O(h^{degree + 1}): approximate", is_passed, f"shrinks like h^{power:.1f} instead of h^{degree + 1}"


def _or_infinite(measure: Callable[[Method, Floats, float], float], method: Method, x: Floats, h: float) -> float:
    try:
        value = measure(method, x, h)
    except StepError:
        return math.inf
    return value if math.isfinite(value) else math.inf


def agreement_check(subject: Subject, states: Sequence[Floats]) -> Check:
    """Return the check that single steps of all targets from the same states agree to round-off."""
    name, difference = "agreement of " + " and ".join(subject.own), 0.0
    if len(subject.own) < 2:
        return Check(f"agreement: only one target, {subject.main.name}", math.nan)
    for x in states:
        images = [m.step(x, subject.h) for m in subject.own.values()]
        size = size_of(images[0])
        difference = max(difference, *(float(np.max(np.abs(i - images[0]))) / size for i in images[1:]))
    is_passed = difference <= ONE_STEP
    return Check(
        name, difference, f"at most {ONE_STEP:g}", is_passed, f"they differ by {difference:.1e} after one step"
    )


def single_checks(
    subject: Subject, solver: Solver | None, gauge: Floats | None, states: Sequence[Floats]
) -> Iterator[Check]:
    """Yield the checks of the solver in single precision; none if the spec does not request single precision."""
    if solver is None:
        return
    method = of_solver(solver, subject.parameters, gauge, subject.t0)
    numbers = subject.start, subject.h, subject.steps, subject.parameters, subject.t0
    for name, value, limit in single_precision.measured(
        subject.compilation.system, method, subject.main, states, *numbers
    ):
        yield Check(name, value, f"at most {limit:.1e}", value <= limit, f"{value:.1e} is more than rounding")


def modified_checks(subject: Subject, gauge: Floats | None) -> Iterator[Check]:
    """Yield the checks of the modified Hamiltonian H̃ of the method, one for each number m of corrections.

    For a method of order p, changes of H̃ must decrease like h^(p+m), or like h^(p+2m) if the method is symmetric.
    There are no checks if H̃ is not available.
    """
    try:
        series = backward.modified(subject.compilation, subject.parameters, gauge)
    except backward.NotOfferedError:
        return
    observed = backward.observed_powers(series, subject.main, subject.start, subject.h)
    for m, (power, observed_power) in enumerate(zip(series.powers[1:], observed[1:], strict=True), 1):
        # If the last correction were wrong, the observed power would be the one without this correction.
        limit = power - MODIFIED_SLACK * (power - series.powers[m - 1])
        reason = f"shrinks like h^{observed_power:.2f} instead of h^{power}"
        name = f"modified H, {m} correction{'s' * (m > 1)}: order"
        yield Check(name, observed_power, order_limit(power, power - limit), observed_power >= limit, reason)


def step_check(subject: Subject, states: Sequence[Floats]) -> Check:
    """Find the largest step size with which steps from all ``states`` succeed, and return it as a check.

    The check gives this step size as a multiple of the step size of the run, and fails below 1.
    """
    largest = measures.largest_step(subject.main, states, subject.h)
    return Check(
        "largest step that converges, in steps of the run", largest, "at least 1", largest >= 1, "the run's step fails"
    )
