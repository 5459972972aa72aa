"""``phigen tune``: measure the settings of a spec, and propose the cheapest with a requested accuracy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen.cli.arguments import FIGURES, file_ending, one_spec, profile_option, run_option, settings_option
from phigen.cli.console import Console, out_json, pass_console, verbosity
from phigen.cli.existing import expect_same_origin, force_option, wrote
from phigen.cli.experiment import loaded, prepared, run_of
from phigen.cli.sources import load_one
from phigen.cli.tune_summary import described, print_monitors, print_tuning, unreached
from phigen.errors import CheckError, SpecError

if TYPE_CHECKING:
    from phigen.cli.experiment import Experiment
    from phigen.compilation import Compilation
    from phigen.spec.model import Run
    from phigen.tuning.problem import Problem

#: Default accuracies, in double and in single precision. In single precision, rounding errors reach 1e-4 after some
#: million steps.
ACCURACY, SINGLE_ACCURACY = 1e-8, 1e-4


@click.command("tune")
@one_spec
@run_option
@profile_option
@click.option(
    "--accuracy", type=click.FloatRange(1e-15, 0.5), metavar="E",
    help="Largest relative error that is allowed.  [default: 1e-8, or 1e-4 with real: float]",
)  # fmt: skip
@click.option(
    "--measure", type=click.Choice(["energy", "orbit"]), default="energy", show_default=True,
    help="Error of the energy, or distance from a reference solution.",
)  # fmt: skip
@click.option(
    "--horizon",
    type=float,
    metavar="T",
    help="Length of the run in time, or in τ with a monitor.  [default: as in the spec]",
)
@settings_option
@click.option(
    "--budget", type=float, default=60.0, show_default=True, metavar="SECONDS", help="Time limit of the search."
)
@click.option("--plot", metavar="FILE", callback=file_ending(*FIGURES),
              help="Draw error against time: FILE.png, FILE.svg or FILE.pdf.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print all measurements as JSON.")
@force_option
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    name: str | None,
    profile: str | None,
    accuracy: float | None,
    measure: str,
    horizon: float | None,
    settings: tuple[str, ...],
    budget: float,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Find the cheapest bi-realisation, order, gauge, composition and step for an accuracy, for lattices too.

    phigen builds candidates as C, or as NumPy if there is no compiler, and measures error and time of each over a part
    of a run. The best candidates are measured again over the whole run if the time limit allows. phigen prints lines to
    paste into the spec. Classical methods are measured for comparison. Exit code 5 if nothing reaches the accuracy.
    """
    from phigen.api import chosen_target
    from phigen.compiler import compile_proved
    from phigen.runtime.origin import origin_of
    from phigen.tuning.study import tune
    from phigen.tuning.tuner import TimeBudget

    _expect_positive(horizon, "--horizon")
    _expect_positive(budget, "--budget")
    if plot:
        from phigen.drawing.palette import require_matplotlib

        require_matplotlib()
    clock = TimeBudget(budget)
    spec = load_one(spec_file)
    if spec.noise:
        message = "phigen tune does not compare settings for systems with noise"
        raise SpecError(
            [
                spec.diagnostic(
                    ("noise",),
                    message,
                    "choose the settings yourself; phigen verify and phigen run measure their errors",
                )
            ]
        )
    if spec.time:
        message = "phigen tune does not compare settings for systems whose H depends on the time"
        raise SpecError(
            [
                spec.diagnostic(
                    ("time",),
                    message,
                    "choose the settings yourself; phigen verify and phigen run measure their errors",
                )
            ]
        )
    if spec.forces and measure == "energy":
        place = ("damping",) if ("damping",) in spec.locations else ("forces",)
        message = "forces change the energy, so its change is not an error of the method"
        raise SpecError(
            [spec.diagnostic(place, message, "use --measure orbit, which compares orbits with a reference solution")]
        )
    origin = origin_of(spec, run_of(spec, name), "tune")
    expect_same_origin({"--plot": plot}, origin)
    compilation = compile_proved(spec.for_running(profile=profile))
    chosen_target("auto", console.note)
    run, problem = initial_value_problem(console, compilation, name, settings, horizon, measure)
    accuracy = accuracy or (SINGLE_ACCURACY if compilation.program.single else ACCURACY)
    tuning = tune(compilation, problem, measure, accuracy, clock, console.note)
    if as_json:
        out_json(described(tuning, spec, run))
    elif tuning.winner:
        print_tuning(tuning, spec, run)
    elif tuning.monitors:
        print_monitors(tuning.monitors, tuning, run)
    if plot:
        from phigen.drawing import figures

        figures.save(figures.tuning_figure(tuning, f"{spec.name}, run {run.name}"), plot, str(origin))
        console.note(wrote(plot))
    if not tuning.winner:
        raise CheckError(unreached(tuning))


def _expect_positive(value: float | None, option: str) -> None:
    if value is not None and not (value > 0 and math.isfinite(value)):
        raise click.BadParameter(f"{value!r} is not a positive number", param_hint=option)


def initial_value_problem(
    console: Console,
    compilation: Compilation,
    name: str | None,
    settings: tuple[str, ...],
    horizon: float | None,
    measure: str,
) -> tuple[Run, Problem]:
    """Return the run called ``name``, by default the first, and the initial value problem for measuring settings.

    For a run of a large lattice, the problem has fewer sites than the run.
    """
    spec = compilation.spec
    if spec.lattice:
        run = run_of(spec, name)
        return run, _of_lattice(console, compilation, run, settings, horizon, measure)
    experiment = prepared(spec, name, settings=settings)
    return experiment.run, problem_of(compilation, experiment, horizon, console)


def problem_of(compilation: Compilation, experiment: Experiment, horizon: float | None, console: Console) -> Problem:
    """Return the initial value problem of an experiment.

    Its length is ``horizon``, by default the length of the run. The length is in the time t or, with a monitor g, in
    the rescaled time τ, for which dt = g dτ.
    """
    import numpy as np

    from phigen.cli.endings import ended, length
    from phigen.tuning.problem import SystemProblem, rounding_of

    run, start = experiment.run, np.array(experiment.initial)
    if horizon is None and (run.until is not None or run.stop is not None):
        solver = loaded(compilation, "auto", console)
        horizon = length(ended(experiment, solver, console), solver)
    clock = "t" if compilation.spec.monitor is None else "τ"
    return SystemProblem(
        start, experiment.parameters, *_time_scales(run, horizon),
        clock=clock, rounding=rounding_of(compilation), system=compilation.system,
    )  # fmt: skip


def _of_lattice(
    console: Console, compilation: Compilation, run: Run, settings: tuple[str, ...], horizon: float | None, measure: str
) -> Problem:
    """Return the initial value problem for a run of a lattice. A large lattice is replaced by one with fewer sites."""
    from phigen.api import chosen_target, lattice_solver_of
    from phigen.cli.endings import ended, length
    from phigen.cli.lattice_experiment import LatticeExperiment
    from phigen.cli.lattice_run import parameters_of
    from phigen.lattice.states import start_of
    from phigen.tuning.lattice_problem import MOST_COMPARED, lattice_problem

    changed_names = {s.partition("=")[0].strip() for s in settings}
    start = start_of(compilation.spec, run)
    values = parameters_of(compilation.spec, start, settings)
    if horizon is None and (run.until is not None or run.stop is not None):
        solver = lattice_solver_of(compilation, chosen_target("auto", console.note))
        experiment = LatticeExperiment(run, (), start.arguments | values, start=start)
        horizon = length(ended(experiment, solver, console), solver)
    changed_values = {name: value for name, value in values.items() if name in changed_names}
    problem = lattice_problem(compilation, run, changed_values, *_time_scales(run, horizon))
    if problem.sizes != problem.whole:
        reduced_text, full_text = ("×".join(map(str, sizes)) for sizes in (problem.sizes, problem.whole))
        console.note(
            f"measured on {reduced_text} instead of {full_text} sites; times grow in proportion to the number of sites"
        )
    if measure == "orbit" and len(problem.start) > MOST_COMPARED:
        message = f"a state of this run has {len(problem.start)} numbers; orbits are compared up to {MOST_COMPARED}"
        raise SpecError(
            [compilation.spec.diagnostic(("runs", run.name), message, "use --measure energy, or smaller sizes")]
        )
    return problem


def _time_scales(run: Run, horizon: float | None) -> tuple[float, float, float]:
    """Return three numbers: an initial step size, the length of time to integrate, and the sign of the step.

    The length is ``horizon``, by default that of the run.
    """
    step = float(run.step)
    span = abs(step) * run.steps if horizon is None else horizon
    return min(abs(step), span), span, math.copysign(1.0, step)
