"""Sections of a page with tables: choices of the compiler, proofs, measurements, and errors of runs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from markupsafe import Markup

from phigen.compilation import Compilation
from phigen.geometry.conservation import stated
from phigen.registry import TARGETS
from phigen.report import page
from phigen.report.material import Material
from phigen.study.lyapunov import Spectrum
from phigen.study.meanings import Meaning, meaning_of
from phigen.study.summary import Drift, Summary
from phigen.study.verification import Check, Verification
from phigen.symbolic.verdict import PROVED, REFUTED, UNDECIDED, Statement

#: Tile of the summary: CSS class, number, label, note. The number is shown in large digits.
Tile = tuple[str, str, str, str]

_GOOD, _BAD, _UNSURE = "good", "bad", "unsure"
_MARKS = {_GOOD: "✓ ", _BAD: "✗ ", _UNSURE: "~ "}


def brief_section(material: Material) -> Markup:
    """Return the summary of the page: a few numbers as tiles."""
    tiles = [_proofs_tile(material.examination.statements)]
    if material.verification:
        tiles += _measured_tiles(material.verification)
    blocks = [page.block("tiles", tiles=tiles)]
    blocks += [page.paragraph(note, "note") for note in material.notes]
    return page.joined(blocks)


def choices_section(compilation: Compilation) -> Markup:
    """Return the section on the choices of the compiler, with reasons."""
    program = compilation.program
    pairs = [
        ("Poisson tensor", str(compilation.system.shape)),
        *compilation.reasons.items(),
        ("order", str(compilation.order.order) + (f", {compilation.order.note}" if compilation.order.note else "")),
    ]
    for fact in program.about.facts:
        name, colon, text = fact.partition(": ")
        if colon and name != "bi-realisation":
            pairs.append((name, text))
        elif not colon:
            pairs.append(("note", fact))
    pairs.append((f"one {program.step.kind.unit}", program.about.counts or "nothing to compute"))
    return page.facts((name, page.typeset(text)) for name, text in pairs)


def proofs_section(material: Material) -> Markup:
    """Return the section with all statements of `phigen check`."""
    blocks, columns = [], [("", "statement"), ("verdict", "verdict"), ("", "how")]
    for group, statements in material.examination.groups.items():
        rows = [_statement(s) for s in statements]
        blocks.append(page.table(group, columns, rows, "proofs"))
    explanation = "Proved means in exact arithmetic, for all values of the coordinates, covectors and parameters."
    return page.joined([page.paragraph(explanation), *blocks])


def measured_section(v: Verification) -> Markup:
    """Return the section with all checks of `phigen verify`."""
    columns = [("", "property"), ("number", "phigen"), ("", "required"), ("verdict", "verdict")]
    columns += [("number", method) for method in v.compared]
    rows = [_check(check, v.compared) for check in v.checks]
    targets = " and ".join(TARGETS[t].title for t in v.targets)
    conditions = f"Run {v.run}: {v.made}, generated for {targets}. Solver: {v.label}."
    meanings = dict.fromkeys(meaning_of(check.name) for check in v.checks)
    title = "Measured properties of the solver" + ", and of classical methods" * bool(v.compared)
    rows_explained = page.facts((m.row, page.typeset(_meaning(m))) for m in meanings)
    return page.joined(
        [page.paragraph(conditions), page.table(title, columns, rows),
         page.paragraph(page.typeset(v.said or stated(v.units)), "note"),
         page.fold("Meaning of the rows", rows_explained)]
    )  # fmt: skip


def _meaning(m: Meaning) -> str:
    sentence = f"{m.measures[0].upper()}{m.measures[1:]}."
    return f"{sentence} A failure means: {m.failure}." if m.failure else sentence


def summary_table(summaries: Sequence[Summary]) -> Markup:
    """Return a table of the largest errors of runs, with one column for each method."""
    first = summaries[0]
    rows = [("energy H", [_drift(s.energy) for s in summaries])]
    for kind, noun in (("casimirs", "Casimir"), ("invariants", "invariant")):
        rows += [(f"{noun} {n}", [_drift(getattr(s, kind)[n]) for s in summaries]) for n in getattr(first, kind)]
    if first.exact:
        rows.append(("solution, against the closed form", [_drift(s.exact) for s in summaries if s.exact]))
    if any(s.good < s.rows for s in summaries):
        rows.append(("rows before the failure", [("number", f"{s.good} of {s.rows}") for s in summaries]))
    columns = [("", "quantity"), *(("number", s.method) for s in summaries)]
    table = page.table("Largest errors along the run", columns, rows)
    return page.joined([table, page.paragraph(page.typeset(stated(first.units)), "note")])


def lyapunov_paragraph(spectrum: Spectrum) -> Markup:
    """Return a paragraph with the Lyapunov exponents and their uncertainty."""
    exponents = ", ".join(page.scientific(v) for v in spectrum.exponents.tolist())
    late_change, duration = page.scientific(spectrum.uncertainty), f"{spectrum.clock} = {spectrum.t:.9g}"
    if len(spectrum.exponents) == 1:
        sentence = f"The largest Lyapunov exponent after {duration} is {exponents}."
        return page.paragraph(f"{sentence} The second half of the time changed it by {late_change}.")
    sentence = f"Lyapunov exponents after {duration}: {exponents}; their sum is {page.scientific(spectrum.total)}."
    uncertainty_note = f"The second half of the time changed them by {late_change}, at most."
    return page.paragraph(f"{sentence} {uncertainty_note}")


def _statement(s: Statement) -> tuple[str, list[page.Cell]]:
    kind = _GOOD if s.verdict == PROVED else _BAD if s.verdict == REFUTED else _UNSURE
    detail = s.detail + (f"; residual {s.residual}" if s.residual else "")
    return page.typeset(s.name), [(f"verdict {kind}", _MARKS[kind] + s.verdict), ("", page.typeset(detail))]


def _check(check: Check, compared: Sequence[str]) -> tuple[str, list[page.Cell]]:
    kind = "" if not check.limit else _GOOD if check.passed else _BAD
    verdict = "" if not kind else _MARKS[kind] + ("holds" if check.passed else f"failed: {check.reason}")
    cells = [("number", page.scientific(check.value)), ("", page.typeset(check.limit)), (f"verdict {kind}", verdict)]
    other_values = [("number", page.scientific(check.others[m]) if m in check.others else "") for m in compared]
    return check.name, [*cells, *other_values]


def _drift(drift: Drift) -> page.Cell:
    return "number", page.scientific(drift.error)


def _proofs_tile(statements: Sequence[Statement]) -> Tile:
    counts = Counter(s.verdict for s in statements)
    refuted_count = counts.pop(REFUTED, 0)
    kind = _BAD if refuted_count else _UNSURE if counts[UNDECIDED] else _GOOD
    unproved = "; ".join(f"{s.verdict}: {s.name}" for s in statements if s.verdict != PROVED)
    summary = f"{counts[PROVED]} of {len(statements)}"
    return (
        kind,
        summary,
        "statements proved",
        f"{refuted_count} refuted" if refuted_count else unproved or "in exact arithmetic",
    )


def _measured_tiles(v: Verification) -> Iterator[Tile]:
    judged = [c for c in v.checks if c.limit]
    passed_count = sum(c.passed for c in judged)
    kind = _GOOD if passed_count == len(judged) else _BAD
    yield kind, f"{passed_count} of {len(judged)}", "measured properties hold", v.made
    casimirs = [c for c in v.checks if c.name.startswith("Casimir") and "largest" in c.name]
    if casimirs:
        worst = max(casimirs, key=lambda c: c.value)
        label = f"largest error of {'a' if len(casimirs) > 1 else 'the'} Casimir"
        yield _tile(worst, label, {m: max(c.others.get(m, math.nan) for c in casimirs) for m in v.compared})
    for name, label in (
        ("energy: largest error", "largest error of the energy"),
        ("energy balance: largest error", "largest error of the energy balance"),
        ("observed order", "observed order"),
        ("Poisson defect", "Poisson defect of a step"),
        ("reversibility", "error after a step of h and one of −h"),
    ):
        for check in v.checks:
            if check.name.startswith(name) and not math.isnan(check.value):
                yield _tile(check, label, check.others)


def _tile(check: Check, label: str, other_values: Mapping[str, float]) -> Tile:
    defined_values = {m: v for m, v in other_values.items() if not math.isnan(v)}
    value = "exact" if check.value == math.inf else page.scientific(check.value)
    return _GOOD if check.passed else _BAD, value, label, page.listed(defined_values)
