"""``phigen sweep``: a run for many parameters and initial values, on the processes of a machine or a cluster."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen.cli.arguments import (
    FIGURES,
    file_ending,
    one_spec,
    order_option,
    profile_option,
    scheme_option,
)
from phigen.cli.console import Console, out_json, pass_console, verbosity
from phigen.cli.existing import expect_same_origin, force_option, wrote
from phigen.cli.sources import load_one
from phigen.registry import RUNNABLE

if TYPE_CHECKING:
    from phigen.spec.model import Spec, SweepSettings


@click.command("sweep")
@one_spec
@click.option("--sweep", "name", metavar="NAME", help="The sweep of the spec to compute.  [default: the first]")
@click.option(
    "-o", "--output", metavar="FOLDER", type=click.Path(path_type=Path), help="The Zarr store.  [default: NAME.zarr]"
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Address of a Dask cluster, tcp://…, to use instead of this machine.",
)
@click.option(
    "--workers",
    metavar="N",
    type=click.IntRange(min=1),
    help="Number of processes.  [default: one for each core, or each device]",
)
@click.option(
    "-t",
    "--target",
    type=click.Choice(["auto", *RUNNABLE]),
    help="Target that runs the members; overrides the sweep.  [default: auto]",
)
@order_option
@scheme_option
@profile_option
@click.option(
    "--plot", metavar="FILE", callback=file_ending(*FIGURES), help="Draw the results: FILE.png, FILE.svg or FILE.pdf."
)
@click.option(
    "--show",
    "shown",
    metavar="VARIABLE",
    help="The variable to draw.  [default: all observables, else one other variable]",
)
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
@force_option
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    name: str | None,
    output: Path | None,
    scheduler: str | None,
    workers: int | None,
    target: str | None,
    order: int | None,
    scheme: str | None,
    profile: str | None,
    plot: Path | None,
    shown: str | None,
    as_json: bool,
) -> None:
    """Repeat a run for many parameters, initial values or steps, and write the results to a Zarr store.

    If the store exists, only missing members are computed. xarray.open_zarr reads the store.
    """
    from phigen.cli.energy_warning import sweep_warning
    from phigen.progress import stage
    from phigen.runtime.origin import origin_of
    from phigen.sweeping.sweep import SweepSetting, made

    if scheduler and workers:
        raise click.UsageError("--workers counts processes of this machine, so it excludes --scheduler")
    if plot:
        from phigen.drawing.palette import require_matplotlib

        require_matplotlib()
    elif shown:
        raise click.UsageError("--show chooses what --plot draws: add --plot FILE")
    spec = load_one(spec_file)
    sweep = _sweep_of(spec, name)
    if shown and shown not in sweep.stored:
        stored_names = ", ".join(sweep.stored)
        raise click.BadParameter(f"{shown!r} is not stored; the sweep stores {stored_names}", param_hint="--show")
    origin = origin_of(spec, sweep, "sweep")
    expect_same_origin({"--plot": plot}, origin)
    setting = SweepSetting(output or Path(f"{sweep.name}.zarr"), scheduler, workers, target, order, scheme, profile)
    with console.watching(), stage(f"sweep {sweep.name}") as progress:

        def started(members: int) -> None:
            progress.total = members

        def tell(members: int, failed: int) -> None:
            progress.done += members

        outcome = made(spec, sweep, spec.runs[sweep.run], setting, started, tell)
    sizes = " × ".join(f"{dim} {size}" for dim, size in outcome.dims.items())
    if as_json:
        out_json({"output": str(setting.output), "members": outcome.size, "made": outcome.members,
                  "failed": outcome.failed, "dims": dict(outcome.dims)})  # fmt: skip
    else:
        failed = f", of which {outcome.failed} failed (see status)" if outcome.failed else ""
        click.echo(f"{setting.output}: {outcome.size} members ({sizes}), {outcome.members} computed now{failed}")
    energy, h = outcome.energy, float(spec.runs[sweep.run].step)
    if warning := sweep_warning(energy.count, outcome.size, energy.largest, h, outcome.order):
        console.warn(warning)
    if plot:
        from phigen.drawing.sweep_map import draw

        draw(setting.output, plot, shown, str(origin))
        console.note(wrote(plot))


def _sweep_of(spec: Spec, name: str | None) -> SweepSettings:
    """Return the sweep called ``name``, by default the first. Raises `SpecError` if the spec has no sweeps."""
    from phigen.errors import Diagnostic, SpecError

    if not spec.sweeps:
        hint = "add a sweep under sweeps:, with the keys over: and keep:; docs/sweeps.md has examples"
        raise SpecError([Diagnostic(f"{spec.file}: the spec has no sweeps", hint=hint)])
    sweep = spec.sweeps.get(name) if name else next(iter(spec.sweeps.values()))
    if sweep is None:
        sweep_names = ", ".join(spec.sweeps)
        raise click.BadParameter(f"there is no sweep {name!r}; the spec has {sweep_names}", param_hint="--sweep")
    return sweep
