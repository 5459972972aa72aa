"""``phigen run``: integrate an experiment of a spec and sum up what was conserved."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.console import Console, heading, out, pass_console, table, verbosity
from phigen.cli.sources import ORDER, load_one, one_spec, scheme_option
from phigen.errors import Diagnostic, SpecError, StepError

if TYPE_CHECKING:
    from phigen.analysis.summary import Drift, Summary
    from phigen.compiler import Compilation
    from phigen.runtime.interface import Floats
    from phigen.runtime.solver import Solver
    from phigen.runtime.trajectory import Trajectory
    from phigen.spec.model import Run, Spec

_OUTPUTS = (".csv", ".npz")


@dataclass(frozen=True)
class Experiment:
    """A run with the values of the command line put in."""

    run: Run
    initial: tuple[float, ...]
    parameters: dict[str, float]


@click.command("run")
@one_spec
@click.option("--run", "name", metavar="NAME", help="Which run of the spec.  [default: the first]")
@click.option("-t", "--target", type=click.Choice(["auto", "c", "numpy"]), default="auto", show_default=True)
@click.option("--order", type=ORDER, help="Order of the method, instead of the spec's.")
@scheme_option
@click.option("--step", type=float, help="Step size, instead of the run's.")
@click.option("--steps", type=click.IntRange(min=1), help="Number of steps, instead of the run's.")
@click.option("--set", "settings", metavar="NAME=VALUE", multiple=True, help="A parameter, or an initial coordinate.")
@click.option("-o", "--output", metavar="FILE", help="Store the trajectory: FILE.csv or FILE.npz.")
@click.option("--json", "as_json", is_flag=True, help="The summary for machines.")
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    name: str | None,
    target: str,
    order: int | None,
    scheme: str | None,
    step: float | None,
    steps: int | None,
    settings: tuple[str, ...],
    output: str | None,
    as_json: bool,
) -> None:
    """Integrate a run of a spec, and sum up the errors of energy, Casimirs, invariants and solution.

    The classical methods that the run names under compare: are run beside it, with the same step size.
    """
    from phigen.api import compilation_of

    if output and Path(output).suffix.lower() not in _OUTPUTS:
        raise click.BadParameter(f"{output!r} must end in {' or '.join(_OUTPUTS)}", param_hint="--output")
    spec = load_one(spec_file)
    experiment = prepared(spec, name, step, steps, settings)
    compilation = compilation_of(spec, order, scheme=scheme)
    solver = loaded(compilation, target, console)
    trajectory, failure = integrated(solver, experiment, console)
    if output:
        trajectory.save(output)
        console.note(f"wrote {output}: {len(trajectory)} rows")
    summaries = summaries_of(compilation, experiment, solver, trajectory, console, compare=failure is None)
    if as_json:
        described = described_run(compilation, experiment, solver, trajectory, summaries)
        out(json.dumps(finite(described), indent=2, ensure_ascii=False))
    else:
        print_summary(compilation, experiment, solver, trajectory, summaries)
    if failure:
        raise failure


def prepared(
    spec: Spec, name: str | None, step: float | None = None, steps: int | None = None, settings: Iterable[str] = ()
) -> Experiment:
    """The run of that name, the first by default, with changes of the command line."""
    if not spec.runs:
        hint = "add one under runs:, with initial, step and steps; phigen new shows how"
        raise SpecError([Diagnostic(f"{spec.file}: the spec has no runs", hint=hint)])
    run = spec.runs.get(name) if name else next(iter(spec.runs.values()))
    if run is None:
        raise click.BadParameter(f"there is no run {name!r}; there are {', '.join(spec.runs)}", param_hint="--run")
    if step is not None:
        if step == 0 or not math.isfinite(step):
            raise click.BadParameter("the step must be a finite number, and not 0", param_hint="--step")
        run = replace(run, step=Fraction(step))
    if steps is not None:
        run = replace(run, steps=steps, stride=min(run.stride, steps))
    initial = dict(zip(spec.coordinates, map(float, run.initial), strict=True))
    parameters = {p.name: float(run.parameters.get(p.name, p.value)) for p in spec.parameters}
    for setting in settings:
        _set(setting, initial, parameters)
    for p in spec.parameters:
        if p.positive and parameters[p.name] <= 0:
            raise click.BadParameter(f"parameter {p.name} must be positive", param_hint="--set")
    return Experiment(run, tuple(initial.values()), parameters)


def _set(setting: str, initial: dict[str, float], parameters: dict[str, float]) -> None:
    name, equals, text = (part.strip() for part in setting.partition("="))
    try:
        value = float(Fraction(text)) if "/" in text else float(text)
    except (ValueError, ZeroDivisionError, OverflowError):
        value = math.nan
    if not equals or not math.isfinite(value):
        raise click.BadParameter(f"{setting!r} is not NAME=VALUE with a number", param_hint="--set")
    home = parameters if name in parameters else initial
    if name not in home:
        known = ", ".join([*parameters, *initial])
        raise click.BadParameter(f"{name!r} is neither a parameter nor a coordinate ({known})", param_hint="--set")
    home[name] = value


def loaded(compilation: Compilation, target: str, console: Console) -> Solver:
    """The solver; where auto falls back to NumPy, stderr says so."""
    from phigen.api import chosen_target, solver_of

    chosen = chosen_target(target)
    if target == "auto" and chosen == "numpy":
        console.note(
            "no C compiler found: using the NumPy target, which is slower; install gcc or clang, or name one in CC"
        )
    start = time.perf_counter()
    solver = solver_of(compilation, chosen)
    console.detail(f"{compilation.spec.name}: {chosen} ready after {time.perf_counter() - start:.2f} s")
    return solver


def integrated(solver: Solver, experiment: Experiment, console: Console) -> tuple[Trajectory, StepError | None]:
    """The trajectory of an experiment; if a step fails, what was computed before it, and the error."""
    run, start = experiment.run, time.perf_counter()
    failure = None
    with console.progress(f"{solver.interface.name}, order {solver.order}", run.steps) as progress:
        try:
            trajectory = solver.integrate(
                experiment.initial, float(run.step), run.steps, run.stride, progress=progress,
                parameters=experiment.parameters,
            )  # fmt: skip
        except StepError as error:
            trajectory, failure = error.trajectory, error
    console.detail(f"integrated in {time.perf_counter() - start:.3f} s")
    return trajectory, failure


def summaries_of(
    compilation: Compilation,
    experiment: Experiment,
    solver: Solver,
    trajectory: Trajectory,
    console: Console,
    compare: bool = True,
) -> list[Summary]:
    """The summary of the solver's trajectory, then those of the classical methods of the run."""
    from phigen.analysis.summary import summarise

    run, system, own = experiment.run, compilation.system, f"phigen, order {compilation.order.order}"
    result = [summarise(own, system, run, experiment.parameters, trajectory.t, trajectory.x)]
    for method in run.compare if compare else ():
        states = classical_states(solver, experiment, method, console)
        result.append(summarise(method, system, run, experiment.parameters, trajectory.t, states))
    return result


def classical_states(solver: Solver, experiment: Experiment, method: str, console: Console) -> Floats:
    """The rows (rows, DIM) of a classical method on the same experiment; NaN after it failed."""
    import numpy as np

    from phigen.analysis import classical

    run, backend, start = experiment.run, solver.backend, time.perf_counter()

    def f(x: Floats) -> Floats:
        slope: Floats = backend.vector_field(x[None, :], experiment.parameters)[0]
        return slope

    with console.progress(method, run.steps) as progress:
        x0 = np.array(experiment.initial)
        states = classical.integrate(method, f, x0, float(run.step), run.steps, run.stride, progress)
    console.detail(f"{method}: {time.perf_counter() - start:.3f} s")
    return states


def print_summary(
    compilation: Compilation,
    experiment: Experiment,
    solver: Solver,
    trajectory: Trajectory,
    summaries: Sequence[Summary],
) -> None:
    """The table of a run: one column for each method."""
    run, name = experiment.run, compilation.spec.name
    end = trajectory.t[-1]
    out(heading(f"{name}, run {run.name}") + (f": {run.description}" if run.description else ""))
    chosen = f"{compilation.label}, order {solver.order}, target {solver.target}"
    out(f"  {trajectory.steps} steps of {float(run.step):.9g}, t = 0 … {end:.9g}; {chosen}")
    final = ", ".join(f"{c} = {v:.9g}" for c, v in zip(solver.coordinates, trajectory.x[-1].tolist(), strict=True))
    out(f"  final state: {final}\n")
    for line in table(_rows(summaries), right=range(1, len(summaries) + 1)):
        out(f"  {line}")


def _rows(summaries: Sequence[Summary]) -> list[list[str]]:
    first = summaries[0]
    rows = [["largest error", *(s.method for s in summaries), ""]]
    rows.append(["energy", *(_shown(s.energy) for s in summaries), first.energy.kind])
    if any(math.isfinite(s.energy.growth) for s in summaries):
        growth = [f"{s.energy.growth:.3g}" if math.isfinite(s.energy.growth) else "–" for s in summaries]
        rows.append(["  last tenth/first", *growth, "1 is no drift"])
    for kind, noun in (("casimirs", "Casimir"), ("invariants", "invariant")):
        for name, drift in getattr(first, kind).items():
            rows.append([f"{noun} {name}", *(_shown(getattr(s, kind)[name]) for s in summaries), drift.kind])
    if first.exact:
        rows.append(["against closed form", *(_shown(s.exact) for s in summaries if s.exact), "relative"])
    if any(s.good < s.rows for s in summaries):
        rows.append(["finite rows", *(f"{s.good} of {s.rows}" for s in summaries), ""])
    return rows


def _shown(drift: Drift) -> str:
    return f"{drift.error:.1e}" if drift.error else "0"


def described_run(
    compilation: Compilation,
    experiment: Experiment,
    solver: Solver,
    trajectory: Trajectory,
    summaries: Sequence[Summary],
) -> dict[str, Any]:
    """The summary as plain data."""
    from dataclasses import asdict

    return {
        "name": compilation.spec.name,
        "run": experiment.run.name,
        "target": solver.target,
        "order": solver.order,
        "birealisation": compilation.realisation.kind if compilation.realisation else None,
        "scheme": "splitting" if compilation.splitting else "series",
        "exact": compilation.exact,
        "step": float(experiment.run.step),
        "steps": trajectory.steps,
        "time": float(trajectory.t[-1]),
        "parameters": experiment.parameters,
        "initial": dict(zip(solver.coordinates, experiment.initial, strict=True)),
        "final": dict(zip(solver.coordinates, trajectory.x[-1].tolist(), strict=True)),
        "methods": [asdict(s) for s in summaries],
    }


def finite(value: Any) -> Any:
    """JSON has no NaN and no infinity: null stands for them."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(v) for key, v in value.items()}
    return [finite(v) for v in value] if isinstance(value, list | tuple) else value
