import copy
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

from phigen.errors import Diagnostic, LimitError, Location, StepError
from phigen.runtime.interface import row_steps
from phigen.runtime.solver import Solver

START = [1.0, 0.5, 2.0]


def exact(t, omega=1.0):
    q, p, c = START
    return np.array(
        [
            q * np.cos(omega * t) + p / omega * np.sin(omega * t),
            p * np.cos(omega * t) - q * omega * np.sin(omega * t),
            c + 0 * t,
        ]
    ).T


@pytest.mark.parametrize(
    ("steps", "stride", "expected"),
    [(10, 5, [0, 5, 10]), (10, 4, [0, 4, 8, 10]), (3, 10, [0, 3]), (0, 3, [0]), (2, 1, [0, 1, 2])],
)
def test_rows_are_every_stride_th_and_the_last(steps, stride, expected):
    assert row_steps(steps, stride).tolist() == expected


@pytest.mark.parametrize(("steps", "stride"), [(100, 1), (100, 7), (5, 100), (0, 1)])
def test_trajectory_is_the_exact_one_at_the_stored_times(solver, steps, stride):
    trajectory = solver.integrate(START, h=0.1, steps=steps, stride=stride, omega=1.5)
    np.testing.assert_allclose(trajectory.t, 0.1 * row_steps(steps, stride), rtol=0, atol=0)
    np.testing.assert_allclose(trajectory.x, exact(trajectory.t, 1.5), atol=1e-12)
    assert trajectory.steps == steps
    assert trajectory.x[0].tolist() == START


def test_energy_and_casimirs_are_those_of_the_rows(solver):
    trajectory = solver.integrate(START, 0.1, 20, stride=3, omega=2)
    np.testing.assert_allclose(trajectory.energy, (0.5**2 + 4 * 1.0**2) / 2, rtol=1e-13)
    assert list(trajectory.casimirs) == ["c", "c2"]
    assert trajectory.casimirs["c"].tolist() == [2.0] * len(trajectory)
    assert trajectory.casimirs["c2"].tolist() == [4.0] * len(trajectory)
    assert trajectory.parameters == {"omega": 2.0, "limit": 1e300}


def test_negative_step_goes_back(solver):
    there = solver.integrate(START, 0.1, 30).x[-1]
    np.testing.assert_allclose(solver.integrate(there, -0.1, 30).x[-1], START, atol=1e-13)


def test_step_is_the_first_row_of_a_trajectory(solver):
    assert solver.step(START, h=0.1).tolist() == solver.integrate(START, 0.1, 5).x[1].tolist()


def test_ensemble_moves_each_member_as_if_alone(solver):
    starts = np.random.default_rng(7).normal(size=(3000, 3))
    final = solver.ensemble(starts, h=0.1, steps=40, omega=1.2)
    assert final.shape == starts.shape
    for member in (0, 1024, 2999):
        alone = solver.integrate(starts[member], 0.1, 40, stride=40, omega=1.2).x[-1]
        np.testing.assert_allclose(final[member], alone, rtol=1e-13)


def test_ensemble_accepts_no_members_and_no_steps(solver):
    assert solver.ensemble(np.empty((0, 3)), 0.1, 10).shape == (0, 3)
    assert solver.ensemble([START], 0.1, 0).tolist() == [START]


def test_input_arrays_are_left_alone(solver):
    start, starts = np.array(START), np.array([START, START])
    trajectory = solver.integrate(start, 0.1, 3)
    solver.ensemble(starts, 0.1, 3)
    assert start.tolist() == START
    assert starts.tolist() == [START, START]
    start[0] = 9
    assert trajectory.x[0].tolist() == START


def test_functions_of_the_state_take_any_leading_shape(solver):
    x = np.arange(24.0).reshape(2, 4, 3)
    np.testing.assert_allclose(solver.hamiltonian(x, omega=2), (x[..., 1] ** 2 + 4 * x[..., 0] ** 2) / 2)
    np.testing.assert_allclose(solver.casimirs(x)["c2"], x[..., 2] ** 2)
    np.testing.assert_allclose(solver.vector_field(x)[..., 0], x[..., 1])
    assert solver.hamiltonian(START).shape == ()


def test_back_ends_agree(solvers):
    a, b = (solvers[t].integrate(START, 0.1, 100, stride=9) for t in ("c", "numpy"))
    np.testing.assert_allclose(a.x, b.x, atol=1e-13)
    np.testing.assert_array_equal(a.t, b.t)


@pytest.mark.parametrize("progress", [None, lambda done: None])
@pytest.mark.parametrize("stride", [1, 4, 5, 1000])
def test_failed_step_keeps_the_trajectory_so_far(solver, stride, progress):
    # q = A cos(t − φ) with A² = 1.25 and tan φ = 1/2 passes 1.11 at t = 0.344, after 34 good steps of 0.01.
    with pytest.raises(StepError) as caught:
        solver.integrate(START, h=0.01, steps=1000, stride=stride, limit=1.11, progress=progress)
    error = caught.value
    good = next(n for n in range(1000) if abs(exact(0.01 * (n + 1))[0]) > 1.11)
    assert (error.step, error.status, error.members) == (good, "NO_CONVERGENCE", ())
    np.testing.assert_allclose(error.trajectory.t, 0.01 * row_steps(good, stride), atol=1e-15)
    np.testing.assert_allclose(error.trajectory.x, exact(error.trajectory.t), atol=1e-13)
    assert len(error.trajectory.energy) == len(error.trajectory)
    assert "smaller step" in str(error)


def test_failed_members_of_an_ensemble_are_named(solver):
    starts = np.array([[0.1, 0, 1], [1.0, 0.5, 1], [0.2, 0, 1], [1.0, 0.6, 1]])
    with pytest.raises(StepError) as caught:
        solver.ensemble(starts, h=0.1, steps=20, limit=1.05)
    assert set(caught.value.members) <= {1, 3}
    assert caught.value.trajectory.shape == (4, 3)


def test_progress_counts_up_to_the_number_of_steps(solver):
    seen = []
    trajectory = solver.integrate(START, 0.01, 1003, stride=10, progress=seen.append)
    assert seen == sorted(set(seen))
    assert seen[-1] == 1003
    np.testing.assert_allclose(trajectory.x, exact(trajectory.t), atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"x0": [1, 2]}, ValueError, r"last axis of length 3 \(q, p, c\), but its shape is \(2,\)"),
        ({"x0": [[1, 2, 3]]}, ValueError, "use ensemble"),
        ({"x0": [1, math.nan, 3]}, ValueError, "p is nan"),
        ({"x0": ["a", 2, 3]}, TypeError, "array of numbers"),
        ({"x0": [1j, 2, 3]}, TypeError, "real"),
        ({"h": 0}, ValueError, "must not be 0"),
        ({"h": math.inf}, ValueError, "finite"),
        ({"steps": -1}, ValueError, "at least 0"),
        ({"steps": 1.5}, TypeError, "integer"),
        ({"stride": 0}, ValueError, "at least 1"),
        ({"h": 10**400}, ValueError, "finite, not an integer of 401 digits"),
        ({"h": Fraction(10) ** 5000}, ValueError, "finite"),
        ({"h": "0.1"}, TypeError, "must be a number, not '0.1'"),
        ({"x0": [1, -(10**400), 3]}, ValueError, "x0 must be finite, but a number in it is too large"),
        ({"x0": ["1", "2", "3"]}, TypeError, "array of numbers: text is not a number"),
        ({"steps": 10**400}, ValueError, "at most .*, not an integer of 401 digits"),
        ({"steps": -(10**5000)}, ValueError, "at least 0, not an integer of 5001 digits"),
        ({"stride": 2**63}, ValueError, "at most"),
        ({"omega": 10**400}, ValueError, "'omega' must be finite, not an integer of 401 digits"),
        ({"omga": 1}, TypeError, "did you mean 'omega'"),
        ({"zzz": 1}, TypeError, "the system has omega, limit"),
        ({"omega": -1}, ValueError, "must be positive, not -1"),
        ({"omega": math.nan}, ValueError, "finite"),
        ({"omega": "fast"}, TypeError, "must be a number, not 'fast'"),
        ({"omega": 1, "parameters": {"omega": 2}}, TypeError, "given twice"),
    ],
)
def test_wrong_arguments_are_named(solver, arguments, error, message):
    with pytest.raises(error, match=message):
        solver.integrate(**{"x0": START, "h": 0.1, "steps": 10, **arguments})


def test_solvers_can_be_copied_and_pickled(solver):
    """A copy of a solver makes the same steps, and a solver with a fixed gauge can be pickled, too."""
    expected = solver.integrate(START, 0.1, 5, omega=2).x.tolist()
    for twin in (copy.copy(solver), copy.deepcopy(solver), pickle.loads(pickle.dumps(solver))):
        assert twin is not solver
        assert (repr(twin), twin.interface) == (repr(solver), solver.interface)
        assert twin.integrate(START, 0.1, 5, omega=2).x.tolist() == expected
    fixed = pickle.loads(pickle.dumps(Solver(solver.backend.with_gauge(np.array([0.5])), solver.interface)))
    assert fixed.backend._gauge.tolist() == [0.5]


def test_errors_can_be_pickled(solver):
    """Pools of processes pickle the errors of their workers."""
    with pytest.raises(StepError) as caught:
        solver.integrate(START, 0.1, 100, limit=1.05)
    error, twin = caught.value, pickle.loads(pickle.dumps(caught.value))
    assert (str(twin), twin.step, twin.status, twin.members) == (str(error), error.step, error.status, error.members)
    assert twin.trajectory.x.tolist() == error.trajectory.x.tolist()
    diagnostics = [Diagnostic("one"), Diagnostic("two", Location(1, 2))]
    restored = pickle.loads(pickle.dumps(LimitError(diagnostics)))
    assert (type(restored), restored.diagnostics, str(restored)) == (
        LimitError,
        diagnostics,
        str(LimitError(diagnostics)),
    )


def test_parameters_can_be_a_mapping(solver):
    by_name = solver.integrate(START, 0.1, 5, omega=2)
    assert solver.integrate(START, 0.1, 5, parameters={"omega": 2}).x.tolist() == by_name.x.tolist()
