"""Makes the first figure of the README: its rigid body over a long time, by phigen and by RK4 at the same cost."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from phigen import spec
from phigen.api import compilation_of, solver_of
from phigen.compilation import Compilation
from phigen.drawing.error_curves import LINES
from phigen.drawing.leaf import leaf_of
from phigen.drawing.palette import MARK, PALETTE, SERIES, save_for_pages, styled
from phigen.drawing.phase_space import draw_in_space
from phigen.paper.plate import relative, trajectory_of
from phigen.paper.runge_kutta import started
from phigen.runtime.session import rows_along
from phigen.runtime.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parent.parent
FIGURE = ROOT / "docs" / "figures" / "overview.svg"
#: The step of phigen and the steps that RK4 takes in its place. A step of phigen's order 6 takes the processor time of
#: three to four steps of RK4 in C (`phigen compare`), so this is to the advantage of RK4.
STEP, RK4_STEPS = 1.2, 4
#: Units of time of the run; rows that are stored, and the rows of the last orbits with a step of phigen between them.
END, ROWS, LAST = 1e8, 50_000, 60
PHIGEN, RK4 = "phigen, order 6, step 1.2", "RK4, step 0.3: the same cost"


def compilation_of_readme() -> Compilation:
    """The system that the README begins with."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```yaml\n(phigen: 1\nname: tumbler\n.*?)^```", readme, re.M | re.S)
    return compilation_of(spec.loads(text))


def courses(compilation: Compilation, end: float) -> dict[str, tuple[Trajectory, Trajectory]]:
    """The run up to a time by both methods: rows over all of it, and the orbit that comes after it."""
    solver, run = solver_of(compilation, "c"), compilation.spec.runs["flip"]
    x0, parameters = np.array([float(v) for v in run.initial]), compilation.spec.parameters_of(run)
    stride = max(1, round(end / STEP / ROWS))
    ours = solver.integrate(x0, STEP, ROWS * stride, stride)
    course = started("rk4", compilation, x0, parameters)
    states = rows_along(course, STEP / RK4_STEPS, ROWS * stride * RK4_STEPS, stride * RK4_STEPS, None)
    theirs = trajectory_of(solver, ours.t, states, STEP / RK4_STEPS, parameters)
    return {
        label: (method_run, solver.integrate(method_run.x[-1], STEP / 12, 12 * LAST))
        for label, method_run in ((PHIGEN, ours), (RK4, theirs))
    }


@styled
def figure(runs: dict[str, tuple[Trajectory, Trajectory]], compilation: Compilation) -> Figure:
    """The surface of the momentum with the orbits at the end, and the errors on the way there."""
    from matplotlib.figure import Figure

    result = Figure(figsize=(7.2, 2.7), layout="constrained")
    space, curves = np.ravel(result.subfigures(1, 2, width_ratios=[1, 2], squeeze=False))
    (ours, last), (_, lost) = runs.values()
    coordinates = ours.coordinates
    casimirs, start = compilation.system.casimirs, dict(zip(coordinates, ours.x[0].tolist(), strict=True))
    axes = space.add_subplot(projection="3d")
    draw_in_space(axes, coordinates, last.x, leaf_of(casimirs, coordinates, start, ours.parameters), 1.25)
    axes.plot(*lost.x.T, color=SERIES[1], linewidth=1.2)
    axes.set_axis_off()
    axes.set_title(f"orbits after t = 10$^{{{round(np.log10(ours.t[-1]))}}}$")
    panels = [("energy error", lambda t: t.energy), ("Casimir error", lambda t: t.casimirs["C"])]
    for number, (title, values) in enumerate(panels, 1):
        axes = curves.add_subplot(1, 2, number)
        for index, (label, (run, _)) in enumerate(runs.items()):
            t, error = log_spaced_maxima(run.t[1:], relative(values(run))[1:])
            axes.loglog(t, np.maximum(error, 2.0**-53), color=SERIES[index], linestyle=LINES[index], label=label)
        axes.axhline(1.0, **MARK)
        axes.set(title=title, xlabel="t", ylim=(1e-17, 10))
        axes.grid(True, color=PALETTE["grid"])
    curves.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return result


def log_spaced_maxima(t: np.ndarray, values: np.ndarray, windows: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """The largest value in each of some windows that are equally long on a logarithmic axis."""
    edges = np.unique(np.searchsorted(t, np.geomspace(t[0], t[-1], windows)))[:-1]
    return t[edges], np.maximum.reduceat(np.abs(values), edges)


def main() -> None:
    """Draw the figure."""
    compilation = compilation_of_readme()
    save_for_pages(figure(courses(compilation, END), compilation), FIGURE)


if __name__ == "__main__":
    main()
