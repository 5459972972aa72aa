"""``phigen run`` of a lattice."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from phigen.cli.arguments import FILMS
from phigen.cli.console import Console, counted, heading, out, out_json, table
from phigen.cli.experiment import expect_positive, setting_of
from phigen.cli.run_summary import described_averages, described_spectrum, finite, print_averages
from phigen.errors import StepError
from phigen.reading import opened

if TYPE_CHECKING:
    from phigen.lattice.states import Start
    from phigen.runtime.lattice import LatticeSolver, LatticeTrajectory
    from phigen.runtime.lattice_series import LatticeSeries
    from phigen.spec.model import Run, Spec
    from phigen.study.conservation import Unit
    from phigen.study.lyapunov import Spectrum

#: Options of ``phigen run`` that lattices do not have: the reasons, and what to do.
_ABSENT = {
    "every": "frames are ends of steps, as stride: says; trajectory.at([t, …]) in Python makes states between",
    "at": "frames are ends of steps; trajectory.at([t, …]) in Python makes states at given times",
    "extend": "files of frames are not written on; --from FILE.npz starts a further run at the end of this one",
    "section": "sections are those of ordinary systems; observables: of the lattice are recorded at every frame",
}


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
    plot: Path | None,
    resume: bool,
    as_json: bool,
    lyapunov: bool,
    source: Path | None = None,
    until: float | None = None,
) -> None:
    """Integrate a run, and print what was conserved. Raises `StepError` after that if it did not come to its end.

    ``lyapunov`` asks for the largest Lyapunov exponent besides, in a second pass with a tangent vector.
    """
    from phigen.api import chosen_target, compilation_of, lattice_solver_of
    from phigen.cli.energy_warning import energy_warning
    from phigen.lattice.observing import BALANCE, CHANGE, ENERGY, errors_of, units_of
    from phigen.lattice.states import start_of
    from phigen.runtime.lattice_series import LatticeSeries, series_of
    from phigen.study.averages import averages_of

    if output and output.suffix != ".npz" and not run.records_numbers:
        message = "the frames of a lattice are stored in a .npz file; with record: [energy, …] columns go to .csv too"
        raise click.BadParameter(message, param_hint="--output")
    if plot and plot.suffix.lower() in FILMS and run.records_numbers:
        raise click.BadParameter("a film needs frames: the run has record: without state", param_hint="--plot")
    if plot and plot.suffix.lower() in FILMS:
        from phigen.drawing.films import expect_writer

        expect_writer(plot)
    compiled = compilation_of(spec, order=order, scheme=scheme, profile=profile, tangent=lyapunov)
    compilation = compiled.by_sweeps()
    run, start = begun_at(run, start_of(spec, run), source, timed=bool(spec.time))
    run, parameters = until_time(run, until), parameters_of(spec, start, settings)
    solver = lattice_solver_of(compilation, chosen_target(target, console.note))
    whole, failure = _integrated(console, spec, run, solver, start, start.arguments | parameters, output, resume=resume)
    trajectory, series = (whole.ends, whole) if isinstance(whole, LatticeSeries) else (whole, series_of(whole))
    if output and not failure:
        console.note(f"wrote {output}")
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
        built = {"profile": compilation.program.profile, "threads": threads}
        method = {
            "target": solver.target,
            **built,
            "order": solver.order,
            "step": trajectory.h,
            "steps": trajectory.steps,
        }
        description = {
            "name": spec.name,
            "run": run.name,
            **sizes,
            **method,
            **compilation.described,
            "errors": largest,
        }
        description |= {"observables": described_averages(observables, averages)} if observables else {}
        out_json(finite(description | ({"lyapunov": described_spectrum(spectrum)} if spectrum else {})))
    else:
        target = f"target {solver.target}, {counted(threads, 'thread')}"
        named_method = compilation.named(f"{compilation.method}, {target}")
        _print(spec, run, start, named_method, trajectory, largest, units)
        if observables:
            print_averages(observables, averages)
        if spectrum:
            changed_by = f"the second half changed it by {spectrum.uncertainty:.1g}"
            out(f"\n  largest Lyapunov exponent after t = {spectrum.t:.9g}: {spectrum.largest:.4g}; {changed_by}")
    energy = largest.get(ENERGY, largest.get(BALANCE, 0.0))
    warning = energy_warning(spec, energy, units["energy"], trajectory.h, solver.order)
    if warning and not failure:
        console.warn(warning)
    if plot:
        _draw(spec, run, whole, errors, spectrum, plot)
        console.note(f"wrote {plot}")
    if failure:
        raise failure


def _integrated(
    console: Console,
    spec: Spec,
    run: Run,
    solver: LatticeSolver,
    start: Start,
    parameters: Mapping[str, Any],
    output: Path | None,
    *,
    resume: bool,
) -> tuple[LatticeTrajectory | LatticeSeries, StepError | None]:
    """The frames of a run, or what it records, and why it did not come to its end if it did not."""
    from phigen.runtime.checkpoint import MismatchError, objection

    checkpoint = output.with_name(output.name + ".checkpoint") if output else None
    if checkpoint is None and resume:
        raise click.UsageError("--resume continues the files of an interrupted run: name them by --output")
    if checkpoint and (refused := objection(checkpoint, output, resume=resume, how="--resume")):
        raise click.UsageError(refused)
    with console.progress(f"{spec.name} {run.name}", run.steps) as progress:
        try:
            integrate: Any = partial(solver.series, of=run.record) if run.records_numbers else solver.integrate
            return integrate(
                start.state, float(run.step), run.steps, run.stride,
                t0=float(run.start) if spec.time else None, seed=run.seed if spec.noise else None,
                output=output, checkpoints=checkpoint, resume=resume, progress=progress, parameters=parameters,
            ), None  # fmt: skip
        except MismatchError as error:
            raise click.UsageError(str(error)) from None
        except StepError as error:
            return error.trajectory, error


def _draw(
    spec: Spec,
    run: Run,
    result: LatticeTrajectory | LatticeSeries,
    errors: Mapping[str, Any],
    spectrum: Spectrum | None,
    plot: Path,
) -> None:
    """A film or a figure, by the suffix of the file."""
    from phigen.runtime.lattice_series import LatticeSeries

    title = f"{spec.name}, {run.name}"
    if isinstance(result, LatticeSeries):
        from phigen.drawing.figures import save
        from phigen.drawing.lattices import series_figure

        save(series_figure(result, title), plot)
    elif plot.suffix.lower() in FILMS:
        from phigen.drawing.films import film

        film(result, title, plot)
    else:
        from phigen.drawing.figures import save
        from phigen.drawing.lattices import lattice_figure

        save(lattice_figure(result, errors, title, spectrum=spectrum), plot)


def exponents_of(
    console: Console, spec: Spec, run: Run, solver: LatticeSolver, start: Start, parameters: Mapping[str, Any]
) -> Spectrum:
    """The largest Lyapunov exponent of a run. Raises `StepError`."""
    from phigen.study.lyapunov import lattice_spectrum

    t0, draws = float(run.start) if spec.time else None, {"seed": run.seed} if spec.noise else {}
    with console.progress(f"{spec.name} {run.name}, with a tangent vector", run.steps) as progress:
        return lattice_spectrum(
            solver, start.state, float(run.step), run.steps, 1, parameters, t0=t0, progress=progress, **draws
        )


def expect_no(**options: object) -> None:
    """Refuse options that lattices do not have."""
    for name, value in options.items():
        if value:
            raise click.BadParameter(f"not for lattices: {_ABSENT[name]}", param_hint=f"--{name}")


def until_time(run: Run, until: float | None) -> Run:
    """Return the run with the steps up to a time. Raises `click.BadParameter` where that is no whole number of them."""
    from phigen.spec.runs import whole

    if until is None:
        return run
    steps = whole((Fraction(until) - run.start) / run.step) if math.isfinite(until) else None
    if steps is None or steps < 1:
        message = f"runs of lattices make whole steps of {float(run.step):.9g}, which do not end at {until!r}"
        raise click.BadParameter(message, param_hint="--until")
    return replace(run, steps=steps, stride=min(run.stride, steps), duration=None)


def begun_at(run: Run, start: Start, source: Path | None, *, timed: bool) -> tuple[Run, Start]:
    """Return a run that starts at the last state in a file of another run, with its time where there is one.

    Raises `click.BadParameter` for what is no such file, and states of other sizes.
    """
    if source is None:
        return run, start
    try:
        with opened(source) as file, np.load(file, allow_pickle=False) as stored:
            state = np.asarray(stored["last"] if "last" in stored else stored["x"][-1], dtype=np.float64)
            t = float(stored["t"][-1])
    except (OSError, ValueError, KeyError, EOFError, IndexError, zipfile.BadZipFile) as error:
        message = f"{source} is no .npz of a run of a lattice: {error}"
        raise click.BadParameter(message, param_hint="--from") from None
    if state.shape != start.state.shape or not np.isfinite(state).all():
        message = f"{source} ends with a state of shape {state.shape}, the run has {start.state.shape}"
        wrong = message if state.shape != start.state.shape else f"the last state in {source} is not finite"
        raise click.BadParameter(wrong, param_hint="--from")
    return replace(run, start=Fraction(t)) if timed else run, replace(start, state=state)


def parameters_of(spec: Spec, start: Start, settings: Iterable[str]) -> dict[str, Any]:
    """The parameters of a run, with those of the command line put in."""
    parameters: dict[str, Any] = dict(start.parameters)
    for setting in settings:
        name, value = setting_of(setting)
        if name not in parameters:
            known = ", ".join(parameters) or "none"
            raise click.BadParameter(f"{name!r} is not a parameter ({known})", param_hint="--set")
        parameters[name] = value
    expect_positive(spec, parameters)
    return parameters


def _print(
    spec: Spec,
    run: Run,
    start: Start,
    method: str,
    trajectory: Any,
    errors: Mapping[str, float],
    units: Mapping[str, Unit],
) -> None:
    from phigen.lattice.observing import BALANCE, CHANGE, ENERGY
    from phigen.study.conservation import stated

    out(heading(f"{spec.name}, run {run.name}") + (f": {run.description}" if run.description else ""))
    sizes = " × ".join(map(str, start.sizes))
    out(
        f"  {sizes} sites; {trajectory.steps} steps of {trajectory.h:.9g}, "
        f"t = {trajectory.t[0]:.9g} … {trajectory.t[-1]:.9g}; {method}\n"
    )
    kinds = dict.fromkeys(spec.casimirs, "at the worst site") | {name: unit.kind for name, unit in units.items()}
    kinds |= dict.fromkeys((ENERGY, BALANCE, CHANGE), units["energy"].kind)
    rows = [["largest change" if CHANGE in errors else "largest error", "", ""]]
    rows += [[name, f"{error:.1e}" if error else "0", kinds[name]] for name, error in errors.items()]
    for line in table(rows, right=[1]):
        out(f"  {line}")
    out(f"  {stated(units)}")
    if BALANCE in errors:
        out("  The energy balance is H − ∫ dH/dt dt, integrated over all steps by a rule of order 8.")
