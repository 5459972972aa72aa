"""``phigen check``: the mathematics of specs, statement by statement."""

from __future__ import annotations

import json
from collections import Counter
from typing import TYPE_CHECKING

import click

from phigen.cli.console import Console, heading, out, pass_console, verbosity
from phigen.cli.failures import Collector
from phigen.cli.sources import ORDER, load_all, many_specs, scheme_option
from phigen.errors import CheckError

if TYPE_CHECKING:
    from phigen.analysis.proof import Examination
    from phigen.symbolic.verdict import Statement

_COLOURS = {"proved": "green", "refuted": "red", "checked numerically": "yellow", "undecided": "yellow"}


@click.command("check")
@many_specs
@click.option("--order", metavar="K", type=ORDER, help="Order of the method, instead of the spec's.")
@scheme_option
@click.option("--json", "as_json", is_flag=True, help="For machines: one object per spec.")
@verbosity
@pass_console
def command(
    console: Console, spec_files: tuple[str, ...], order: int | None, scheme: str | None, as_json: bool
) -> None:
    """Prove the mathematics of specs, or refute it.

    π is skew and satisfies the Jacobi identity; Casimirs and invariants are what they claim to be; α and β satisfy
    the axioms of a bi-realisation; S_1 … S_k solve the Hamilton–Jacobi equation; of a splitting, each flow solves its
    own equation. Each statement is proved in exact
    arithmetic, refuted with a residual, or checked at points. Exit code 5 if anything is refuted.
    """
    from phigen.analysis.proof import examine

    collector, found = Collector(), []
    for spec in load_all(spec_files, collector):
        with collector.collecting():
            examination = examine(spec, order=order, scheme=scheme)
            found.append(examination)
            if not as_json:
                _print(examination)
            _collect(examination, collector, console)
    if as_json:
        out(json.dumps([_described(e) for e in found], indent=2, ensure_ascii=False))
    collector.finish()


def _collect(examination: Examination, collector: Collector, console: Console) -> None:
    counts = Counter(s.verdict for s in examination.statements)
    console.note(f"{examination.spec.file}: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()))
    mistakes = [s.name for _, s in examination.mistakes]
    if mistakes:
        collector.errors.append(CheckError(f"{examination.spec.file}: refuted: {'; '.join(mistakes)}"))
    elif examination.obstacle:
        collector.errors.append(examination.obstacle)


def _print(examination: Examination) -> None:
    spec = examination.spec
    out(heading(f"{spec.name}: {spec.title}" if spec.title else spec.name))
    for group, statements in examination.groups.items():
        out(f"  {group}")
        for statement in statements:
            out("\n".join(_lines(statement)))
    if examination.unexamined:
        out(f"  Not examined, since they rest on it: {examination.unexamined}")
    out("")


def _lines(statement: Statement) -> list[str]:
    verdict = click.style(f"{statement.verdict:<19}", fg=_COLOURS[statement.verdict])
    lines = [f"    {verdict}  {statement.name}"]
    if statement.detail:
        lines[0] += f" ({statement.detail})"
    if statement.residual:
        lines.append(f"    {'':<19}  residual: {statement.residual}")
    return lines


def _described(examination: Examination) -> dict[str, object]:
    listed = [
        {"group": group, "name": s.name, "verdict": s.verdict, "detail": s.detail, "residual": s.residual}
        for group, statements in examination.groups.items()
        for s in statements
    ]
    obstacle = [d.message for d in examination.obstacle.diagnostics] if examination.obstacle else []
    return {
        "name": examination.spec.name,
        "file": examination.spec.file,
        "refuted": len(examination.refuted),
        "statements": listed,
        "obstacles": obstacle,
        "unexamined": examination.unexamined,
    }
