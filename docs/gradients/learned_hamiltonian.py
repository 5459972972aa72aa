"""A Hamiltonian learned from trajectories, π given: python docs/gradients/learned_hamiltonian.py [FIGURE]

A gyrostat on so(3)*: π is known, H a polynomial of degree two with nine unknown coefficients. A multiple of the Casimir
x1² + x2² + x3² in H moves nothing, so a33 is given. Twenty short records with noise are fitted at once.
"""

import sys

import numpy as np
from scipy.optimize import minimize

import phigen
from phigen.drawing.palette import SERIES, save, styled

SPEC = """phigen: 1
name: learned
coordinates: [x1, x2, x3]
parameters: {a11: 0, a22: 0, a12: 0, a13: 0, a23: 0, b1: 0, b2: 0, b3: 0, a33: 0.5}
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: (a11*x1**2 + a22*x2**2 + a33*x3**2)/2 + a12*x1*x2 + a13*x1*x3 + a23*x2*x3 + b1*x1 + b2*x2 + b3*x3
order: 4
"""
NAMES = ("a11", "a22", "a12", "a13", "a23", "b1", "b2", "b3")
TRUE = np.array([1.3, 0.9, 0.2, -0.1, 0.05, 0.3, -0.2, 0.4])
STEP, STRIDE, STEPS, RECORDS, NOISE = 0.1, 5, 40, 20, 0.01


def rows(solver, starts, coefficients, steps=STEPS):
    """The states of all records (rows, records, 3)."""
    return solver.ensemble(starts, STEP, steps, STRIDE, parameters=dict(zip(NAMES, coefficients, strict=True)))


def loss(coefficients, solver, starts, records):
    """The mean of squares of what is not explained, and its gradient: one run back for all records."""
    residuals = rows(solver, starts, coefficients) - records
    parameters = dict(zip(NAMES, coefficients, strict=True))
    bars = solver.pullback(
        starts, STEP, STEPS, 2 * residuals / residuals.size, STRIDE, parameters=parameters
    ).parameters_bar
    return np.mean(residuals**2), np.array([bars[name] for name in NAMES])


def learned(solver, starts, records):
    """The coefficients, and the losses on the way, from H = x3²/4."""
    losses = []
    fit = minimize(
        loss, np.zeros(len(NAMES)), (solver, starts, records), jac=True, method="BFGS", options={"gtol": 1e-7},
        callback=lambda c: losses.append(loss(c, solver, starts, records)[0]),
    )  # fmt: skip
    return fit.x, losses


@styled
def drawn(solver, start, coefficients, losses):
    """A trajectory that was not learned from, in truth and as predicted; the losses."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 2.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.8, 1))
    steps = 10 * STEPS
    t = STEP * STRIDE * np.arange(steps // STRIDE + 1)
    for curve, style, label in ((TRUE, {"color": SERIES[1], "linewidth": 2.6, "alpha": 0.4}, "truth"),
                              (coefficients, {"color": SERIES[0], "linewidth": 0.9}, "prediction")):  # fmt: skip
        left.plot(t, rows(solver, start[np.newaxis], curve, steps)[:, 0, 0], label=label, **style)
    left.axvspan(0, STEP * STEPS, color="#8b98a9", alpha=0.2, linewidth=0, label="length of a record")
    left.set(xlabel="t", ylabel="x1", ylim=(0.3, 1.3))
    left.legend(loc="upper right", ncols=3)
    right.semilogy(range(1, len(losses) + 1), losses, color=SERIES[0])
    right.axhline(NOISE**2, color="#6e7781", linewidth=0.8, linestyle=(0, (1, 2)))
    right.set(xlabel="iteration", ylabel="mean square")
    return figure


def main(path=None):
    """The numbers, and the figure."""
    solver = phigen.compile(phigen.spec.loads(SPEC), adjoint=True)
    rng = np.random.default_rng(5)
    starts = rng.normal(size=(RECORDS, 3))
    starts /= np.linalg.norm(starts, axis=1, keepdims=True)
    records = rows(solver, starts, TRUE)
    records[1:] += NOISE * rng.normal(size=records[1:].shape)
    coefficients, losses = learned(solver, starts, records)
    for name, value, true in zip(NAMES, coefficients, TRUE, strict=True):
        print(f"{name} = {value:7.4f}, in truth {true:5}")
    print(f"{len(losses)} iterations")
    if path:
        save(drawn(solver, np.array([0.6, 0.0, 0.8]), coefficients, losses), path)
    return coefficients, losses


if __name__ == "__main__":
    main(*sys.argv[1:])
