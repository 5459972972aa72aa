"""The eight planets: equations of motion about the centre of mass, and the errors of methods for H = A + εB."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import solver
from systems import spec_of

from phigen.compiler import compile_spec

SPEC = spec_of("planets")
START = np.array([float(v) for v in SPEC.runs["orbits"].initial])
VALUES = {p.name: float(p.value) for p in SPEC.parameters}
MASSES = np.array([1, *(VALUES[f"m{i}"] for i in range(1, 9))])
PLANETS = 8


@cache
def planets():
    return solver(compile_spec(SPEC), "c")


def bodies(x):
    """Return positions and velocities of the Sun and the planets about their centre of mass."""
    q, p = np.zeros((2, PLANETS + 1, 3))
    q[1:], p[1:] = x.reshape(2, PLANETS, 3)
    p[0] = -p[1:].sum(axis=0)
    return q - MASSES @ q / MASSES.sum(), p / MASSES[:, np.newaxis]


def newton(_, y):
    """Return the velocities and the accelerations of all bodies by gravity."""
    q, v = y.reshape(2, PLANETS + 1, 3)
    between = q[np.newaxis] - q[:, np.newaxis]
    cubes = (np.square(between).sum(axis=-1) + np.eye(PLANETS + 1)) ** 1.5
    return np.concatenate(
        [v.ravel(), (VALUES["GM"] * MASSES[:, np.newaxis] * between / cubes[..., np.newaxis]).sum(axis=1).ravel()]
    )


@pytest.mark.slow
def test_they_obey_the_equations_of_newton():
    """A Runge–Kutta method follows all nine bodies for a hundred days."""
    exact = solve_ivp(newton, (0, 100), np.concatenate(bodies(START)).ravel(), "DOP853", rtol=1e-12, atol=1e-14).y[
        :, -1
    ]
    q, _ = exact.reshape(2, PLANETS + 1, 3)
    positions, _ = bodies(planets().integrate(START, 5, 20).x[-1])
    np.testing.assert_allclose(positions, q, rtol=0, atol=1e-10)


def test_steps_of_five_days_keep_energy_and_angular_momentum_to_rounding():
    run = planets().integrate(START, 5, 1460, stride=73)
    assert np.ptp(run.energy) < 1e-14 * abs(run.energy[0])
    q, p = (run.x[:, k * 3 * PLANETS : (k + 1) * 3 * PLANETS].reshape(-1, PLANETS, 3) for k in (0, 1))
    momentum = np.cross(q, p).sum(axis=1)
    assert np.ptp(momentum, axis=0).max() < 3e-15 * np.linalg.norm(momentum[0])


@pytest.mark.slow
def test_a_corrector_removes_what_is_of_first_order():
    """Steps consist of one flow of each part."""
    errors = {}
    for name in ("wisdom-holman", "wisdom-holman-17"):
        integrator = solver(compile_spec(replace(SPEC, composition=name, order=2, profile="small")), "c")
        energy = integrator.integrate(START, 5, 1460, stride=73).energy
        errors[name] = np.ptp(energy) / abs(energy[0])
    assert errors["wisdom-holman-17"] < errors["wisdom-holman"] / 500
