"""Verification of lattices: properties of their solvers, measured on a run and on small lattices.

The identity DΦ π DΦᵀ = π∘Φ of Poisson maps is measured on a lattice of a few sites. The initial values on this lattice
are values at sites of the run. The identity is proved for all sizes; the measurement detects errors of the generated
code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from phigen import progress
from phigen.compilation import CompiledLattice
from phigen.errors import StepError
from phigen.geometry.checks import COMMUTING
from phigen.geometry.conservation import rounding, stated
from phigen.lattice.cell import PAIRS, Cell
from phigen.lattice.expansion import Expansion, expand, ring
from phigen.lattice.forcing import noise_statements
from phigen.lattice.states import Start
from phigen.runtime.lattice import LatticeSolver, LatticeTrajectory
from phigen.study import gradients, lattice_noise, single_precision
from phigen.study.lattice_errors import BALANCE, CHANGE, ENERGY, MAX_BALANCED_SITE_STEPS, errors_of, units_of, works
from phigen.study.methods import size_of
from phigen.study.verification import ONE_STEP, ORDER_SLACK, STRONG_SLACK, Check, Verification, order_limit
from phigen.symbolic.arrays import Floats, evaluate

#: Largest product steps × sites of a run: without ``quick`` (MOST_UPDATES), and with it (FEW_UPDATES). Longer runs are
#: shortened. FRAMES is the number of states of the run at which conserved quantities are evaluated.
MOST_UPDATES, FEW_UPDATES, FRAMES = 200_000_000, 20_000_000, 100
#: Limit for the ratio of the largest energy error in the last quarter of a run to that in the first three quarters.
GROWTH = 4.0
#: Largest accepted relative errors on a small lattice. IDENTITY: error of DΦ π DΦᵀ = π∘Φ. DIFFERENCES: error of tangent
#: maps, compared with finite differences of order 6.
IDENTITY, DIFFERENCES = 1e-12, 1e-9
#: Largest number of sites for which gradients are measured on the whole lattice.
MOST_GRADED = 16384
#: In measurements of the order, errors up to this fraction of the state may be rounding errors.
MAX_ROUNDING = 1e-11
#: Number of sites along each axis in measurements of the strong order, for lattices with one, two and three axes.
SOME = (32, 6, 4)
#: Number of Wiener paths in measurements of the strong order: with ``quick``, and without. Each site has its own path,
#: so a run on n sites counts as n paths.
FEW_PATHS, MANY_PATHS = 32, 96
#: Sentence on the errors of Casimirs, printed below the table of results.
WORST_SITE = "For a Casimir at every site, the error is that at the site where the Casimir changed most."


@dataclass(frozen=True)
class _Subject:
    """The compiled lattice that is verified, its solvers by target, and the start and step size of the run."""

    compilation: CompiledLattice
    solvers: Mapping[str, LatticeSolver]
    start: Start
    h: float
    t0: float | None = None
    seed: int | None = None

    @property
    def solver(self) -> LatticeSolver:
        """The solver of the first target, C if available, for measurements that need only one target."""
        return next(iter(self.solvers.values()))

    def time(self, trajectory: LatticeTrajectory, frame: int) -> float | None:
        """Return the time of a stored state (frame); None if the equations do not depend on the time."""
        return None if self.t0 is None else float(trajectory.t[frame])

    def stepped(
        self,
        x: Floats,
        h: float,
        steps: int = 1,
        t0: float | None = None,
        held_level: Mapping[str, float] | None = None,
    ) -> Floats:
        """Return the state after ``steps`` steps of size h from the state ``x`` at the time ``t0``.

        The default of ``t0`` is the start of the run. ``held_level`` is the argument that fixes the energy level e.
        """
        t0 = self.t0 if t0 is None else t0
        options: dict[str, Any] = {
            "t0": t0,
            "seed": self.seed,
            "parameters": self.start.arguments,
            **(held_level or {}),
        }
        trajectory = self.solver.integrate(x, h, steps, max(1, steps), **options)
        end: Floats = trajectory.x[-1]
        return end


def verify_lattice(
    compilation: CompiledLattice,
    solvers: Mapping[str, LatticeSolver],
    run: str,
    start: Start,
    h: float,
    steps: int,
    *,
    t0: float | None = None,
    seed: int | None = None,
    quick: bool = False,
    single: LatticeSolver | None = None,
) -> Verification:
    """Measure properties of the solvers of a lattice on a run, and judge them.

    ``solvers`` maps targets to solvers with tangent maps. A long run is shortened, more so with ``quick``. ``t0`` is
    the time at the start, None if the equations do not depend on the time; ``seed`` is the seed of the noise, None
    without noise. ``single`` is the solver in single precision, if there is one; it is compared with the others. Raises
    `StepError` if a step of the run fails.
    """
    cell = compilation.cell
    subject = _Subject(compilation, solvers, start, h, t0, seed)
    max_updates = MAX_BALANCED_SITE_STEPS if cell.driven else MOST_UPDATES
    steps = min(steps, max(20, (min(max_updates, FEW_UPDATES) if quick else max_updates) // int(np.prod(start.sizes))))
    name, stride = compilation.spec.name, max(1, steps // FRAMES)
    with progress.stage(f"{name}: {steps} steps"):
        trajectory = subject.solver.integrate(
            start.state, h, steps, stride, t0=t0, seed=seed, parameters=start.arguments
        )
    checks = [_order(subject if seed is None else _without_noise(subject), quiet=seed is not None)]
    checks += _conserved(cell, trajectory)
    with progress.stage(f"{name}: single steps"):
        checks += [_reversal(subject, trajectory), *_agreement(subject, trajectory)]
        checks += _identity(cell, subject, trajectory)
    if compilation.program.extras.adjoint:
        with progress.stage(f"{name}: gradients"):
            checks += _gradients(cell, subject, trajectory)
    if seed is not None:
        with progress.stage(f"{name}: paths of the noise"):
            checks += _noise(cell, subject, quick=quick)
    checks += _single(cell, subject, single, trajectory) if single else []
    label = compilation.named(compilation.method)
    unit_note = f"{stated(units_of(cell, trajectory))} {WORST_SITE} {_sampled(stride)}".strip()
    clock = "τ" if subject.solver.interface.monitored else "t"
    return Verification(name, run, label, h, steps, tuple(solvers), (), tuple(checks), {}, unit_note, clock=clock)


def _sampled(stride: int) -> str:
    """Return a sentence that says at which states conserved quantities are evaluated; "" if at all states."""
    every = f"at the start, after every {stride} steps and at the end"
    return f"Energy, Casimirs and invariants are evaluated {every}." if stride > 1 else ""


def _without_noise(subject: _Subject) -> _Subject:
    """Return the subject without the noise of the spec, with the NumPy solver only."""
    from phigen.api import lattice_solver_of
    from phigen.compiler import compile_spec

    compilation = subject.compilation
    quiet = compile_spec(
        replace(compilation.spec, noise={}), order=compilation.order.order, scheme=compilation.scheme_name
    )
    return replace(
        subject, compilation=quiet.by_sweeps(), solvers={"numpy": lattice_solver_of(quiet, "numpy")}, seed=None
    )


def _order(subject: _Subject, *, quiet: bool = False) -> Check:
    """Return the check of the observed order of a lattice.

    The order is the logarithm, to the base 2, of the quotient of the errors with steps h and h/2. It is measured for
    several h; the value for the smallest errors above rounding is the result. ``quiet`` says that the noise of the spec
    was removed.
    """
    name = "observed order, without the noise" if quiet else "observed order"
    step = subject.compilation.program.step.swept
    if step and len(step.parts) == 1 and not step.by_colour:
        return Check(name, math.inf)
    order, x, size = subject.compilation.order.order, subject.start.state, size_of(subject.start.state)
    span, slopes, measured_errors = 4 * abs(subject.h), dict[float, float](), list[float]()
    for _ in range(5):
        try:
            reference = subject.stepped(x, span / 256, 256)
            errors = [np.abs(subject.stepped(x, span / n, n) - reference).max() / size for n in (4, 8, 16)]
        except StepError:
            break
        slopes |= {b: math.log2(a / b) for a, b in pairwise(errors) if MAX_ROUNDING < b < a < 0.1}
        span, measured_errors = 2 * span, measured_errors + errors
    if (
        measured_errors and max(measured_errors) <= MAX_ROUNDING
    ):  # results with steps of all sizes agree, so each step is exact
        return Check(f"{name} (errors at round-off)", math.inf, order_limit(order))
    measured = slopes[min(slopes)] if slopes else math.nan
    is_passed = measured >= order - ORDER_SLACK
    return Check(name, measured, order_limit(order), is_passed, f"{measured:.2f} instead of {order}")


def _conserved(cell: Cell, trajectory: LatticeTrajectory, coarser: float = 1.0) -> Iterator[Check]:
    """Yield the checks of energy, Casimirs and invariants along a run.

    ``coarser`` is the rounding unit of the solver, divided by the rounding unit of double precision.
    """
    errors = errors_of(cell, trajectory)
    least = coarser * rounding(trajectory.steps)
    yield from _energy(cell, trajectory, errors, least)
    for name, (_, kind) in cell.casimirs.items():
        if name in trajectory.solver.interface.moving:
            yield Check(f"Casimir {name}: largest change", float(errors[name].max()))
            continue
        value = float(np.max(np.abs(trajectory.casimirs[name][0])))
        # The limit is 8 times larger for Casimirs at every site, since the error is the largest one of many sites.
        limit = {"sites": 8.0, "sum": 1.0, "product": max(1.0, math.sqrt(trajectory.x[0][0].size))}[kind] * least
        error = float(errors[name].max()) / (value if kind == "product" and value else max(1.0, value))
        yield Check(
            f"Casimir {name}: largest error", error, f"≤ {limit:.0e}", error <= limit, f"changes by {error:.1e}"
        )
        if kind == "sites":
            spread = float(np.std(trajectory.casimirs[name][-1] - trajectory.casimirs[name][0]))
            yield Check(f"Casimir {name}: spread over the sites", spread)
    for name in cell.invariants:
        yield Check(f"invariant {name}: largest error", float(errors[name].max()))


def _energy(cell: Cell, trajectory: LatticeTrajectory, errors: Mapping[str, Floats], least: float) -> Iterator[Check]:
    """Yield two checks of the energy, or of the energy balance: the largest error, and the drift.

    If ``errors`` has only the change of the energy, there is one check, which reports the largest change without a
    limit. ``least`` is the relative error that rounding may cause.
    """
    quantity = next(name for name in (ENERGY, BALANCE, CHANGE) if name in errors)
    energy = errors[quantity]
    if quantity == CHANGE:
        yield Check("energy: largest change", float(energy.max()))
        return
    yield Check(f"{quantity}: largest error", float(energy.max()))
    least = max(least, works(cell, trajectory)[1] / trajectory.energy_scale) if quantity == BALANCE else least
    quarter = max(1, 3 * len(energy) // 4)
    early_error, late_error = float(energy[:quarter].max()), float(energy[quarter:].max())
    grown = late_error / early_error if early_error > 10 * least else math.nan
    judged = not cell.forces  # with forces a step is not a Poisson map, and its energy error may grow
    is_passed = not (judged and grown > GROWTH)
    limit = f"≤ {GROWTH:g}" if judged else ""
    yield Check(f"{quantity}: last quarter/before", grown, limit, is_passed, f"grows by a factor of {grown:.1f}")


def _reversal(subject: _Subject, trajectory: LatticeTrajectory) -> Check:
    worst = 0.0
    for k in (0, -1):
        x, t0 = trajectory.x[k], subject.time(trajectory, k)
        time_after = None if t0 is None else t0 + subject.h
        held_level = _level_argument(subject.solver, x, subject.start.arguments)
        forward_state = subject.stepped(x, subject.h, 1, t0, held_level)
        returned_state = subject.stepped(forward_state, -subject.h, 1, time_after, held_level)
        worst = max(worst, float(np.abs(returned_state - x).max()) / size_of(x))
    if subject.compilation.program.step.corrected:  # with a corrector, Φ₋ₕ is not exactly the inverse of Φₕ
        return Check("reversibility", worst, "", True, "")
    return Check("reversibility", worst, f"≤ {ONE_STEP:.0e}", worst <= ONE_STEP, f"differs by {worst:.1e}")


def _level_argument(solver: LatticeSolver, x: Floats, parameters: Mapping[str, Any]) -> dict[str, float]:
    """Return the argument that fixes the energy level e = −H(x) in steps of systems with a monitor.

    The result is {} for systems without a monitor.
    """
    return {"gauge": -solver.hamiltonian(x, parameters=parameters)} if solver.interface.monitored else {}


def _agreement(subject: _Subject, trajectory: LatticeTrajectory) -> Iterator[Check]:
    """Yield the checks that single steps of each further target agree with those of the first target."""
    first, *other_solvers = subject.solvers.items()
    for target, solver in other_solvers:
        worst = 0.0
        for k in (0, -1):
            x, t0 = trajectory.x[k], subject.time(trajectory, k)
            options: dict[str, Any] = {"t0": t0, "seed": subject.seed, "parameters": subject.start.arguments}
            a, b = (s.step(x, subject.h, **options) for s in (first[1], solver))
            worst = max(worst, float(np.abs(a - b).max()) / size_of(x))
        name = f"agreement of {target} with {first[0]}"
        yield Check(name, worst, f"≤ {ONE_STEP:.0e}", worst <= ONE_STEP, f"differs by {worst:.1e}")


def _single(cell: Cell, subject: _Subject, solver: LatticeSolver, trajectory: LatticeTrajectory) -> Iterator[Check]:
    """Yield the checks of the solver in single precision: single steps, and Casimirs along a run."""
    single = replace(subject, solvers={"c": solver})
    worst = single_precision.farthest(single.stepped, subject.stepped, [trajectory.x[0], trajectory.x[-1]], subject.h)
    limit = single_precision.ONE_STEP
    name, reason = "single precision: a step against double precision", f"{worst:.1e} is more than rounding"
    yield Check(name, worst, f"≤ {limit:.0e}", worst <= limit, reason)
    stride, arguments = max(1, trajectory.steps // FRAMES), subject.start.arguments
    run = solver.integrate(
        subject.start.state, subject.h, trajectory.steps, stride, t0=subject.t0, parameters=arguments
    )
    for check in _conserved(cell, run, single_precision.COARSER):
        if check.limit and check.name.startswith("Casimir"):
            yield replace(check, name=f"single precision: {check.name}")


# --- measurements on a lattice of a few sites


def _noise(cell: Cell, subject: _Subject, *, quick: bool) -> Iterator[Check]:
    """Yield two checks on a lattice of a few sites: of the strong order, and of steps with the largest increments."""
    interface, start = subject.solver.interface, subject.start
    few_sizes = [SOME[len(start.sizes) - 1]] * len(start.sizes)
    if cell.relation == PAIRS:  # if all sites interact, each site of the run is taken at most once
        few_sizes = [min(few_sizes[0], *start.sizes)]
    sizes = [
        -(-max(size, least) // p) * p
        for size, least, p in zip(few_sizes, interface.least, interface.periods, strict=True)
    ]
    bonds = ring(sizes[0]) if interface.graph else ()
    x, parameters = _on_few(cell, start, sizes, bonds)
    commuting = any(s.holds and s.name == COMMUTING for s in noise_statements(cell))
    stated = 1.0 if commuting else 0.5
    subject_arguments = subject.compilation, x, parameters, subject.t0, subject.h
    paths = -(-(FEW_PATHS if quick else MANY_PATHS) // x[0].size)
    observed_order = lattice_noise.strong_order(*subject_arguments, paths)
    limit, reason = order_limit(stated, STRONG_SLACK), f"{observed_order:.2f} instead of {stated:g}"
    yield Check(
        "strong order, along common paths", observed_order, limit, observed_order >= stated - STRONG_SLACK, reason
    )
    failed = lattice_noise.failures(*subject_arguments)
    name, reason = "steps that fail with the largest increments", f"{failed} fail; a smaller step helps"
    yield Check(name, failed, "none", failed == 0, reason)


def _identity(cell: Cell, subject: _Subject, trajectory: LatticeTrajectory) -> Iterator[Check]:
    """Yield two checks on a lattice of a few sites: of the identity DΦ π DΦᵀ = π∘Φ, and of the tangent maps DΦ.

    Each target computes its own DΦ. The error of the identity is the largest entry of DΦ π DΦᵀ − π∘Φ, divided by the
    largest entry of |DΦ| |π| |DΦ|ᵀ. Each coordinate is measured in units of its typical magnitude. Tangent maps are
    compared with finite differences. If forces act, a step is no Poisson map, and the identity is not checked.
    """
    interface, sizes = subject.solver.interface, _few_sizes(subject)
    expansion, site_count = expand(cell, sizes, ring(sizes[0]) if interface.graph else ()), int(np.prod(sizes))
    x, parameters = _on_few(cell, subject.start, sizes, expansion.bonds)
    small_lattice = _SmallLattice(expansion, subject, parameters, x)
    usual = np.abs(trajectory.x).max(axis=0).reshape(len(x), -1)
    fields = _units(usual.max(axis=1).repeat(site_count))
    sizes_text = f"on {'×'.join(map(str, sizes))} sites"
    if not cell.forces:
        finite, replaced = _with_finite_brackets(cell, small_lattice)
        solvers = subject.solvers.values()
        defect = max(finite.defect(solver, f * subject.h, fields) for solver in solvers for f in (1, -1))
        name, limit = f"Poisson identity {sizes_text}{replaced}", f"≤ {IDENTITY:.0e}"
        yield Check(name, defect, limit, defect <= IDENTITY, f"DΦ π DΦᵀ differs from π∘Φ by {defect:.1e}")
    # Finite differences are computed four times: with two spacings, each in two units. The first unit of a coordinate
    # is its largest magnitude in all rows at all sites. The second unit is its largest magnitude in all rows at one
    # site. The smallest deviation from the tangent map counts, since larger ones are errors of the differences.
    sampled_values = usual[:, _picked(cell, subject.start, sizes).reshape(-1)]
    site_units = _units(np.maximum(sampled_values, 1e-9 * usual.max(axis=1, keepdims=True)).reshape(-1))
    trials = [(units, spacing) for units in (fields, site_units) for spacing in (3e-3, 3e-4)]
    slip = min(max(small_lattice.slip(s, *trial) for s in subject.solvers.values()) for trial in trials)
    name, limit = f"tangent map against differences {sizes_text}", f"≤ {DIFFERENCES:.0e}"
    yield Check(name, slip, limit, slip <= DIFFERENCES, f"differs from finite differences of the step by {slip:.1e}")


def _gradients(cell: Cell, subject: _Subject, trajectory: LatticeTrajectory) -> Iterator[Check]:
    """Yield the checks of gradients on a lattice of a few sites. Every target computes the gradients.

    If the lattice of the run is small enough, gradients of the first target are also checked on that lattice.
    """
    sizes, start, step_and_time = _few_sizes(subject), subject.start, (subject.h, subject.t0)
    x, parameters = _on_few(cell, start, sizes, ring(sizes[0]) if subject.solver.interface.graph else ())
    usual = _units(np.abs(trajectory.x).max(axis=tuple(i for i in range(trajectory.x.ndim) if i != 1)))
    small_runs = [
        gradients.of_lattice(s, x, usual.repeat(x[0].size), step_and_time[0], parameters, step_and_time[1])
        for s in subject.solvers.values()
    ]
    groups = [(small_runs, f" on {'×'.join(map(str, sizes))} sites")]
    if start.state[0].size <= MOST_GRADED:
        units = usual.repeat(start.state[0].size)
        full_run = gradients.of_lattice(
            subject.solver, start.state, units, step_and_time[0], start.arguments, step_and_time[1]
        )
        groups.append(([full_run], " on all sites"))
    for runs, place in groups:
        for name, value, limit, reason in gradients.measured(runs, runs, place):
            yield Check(name, value, f"≤ {limit:.0e}", value <= limit, reason)


def _few_sizes(subject: _Subject) -> list[int]:
    """Return sizes of a small lattice. The solver accepts them, and the lattice has the boundary seams of the run."""
    interface = subject.solver.interface
    least = 3 if len(interface.axes) < 3 else 2
    if subject.compilation.cell.relation == PAIRS:  # if all sites interact, each site of the run is taken at most once
        least = min(least, *subject.start.sizes)
    sizes = [-(-max(size, least) // p) * p for size, p in zip(interface.least, interface.periods, strict=True)]
    return _with_seams(subject, sizes)


def _with_seams(subject: _Subject, sizes: list[int]) -> list[int]:
    """Return the sizes, increased until the boundary seams of the lattice are those of the run.

    With one or two axes, the sizes are increased further, so that some sites lie away from the seams.
    """
    seams = subject.compilation.sweeps.colouring.seams
    for axis, (seam, size) in enumerate(zip(seams, subject.start.sizes, strict=False)):
        sizes[axis] += 2 * seam.margin * (len(seams) < 3)
        sizes[axis] += (size - sizes[axis]) % seam.period
    return sizes


@dataclass(frozen=True)
class _SmallLattice:
    """Lattice of a few sites, with parameters and the initial state ``x``.

    ``whole`` is the ordinary system with the coordinates of all these sites. ``subject`` is the verification to which
    the lattice belongs.
    """

    whole: Expansion
    subject: _Subject
    parameters: Mapping[str, Any]
    x: Floats

    @property
    def given(self) -> dict[str, Any]:
        """Keyword arguments for steps: the time, the seed of the noise, the parameters, and a fixed energy level if
        there is a monitor.
        """
        held_level = _level_argument(self.subject.solver, self.x, self.parameters)
        return {"t0": self.subject.t0, "seed": self.subject.seed, "parameters": self.parameters, **held_level}

    def tangent(self, solver: LatticeSolver, h: float) -> tuple[Floats, Floats]:
        """Return the state after a step, and the tangent map of the step as a matrix over all numbers of a state."""
        count = self.x.size
        image, columns = solver.step_tangent(self.x, h, np.eye(count).reshape(count, *self.x.shape), **self.given)
        return image, columns.reshape(count, count).T

    def defect(self, solver: LatticeSolver, h: float, units: Floats) -> float:
        """Return the largest entry of DΦ π DΦᵀ − π∘Φ for a step Φ of size h. The result is relative to the largest
        entry of |DΦ| |π| |DΦ|ᵀ.

        ``units`` has the unit in which each number of a state is measured.
        """
        after, slopes = self.tangent(solver, h)
        slopes = slopes * units / units[:, None]
        start_tensor, image = (
            _poisson(self.whole, x, self.parameters) / units / units[:, None] for x in (self.x, after)
        )
        size = float((np.abs(slopes) @ np.abs(start_tensor) @ np.abs(slopes).T).max()) or 1.0
        return float(np.abs(slopes @ start_tensor @ slopes.T - image).max()) / size

    def slip(self, solver: LatticeSolver, units: Floats, spacing: float) -> float:
        """Return the largest difference between the tangent map of a step and finite differences of order 6.

        The difference is relative to the largest entry of the tangent map. ``units`` has a unit for each number of a
        state. In the finite differences, each number is displaced by multiples of ``spacing`` times its unit.
        """

        def step(y: Floats) -> Floats:
            stepped_state = solver.step((y * units).reshape(self.x.shape), self.subject.h, **self.given)
            return np.asarray(stepped_state.reshape(-1) / units)

        slopes = self.tangent(solver, self.subject.h)[1] * units / units[:, None]
        differences = _slopes(step, self.x.reshape(-1) / units, spacing)
        return float(np.abs(slopes - differences).max() / np.abs(slopes).max())


def _with_finite_brackets(cell: Cell, small_lattice: _SmallLattice) -> tuple[_SmallLattice, str]:
    """Return the lattice with parameters for which π is finite, and a note.

    If a parameter is 0 and therefore makes π infinite, its value is replaced. The note is added to the name of a check,
    such as ", m = 0.1 instead of 0". The note is "" if nothing was replaced.
    """
    with np.errstate(all="ignore"):
        if np.isfinite(_poisson(small_lattice.whole, small_lattice.x, small_lattice.parameters)).all():
            return small_lattice, ""
    replaced: dict[str, Any] = {}
    for name in sorted(cell.vanishing):
        values = np.asarray(small_lattice.parameters[name])
        if not values.all():
            least = float(np.abs(values[values != 0]).min(initial=1.0))
            replaced[name] = np.where(values == 0, least, values)
    note = "".join(f", {name} = {np.abs(values).min():.3g} instead of 0" for name, values in replaced.items())
    return replace(small_lattice, parameters={**small_lattice.parameters, **replaced}), note


def _units(sizes: Floats) -> Floats:
    return np.where(sizes > 0, sizes, 1.0)


def _slopes(function: Callable[[Floats], Floats], y: Floats, spacing: float) -> Floats:
    """Return the derivative of a function at ``y`` as a matrix, by central differences of order 6.

    The differences use points at distances of ``spacing``.
    """
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    columns = []
    for k in range(len(y)):
        displacement = spacing * np.eye(len(y))[k]
        columns.append(
            sum(w * (function(y + m * displacement) - function(y - m * displacement)) for m, w in weights.items())
        )
    return np.array(columns).T / spacing


def _picked(cell: Cell, start: Start, sizes: Sequence[int]) -> Any:
    """Return indices of sites of the run, drawn at random. A small lattice receives the values at these sites.

    If all sites interact in pairs, the first site is always drawn, since it must have a mass. Then no site is drawn
    twice, and the sites are in the order of the run, since relative coordinates of bodies depend on the order.
    """
    sites, count = int(np.prod(start.sizes)), int(np.prod(sizes))
    if cell.relation == PAIRS:
        return np.append(0, 1 + np.sort(np.random.default_rng(1).choice(sites - 1, count - 1, replace=False)))
    return np.random.default_rng(1).choice(sites, count, replace=sites < count).reshape(sizes)


def _on_few(
    cell: Cell, start: Start, sizes: Sequence[int], bonds: Sequence[tuple[int, int]]
) -> tuple[Floats, dict[str, Any]]:
    """Return the state (coordinates, …) and the parameters of a small lattice, taken from random sites of the run."""
    picked, arguments = _picked(cell, start, sizes), dict[str, Any]()
    for p in cell.parameters:
        value = np.asarray(start.parameters[p.name])
        if p.at == "sites":
            arguments[p.name] = value.reshape(-1)[picked]
        elif p.at == "bonds":
            arguments[p.name] = np.resize(value, len(bonds))
        else:
            arguments[p.name] = float(value)
    arguments |= {"bonds": np.array(bonds)} if start.graph else {}
    return start.state.reshape(len(cell.fields), -1)[:, picked], arguments


def _poisson(expansion: Expansion, x: Floats, parameters: Mapping[str, Any]) -> Floats:
    entries, index = expansion.poisson(), {c: k for k, c in enumerate(expansion.coordinates)}
    values = dict(zip(expansion.coordinates, x.reshape(-1).tolist(), strict=True)) | expansion.numbers(parameters)
    matrix = np.zeros((len(index), len(index)))
    for (a, b), value in zip(entries, evaluate(list(entries.values()), values), strict=True):
        matrix[index[a], index[b]] = float(value)
    return matrix
