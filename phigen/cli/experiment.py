"""The run of a spec with the settings of the command line, and its solver."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.console import Console
from phigen.errors import Diagnostic, LimitError, SpecError
from phigen.spec import limits

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.runtime.crossings import Function
    from phigen.runtime.ending import End
    from phigen.runtime.interface import Floats
    from phigen.runtime.solver import Solver
    from phigen.spec.model import Run, Spec
    from phigen.symbolic.expression import Expression


@dataclass(frozen=True)
class Experiment:
    """A run with the settings of the command line.

    ``end`` is an end between two steps, ``times`` are those of stored states, in place of a stride, in addition to
    the first and the last. ``past`` is a finished run (`phigen.cli.past.StoredRows`) that this run continues,
    ``first`` an attitude at its start.
    """

    run: Run
    initial: tuple[float, ...]
    parameters: Mapping[str, Any]
    end: End | None = None
    times: tuple[float, ...] | None = None
    past: Any = None  # `StoredRows`
    first: Floats | None = None

    @property
    def h(self) -> float:
        """The step size, in t or τ."""
        return float(self.run.step)

    @property
    def t0(self) -> float:
        """The time at the start."""
        return float(self.run.start)

    @property
    def begin(self) -> float:
        """The time at which its steps start: at the start, or where the past run ends."""
        return self.past.t if self.past else self.t0

    @property
    def made(self) -> int:
        """Number of steps of noise that the past run has used; a part of a step counts as one."""
        steps = (self.begin - self.t0) / self.h
        return math.ceil(steps - 1e-9 * max(1.0, steps))

    def begun(self, solver: Any) -> Any:
        """Return a session of the solver at the start of the steps. Raises `StepError`."""
        from phigen.cli.past import begun

        return begun(solver, self)

    def function(self, expression: Expression, solver: Any) -> Function:
        """An expression of the run as a function of states, and of their times where there is a time."""
        from phigen.runtime.sections import function_of

        return function_of(expression, solver.interface.coordinates, self.parameters, solver.interface.time)

    @property
    def spans(self) -> tuple[float, ...]:
        """The times of states that are stored, from where steps begin."""
        return tuple(time - self.begin for time in self.times or ())

    @property
    def until(self) -> float:
        """The time where it ends, of steps that are equal in time or with an end in time."""
        return self.begin + (self.end.span if self.end else self.h * self.run.steps)

    @property
    def rows(self) -> int:
        """Number of states that are stored: those of every stride-th step or at given times, and the last."""
        first_rows = len(self.past.rows) if self.past else 1
        if self.times is not None:
            last = self.times[-1] if self.times else self.begin
            return first_rows + len(self.times) + (abs(self.until - last) > 1e-9 * abs(self.until - self.begin))
        return first_rows + self.run.steps // self.run.stride + (self.has_part or self.run.steps % self.run.stride > 0)

    @property
    def has_part(self) -> bool:
        """Whether a part of a step follows the whole steps."""
        return bool(self.end and self.end.part)


def expect_system(spec: Spec) -> None:
    """Refuse lattices, with the way to one of a few sites."""
    if spec.lattice:
        from phigen.geometry.system import system_of_lattice

        raise system_of_lattice(spec)


def run_of(spec: Spec, name: str | None) -> Run:
    """The run of that name, the first by default."""
    if not spec.runs:
        hint = "add one under runs:, with initial, step and steps; phigen new shows how"
        raise SpecError([Diagnostic(f"{spec.file}: the spec has no runs", hint=hint)])
    run = spec.runs.get(name) if name else next(iter(spec.runs.values()))
    if run is None:
        raise click.BadParameter(f"there is no run {name!r}; the spec has {', '.join(spec.runs)}", param_hint="--run")
    return run


def prepared(
    spec: Spec,
    name: str | None,
    step: float | None = None,
    steps: int | None = None,
    settings: Iterable[str] = (),
    until: float | None = None,
) -> Experiment:
    """The run of that name, the first by default, with changes of the command line; not of a lattice."""
    expect_system(spec)
    run = changed(spec, name, step, steps, until)
    initial = dict(zip(spec.coordinates, map(float, run.initial), strict=True))
    parameters = spec.parameters_of(run)
    for setting in settings:
        _set(setting, initial, parameters)
    expect_positive(spec, parameters)
    _expect_room_for_members(spec, run)
    return Experiment(run, tuple(initial.values()), parameters)


def changed(
    spec: Spec,
    name: str | None,
    step: float | None = None,
    steps: int | None = None,
    until: float | None = None,
) -> Run:
    """The run of that name, the first by default, with the step and the end that the command line says."""
    run = run_of(spec, name)
    if until is not None:
        run = replace(run, duration=None)
    run = with_steps(spec, run, step, steps)
    if until is None:
        return run
    if not math.isfinite(until) or (until - run.start) / run.step <= 0:
        raise click.BadParameter(f"{until!r} is never reached by steps of {float(run.step)!r}", param_hint="--until")
    _expect_few((until - run.start) / run.step, "--until")
    return replace(run, until=Fraction(until))


def _expect_room_for_members(spec: Spec, run: Run) -> None:
    """Raise `LimitError` if the states of the members of a run with noise, and copies of them, do not fit into
    memory."""
    from phigen.memory import expect_room

    place = spec.diagnostic(("runs", run.name, "members"), "").location
    if run.members > 1:
        expect_room(f"{run.members} members", 3 * 8 * spec.dimension * run.members, place, "fewer members")


def with_steps(spec: Spec, run: Run, step: float | None, steps: int | None) -> Run:
    """The run with the step and the number of steps that the command line says."""
    from phigen.spec.runs import with_step

    if steps is not None:
        _expect_few(steps, "--steps")
        run = replace(run, steps=steps, stride=min(run.stride, steps), duration=None, until=None)
    if step is None:
        return run
    if step == 0 or not math.isfinite(step):
        raise click.BadParameter("the step must be a finite number, and not 0", param_hint="--step")
    try:
        return with_step(run, Fraction(step), parts=spec.monitor is None)
    except ValueError as error:
        raise click.BadParameter(f"{error}; --steps N sets the number of steps", param_hint="--step") from None


def _expect_few(steps: float | Fraction, option: str) -> None:
    """Refuse more steps than a spec may ask for."""
    if steps > limits.STEPS:
        message = f"{option}: {float(steps):.9g} steps, more than the limit of {limits.STEPS}"
        raise LimitError([Diagnostic(message, hint="fewer or larger steps")])


def with_seed(spec: Spec, run: Run, seed: int | None) -> Run:
    """The run with the seed that the command line says."""
    if seed is None:
        return run
    if not spec.noise:
        raise click.BadParameter(f"{spec.name} has no noise, hence no random numbers", param_hint="--seed")
    return replace(run, seed=seed)


def with_stop(spec: Spec, run: Run, text: str | None) -> Run:
    """The run with the expression of ``--stop``, by which it ends."""
    from phigen.spec.stops import stop_of

    if text is None:
        return run
    try:
        return replace(run, stop=stop_of(spec, run.name, text, "--stop"))
    except SpecError as error:
        message = "\n".join(str(diagnostic).removeprefix("--stop:") for diagnostic in error.diagnostics)
        raise click.BadParameter(message, param_hint="--stop") from None


def expect_positive(spec: Spec, parameters: Mapping[str, Any]) -> None:
    """Refuse numbers beyond the bounds of parameters; arrays are checked elsewhere."""
    for p in spec.parameters:
        value = parameters.get(p.name)
        if isinstance(value, float | Fraction) and p.refuses(value):
            raise click.BadParameter(f"parameter {p.name} must be {p.bound}", param_hint="--set")


def setting_of(setting: str) -> tuple[str, float]:
    """The name and the number of NAME=VALUE."""
    name, equals, text = (part.strip() for part in setting.partition("="))
    try:
        value = float(Fraction(text)) if "/" in text else float(text)
    except (ValueError, ZeroDivisionError, OverflowError):
        value = math.nan
    if not equals or not math.isfinite(value):
        raise click.BadParameter(f"{setting!r} is not NAME=VALUE with a number", param_hint="--set")
    return name, value


def _set(setting: str, initial: dict[str, float], parameters: dict[str, float]) -> None:
    name, value = setting_of(setting)
    home = parameters if name in parameters else initial
    if name not in home:
        known_names = ", ".join([*parameters, *initial])
        raise click.BadParameter(
            f"{name!r} is neither a parameter nor a coordinate ({known_names})", param_hint="--set"
        )
    home[name] = value


def loaded(compilation: Compilation, target: str, console: Console) -> Solver:
    """The solver; where auto falls back to NumPy, stderr says so."""
    from phigen.api import chosen_target, solver_of

    target_name = chosen_target(target, console.note)
    start = time.perf_counter()
    solver = solver_of(compilation, target_name)
    console.detail(f"{compilation.spec.name}: {target_name} ready after {time.perf_counter() - start:.2f} s")
    return solver
