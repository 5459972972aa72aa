"""Makes docs/gallery.md and its figures from the bundled specs: python docs/make_gallery.py [NAME …]"""

from __future__ import annotations

import html
import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from phigen import resources, spec
from phigen.api import compilation_of, lattice_solver_of, solver_of
from phigen.cli.list import kind_of_structure
from phigen.cli.show import readable_one
from phigen.drawing import figures
from phigen.drawing.groups import groups
from phigen.drawing.lattice_figures import lattice_figure
from phigen.drawing.palette import save_for_pages
from phigen.drawing.phase_space import joins
from phigen.lattice.states import start_of as start_of_lattice
from phigen.notation.cell_formulas import described, sections
from phigen.paper.runge_kutta import started
from phigen.runtime.interface import BackendError
from phigen.runtime.sections import function_of
from phigen.runtime.session import rows_along
from phigen.runtime.solver import Solver
from phigen.runtime.trajectory import Trajectory
from phigen.spec.model import Run, Spec
from phigen.study.lattice_errors import errors_of
from phigen.study.methods import of_classical
from phigen.study.race import TABLEAUX
from phigen.study.summary import Summary, summarise

DOCS = Path(__file__).resolve().parent
PAGE, FACTS, FIGURES = DOCS / "gallery.md", DOCS / "figures" / "gallery.json", DOCS / "figures" / "gallery"
#: Largest numbers of steps in a figure of a run, and of crossings in a Poincaré section.
DRAWN, CROSSINGS = 1500, 1500
#: A trajectory that winds too fast for its rows is drawn over half the time, again and again while it has more rows.
SHORTEST = 100
#: Rows in the diagram of a lattice, and in the curves of its errors.
SMALL, FRAMES = 80, 200
#: The width of the small pictures in pixels: four beside each other on a page of GitHub.
THUMBNAIL = 190
#: The largest number of characters of a formula; longer ones are shown as "…".
LONGEST = 160
HEAD = """# Gallery

phigen ships the systems of this page. Each picture links to the entry of its system below. `phigen run NAME` integrates
a system, `phigen show NAME` prints its formulas, and `cp "$(phigen list --path NAME)" .` copies its spec, as a start
for your own spec.
"""
SYSTEMS = """
## Systems

Each figure shows one run: of the runs in the spec, the one with the most steps. Of a long run, the figure shows at most
the first 1500 steps. A dot marks the initial state. If a system has three coordinates, the figure also shows the level
surface of its first Casimir. The line below the formulas names the form of the brackets π, the method, and the run. The
page on the mathematics explains the [forms of π and the bi-realisations](mathematics.md#catalogue),
[splittings](mathematics.md#splitting) and [Gauss collocation](mathematics.md#gauss-collocation).

The tables list the largest errors over the whole run. The first column of numbers is for phigen. If there is a second
column of numbers, it is for the classical method that the spec names, with the same step size. Errors are relative to
the initial value, unless the initial value is nearly 0. "H, balance" is the error of the energy balance of a system
with time, forces or damping: the error of H minus the work done. "H, change" is the largest change of H in a run with
noise.
"""
LATTICES = """

## Lattices

The entries of this section are systems of many identical sites, of any size ([lattices.md](lattices.md)). Each figure
shows one run: its fields over space and time, or at selected times, and the errors of its conserved quantities. Errors
of energy and invariants are relative to the initial value. If the initial value is nearly 0, they are relative to the
sum of the magnitudes of the terms at all sites. For Casimirs at sites, the error is that of the site with the largest
error.
"""


def names() -> list[str]:
    """Names of the systems that are no lattices, in the order of `phigen list`."""
    return [name for name, path in resources.bundled().items() if path.parent == resources.bundled_specs()]


def lattices() -> list[str]:
    """Names of the lattices, in the order of `phigen list`."""
    return [name for name, path in resources.bundled().items() if path.parent != resources.bundled_specs()]


def source(name: str) -> Spec:
    """The bundled spec ``name``."""
    return spec.load(resources.bundled()[name])


def longest_run(specification: Spec) -> Run:
    """The run with the most steps; the first of several."""
    return max(specification.runs.values(), key=lambda run: run.steps)


def start_of(specification: Spec, run: Run) -> float | None:
    """The time at the start of a run, None without a time."""
    return float(run.start) if specification.time else None


def seed_of(specification: Spec, run: Run) -> int | None:
    """The seed of the noise of a run, None without noise."""
    return run.seed if specification.noise else None


def facts(name: str) -> dict[str, Any]:
    """Facts on a system for its entry: structure, method, formulas, and errors of its longest run."""
    specification = source(name)
    compilation = compilation_of(specification)
    solver, run = solver_of(compilation), longest_run(specification)
    parameters = specification.parameters_of(run)
    x0, h = np.array([float(v) for v in run.initial]), float(run.step)
    arguments: dict[str, Any] = {
        "t0": start_of(specification, run),
        "seed": seed_of(specification, run),
        "parameters": parameters,
    }
    trajectory = solver.integrate(x0, h, run.steps, run.stride, **arguments)
    summaries = [summarise("phigen", compilation.system, run, parameters, trajectory.t, trajectory.x)]
    for method in [m for m in run.compare if m in TABLEAUX]:
        try:
            if specification.time:
                x = of_classical(method, solver, parameters, float(run.start)).rows(x0, h, run.steps, run.stride)
            else:
                x = rows_along(started(method, compilation, x0, parameters), h, run.steps, run.stride, None)
        except BackendError as error:
            x = error.states
        summaries.append(summarise(method.upper(), compilation.system, run, parameters, trajectory.t[: len(x)], x))
    return {
        "sha256": specification.source_sha256,
        "structure": kind_of_structure(specification),
        "method": compilation.label,
        "order": solver.order,
        "hamiltonian": readable_one(compilation.system.hamiltonian, None),
        "casimirs": {c: readable_one(e, None) for c, e in compilation.system.casimirs.items()},
        "run": run.name,
        "errors": {summary.method: _errors(summary) for summary in summaries},
    }


def _errors(summary: Summary) -> dict[str, float]:
    energy = "H, change" if summary.energy.unit.moves else "H"
    energy = energy if math.isnan(summary.off) else "H, balance"
    drifts = {energy: summary.energy, **summary.casimirs, **summary.invariants}
    if summary.exact:
        drifts["solution"] = summary.exact
    return {quantity: drift.error for quantity, drift in drifts.items()}


def draw(name: str) -> None:
    """Draw the figures of a system."""
    specification = source(name)
    compilation = compilation_of(specification)
    solver, run = solver_of(compilation), longest_run(specification)
    parameters = specification.parameters_of(run)
    # Many panels make a large file: from five dimensions on fewer steps, from ten on no level surfaces.
    steps = min(run.steps, DRAWN if specification.dimension <= 4 else DRAWN // 2)
    casimirs = compilation.system.casimirs if specification.dimension <= 9 else {}
    arguments: dict[str, Any] = {
        "t0": start_of(specification, run),
        "seed": seed_of(specification, run),
        "parameters": parameters,
    }
    trajectory = solver.integrate(run.initial, float(run.step), steps, **arguments)
    while len(trajectory) > SHORTEST and not _is_curve(trajectory):
        trajectory = solver.integrate(run.initial, float(run.step), trajectory.steps // 2, **arguments)
    save_for_pages(figures.trajectory_figure(trajectory, casimirs), FIGURES / f"{name}.svg")
    if sections := _sections(specification, solver):
        save_for_pages(figures.section_figure(sections, solver.coordinates), FIGURES / f"{name}_section.svg")


def _is_curve(trajectory: Trajectory) -> bool:
    """Whether the rows in every panel are close enough to be drawn as a curve."""
    panels = groups(trajectory.coordinates)
    return all(joins(trajectory.x[:, [trajectory.coordinates.index(c) for c in panel]]) for panel in panels)


def _sections(specification: Spec, solver: Solver) -> dict[str, Any]:
    """Crossings of each run that has a section. In three dimensions these are isolated points, and are left out."""
    sections = {}
    for run in specification.runs.values():
        if run.section is not None and (specification.dimension > 3 or specification.time):
            parameters = specification.parameters_of(run)
            g, begin = (
                function_of(run.section, solver.coordinates, parameters, specification.time),
                start_of(specification, run),
            )
            points = solver.section(run.initial, float(run.step), run.steps, g, t0=begin, parameters=parameters).x
            sections[f"{run.name}: {readable_one(run.section, None)} = 0"] = points[:CROSSINGS]
    return sections


def lattice_facts(name: str) -> dict[str, Any]:
    """Facts on a lattice for its entry; also draws its figure."""
    specification = source(name)
    compilation = compilation_of(specification)
    solver, run = lattice_solver_of(compilation), longest_run(specification)
    start = start_of_lattice(specification, run)
    arguments: dict[str, Any] = {
        "seed": seed_of(specification, run),
        "t0": float(run.start) if specification.time else None,
    }
    trajectory = solver.integrate(
        start.state, float(run.step), run.steps, run.stride, parameters=start.arguments, **arguments
    )
    errors = errors_of(compilation.cell, trajectory)
    thin = max(1, len(trajectory) // FRAMES)
    rows = {name: getattr(trajectory, name)[::thin] for name in ("t", "x", "energy", "observed")}
    few = replace(trajectory, **rows)
    names = run.lattice.names if run.lattice else ()
    thin_errors = {quantity: e[::thin] for quantity, e in errors.items()}
    figure = lattice_figure(few, thin_errors, "", dots=SMALL, site_names=names)
    save_for_pages(figure, FIGURES / f"{name}.svg")
    return {
        "sha256": specification.source_sha256,
        "structure": described(compilation.cell),
        "method": compilation.label,
        "order": solver.order,
        "formulas": [
            f"{left} = {right}" for _, lines in sections(compilation.cell, None)[1:-1] for left, right in lines
        ],
        "run": run.name,
        "sites": list(start.sizes),
        "errors": {"phigen": {quantity: float(e.max()) for quantity, e in errors.items()}},
    }


def page(facts_by_name: dict[str, dict[str, Any]]) -> str:
    """Text of the page, from the specs and from the facts on each."""
    rows = [f"| [{name}](#{name}) | {facts_by_name[name]['structure']} | {source(name).title} |" for name in lattices()]
    more = "\n".join([LATTICES, "| spec | sites | system |", "|---|---|---|", *rows])
    entries = [_lattice_entry(source(name), facts_by_name[name]) for name in lattices()]
    return "\n".join([_systems(facts_by_name), more, *entries])


def thumbnail(name: str) -> str:
    """Small figure of a system, as a link to its entry."""
    title = html.escape(source(name).title)
    image = f'<img src="figures/gallery/{name}.svg" width="{THUMBNAIL}" alt="{title}" title="{title}">'
    return f'<a href="#{name}">{image}</a>'


def _systems(facts_by_name: dict[str, dict[str, Any]]) -> str:
    rows = [f"| [{name}](#{name}) | {len(source(name).coordinates)} | {source(name).title} |" for name in names()]
    contents = "\n".join(["| spec | dimension | system |", "|---|---|---|", *rows])
    return "\n".join(
        [
            HEAD,
            *map(thumbnail, [*names(), *lattices()]),
            SYSTEMS,
            contents,
            *(_entry(source(name), facts_by_name[name]) for name in names()),
        ]
    )


def _method(label: str) -> str:
    """Return the name of a method. The label of a series names only its bi-realisation."""
    if label.startswith(("splitting", "Gauss")):
        return label
    kind, _, rest = label.partition(", ")
    return f"series with the bi-realisation `{kind}`{' ' + rest if rest else ''}"


def _lattice_entry(specification: Spec, fact: dict[str, Any]) -> str:
    run = longest_run(specification)
    image = f"![{specification.title}: a run over space and time](figures/gallery/{specification.name}.svg)"
    method_text = f"Lattice: {fact['structure']}. Method: {_method(fact['method'])}, order {fact['order']}."
    length = (
        f"Run `{run.name}`: {' × '.join(map(str, fact['sites']))} sites, {run.steps} steps of size {float(run.step):g}."
    )
    formulas = [line if len(line) <= LONGEST else line.split(" = ")[0] + " = …" for line in fact["formulas"]]
    return "\n\n".join(
        ["", f"## {specification.name}", f"**{specification.title}.** {specification.description}", image,
         "```text\n" + "\n".join(formulas) + "\n```", f"{method_text} {length}", _table(fact["errors"])]
    )  # fmt: skip


def _entry(specification: Spec, fact: dict[str, Any]) -> str:
    run = longest_run(specification)
    images = [f"![{specification.title}: a trajectory](figures/gallery/{specification.name}.svg)"]
    if (FIGURES / f"{specification.name}_section.svg").exists():
        images.append(f"![{specification.title}: a Poincaré section](figures/gallery/{specification.name}_section.svg)")
    lines = [f"H = {fact['hamiltonian']}", *(f"{name} = {e}" for name, e in fact["casimirs"].items())]
    formulas = [line if len(line) <= LONGEST else line.split(" = ")[0] + " = …" for line in lines]
    method_text = f"π: {fact['structure']}. Method: {_method(fact['method'])}, order {fact['order']}."
    length = f"Run `{run.name}`: {run.steps} steps of size {float(run.step):g}."
    return "\n\n".join(
        ["", f"## {specification.name}", f"**{specification.title}.** {specification.description}", "\n".join(images),
         "```text\n" + "\n".join(formulas) + "\n```", f"{method_text} {length}", _table(fact["errors"])]
    )  # fmt: skip


def _table(errors: dict[str, dict[str, float]]) -> str:
    head = ["largest error", *errors]
    quantities = next(iter(errors.values()))
    body = [[q, *(_shown(column[q]) for column in errors.values())] for q in quantities]
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *body])


def _shown(error: float) -> str:
    """Two digits of an error, or "round-off": digits of rounding errors differ from compiler to compiler."""
    return "round-off" if error < 1e-12 else f"{error:.1e}" if np.isfinite(error) else "breaks down"


def main(chosen: list[str]) -> None:
    """Write the facts and figures of the chosen systems, or of all, and then the page."""
    FIGURES.mkdir(parents=True, exist_ok=True)
    for stray in FIGURES.glob("*.svg"):
        if not chosen:
            stray.unlink()
    facts_by_name = json.loads(FACTS.read_text(encoding="utf-8")) if FACTS.exists() else {}
    for name in chosen or [*names(), *lattices()]:
        print(name, file=sys.stderr)
        if name in lattices():
            facts_by_name[name] = lattice_facts(name)
        else:
            facts_by_name[name] = facts(name)
            draw(name)
    facts_by_name = {name: facts_by_name[name] for name in [*names(), *lattices()]}
    FACTS.write_text(json.dumps(facts_by_name, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(page(facts_by_name), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
