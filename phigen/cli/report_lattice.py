"""``phigen report`` of a lattice."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phigen.cli.console import Console
from phigen.errors import CheckError, PhigenError, StepError

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.report.lattice import LatticeMaterial
    from phigen.spec.model import Spec


def report_lattice(
    console: Console,
    spec: Spec,
    spec_file: str,
    output: str | None,
    target: str,
    name: str | None,
    order: int | None,
    scheme: str | None,
    lyapunov: bool,
    quick: bool,
) -> None:
    """Write the page of a lattice. Raises what ended its run, or the `CheckError` of what fell short, after that."""
    from phigen.cli.report import command_of, write_page
    from phigen.cli.verify import with_tangent
    from phigen.compiler import examine
    from phigen.proofs.examination import refutation
    from phigen.report.lattice import LatticeMaterial, lattice_document

    found = examine(spec, order=order, scheme=scheme, extras=with_tangent(spec))
    if found.refuted:
        raise CheckError(refutation(found))
    if found.compilation is None:
        raise found.obstacle or AssertionError("an examination without compilation has an obstacle")
    console.note(f"{spec.name}: {len(found.statements)} statements examined, none refuted")
    written = command_of(spec_file, target, name, order, scheme, lyapunov, quick)
    material, failure = LatticeMaterial(found, found.compilation, written), None
    if spec.runs or name:
        material, failure = _measured(material, found.compilation, name, scheme, lyapunov, quick, console)
    else:
        console.warn(f"{spec.file}: the spec has no runs, so the page has no measurements and no figures")
    write_page(lattice_document(material), material.trajectory is not None, output, target, console)
    if failure:
        raise failure


def _measured(
    material: LatticeMaterial,
    compilation: Compilation,
    name: str | None,
    scheme: str | None,
    lyapunov: bool,
    quick: bool,
    console: Console,
) -> tuple[LatticeMaterial, PhigenError | None]:
    """With a run and what was verified on it, and what failed."""
    from dataclasses import replace

    import numpy as np

    from phigen import registry
    from phigen.api import chosen_target, lattice_solver_of
    from phigen.cli.experiment import run_of
    from phigen.cli.lattice_run import exponents_of
    from phigen.cli.verify import fallen_short, verified_lattice
    from phigen.lattice.observing import errors_of
    from phigen.lattice.states import start_of
    from phigen.report.live_lattice import gathered_lattice
    from phigen.runtime import toolchain

    spec = compilation.spec
    run = run_of(spec, name)
    start = start_of(spec, run)
    solver = lattice_solver_of(compilation, chosen_target("auto", console.note))
    console.note(f"{spec.name}: run {run.name}, {run.steps} steps")
    failure: PhigenError | None = None
    begin = float(run.start) if spec.time else None
    try:
        made = solver.integrate(
            start.state,
            float(run.step),
            run.steps,
            run.stride,
            t0=begin,
            seed=run.seed if spec.noise else None,
            parameters=start.arguments,
        )
    except StepError as error:
        failure, made = error, error.trajectory
    assert compilation.cell is not None
    energies = np.array(
        [
            solver.density(x, t if spec.time else None, parameters=start.arguments)
            for x, t in zip(made.x, made.t, strict=True)
        ]
    )
    material = replace(
        material, run=run, trajectory=made, errors=errors_of(compilation.cell, made), energies=energies,
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
    return replace(material, verification=verification), (fallen_short(verification) if verification.failures else None)
