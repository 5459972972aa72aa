"""``phigen run``: integrate a run of a spec, and print the errors of conserved quantities."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.arguments import (
    FIGURES,
    FILMS,
    SEED,
    file_ending,
    one_spec,
    order_option,
    profile_option,
    run_option,
    scheme_option,
    settings_option,
    target_option,
)
from phigen.cli.console import Console, out_json, pass_console, verbosity
from phigen.cli.existing import expect_same_origin, force_option, wrote
from phigen.cli.experiment import changed, loaded, prepared, with_seed, with_stop
from phigen.cli.interruption import InterruptedRunError
from phigen.cli.lattice_run import run_lattice
from phigen.cli.resizing import resized, sizes_option
from phigen.cli.run_summary import described_run, finite, print_summary
from phigen.cli.sources import load_one

if TYPE_CHECKING:
    from phigen.cli.recording import Recorder
    from phigen.runtime.trajectory import Trajectory
    from phigen.study.summary import Summary

_TABLES = (".csv", ".npz")


@click.command("run")
@one_spec
@run_option
@target_option
@order_option
@scheme_option
@profile_option
@click.option(
    "--step",
    metavar="H",
    type=float,
    help="Step size; overrides that of the run. The duration of the run does not change.",
)
@click.option("--steps", metavar="N", type=click.IntRange(min=1), help="Number of steps; overrides that of the run.")
@sizes_option
@click.option(
    "--until", metavar="T", type=float, help="Time at which the run ends, by a shorter last step if necessary."
)
@click.option(
    "--every", metavar="DT", type=float, help="Store states at intervals DT of time, instead of every stride-th step."
)
@click.option(
    "--at", metavar="T,…", multiple=True, help="Store states at these times, or at the times listed in a file."
)
@click.option("--stop", metavar="EXPR", help="The run ends where EXPR passes through 0, as with stop: in the spec.")
@click.option(
    "--seed", metavar="N", type=SEED, help="Seed of the random numbers of the noise; overrides that of the run."
)
@click.option("--from", "source", metavar="FILE", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help="Start at the last state of another run: FILE.csv or FILE.npz.")  # fmt: skip
@click.option(
    "--extend", is_flag=True, help="Continue a finished run beyond its end; the run is in the file that --output names."
)
@settings_option
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    callback=file_ending(*_TABLES, ".zarr"),
    help="Store the trajectory: FILE.csv or FILE.npz; a lattice as FILE.zarr too.",
)
@click.option("--section", metavar="FILE", callback=file_ending(*_TABLES),
              help="Store the crossings of the run's Poincaré section: FILE.csv or FILE.npz.")  # fmt: skip
@click.option(
    "--plot",
    metavar="FILE",
    callback=file_ending(*FIGURES, *FILMS),
    help="Draw the run: FILE.png, FILE.svg or FILE.pdf; a lattice as a film: FILE.gif or FILE.mp4.",
)
@click.option(
    "--lyapunov",
    is_flag=True,
    help="Compute Lyapunov exponents from the exact derivative of each step; for a lattice only the largest exponent.",
)
@click.option("--resume", is_flag=True, help="Continue an interrupted run that was writing the same files.")
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    name: str | None,
    target: str,
    order: int | None,
    scheme: str | None,
    profile: str | None,
    step: float | None,
    steps: int | None,
    sizes: str | None,
    until: float | None,
    every: float | None,
    at: tuple[str, ...],
    stop: str | None,
    seed: int | None,
    source: Path | None,
    extend: bool,
    settings: tuple[str, ...],
    output: Path | None,
    section: Path | None,
    plot: Path | None,
    lyapunov: bool,
    resume: bool,
    as_json: bool,
) -> None:
    """Integrate a run of a spec, and summarise the errors of energy, Casimirs, invariants and solution.

    The solver is compiled with profile fast, unless --profile names another profile. The key "profile:" of a spec
    applies to phigen build only. The classical methods that the run lists under "compare:" are run too, with the same
    step size. Files are written during the run. The results of an interrupted run are kept, and --resume continues it.
    """
    from phigen.api import compilation_of
    from phigen.cli.endings import ended, timed
    from phigen.cli.energy_warning import compares_with_rk4, rk4_warning, summary_warning
    from phigen.cli.past import extended, past_of, started_from
    from phigen.cli.recording import Files, Recorder, compared, opened_recorder, record
    from phigen.cli.tune import problem_of
    from phigen.runtime.origin import mark, origin_of

    if plot:
        from phigen.drawing.palette import require_matplotlib

        require_matplotlib()
    spec = resized(load_one(spec_file), name, sizes)
    _expect_together(
        {"--until": until, "--every": every, "--at": at, "--extend": extend},
        {"--steps": steps, "--from": source, "--section": section, "--lyapunov": lyapunov},
    )
    chosen = with_stop(spec, with_seed(spec, changed(spec, name, step, steps, until), seed), stop)
    origin = origin_of(spec, chosen)
    expect_same_origin({"--output": output, "--section": section}, origin, continued=resume or extend)
    expect_same_origin({"--plot": plot}, origin)
    if section and chosen.section is None:
        raise click.BadParameter(f"the run {chosen.name} of the spec has no section", param_hint="--section")
    if spec.lattice:
        method: Any = {"target": target, "order": order, "scheme": scheme, "profile": profile, "lyapunov": lyapunov}
        written: Any = {"output": output, "section": section, "plot": plot, "resume": resume, "as_json": as_json}
        rows: Any = {"source": source, "extend": extend, "every": every, "at": at, "origin": origin}
        run_lattice(console, spec, chosen, settings=settings, **method, **written, **rows)
        return
    if output and output.suffix.lower() == ".zarr":
        raise click.BadParameter(f"a .zarr is for lattices; the table of {spec.name} is .csv or .npz", param_hint="-o")
    if plot and plot.suffix.lower() in FILMS:
        raise click.BadParameter(f"films are for lattices, and {spec.name} is not a lattice", param_hint="--plot")
    experiment = prepared(spec, name, step, steps, settings, until)
    experiment = replace(experiment, run=chosen)
    compilation = compilation_of(spec, order=order, scheme=scheme, profile=profile, tangent=lyapunov)
    solver = loaded(compilation, target, console)
    if source:
        experiment = started_from(experiment, past_of(source, solver.interface, "--from"), solver)
    if extend:
        if output is None or not output.exists():
            raise click.UsageError("--extend continues a finished run: name its file by --output")
        experiment = extended(experiment, output, solver)
    experiment = timed(ended(experiment, solver, console), solver, every, at)
    recorder = Recorder(compilation, solver, experiment, Files(output, section), lyapunov)
    recorder = opened_recorder(recorder, resume, console)
    failure, interrupted = record(recorder, console)
    for file in (output, section):
        if file:
            mark(file, origin)
            console.note(f"{wrote(file)}" + (", up to the last computed state" if failure or interrupted else ""))
    summaries, drawn = [recorder.watch.summary()], {recorder.label: recorder.trajectory(failure is not None)}
    comparable = not (failure or interrupted or extend)
    for method in experiment.run.compare if comparable else ():
        watch, drawn[method] = compared(compilation, solver, experiment, method, console, recorder.time)
        summaries.append(watch.summary())
    warning = summary_warning(spec, summaries[0], recorder.experiment.h, solver.order)
    if comparable and not warning and compares_with_rk4(compilation, target, summaries[0].energy, recorder.steps):
        problem = problem_of(compilation, recorder.experiment, None, console)
        warning = rk4_warning(compilation, problem, solver, summaries[0].energy)
    if as_json:
        out_json(finite(described_run(compilation, recorder, summaries)))
    else:
        print_summary(compilation, recorder, summaries)
    if warning and not failure:
        console.warn(warning)
    if plot:
        _draw(plot, recorder, drawn, compilation.system.casimirs, summaries[0])
        console.note(wrote(plot))
    if failure:
        raise failure
    if interrupted:
        raise InterruptedRunError(_interruption_message(recorder))


#: Pairs of options that exclude each other.
_APART = [("--until", "--steps"), ("--every", "--at"), ("--extend", "--from")]
_APART += [("--extend", "--section"), ("--extend", "--lyapunov")]


def _expect_together(*options: dict[str, object]) -> None:
    """Raise `click.UsageError` for options that exclude each other."""
    used_options = {name for part in options for name, value in part.items() if value}
    for first, second in _APART:
        if {first, second} <= used_options:
            raise click.UsageError(f"{first} and {second} exclude each other")


def _interruption_message(recorder: Recorder) -> str:
    status_text = f"interrupted after {recorder.steps} of {recorder.experiment.run.steps} steps"
    return f"{status_text}; repeat the command with --resume to continue" if recorder.files.checkpoint else status_text


def _draw(path: Path, recorder: Recorder, drawn: dict[str, Trajectory], casimirs: Any, summary: Summary) -> None:
    from phigen.drawing import figures

    sections = {f"{recorder.section_text} = 0": recorder.points.rows[:, 1:]} if recorder.finder else {}
    title = f"{recorder.solver.interface.name}, {recorder.experiment.run.name}"
    figure = figures.run_figure(drawn, casimirs, sections, title, recorder.spectrum, summary.units)
    figures.save(figure, path, str(recorder.origin))
