"""Figures of a page, each with a title, a text description for accessibility, and a caption."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from markupsafe import Markup

from phigen.compilation import Compilation
from phigen.drawing import figures
from phigen.report import page
from phigen.report.material import Material
from phigen.report.svg import inlined
from phigen.runtime.trajectory import Trajectory
from phigen.study.backward import Constancy, truncation
from phigen.study.lyapunov import Spectrum
from phigen.study.precision import Study
from phigen.study.summary import Summary
from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: ROWS: largest number of drawn rows of a trajectory. CASIMIRS: largest number of drawn Casimirs.
ROWS, CASIMIRS = 3_000, 11


def trajectory_picture(compilation: Compilation, trajectory: Trajectory) -> Markup:
    """Return the figure of the trajectory in phase space."""
    names = ", ".join(trajectory.coordinates)
    figure = figures.trajectory_figure(_thinned(trajectory), compilation.system.casimirs)
    caption = f"The trajectory of {names}, from the dot at t = {trajectory.t[0]:.9g} to t = {trajectory.t[-1]:.9g}."
    # With three coordinates, the page shows the interactive viewer in place of this figure. The figure then appears
    # only in print and where scripts do not run.
    instead = "instead" if len(trajectory.coordinates) == 3 else ""
    return picture("trajectory", figure, "Trajectory in phase space", caption, caption, instead)


def error_picture(material: Material) -> Markup:
    """Return the figure of the errors of energy and Casimirs against time."""
    caption = (
        "Errors of conserved quantities against time, on a logarithmic scale. The dotted line is one unit in the "
        "last place of a double."
    )
    methods = {label: _with_few_casimirs(t) for label, t in material.methods.items()}
    left_out = len(next(iter(material.methods.values())).casimirs) - CASIMIRS
    if left_out > 0:
        caption += f" {left_out} more Casimirs are in the table above only."
    worst = "; ".join(_described(s) for s in material.summaries)
    figure = figures.error_figure(methods, material.summaries[0].units)
    return picture("errors", figure, "Errors of energy and Casimirs over time", f"Largest errors: {worst}.", caption)


def section_picture(names: Sequence[str], function: str, points: Floats, count: int) -> Markup:
    """Return the figure of the Poincaré section.

    The figure shows some of the ``count`` crossings. ``function`` is the text of the function whose zeros define the
    section.
    """
    shown_points = points[:: max(1, -(-len(points) // ROWS))]
    caption = f"Poincaré section: {count} points where {function} rises through zero"
    caption += f"; {len(shown_points)} of them are drawn." if len(shown_points) < count else "."
    figure = figures.section_figure({f"{function} = 0": shown_points}, names)
    return picture("section", figure, "Poincaré section", caption, caption)


def constancy_picture(constancy: Constancy) -> Markup:
    """Return the figure of the changes of the modified Hamiltonian along a run."""
    largest = page.listed({truncation(m): float(e.max()) for m, e in enumerate(constancy.errors)})
    caption = "Changes of H and of H̃ with one and two corrections, relative to the energy. Thin lines have the "
    caption += "expected slopes. The dotted line is one unit in the last place of a double."
    figure, description = (
        figures.constancy_figure(constancy),
        f"Largest changes at steps of {constancy.step:.4g}: {largest}.",
    )
    return picture("constancy", figure, "Constancy of the modified Hamiltonian", description, caption)


def lyapunov_picture(spectrum: Spectrum) -> Markup:
    """Return the figure of the convergence of the Lyapunov exponents."""
    caption = f"Convergence of the Lyapunov exponents up to {spectrum.clock} = {spectrum.t:.9g}."
    exponents = ", ".join(page.scientific(v) for v in spectrum.exponents.tolist())
    return picture(
        "lyapunov", figures.lyapunov_figure(spectrum), "Lyapunov exponents", f"At the end: {exponents}.", caption
    )


def convergence_picture(study: Study) -> Markup:
    """Return the figure of errors against step size."""
    slopes = page.listed({f"{c.label} (order {c.order})": c.slope for c in study.curves})
    caption = f"Error at {study.clock} = {study.time:.4g} against the step. "
    caption += "The thin line has the slope of the stated order."
    return picture(
        "convergence", figures.convergence_figure(study), "Convergence", f"Observed orders: {slopes}.", caption
    )


def work_picture(study: Study) -> Markup:
    """Return the figure of errors against computing time."""
    figure = figures.work_precision_figure(study)
    description = "; ".join(_fastest(study, tolerance) for tolerance in (1e-3, 1e-6, 1e-9))
    caption = f"Error at {study.clock} = {study.time:.4g} against the time of the run (measured)."
    return picture("work", figure, "Work and precision", f"Seconds needed: {description}.", caption)


def picture(identifier: str, figure: Figure, title: str, description: str, caption: str, instead: str = "") -> Markup:
    """Return a figure with its title, a text description for accessibility, and a caption."""
    image = inlined(figures.svg(figure), identifier, title, description)
    wide = figure.get_figwidth() > figures.NARROW
    kind = " ".join(filter(None, ["wide" if wide else "", instead]))
    tabindex = "0" if wide else "-1"  # wide figures can be scrolled by keyboard
    return page.block(
        "figure", identifier=f"figure-{identifier}", kind=kind, tabindex=tabindex, image=image, caption=caption
    )


def _described(s: Summary) -> str:
    errors = {"energy": s.energy.error, **{f"Casimir {n}": d.error for n, d in s.casimirs.items()}}
    return f"{s.method}: {page.listed(errors)}"


def _fastest(study: Study, tolerance: float) -> str:
    seconds = {curve.label: curve.seconds_for(tolerance) for curve in study.curves}
    return f"for an error of {page.scientific(tolerance, 1)}, {page.listed(seconds)}"


def _with_few_casimirs(trajectory: Trajectory) -> Trajectory:
    return replace(trajectory, casimirs=dict(list(trajectory.casimirs.items())[:CASIMIRS]))


def _thinned(trajectory: Trajectory) -> Trajectory:
    stride = max(1, -(-len(trajectory) // ROWS))
    casimirs = {name: values[::stride] for name, values in trajectory.casimirs.items()}
    return replace(
        trajectory,
        t=trajectory.t[::stride],
        x=trajectory.x[::stride],
        energy=trajectory.energy[::stride],
        casimirs=casimirs,
    )
