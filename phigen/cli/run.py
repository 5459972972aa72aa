"""``phigen run``: integrate an experiment of a spec and sum up what was conserved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.console import Console, out_json, pass_console, verbosity
from phigen.cli.experiment import loaded, prepared, run_of
from phigen.cli.interruption import InterruptedRunError
from phigen.cli.lattice_run import changed, expect_no, run_lattice
from phigen.cli.run_summary import described_run, finite, print_summary
from phigen.cli.sources import FIGURES, ORDER, file_ending, load_one, one_spec, run_option, scheme_option
from phigen.registry import LOADABLE

if TYPE_CHECKING:
    from phigen.cli.recording import Recorder
    from phigen.runtime.trajectory import Trajectory
    from phigen.study.summary import Summary

_TABLES = (".csv", ".npz")


@click.command("run")
@one_spec
@run_option
@click.option("-t", "--target", type=click.Choice(["auto", *LOADABLE]), default="auto", show_default=True)
@click.option("--order", metavar="K", type=ORDER, help="Order of the method, instead of the spec's.")
@scheme_option
@click.option("--step", metavar="H", type=float, help="Step size, instead of the run's.")
@click.option("--steps", metavar="N", type=click.IntRange(min=1), help="Number of steps, instead of the run's.")
@click.option("--set", "settings", metavar="NAME=VALUE", multiple=True, help="A parameter, or an initial coordinate.")
@click.option(
    "-o", "--output", metavar="FILE", callback=file_ending(*_TABLES), help="Store the trajectory: FILE.csv or FILE.npz."
)
@click.option("--section", metavar="FILE", callback=file_ending(*_TABLES),
              help="Store the crossings of the run's Poincaré section: FILE.csv or FILE.npz.")  # fmt: skip
@click.option(
    "--plot", metavar="FILE", callback=file_ending(*FIGURES), help="Draw the run: FILE.png, FILE.svg or FILE.pdf."
)
@click.option("--lyapunov", is_flag=True, help="Lyapunov exponents, through the exact derivative of each step.")
@click.option("--resume", is_flag=True, help="Go on with an interrupted run that was writing the same files.")
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
    output: Path | None,
    section: Path | None,
    plot: Path | None,
    lyapunov: bool,
    resume: bool,
    as_json: bool,
) -> None:
    """Integrate a run of a spec, and sum up the errors of energy, Casimirs, invariants and solution.

    The classical methods that the run names under compare: are run beside it, with the same step size. Files are
    written while the run goes on; one that is interrupted keeps what it has, and goes on with --resume.
    """
    from phigen.api import compilation_of
    from phigen.cli.recording import Files, Recorder, compared, opened_recorder, record
    from phigen.cli.verify import with_tangent

    if plot:
        from phigen.drawing.palette import require_matplotlib

        require_matplotlib()
    spec = load_one(spec_file)
    if spec.lattice:
        expect_no(section=section, lyapunov=lyapunov)
        chosen = changed(run_of(spec, name), step, steps)
        given: Any = {"target": target, "order": order, "scheme": scheme, "settings": settings, "output": output}
        run_lattice(console, spec, chosen, **given, plot=plot, resume=resume, as_json=as_json)
        return
    experiment = prepared(spec, name, step, steps, settings)
    if section and experiment.run.section is None:
        raise click.BadParameter(f"the run {experiment.run.name} has no section: in the spec", param_hint="--section")
    compilation = compilation_of(spec, order, with_tangent(spec) if lyapunov else None, scheme=scheme)
    solver = loaded(compilation, target, console)
    recorder = Recorder(compilation, solver, experiment, Files(output, section), lyapunov)
    recorder = opened_recorder(recorder, resume, console)
    failure, interrupted = record(recorder, console)
    for file in (output, section):
        if file:
            console.note(f"wrote {file}" + (", as far as the run came" if failure or interrupted else ""))
    summaries, drawn = [recorder.watch.summary()], {recorder.label: recorder.trajectory(failure is not None)}
    for method in experiment.run.compare if not (failure or interrupted) else ():
        watch, drawn[method] = compared(compilation, solver, experiment, method, console, recorder.time)
        summaries.append(watch.summary())
    if as_json:
        out_json(finite(described_run(compilation, recorder, summaries)))
    else:
        print_summary(compilation, recorder, summaries)
    if plot:
        _draw(plot, recorder, drawn, compilation.system.casimirs, summaries[0])
        console.note(f"wrote {plot}")
    if failure:
        raise failure
    if interrupted:
        raise InterruptedRunError(_told(recorder))


def _told(recorder: Recorder) -> str:
    done = f"interrupted after {recorder.session.steps} of {recorder.experiment.run.steps} steps"
    return f"{done}; the same command with --resume goes on" if recorder.files.checkpoint else done


def _draw(path: Path, recorder: Recorder, drawn: dict[str, Trajectory], casimirs: Any, summary: Summary) -> None:
    from phigen.drawing import figures

    sections = {f"{recorder.section_text} = 0": recorder.points.rows[:, 1:]} if recorder.finder else {}
    title = f"{recorder.solver.interface.name}, {recorder.experiment.run.name}"
    figure = figures.run_figure(
        drawn, casimirs, sections, title, recorder.spectrum, summary.units, balance=summary.is_balance
    )
    figures.save(figure, path)
