"""Rigid body: errors over a long run, trajectory, Poincaré section, and the final state of Runge–Kutta."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.compilation import Compilation
from phigen.drawing.dots import draw_dots
from phigen.drawing.error_curves import draw_errors
from phigen.drawing.leaf import leaf_of
from phigen.drawing.palette import PALETTE, SERIES, styled
from phigen.drawing.phase_space import draw_in_space
from phigen.paper.plate import Finding, Plate, compiled, relative, trajectory_of
from phigen.paper.runge_kutta import ClassicalCourse, started
from phigen.runtime.crossings import CrossingFinder
from phigen.runtime.session import rows_along
from phigen.runtime.solver import Solver
from phigen.runtime.trajectory import Trajectory
from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPEC, RUN = "rigid_body_paper", "paper"
#: LONG: number of steps of the long run. EARLY: number of steps of shorter runs, which are measured too.
#: ROWS: number of rows that each run stores.
LONG, EARLY, ROWS = 10**8, 10**6, 20_000
#: Labels of curves. PHI is the method PHI-2 of the paper: the Cayley bi-realisation at order 2.
PHI, RK4, BETTER = "phigen, order 2, Cayley", "RK4", "phigen, order 4"
#: Step size and number of steps of the run for the Poincaré section. With this step size RK4 drifts visibly.
COARSE, SECTION_STEPS = 0.004, 75_000
#: _REST: number of further steps after which RK4 has come to rest at an equilibrium. _DOTS: number of crossings of the
#: section that are drawn.
_REST, _DOTS = 10**6, 500


@dataclass(frozen=True)
class Bodies:
    """Solvers of the rigid body, with initial state, step size and parameters of the run of the spec."""

    compilation: Compilation
    solver: Solver
    better: Solver
    x0: Floats
    h: float
    parameters: dict[str, float]


def bodies() -> Bodies:
    """Return the two solvers of the figures, with the initial state, step size and parameters of the run.

    One solver is the method PHI-2 of the paper. The other has order 4 and the bi-realisation that phigen chooses.
    """
    compilation, solver = compiled(SPEC, 2, "cayley")
    run = compilation.spec.runs[RUN]
    parameters = compilation.spec.parameters_of(run)
    x0 = np.array([float(v) for v in run.initial])
    return Bodies(compilation, solver, compiled(SPEC, 4)[1], x0, float(run.step), parameters)


def _runge_kutta(body: Bodies, h: float, steps: int, stride: int) -> Trajectory:
    states = rows_along(started("rk4", body.compilation, body.x0, body.parameters), h, steps, stride, None)
    return trajectory_of(body.solver, h * stride * np.arange(len(states), dtype=np.float64), states, h, body.parameters)


def errors_plate(steps: int = LONG) -> Plate:
    """Return the figure of the errors of energy and Casimir over ``steps`` steps, with the step size of the paper."""
    body = bodies()
    stride = max(1, steps // ROWS)
    methods = {
        PHI: body.solver.integrate(body.x0, body.h, steps, stride),
        BETTER: body.better.integrate(body.x0, body.h, steps, stride),
        RK4: _runge_kutta(body, body.h, steps, stride),
    }
    zoom = body.solver.integrate(body.x0, body.h, 2000, 2)
    findings = _early_findings(body) + (_late_findings(methods) if steps > EARLY else ())
    return Plate("Rigid body: errors of energy and Casimir", _draw_errors(methods, zoom), findings)


def _early_findings(body: Bodies) -> tuple[Finding, ...]:
    """Return the numbers that are measured in runs of `EARLY` steps."""
    stride = EARLY // ROWS
    poisson, double, better = (
        solver.integrate(body.x0, factor * body.h, EARLY // factor, stride)
        for solver, factor in ((body.solver, 1), (body.solver, 2), (body.better, 1))
    )
    runge_kutta_run = _runge_kutta(body, body.h, EARLY, stride)
    amplitude = float(np.max(relative(poisson.energy)))
    drift = float(relative(runge_kutta_run.energy)[-1])
    return (
        Finding("energy, PHI-2: largest error up to t = 100", "small oscillation", amplitude),
        Finding("energy, PHI-2: factor when the step is doubled", "4",
                float(np.max(relative(double.energy))) / amplitude),
        Finding("energy, RK4: error at t = 100", "larger than of PHI-2", drift),
        Finding("time after which RK4 has the larger energy error", "–", 100 * amplitude / drift),
        Finding("energy, phigen at order 4: largest error up to t = 100", "–", float(np.max(relative(better.energy)))),
        Finding("Casimir, PHI-2: largest error up to t = 100", "machine precision", _casimir_error(poisson)),
        Finding("Casimir, RK4: error at t = 100", "grows linearly", _casimir_error(runge_kutta_run)),
    )  # fmt: skip


def _late_findings(methods: dict[str, Trajectory]) -> tuple[Finding, ...]:
    end = f"t = {methods[PHI].t[-1]:g}"
    return (
        Finding(f"energy, PHI-2: largest error up to {end}", "as before", float(np.max(relative(methods[PHI].energy)))),
        Finding(f"energy, RK4: error at {end}", "grows linearly", float(relative(methods[RK4].energy)[-1])),
        Finding(f"Casimir, PHI-2: largest error up to {end}", "machine precision", _casimir_error(methods[PHI])),
        Finding(f"Casimir, RK4: error at {end}", "grows linearly", _casimir_error(methods[RK4])),
    )


def _casimir_error(trajectory: Trajectory) -> float:
    return float(np.max(relative(trajectory.casimirs["C"])))


@styled
def _draw_errors(methods: dict[str, Trajectory], zoom: Trajectory) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    upper_part, lower_part = np.ravel(figure.subfigures(2, 1, height_ratios=[2.7, 2], squeeze=False))
    draw_errors(upper_part, methods)
    axes = lower_part.add_subplot()
    axes.plot(zoom.t, 1e7 * (zoom.energy / zoom.energy[0] - 1), color=SERIES[0], linewidth=1.2)
    axes.set(xlabel="t", title=f"the beginning: relative error of the energy · 10⁷, {PHI}")
    axes.grid(True)
    return figure


def section_plate() -> Plate:
    """Return the figure of a trajectory of phigen, with the Poincaré sections of phigen and of RK4."""
    body = bodies()

    def height(states: Floats) -> Floats:
        return states[:, 1]

    poisson_crossings = body.solver.section(body.x0, COARSE, SECTION_STEPS, height).x
    course = started("rk4", body.compilation, body.x0, body.parameters)
    finder = CrossingFinder[ClassicalCourse](height, COARSE)
    blocks = finder.follow(course, SECTION_STEPS, lambda: course.advance(COARSE, 1))
    runge_kutta_points = np.array([x for _, crossings in blocks for _, x in crossings])
    course.advance(COARSE, _REST)
    end_state, orbit = course.state(), body.solver.integrate(body.x0, body.h, 700)
    findings = (
        Finding("PHI-2, step 0.004: diameter of the set of crossings", "one point", _diameter(poisson_crossings)),
        Finding("RK4, step 0.004: distance of its last crossing from the first", "moves away",
                float(np.linalg.norm(runge_kutta_points[-1] - runge_kutta_points[0]))),
        Finding("RK4, step 0.004: |x| in the end", "0", float(np.linalg.norm(end_state))),
        Finding("RK4, step 0.004: |π∇H| in the end", "0", float(np.linalg.norm(body.solver.vector_field(end_state)))),
    )  # fmt: skip
    return Plate(
        "Rigid body: trajectory and Poincaré section",
        _draw_section(body, orbit, poisson_crossings, runge_kutta_points, end_state),
        findings,
    )


def _diameter(points: Floats) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


@styled
def _draw_section(
    body: Bodies, orbit: Trajectory, crossings: Floats, runge_kutta_points: Floats, phigen_points: Floats
) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.6, 3.8), layout="constrained")
    left, right = np.ravel(figure.subfigures(1, 2, width_ratios=[1, 1.1], squeeze=False))
    space: Any = left.add_subplot(projection="3d")
    names = orbit.coordinates
    leaf = leaf_of(body.compilation.system.casimirs, names, dict(zip(names, body.x0, strict=True)), body.parameters)
    draw_in_space(space, names, orbit.x, leaf, 0.95)
    side = np.array([[-1.8, 1.8], [-1.8, 1.8]])
    space.plot_surface(side, np.zeros((2, 2)), side.T, color=SERIES[2], alpha=0.25, shade=False)
    space.set_title("trajectory on its leaf, and the plane x2 = 0")
    axes = right.add_subplot()
    draw_dots(axes, runge_kutta_points[:: len(runge_kutta_points) // _DOTS, [0, 2]], SERIES[1], 2.0, 2.0, "RK4")
    draw_dots(axes, crossings[:1, [0, 2]], SERIES[0], 7.0, 3.0, f"{PHI}: all {len(crossings)} crossings")
    exact = body.better.section(body.x0, body.h, 700, lambda x: x[:, 1]).x[0]
    axes.plot(exact[0], exact[2], "o", color=PALETTE["ink"], markersize=7, fillstyle="none", label="exact", zorder=4)
    axes.plot(phigen_points[0], phigen_points[2], "+", color=PALETTE["ink"], markersize=10, zorder=4)
    axes.annotate(
        "where RK4 comes to rest", (phigen_points[0], phigen_points[2]), (-4, -16), textcoords="offset points"
    )
    axes.set(xlabel="x1", ylabel="x3", title="x2 = 0, rising; steps of 0.004", ylim=(0.994, 1.018))
    axes.grid(True)
    axes.legend(loc="upper left")
    return figure
