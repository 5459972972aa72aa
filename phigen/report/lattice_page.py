"""Page of a lattice: its cell, the proofs for all sizes, and one run over space and time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup

from phigen.compilation import CompiledLattice
from phigen.drawing.lattice_figures import lattice_figure, places_of, sites_figure
from phigen.lattice.cell import Cell
from phigen.notation import mathml
from phigen.notation.cell_formulas import described, formulas
from phigen.proofs.examination import Examination
from phigen.report import evidence, page
from phigen.report.document import lead, provenance
from phigen.report.drawable import NO_FIGURES, drawable
from phigen.report.live_lattice import LatticeLive, lattice_live_section, lattice_script
from phigen.report.material import Material
from phigen.runtime.lattice import LatticeTrajectory
from phigen.spec.model import Run
from phigen.study.lyapunov import Spectrum
from phigen.study.verification import Verification
from phigen.symbolic.arrays import Floats


@dataclass(frozen=True)
class LatticeMaterial:
    """Content of the page of a lattice. Without a run, trajectory and verification are None.

    ``errors`` maps the names of conserved quantities to their errors (frames,). ``energies`` (frames, *sizes) are the
    energies of the sites. ``failure`` is the reason if the run is incomplete. ``live`` is the live panel. ``spectrum``
    contains Lyapunov exponents.
    """

    examination: Examination
    compilation: CompiledLattice
    command: str
    run: Run | None = None
    trajectory: LatticeTrajectory | None = None
    errors: Mapping[str, Floats] = field(default_factory=dict)
    energies: Floats | None = None
    verification: Verification | None = None
    failure: str = ""
    live: LatticeLive | None = None
    spectrum: Spectrum | None = None


def lattice_document(material: LatticeMaterial) -> str:
    """Return the HTML of the page."""
    spec = material.compilation.spec
    solvers = lattice_script(material.live) if material.live and material.live.solvers else ""
    title = f"{spec.title or spec.name} – phigen"
    return page.page(title, lead(material.compilation), list(_sections(material)), solvers, page.FIELDS)


def _sections(material: LatticeMaterial) -> Iterator[tuple[str, str, Markup]]:
    compilation, verification = material.compilation, material.verification
    notes = (material.failure,) if material.failure else ()
    lattice_material = Material(
        material.examination, compilation, material.command, verification=verification, notes=notes
    )
    if material.live:
        yield "live", "Live", lattice_live_section(compilation, material.live)
    yield "brief", "Summary", evidence.brief_section(lattice_material)
    yield "system", "Cell", page.joined(_cell(compilation.cell))
    yield "choices", "Method", page.joined(_method(compilation))
    yield "proofs", "Proofs", evidence.proofs_section(lattice_material)
    if verification:
        yield "measured", "Measurements", evidence.measured_section(verification)
    if material.trajectory is not None:
        yield "run", "Run", page.joined(_run(material, material.trajectory))
    yield "provenance", "Provenance", page.joined(provenance(lattice_material))


def _cell(cell: Cell) -> Iterator[Markup]:
    description = described(cell)
    yield page.paragraph(
        f"{description[0].upper()}{description[1:]}. Fields of a site: {', '.join(cell.fields)}.", "note"
    )
    for title, equations in formulas(cell):
        yield page.heading(title)
        yield page.equations(
            [
                [mathml.math(f"{left}<mo>=</mo>{first}"), *map(mathml.math, continuation)]
                for left, (first, *continuation) in equations
            ]
        )
    if cell.parameters:
        places_text = {"all": "", "sites": "at every site", "bonds": "at every bond"}
        rows = [
            (Markup(mathml.math(mathml.name(p.name))),
             [("number", "" if p.values else f"{float(p.value):.9g}"), ("", places_text[p.at]), ("", p.description)])
            for p in cell.parameters
        ]  # fmt: skip
        yield page.table("Parameters", [("", "name"), ("number", "default"), ("", ""), ("", "meaning")], rows)


def _method(compilation: CompiledLattice) -> Iterator[Markup]:
    facts = [fact.partition(": ") for fact in compilation.program.about.facts]
    yield page.facts((name if colon else "note", page.typeset(text or name)) for name, colon, text in facts)
    if flows := compilation.sweeps.flows:
        rows = [(page.typeset(f"H_{k}"), [("", flow.manner)]) for k, flow in enumerate(flows, 1)]
        yield page.table("The parts of H, and how their flows update a site", [("", "part"), ("", "flow")], rows)


def _run(material: LatticeMaterial, trajectory: LatticeTrajectory) -> Iterator[Markup]:
    run = material.run
    assert run is not None
    pairs = [("run", run.name)] + ([("description", run.description)] if run.description else [])
    pairs.append(("sites", " × ".join(map(str, trajectory.x.shape[2:]))))
    pairs.append(
        ("steps", f"{trajectory.steps} of {trajectory.h:.9g}, {len(trajectory)} frames to t = {trajectory.t[-1]:.9g}")
    )
    yield page.facts(pairs)
    rows = [(name, [("number", page.scientific(float(e.max())))]) for name, e in material.errors.items()]
    yield page.table("Largest errors along the run", [("", "quantity"), ("number", "error")], rows)
    if material.spectrum:
        yield evidence.lyapunov_paragraph(material.spectrum)
    if not drawable():
        yield page.paragraph(NO_FIGURES, "note")
        return
    from phigen.report.pictures import lyapunov_picture, picture

    if material.spectrum:
        yield lyapunov_picture(material.spectrum)

    flat, is_graph = trajectory.x.ndim == 3, places_of(trajectory) is not None
    caption = "The fields over time, with the sites upwards" if flat and not is_graph else "The fields at some times"
    caption += ", and errors of conserved quantities, on a logarithmic scale."
    if is_graph:
        caption += " The distance of two sites in the figure is close to the number of bonds between them."
    worst = ", ".join(f"{name} {page.scientific(float(e.max()))}" for name, e in material.errors.items())
    title, run = "The fields over space and time", material.run
    names = run.lattice.names if run and run.lattice else ()
    yield picture(
        "fields",
        lattice_figure(trajectory, material.errors, "", site_names=names),
        title,
        f"Largest errors: {worst}.",
        caption,
    )
    energies = material.energies
    if energies is not None:
        mean = float(np.mean(energies[-1]))
        summary = f"Energy per site at the end: mean {mean:.6g}, standard deviation {np.std(energies[-1]):.2g}."
        caption = f"{summary} Below: changes of Casimirs, the largest of all sites and the standard deviation."
        yield picture(
            "sites", sites_figure(trajectory, energies), "Energies and Casimirs of the sites", summary, caption
        )
