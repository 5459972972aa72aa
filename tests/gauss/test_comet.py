"""A comet that has a close encounter with Jupiter: Gauss steps with a monitor, compared with a Runge–Kutta method with
step size control.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import solver
from systems import spec_of

from phigen.compiler import compile_spec

SPEC = spec_of("comet_jupiter")
RUN = SPEC.runs["encounter"]
START = np.array([float(v) for v in RUN.initial])
VALUES = {p.name: float(p.value) for p in SPEC.parameters}
MASSES = np.array([1.0, VALUES["mJ"], VALUES["mC"]])


def newton(_, y):
    """Return the time derivatives of positions and momenta of three bodies."""
    q, p = y.reshape(2, 3, 2)
    between = q[np.newaxis] - q[:, np.newaxis]
    cubes = (np.square(between).sum(axis=-1) + np.eye(3)) ** 1.5
    force = (VALUES["GM"] * MASSES[:, np.newaxis] * MASSES / cubes)[..., np.newaxis] * between
    return np.concatenate([(p / MASSES[:, np.newaxis]).ravel(), force.sum(axis=1).ravel()])


@pytest.mark.slow
def test_energy_is_kept_through_the_encounter_and_the_comet_goes_where_newton_says():
    """The relative energy error is small through the encounter, although the total energy is a million times that of
    the comet, and the final position of the comet agrees with DOP853.
    """
    integrator = solver(compile_spec(SPEC), "c")
    run = integrator.integrate(START, float(RUN.step), RUN.steps)
    until = float(run.t[-1])
    assert np.abs(run.energy / run.energy[0] - 1).max() < 1e-12
    exact = solve_ivp(newton, (0, until), START, "DOP853", rtol=3e-14, atol=1e-20)
    distances = np.linalg.norm(exact.y[4:6] - exact.y[2:4], axis=0)
    assert distances.min() < 0.004
    np.testing.assert_allclose(run.x[-1, 4:6], exact.y[4:6, -1], rtol=0, atol=1e-5)
