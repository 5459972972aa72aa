"""``phigen certify``: a rigorous bound for the distance between computed steps and the exact Poisson map."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phigen.cli.arguments import one_spec, order_option, run_option, scheme_option, settings_option
from phigen.cli.console import Console, out, out_json, pass_console, table, verbosity
from phigen.cli.experiment import Experiment, prepared
from phigen.cli.generation import Options, generate
from phigen.cli.sources import load_one
from phigen.errors import CheckError

if TYPE_CHECKING:
    from phigen.spec.model import Spec

#: Half-width of the default interval of a coordinate, as a fraction of its initial value. If the initial value is
#: smaller than 1 in magnitude, the half-width is `WIDTH` itself.
WIDTH = 0.01


@click.command("certify")
@one_spec
@run_option
@order_option
@scheme_option
@click.option("--step", type=float, metavar="H", help="Step size.  [default: that of the run]")
@settings_option
@click.option(
    "--box",
    "boxes",
    multiple=True,
    metavar="NAME=LOW:HIGH",
    help="Range of a coordinate.  [default: box of the run, else the initial value ± 1 %, or ± 0.01 below 1]",
)
@click.option(
    "--time", "times", metavar="LOW:HIGH", help="Range of the time t, if H depends on t.  [default: times of the run]"
)
@click.option(
    "--ulps",
    type=click.FloatRange(0.5, 1e6),
    metavar="N",
    default=1.0,
    show_default=True,
    help="Largest error of functions of your libm, in units in the last place.",
)
@click.option(
    "--within",
    type=click.FloatRange(0, min_open=True),
    metavar="N",
    default=1000.0,
    show_default=True,
    help="Divide the box of coordinates where the bound exceeds N units in the last place.",
)
@click.option(
    "--boxes",
    "most",
    type=click.IntRange(1, 1_000_000),
    metavar="N",
    default=1000,
    show_default=True,
    help="Largest number of boxes into which the box of coordinates may be divided.",
)
@click.option(
    "--samples",
    type=click.IntRange(0, 1_000_000),
    metavar="N",
    default=100,
    show_default=True,
    help="Number of steps of the compiled C that are compared with the exact map.",
)
@click.option(
    "-o", "--output", "folder", metavar="DIR", default="certified", show_default=True, help="Folder to write."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    name: str | None,
    order: int | None,
    scheme: str | None,
    step: float | None,
    settings: tuple[str, ...],
    boxes: tuple[str, ...],
    times: str | None,
    ulps: float,
    within: float,
    most: int,
    samples: int,
    folder: str,
    as_json: bool,
) -> None:
    """Prove a bound for the distance between a step of the generated C and the exact Poisson map.

    The bound holds for all steps that begin in a box of states, for C of profile small. It is proved by ball
    arithmetic. It covers the rounding of every operation, the stopping criterion of Newton's method, and the errors of
    libm. For an implicit step, the proof shows that its equation has exactly one solution near the computed one.
    DIR/NAME receives the C, the certificate NAME.bounds.json, and a checker that verifies the certificate without
    phigen. Exit code 5 if there is no certificate for the box; the message says what to try.
    """
    from phigen.certify.checker import RefusedError
    from phigen.certify.problem import problem_of
    from phigen.certify.prove import NoCertificateError, certified, described

    spec = load_one(spec_file)
    experiment = prepared(spec, name, step=step, settings=settings)
    domain = _domain(spec, experiment, boxes)
    options = Options(targets=("c",), order=order, scheme=scheme, profile="small")
    compilation = options.compiled(spec)
    files = generate(compilation, "c", options)
    text = files[f"{spec.name}.c"]
    span = _time(spec, experiment, times)
    problem = problem_of(
        compilation, text, experiment.h, experiment.parameters, experiment.initial, domain, span, ulps, within
    )
    start = time.perf_counter()
    try:
        certificate = certified(problem, most)
    except RefusedError as error:
        hint = f"\n  hint: {error.hint}" if isinstance(error, NoCertificateError) else ""
        raise CheckError(f"{spec.file}: {error}{hint}") from None
    seconds = time.perf_counter() - start
    observed = _observed(certificate, described(problem, exact=True), files, samples, console)
    _write(console, Path(folder) / spec.name, spec.name, files, certificate, seconds)
    summary = {
        **{key: certificate[key] for key in ("name", "kind", "step", "coordinates", "domain", "boxes")},
        "bound": certificate["bound"],
        "bound_in_ulps": certificate["bound_in_ulps"],
        "observed": observed,
        "samples": samples if observed else 0,
        "seconds": seconds,
    }
    if as_json:
        out_json(summary)
        return
    out("\n".join(_lines(summary)))


def _domain(spec: Spec, experiment: Experiment, boxes: Sequence[str]) -> list[list[float]]:
    """Return the interval of each coordinate.

    ``--box`` takes precedence over ``box:`` of the run. The default is an interval around the initial value.
    """
    domain = {
        name: [value - WIDTH * max(1.0, abs(value)), value + WIDTH * max(1.0, abs(value))]
        for name, value in zip(spec.coordinates, experiment.initial, strict=True)
    }
    domain |= {name: [float(low), float(high)] for name, (low, high) in experiment.run.box.items()}
    for box in boxes:
        name, _, range_text = box.partition("=")
        if name.strip() not in domain:
            message = f"{name.strip()!r} is not a coordinate; there are {', '.join(domain)}"
            raise click.BadParameter(message, param_hint="--box")
        domain[name.strip()] = _range(range_text, "--box")
    return list(domain.values())


def _time(spec: Spec, experiment: Experiment, times: str | None) -> list[float]:
    """Return the interval of times for which the bound holds, as its two ends.

    ``times`` is the text of ``--time``. If ``times`` is None and H depends on the time, the interval is that of the
    run. If H does not depend on the time, both ends are the start of the run.
    """
    if times and not spec.time:
        raise click.UsageError("--time: H does not depend on the time")
    if times:
        return _range(times, "--time")
    start = experiment.t0
    return sorted((start, start + experiment.h * experiment.run.steps)) if spec.time else [start, start]


def _range(text: str, option: str) -> list[float]:
    low, colon, high = text.partition(":")
    try:
        bounds = [float(low), float(high if colon else low)]
    except ValueError:
        bounds = [math.nan]
    if not all(map(math.isfinite, bounds)) or bounds != sorted(bounds):
        raise click.BadParameter(f"{text!r} is not LOW:HIGH, two numbers in this order", param_hint=option)
    return bounds


def _observed(
    certificate: dict[str, Any], exact: dict[str, Any], files: dict[str, str], samples: int, console: Console
) -> list[float]:
    """Compare sampled steps of the compiled C with the exact map; return the largest distance for each
    coordinate.

    The list is empty without samples or without a C compiler. Raises `CheckError` if a distance exceeds its bound.
    """
    from phigen.certify.samples import observed
    from phigen.errors import ToolchainError
    from phigen.runtime import cache

    if not samples:
        return []
    try:
        library = cache.load(files)
    except ToolchainError as error:
        console.warn(f"no steps are compared: {error}")
        return []
    worst = observed(certificate, exact, library, samples)
    exceeding = [
        name
        for name, distance, claimed in zip(certificate["coordinates"], worst, certificate["bound"], strict=True)
        if distance > claimed
    ]
    if exceeding:
        message = f"steps of the compiled C are farther from the exact map than the bound: {', '.join(exceeding)}"
        raise CheckError(f"{certificate['name']}: {message}\n  hint: try --ulps 4, in case your libm is less accurate")
    return worst


def _write(
    console: Console, folder: Path, name: str, files: dict[str, str], certificate: dict[str, Any], seconds: float
) -> None:
    """Write the C, the certificate, and the checker to a folder."""
    from phigen.certify import checker
    from phigen.writing import write_all

    contents: dict[Path, str | bytes] = {folder / file: text for file, text in files.items()}
    contents[folder / f"{name}.bounds.json"] = json.dumps(certificate) + "\n"
    contents[folder / "checker.py"] = Path(str(checker.__file__)).read_text(encoding="utf-8")
    write_all(contents)
    console.note(
        f"wrote {folder} in {seconds:.2f} s; to check it: cd {folder}; python checker.py {name}.bounds.json {name}.c"
    )


def _lines(summary: dict[str, Any]) -> list[str]:
    observed = summary["observed"] or [None] * len(summary["bound"])
    columns = zip(
        summary["coordinates"], summary["domain"], summary["bound"], summary["bound_in_ulps"], observed, strict=True
    )
    rows = [("coordinate", "from", "to", "bound", "in ulps", "observed")]
    rows += [
        (
            name,
            f"{low:.6g}",
            f"{high:.6g}",
            _two_digits(claimed),
            _two_digits(ulps),
            "" if observed_text is None else _two_digits(observed_text),
        )
        for name, (low, high), claimed, ulps, observed_text in columns
    ]
    boxes = "1 box" if summary["boxes"] == 1 else f"{summary['boxes']} boxes"
    title = f"{summary['name']}: distance of a step of {summary['step']:g} from the exact map, certified over {boxes}"
    return [title, *(f"  {line}" for line in table(rows, right=(1, 2, 3, 4, 5)))]


def _two_digits(value: float) -> str:
    """Return a bound as text with two digits.

    Bounds below 1e-300 become "0": they belong to coordinates that do not change.
    """
    return f"{value:.2g}" if value > 1e-300 else "0"
