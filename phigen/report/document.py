"""Page of a spec: the sections in order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from markupsafe import Markup

from phigen.compilation import Compilation
from phigen.notation.mathml import math, name
from phigen.report import evidence, page
from phigen.report.drawable import NO_FIGURES, drawable
from phigen.report.live import live_section, script
from phigen.report.material import Material
from phigen.report.method import method_section
from phigen.report.modified import modified_section
from phigen.report.precision import precision_section
from phigen.report.system import system_section
from phigen.report.viewer import viewer

#: Largest number of characters of the spec that the page shows.
SOURCE = 100_000


def document(material: Material) -> str:
    """Return the HTML of the page; ``material`` is its content."""
    spec = material.compilation.spec
    solvers = script(material.live) if material.live and material.live.solvers else ""
    return page.page(
        f"{spec.title or spec.name} – phigen", lead(material.compilation), list(_sections(material)), solvers
    )


def lead(compilation: Compilation) -> Markup:
    """Return the head of the page: its title, the description of the spec, and the references."""
    spec = compilation.spec
    return page.block(
        "lead",
        kind=f"Poisson system {spec.name}, solver of order {compilation.order.order} by phigen",
        title=spec.title or spec.name,
        paragraphs=[p for p in spec.description.split("\n") if p.strip()],
        references=spec.references,
    )


def _sections(material: Material) -> Iterator[tuple[str, str, Markup]]:
    if material.live:
        yield "live", "Live", live_section(material.compilation, material.live)
    yield "brief", "Summary", evidence.brief_section(material)
    yield "system", "System", system_section(material.compilation.system)
    yield "choices", "Method", evidence.choices_section(material.compilation)
    yield "method", "Formulas of the method", method_section(material.compilation)
    yield "proofs", "Proofs", evidence.proofs_section(material)
    if material.verification:
        yield "measured", "Measurements", evidence.measured_section(material.verification)
        yield "modified", "Modified Hamiltonian", modified_section(material.constancy, material.no_constancy)
    if material.methods:
        yield "run", "Run", page.joined(_run(material))
    if material.study:
        yield "precision", "Precision and time", precision_section(material.study)
    yield "provenance", "Provenance", page.joined(provenance(material))


def _run(material: Material) -> Iterator[Markup]:
    run, first = material.run, next(iter(material.methods.values()))
    if run is None:
        return
    last = int(np.flatnonzero(np.isfinite(first.x).all(axis=1))[-1])
    start, end = (_values(dict(zip(first.coordinates, first.x[row].tolist(), strict=True))) for row in (0, last))
    storage_note = "all stored" if run.stride == 1 else f"one in {run.stride} stored"
    storage_note = storage_note if run.every is None else f"states stored at times {float(run.every):.9g} apart"
    storage_note = f"states stored at {len(run.at)} given times" if run.at else storage_note
    pairs = [("run", run.name), ("start", start)]
    if run.description:
        pairs.insert(1, ("description", run.description))
    if first.parameters:
        pairs.append(("parameters", _values(first.parameters)))
    pairs += [("integrated", f"{material.steps}, {storage_note}"), (f"t = {first.t[last]:.9g}", end)]
    yield page.facts(pairs)
    yield evidence.summary_table(material.summaries)
    if material.spectrum:
        yield evidence.lyapunov_paragraph(material.spectrum)
    if not drawable():
        yield page.paragraph(NO_FIGURES, "note")
        yield viewer(material.methods, material.opening, material.compilation.system.casimirs)
        return
    from phigen.report import pictures

    yield pictures.error_picture(material)
    yield page.heading("In phase space")
    yield viewer(material.methods, material.opening, material.compilation.system.casimirs)
    yield pictures.trajectory_picture(material.compilation, first)
    if material.section is not None:
        yield pictures.section_picture(first.coordinates, *material.section)
    if material.spectrum:
        yield pictures.lyapunov_picture(material.spectrum)


def _values(values: Mapping[str, float]) -> Markup:
    """Return names with their values as one line, such as ``x_1 = 0.5, x_2 = 1``."""
    equations = (
        Markup("{} = {}").format(Markup(math(name(n))), f"{v:.9g}".replace("-", "−")) for n, v in values.items()
    )
    return Markup(", ").join(equations)


def provenance(material: Material) -> Iterator[Markup]:
    """Return the section on provenance: the version, the spec, the command, and the machine of the measurements."""
    spec = material.compilation.spec
    pairs = [
        ("phigen", material.compilation.program.version),
        ("spec", spec.name),
        ("sha256 of the spec", spec.source_sha256),
        ("command", material.command),
        *material.environment.items(),
    ]
    yield page.facts(pairs)
    cut = "" if len(spec.source) <= SOURCE else f", the first {SOURCE} of {len(spec.source)} characters"
    yield page.fold(f"The spec{cut}", page.block("source", name="The spec", text=spec.source[:SOURCE]))
