"""Comparison of two Poisson maps. A map in the paper changes the symplectic leaf; the step of phigen does not."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from phigen.compilation import Compilation
from phigen.drawing.leaf import leaf_of
from phigen.drawing.palette import SERIES, styled
from phigen.drawing.phase_space import draw_in_space
from phigen.paper.plate import Finding, Plate, compiled, relative
from phigen.runtime.trajectory import Trajectory
from phigen.study.measures import poisson_defect
from phigen.study.methods import Method
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import gradient

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPEC, START = "poisson_not_hamiltonian", (1.0, 1.0, 2.0)
#: K: exponent k in `printed_map`. PAPER_STEP: step size in the paper. STEP: larger step size, with which the change of
#: the leaf is visible after TURNS periods of the orbit.
K, PAPER_STEP, STEP, TURNS = 2, 1e-4, 0.05, 3
PERIOD, ELSEWHERE = 2 * math.pi, (1.0, 2.0, 4.0)


def printed_map(state: Floats, h: float) -> Floats:
    """Return the images of states (…, 3) under the map of the paper.

    The map is the exact flow over the time h, followed by a dilation by exp(h^k) that changes the leaf.
    """
    x, y, z = np.moveaxis(state, -1, 0)
    u, v, w = x - y + z, x + y - z, -x + y + z
    angle, stretched = h * (u**2 + v**2) / 4, w * np.exp(h**K)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([x * cos + (y - z) * sin, (v * cos - u * sin + stretched) / 2,
                     (u * cos + v * sin + stretched) / 2], axis=-1)  # fmt: skip


def printed_field(state: Floats) -> Floats:
    """Return the vector field that the paper prints for the system `SPEC`, at one state (3,)."""
    x, y, z = state
    u, v = x - y + z, x + y - z
    return np.array([-v / 8 * (v**2 + v**2), (z - y) / 4 * (u**2 + v**2), u / 8 * (u**2 + v**2)])


def _rows(state: Floats, h: float, steps: int, stride: int) -> Floats:
    rows = [state]
    for step_number in range(1, steps + 1):
        state = printed_map(state, h)
        if step_number % stride == 0:
            rows.append(state)
    return np.array(rows)


def leaf_change_plate() -> Plate:
    """Return the figure of two orbits, by the map of the paper and by phigen, and of the Casimir along each orbit."""
    compilation, solver = compiled(SPEC, 4)
    steps = round(TURNS * PERIOD / STEP)
    trajectory = solver.integrate(START, STEP, steps)
    start = np.array(START)
    printed = _rows(start, STEP, steps, 1)
    findings = _findings(compilation, trajectory, start)
    section = solver.section(START, 1e-3, 13000, lambda x: 1 - x[:, 0])
    period = Finding("period of the orbit through (1, 1, 2)", "4π", float(np.diff(section.t)[0]))
    figure = _draw(compilation, trajectory, printed)
    return Plate("A Poisson map that is not Hamiltonian", figure, (period, *findings))


def _findings(compilation: Compilation, trajectory: Trajectory, start: Floats) -> tuple[Finding, ...]:
    method = Method("printed", printed_map, _rows)
    period_rows = _rows(start, PAPER_STEP, round(PERIOD / PAPER_STEP), 10)
    label, (x, y, z) = period_rows @ (-1, 1, 1), trajectory.x.T
    final_errors = [float(np.max(np.abs(_rows(start, 1 / n, n, n)[-1] - _flow(start, 1.0)))) for n in (1000, 2000)]
    point = np.array(ELSEWHERE)
    slopes = evaluate(
        gradient(compilation.system.hamiltonian, trajectory.coordinates), dict(zip("xyz", point, strict=True))
    )
    return (
        Finding("printed equations: dH/dt at (1, 2, 4)", "0, Hamiltonian", float(printed_field(point) @ slopes)),
        Finding("printed map: defect of DΦ π DΦᵀ = π∘Φ, step 0.05", "it is Poisson",
                poisson_defect(compilation.system, {}, method, start, STEP)),
        Finding("printed map with k = 2: observed order", "2", math.log2(final_errors[0] / final_errors[1])),
        Finding("printed map: −x + y + z after one turn, relative change, step 0.0001", "leaves the leaf",
                float(label[-1] / label[0] - 1)),
        Finding("phigen: −x + y + z, largest relative change", "constant",
                float(np.max(relative(trajectory.casimirs["C"])))),
        Finding("exact flow: x − y + z, largest change", "constant on leaves", float(np.ptp(x - y + z))),
    )  # fmt: skip


def _flow(state: Floats, t: float) -> Floats:
    """Return the image of a state under the exact flow over the time t: `printed_map` without the dilation."""
    label = state @ (-1, 1, 1)
    image = printed_map(state, t)
    flow: Floats = image - label * (math.exp(t**K) - 1) / 2 * np.array([0.0, 1.0, 1.0])
    return flow


@styled
def _draw(compilation: Compilation, trajectory: Trajectory, printed: Floats) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.6, 3.3), layout="constrained")
    names = trajectory.coordinates
    leaf = leaf_of(compilation.system.casimirs, names, dict(zip(names, START, strict=True)), {})
    for index, (points, title) in enumerate(
        ((trajectory.x, "phigen, order 4"), (printed, "the printed map, k = 2")), start=1
    ):
        axes = figure.add_subplot(1, 3, index, projection="3d")
        draw_in_space(axes, names, points, leaf, 0.85)
        axes.locator_params(nbins=3)
        axes.set_title(title)
    axes = figure.add_subplot(1, 3, 3)
    axes.plot(trajectory.t, printed @ (-1, 1, 1), color=SERIES[1], linewidth=1.4, label="the printed map")
    axes.plot(
        trajectory.t, trajectory.casimirs["C"], color=SERIES[0], linewidth=1.4, label="phigen, and the exact flow"
    )
    axes.set(xlabel="t", title="which leaf: −x + y + z", ylim=(0, None))
    axes.grid(True)
    axes.legend(loc="upper left")
    return figure
