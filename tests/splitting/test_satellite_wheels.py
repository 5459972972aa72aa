"""The satellite with wheels: the order of its splitting, its Poisson map, and what its motion conserves."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import solver
from systems import spec_of

from phigen.compiler import compile_spec
from phigen.symbolic.numeric import evaluate

START = np.array([0.4, 0.5, 0.3, 0, 0, 1, 1, 0, 0, 0, 0.1, 0, 0.2, 0, -0.1])


@cache
def satellite():
    return compile_spec(spec_of("satellite_wheels"), tangent=True)


def equations(_, x):
    """Return the derivatives by Euler's equations of a body with moments I, of the rotating directions N and G, and of
    the wheels.
    """
    moments, wheel, n = np.array([1, 1.6, 2]), 0.05, 0.3
    m, normal, vertical, momenta = x[:3], x[3:6], x[6:9], x[10::2]
    rate = (m - momenta) / moments - n * normal
    torque = 3 * n**2 * np.cross(vertical, moments * vertical) - n * np.cross(normal, m)
    wheels = np.zeros(6)
    wheels[::2] = momenta / wheel - (m - momenta) / moments
    return [*(np.cross(m, rate) + torque), *np.cross(normal, rate), *np.cross(vertical, rate), *wheels]


@pytest.mark.slow
def test_it_solves_the_equations_of_the_body_with_order_four():
    """The reference is a Runge–Kutta method for equations that are written by hand."""
    exact = solve_ivp(equations, (0, 4), START, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    integrator = solver(satellite(), "c")
    errors = [np.abs(integrator.integrate(START, 4 / n, n).x[-1] - exact).max() for n in (20, 40, 80)]
    assert errors[-1] < 1e-6
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(4, abs=0.3)


def test_a_step_is_a_poisson_map():
    system = satellite().system
    end, tangent = solver(satellite(), "c").step_tangent(START, 0.5)

    def poisson(x):
        at = dict(zip(system.coordinates, map(float, x), strict=True))
        return np.array(
            [evaluate(row, {**at, "I1": 1, "I2": 1.6, "I3": 2, "J": 0.05, "n": 0.3}) for row in system.poisson]
        )

    assert np.abs(tangent @ poisson(START) @ tangent.T - poisson(end)).max() < 1e-14


def test_casimirs_and_momenta_of_wheels_are_kept():
    run = solver(satellite(), "c").integrate(START, 0.2, 2000)
    assert max(np.ptp(values) for values in run.casimirs.values()) < 2e-15
    assert np.ptp(run.x[:, 10::2], axis=0).max() == 0
    assert np.ptp(run.energy) < 2e-3 * abs(run.energy[0])
