"""A run of a spec with the changes from the command line, and the solver of the spec."""

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
    """Run of a spec, changed by options of the command line.

    ``end`` is set if the run ends at a given time or at a zero of an expression; then the last step may be shorter than
    the others. If ``times`` is not None, states are stored at these times, at the start and at the end; the stride of
    the run is ignored. If the run continues a finished run, ``past`` has the rows of the finished run
    (`phigen.cli.past.StoredRows`). ``first`` is the attitude at the start; None stands for the identity.
    """

    run: Run
    initial: tuple[float, ...]
    parameters: Mapping[str, Any]
    end: End | None = None
    times: tuple[float, ...] | None = None
    past: Any = None  # StoredRows, whose module is not imported here
    first: Floats | None = None

    @property
    def h(self) -> float:
        """The step size in the time t or, with a monitor g, in the rescaled time τ, for which dt = g dτ."""
        return float(self.run.step)

    @property
    def t0(self) -> float:
        """The time at the start of the run."""
        return float(self.run.start)

    @property
    def begin(self) -> float:
        """The time at which the steps start: the start of the run, or the end of the finished run ``past``."""
        return self.past.t if self.past else self.t0

    @property
    def made(self) -> int:
        """Number of steps of the finished run ``past``; a shorter last step counts as a whole one.

        For a system with noise, this is also the number of steps whose random numbers have been used.
        """
        steps = (self.begin - self.t0) / self.h
        return math.ceil(steps - 1e-9 * max(1.0, steps))

    def begun(self, solver: Any) -> Any:
        """Return a session of the solver, at the state from which the steps of this experiment start. Raises
        `StepError`.
        """
        from phigen.cli.past import begun

        return begun(solver, self)

    def function(self, expression: Expression, solver: Any) -> Function:
        """Return an expression of the spec as a function of states, and of times if H depends on the time."""
        from phigen.runtime.sections import function_of

        return function_of(expression, solver.interface.coordinates, self.parameters, solver.interface.time)

    @property
    def spans(self) -> tuple[float, ...]:
        """The times of stored states, relative to the time at which the steps start."""
        return tuple(time - self.begin for time in self.times or ())

    @property
    def until(self) -> float:
        """The time t at which the run ends.

        With a monitor, steps are not equal in t, so ``end`` must be set.
        """
        return self.begin + (self.end.span if self.end else self.h * self.run.steps)

    @property
    def rows(self) -> int:
        """Number of states to be stored, including the first and the last state and the rows of ``past``."""
        first_rows = len(self.past.rows) if self.past else 1
        if self.times is not None:
            last = self.times[-1] if self.times else self.begin
            return first_rows + len(self.times) + (abs(self.until - last) > 1e-9 * abs(self.until - self.begin))
        return first_rows + self.run.steps // self.run.stride + (self.has_part or self.run.steps % self.run.stride > 0)

    @property
    def has_part(self) -> bool:
        """Whether the last step of the run is shorter than the others."""
        return bool(self.end and self.end.part)


def expect_system(spec: Spec) -> None:
    """Raise `SpecError` for lattices, with a hint that `phigen show --expand` makes a spec without lattice."""
    if spec.lattice:
        from phigen.geometry.system import system_of_lattice

        raise system_of_lattice(spec)


def run_of(spec: Spec, name: str | None) -> Run:
    """Return the run called ``name``, by default the first run. Raises `SpecError` if the spec has no runs."""
    if not spec.runs:
        hint = "under `runs`, add a run with `initial`, `step` and `steps`; phigen new writes a spec with a run"
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
    """Return the run called ``name``, by default the first run, with the options of the command line.

    ``settings`` are texts NAME=VALUE of initial values and parameters. Raises `SpecError` for lattices.
    """
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
    """Return the run called ``name``, by default the first run, with the step and the end from the command line."""
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
    """Raise `LimitError` if the states of all members of a run with noise do not fit into memory."""
    from phigen.memory import expect_room

    place = spec.diagnostic(("runs", run.name, "members"), "").location
    if run.members > 1:
        expect_room(f"{run.members} members", 3 * 8 * spec.dimension * run.members, place, "fewer members")


def with_steps(spec: Spec, run: Run, step: float | None, steps: int | None) -> Run:
    """Return the run with step and number of steps from the command line."""
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
    """Raise `LimitError` for more steps than a spec may have."""
    if steps > limits.STEPS:
        message = f"{option}: {float(steps):.9g} steps, more than the limit of {limits.STEPS}"
        raise LimitError([Diagnostic(message, hint="take fewer or larger steps")])


def with_seed(spec: Spec, run: Run, seed: int | None) -> Run:
    """Return the run with the seed from the command line."""
    if seed is None:
        return run
    if not spec.noise:
        raise click.BadParameter(f"{spec.name} has no noise, hence no random numbers", param_hint="--seed")
    return replace(run, seed=seed)


def with_stop(spec: Spec, run: Run, text: str | None) -> Run:
    """Return the run, changed so that it stops at a zero of the expression in ``--stop``."""
    from phigen.spec.stops import stop_of

    if text is None:
        return run
    try:
        return replace(run, stop=stop_of(spec, run.name, text, "--stop"))
    except SpecError as error:
        message = "\n".join(str(diagnostic).removeprefix("--stop:") for diagnostic in error.diagnostics)
        raise click.BadParameter(message, param_hint="--stop") from None


def expect_positive(spec: Spec, parameters: Mapping[str, Any]) -> None:
    """Raise `click.BadParameter` for numbers outside the bounds of their parameters.

    Parameters that are arrays are checked elsewhere.
    """
    for p in spec.parameters:
        value = parameters.get(p.name)
        if isinstance(value, float | Fraction) and p.refuses(value):
            raise click.BadParameter(f"parameter {p.name} must be {p.bound}", param_hint="--set")


def setting_of(setting: str) -> tuple[str, float]:
    """Return the name and the number in a text NAME=VALUE."""
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
    """Return the loaded solver; a fallback from C to NumPy is reported."""
    from phigen.api import chosen_target, solver_of

    target_name = chosen_target(target, console.note)
    start = time.perf_counter()
    solver = solver_of(compilation, target_name)
    console.detail(f"{compilation.spec.name}: {target_name} ready after {time.perf_counter() - start:.2f} s")
    return solver
