"""Caller-driven stepping by sessions: steps, kicks, and states that the caller sets."""

import pickle

import numpy as np
import pytest
from support import compiled, setting, solver

from phigen.errors import StepError

TARGETS = ["c", "numpy"]
#: Systems with a gauge; with an attitude; with a time; with a splitting and a monitor; and with a bi-realisation by
#: paths.
SYSTEMS = ["rigid_body", "dzhanibekov", "duffing", "kepler_eccentric", "sir_epidemic"]


def session_of(name, target):
    at = setting(compiled(name))
    return solver(compiled(name), target).session(at.x, parameters=at.parameters), at


@pytest.mark.thin(2)
@pytest.mark.parametrize("name", SYSTEMS)
def test_kicked_sessions_of_c_and_numpy_are_one_trajectory(name):
    states = []
    for target in TARGETS:
        session, at = session_of(name, target)
        kick = 1e-2 * np.array(at.x)
        session.step(at.h, 20).kick(kick).step(at.h).kick(-0.9 * kick).step(0.5 * at.h, 10)
        session.x = 0.7 * session.x
        session.step(at.h, 3).set_parameters({name: 1.1 * value for name, value in session.parameters.items()})
        session.step(at.h, 10)
        states.append([*session.x, session.t, session.energy, *session.casimirs.values()])
        states[-1] += [] if session.attitude is None else session.attitude.tolist()
        assert session.steps == 44
    assert np.allclose(states[0], states[1], rtol=1e-11, atol=1e-12)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", SYSTEMS[:2])
def test_a_kick_moves_to_another_leaf_and_energy_which_are_kept_from_then_on(name, target):
    session, at = session_of(name, target)
    before = session.step(at.h, 10).leaf
    session.kick(0.05 * np.array(at.x))
    energy, leaf = session.energy, session.leaf
    assert all(abs(leaf[n] - before[n]) > 1e-3 for n in leaf)
    session.step(at.h, 500)
    assert session.casimirs == pytest.approx(leaf, rel=1e-13)
    assert session.energy == pytest.approx(energy, rel=1e-4)


@pytest.mark.parametrize("target", TARGETS)
def test_a_kick_gives_a_monitor_the_new_energy_level(target):
    """A kick changes the energy H, and the session takes the new energy level e = −H. With the old level, K = g(H + e),
    the Hamiltonian of a step with the monitor g, would not vanish, and the orbit would have another eccentricity.
    """
    at = setting(compiled("kepler_eccentric"))
    session = solver(compiled("kepler_eccentric"), target).session(at.x, oblateness=0)
    session.step(at.h, 7)
    q1, q2, p1, p2 = session.x
    session.kick([0, 0, -0.1 * p1, -0.1 * p2])
    excentricity = []
    for _ in range(2):
        q1, q2, p1, p2 = session.x
        spin = q1 * p2 - q2 * p1
        excentricity.append([p2 * spin - q1 / np.hypot(q1, q2), -p1 * spin - q2 / np.hypot(q1, q2)])
        session.step(at.h, 300)
    assert excentricity[0] == pytest.approx(excentricity[1], abs=1e-11)


@pytest.mark.parametrize("target", TARGETS)
def test_the_momentum_in_space_is_constant_after_an_impulse_too(target):
    """A gauge subtracts multiples of Casimirs from H. These rotate the body at a rate that depends on the leaf, so
    after an impulse the attitude must use the rate of the new leaf.
    """
    session, at = session_of("dzhanibekov", target)
    session.step(at.h, 40)
    attitude = session.attitude
    session.kick([0.3, -0.1, 0.2])
    assert session.attitude == pytest.approx(attitude, abs=1e-14)
    spatial = turned(session.attitude, session.x)
    session.step(at.h, 200)
    assert turned(session.attitude, session.x) == pytest.approx(spatial, abs=1e-12)
    for _ in range(300):  # the norm of the quaternion stays 1 after many kicks
        session.kick([1e-3, 0, 0])
    assert session.attitude @ session.attitude == pytest.approx(1, abs=1e-15)


def turned(q, v):
    """Return the components in space of a vector v of the body frame, for an attitude quaternion q = (w, x, y, z)."""
    t = 2 * np.cross(q[1:], v)
    return v + q[0] * t + np.cross(q[1:], t)


@pytest.mark.parametrize("target", TARGETS)
def test_sessions_make_the_steps_of_integrate_and_branch_and_are_stored(target):
    session, at = session_of("rigid_body", target)
    whole = session.solver.integrate(at.x, at.h, 30, parameters=at.parameters)
    session.step(at.h, 10)
    copy, stored = session.copy(), pickle.dumps(session)
    session.kick([1, 2, 3]).step(at.h, 5)
    for other in (copy, pickle.loads(stored)):
        other.step(at.h, 20)
        assert other.x.tolist() == whole.x[-1].tolist()
        assert (other.t, other.steps) == (whole.t[-1], 30)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_time_is_counted_through_changes_of_the_step(target):
    session, at = session_of("duffing", target)
    later = session.solver.session(at.x, t0=2.0)
    later.step(0.1, 1000).step(0.05, 10).kick([0.1, 0]).step(0.1, 1000)
    assert later.t == pytest.approx(202.5, rel=1e-15)


@pytest.mark.parametrize("target", TARGETS)
def test_what_is_not_allowed_leaves_all_as_it_was(target):
    session, at = session_of("kepler_eccentric", target)
    before = session.step(at.h, 3).x
    with pytest.raises(StepError, match="not finite, or the monitor not positive there"):
        session.kick(-before)
    with pytest.raises(ValueError, match="must be finite"):
        session.kick([np.nan, 0, 0, 0])
    with pytest.raises(ValueError, match="shape"):
        session.x = np.zeros((2, 4))
    with pytest.raises(StepError):
        session.step(1e300)
    assert (session.x.tolist(), session.steps) == (before.tolist(), 3)


@pytest.mark.parametrize("target", TARGETS)
def test_parameters_can_be_changed_after_a_failed_step(target):
    """Coefficients that depend on the time are not finite after a step that is far too large."""
    session, at = session_of("duffing", target)
    with pytest.raises(StepError):
        session.step(at.h, 3).step(1e300)
    fresh = session.solver.session(session.x, t0=session.t, A=0.7).step(at.h, 5)
    assert session.set_parameters(A=0.7).step(at.h, 5).x == pytest.approx(fresh.x, rel=1e-13)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", SYSTEMS)
def test_after_a_change_of_parameters_a_session_goes_on_as_one_that_starts_there(name, target):
    """The session keeps its gauge, and a session that starts at the same state determines a new gauge. So the states
    differ by less than the error of the steps.
    """
    session, at = session_of(name, target)
    unknown = {"unknown": 1.0}
    before = session.step(at.h, 20).parameters
    changed = {p: 1.2 * value for p, value in before.items()}
    when = {"t0": session.t} if name == "duffing" else {}
    first = {} if session.attitude is None else {"attitude0": session.attitude}
    still = session.solver.session(session.x, parameters=before, **when, **first).step(at.h, 30)
    fresh = session.solver.session(session.x, parameters=changed, **when, **first).step(at.h, 30)
    with pytest.raises(TypeError, match="unknown"):
        session.set_parameters(unknown)
    with pytest.raises(ValueError, match=r"must be finite|nan"):
        session.set_parameters(dict.fromkeys(before, np.nan))
    final = session.set_parameters(changed).step(at.h, 30)
    assert final.parameters == changed
    off, size = np.abs(final.x - fresh.x).max(), np.abs(fresh.x - still.x).max()
    assert off < 1e-8 * size
    assert final.attitude is None or final.attitude == pytest.approx(fresh.attitude, abs=1e-8)
