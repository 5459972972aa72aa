"""``phigen verify``: measure how well solvers keep the properties that phigen promises, and compare the results with
bounds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.arguments import (
    FIGURES,
    file_ending,
    many_specs,
    order_option,
    profile_option,
    run_option,
    scheme_option,
)
from phigen.cli.console import Console, heading, out, out_json, pass_console, table, verbosity
from phigen.cli.existing import expect_same_origin, force_option, wrote
from phigen.cli.experiment import Experiment, expect_system, prepared, run_of
from phigen.cli.failures import Collector
from phigen.cli.resizing import resized, sizes_option
from phigen.cli.sources import load_all
from phigen.errors import CheckError, StepError
from phigen.registry import loadable

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.study.backward import Constancy
    from phigen.study.verification import Check, Verification

_NOT_FINITE = {math.inf: "∞", -math.inf: "-∞"}


@click.command("verify")
@many_specs
@run_option
@order_option
@scheme_option
@profile_option
@sizes_option
@click.option("--adjoint", is_flag=True, help="Measure gradients, whether the spec asks for them or not.")
@click.option("--quick", is_flag=True, help="Use fewer steps.")
@click.option("--plot", metavar="FILE", callback=file_ending(*FIGURES),
              help="Draw changes of the modified Hamiltonian of one spec: FILE.png, FILE.svg or FILE.pdf.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one object for each spec.")
@force_option
@verbosity
@pass_console
def command(
    console: Console,
    spec_files: tuple[str, ...],
    name: str | None,
    order: int | None,
    scheme: str | None,
    profile: str | None,
    sizes: str | None,
    adjoint: bool,
    quick: bool,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Build every target of specs, and measure whether the solvers have the promised properties.

    The command measures the observed order, the errors of Casimirs and energy, reversibility, agreement of the targets,
    and the largest step with which the solver converges. It measures the error of the Poisson identity DΦ π DΦᵀ = π∘Φ
    for a step Φ with the exact derivative DΦ. It also measures the drift of errors: the largest error in the last tenth
    of the run, divided by that in the first tenth. Classical methods are measured for comparison. Exit code 5 if a
    measurement misses its bound.
    """
    from phigen.compiler import compile_proved
    from phigen.runtime.origin import origin_of

    collector, verifications = Collector(), []
    specs = load_all(spec_files, collector)
    if plot:
        from phigen.drawing.palette import require_matplotlib

        require_matplotlib()
        if len(specs) > 1:
            raise click.BadParameter(f"--plot takes one spec, not {len(specs)}", param_hint="--plot")
    for source in specs:
        with collector.collecting():
            spec = resized(source, name, sizes)
            if plot:
                expect_system(spec)
                expect_same_origin({"--plot": plot}, origin_of(spec, run_of(spec, name), "verify"))
            compilation = compile_proved(
                spec.for_running(order=order, scheme=scheme, profile=profile, adjoint=adjoint, tangent=True)
            )
            judged = verified_lattice if spec.lattice else verified
            verification = judged(compilation, name, quick, console)
            verifications.append(verification)
            if not as_json:
                print_table(verification)
            if plot:
                _draw(plot, compilation, prepared(spec, name), console)
            if verification.failures:
                collector.errors.append(missed_bounds(verification))
    if as_json:
        out_json([described(v) for v in verifications])
    collector.finish()


def _draw(path: Path, compilation: Compilation, experiment: Experiment, console: Console) -> None:
    from phigen.drawing import figures
    from phigen.runtime.origin import origin_of
    from phigen.study.backward import NotOfferedError

    origin = str(origin_of(compilation.spec, experiment.run, "verify"))

    try:
        figures.save(figures.constancy_figure(constancy_of(compilation, experiment)), path, origin)
    except (NotOfferedError, StepError) as error:
        console.warn(f"{compilation.spec.name}: the modified Hamiltonian cannot be drawn: {error}")
        return
    console.note(wrote(path))


def constancy_of(compilation: Compilation, experiment: Experiment) -> Constancy:
    """Return how much the modified Hamiltonian changes along a run: without corrections, and with 1, 2, …
    corrections.

    Raises `NotOfferedError` and `StepError`.
    """
    import numpy as np

    from phigen.api import chosen_target, solver_of
    from phigen.study import backward
    from phigen.study.methods import of_solver
    from phigen.study.verification import gauge_at

    parameters, x0 = experiment.parameters, np.array(experiment.initial)
    gauge = gauge_at(compilation, x0, parameters)
    modified = backward.modified(compilation, parameters, gauge)
    method = of_solver(solver_of(compilation, chosen_target("auto")), parameters, gauge)
    return backward.constancy(modified, method, x0, experiment.h)


def verified(
    compilation: Compilation, name: str | None, quick: bool, console: Console, targets: Sequence[str] = ()
) -> Verification:
    """Verify a compilation on a run of its spec. The compilation must have the tangent map of a step.

    ``targets`` are by default those of the spec; targets that Python cannot run are left out. Only whole steps are
    made, at least one. If the last step of the run is shorter, it is left out.
    """
    from phigen.api import chosen_target, solver_of
    from phigen.cli.endings import ended
    from phigen.study.classical import COMPARED
    from phigen.study.verification import verify

    spec = compilation.spec
    target_names = loadable(targets or spec.targets) or (chosen_target("auto"),)
    single = solver_of(compilation, "c") if compilation.program.single and "c" in target_names else None
    compilation = compilation.in_double
    solvers = {target: solver_of(compilation, target) for target in target_names}
    console.detail(f"{spec.name}: built {', '.join(solvers)}")
    experiment = ended(prepared(spec, name), next(iter(solvers.values())), console)
    run = experiment.run
    return verify(
        compilation, solvers, run.name, experiment.initial, experiment.parameters, experiment.h, max(1, run.steps),
        run.compare or COMPARED, t0=experiment.t0, quick=quick, single=single,
    )  # fmt: skip


def verified_lattice(
    compilation: Compilation, name: str | None, quick: bool, console: Console, targets: Sequence[str] = ()
) -> Verification:
    """Verify the compilation of a lattice, on a run of its spec."""
    from phigen.api import chosen_target, lattice_solver_of
    from phigen.cli.endings import ended
    from phigen.cli.lattice_experiment import LatticeExperiment
    from phigen.lattice.states import start_of
    from phigen.study.lattice_verification import verify_lattice

    spec = compilation.spec
    run = run_of(spec, name)
    start = start_of(spec, run)
    target_names = loadable(targets or spec.targets) or (chosen_target("auto"),)
    single = lattice_solver_of(compilation, "c") if compilation.program.single and "c" in target_names else None
    compilation = compilation.in_double
    solvers = {target: lattice_solver_of(compilation, target) for target in target_names}
    console.detail(f"{spec.name}: built {', '.join(solvers)}")
    experiment = LatticeExperiment(run, (), start.arguments, start=start)
    steps = max(1, ended(experiment, next(iter(solvers.values())), console).run.steps)
    begin = float(run.start) if spec.time else None
    seed = run.seed if spec.noise else None
    run_options: dict[str, Any] = {"t0": begin, "seed": seed, "quick": quick, "single": single}
    return verify_lattice(compilation.by_sweeps(), solvers, run.name, start, float(run.step), steps, **run_options)


def missed_bounds(verification: Verification) -> CheckError:
    """Return the error that lists the checks whose measured value misses its bound."""
    lines = [f"{verification.name}: verification failed", *(f"  {f}" for f in verification.failures)]
    return CheckError("\n".join(lines))


def print_table(v: Verification) -> None:
    """Print the checks as a table."""
    from phigen.geometry.conservation import stated

    out(heading(f"{v.name}, run {v.run}") + f": {v.label}")
    out(f"  {v.made}, targets {', '.join(v.targets)}")
    rows = [["", "phigen", "required", "", *v.compared]]
    rows += [_row(check, v.compared) for check in v.checks]
    for line in table(rows, right=[1, *range(4, 4 + len(v.compared))]):
        out(f"  {line}")
    out(f"  {v.said or stated(v.units)}\n")


def _row(check: Check, compared: Sequence[str]) -> list[str]:
    verdict = "" if not check.limit else "ok" if check.passed else "FAILED"
    other_values = [_formatted_value(check.others[m]) if m in check.others else "" for m in compared]
    return [check.name, _formatted_value(check.value), check.limit, verdict, *other_values]


def _formatted_value(value: float) -> str:
    if math.isnan(value):
        return "–"
    if not math.isfinite(value):
        return _NOT_FINITE[value]
    return f"{value:.2f}" if 0.01 <= abs(value) < 1000 else f"{value:.1e}" if value else "0"


def described(v: Verification) -> dict[str, Any]:
    """Return the verification as data for JSON; numbers that are not finite become null."""
    from phigen.cli.run_summary import finite

    data: dict[str, Any] = finite(asdict(v))
    return {**data, "passed": not v.failures, "failures": v.failures}
