"""Results of ``phigen.solve_ivp`` agree with those of ``scipy.integrate.solve_ivp``."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phigen


@cache
def solver_of(name):
    return phigen.compile(name, target="numpy", order=None)


def field(name, **parameters):
    """Return the right-hand side of the equations of motion as a function for SciPy."""
    solver = solver_of(name)
    if solver.interface.time:
        return lambda t, y: solver.vector_field(y, t, **parameters)
    return lambda t, y: solver.vector_field(y, **parameters)


def crossing(t, y):
    return y[0] - 0.2


def falling(t, y):
    return y[0] - 0.2


def ending(t, y):
    return y[1] + 0.05 * t


falling.direction = -1
ending.terminal = True
ending.direction = -1


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("name", "span"), [("pendulum", (1.0, 7.0)), ("duffing", (0.5, 12.0)), ("pendulum", (7.0, -3.0))]
)
def test_results_are_those_of_scipy(name, span):
    times = np.linspace(*span, 9)
    asked = {"t_eval": times, "dense_output": True, "events": [crossing, falling]}
    ours = phigen.solve_ivp(solver_of(name), span, [1.0, 0.3], rtol=1e-9, atol=1e-9, **asked)
    theirs = solve_ivp(field(name), span, [1.0, 0.3], rtol=1e-11, atol=1e-12, **asked)
    assert (ours.status, ours.message, ours.success) == (0, theirs.message, True)
    assert ours.t.tolist() == theirs.t.tolist()
    assert np.allclose(ours.y, theirs.y, rtol=0, atol=2e-8)
    assert np.allclose(ours.sol(times[3]), theirs.sol(times[3]), rtol=0, atol=2e-8)
    assert np.allclose(ours.sol(times[2:5]), theirs.sol(times[2:5]), rtol=0, atol=2e-8)
    for mine, other in zip(ours.t_events, theirs.t_events, strict=True):
        assert np.allclose(mine, other, rtol=0, atol=2e-8)
    assert 0 < len(ours.t_events[1]) < len(ours.t_events[0])
    assert np.allclose(np.array(ours.y_events[0])[:, 0], 0.2, rtol=0, atol=1e-15)


def test_an_event_ends_the_integration_where_it_is_met():
    ours = phigen.solve_ivp(solver_of("pendulum"), (2, 30), [1.0, 0.3], h=0.05, events=ending)
    theirs = solve_ivp(field("pendulum"), (2, 30), [1.0, 0.3], rtol=1e-11, atol=1e-12, events=ending)
    assert (ours.status, ours.message) == (1, theirs.message)
    assert ours.t[-1] == pytest.approx(theirs.t[-1], abs=1e-4)
    assert ours.y[1, -1] == pytest.approx(-0.05 * ours.t[-1], abs=1e-14)
    assert (ours.sol, ours.h, ours.t[0]) == (None, 0.05, 2)


def test_status_says_that_the_end_was_not_reached():
    # This solution becomes infinite at t = 0.2554.
    lotka = phigen.solve_ivp(solver_of("lotka_volterra"), (0, 1), [-3, 5, 0.001], h=0.01)
    assert lotka.status == -1
    assert not lotka.success
    assert 0 < lotka.t[-1] < 0.26
    assert lotka.y.shape == (3, len(lotka.t))
    with pytest.raises(ValueError, match="within t_span"):
        phigen.solve_ivp(solver_of("pendulum"), (0, 1), [1, 0], t_eval=[0.5, 2])
    with pytest.raises(ValueError, match="sorted"):
        phigen.solve_ivp(solver_of("pendulum"), (0, 1), [1, 0], t_eval=[0.5, 0.2])
    with pytest.raises(ValueError, match="two different numbers"):
        phigen.solve_ivp(solver_of("pendulum"), (1, 1), [1, 0])
    with pytest.raises(TypeError, match="no 'method' here: the solver determines the method"):
        phigen.solve_ivp(solver_of("pendulum"), (0, 1), [1, 0], method="RK45")
