"""Checks that every random lattice must pass: comparisons with independent equations of motion, with finite
differences, and across targets.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from differential import device_checks
from differential.inputs import as_cpp, malformed, tables
from differential.lattices import draw_lattice
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
from differential.sites import Lattice
from differential.trial import Check, RefusedError, Suite, refused
from node import asked as asked_of_node
from solvers import COMMAND
from tools import write

import phigen
import phigen.spec
from phigen.api import lattice_solver_of
from phigen.compilation import Compilation
from phigen.compiler import compile_spec, emit
from phigen.errors import LimitError, SpecError, StepError
from phigen.lattice.states import start_of
from phigen.runtime.lattice import LatticeSolver

LOADED = ("c", "numpy")
START = 0.3


@dataclass(frozen=True)
class Trial:
    """A lattice with its compilation and solvers, and the data of a run: initial state x0 (fields, *sizes), parameters,
    step size h, start time t0.
    """

    system: Lattice
    compilation: Compilation
    solvers: Mapping[str, LatticeSolver]
    h: float = 0.0

    @property
    def random(self) -> np.random.Generator:
        """New generator of random numbers, with the same numbers for every check."""
        return np.random.default_rng(self.system.seed)

    @cached_property
    def x0(self) -> Floats:
        """Initial state of the run."""
        shape = (len(self.system.fields), *self.system.sizes)
        drawn = np.random.default_rng(self.system.seed + 1).uniform(0.4, 1.1, shape)
        signs = np.random.default_rng(self.system.seed + 2).choice([-1.0, 1.0], shape)
        return np.array(drawn if self.system.positive else drawn * signs)

    @cached_property
    def values(self) -> dict[str, Any]:
        """Values of the parameters: numbers, or arrays over sites or bonds."""
        random, shapes = (
            np.random.default_rng(self.system.seed + 3),
            {"sites": self.system.sizes, "bonds": (len(self.system.bonds),)},
        )
        return {
            n: random.uniform(0.5, 1.2, shapes[p.at]) if p.at in shapes else float(random.uniform(0.5, 1.2))
            for n, p in self.system.parameters.items()
        }

    @property
    def given(self) -> dict[str, Any]:
        """Parameters and bonds as keyword arguments for a solver."""
        return {**self.values, **({"bonds": self.system.edges} if self.system.graph else {})}

    @property
    def since(self) -> dict[str, Any]:
        """Keyword arguments for calls that begin at the start: the start time, and the seed of the noise."""
        return ({"t0": START} if self.system.timed else {}) | ({"seed": 2**40 + 3} if self.system.noise else {})

    @property
    def held(self) -> dict[str, Any]:
        """Keyword argument for calls that hold the energy level of the start fixed, for lattices with a monitor."""
        if not self.system.monitored:
            return {}
        return {"gauge": -self.system.densities(self.values, self.t0, self.x0.reshape(len(self.x0), -1))}

    @property
    def t0(self) -> float:
        """Start time of the run."""
        return START if self.system.timed else 0.0

    @property
    def single(self) -> bool:
        """Whether the C computes in single precision."""
        return self.compilation.program.single

    @property
    def splits(self) -> bool:
        """Whether steps are compositions of flows of parts of H."""
        return self.compilation.program.step.equation is None  # type: ignore[union-attr]

    def part(self, target: str, double: float, single: float = 2e-4) -> float:
        """Return the tolerance ``single`` for a target that computes in single precision, otherwise ``double``."""
        return single if self.single and target == "c" else double

    @cached_property
    def field(self) -> Callable[[float, Floats], Floats]:
        """Right-hand side of the equations of motion without noise, for states as vectors. With a monitor it is the
        derivative along the fictitious time τ.
        """
        rate, shape = self.system.rates(self.values), (len(self.system.fields), self.system.count)

        def field(t: float, y: Floats) -> Floats:
            x = y.reshape(shape)
            return np.asarray(rate(t, x).ravel() * self.system.pace(self.values, x))

        return field


def prepare(system: Lattice) -> Trial:
    """Compile a lattice, and choose a step size that suits the time scale of its vector field."""
    try:
        spec = phigen.spec.loads(system.text + "".join(f"{key}: true\n" for key in system.asked))
        compilation = compile_spec(spec)
        solvers = {target: lattice_solver_of(compilation, target) for target in LOADED}
    except (SpecError, LimitError) as error:
        raise refused(error) from None
    trial = Trial(system, compilation, solvers)
    speed = speed_of(trial.field, trial.t0, trial.x0.ravel())
    if not np.isfinite(speed):
        raise RefusedError("the field is not finite at the start")
    return replace(trial, h=float(f"{0.1 / speed:.2g}"))


# --- the checks


def starts(trial: Trial) -> None:
    """Check that the initial state and parameters of a run have the values that docs/lattices.md defines."""
    system = trial.system
    begun = start_of(trial.compilation.spec, trial.compilation.spec.runs["r"])
    for name, parameter in system.parameters.items():
        shape = {"sites": system.sizes, "bonds": (len(system.bonds),)}.get(parameter.at, ())
        value = np.broadcast_to(np.asarray(begun.parameters[name], dtype=float), shape)
        _expect_drawn(system, value, parameter.value, f"parameter {name}")
    if "random" not in system.initial:
        for k, name in enumerate(system.fields):
            _expect_drawn(system, begun.state[k], system.initial[name], f"start of {name}")
    elif system.initial["random"] == "sphere":
        length = np.sqrt((begun.state**2).sum(axis=0))
        expect_close(length, np.ones_like(length), 1e-14, "length of unit vectors")
    elif system.initial.get("scale") == 0:
        expect_close(begun.state, np.zeros_like(begun.state), 0.0, "random start with scale 0", 1.0)


def _expect_drawn(system: Lattice, value: Floats, said: Any, what: str) -> None:
    """Check that an array has the values that the spec gives: a number, a formula, a list, or random numbers about a
    mean.
    """
    if not isinstance(said, dict):
        return expect_close(value, _spelt(system, said, value.shape), 1e-14, what, 1.0)
    spread = value - np.broadcast_to(_spelt(system, said.get("mean", 0), value.shape), value.shape)
    scale = _number(said.get("scale", 1))
    if scale == 0:
        return expect_close(spread, np.zeros_like(spread), 1e-14, f"{what}, random with scale 0", 1.0)
    most = {"uniform": 1.0, "normal": 7.0}[said["random"]]
    expect(float(np.abs(spread / scale).max(initial=0.0)) <= most, f"{what}: {said} gives {value.ravel()[:4]}")
    expect(value.size < 3 or float(np.ptp(spread)) > 1e-3 * scale, f"{what}: {said} gives {value.ravel()[:4]}")


def _spelt(system: Lattice, said: Any, shape: tuple[int, ...]) -> Floats:
    """Return the values that a number, a list or one of the drawn formulas in a spec denotes."""
    if isinstance(said, list):
        return np.array(said, dtype=float).reshape(shape)
    if not isinstance(said, str) or (said[0].isdigit() and said[-1].isdigit()):
        return np.full(shape, _number(said))
    index = next(a for a in (system.axes or ("i",)) if a in said.replace("pi", ""))
    axis = system.axes.index(index) if system.axes else 0
    i, n = np.indices(system.sizes)[axis], system.sizes[axis]
    return {"1 +": 1 + i / n, "cos": np.cos(2 * np.pi * i / n) / 2, f"{index} -": i - 1.0}[said[:3]]


def _number(said: Any) -> float:
    top, _, bottom = str(said).partition("/")
    return float(top) / float(bottom or 1)


def functions(trial: Trial) -> None:
    """Check that H, its density, the vector field, observables and Casimirs agree with the formulas."""
    system, x, when = trial.system, trial.x0, {"t": START} if trial.system.timed else {}
    field = trial.field(trial.t0, x.ravel()).reshape(x.shape) / system.pace(trial.values, x.reshape(len(x), -1))
    energy = system.densities(trial.values, trial.t0, x.reshape(len(x), -1))
    for target, solver in trial.solvers.items():
        part = trial.part(target, 1e-12, 1e-4)
        expect_close(
            solver.vector_field(x, **when, **trial.given),
            field,
            part,
            f"{target}: vector_field",
            1 + float(np.abs(field).max()),
        )
        expect_close(
            np.array(solver.hamiltonian(x, **when, **trial.given)),
            np.array(energy),
            part,
            f"{target}: hamiltonian",
            1 + abs(energy),
        )
        density = np.array(np.sum(solver.density(x, **when, **trial.given)))
        expect_close(density, np.array(energy), part, f"{target}: sum of the density", 1 + abs(energy))
        seen = solver.observables(x, **when, **trial.given)
        for name, value in system.seen(trial.values, x.reshape(len(x), -1)).items():
            size = 1 + float(np.abs(value).max(initial=0.0))
            expect_close(np.array(seen[name]), value, part, f"{target}: observable {name}", size)
        if system.casimir is not None:
            expect_close(solver.casimirs(x, **trial.given)["C"], (x**2).sum(axis=0), part, f"{target}: Casimir")


def order(trial: Trial) -> None:
    """Check that errors decrease with the stated order, compared with a solution of the independent equations by
    DOP853.
    """
    system, stated, span = trial.system, trial.compilation.order.order, 8 * trial.h
    expect(stated >= system.options.get("order", 2), f"order {system.options['order']} was asked for, and is {stated}")
    exact = flow(trial.field, trial.t0, trial.x0.ravel(), span)
    solver, scale = trial.solvers["c"], max(1.0, float(np.abs(exact).max()))
    floor = (2e-4 if trial.single else 4e-12) * scale

    def ends(steps: int) -> Floats:
        return np.array(
            solver.integrate(trial.x0, span / steps, steps, steps, **trial.since, **trial.given).x[-1].ravel()
        )

    expect_order(ends, exact, stated, floor, "c against DOP853")


def targets(trial: Trial) -> None:
    """Check that runs in C, NumPy and JavaScript agree to round-off."""
    steps = 7
    runs = {t: s.integrate(trial.x0, trial.h, steps, 3, **trial.since, **trial.given) for t, s in trial.solvers.items()}
    c, numpy = runs["c"], runs["numpy"]
    scale, part = float(np.abs(numpy.x).max()), trial.part("c", 1e-12)
    expect_close(c.x, numpy.x, part, "states of C and NumPy", scale)
    expect_close(c.t, numpy.t, 1e-13, "times of C and NumPy", 1.0)
    expect_close(c.energy, numpy.energy, 20 * part, "energies of C and NumPy", 1 + float(np.abs(numpy.energy).max()))
    x, t, energy = _javascript(trial, steps)
    expect_close(np.reshape(x, trial.x0.shape), numpy.x[-1], 1e-12, "states of JavaScript and NumPy", scale)
    expect_close(np.array(t), numpy.t[-1], 1e-13, "time of JavaScript and NumPy", 1.0)
    expect_close(
        np.array(energy), numpy.energy[-1], 2e-11, "energy of JavaScript", 1 + float(np.abs(numpy.energy).max())
    )


def _javascript(trial: Trial, steps: int) -> Any:
    """Return the final state, time and energy of the run in JavaScript."""
    program = trial.compilation.program
    plain = replace(program, step=replace(program.step, adjoint=None), extras=replace(program.extras, adjoint=False))
    options: dict[str, Any] = {"x0": trial.x0.ravel().tolist(), "sizes": list(trial.system.sizes)}
    options["params"] = {n: np.ravel(v).tolist() if np.ndim(v) else v for n, v in trial.values.items()}
    options |= {"bonds": trial.system.edges.ravel().tolist()} if trial.system.graph else {}
    options |= {k: v for k, v in trial.since.items() if k != "seed"}
    seed = f"options.seed = {trial.since['seed']}n; " if trial.system.noise else ""
    (source,) = emit(plain, "js", COMMAND).values()
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder), {"solver.mjs": source})
        setup = f"const options = {json.dumps(options)}; {seed}const s = new module.Solver(options); "
        call = f"s.integrate({trial.h!r}, {steps}); return [[...s.x], s.t, s.hamiltonian()]"
        return asked_of_node(Path(folder) / "solver.mjs", setup + call)


def bits(trial: Trial) -> None:
    """Check that a stride, streamed frames and a resumed checkpoint give the same bits as one run; with implicit steps
    a stride may change round-off.
    """
    for target, solver in trial.solvers.items():
        whole = solver.integrate(trial.x0, trial.h, 9, **trial.since, **trial.given)
        thin = solver.integrate(trial.x0, trial.h, 9, 4, **trial.since, **trial.given)
        expect_close(thin.x, whole.x[[0, 4, 8, 9]], trial.part(target, 1e-13), f"{target}: states with a stride")
        if trial.splits:
            expect_same_bits(thin.x, whole.x[[0, 4, 8, 9]], f"{target}: states with a stride")
        whole = solver.integrate(trial.x0, trial.h, 9, 3, **trial.since, **trial.given)
        with tempfile.TemporaryDirectory() as folder:
            _expect_resumed(trial, solver, whole.x, Path(folder), target)


def _expect_resumed(trial: Trial, solver: LatticeSolver, rows: Floats, folder: Path, target: str) -> None:
    """Check that an interrupted run, resumed from its checkpoint, has the same bits as a whole run."""

    def stop(steps_done: int) -> None:
        if steps_done >= 6:
            raise KeyboardInterrupt

    more: dict[str, Any] = {
        "checkpoints": folder / "state",
        "output": folder / "frames.npy",
        **trial.since,
        **trial.given,
    }
    with contextlib.suppress(KeyboardInterrupt):
        solver.integrate(trial.x0, trial.h, 9, 3, progress=stop, **more)
    resumed = solver.integrate(trial.x0, trial.h, 9, 3, **more)
    expect_same_bits(np.asarray(resumed.x), rows, f"{target}: a run that was resumed")
    expect_same_bits(np.load(folder / "frames.npy"), rows, f"{target}: frames that were streamed")


def sessions(trial: Trial) -> None:
    """Check that sessions and their copies agree with a run."""
    for target, solver in trial.solvers.items():
        whole = solver.integrate(trial.x0, trial.h, 9, **trial.since, **trial.given)
        session = solver.session(trial.x0, **trial.since, **trial.given).step(trial.h, 3)
        expect_close(session.x, whole.x[3], trial.part(target, 1e-13), f"{target}: a session after 3 steps")
        for name, twin in (("a copy", session.copy()), ("a session", session)):
            end = twin.step(trial.h, 1).step(trial.h, 5)
            expect_close(end.x, whole.x[-1], trial.part(target, 1e-12), f"{target}: {name} after 3 + 1 + 5 steps")


def members(trial: Trial) -> None:
    """Check that members of ensembles with different parameters and steps agree with single runs."""
    x, sizes, options = _many(trial, 3)
    shared = {"bonds": trial.system.edges} if trial.system.graph else {}
    for target, solver in trial.solvers.items():
        rows = solver.ensemble(x, sizes, 5, 2, **trial.since, **options, **shared)
        for m in (0, 2):
            each = {k: v[m] if np.ndim(v[m]) else float(v[m]) for k, v in options.items()}
            begin = trial.since | ({"member": m} if trial.system.noise else {})
            run = solver.integrate(x[m], float(sizes[m]), 5, 2, **begin, **each, **shared)
            expect_close(rows[:, m], run.x, trial.part(target, 1e-12), f"{target}: member {m} and its run")


def _many(trial: Trial, many: int) -> tuple[Floats, Floats, dict[str, Any]]:
    """Return the states, step sizes and parameters of the members of an ensemble."""
    random = trial.random
    x = trial.x0 + 0.05 * random.uniform(-1, 1, (many, *trial.x0.shape))
    parameters = {n: np.multiply.outer(random.uniform(0.9, 1.1, many), v) for n, v in trial.values.items()}
    return x, trial.h * random.uniform(0.7, 1, many), parameters


def gradient(trial: Trial) -> None:
    """Check that the pullback of a run agrees with finite differences, along random directions of the start and of all
    parameters.
    """
    steps, stride, random = 5, 2, trial.random
    bars, along = random.normal(size=(4, *trial.x0.shape)), random.normal(size=trial.x0.shape)
    pushes = {n: 0.3 * random.normal(size=np.shape(v)) for n, v in trial.values.items()}
    shared = {"bonds": trial.system.edges} if trial.system.graph else {}
    derivatives = {}
    for target, solver in trial.solvers.items():
        back = solver.pullback(trial.x0, trial.h, steps, bars, stride, **trial.since, **trial.given)
        run = solver.integrate(trial.x0, trial.h, steps, stride, **trial.since, **trial.given)
        expect_close(back.x1, run.x, trial.part(target, 1e-13), f"{target}: states of the pullback and of the run")
        for name, bar in back.parameters_bar.items():
            expect(np.shape(bar) == np.shape(trial.values[name]), f"{target}: {name}_bar has shape {np.shape(bar)}")
        derivatives[target] = np.concatenate(
            [back.x0_bar.ravel(), *(np.ravel(back.parameters_bar[n]) for n in trial.values)]
        )

    run = trial.solvers["numpy" if trial.single else "c"]

    def weighed(e: float) -> Floats:
        displaced = {n: v + e * pushes[n] for n, v in trial.values.items()} | shared
        rows = run.integrate(trial.x0 + e * along, trial.h, steps, stride, **trial.since, **displaced).x
        return np.array(float(np.sum(bars * rows)))

    slope, doubt = derivative(weighed)
    direction = np.concatenate([along.ravel(), *(np.ravel(pushes[n]) for n in trial.values)])
    scale = float(np.abs(derivatives["numpy"]) @ np.abs(direction)) + float(np.abs(slope)) + 1e-3
    for target, bar in derivatives.items():
        part = max(trial.part(target, 1e-9, 5e-3), 30 * float(doubt) / scale)
        expect_close(np.array(bar @ direction), slope, part, f"{target}: pullback and differences", scale)
    expect_close(derivatives["c"], derivatives["numpy"], trial.part("c", 1e-11, 5e-3), "pullback of C and NumPy")


def member_gradients(trial: Trial) -> None:
    """Check that pullbacks of members agree with those of single runs."""
    x, sizes, options = _many(trial, 3)
    bars, shared = trial.random.normal(size=x.shape), {"bonds": trial.system.edges} if trial.system.graph else {}
    for target, solver in trial.solvers.items():
        back = solver.pullback(x, sizes, 3, bars, **trial.since, **options, **shared)
        for m in (0, 2):
            each = {k: v[m] if np.ndim(v[m]) else float(v[m]) for k, v in options.items()}
            alone = solver.pullback(x[m], float(sizes[m]), 3, bars[m], **trial.since, **each, **shared)
            expect_close(
                back.x0_bar[m], alone.x0_bar, trial.part(target, 1e-11, 5e-3), f"{target}: x0_bar of member {m}"
            )
            for name in options:
                scale = 1 + float(np.abs(alone.parameters_bar[name]).max(initial=0))
                expect_close(
                    back.parameters_bar[name][m],
                    alone.parameters_bar[name],
                    trial.part(target, 1e-11, 5e-3),
                    f"{target}: {name}_bar of member {m}",
                    scale,
                )


def tangent(trial: Trial) -> None:
    """Check that tangent vectors agree with finite differences and between targets."""
    steps, along = 3, trial.random.normal(size=(2, *trial.x0.shape))
    run, carried = trial.solvers["numpy" if trial.single else "c"], {}
    for target, solver in trial.solvers.items():
        more = {**trial.since, **trial.held, **trial.given}
        for _, vectors in solver.tangents(trial.x0, trial.h, steps, along, **more):
            carried[target] = vectors
    slope, doubt = derivative(lambda e: run.integrate(trial.x0 + e * along[0], trial.h, steps, steps, **more).x[-1])
    scale = float(np.abs(carried["numpy"]).max()) + float(np.abs(along).sum())
    for target, vectors in carried.items():
        part = max(trial.part(target, 1e-9, 2e-3), 30 * float(doubt.max()) / scale)
        expect_close(vectors[0], slope, part, f"{target}: tangents and differences", scale)
    expect_close(carried["c"], carried["numpy"], trial.part("c", 1e-11, 2e-3), "tangents of C and NumPy")


def jacobian(trial: Trial) -> None:
    """Check that the pullback of a step is the transpose of its tangent map."""
    along, bar = trial.random.normal(size=(1, *trial.x0.shape)), trial.random.normal(size=trial.x0.shape)
    for target, solver in trial.solvers.items():
        _, carried = solver.step_tangent(trial.x0, trial.h, along, **trial.since, **trial.given)
        back = solver.pullback(trial.x0, trial.h, 1, bar, **trial.since, **trial.given)
        scale = float(np.abs(back.x0_bar).sum())
        values = np.array(np.sum(back.x0_bar * along)), np.array(np.sum(bar * carried))
        expect_close(*values, trial.part(target, 1e-11, 2e-3), f"{target}: pullback and tangent of a step", scale)


def poisson(trial: Trial) -> None:
    """Check that a step is a Poisson map: DΦ π DΦᵀ equals π at the end of the step."""
    n, shape = trial.x0.size, (len(trial.system.fields), trial.system.count)
    unit = np.eye(n).reshape(n, *trial.x0.shape)
    for target, solver in trial.solvers.items():
        x, carried = solver.step_tangent(trial.x0, 2 * trial.h, unit, **trial.since, **trial.given)
        step = carried.reshape(n, n).T
        before, after = (trial.system.matrix(trial.values, y.reshape(shape)) for y in (trial.x0, x))
        scale = float((np.abs(step) @ np.abs(before) @ np.abs(step.T)).max()) + float(np.abs(after).max())
        expect_close(
            step @ before @ step.T, after, trial.part(target, 1e-11, 2e-4), f"{target}: Poisson identity", scale
        )


def casimirs(trial: Trial) -> None:
    """Check that the Casimir |x|² of every site is constant to round-off."""
    for target, solver in trial.solvers.items():
        run = solver.integrate(trial.x0, 2 * trial.h, 20, 20, **trial.since, **trial.given)
        squares = (run.x**2).sum(axis=1)
        expect_close(squares[-1], squares[0], trial.part(target, 1e-13, 1e-4), f"{target}: Casimirs")


def reversal(trial: Trial) -> None:
    """Check that steps of −h lead back to the start of steps of h."""
    for target, solver in trial.solvers.items():
        there = solver.integrate(trial.x0, trial.h, 3, 3, **trial.since, **trial.given).x[-1]
        since = {"t0": START + 3 * trial.h} if trial.system.timed else {}
        back = solver.integrate(there, -trial.h, 3, 3, **since, **trial.held, **trial.given).x[-1]
        scale = float(max(np.abs(there).max(), np.abs(trial.x0).max()))
        expect_close(back, trial.x0, trial.part(target, 1e-12, 1e-4), f"{target}: there and back", scale)


def hopeless(trial: Trial) -> None:
    """Check that a step that is far too large raises a `StepError` and leaves the state, or has a finite result."""
    for target, solver in trial.solvers.items():
        try:
            run = solver.integrate(trial.x0, 1e9 * trial.h, 1, **trial.since, **trial.given)
            expect(bool(np.isfinite(run.x).all()), f"{target}: a step of {1e9 * trial.h:g} leads to what is not finite")
        except StepError as error:
            known = ("NO_CONVERGENCE", "SINGULAR", "NOT_FINITE", "BAD_ARGUMENT")
            expect(error.status in known, f"{target}: status {error.status}")
            end = error.trajectory.x[-1]  # type: ignore[union-attr]
            expect_close(end, trial.x0, 1e-7 if trial.single else 0.0, f"{target}: the state after a failure")


def extras(trial: Trial) -> None:
    """Check that derivatives and options work, both those requested in the spec and those requested in the call of
    `compile`.
    """
    solver = phigen.compile(phigen.spec.loads(trial.system.text), "numpy", **trial.system.asked)
    requested = trial.compilation.program.extras
    if requested.adjoint:
        solver.pullback(trial.x0, trial.h, 1, trial.x0, **trial.since, **trial.given)
    if requested.tangent:
        solver.step_tangent(trial.x0, trial.h, trial.x0[None], **trial.since, **trial.given)
    expect(solver.interface.single == trial.single, "real: float of the spec is lost")


def _wants(name: str) -> Callable[[Trial], bool]:
    return lambda trial: bool(getattr(trial.compilation.program.extras, name))


def _always(trial: Trial) -> bool:
    return True


def _runs_on_devices(trial: Trial) -> bool:
    return device_checks.applies(trial.system.seed) and trial.compilation.program.monitor is None


def _asked_twice(trial: Trial) -> bool:
    """Whether both the spec and the call of `compile` request options."""
    return bool(trial.system.asked) and not {"adjoint", "tangent", "real", "without"}.isdisjoint(trial.system.options)


def _is_fast(trial: Trial) -> bool:
    return trial.system.options.get("profile", "fast") == "fast"


def _compensated(trial: Trial) -> bool:
    return bool(trial.compilation.program.compensated)


_GRADIENT = """bar, v = np.random.default_rng(1).normal(size=(2, *x.shape))
f = lambda y: np.sum(bar * s.integrate(y, h, 5, **given).x[-1])
print(target, "pullback   ", np.sum(v * s.pullback(x, h, 5, bar, **given).x0_bar))
print(target, "differences", (f(x + 1e-5 * v) - f(x - 1e-5 * v)) / 2e-5)"""
_RUN = "print(target, s.integrate(x, h, 7, 3, **given).x[-1])"
_BACK = "print(s.integrate(s.step(x, h, **given), -h, 1, **given).x[-1] - x)"

CHECKS = (
    Check("starts of runs", starts, _always),
    Check("functions are those of the formulas", functions, _always, "print(target, s.vector_field(x, **given))"),
    Check("order", order, lambda t: not t.system.noise, _RUN),
    Check("targets agree", targets, _always, _RUN),
    Check("strides and checkpoints keep the bits", bits, _always, _RUN),
    Check("sessions", sessions, lambda t: _is_fast(t) and not _compensated(t), _RUN),
    Check("members are runs", members, lambda t: t.system.options.get("profile") != "certified"),
    Check("gradient", gradient, _wants("adjoint"), _GRADIENT),
    Check("gradients of members", member_gradients, _wants("adjoint"), _GRADIENT),
    Check("tangent", tangent, _wants("tangent")),
    Check("transpose of the tangent", jacobian, lambda t: _wants("adjoint")(t) and _wants("tangent")(t), _GRADIENT),
    Check("Poisson map", poisson, lambda t: _wants("tangent")(t) and not t.system.forced),
    Check("Casimirs", casimirs, lambda t: t.system.casimir is not None and not t.system.vector, _RUN),
    Check("reversal", reversal, lambda t: not t.system.noise, _BACK),
    Check("steps that are too large", hopeless, _always),
    Check("extras", extras, _asked_twice),
    Check("wrong values are refused", lambda t: malformed(t.system), _always),
    Check("tables of bonds", lambda t: tables(t.system), lambda t: bool(t.system.bonds) and "k" in t.system.parameters),
    Check("C++", lambda t: as_cpp(t.compilation, lattice=True), lambda t: t.system.seed % 20 == 0),
    Check("devices", device_checks.lattice, _runs_on_devices, _RUN),
)  # fmt: skip


def script(system: Lattice, check: Check | None) -> str:
    """Return a script that shows the two results which a check compares."""
    trial = Trial(system, None, {})  # type: ignore[arg-type]
    arguments = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in (trial.given | trial.since).items()}
    h = float(f"{0.1 / speed_of(trial.field, trial.t0, trial.x0.ravel()):.2g}")
    return (
        f"import numpy as np, phigen, phigen.spec\n"
        f'spec = phigen.spec.loads(open("case.yaml").read())  # the lines above\n'
        f"x, h = np.array({trial.x0.round(3).tolist()}), {h!r}\n"
        f"given = {arguments}\n"
        f'for target in ("c", "numpy"):\n'
        f"    s = phigen.compile(spec, target{''.join(f', {k}=True' for k in system.asked)})\n"
        + "\n".join(f"    {line}" for line in (check.lines if check else "").splitlines())
    )


SUITE = Suite(draw_lattice, prepare, CHECKS, script)
