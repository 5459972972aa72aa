"""``phigen run`` for lattices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.arguments import FILMS
from phigen.cli.console import Console, counted, heading, out, out_json, table
from phigen.cli.existing import wrote
from phigen.cli.experiment import expect_positive, setting_of
from phigen.cli.interruption import InterruptedRunError
from phigen.cli.run_summary import counted_crossings, described_averages, described_spectrum, finite, print_averages
from phigen.errors import StepError

if TYPE_CHECKING:
    from phigen.cli.lattice_experiment import LatticeExperiment
    from phigen.geometry.conservation import Unit
    from phigen.lattice.states import Start
    from phigen.runtime.lattice import LatticeSolver, LatticeTrajectory
    from phigen.runtime.lattice_series import LatticeSeries
    from phigen.runtime.origin import Origin
    from phigen.spec.model import Run, Spec
    from phigen.study.lyapunov import Spectrum


def run_lattice(
    console: Console,
    spec: Spec,
    run: Run,
    *,
    target: str,
    order: int | None,
    scheme: str | None,
    profile: str | None,
    settings: Iterable[str],
    output: Path | None,
    section: Path | None,
    plot: Path | None,
    resume: bool,
    as_json: bool,
    lyapunov: bool,
    source: Path | None = None,
    extend: bool = False,
    every: float | None = None,
    at: Sequence[str] = (),
    origin: Origin,
) -> None:
    """Integrate a run, and print the errors of conserved quantities. Raises `StepError` at the end if a step failed.

    ``lyapunov`` also requests the largest Lyapunov exponent, from a second pass with a tangent vector.
    """
    import numpy as np

    from phigen.api import chosen_target, compilation_of, lattice_solver_of
    from phigen.cli.endings import ended, timed
    from phigen.cli.energy_warning import energy_warning
    from phigen.cli.lattice_experiment import LatticeExperiment, extended, started_from
    from phigen.lattice.states import start_of
    from phigen.runtime.lattice_series import LatticeSeries, series_of
    from phigen.runtime.origin import mark
    from phigen.study.averages import averages_of
    from phigen.study.lattice_errors import BALANCE, CHANGE, ENERGY, errors_of, units_of

    if plot and plot.suffix.lower() in FILMS and run.records_numbers:
        raise click.BadParameter(
            "a film needs states, but `record` of the run does not list `state`", param_hint="--plot"
        )
    if plot and plot.suffix.lower() in FILMS:
        from phigen.drawing.films import expect_writer

        expect_writer(plot)
    compiled = compilation_of(spec, order=order, scheme=scheme, profile=profile, tangent=lyapunov)
    compilation = compiled.by_sweeps()
    start = start_of(spec, run)
    parameters = parameters_of(spec, start, settings)
    solver = lattice_solver_of(compilation, chosen_target(target, console.note))
    if source:
        run, start = started_from(run, start, source, solver)
    _expect_files(run, start, {"--output": output, "--section": section})
    experiment = LatticeExperiment(run, (), start.arguments | parameters, start=start, origin=str(origin))
    if extend:
        if output is None or not output.exists():
            raise click.UsageError("--extend continues a finished run: name its file by --output")
        if output.suffix.lower() == ".zarr":
            raise click.UsageError("--extend continues .npz and .csv files; a .zarr is written as a whole")
        experiment = extended(experiment, output, solver)
    experiment = timed(ended(experiment, solver, console), solver, every, at)
    results, failure = _integrated(console, experiment, solver, output, section, resume=resume)
    trajectory, series = (
        (results.ends, results) if isinstance(results, LatticeSeries) else (results, series_of(results))
    )
    for file in (output, section):
        if file and not failure:
            mark(file, origin)
            console.note(wrote(file))
    spectrum = None
    if lyapunov and not failure:
        spectrum = exponents_of(console, spec, run, solver, start, start.arguments | parameters)
    errors, units = errors_of(compilation.cell, trajectory), units_of(compilation.cell, trajectory)
    largest = {name: float(e.max()) for name, e in errors.items()}
    if "energy" in series.columns:
        worst = units["energy"].errors(series.columns["energy"], float(series.columns["energy"][0])).max()
        largest |= {kind: max(largest[kind], float(worst)) for kind in (ENERGY, CHANGE) if kind in largest}
    observables = list(series.observables)
    averages = averages_of(run, len(observables))
    averages.see(series.t, np.column_stack([series.t, *series.observables.values()])[:, 1:])
    threads = solver.backend.threads(prod(start.sizes))
    if as_json:
        sizes = {"sizes": list(start.sizes), "frames": len(trajectory), "rows": len(series)}
        build_facts = {"profile": compilation.program.profile, "threads": threads}
        method = {
            "target": solver.target,
            **build_facts,
            "order": solver.order,
            "step": trajectory.h,
            "steps": trajectory.steps,
            "time": float(trajectory.t[-1] - trajectory.t[0]),
        }
        description = {
            "name": spec.name,
            "run": run.name,
            **sizes,
            **method,
            **compilation.described,
            "errors": largest,
        }
        description |= {"observables": described_averages(observables, averages, run.average.of)} if observables else {}
        if results.crossings is not None:
            crossed = {"expression": section_text(run), "crossings": len(results.crossings)}
            description["section"] = crossed
        out_json(finite(description | ({"lyapunov": described_spectrum(spectrum)} if spectrum else {})))
    else:
        target = f"target {solver.target}, {counted(threads, 'thread')}"
        named_method = compilation.named(f"{compilation.method}, {target}")
        _print(spec, run, start, named_method, trajectory, largest, units)
        if observables:
            print_averages(observables, averages, run.average.of)
        if results.crossings is not None:
            out(f"\n  {counted_crossings(run, len(results.crossings), section_text(run))}")
        if spectrum:
            changed_by = f"the second half changed it by {spectrum.uncertainty:.1g}"
            out(f"\n  largest Lyapunov exponent after t = {spectrum.t:.9g}: {spectrum.largest:.4g}; {changed_by}")
    energy = largest.get(ENERGY, largest.get(BALANCE, 0.0))
    warning = energy_warning(spec, energy, units["energy"], trajectory.h, solver.order)
    if warning and not failure:
        console.warn(warning)
    if plot:
        _draw(spec, run, results, errors, spectrum, plot, str(origin))
        console.note(wrote(plot))
    if failure:
        raise failure


def _integrated(
    console: Console,
    experiment: LatticeExperiment,
    solver: LatticeSolver,
    output: Path | None,
    section: Path | None,
    *,
    resume: bool,
) -> tuple[LatticeTrajectory | LatticeSeries, StepError | None]:
    """Integrate a run; return its result, and the `StepError` if a step failed, else None.

    The result has all frames (states of all sites), or only the numbers that the run lists under ``record``.
    """
    from phigen.runtime.checkpoint import MismatchError, objection

    run, first = experiment.run, output or section
    checkpoint = first.with_name(first.name + ".checkpoint") if first else None
    if checkpoint is None and resume:
        raise click.UsageError("--resume continues the files of an interrupted run: name them by --output or --section")
    finished = None if experiment.past else first
    if checkpoint and (refused := objection(checkpoint, finished, resume=resume, how="--resume")):
        raise click.UsageError(refused)
    if resume and checkpoint and checkpoint.exists():
        console.note(f"resuming from {checkpoint}")
    plan, recorded = experiment.plan(solver), run.record if run.records_numbers else ()
    try:
        if plan.transforms:
            plan.transforms.expect_frames(plan.times, plan.at.h)
    except ValueError as error:
        raise click.UsageError(f"spectrum: and correlation: of the run {run.name}: {error}") from None
    with console.progress(f"{solver.interface.name} {run.name}", run.steps) as progress:
        try:
            result = solver.carried_out(
                plan, recorded, output=output, checkpoints=checkpoint, resume=resume, progress=progress
            )
        except MismatchError as error:
            raise click.UsageError(str(error)) from None
        except KeyboardInterrupt:
            if checkpoint is None or not checkpoint.exists():
                raise
            message = f"interrupted; {checkpoint} keeps the run: repeat the command with --resume to continue"
            raise InterruptedRunError(message) from None
        except StepError as error:
            if error.trajectory is None:  # not even the first step was possible
                raise
            return error.trajectory, error
    if section and result.crossings is not None:
        result.crossings.save(section)
    return result, None


def _expect_files(run: Run, start: Start, files: Mapping[str, Path | None]) -> None:
    """Raise `click.BadParameter` for files whose format cannot hold the rows of the run."""
    from phigen.runtime.lattice_frames import expect_columns, expect_store

    for option, path in files.items():
        try:
            if path and path.suffix.lower() == ".csv" and not run.records_numbers:
                expect_columns(start.state.shape)
            if path and path.suffix.lower() == ".zarr":
                expect_store(path)
        except ValueError as error:
            raise click.BadParameter(str(error), param_hint=option) from None
        if path and path.suffix.lower() == ".zarr" and run.records_numbers:
            message = "a .zarr file stores states, but `record` of the run does not list `state`; use .csv or .npz"
            raise click.BadParameter(message, param_hint=option)


def _draw(
    spec: Spec,
    run: Run,
    result: LatticeTrajectory | LatticeSeries,
    errors: Mapping[str, Any],
    spectrum: Spectrum | None,
    plot: Path,
    origin: str,
) -> None:
    """Draw a film or a figure, depending on the suffix of the file."""
    from phigen.runtime.lattice_series import LatticeSeries

    title = f"{spec.name}, {run.name}"
    if isinstance(result, LatticeSeries):
        from phigen.drawing.figures import save
        from phigen.drawing.lattice_figures import series_figure

        save(series_figure(result, title), plot, origin)
    elif plot.suffix.lower() in FILMS:
        from phigen.drawing.films import film

        film(result, title, plot, origin)
    else:
        from phigen.drawing.figures import save
        from phigen.drawing.lattice_figures import lattice_figure

        names = run.lattice.names if run.lattice else ()
        save(lattice_figure(result, errors, title, spectrum=spectrum, site_names=names), plot, origin)


def exponents_of(
    console: Console, spec: Spec, run: Run, solver: LatticeSolver, start: Start, parameters: Mapping[str, Any]
) -> Spectrum:
    """Return the largest Lyapunov exponent of a run, as a spectrum without other exponents. Raises `StepError`."""
    from phigen.study.lyapunov import lattice_spectrum

    t0, draws = float(run.start) if spec.time else None, {"seed": run.seed} if spec.noise else {}
    with console.progress(f"{spec.name} {run.name}, with a tangent vector", run.steps) as progress:
        return lattice_spectrum(
            solver, start.state, float(run.step), run.steps, 1, parameters, t0=t0, progress=progress, **draws
        )


def parameters_of(spec: Spec, start: Start, settings: Iterable[str]) -> dict[str, Any]:
    """Return the parameters of a run. Values from the command line replace those of the spec."""
    parameters: dict[str, Any] = dict(start.parameters)
    for setting in settings:
        name, value = setting_of(setting)
        if name not in parameters:
            known_names = ", ".join(parameters) or "none"
            raise click.BadParameter(f"{name!r} is not a parameter ({known_names})", param_hint="--set")
        parameters[name] = value
    expect_positive(spec, parameters)
    return parameters


def steps_text(trajectory: LatticeTrajectory) -> str:
    """Return the number of steps in words, such as "60 steps of 0.1".

    With a monitor, "in τ" is added. If the last step is shorter, "and a part of one" is added.
    """
    whole_time, monitored = trajectory.steps * trajectory.h, trajectory.solver.interface.monitored
    elapsed = trajectory.t[-1] - trajectory.t[0]
    if monitored:
        elapsed = whole_time if trajectory.tau is None else trajectory.tau[-1]
    part = abs(elapsed - whole_time) > 1e-9 * max(abs(whole_time), abs(trajectory.h))
    return f"{trajectory.steps} steps of {trajectory.h:.9g}" + " in τ" * monitored + " and a part of one" * bool(part)


def _formatted_error(error: float) -> str:
    return f"{error:.1e}" if error else "0"


def section_text(run: Run) -> str:
    """Return the expression of a section as readable text; "" if there is no section."""
    from phigen.symbolic.readable import readable

    return readable([run.section])[0] if run.section is not None else ""


def _print(
    spec: Spec,
    run: Run,
    start: Start,
    method: str,
    trajectory: Any,
    errors: Mapping[str, float],
    units: Mapping[str, Unit],
) -> None:
    from phigen.geometry.conservation import stated
    from phigen.study.lattice_errors import BALANCE, CHANGE, ENERGY

    out(heading(f"{spec.name}, run {run.name}") + (f": {run.description}" if run.description else ""))
    sizes = " × ".join(map(str, start.sizes))
    out(f"  {sizes} sites; {steps_text(trajectory)}, t = {trajectory.t[0]:.9g} … {trajectory.t[-1]:.9g}; {method}\n")
    kinds = dict.fromkeys(spec.casimirs, "at the worst site") | {name: unit.kind for name, unit in units.items()}
    kinds |= dict.fromkeys((ENERGY, BALANCE, CHANGE), units["energy"].kind)
    rows = [["largest" if BALANCE in errors else "largest change" if CHANGE in errors else "largest error", "", ""]]
    if BALANCE in errors:
        change = float(units["energy"].errors(trajectory.energy, float(trajectory.energy[0])).max())
        rows.append([CHANGE, _formatted_error(change), units["energy"].kind])
    for name, error in errors.items():
        label = name if BALANCE not in errors else f"{'error of the' if name == BALANCE else 'change of'} {name}"
        rows.append([label, _formatted_error(error), kinds[name]])
    for line in table(rows, right=[1]):
        out(f"  {line}")
    out(f"  {stated(units)}")
    if BALANCE in errors:
        power = "(∂H/∂t + the power of the forces)" if spec.forces else "∂H/∂t"
        out(f"  The energy balance is H − ∫ {power} dt, integrated over all steps by a rule of order 8.")
