"""``phigen report``: an HTML page about a spec and its solver, with proofs and measurements."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from phigen.cli.arguments import expect_writable, one_spec, order_option, run_option, scheme_option
from phigen.cli.console import Console, out_document, pass_console, verbosity
from phigen.cli.existing import expect_replaceable, expect_same_origin, force_option, wrote
from phigen.cli.experiment import prepared, run_of
from phigen.cli.sources import load_one
from phigen.errors import CheckError
from phigen.writing import write

if TYPE_CHECKING:
    from phigen.spec.model import Spec


@click.command("report")
@one_spec
@click.option("-o", "--output", metavar="FILE", help="Where to write the page; - is stdout.  [default: NAME.html]")
@run_option
@order_option
@scheme_option
@click.option("--lyapunov", is_flag=True, help="Also compute Lyapunov exponents of the run.")
@click.option("--quick", is_flag=True, help="Use fewer steps and fewer repetitions.")
@click.option("--panel", is_flag=True, help="Write the live panel alone, for an <iframe> in a page of yours.")
@force_option
@verbosity
@pass_console
def command(
    console: Console,
    spec_file: str,
    output: str | None,
    name: str | None,
    order: int | None,
    scheme: str | None,
    lyapunov: bool,
    quick: bool,
    panel: bool,
) -> None:
    """Write one self-contained HTML page about a spec, to be read by anyone.

    The page shows the solver running beside RK4, the formulas, the choices of the compiler with their reasons, the
    proofs of `phigen check`, the measurements of `phigen verify`, figures of a run, and errors against step and time in
    comparison with classical methods. The page needs no network. Nothing is written if the mathematics of the spec is
    refuted. Exit code 5 if a measurement misses its bound; the page shows which one.
    """
    from phigen.cli.report_lattice import gathered_of_lattice
    from phigen.cli.report_material import gathered
    from phigen.compiler import examine
    from phigen.proofs.examination import refutation
    from phigen.report.document import document
    from phigen.report.lattice_page import lattice_document
    from phigen.report.page import with_origin
    from phigen.runtime.origin import origin_of

    spec = load_one(spec_file)
    if panel:
        write_panel(spec.overridden(order=order, scheme=scheme), name, output, lyapunov or quick, console)
        return
    target = output if output and output != "-" else f"{spec.name}.html"
    if output != "-":
        expect_writable(Path(target), "--output")
        expect_replaceable(Path(target), "--output")
    run = run_of(spec, name) if spec.runs or name or lyapunov else None
    origin = origin_of(spec, run, "report")
    expect_same_origin({"--output": None if output == "-" else Path(target)}, origin)
    if run is None:
        console.warn(f"{spec.file}: the spec has no runs, so the page has no measurements and no figures")
    experiment = prepared(spec, name) if run and not spec.lattice else None
    examination = examine(spec.for_running(order=order, scheme=scheme, tangent=True))
    if examination.refuted:
        raise CheckError(refutation(examination))
    if examination.compilation is None:
        raise examination.obstacle or AssertionError("the spec was neither compiled nor refused")
    console.note(f"{spec.name}: {len(examination.statements)} statements examined, none refuted")
    command_line = command_of(spec_file, target, name, order, scheme, lyapunov, quick)
    if spec.lattice:
        cell, failures = gathered_of_lattice(
            examination, examination.compilation.by_sweeps(), run, command_line, scheme, lyapunov, quick, console
        )
        page, figures = lattice_document(cell), cell.trajectory is not None
    else:
        material, failures = gathered(
            examination, examination.compilation, experiment, command_line, scheme, lyapunov, quick, console
        )
        page, figures = document(material), bool(material.methods)
    write_page(with_origin(page, str(origin)), figures, output, target, console)
    if failures:
        raise failures[0]


def write_panel(spec: Spec, name: str | None, output: str | None, measuring: bool, console: Console) -> None:
    """Write a page on which the run is computed in the browser. If ``output`` is "-", print the page instead. Raises
    `NoPanelError` if phigen cannot make this page for the spec.
    """
    from phigen.compiler import compile_proved
    from phigen.report.page import with_origin
    from phigen.report.panel import panel_page
    from phigen.runtime.origin import origin_of

    if measuring:
        raise click.UsageError("--panel measures nothing: leave out --lyapunov and --quick")
    target = output if output and output != "-" else f"{spec.name}-panel.html"
    if output != "-":
        expect_writable(Path(target), "--output")
        expect_replaceable(Path(target), "--output")
    run = run_of(spec, name)
    origin = origin_of(spec, run, "panel")
    expect_same_origin({"--output": None if output == "-" else Path(target)}, origin)
    html = with_origin(panel_page(compile_proved(spec), run), str(origin))
    if output == "-":
        out_document(html)
        return
    write(Path(target), html)
    console.note(f"{wrote(Path(target))} ({len(html) // 1000} kB)")


def command_of(
    spec_file: str, target: str, name: str | None, order: int | None, scheme: str | None, lyapunov: bool, quick: bool
) -> str:
    """Return the command that writes the page again."""
    chosen = {"run": name, "order": order, "scheme": scheme}
    options = [part for key, value in chosen.items() if value for part in (f"--{key}", str(value))]
    options += ["--lyapunov"] * lyapunov + ["--quick"] * quick
    return shlex.join(["phigen", "report", Path(spec_file).name, *options, "-o", Path(target).name])


def write_page(text: str, figures: bool, output: str | None, target: str, console: Console) -> None:
    """Write the page to the file ``target``, or to stdout if ``output`` is "-".

    A warning appears if ``figures`` are requested and matplotlib is missing.
    """
    from phigen.report.drawable import NO_FIGURES, drawable

    if figures and not drawable():
        console.warn(NO_FIGURES)
    if output == "-":
        out_document(text)
        return
    write(Path(target), text)
    console.note(f"{wrote(Path(target))} ({len(text) // 1000} kB)")
