"""Sessions of lattices: steps, kicks, assigned states, copies, and pickles."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from lattice import test_forcing as forcing
from lattice import test_monitor as monitored
from lattice import test_sweeps as sweeps
from lattice import test_time as timed
from lattice.lattices import SPIN_GRAPH

import phigen
import phigen.spec
from phigen.errors import StepError
from phigen.runtime.arguments import Beginning
from phigen.runtime.lattice_course import LatticeCourse

#: Sources of lattices by name: a splitting with merged flows, one with time dependence, the series with noise, and a
#: splitting with noise.
CASES = {"xxz": sweeps, "coloured": timed, "bath": forcing, "langevin": forcing}


def prepared(name: str, target: str) -> tuple[Any, np.ndarray, dict[str, Any]]:
    module = CASES[name]
    order = 4 if module is sweeps else 2
    if module is sweeps:
        return sweeps.solver(name, 4, target), sweeps.start(name, (5,)), {}
    x, values = module.given(name)
    asked = {"parameters": values} | ({"t0": 0.3} if name == "coloured" else {"seed": 3, "step0": 2})
    return module.solver(name, order, target), x, asked


@pytest.mark.parametrize(("name", "target"), [(n, "numpy") for n in CASES] + [("xxz", "c"), ("bath", "c")])
def test_steps_kicks_and_states_are_those_of_single_runs(name: str, target: str) -> None:
    solver, x, asked = prepared(name, target)
    session = solver.session(x, **asked)
    change = np.random.default_rng(2).normal(size=x.shape) / 10
    session.step(0.05, 3).kick(change)
    half = solver.integrate(x, 0.05, 3, 3, **asked).x[-1]
    np.testing.assert_allclose(session.x, half + change, rtol=0, atol=1e-13)
    later = {k: v + 3 if k == "step0" else v + 0.15 if k == "t0" else v for k, v in asked.items()}
    session.step(0.05, 2)
    whole = solver.integrate(half + change, 0.05, 2, 2, **later)
    np.testing.assert_allclose(session.x, whole.x[-1], rtol=0, atol=1e-13)
    np.testing.assert_allclose(session.energy, whole.energy[-1], rtol=1e-12)
    assert (session.steps, round(session.t, 12)) == (5, asked.get("t0", 0.0) + 0.25)
    session.x = x
    np.testing.assert_array_equal(session.x, x)


@pytest.mark.parametrize(("name", "target"), [("xxz", "c"), ("coloured", "numpy"), ("bath", "c")])
def test_copies_and_pickles_go_on_to_the_last_bit(name: str, target: str) -> None:
    solver, x, asked = prepared(name, target)
    session = solver.session(x, **asked).step(0.05, 2).step(0.03, 2)
    others = [session.copy(), pickle.loads(pickle.dumps(session))]
    for other in others:
        assert (other.t, other.steps) == (session.t, session.steps)
        other.step(0.03, 2)
    session.step(0.03, 2)
    for other in others:
        assert other.x.tobytes() == session.x.tobytes()


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_states_that_cannot_be_are_refused_and_leave_the_session_where_it_was(target: str) -> None:
    solver, x, _ = prepared("xxz", target)
    session = solver.session(x).step(0.05)
    before = session.x
    with pytest.raises(StepError, match="not finite"):
        session.kick(np.full(x.shape, 1.7e308)).kick(np.full(x.shape, 1.7e308))
    session.x = before
    with pytest.raises(ValueError, match="must have shape"):
        session.kick(x[:, :4])
    np.testing.assert_array_equal(session.x, before)
    assert session.casimirs["C"].shape == x.shape[1:]


@pytest.mark.parametrize(("name", "target"), [(n, t) for n in CASES for t in ("numpy", "c")])
def test_after_a_change_of_parameters_a_session_goes_on_as_one_that_starts_there(name: str, target: str) -> None:
    solver, x, asked = prepared(name, target)
    session = solver.session(x, **asked).step(0.05, 3)
    name_of_one = next(iter(solver.interface.parameters))
    changes = {name_of_one: 1.25 * np.asarray(session.parameters[name_of_one]) + 0.1}
    before = session.x
    assert session.set_parameters(changes) is session
    np.testing.assert_array_equal(session.x, before)
    later = {k: v + 3 if k == "step0" else session.t if k == "t0" else v for k, v in asked.items()}
    later["parameters"] = {**later.get("parameters", {}), **changes}
    other = solver.session(before, **later)
    twins = [session.copy(), pickle.loads(pickle.dumps(session))]
    assert {s.energy for s in twins} == {other.energy} == {session.energy}
    states = {s.step(0.05, 2).step(0.03, 2).x.tobytes() for s in (session, other, *twins)}
    assert len(states) == 1
    assert (session.steps, session.t) == (7, pytest.approx(asked.get("t0", 0.0) + 0.31, abs=1e-15))
    unchanged = solver.session(before, **{**later, "parameters": asked.get("parameters")}).step(0.05, 2).step(0.03, 2)
    assert np.abs(unchanged.x - session.x).max() > 1e-6


def test_copies_before_and_after_a_change_of_parameters_have_their_own() -> None:
    solver, x, _ = prepared("xxz", "c")
    session, name = solver.session(x).step(0.05, 2), next(iter(solver.interface.parameters))
    before = session.copy()
    after = session.set_parameters({name: 2.5}).copy()
    unchanged = solver.session(x).step(0.05, 4)
    assert before.step(0.05, 2).x.tobytes() == unchanged.x.tobytes()
    assert after.step(0.05, 2).x.tobytes() == session.step(0.05, 2).x.tobytes() != unchanged.x.tobytes()


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_parameters_of_steps_in_tau_change_the_level_and_not_the_time(target: str) -> None:
    solver = phigen.compile(phigen.spec.loads(monitored.BODIES), target=target)
    session = solver.session(monitored.X0).step(0.02, 5)
    time, masses = session.t, np.array([0.9, 0.4, 0.2])
    session.set_parameters(m=masses)
    twin, other = session.copy(), solver.session(session.x, m=masses)
    assert (session.t, twin.t, session.energy) == (time, time, other.energy)
    for s in (session, twin, other):
        s.step(0.02, 5)
    assert session.x.tobytes() == twin.x.tobytes() == other.x.tobytes()
    assert session.t == twin.t == pytest.approx(time + other.t, abs=1e-15)


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_parameters_that_cannot_be_leave_a_session_unchanged(target: str) -> None:
    solver = phigen.compile(phigen.spec.loads(monitored.BODIES), target=target)
    session, twin = (solver.session(monitored.X0).step(0.02, 2) for _ in range(2))
    for changes, error, message in (
        ({"m": [1, 2]}, ValueError, r"must be a number or have shape \(3,\)"),
        ({"m": -1}, ValueError, "'m' must be positive at all sites"),
        ({"n": 1}, TypeError, "'n'"),
        ({"m": 1e200}, StepError, "not negative at the start"),
    ):
        with pytest.raises(error, match=message):
            session.set_parameters(changes)
    assert session.parameters is not twin.parameters
    assert session.step(0.02).x.tobytes() == twin.step(0.02).x.tobytes()
    graph = phigen.compile(phigen.spec.loads(SPIN_GRAPH), target=target)
    with pytest.raises(TypeError, match="the bonds of a session are fixed"):
        graph.session(np.ones((3, 4)), bonds=[[0, 1], [1, 2], [2, 0], [2, 3]]).set_parameters(bonds=[[1, 2]] * 4)


CHAIN_WITH_NOISE = """\
phigen: 1
name: chain
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1] - q)**2/2 + q**4/4
noise: {bath: {hamiltonian: q, amplitude: 0.1}}
"""


#: A driven chain; steps that are far too large have coefficients that are not finite.
GROWING = """\
phigen: 1
name: growing
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
time: t
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + q**4/4 + p*q/3 + q*q[i+1]/6 + q*cos(t)/5
order: 2
scheme: splitting
"""


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_copies_and_pickles_go_on_after_a_failed_step(target):
    solver = phigen.compile(phigen.spec.loads(GROWING), target)
    session = solver.session(np.linspace(-0.5, 0.7, 10).reshape(2, 5), t0=0.4)
    for _ in range(2):
        with pytest.raises(StepError):
            session.step(1e6)
        others = [session.copy(), pickle.loads(pickle.dumps(session))]
        session.step(0.1, 2)
        for other in others:
            np.testing.assert_array_equal(other.step(0.1, 2).x, session.x)
            assert other.t == session.t
    assert session.t == pytest.approx(0.8)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_branches_share_states_and_keep_the_bits(target):
    solver = phigen.compile(phigen.spec.loads(CHAIN_WITH_NOISE), target=target)
    x0 = np.random.default_rng(4).normal(size=(2, 9))
    whole = LatticeCourse(solver, Beginning(x0, 0.1, solver.values({}, {}, (9,))))
    course, branches = LatticeCourse(solver, whole.at), []
    for step in range(40):
        branches.append(course.branch())
        h = 0.1 if step < 25 else 0.07
        course.advance(h, 1)
        if step == 20:
            course.kick(np.full((2, 9), 0.01))
    for step in range(40):
        assert branches[step].steps == step
        if step % 7 == 0:
            np.testing.assert_array_equal(branches[step].branch().state(), whole.state())
        whole.advance(0.1 if step < 25 else 0.07, 1)
        if step == 20:
            whole.kick(np.full((2, 9), 0.01))
    late = branches[3]
    late.advance(0.1, 17)
    np.testing.assert_array_equal(late.state(), branches[20].state())
    np.testing.assert_array_equal(whole.state(), course.state())
