"""Sessions: a trajectory has the same bits, however its steps are divided into calls."""

import numpy as np
import pytest
from support import NAMES, compiled, setting, solver

from phigen.errors import StepError
from phigen.runtime.interface import BackendError

STEPS = 24
#: One system for each driver, the loop over steps in the C runtime: Newton's method, explicit steps, and Karasev's
#: paths.
DRIVERS = ("rigid_body", "pendulum_euler", "sir_epidemic")


def session_of(name, target):
    at = setting(compiled(name))
    return solver(compiled(name), target).backend.start(np.array(at.x), at.parameters), at


@pytest.mark.corpus
@pytest.mark.parametrize("name", NAMES)
def test_numpy_session_is_the_loop_of_the_generated_module(name):
    session, at = session_of(name, "numpy")
    module = solver(compiled(name), "numpy").backend.module
    session.advance(at.h, 5)
    assert session.state().tolist() == module.integrate(at.x, at.h, 5, **at.parameters)[-1].tolist()


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("name", DRIVERS)
def test_pieces_copies_and_stored_bytes_give_the_same_trajectory(name, target):
    whole, at = session_of(name, target)
    whole.advance(at.h, STEPS)
    session, _ = session_of(name, target)
    session.advance(at.h, 5)
    copy = session.branch()
    session.advance(-0.3 * at.h, 1)  # a step of the original must not change the copy
    backend = solver(compiled(name), target).backend
    back = backend.restored(copy.saved(), at.parameters)
    for other in (copy, back):
        for part in (1, 7, STEPS - 13):
            other.advance(at.h, part)
        assert other.steps == STEPS
        assert other.state().tolist() == whole.state().tolist()
        assert other.saved() == whole.saved()


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("name", ["rigid_body", "pendulum_euler"])
def test_a_failing_step_leaves_the_state_before_it(name, target):
    session, at = session_of(name, target)
    session.advance(at.h, 3)
    before = session.state()
    with pytest.raises(BackendError):
        session.advance(1e300, 1)
    assert session.steps == 3
    assert session.state().tolist() == before.tolist()


def test_progress_does_not_change_a_trajectory():
    """With ``progress``, the run is made in several blocks. The gauge is still determined once, at the start, and each
    block continues with the compensation terms of the block before.
    """
    from phigen import api, resources

    numpy = api.compile(resources.bundled_specs() / "rigid_body.yaml", target="numpy")
    trajectories = [numpy.integrate([0.01, 1, 0.01], 0.1, 300, progress=p) for p in (None, lambda done: None)]
    assert trajectories[0].x.tolist() == trajectories[1].x.tolist()


def test_bytes_of_another_solver_are_refused():
    session, _ = session_of("rigid_body", "c")
    other = solver(compiled("pendulum_euler"), "c").backend
    with pytest.raises(ValueError, match="the saved session has"):
        other.restored(session.saved(), {})


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_trajectory_that_fails_ends_with_its_last_good_state(target):
    lotka = solver(compiled("lotka_volterra"), target)
    with pytest.raises(StepError) as caught:
        lotka.integrate([-3, 5, 0.001], 0.01, 1000, stride=7)
    partial_run = caught.value.trajectory
    assert partial_run.t[-1] == 0.01 * caught.value.step
    again = lotka.integrate([-3, 5, 0.001], 0.01, caught.value.step, stride=7)
    assert partial_run.x.tolist() == again.x.tolist()
