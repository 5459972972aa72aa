"""Symplectic leaves of three structures of the paper: spheres, hyperbolic paraboloids, planes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from phigen import resources, spec
from phigen.drawing.leaf import Leaf, net
from phigen.drawing.palette import PALETTE, SERIES, styled
from phigen.geometry.system import System, system_from_spec
from phigen.paper.plate import Finding, Plate
from phigen.study.measures import poisson_matrix
from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SYSTEMS = ("rigid_body_paper", "lotka_volterra", "poisson_not_hamiltonian")
#: Values of the Casimirs whose leaves are drawn.
SPHERES, PARABOLOIDS, PLANES = (0.1, 0.4, 1.0), (0.25, 1.5), (-2.0, 0.0, 2.0)


def foliation_plate() -> Plate:
    """Return the figure of three foliations side by side."""
    systems = [system_from_spec(spec.load(resources.bundled_specs() / f"{name}.yaml")) for name in SYSTEMS]
    parameters = {p.name: float(p.value) for p in systems[0].parameters}

    def rank(system: System, x: tuple[float, ...]) -> float:
        return float(np.linalg.matrix_rank(poisson_matrix(system, parameters, np.array(x))))

    body, species, _ = systems
    findings = (
        Finding("so(3)*: dimension of the leaf through (1, 1, 1)", "2, a sphere", rank(body, (1, 1, 1))),
        Finding("so(3)*: dimension of the leaf through 0", "0, the origin", rank(body, (0, 0, 0))),
        Finding("Lotka–Volterra: dimension of the leaf through (1, 1, 1)", "1, hyperbolas",
                rank(species, (1, 1, 1))),
    )  # fmt: skip
    return Plate("Symplectic leaves", _draw(systems), findings)


@styled
def _draw(systems: list[System]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.6, 3.1), layout="constrained")
    titles = ("so(3)*: spheres and the origin", "Lotka–Volterra: x1 x3 = C x2", "−x + y + z = C")
    for index, (system, title, draw) in enumerate(
        zip(systems, titles, (_draw_spheres, _draw_paraboloids, _draw_planes), strict=True), start=1
    ):
        axes: Any = figure.add_subplot(1, 3, index, projection="3d")
        draw(axes, system)
        axes.set_box_aspect((1, 1, 1), zoom=0.92)
        axes.set_title(title)
        for axis, name in zip("xyz", system.coordinates, strict=True):
            getattr(axes, f"set_{axis}label")(name, labelpad=-14)
            getattr(axes, f"set_{axis}ticks")([])
            getattr(axes, f"{axis}axis").pane.set_visible(False)
    return figure


def _draw_spheres(axes: Any, system: System) -> None:
    """Draw spheres as nets of lines. The quarter in front is left out, so that the inner spheres are visible."""
    casimir, names = system.casimirs["C"], system.coordinates
    box, gap = np.array([[-1.0] * 3, [1.0] * 3]), np.full((1, 3), np.nan)
    for level, colour in zip(SPHERES, SERIES, strict=False):
        for line in net(Leaf(casimir, names, {}, level), box * 1.05):
            hidden = (line[:, 0] > 0) & (line[:, 1] < 0)
            axes.plot(*np.concatenate([np.where(hidden[:, None], np.nan, line), gap]).T, color=colour, linewidth=0.6)
    axes.plot(0, 0, 0, "o", color=PALETTE["ink"], markersize=3)
    axes.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05), zlim=(-1.05, 1.05))
    axes.view_init(22, -45)


def _draw_paraboloids(axes: Any, system: System) -> None:
    """Draw the leaves x2 = x1 x3/C in the positive octant."""
    for level, colour in zip(PARABOLOIDS, SERIES, strict=False):
        first, share = np.meshgrid(np.linspace(0.02, 1, 8), np.linspace(0.02, 1, 8))
        # the drawn part of the surface ends at x2 = 1
        third = share * np.minimum(1.0, level / first)
        _draw_surface(axes, first, first * third / level, third, colour)
    axes.view_init(24, -40)


def _draw_planes(axes: Any, system: System) -> None:
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5))
    for level, colour in zip(PLANES, SERIES, strict=False):
        _draw_surface(axes, x, y, level + x - y, colour)
    axes.view_init(22, 75)


def _draw_surface(axes: Any, x: Floats, y: Floats, z: Floats, colour: str) -> None:
    axes.plot_surface(x, y, z, color=colour, alpha=0.25, edgecolor=colour, linewidth=0.4, shade=False,
                      rcount=len(x), ccount=len(x))  # fmt: skip
