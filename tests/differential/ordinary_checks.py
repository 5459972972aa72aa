"""Checks that every random system other than a lattice must pass: comparisons with independent equations of motion,
with finite differences, and across targets.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from differential import device_checks
from differential.formulas import numeric
from differential.inputs import as_cpp
from differential.ordinary import OBSERVED, Ordinary, draw_ordinary
from differential.reference import (
    Floats,
    derivative,
    expect,
    expect_close,
    expect_order,
    expect_same_bits,
    flow,
    speed_of,
)
from differential.trial import Check, RefusedError, Suite, refused
from solvers import javascript

import phigen
import phigen.spec
from phigen.api import solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.errors import LimitError, SpecError, StepError
from phigen.runtime.solver import Solver

#: Targets that run in Python.
LOADED = ("c", "numpy")
START = 0.3


@dataclass(frozen=True)
class Trial:
    """A system with its compilation and solvers, and the data of a run: initial state x0, start time t0, and a step
    size h that suits the time scale of the vector field.
    """

    system: Ordinary
    compilation: Compilation
    solvers: Mapping[str, Solver]
    h: float

    @property
    def random(self) -> np.random.Generator:
        """New generator of random numbers, with the same numbers for every check."""
        return np.random.default_rng(self.system.seed)

    @property
    def x0(self) -> Floats:
        """Initial state of the run."""
        return np.array(self.system.start)

    @property
    def t0(self) -> float:
        """Start time of the run."""
        return START if self.system.timed else 0.0

    @property
    def single(self) -> bool:
        """Whether the C computes in single precision."""
        return self.compilation.program.single

    @property
    def since(self) -> dict[str, Any]:
        """Keyword arguments for calls that begin at the start: the start time, and the seed of the noise."""
        timed = {"t0": self.t0} if self.system.timed else {}
        return timed | ({"seed": 2**40 + 3} if self.system.noise else {})

    def since_step(self, step: int) -> dict[str, Any]:
        """Return the keyword arguments for calls that begin after ``step`` steps."""
        timed = {"t0": self.t0 + step * self.h} if self.system.timed else {}
        return timed | ({"seed": 2**40 + 3, "step0": step} if self.system.noise else {})

    @cached_property
    def fixed(self) -> Mapping[str, Solver]:
        """Solvers that keep the gauge which they choose at the start of the run."""
        if not self.compilation.program.gauge:
            return self.solvers
        module = self.solvers["numpy"].backend.module  # type: ignore[attr-defined]
        gauge = module.gauge(self.x0, **({"t": self.t0} if self.system.timed else {}), **self.system.values)
        return {t: Solver(s.backend.with_gauge(gauge), s.interface) for t, s in self.solvers.items()}  # type: ignore[attr-defined]

    @cached_property
    def plain(self) -> Compilation:
        """The compilation without pullbacks, which JavaScript does not have."""
        program = self.compilation.program
        step, extras = replace(program.step, adjoint=None), replace(program.extras, adjoint=False)
        return replace(self.compilation, program=replace(program, step=step, extras=extras))

    def part(self, target: str, double: float, single: float = 2e-4) -> float:
        """Return the tolerance ``single`` for a target that computes in single precision, otherwise ``double``."""
        return single if self.single and target == "c" else double

    def attribute(self, name: str) -> Any:
        """Return an attribute of the compilation."""
        return getattr(self.compilation, name)


def prepare(system: Ordinary) -> Trial:
    """Compile a system, and choose a step size that suits the time scale of its vector field."""
    try:
        spec = phigen.spec.loads(system.text + "".join(f"{key}: true\n" for key in system.asked))
        compilation = compile_spec(spec)
        solvers = {target: solver_of(compilation, target) for target in LOADED}
    except (SpecError, LimitError) as error:
        raise refused(error) from None
    start = np.array([*system.start, START if system.timed else 0.0])
    speed = speed_of(system.field, 0.0, start)
    if not np.isfinite(speed):
        raise RefusedError("the field is not finite at the start")
    return Trial(system, compilation, solvers, float(f"{0.1 / speed:.2g}"))


# --- the checks


def functions(trial: Trial) -> None:
    """Check that H, the vector field with forces, and Casimirs agree with the formulas."""
    system, x = trial.system, trial.x0 + 0.1 * trial.random.uniform(-1, 1, (3, len(trial.x0)))
    when = {"t": trial.t0 + 0.2} if system.timed else {}
    energy, velocity = system.function([system.hamiltonian]), system.function(system.velocity)
    casimirs = system.function(list(system.structure.casimirs))
    for target, solver in trial.solvers.items():
        part = trial.part(target, 1e-12, 1e-4)
        field = np.array([velocity(trial.t0 + 0.2, row) for row in x])
        expect_close(solver.vector_field(x, **when), field, part, f"{target}: vector_field")
        value = np.array([energy(trial.t0 + 0.2, row)[0] for row in x])
        expect_close(
            solver.hamiltonian(x, **when), value, part, f"{target}: hamiltonian", 1 + float(np.abs(value).max())
        )
        named = solver.casimirs(x)
        for k in range(len(system.structure.casimirs)):
            value = np.array([casimirs(0.0, row)[k] for row in x])
            expect_close(named[f"C{k}"], value, part, f"{target}: Casimir C{k}", 1 + float(np.abs(value).max()))


def observables(trial: Trial) -> None:
    """Check that observables agree with their formulas, at given states and times and along a run."""
    system, x = trial.system, trial.x0 + 0.1 * trial.random.uniform(-1, 1, (5, len(trial.x0)))
    forms = [OBSERVED[form] for form, *_ in system.observables.values()]
    operands = system.function([e for _, *pair in system.observables.values() for e in pair])
    for target, solver in trial.solvers.items():
        part = trial.part(target, 1e-12, 1e-4)
        run = solver.integrate(trial.x0, trial.h, 5, 2, **trial.since)
        expect(list(run.observables) == list(system.observables), f"{target}: observables {list(run.observables)}")
        when = np.linspace(0.2, 0.6, len(x)) + trial.t0
        at_states = solver.observables(x, **({"t": when} if system.timed else {}))
        for named, states, times in ((at_states, x, when), (run.observables, run.x, run.t)):
            pairs = [operands(t, row).reshape(-1, 2) for t, row in zip(times, states, strict=True)]
            values = np.array([[form(*pair) for form, pair in zip(forms, row, strict=True)] for row in pairs])
            for k, name in enumerate(system.observables):
                size = 1 + float(np.abs(values[:, k]).max())
                expect_close(np.asarray(named[name]), values[:, k], part, f"{target}: observable {name}", size)


def order(trial: Trial) -> None:
    """Check that errors decrease with the stated order, compared with a solution of the independent equations by
    DOP853.
    """
    system, solver, stated = trial.system, trial.solvers["c"], trial.compilation.order.order
    expect(
        stated >= min(system.order, 2 if system.noise else 16), f"order {system.order} was asked for, and is {stated}"
    )
    span = 8 * trial.h
    exact = flow(system.field, 0.0, np.array([*trial.x0, trial.t0]), span)
    _expect_flow(trial, solver, exact, stated, span)


def _expect_flow(
    trial: Trial, solver: Solver, exact: Floats, stated: int, span: float, pushes: Floats | None = None
) -> None:
    scale = max(1.0, float(np.abs(exact).max()))

    def ends(steps: int) -> Floats:
        more: dict[str, Any] = {"t0": trial.t0} if trial.system.timed else {}
        if trial.system.noise:
            draws = trial.solvers["c"].interface.draws
            more["increments"] = np.tile(np.zeros(draws) if pushes is None else pushes / steps, (steps, 1))
        run = solver.integrate(trial.x0, span / steps, steps, steps, **more)
        return np.array([*run.x[-1], run.t[-1]])

    floor = (2e-4 if trial.single else 4e-12) * scale
    expect_order(ends, exact, stated, floor, "c against DOP853")


def noise(trial: Trial) -> None:
    """Check noise by increments in proportion to the step size. The solution then converges, with order 2, to that of a
    deterministic equation: the vector field plus the noise sources.
    """
    system, draws = trial.system, trial.solvers["c"].interface.draws
    pushes = trial.random.normal(size=len(system.sources)) * 0.5
    span = 8 * trial.h
    twice = draws // len(system.sources)

    def field(s: float, y: Floats) -> Floats:
        driven = system.field(s, y)
        for push, source in zip(pushes, system.sources, strict=True):
            driven[:-1] += push / span * source(y[-1], y[:-1])
        return driven

    exact = flow(field, 0.0, np.array([*trial.x0, trial.t0]), span)
    _expect_flow(trial, trial.solvers["c"], exact, 2, span, np.tile(pushes / twice, twice))


def targets(trial: Trial) -> None:
    """Check that runs in C, NumPy and JavaScript agree to round-off."""
    steps = 11
    runs = {t: s.integrate(trial.x0, trial.h, steps, 3, **trial.since) for t, s in trial.solvers.items()}
    c, numpy = runs["c"], runs["numpy"]
    scale, part = float(np.abs(numpy.x).max()), trial.part("c", 2e-13)
    expect_close(c.x, numpy.x, part, "states of C and NumPy", scale)
    expect_close(c.t, numpy.t, part, "times of C and NumPy")
    expect_close(c.energy, numpy.energy, 20 * part, "energies of C and NumPy", 1 + float(np.abs(numpy.energy).max()))
    if c.attitude is not None:
        expect_close(c.attitude, numpy.attitude, 10 * part, "attitudes of C and NumPy")
    options = [f"x0: {trial.x0.tolist()}"] + [f"{k}: {v}{'n' * (k == 'seed')}" for k, v in trial.since.items()]
    value = "[[...s.x], s.t, s.hamiltonian(), [...(s.attitude ?? [])], [...(s.observables?.() ?? [])]]"
    x, t, energy, attitude, seen = javascript(
        trial.plain, ", ".join(options), f"s.integrate({trial.h!r}, {steps})", value
    )
    expect_close(np.array(x), numpy.x[-1], 2e-13, "states of JavaScript and NumPy", scale)
    expect_close(np.array(t), numpy.t[-1], 2e-13, "time of JavaScript and NumPy", 1.0)
    expect_close(
        np.array(energy), numpy.energy[-1], 4e-12, "energy of JavaScript", 1 + float(np.abs(numpy.energy).max())
    )
    for at_end, (name, rows) in zip(seen, numpy.observables.items(), strict=True):
        expect_close(
            np.array(at_end), rows[-1], 2e-11, f"observable {name} of JavaScript", 1 + float(np.abs(rows).max())
        )
    if numpy.attitude is not None:
        expect_close(np.array(attitude), numpy.attitude[-1].ravel(), 2e-12, "attitude of JavaScript")


def bits(trial: Trial) -> None:
    """Check that runs with a stride, sessions, their copies and pickles give the same bits as one run."""
    for target, steps, stride in (("c", 19, 7), ("numpy", 7, 3)):
        solver = trial.solvers[target]
        whole = solver.integrate(trial.x0, trial.h, steps, **trial.since)
        thin, rows = solver.integrate(trial.x0, trial.h, steps, stride, **trial.since), [0, stride, 2 * stride, steps]
        expect_same_bits(thin.x, whole.x[rows], f"{target}: states with a stride")
        expect_same_bits(thin.t, whole.t[rows], f"{target}: times with a stride")
        session = solver.session(trial.x0, **trial.since).step(trial.h, 3)
        expect_same_bits(session.x, whole.x[3], f"{target}: a session after 3 steps")
        twins = [session.copy(), pickle.loads(pickle.dumps(session)), session]
        for name, twin in zip(("a copy", "a pickled session", "a session"), twins, strict=True):
            end = twin.step(trial.h, 1).step(trial.h, steps - 4)
            expect_same_bits(end.x, whole.x[-1], f"{target}: {name} after 3, 4 and {steps} steps")
            expect_close(np.array(end.t), whole.t[-1], 1e-14, f"{target}: time of {name}", 1.0)


def until(trial: Trial) -> None:
    """Check that a run until a given time ends with a fraction of a step."""
    if trial.system.monitor is not None:
        return
    for target, solver in trial.solvers.items():
        run = solver.integrate(trial.x0, trial.h, until=trial.t0 + 6.4 * trial.h, **trial.since)
        session = solver.session(trial.x0, **trial.since).step(trial.h, 6)
        if not trial.system.noise:
            session.step(trial.t0 + 6.4 * trial.h - session.t)
        else:
            expect_same_bits(run.x[6], session.x, f"{target}: until, before its last step")
            continue
        expect_close(run.x[-1], session.x, trial.part(target, 1e-13), f"{target}: until", float(np.abs(run.x).max()))
        expect_close(run.t[-1], np.array(trial.t0 + 6.4 * trial.h), 1e-14, f"{target}: time of until", 1.0)


def members(trial: Trial) -> None:
    """Check that members of ensembles with different parameters, steps and start times agree with single runs."""
    many, steps = 11, 6
    x, sizes, options, since = _many(trial, many)
    for target, solver in trial.solvers.items():
        rows = solver.ensemble(x, sizes, steps, 4, **since, **options)
        last = solver.ensemble(x, sizes, steps, **since, **options)
        expect_close(last, rows[-1], trial.part(target, 1e-13), f"{target}: an ensemble with and without a stride")
        for m in (0, many - 1):
            each = {k: float(v[m]) for k, v in options.items()}
            begin = {k: (float(v[m]) if k == "t0" else v) for k, v in since.items()} | (
                {"member": m} if trial.system.noise else {}
            )
            run = solver.integrate(x[m], sizes[m], steps, 4, **begin, **each)
            expect_close(rows[:, m], run.x, trial.part(target, 1e-12), f"{target}: member {m} of {many} and its run")
        _expect_unmoved_by_failure(trial, target, rows, (x, sizes, options, since))


def _expect_unmoved_by_failure(trial: Trial, target: str, rows: Floats, many: Any) -> None:
    """Check that members do not change if another member starts so far away that it may fail."""
    x, sizes, parameters, since = many
    far = x.copy()
    far[1] = 1e150
    try:
        ends = trial.solvers[target].ensemble(far, sizes, 6, **since, **parameters)
    except StepError as failed:
        ends = failed.trajectory
        if list(failed.members) != [1]:
            raise
    others = np.arange(len(x)) != 1
    expect_close(ends[others], rows[-1][others], trial.part(target, 1e-12), f"{target}: members beside one far away")


def _many(trial: Trial, many: int) -> tuple[Floats, Floats, dict[str, Floats], dict[str, Any]]:
    """Return the states, step sizes, parameters and further arguments of the members of an ensemble."""
    random = trial.random
    x = trial.x0 + 0.05 * random.uniform(-1, 1, (many, len(trial.x0)))
    sizes = trial.h * random.uniform(0.7, 1, many)
    parameters = {name: value * random.uniform(0.9, 1.1, many) for name, value in trial.system.values.items()}
    since = dict(trial.since)
    if trial.system.timed:
        since["t0"] = trial.t0 + random.uniform(-1, 1, many)
    return x, sizes, parameters, since


def gradient(trial: Trial) -> None:
    """Check that the pullback of a run agrees with finite differences, along random directions of the start and of all
    parameters.
    """
    steps, stride, random = 7, 3, trial.random
    values, n = trial.system.values, len(trial.x0)
    bars, along = random.normal(size=(4, n)), random.normal(size=n)
    pushes = {name: 0.3 * value * random.normal() for name, value in values.items()}
    derivatives = {}
    for target, solver in trial.fixed.items():
        back = solver.pullback(trial.x0, trial.h, steps, bars, stride, **trial.since)
        run = solver.integrate(trial.x0, trial.h, steps, stride, **trial.since)
        expect_close(back.x1, run.x, trial.part(target, 1e-13), f"{target}: states of the pullback and of the run")
        derivatives[target] = np.array([*back.x0_bar, *(back.parameters_bar[name] for name in values)])

    run = trial.fixed["numpy" if trial.single else "c"]

    def weighed(e: float) -> Floats:
        displaced = {name: value + e * pushes[name] for name, value in values.items()}
        rows = run.integrate(trial.x0 + e * along, trial.h, steps, stride, **trial.since, **displaced).x
        return np.array(float(np.sum(bars * rows)))

    slope, doubt = derivative(weighed)
    direction = np.array([*along, *(pushes[name] for name in values)])
    scale = float(np.abs(derivatives["numpy"]) @ np.abs(direction)) + float(np.abs(slope)) + 1e-3
    for target, bar in derivatives.items():
        part = max(trial.part(target, 1e-9, 5e-3), 30 * float(doubt) / scale)
        expect_close(np.array(bar @ direction), slope, part, f"{target}: pullback and differences", scale)
    expect_close(derivatives["c"], derivatives["numpy"], trial.part("c", 1e-11, 5e-3), "pullback of C and NumPy")


def member_gradients(trial: Trial) -> None:
    """Check that pullbacks of members agree with those of single runs."""
    many, steps = 10, 3
    x, sizes, options, since = _many(trial, many)
    bars = trial.random.normal(size=x.shape)
    for target, solver in trial.solvers.items():
        back = solver.pullback(x, sizes, steps, bars, **since, **options)
        scale = float(np.abs(back.x0_bar).max())
        for m in (0, many - 1):
            each = {k: float(v[m]) for k, v in options.items()}
            begin = {k: (float(v[m]) if k == "t0" else v) for k, v in since.items()}
            alone = solver.pullback(x[m], float(sizes[m]), steps, bars[m], **begin, **each)
            part = trial.part(target, 1e-11, 5e-3)
            expect_close(back.x0_bar[m], alone.x0_bar, part, f"{target}: x0_bar of member {m} and of its run", scale)
            for name in options:
                bar = np.array(back.parameters_bar[name][m])
                expect_close(bar, alone.parameters_bar[name], part, f"{target}: {name}_bar of member {m}", scale + 1)


def tangent(trial: Trial) -> None:
    """Check that the product of the tangent maps of a run agrees with finite differences and between targets."""
    steps, n = 3, len(trial.x0)
    along, products = trial.random.normal(size=n), {}
    for target, solver in trial.fixed.items():
        product = np.eye(n)
        for _, step in solver.tangents(trial.x0, trial.h, steps, **trial.since):
            product = step @ product
        products[target] = product
    if trial.system.monitor is None:
        run = trial.fixed["numpy" if trial.single else "c"]
        slope, doubt = derivative(
            lambda e: run.integrate(trial.x0 + e * along, trial.h, steps, steps, **trial.since).x[-1]
        )
        scale = float(np.abs(products["numpy"]).max()) * float(np.abs(along).sum())
        for target, product in products.items():
            part = max(trial.part(target, 1e-9, 2e-3), 30 * float(doubt.max()) / scale)
            expect_close(product @ along, slope, part, f"{target}: tangents and differences", scale)
    expect_close(products["c"], products["numpy"], trial.part("c", 1e-12, 2e-3), "tangents of C and NumPy")


def jacobian(trial: Trial) -> None:
    """Check that the pullback of a step is the transpose of its tangent map."""
    bar = trial.random.normal(size=len(trial.x0))
    for target, solver in trial.solvers.items():
        _, step = solver.step_tangent(trial.x0, trial.h, **trial.since)
        back = solver.pullback(trial.x0, trial.h, 1, bar, **trial.since)
        expect_close(
            back.x0_bar, bar @ step, trial.part(target, 1e-12, 2e-3), f"{target}: pullback and tangent of a step"
        )


def poisson(trial: Trial) -> None:
    """Check that a step is a Poisson map: DΦ π DΦᵀ equals π at the end of the step."""
    system = trial.system
    n = len(trial.x0)
    entries = system.function([system.structure.pi[i, j] for i in range(n) for j in range(n)])
    for target, solver in trial.solvers.items():
        x, step = solver.step_tangent(trial.x0, 2 * trial.h, **trial.since)
        before, after = (entries(0.0, y).reshape(n, n) for y in (trial.x0, x))
        scale = float((np.abs(step) @ np.abs(before) @ np.abs(step.T)).max()) + float(np.abs(after).max())
        expect_close(
            step @ before @ step.T, after, trial.part(target, 1e-12, 2e-4), f"{target}: Poisson identity", scale
        )


def casimirs(trial: Trial) -> None:
    """Check that Casimirs are constant to round-off; they are evaluated by the formulas of this test."""
    compiled = numeric(list(trial.system.structure.casimirs), trial.system.arguments)
    for target, solver in trial.solvers.items():
        run = solver.integrate(trial.x0, 2 * trial.h, 30, 30, **trial.since)
        expect_same_bits(run.x[0], trial.x0, f"{target}: the first row") if not trial.single else None
        values = np.array([compiled(0.0, *x, *trial.system.values.values()) for x in run.x], dtype=float)
        largest = float(max(1.0, np.abs(run.x).max() ** 3, np.abs(values).max()))
        expect_close(values[-1], values[0], trial.part(target, 2e-13, 1e-3), f"{target}: Casimirs", largest)


def reversal(trial: Trial) -> None:
    """Check that steps of −h lead back to the start of steps of h."""
    for target, solver in trial.solvers.items():
        session = solver.session(trial.x0, **trial.since)
        for _ in range(3):
            session.step(trial.h)
        far = float(np.abs(session.x - trial.x0).max())
        for _ in range(3):
            session.step(-trial.h)
        scale = float(np.abs(trial.x0).max()) + far
        expect_close(session.x, trial.x0, trial.part(target, 1e-12, 1e-4), f"{target}: there and back", scale)


def attitude(trial: Trial) -> None:
    """Check that the attitude maps the momentum to its constant value in the other frame, and that errors of the
    attitude decrease with the order of the method.
    """
    system, sign, span = trial.system, trial.system.structure.body, 8 * trial.h
    slope = system.function(list(system.slope))

    def field(s: float, y: Floats) -> Floats:
        moved, turned = system.field(s, y[:4]), y[4:].reshape(3, 3)
        omega = _hat(moved[3] * slope(y[3], y[:3]))
        return np.array([*moved, *(turned @ omega if sign < 0 else omega @ turned).ravel()])

    exact = flow(field, 0.0, np.array([*trial.x0, trial.t0, *np.eye(3).ravel()]), span)
    for target, solver in trial.solvers.items():

        def ends(steps: int, solver: Solver = solver, target: str = target) -> Floats:
            run = solver.integrate(trial.x0, span / steps, steps, steps, **trial.since)
            turned = _rotation(run.attitude[-1])
            if not system.forced:
                image = turned @ run.x[-1] if sign < 0 else turned.T @ run.x[-1]
                expect_close(image, trial.x0, trial.part(target, 1e-13, 1e-4), f"{target}: momentum in the other frame")
            return np.array(turned.ravel())

        floor = 2e-4 if trial.single else 4e-12
        expect_order(ends, exact[4:], trial.compilation.order.order, floor, f"{target}: attitude against DOP853")


def _hat(v: Floats) -> Floats:
    """Return the matrix of the map u ↦ v × u."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _rotation(q: Floats) -> Floats:
    """Return the rotation matrix of a quaternion; a matrix is returned unchanged."""
    if q.shape == (3, 3):
        return q
    w, v = q[0], q[1:]
    return np.array((w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * _hat(v))


def hopeless(trial: Trial) -> None:
    """Check that a step that is far too large raises a `StepError` and leaves the state, or has a finite result."""
    for target, solver in trial.solvers.items():
        for h in (300 * trial.h, 1e30) if target == "c" else (1e30,):
            session = solver.session(trial.x0, **trial.since)
            try:
                session.step(h)
                expect(bool(np.isfinite(session.x).all()), f"{target}: a step of {h:g} leads to {session.x}")
            except StepError as error:
                known = ("NO_CONVERGENCE", "SINGULAR", "NOT_FINITE", "BAD_ARGUMENT")
                expect(error.status in known, f"{target}: status {error.status}")
                expect_close(session.x, trial.x0, 1e-7 if trial.single else 0.0, f"{target}: the state after a failure")
                session.step(trial.h)


def extras(trial: Trial) -> None:
    """Check that derivatives and options work, both those requested in the spec and those requested in the call of
    `compile`.
    """
    spec = phigen.spec.loads(trial.system.text)
    solver = phigen.compile(spec, "numpy", **trial.system.asked)
    if trial.compilation.program.extras.adjoint:
        solver.pullback(trial.x0, trial.h, 1, trial.x0, **trial.since)
    if trial.compilation.program.extras.tangent:
        solver.step_tangent(trial.x0, trial.h, **trial.since)
    expect(solver.interface.single == trial.single, f"real: float is {solver.interface.single} of compile(**asked)")


def _wants(name: str) -> Callable[[Trial], bool]:
    return lambda trial: getattr(trial.compilation.program.extras, name)


def _is_observed(trial: Trial) -> bool:
    return bool(trial.system.observables)


def _always(trial: Trial) -> bool:
    return True


def _is_plain(trial: Trial) -> bool:
    """Whether the method has no corrector, which is applied at each output and adds rounding errors there."""
    return not trial.compilation.program.step.corrected


def _has_both(trial: Trial) -> bool:
    """Whether a step has both a tangent map and a pullback of the same map. With a monitor the maps differ, as only the
    tangent map holds the energy level fixed.
    """
    return _wants("adjoint")(trial) and _wants("tangent")(trial) and trial.system.monitor is None


def _is_poisson(trial: Trial) -> bool:
    return _wants("tangent")(trial) and bool(trial.attribute("poisson")) and not trial.system.forced


def _keeps_casimirs(trial: Trial) -> bool:
    return bool(trial.system.structure.casimirs) and not trial.system.vector and bool(trial.attribute("exact"))


def _has_ensembles(trial: Trial) -> bool:
    options = trial.system.options
    return "ensemble" not in options.get("without", ()) and options.get("profile") != "certified"


def _runs_on_devices(trial: Trial) -> bool:
    return device_checks.applies(trial.system.seed) and _has_ensembles(trial)


def _asked_twice(trial: Trial) -> bool:
    """Whether both the spec and the call of `compile` request options."""
    return bool(trial.system.asked) and not {"adjoint", "tangent", "real", "without"}.isdisjoint(trial.system.options)


_GRADIENT = """bar = np.random.default_rng(1).normal(size=x.shape)
f = lambda y: bar @ s.integrate(y, h, 7, **since).x[-1]
print("pullback   ", s.pullback(x, h, 7, bar, **since).x0_bar)
print("differences", np.array([(f(x + 1e-5 * e) - f(x - 1e-5 * e)) / 2e-5 for e in np.eye(len(x))]))"""
_RUN = "print(target, s.integrate(x, h, 11, 3, **since).x[-1])"
_BACK = "r = s.session(x, **since); r.step(h).step(-h); print(r.x - x)"
_ATTITUDE = "print(target, s.integrate(x, h, 11, **since).attitude[-1])"

CHECKS = (
    Check("functions are those of the formulas", functions, _always, "print(s.vector_field(x), s.hamiltonian(x))"),
    Check("observables are those of the formulas", observables, _is_observed, "print(s.observables(x))"),
    Check("order", order, _always, _RUN),
    Check("targets agree", targets, _always, _RUN),
    Check("strides and sessions keep the bits", bits, _is_plain, _RUN),
    Check("until", until, lambda t: t.system.monitor is None),
    Check("members are runs", members, _has_ensembles),
    Check("gradient", gradient, _wants("adjoint"), _GRADIENT),
    Check("gradients of members", member_gradients, _wants("adjoint"), _GRADIENT),
    Check("tangent", tangent, _wants("tangent"), "print(target, s.step_tangent(x, h, **since))"),
    Check("transpose of the tangent", jacobian, _has_both, _GRADIENT),
    Check("Poisson map", poisson, _is_poisson, "print(target, s.step_tangent(x, h, **since))"),
    Check("Casimirs", casimirs, _keeps_casimirs, _RUN),
    Check("reversal", reversal, lambda t: t.attribute("symmetric") and not t.system.noise, _BACK),
    Check("attitude", attitude, lambda t: "reconstruct" in t.system.options and not t.system.noise, _ATTITUDE),
    Check("noise", noise, lambda t: bool(t.system.noise), _RUN),
    Check("steps that are too large", hopeless, _always, "s.step(x, 300 * h)"),
    Check("extras", extras, _asked_twice),
    Check("C++", lambda t: as_cpp(t.compilation, lattice=False), lambda t: t.system.seed % 20 == 0),
    Check("devices", lambda t: device_checks.members(t, _many(t, 5)), _runs_on_devices, _RUN),
)  # fmt: skip


def script(system: Ordinary, check: Check | None) -> str:
    """Return a script that shows the two results which a check compares."""
    since = ({"t0": START} if system.timed else {}) | ({"seed": 2**40 + 3} if system.noise else {})
    try:
        h = prepare(system).h
    except Exception:  # the script shows that the system does not compile
        h = 0.1
    return (
        f"import numpy as np, phigen, phigen.spec\n"
        f'spec = phigen.spec.loads(open("case.yaml").read())  # the lines above\n'
        f"x, h, since = np.array({list(system.start)}), {h!r}, {since}\n"
        f'for target in ("c", "numpy"):\n'
        f"    s = phigen.compile(spec, target{''.join(f', {k}=True' for k in system.asked)})\n"
        + "\n".join(f"    {line}" for line in (check.lines if check else "").splitlines())
    )


SUITE = Suite(draw_ordinary, prepare, CHECKS, script)
