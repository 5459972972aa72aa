"""Moments of inertia from a noisy record of a tumbling body: python docs/gradients/moments_of_inertia.py [FIGURE]

A gyroscope in the body measures the angular velocity ω = (x1/I1, x2/I2, x3/I3). Without torque nobody can tell I and
the momentum x from multiples of both, so I3 is given. Unknown are I1, I2 and the momentum at the start.
"""

import sys

import numpy as np
from scipy.optimize import minimize

import phigen
from phigen.drawing.palette import SERIES, save, styled

STEP, STRIDE, SAMPLES, NOISE = 0.1, 4, 150, 0.03
TRUE, GUESS = np.array([1.0, 2.0, 0.1, 2.0, 0.2]), np.array([1.2, 1.7, 0.0, 1.8, 0.3])  # I1, I2, start
I3 = 3.0


def velocities(solver, unknown, samples):
    """ω at the first samples (samples, 3)."""
    x = solver.integrate(unknown[2:], STEP, STRIDE * (samples - 1), STRIDE, I1=unknown[0], I2=unknown[1], I3=I3).x
    return x / [*unknown[:2], I3]


def loss(unknown, solver, record):
    """Half the sum of squares of what is not explained, in units of the noise, and its gradient: one run back."""
    moments, samples = np.array([*unknown[:2], I3]), len(record)
    residuals = (velocities(solver, unknown, samples) - record) / NOISE**2
    run = {"h": STEP, "steps": STRIDE * (samples - 1), "stride": STRIDE, "I1": unknown[0], "I2": unknown[1], "I3": I3}
    x, start_bar, bars = solver.pullback(unknown[2:], cotangent=residuals / moments, **run)
    direct = -np.sum(residuals * x, axis=0) / moments**2  # ω depends on I beside x
    return 0.5 * NOISE**2 * np.sum(residuals**2), np.array([bars["I1"] + direct[0], bars["I2"] + direct[1], *start_bar])


def fitted(solver, record):
    """The unknowns, their standard deviations, and how many gradients that took: first of a short record."""
    unknown, gradients = GUESS, 0
    for samples in (15, 40, len(record)):
        fit = minimize(loss, unknown, (solver, record[:samples]), jac=True, method="BFGS", options={"gtol": 1e-3})
        unknown, gradients = fit.x, gradients + fit.njev
    width = 1e-5  # the Hessian, by differences of gradients
    sides = [[loss(unknown + s * width * e, solver, record)[1] for s in (1, -1)] for e in np.eye(5)]
    hessian = np.array([(a - b) / (2 * width) for a, b in sides])
    return unknown, np.sqrt(np.diag(np.linalg.inv(hessian))), gradients


@styled
def drawn(solver, record, unknown):
    """The record, the guess and the fit, of the second component of ω."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 2.6), layout="constrained")
    axes, t = figure.subplots(), STEP * STRIDE * np.arange(SAMPLES)
    axes.plot(t, record[:, 1], ".", color="#6e7781", markersize=3, label="record")
    axes.plot(t, velocities(solver, GUESS, SAMPLES)[:, 1], color=SERIES[1], linewidth=0.9, label="first guess")
    axes.plot(t, velocities(solver, unknown, SAMPLES)[:, 1], color=SERIES[0], linewidth=1.2, label="fit")
    axes.set(xlabel="t", ylabel="ω₂", ylim=(-1.2, 1.6))
    axes.legend(loc="upper right", ncols=3)
    return figure


def main(path=None):
    """The numbers, and the figure."""
    solver = phigen.compile("rigid_body", order=8, adjoint=True)
    noise = np.random.default_rng(3).normal(size=(SAMPLES, 3))
    record = velocities(solver, TRUE, SAMPLES) + NOISE * noise
    unknown, errors, gradients = fitted(solver, record)
    for name, value, error, true in zip(("I1", "I2"), unknown, errors, TRUE, strict=False):
        print(f"{name} = {value:.4f} ± {error:.4f}, in truth {true}")
    print(f"{gradients} gradients")
    if path:
        save(drawn(solver, record, unknown), path)
    return unknown, errors


if __name__ == "__main__":
    main(*sys.argv[1:])
