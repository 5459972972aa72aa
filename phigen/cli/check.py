"""``phigen check``: prove or refute the statements about specs."""

from __future__ import annotations

import warnings
from collections import Counter
from math import prod
from typing import TYPE_CHECKING

import click

from phigen.cli.arguments import ORDER, many_specs, order_option, scheme_option
from phigen.cli.console import Console, heading, out, out_json, pass_console, verbosity
from phigen.cli.failures import Collector
from phigen.cli.generation import expect_target
from phigen.cli.sources import load_all
from phigen.errors import CheckError, Diagnostic, PhigenWarning, SpecError

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.proofs.examination import Examination
    from phigen.proofs.independent import Agreement
    from phigen.spec.model import Spec
    from phigen.symbolic.verdict import Statement

#: For lattices with more sites than this, initial values are not computed, so that a check needs little time and
#: memory.
MOST_SITES = 1_000_000

_COLOURS = {"proved": "green", "refuted": "red", "checked numerically": "yellow", "undecided": "yellow"}


@click.command("check")
@many_specs
@order_option
@scheme_option
@click.option("--independent", is_flag=True, help="Derive the terms S_i and the maps α, β a second time, by sympy.")
@click.option(
    "--terms",
    metavar="K",
    type=ORDER,
    help="With --independent: derive S_1 … S_K instead of those of the method.",
)
@click.option(
    "--seconds",
    metavar="T",
    type=click.FloatRange(0, min_open=True),
    help="With --independent: time limit for each spec.  [default: 60]",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one object for each spec.")
@verbosity
@pass_console
def command(
    console: Console,
    spec_files: tuple[str, ...],
    order: int | None,
    scheme: str | None,
    independent: bool,
    terms: int | None,
    seconds: float | None,
    as_json: bool,
) -> None:
    """Prove the mathematics of specs, or refute it.

    The statements: π is skew and satisfies the Jacobi identity; Casimirs and invariants are conserved; for a series,
    the maps α and β satisfy the axioms of a bi-realisation, and the terms S_1 … S_k solve the Hamilton–Jacobi equation;
    for a splitting, each flow solves its equation. Each statement is proved in exact arithmetic, refuted with a
    residual, or checked at points. Exit code 5 if any statement is refuted. With -q only statements that do not hold
    are printed. With -v all triples of coordinates that violate the Jacobi identity are printed.

    With --independent sympy derives the terms S_i a second time, by another method, and checks α and β. Results are
    printed term by term. Exit code 3 if the time limit is reached.
    """
    from phigen.compiler import examine

    if not independent and (terms or seconds):
        raise click.UsageError("--terms and --seconds need --independent")
    collector, descriptions = Collector(), list[dict[str, object]]()
    specs = load_all(spec_files, collector)
    _say_unexamined(collector, console)
    for spec in specs:
        with collector.collecting():
            examination = examine(spec, order=order, scheme=scheme)
            described = _described(examination)
            if not as_json:
                if descriptions and not console.quiet:
                    out("")
                _print(examination, console)
            _collect(examination, collector, console)
            if independent:
                compared = _compared(examination, terms, seconds, console, collector, shown=not as_json)
                described["independent"] = [_described_comparison(c) for c in compared]
            descriptions.append(described)
    if as_json:
        out_json(descriptions)
    collector.finish()


def _compared(
    examination: Examination,
    terms: int | None,
    seconds: float | None,
    console: Console,
    collector: Collector,
    *,
    shown: bool,
) -> list[Agreement]:
    """Compare the S_i, α and β of a compilation with those that sympy derives. Return the comparisons.

    If ``shown``, each comparison is printed as soon as it is complete. Refutations go to the collector.
    """
    from phigen.proofs.independent import SECONDS, compare
    from phigen.symbolic.verdict import REFUTED

    compilation, comparisons = examination.compilation, []
    if compilation is None:
        return []
    if not compilation.has_series:
        console.warn(f"{examination.spec.file}: {compilation.label} has no series to derive a second time")
        return []
    if shown:
        out("  Second derivation, by sympy alone")
    with collector.collecting():
        for comparison in compare(compilation.by_series(), terms, seconds or SECONDS):
            comparisons.append(comparison)
            if shown:
                out("\n".join(_lines(comparison.timed)))
    refuted_names = [c.statement.name for c in comparisons if c.statement.verdict == REFUTED]
    if refuted_names:
        message = f"{examination.spec.file}: refuted by the second derivation: {', '.join(refuted_names)}"
        collector.errors.append(CheckError(message))
    return comparisons


def _collect(examination: Examination, collector: Collector, console: Console) -> None:
    from phigen.proofs.examination import hint_of, unused_keys

    counts = Counter(s.verdict for s in examination.statements)
    summary = ", ".join(f"{n} {verdict}" for verdict, n in counts.items())
    console.note(f"{examination.spec.file}: {summary or 'nothing was proved'}")
    for note in examination.compilation.notes if examination.compilation else ():
        console.note(f"{examination.spec.file}: {note}")
    for warning in unused_keys(examination):
        warnings.warn(str(warning), PhigenWarning, stacklevel=2)
    mistakes = [s.name for _, s in examination.mistakes]
    if mistakes:
        hints = dict.fromkeys(hint_of(examination.spec, group) for group, _ in examination.mistakes)
        hinted = "".join(f"\n  hint: {hint}" for hint in hints if hint)
        collector.errors.append(CheckError(f"{examination.spec.file}: refuted: {'; '.join(mistakes)}{hinted}"))
    elif examination.obstacle:
        collector.errors.append(examination.obstacle)
    elif examination.compilation:
        _expect_targets(examination.spec, examination.compilation, collector)
    if examination.spec.lattice:
        _expect_starts(examination.spec, collector, console)


def _say_unexamined(collector: Collector, console: Console) -> None:
    """Report each spec that has errors: nothing was proved about it."""
    places = [d.location for e in collector.errors if isinstance(e, SpecError) for d in e.diagnostics]
    for file in dict.fromkeys(place.file for place in places if place):
        console.note(f"{file}: nothing was proved, because the spec has errors")


def _expect_starts(spec: Spec, collector: Collector, console: Console) -> None:
    """Collect errors in the initial states of the runs of a lattice, such as a list of wrong length."""
    from phigen.lattice.states import start_of

    refused: dict[str, Diagnostic] = {}
    for run in spec.runs.values():
        if run.lattice and prod(run.lattice.sizes) > MOST_SITES:
            console.note(f"{spec.file}: the start of the run {run.name} is not examined: more than {MOST_SITES} sites")
            continue
        try:
            start_of(spec, run)
        except SpecError as error:
            refused |= {str(d): d for d in error.diagnostics}
    if refused:
        collector.errors.append(SpecError(list(refused.values())))


def _expect_targets(spec: Spec, compilation: Compilation, collector: Collector) -> None:
    """Collect an error for each target of the spec that cannot generate code for the system."""
    for name in spec.targets:
        try:
            expect_target(compilation, name)
        except SpecError as error:
            collector.errors.append(error)


def _print(examination: Examination, console: Console) -> None:
    from phigen.proofs.statements import GAUSS, METHOD, SPLITTING

    spec = examination.spec
    if console.quiet and all(s.holds for s in examination.statements):
        return
    out(heading(f"{spec.name}: {spec.title}" if spec.title else spec.name))
    compilation = examination.compilation
    for group, statements in examination.groups.items():
        shown_statements = [s for s in statements if not (console.quiet and s.holds)]
        if shown_statements:
            takes_method_name = group.startswith((METHOD, SPLITTING, GAUSS))
            out(f"  {compilation.named(group) if compilation and takes_method_name else group}")
        for statement in shown_statements:
            out("\n".join(_lines(statement)))
            for part, residual in statement.failing if console.verbose else ():
                out(f"    {'':<19}  {part}: {residual}")
    if examination.unexamined:
        out(f"  Not examined, because they depend on a refuted statement: {examination.unexamined}")


def _lines(statement: Statement) -> list[str]:
    verdict = click.style(f"{statement.verdict:<19}", fg=_COLOURS[statement.verdict])
    lines = [f"    {verdict}  {statement.name}"]
    if statement.detail:
        lines[0] += f" ({statement.detail})"
    if statement.residual:
        lines.append(f"    {'':<19}  residual: {statement.residual}")
    return lines


def _described(examination: Examination) -> dict[str, object]:
    entries = [
        {"group": group, **_described_statement(s)}
        for group, statements in examination.groups.items()
        for s in statements
    ]
    obstacle = [d.message for d in examination.obstacle.diagnostics] if examination.obstacle else []
    return {
        "name": examination.spec.name,
        "file": examination.spec.file,
        **(examination.compilation.described if examination.compilation else {}),
        "refuted": len(examination.refuted),
        "statements": entries,
        "obstacles": obstacle,
        "notes": examination.compilation.notes if examination.compilation else [],
        "unexamined": examination.unexamined,
    }


def _described_statement(s: Statement) -> dict[str, object]:
    failing = {"failing": dict(s.failing)} if s.failing else {}
    return {"name": s.name, "verdict": s.verdict, "detail": s.detail, "residual": s.residual, **failing}


def _described_comparison(c: Agreement) -> dict[str, object]:
    return {"term": c.term, **_described_statement(c.statement), "seconds": {"phigen": c.compiler, "sympy": c.sympy}}
