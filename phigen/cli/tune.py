"""``phigen tune``: measure the settings of a spec, and propose the cheapest that is accurate enough."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen.cli.console import Console, out_json, pass_console, verbosity
from phigen.cli.experiment import prepared
from phigen.cli.sources import FIGURES, file_ending, load_one, one_spec, run_option
from phigen.cli.tune_summary import described, print_monitors, print_tuning, unreached
from phigen.errors import CheckError, SpecError

if TYPE_CHECKING:
    from phigen.cli.experiment import Experiment
    from phigen.geometry.system import System
    from phigen.tuning.problem import Problem


@click.command("tune")
@one_spec
@run_option
@click.option(
    "--accuracy", type=click.FloatRange(1e-15, 0.5), default=1e-8, show_default=True, metavar="E",
    help="The largest error that is allowed, relative.",
)  # fmt: skip
@click.option(
    "--measure", type=click.Choice(["energy", "orbit"]), default="energy", show_default=True,
    help="Error of the energy on the way, or distance from a reference solution.",
)  # fmt: skip
@click.option("--horizon", type=float, metavar="T", help="How long a run is.  [default: as in the spec]")
@click.option("--set", "settings", metavar="NAME=VALUE", multiple=True, help="A parameter, or an initial coordinate.")
@click.option("--budget", type=float, default=60.0, show_default=True, metavar="SECONDS", help="How long to search.")
@click.option("--plot", metavar="FILE", callback=file_ending(*FIGURES),
              help="Draw error against time: FILE.png, FILE.svg or FILE.pdf.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="For machines: everything that was measured.")
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    name: str | None,
    accuracy: float,
    measure: str,
    horizon: float | None,
    settings: tuple[str, ...],
    budget: float,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Find the cheapest bi-realisation, order, gauge, composition and step for an accuracy.

    Builds candidates, compiles them as C (without a compiler: as NumPy), measures error and time of each over a piece
    of a run of the spec, confirms the best over the whole horizon if that is affordable, and prints the lines to paste
    into the spec. Classical methods stand beside them. Exit code 5 if nothing reaches the accuracy.
    """
    from phigen.api import chosen_target
    from phigen.compiler import compile_proved
    from phigen.tuning.study import tune

    _expect_positive(horizon, "--horizon")
    _expect_positive(budget, "--budget")
    if plot:
        from phigen.drawing.palette import require_matplotlib

        require_matplotlib()
    spec = load_one(spec_file)
    if spec.noise:
        message = "phigen tune does not compare settings where there is noise"
        raise SpecError([spec.diagnostic(("noise",), message, "phigen verify and phigen run measure what is chosen")])
    if spec.time:
        message = "phigen tune does not compare settings where H depends on the time"
        raise SpecError([spec.diagnostic(("time",), message, "phigen verify and phigen run measure what is chosen")])
    experiment = prepared(spec, name, settings=settings)
    compilation = compile_proved(spec)
    chosen_target("auto", console.note)
    problem = problem_of(compilation.system, experiment, horizon)
    found = tune(compilation, problem, measure, accuracy, budget, console.note)
    if as_json:
        out_json(described(found, spec, experiment.run))
    elif found.winner:
        print_tuning(found, spec, experiment.run)
    elif found.monitors:
        print_monitors(found.monitors, found, experiment.run)
    if plot:
        from phigen.drawing import figures

        figures.save(figures.tuning_figure(found, f"{spec.name}, run {experiment.run.name}"), str(plot))
        console.note(f"wrote {plot}")
    if not found.winner:
        raise CheckError(unreached(found))


def _expect_positive(value: float | None, option: str) -> None:
    if value is not None and not (value > 0 and math.isfinite(value)):
        raise click.BadParameter(f"{value!r} is not a positive number", param_hint=option)


def problem_of(system: System, experiment: Experiment, horizon: float | None) -> Problem:
    """The initial value problem of an experiment, over its own duration unless another is given."""
    import numpy as np

    from phigen.tuning.problem import Problem

    run = experiment.run
    step = float(run.step)
    span = abs(step) * run.steps if horizon is None else horizon
    start = np.array(experiment.initial)
    return Problem(system, start, experiment.parameters, min(abs(step), span), span, math.copysign(1.0, step))
