"""``phigen compare``: bi-realisations, schemes and classical methods, compared on a run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen.cli.arguments import FIGURES, file_ending, one_spec, run_option, settings_option
from phigen.cli.console import Console, heading, out, out_json, pass_console, table, verbosity
from phigen.cli.existing import expect_same_origin, force_option, wrote
from phigen.cli.experiment import run_of
from phigen.cli.sources import load_one
from phigen.cli.tune import initial_value_problem
from phigen.errors import SpecError

if TYPE_CHECKING:
    from phigen.spec.model import Run, Spec
    from phigen.tuning.comparison import ComparedMethod, Comparison


@click.command("compare")
@one_spec
@run_option
@click.option("--orders", metavar="N,…", default="2,4", show_default=True, help="Orders of the methods.")
@click.option(
    "--equal", type=click.Choice(["step", "work"]), default="step", show_default=True,
    help="What all methods share: the step of the run, or the CPU time that the setting of the spec needs "
    "with this step.",
)  # fmt: skip
@click.option("--horizon", type=float, metavar="T", help="Length of the run in time.  [default: as in the spec]")
@settings_option
@click.option(
    "--budget", type=float, default=60.0, show_default=True, metavar="SECONDS", help="Time limit for building solvers."
)
@click.option("--plot", metavar="FILE", callback=file_ending(*FIGURES),
              help="Draw errors against cost: FILE.png, FILE.svg or FILE.pdf.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print all measurements as JSON.")
@force_option
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    name: str | None,
    orders: str,
    equal: str,
    horizon: float | None,
    settings: tuple[str, ...],
    budget: float,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Compare bi-realisations, schemes and classical methods on a run of a spec.

    The table lists steps, CPU time, the errors of energy and Casimirs, the distance from the solution, and the Poisson
    defect. For a step Φ with the exact derivative DΦ, this defect is the largest entry of DΦ π DΦᵀ − π∘Φ. Methods that
    do not apply to the system are left out.
    """
    from phigen.compiler import compile_proved
    from phigen.runtime.origin import origin_of
    from phigen.tuning.comparison import compare

    for value, option in ((horizon, "--horizon"), (budget, "--budget")):
        if value is not None and not (value > 0 and math.isfinite(value)):
            raise click.BadParameter(f"{value!r} is not a positive number", param_hint=option)
    compared_orders = _orders(orders)
    if plot:
        from phigen.drawing.palette import require_matplotlib

        require_matplotlib()
    spec = load_one(spec_file)
    _expect_comparable(spec)
    origin = origin_of(spec, run_of(spec, name), "compare")
    expect_same_origin({"--plot": plot}, origin)
    compilation = compile_proved(spec.for_running(tangent=spec.lattice is None))
    run, problem = initial_value_problem(console, compilation, name, settings, horizon, "energy")
    result = compare(compilation, problem, compared_orders, equal=equal, budget=budget, note=console.note)
    if as_json:
        out_json(_described(result, spec, run))
    else:
        _print(result, spec, run)
    if plot:
        from phigen.drawing import comparison, figures

        figures.save(comparison.figure(result, f"{spec.name}, run {run.name}"), plot, str(origin))
        console.note(wrote(plot))


def _orders(text: str) -> tuple[int, ...]:
    entries = [word.strip() for word in text.split(",")]
    if not all(word.isdecimal() and 1 <= int(word) <= 16 for word in entries):
        raise click.BadParameter(f"{text!r} is not a list of orders from 1 to 16, such as 2,4,8", param_hint="--orders")
    return tuple(dict.fromkeys(int(word) for word in entries))


def _expect_comparable(spec: Spec) -> None:
    """Raise `SpecError` for systems whose energy is not conserved: methods are compared by their energy errors."""
    for key, is_present in (("noise", spec.noise), ("time", spec.time), ("forces", spec.forces)):
        if is_present:
            place = ("damping",) if key == "forces" and ("damping",) in spec.locations else (key,)
            message = f"phigen compare needs a system that conserves its energy, and {place[0]} changes the energy"
            raise SpecError([spec.diagnostic(place, message, "phigen verify and phigen run measure one setting")])


def _print(comparison: Comparison, spec: Spec, run: Run) -> None:
    from phigen.tuning.building import LATE

    comparison_text = "the same step" if comparison.equal == "step" else "the same CPU time"
    out(
        heading(f"{spec.name}, run {run.name}")
        + f": {comparison_text}, up to {comparison.clock} = {comparison.horizon:.9g}\n"
    )
    rows = [["", "steps", "ns/step", "run, ms", "energy error", "Casimir error", "orbit error", "Poisson defect"]]
    rows += [_row(entry) for entry in comparison.entries if not entry.refusal]
    for line in table(rows, right=range(1, 8)):
        out(f"  {line}")
    out(f"\n  * the setting of the spec. Energy errors are {comparison.unit}; orbit errors are distances from an orbit")
    out(
        "  by DOP853 with small steps, relative to its largest coordinate. The Poisson defect is relative to "
        "|DΦ| |π| |DΦ|ᵀ."
    )
    refused = [entry for entry in comparison.entries if entry.refusal]
    for reason in dict.fromkeys(entry.refusal for entry in refused):
        titles = "; ".join(entry.title for entry in refused if entry.refusal == reason)
        hint = "; try a larger --budget" * (reason == LATE)
        out(f"  Not measured, since {reason}{hint}: {titles}.")


def _row(entry: ComparedMethod) -> list[str]:
    errors = (entry.error, entry.casimirs, entry.orbit, entry.defect)
    numbers = ["–" if e is None else f"{e:.1e}" if e else "0" for e in errors]
    title = f"{entry.title} *" if entry.own else entry.title
    return [title, str(entry.steps), f"{entry.nanoseconds:.3g}", f"{1e3 * entry.seconds:.3g}", *numbers]


def _described(comparison: Comparison, spec: Spec, run: Run) -> dict[str, object]:
    from dataclasses import asdict

    from phigen.cli.run_summary import finite

    entries = [{**asdict(entry), "seconds": entry.seconds} for entry in comparison.entries]
    document = {
        "name": spec.name,
        "run": run.name,
        "equal": comparison.equal,
        "horizon": comparison.horizon,
        "unit": comparison.unit,
    }
    described: dict[str, object] = finite({**document, "methods": entries})
    return described
