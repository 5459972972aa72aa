"""Ensembles of Gauss steps with one member in each SIMD lane, compared with single trajectories."""

import numpy as np
import pytest
from support import compile_text, solver

from phigen.errors import StepError

TOP = """
coordinates: [P1, P2, P3, G1, G2, G3]
parameters: {a: 0.7, c: 1}
poisson:
  brackets:
    P1: {P2: -P3, P3: P2, G2: -G3, G3: G2}
    P2: {P3: -P1, G3: -G1, G1: G3}
    P3: {G1: -G2, G2: G1}
hamiltonian: (P1**2/2 + a*P2**2 + P3**2)/2 + c*G1
scheme: gauss
"""
OSCILLATOR = """
coordinates: [q, p]
parameters: {a: 0.7}
poisson:
  canonical: {q: [q], p: [p]}
hamiltonian: p**2/2 + a*q**4/4
scheme: gauss
"""

DRIVEN = """
coordinates: [q, p]
time: t
parameters: {a: 0.7}
poisson:
  canonical: {q: [q], p: [p]}
hamiltonian: p**2/2 + a*q**4/4 + q*cos(2*t)/5
scheme: gauss
"""
COMET = """
coordinates: [q1, q2, p1, p2]
parameters: {a: 1}
poisson:
  canonical: {q: [q1, q2], p: [p1, p2]}
hamiltonian: (p1**2 + p2**2)/2 - a/sqrt(q1**2 + q2**2)
monitor: (q1**2 + q2**2)**(3/4)
scheme: gauss
"""


@pytest.mark.parametrize(("text", "order"), [(TOP, 4), pytest.param(OSCILLATOR, 12, marks=pytest.mark.slow)])
def test_members_in_lanes_follow_their_own_trajectories(text, order):
    """Eleven members with different parameters and steps fill batches of SIMD lanes, except the last batch, which has
    unused lanes.
    """
    method = solver(compile_text(text + f"order: {order}\n"), "c")
    draws = np.random.default_rng(order)
    starts = draws.uniform(0.3, 1.0, (11, len(method.coordinates)))
    starts[3] = 0.0  # the state is 0 and gives no scale for the stopping criterion
    steps, a = draws.uniform(0.05, 0.1, 11), draws.uniform(0.5, 1.0, 11)
    frames = method.ensemble(starts, steps, 60, stride=20, parameters={"a": a})
    for m in range(11):
        alone = method.integrate(starts[m], steps[m], 60, stride=20, parameters={"a": a[m]})
        np.testing.assert_allclose(frames[:, m], alone.x[-len(frames) :], rtol=0, atol=3e-14)


@pytest.mark.parametrize("text", [DRIVEN, COMET])
def test_batches_follow_the_time_and_energy_level_of_each_member(text):
    """Each member of a batch has its own start time or energy level. In the first batch of four members two fail, and
    the other members continue without SIMD.
    """
    method = solver(compile_text(text + "order: 4\n"), "c")
    draws = np.random.default_rng(3)
    starts = draws.uniform(0.5, 0.7, (6, len(method.coordinates)))
    failing = [1, 2]
    starts[1], starts[2] = 1e200, 60.0 if text is DRIVEN else 1e180  # overflow, or divergent sweeps
    start_times = {"t0": draws.uniform(-1, 1, 6)} if text is DRIVEN else {}
    steps, a = draws.uniform(0.05, 0.1, 6), draws.uniform(0.9, 1.0, 6)
    with pytest.raises(StepError) as failed:
        method.ensemble(starts, steps, 30, stride=10, parameters={"a": a}, **start_times)
    assert list(failed.value.members) == failing
    for m in {*range(6)} - {*failing}:
        start_time = {name: float(times[m]) for name, times in start_times.items()}
        alone = method.integrate(starts[m], steps[m], 30, stride=10, parameters={"a": a[m]}, **start_time)
        np.testing.assert_allclose(failed.value.trajectory[:, m], alone.x, rtol=0, atol=3e-14)


def test_member_that_fails_does_not_stop_its_batch():
    method = solver(compile_text(OSCILLATOR + "order: 4\n"), "c")
    starts = np.array([[0.5 + 0.1 * m, 0.2] for m in range(8)])
    starts[5] = 40.0, 0.0  # sweeps diverge
    with pytest.raises(StepError) as failed:
        method.ensemble(starts, 0.1, 50)
    assert list(failed.value.members) == [5]
    for m in {*range(8)} - {5}:
        alone = method.integrate(starts[m], 0.1, 50).x[-1]
        np.testing.assert_allclose(failed.value.trajectory[m], alone, rtol=0, atol=2e-14)
    np.testing.assert_array_equal(failed.value.trajectory[5], starts[5])
