"""Predictors (starting values of the iteration) affect the speed of a solver, and not its results."""

import ctypes

import numpy as np
import pytest
from support import RATTLEBACK, RawC, compile_text

from phigen import api, resources, spec
from phigen.api import solver_of
from phigen.compiler import compile_spec
from phigen.errors import StepError


@pytest.fixture(scope="module")
def body():
    return api.compile(resources.bundled_specs() / "rigid_body.yaml", order=10)


@pytest.mark.thin(3)
@pytest.mark.parametrize("stride", [1, 8, 20000])
def test_guesses_near_a_saddle_lead_nowhere_else(body, stride):
    """Recurrences fitted to the slow motion near the middle axis may predict values of 1e8, where the equation of a
    step has a solution as well.
    """
    for h in (0.55, 0.6, 0.7):
        energy = body.integrate([0.1, 1, 0.1], h=h, steps=20000, stride=stride).energy
        assert np.ptp(energy) < 1e-8


def test_guesses_near_a_saddle_lead_members_of_ensembles_nowhere_else(body):
    start = np.array([[0.1 * 0.5**k, 1, 0.1] for k in range(9)])
    ends = body.ensemble(start, h=0.6, steps=20000)
    energies = [[body.hamiltonian(x) for x in states] for states in (start, ends)]
    np.testing.assert_allclose(energies[1], energies[0], rtol=1e-8)


@pytest.mark.thin(2)
@pytest.mark.parametrize("stride", [1, 8, 40])
def test_steps_that_are_too_large_lead_nowhere_else(stride):
    """The equation of a step that reverses the motion has a second solution, of a hundred times the energy."""
    solver = solver_of(compile_text(RATTLEBACK), "c")
    with pytest.raises(StepError) as failure:
        solver.integrate([0.01, 0.5, -1], h=0.5, steps=600, stride=stride)
    energy = failure.value.trajectory.energy
    assert len(energy) > 0
    assert np.max(energy) < 2 * energy[0]


@pytest.mark.slow
def test_steps_in_numpy_that_lead_elsewhere_are_tried_again():
    """Without a second attempt, the energy is 700 times as large from some step on, and no step fails."""
    energy = solver_of(compile_text(RATTLEBACK), "numpy").integrate([0.01, 0.5, -1], h=0.45, steps=120).energy
    assert np.max(energy) < 2 * energy[0]


def test_steps_that_are_too_large_lead_members_of_ensembles_nowhere_else():
    solver = solver_of(compile_text(RATTLEBACK), "c")
    members = np.array([[0.01, 0.5, -1 + 0.01 * k] for k in range(11)])
    with pytest.raises(StepError) as failure:
        solver.ensemble(members, h=0.5, steps=600)
    energies = np.array([solver.hamiltonian(x) for x in failure.value.trajectory])
    assert len(failure.value.members) > 5
    assert np.max(energies) < 2 * energies.min()


def test_guesses_after_a_kick_are_of_the_motion_from_there():
    """The predictor takes the change of the slope by the kick into account: the step after it converges as fast as one
    without a kick.
    """
    raw = RawC(compile_spec(spec.load(resources.bundled_specs() / "rigid_body.yaml"), order=4, profile="fast"))
    assert raw.init([0.3, 1.0, 0.2]) == 0
    rng = np.random.default_rng(1)
    iteration_counts = []
    for change in 0.01 * rng.uniform(-1, 1, (60, 3)):
        before = int(raw.counters[1])
        assert raw.step(0.05) == 0
        iteration_counts.append(int(raw.counters[1]) - before)
        assert raw.call("kick", ctypes.c_int, raw.here, ctypes.c_void_p(change.ctypes.data)) == 0
    assert np.mean(iteration_counts[10:]) < 2.1
