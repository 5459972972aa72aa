"""A periodic orbit of Hénon and Heiles' system by shooting: python docs/gradients/periodic_orbit.py [FIGURE]

Unknown are the start and the period T, made of a fixed number of steps. Newton's method needs the derivative of the run
along the start; that along T is the vector field at its end. Of the equations x(T) = x(0) and H = E the solution of
least change is taken, as there is one for each point of the orbit.
"""

import sys

import numpy as np

import phigen
from phigen.drawing.palette import PALETTE, SERIES, save, styled

ENERGY, STEPS = 1 / 8, 400
GUESS, PERIOD = np.array([0.0, 0.1, 0.48, 0.02]), 6.5


def shot(solver, start, period):
    """What x(T) misses of x(0), and H of E; its derivatives along start and T."""
    x1, by_start, _ = solver.jacobian(start, period / STEPS, STEPS)
    slope = -np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, 0, 0], [0, -1, 0, 0]]) @ solver.vector_field(start)
    missed = np.array([*(x1 - start), solver.hamiltonian(start) - ENERGY])
    matrix = np.zeros((5, 5))
    matrix[:4, :4], matrix[:4, 4] = by_start - np.eye(4), solver.vector_field(x1)
    matrix[4, :4] = slope
    return missed, matrix, by_start


def found(solver):
    """The start, the period, the multipliers of the orbit, and what was missed in each iteration."""
    start, period, history = GUESS, PERIOD, []
    for _ in range(12):
        missed, matrix, by_start = shot(solver, start, period)
        history.append(np.max(np.abs(missed)))
        if history[-1] < 1e-13:
            break
        change = np.linalg.lstsq(matrix, -missed, rcond=1e-9)[0]
        start, period = start + change[:4], period + change[4]
    return start, period, np.linalg.eigvals(by_start), history


@styled
def drawn(solver, start, period, history):
    """The orbit with the first guess, inside of where it may go; what was missed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.2, 1))
    guess = solver.integrate(GUESS, PERIOD / STEPS, STEPS).x
    orbit = solver.integrate(start, period / STEPS, STEPS).x
    x, y = np.meshgrid(np.linspace(-0.7, 0.7, 200), np.linspace(-0.55, 0.85, 200))
    left.contour(x, y, (x**2 + y**2) / 2 + x**2 * y - y**3 / 3, [ENERGY], colors=PALETTE["grid"])
    left.plot(guess[:, 0], guess[:, 1], color=SERIES[1], linewidth=0.9, label="first guess")
    left.plot(orbit[:, 0], orbit[:, 1], color=SERIES[0], linewidth=1.2, label="periodic orbit")
    left.set(xlabel="x", ylabel="y", aspect="equal", xlim=(-0.8, 0.8), ylim=(-0.6, 1.15))
    left.legend(loc="upper left")
    right.semilogy(range(len(history)), history, "o-", color=SERIES[0], markersize=4)
    right.set(xlabel="iteration", ylabel="|x(T) − x(0)|, |H − E|")
    return figure


def main(path=None):
    """The numbers, and the figure."""
    solver = phigen.compile("henon_heiles", order=8, adjoint=True)
    start, period, multipliers, history = found(solver)
    print(f"period {period:.12f}, missed " + ", ".join(f"{m:.0e}" for m in history))
    print("multipliers " + ", ".join(f"{m:.6f}" for m in sorted(multipliers, key=lambda m: (abs(m), m.imag))))
    if path:
        save(drawn(solver, start, period, history), path)
    return start, period, multipliers, history


if __name__ == "__main__":
    main(*sys.argv[1:])
