"""Makes docs/lotka_volterra.svg from what phigen computes: python docs/make_figure.py"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
import numpy as np

import phigen
from phigen import resources
from phigen.analysis import classical
from phigen.analysis.summary import exact_solution

FIGURE = Path(__file__).with_name("lotka_volterra.svg")
#: The same text and ids on every machine.
STYLE = {"svg.hashsalt": "phigen", "svg.fonttype": "none", "font.size": 10, "font.family": "sans-serif"}


def solutions() -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Times, exact states, and the states of each method, up to just before the singularity."""
    system = phigen.load(resources.bundled_specs() / "lotka_volterra.yaml")
    run = system.spec.runs["blow_up"]
    x0, h = [float(v) for v in run.initial], float(run.step)
    found = {}
    for order in (2, 8):
        solver = phigen.compile(system, order=order)
        trajectory = solver.integrate(x0, h, run.steps, run.stride)
        found[f"phigen, order {order}"] = trajectory.x
    found["RK2"] = classical.integrate("rk2", lambda x: solver.vector_field(x), np.array(x0), h, run.steps, run.stride)
    exact = exact_solution(system, run, {}, np.array(x0), trajectory.t)
    return trajectory.t, np.column_stack([exact[c] for c in system.coordinates]), found


def main() -> None:
    """Draw both panels."""
    t, exact, found = solutions()
    end = np.log(5.001 / 3) / 2.001
    with mpl.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.2), layout="constrained")
        for (name, x), colour in zip(found.items(), ("#1b6ca8", "#0b3c5d", "#d1495b"), strict=True):
            error = np.max(np.abs(x - exact), axis=1) / np.max(np.abs(exact), axis=1)
            casimir = x[:, 0] * x[:, 2] / x[:, 1]
            left.semilogy(end - t[1:], np.maximum(error[1:], 1e-17), color=colour, label=name)
            drift = np.abs(casimir[1:] / casimir[0] - 1)
            right.semilogy(end - t[1:], np.maximum(drift, 1e-17), color=colour, label=name)
        for axes, title in ((left, "error of the solution"), (right, "error of the Casimir")):
            axes.set(xscale="log", title=title, xlabel="time left to the singularity", ylim=(1e-17, 1))
            axes.invert_xaxis()
            axes.grid(alpha=0.3)
        left.legend(frameon=False)
        figure.savefig(FIGURE, metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()
