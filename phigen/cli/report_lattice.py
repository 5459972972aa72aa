"""Content of the page of ``phigen report`` for lattices: one run, integrated and verified."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phigen.cli.console import Console
from phigen.errors import PhigenError, StepError

if TYPE_CHECKING:
    from phigen.compilation import CompiledLattice
    from phigen.proofs.examination import Examination
    from phigen.report.lattice_page import LatticeMaterial
    from phigen.spec.model import Run


def gathered_of_lattice(
    examination: Examination,
    compilation: CompiledLattice,
    run: Run | None,
    command_line: str,
    scheme: str | None,
    lyapunov: bool,
    quick: bool,
    console: Console,
) -> tuple[LatticeMaterial, list[PhigenError]]:
    """Integrate a run of the lattice and verify the solver. Return the content of the page, and the errors that
    occurred.

    Without a run, nothing is integrated or verified.
    """
    from phigen.report.lattice_page import LatticeMaterial

    material = LatticeMaterial(examination, compilation, command_line)
    if run is None:
        return material, []
    material, failure = _measured(material, compilation, run, scheme, lyapunov, quick, console)
    return material, [failure] if failure else []


def _measured(
    material: LatticeMaterial,
    compilation: CompiledLattice,
    run: Run,
    scheme: str | None,
    lyapunov: bool,
    quick: bool,
    console: Console,
) -> tuple[LatticeMaterial, PhigenError | None]:
    """Integrate a run and verify the solver. Return the content with the results, and an error or None.

    The error says that a step failed, or that a measurement missed its bound.
    """
    from dataclasses import replace

    import numpy as np

    from phigen import registry
    from phigen.api import chosen_target, lattice_solver_of
    from phigen.cli.endings import ended, timed
    from phigen.cli.lattice_experiment import LatticeExperiment
    from phigen.cli.lattice_run import exponents_of
    from phigen.cli.verify import missed_bounds, verified_lattice
    from phigen.lattice.states import start_of
    from phigen.report.live_lattice import gathered_lattice
    from phigen.runtime import toolchain
    from phigen.study.lattice_errors import errors_of

    spec = compilation.spec
    start = start_of(spec, run)
    solver = lattice_solver_of(compilation, chosen_target("auto", console.note))
    experiment = LatticeExperiment(run, (), start.arguments, start=start)
    experiment = timed(ended(experiment, solver, console), solver)
    console.note(f"{spec.name}: run {run.name}, {experiment.run.steps} steps")
    failure: PhigenError | None = None
    try:
        trajectory = solver.framed(experiment.plan(solver))
    except StepError as error:
        failure, trajectory = error, error.trajectory
    energies = np.array(
        [
            solver.density(x, t if spec.time else None, parameters=start.arguments)
            for x, t in zip(trajectory.x, trajectory.t, strict=True)
        ]
    )
    material = replace(
        material, run=run, trajectory=trajectory, errors=errors_of(compilation.cell, trajectory), energies=energies,
        failure=f"The run could not be completed: {failure}." if failure else "",
        live=gathered_lattice(compilation, scheme, run, start),
    )  # fmt: skip
    if failure:
        return material, failure
    if lyapunov:
        material = replace(material, spectrum=exponents_of(console, spec, run, solver, start, start.arguments))
    console.note(f"{spec.name}: verifying")
    targets = spec.targets if toolchain.available() else (registry.automatic(compiler=False),)
    verification = verified_lattice(compilation, run.name, quick, console, targets)
    failure = missed_bounds(verification) if verification.failures else None
    return replace(material, verification=verification), failure
