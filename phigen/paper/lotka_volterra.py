"""Lotka–Volterra up to its singularity: the errors of four methods, and which methods detect the singularity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from phigen.compilation import Compilation
from phigen.drawing.error_curves import ROUNDING
from phigen.drawing.palette import MARK, PALETTE, SERIES, styled
from phigen.errors import StepError
from phigen.paper.plate import Finding, Plate, compiled, relative, trajectory_of
from phigen.runtime.solver import Solver
from phigen.runtime.trajectory import Trajectory
from phigen.spec.model import Run
from phigen.study import classical
from phigen.study.methods import field_of
from phigen.study.summary import exact_solution
from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPEC, RUN = "lotka_volterra", "blow_up"
#: Labels of the curves. OWN: labels of methods of phigen, with their orders. CLASSICAL: labels of classical methods,
#: with their names in phigen. PHI: label of the method of the paper.
OWN = {"phigen, order 2": 2, "phigen, order 8": 8}
CLASSICAL = {"RK2": "rk2", "RK4": "rk4"}
PHI, RK2, RK4 = "phigen, order 2", "RK2", "RK4"
COLOURS = dict(zip([*OWN, *CLASSICAL], (SERIES[0], PALETTE["ink"], SERIES[1], SERIES[3]), strict=True))
#: TIME: time of the tabulated errors. COARSE, END: step size and last time in the figure of the singularity.
TIME, COARSE, END = 0.254, 1e-3, 0.262


@dataclass(frozen=True)
class Approach:
    """Trajectories of all methods by label, up to just before the singularity, and the ``exact`` states (rows, DIM)."""

    compilation: Compilation
    solver: Solver
    run: Run
    end: float
    trajectories: dict[str, Trajectory]
    exact: Floats

    def errors(self, label: str) -> Floats:
        """Return the errors (rows,) of the states of one method, relative to the largest coordinate of the
        exact state.
        """
        distance = np.max(np.abs(self.trajectories[label].x - self.exact), axis=1)
        errors: Floats = distance / np.max(np.abs(self.exact), axis=1)
        return errors


def approach() -> Approach:
    """Return the trajectories of all methods for the run `RUN` of the spec, and the exact states."""
    trajectories = {}
    for label, order in reversed(OWN.items()):
        compilation, solver = compiled(SPEC, order)
        run = compilation.spec.runs[RUN]
        x0, h = [float(v) for v in run.initial], float(run.step)
        trajectories[label] = solver.integrate(x0, h, run.steps, run.stride)
    t = trajectories[PHI].t
    for label, method in CLASSICAL.items():
        states = classical.integrate(method, solver.vector_field, np.array(x0), h, run.steps, run.stride)
        trajectories[label] = trajectory_of(solver, t, states, h, {})
    solution = exact_solution(compilation.system, run, {}, np.array(x0), t)
    exact = np.column_stack([solution[c] for c in solver.coordinates])
    total = sum(x0)
    end = math.log((total - x0[0]) / -x0[0]) / total
    return Approach(compilation, solver, run, end, {label: trajectories[label] for label in COLOURS}, exact)


def errors_plate() -> Plate:
    """Return the figure of the errors of the solution, the Casimir and the energy."""
    course = approach()
    row = int(np.searchsorted(course.trajectories[PHI].t, TIME - 1e-9))
    final_errors = {label: float(course.errors(label)[row]) for label in COLOURS}
    casimir = {label: float(np.max(relative(t.casimirs["C"]))) for label, t in course.trajectories.items()}
    energy = {label: float(np.max(relative(t.energy))) for label, t in course.trajectories.items()}
    findings = (
        Finding("error of PHI-1 at t = 0.254", "much smaller than of RK-2", final_errors[PHI]),
        Finding("error of RK2 at t = 0.254", "goes off the solution early", final_errors[RK2]),
        Finding("error of RK4 at t = 0.254", "larger than of PHI-1, for larger t", final_errors[RK4]),
        Finding("error of phigen at order 8 at t = 0.254", "–", final_errors["phigen, order 8"]),
        Finding("order of PHI-1, from steps of 0.001 and 0.0005", "1", _order(course)),
        Finding("Casimir, PHI-1: largest error", "machine precision", casimir[PHI]),
        Finding("Casimir, RK2: largest error", "not preserved", casimir[RK2]),
        Finding("energy, PHI-1: largest error", "up to the order in the step", energy[PHI]),
        Finding("energy, RK2: largest error", "(not mentioned)", energy[RK2]),
    )
    return Plate("Lotka–Volterra: errors up to the singularity", _draw_errors(course), findings)


def _order(course: Approach) -> float:
    """Return the order of the method of the paper, observed from errors at t = 0.2."""
    x0, errors = [float(v) for v in course.run.initial], []
    for steps in (200, 400):
        trajectory = course.solver.integrate(x0, 0.2 / steps, steps, steps)
        exact = exact_solution(course.compilation.system, course.run, {}, np.array(x0), trajectory.t[-1:])
        errors.append(max(abs(trajectory.column(c)[-1] - exact[c][0]) for c in course.solver.coordinates))
    return math.log2(errors[0] / errors[1])


@styled
def _draw_errors(course: Approach) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.6, 3.2), layout="constrained")
    panels: list[Any] = list(figure.subplots(1, 3, sharey=True))
    for label, trajectory in course.trajectories.items():
        curves = course.errors(label), relative(trajectory.casimirs["C"]), relative(trajectory.energy)
        for axes, errors in zip(panels, curves, strict=True):
            left = course.end - trajectory.t[1:]
            axes.loglog(left, np.maximum(errors[1:], ROUNDING / 4), color=COLOURS[label], linewidth=1.2, label=label,
                        zorder=4 if label == PHI else 3)  # fmt: skip
    for axes, quantity in zip(panels, ("solution", "Casimir", "energy"), strict=True):
        axes.set(title=f"relative error of the {quantity}", xlabel="time left to the singularity", ylim=(2e-17, 2))
        axes.axhline(ROUNDING, **MARK)
        axes.grid(True)
    panels[0].invert_xaxis()
    for axes in panels[1:]:
        axes.sharex(panels[0])
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def singularity_plate() -> Plate:
    """Return the figure of PHI-1 and RK2 near T_sing, the time at which the exact solution becomes infinite.

    The steps are so large that they are visible in the figure.
    """
    course = approach()
    x0, steps = [float(v) for v in course.run.initial], round(END / COARSE)
    orbit, stopped = _until_it_fails(course.solver, x0, COARSE, steps)
    _, fine = _until_it_fails(course.solver, x0, COARSE / 10, 10 * steps)
    rk2_rows = classical.integrate("rk2", field_of(course.solver, {}), np.array(x0), COARSE, steps)
    passing = int(course.end / COARSE) + 1
    finite = np.flatnonzero(np.isfinite(rk2_rows).all(axis=1))[-1]
    findings = (
        Finding("T_sing, the time of the singularity", "≃ 0.23", course.end),
        Finding("PHI-1, step h = 0.001: (T_sing − t)/h at the last state", "the last step before",
                _left(course, stopped)),
        Finding("PHI-1, step h = 0.0001: (T_sing − t)/h at the last state", "the last step before",
                (course.end - fine) / (COARSE / 10)),
        Finding("RK2, step 0.001: x1 after T_sing is passed", "misses the singularity", float(rk2_rows[passing, 0])),
        Finding("RK2, step 0.001: overflow, in steps after T_sing", "–", -_left(course, finite * COARSE) + 1),
    )  # fmt: skip
    return Plate("Lotka–Volterra: at the singularity", _draw_singularity(course, orbit, rk2_rows), findings)


def _left(course: Approach, t: float) -> float:
    return (course.end - t) / COARSE


def _until_it_fails(solver: Solver, x0: list[float], h: float, steps: int) -> tuple[Trajectory, float]:
    """Return the trajectory, and the time of its last step.

    If the solver fails, the last step is the one before the failure.
    """
    try:
        trajectory = solver.integrate(x0, h, steps)
    except StepError as error:
        trajectory = cast(Trajectory, error.trajectory)
    return trajectory, float(trajectory.t[-1])


@styled
def _draw_singularity(course: Approach, orbit: Trajectory, runge_kutta_rows: Floats) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 3.4), layout="constrained")
    axes = figure.add_subplot()
    times = course.end - np.geomspace(0.02, 1e-6, 300)
    start = np.array([float(v) for v in course.run.initial])
    exact = exact_solution(course.compilation.system, course.run, {}, start, times)["x1"]
    axes.semilogy(times, -exact, color=PALETTE["muted"], linewidth=1.0, label="exact")
    axes.axvline(course.end, color=PALETTE["muted"], linewidth=0.8, linestyle=(0, (4, 3)))
    axes.annotate("singularity", (course.end, 1e5), (5, 0), textcoords="offset points", color=PALETTE["muted"])
    axes.semilogy(orbit.t, -orbit.x[:, 0], "o", color=COLOURS[PHI], markersize=3.5, label=f"{PHI}, until it stops")
    visible_values = np.where(np.abs(runge_kutta_rows[:, 0]) < 1e8, -runge_kutta_rows[:, 0], np.nan)
    axes.semilogy(
        COARSE * np.arange(len(runge_kutta_rows)), visible_values, "s", color=COLOURS[RK2], markersize=3, label=RK2
    )
    axes.set(xlim=(0.242, END), ylim=(40, 1e6), xlabel="t", ylabel="−x1", title="steps of 0.001")
    axes.grid(True)
    axes.legend(loc="upper left")
    return figure
