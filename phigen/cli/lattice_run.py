"""``phigen run`` of a lattice."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.arguments import FILMS
from phigen.cli.console import Console, counted, heading, out, out_json, table
from phigen.cli.experiment import expect_positive, setting_of
from phigen.cli.run_summary import described_spectrum, finite
from phigen.errors import StepError

if TYPE_CHECKING:
    from phigen.lattice.states import Start
    from phigen.runtime.lattice import LatticeSolver, LatticeTrajectory
    from phigen.spec.model import Run, Spec
    from phigen.study.conservation import Unit
    from phigen.study.lyapunov import Spectrum

#: Options of ``phigen run`` that lattices do not have.
_ABSENT = "phigen run has no {option} for lattices"


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
) -> None:
    """Integrate a run, and print what was conserved. Raises `StepError` after that if it did not come to its end.

    ``lyapunov`` asks for the largest Lyapunov exponent besides, in a second pass with a tangent vector.
    """
    from phigen.api import chosen_target, compilation_of, lattice_solver_of
    from phigen.cli.energy_warning import energy_warning
    from phigen.lattice.observing import BALANCE, ENERGY, errors_of, units_of
    from phigen.lattice.states import start_of

    if output and output.suffix != ".npz":
        raise click.BadParameter("frames of lattices go to .npz files", param_hint="--output")
    if plot and plot.suffix.lower() in FILMS:
        from phigen.drawing.films import expect_writer

        expect_writer(plot)
    compilation = compilation_of(spec, order=order, scheme=scheme, profile=profile, tangent=lyapunov)
    assert compilation.cell is not None
    start = start_of(spec, run)
    parameters = parameters_of(spec, start, settings)
    solver = lattice_solver_of(compilation, chosen_target(target, console.note))
    made, failure = _integrated(console, spec, run, solver, start, start.arguments | parameters, output, resume=resume)
    if output and not failure:
        console.note(f"wrote {output}")
    spectrum = None
    if lyapunov and not failure:
        spectrum = exponents_of(console, spec, run, solver, start, start.arguments | parameters)
    errors, units = errors_of(compilation.cell, made), units_of(compilation.cell, made)
    largest = {name: float(e.max()) for name, e in errors.items()}
    threads = solver.backend.threads(prod(start.sizes))
    if as_json:
        sizes = {"sizes": list(start.sizes), "frames": len(made)}
        built = {"profile": compilation.program.profile, "threads": threads}
        method = {"target": solver.target, **built, "order": solver.order, "step": made.h, "steps": made.steps}
        told = {"name": spec.name, "run": run.name, **sizes, **method, **compilation.described, "errors": largest}
        out_json(finite(told | ({"lyapunov": described_spectrum(spectrum)} if spectrum else {})))
    else:
        target = f"target {solver.target}, {counted(threads, 'thread')}"
        told_method = compilation.told(f"{compilation.method}, {target}")
        _print(spec, run, start, told_method, made, largest, units)
        if spectrum:
            changed_by = f"the second half changed it by {spectrum.uncertainty:.1g}"
            out(f"\n  largest Lyapunov exponent after t = {spectrum.t:.9g}: {spectrum.largest:.4g}; {changed_by}")
    energy = largest.get(ENERGY, largest.get(BALANCE, 0.0))
    warning = energy_warning(spec, energy, units["energy"], made.h, solver.order)
    if warning and not failure:
        console.warn(warning)
    if plot:
        _draw(spec, run, made, errors, spectrum, plot)
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
) -> tuple[LatticeTrajectory, StepError | None]:
    """The frames of a run, and why it did not come to its end if it did not."""
    from phigen.runtime.checkpoint import MismatchError, objection

    kept = output.with_name(output.name + ".checkpoint") if output else None
    if kept is None and resume:
        raise click.UsageError("--resume goes on with files: give those of the interrupted run by --output")
    if kept and (refused := objection(kept, output, resume=resume, how="--resume")):
        raise click.UsageError(refused)
    with console.progress(f"{spec.name} {run.name}", run.steps) as progress:
        try:
            return solver.integrate(
                start.state, float(run.step), run.steps, run.stride,
                t0=float(run.start) if spec.time else None, seed=run.seed if spec.noise else None,
                output=output, checkpoints=kept, resume=resume, progress=progress, parameters=parameters,
            ), None  # fmt: skip
        except MismatchError as error:
            raise click.UsageError(str(error)) from None
        except StepError as error:
            return error.trajectory, error


def _draw(
    spec: Spec, run: Run, made: LatticeTrajectory, errors: Mapping[str, Any], spectrum: Spectrum | None, plot: Path
) -> None:
    """A film or a figure, by the suffix of the file."""
    title = f"{spec.name}, {run.name}"
    if plot.suffix.lower() in FILMS:
        from phigen.drawing.films import film

        film(made, title, plot)
    else:
        from phigen.drawing.figures import save
        from phigen.drawing.lattices import lattice_figure

        save(lattice_figure(made, errors, title, spectrum=spectrum), plot)


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
            raise click.BadParameter(_ABSENT.format(option=f"--{name}"), param_hint=f"--{name}")


def parameters_of(spec: Spec, start: Start, settings: Iterable[str]) -> dict[str, Any]:
    """The parameters of a run, with those of the command line put in."""
    parameters: dict[str, Any] = dict(start.parameters)
    for setting in settings:
        name, value = setting_of(setting)
        if name not in parameters:
            known = ", ".join(parameters) or "none"
            raise click.BadParameter(f"{name!r} is no parameter ({known})", param_hint="--set")
        parameters[name] = value
    expect_positive(spec, parameters)
    return parameters


def _print(
    spec: Spec,
    run: Run,
    start: Start,
    method: str,
    made: Any,
    errors: Mapping[str, float],
    units: Mapping[str, Unit],
) -> None:
    from phigen.lattice.observing import BALANCE, CHANGE, ENERGY
    from phigen.study.conservation import stated

    out(heading(f"{spec.name}, run {run.name}") + (f": {run.description}" if run.description else ""))
    sizes = " × ".join(map(str, start.sizes))
    out(f"  {sizes} sites; {made.steps} steps of {made.h:.9g}, t = {made.t[0]:.9g} … {made.t[-1]:.9g}; {method}\n")
    kinds = dict.fromkeys(spec.casimirs, "at the worst site") | {name: unit.kind for name, unit in units.items()}
    kinds |= dict.fromkeys((ENERGY, BALANCE, CHANGE), units["energy"].kind)
    rows = [["largest change" if CHANGE in errors else "largest error", "", ""]]
    rows += [[name, f"{error:.1e}" if error else "0", kinds[name]] for name, error in errors.items()]
    for line in table(rows, right=[1]):
        out(f"  {line}")
    out(f"  {stated(units)}")
    if BALANCE in errors:
        out("  The energy balance is H − ∫ dH/dt dt, integrated over all steps by a rule of order 8.")
