"""The flow of Kepler motions: conic sections of every shape, as one part of H, with its derivatives."""

from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
from many_digits import values
from scipy.integrate import solve_ivp
from support import compile_text, javascript, solver

from phigen import StepError
from phigen.splitting import kepler
from phigen.splitting.parts import split
from phigen.splitting.statements import check
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

SPACE = "coordinates: [x, y, z, px, py, pz]\npoisson: {canonical: {q: [x, y, z], p: [px, py, pz]}}\n"
ORBIT = SPACE + (
    "parameters: {m: 2, k: 3}\nhamiltonian: (px**2 + py**2 + pz**2)/(2*m) - k/sqrt(x**2 + y**2 + z**2)\n"
    "scheme: splitting\nruns: {one: {initial: [1, 0, 0.1, 0, 2, 0.3], step: 0.1, steps: 10}}\n"
)
MU, MASS = 1.5, 2
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0], [0.48, 0.64, 0.6]])


@cache
def orbit(extras=""):
    return compile_text(ORBIT + extras, 4)


def start(eccentricity, pericentre=True):
    """Return a state on an orbit in an inclined plane, with semi-major axis 1 or, if the orbit is open, with pericentre
    distance 1.
    """
    e = eccentricity if pericentre else -eccentricity
    q = abs(1 - e) if eccentricity < 1 else 1.0
    speed = np.sqrt(MU / q * (1 + e))
    return np.concatenate([TURN @ [q, 0, 0], TURN @ [0, MASS * speed, 0]])


@cache
def increments():
    return orbit().splitting.flows[0].increment


def expected(x, h):
    """Return the end of a step, from the formulas in 40 digits with another solver for the universal Kepler
    equation.
    """
    with mpmath.workdps(40):
        at = dict(zip(("x", "y", "z", "px", "py", "pz"), map(mpmath.mpf, x), strict=True))
        at |= {"m": mpmath.mpf(MASS), "k": mpmath.mpf(3), "h:": mpmath.mpf(h)}
        return np.array([float(mpmath.mpf(a) + d) for a, d in zip(x, values(increments(), at), strict=True)])


ORBITS = [(e, True) for e in (0, 0.3, 0.999, 1.5)] + [(e, False) for e in (0.9, 0.999)]


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_step_of_any_size_ends_on_the_orbit_to_rounding(target):
    """At a pericentre, the derivative of the flow multiplies rounding errors of the start by up to 1e7."""
    for e, pericentre in ORBITS:
        x = start(e, pericentre)
        for h in (0.01, 4.0, -2.0):
            allowed = 1e-13 if e < 0.99 or not pericentre or e > 1 else 2e-12
            end = solver(orbit(), target).integrate(x, h, 1).x[-1]
            np.testing.assert_allclose(end, expected(x, h), rtol=0, atol=allowed, err_msg=f"e = {e}, h = {h}")


def test_the_expected_end_is_that_of_the_equations_of_motion():
    """The reference is a Runge–Kutta method, which does not use universal variables."""
    x, h = start(0.6), 1.5
    end = solve_ivp(
        lambda _, s: [*(s[3:] / MASS), *(-3 * s[:3] / np.linalg.norm(s[:3]) ** 3)],
        (0, h),
        x,
        "DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    np.testing.assert_allclose(expected(x, h), end.y[:, -1], rtol=0, atol=2e-12)


def test_a_parabola_and_what_is_next_to_it():
    for excess in (0, 1e-14, -1e-14, 1e-7):
        x = np.array([1, 0, 0, 0, MASS * np.sqrt(2 * MU) * (1 + excess), 0])
        for h in (0.1, 3.0, 50.0):
            end = solver(orbit(), "c").integrate(x, h, 1).x[-1]
            q = np.hypot(end[0], end[1])
            time = (2 * np.sqrt(q - 1) + 2 / 3 * (q - 1) ** 1.5) / np.sqrt(2 * MU)  # Barker's equation
            assert abs(time - h) < (1e-12 if excess == 0 else 1e-4) * h


def test_targets_agree_and_javascript_has_the_flow():
    x = start(0.9)
    c = solver(orbit(), "c").integrate(x, 0.8, 5).x[-1]
    js = javascript(orbit(), f"x0: {x.tolist()}", "s.integrate(0.8, 5)", "[...s.x]")
    np.testing.assert_allclose(js, c, rtol=1e-11)


@pytest.mark.parametrize("eccentricity", [0, 0.9, 1.5])
def test_the_derivative_of_the_flow_is_exact_and_symplectic(eccentricity):
    integrator = solver(orbit("tangent: true\n"), "c")
    x, h, d = start(eccentricity), 0.9, 1e-5
    _, tangent = integrator.step_tangent(x, h)
    pi = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    assert np.abs(tangent @ pi @ tangent.T - pi).max() < 1e-14 * np.abs(tangent).max() ** 2
    ends = [[integrator.integrate(x + s * d * row, h, 1).x[-1] for s in (2, 1, -1, -2)] for row in np.eye(6)]
    slopes = np.array([(8 * (b - c) - (a - e)) / (12 * d) for a, b, c, e in ends]).T
    np.testing.assert_allclose(tangent, slopes, atol=1e-7 * np.abs(slopes).max())


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_gradients_along_state_mass_and_strength_are_differences(target):
    integrator = solver(orbit("adjoint: true\n"), target)
    x, weights = start(0.6), np.array([1, -2, 0.5, 0.3, 1, -1.0])

    def loss(x, **parameters):
        return weights @ integrator.integrate(x, 0.7, 3, **parameters).x[-1]

    gradient = integrator.pullback(x, 0.7, 3, weights)
    d = 1e-5
    slopes = [(loss(x + d * row) - loss(x - d * row)) / (2 * d) for row in np.eye(6)]
    np.testing.assert_allclose(gradient.x0_bar, slopes, rtol=1e-6, atol=1e-6)
    for name, value in (("m", 2), ("k", 3)):
        slope = (loss(x, **{name: value + d}) - loss(x, **{name: value - d})) / (2 * d)
        assert gradient.parameters_bar[name] == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_members_do_what_single_trajectories_do(target):
    """Some members of a batch use the fast iteration, some are outside of its range, and one is on a radial orbit."""
    states = np.array([start(e, p) for e, p in ORBITS[1:]] + [[2, 0, 0, 0.5, 0, 0]])
    for h in (0.01, 0.4):
        together = solver(orbit(), target).ensemble(states, h, 4)
        alone = [solver(orbit(), "c").integrate(x, h, 4).x[-1] for x in states]
        np.testing.assert_allclose(together, alone, rtol=1e-9, atol=1e-11)


RADIAL = {
    "falls": ([1, 0, 0, 0, 0, 0], 0.6, True),
    "falls through": ([1, 0, 0, 0, 0, 0], 3.0, False),
    "rises and falls through": ([1, 0, 0, 1, 0, 0], 3.0, False),
    "escapes": ([1, 0, 0, 4, 0, 0], 30.0, True),
    "comes from afar, askew": ([*(-TURN[0]), *(40 * TURN[0])], 0.1, False),
    "comes back in time": ([1, 0, 0, 4, 0, 0], -3.0, False),
    "at the centre": ([0, 0, 0, 1, 0, 0], 0.1, False),
}


@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("case", RADIAL)
def test_a_collision_is_a_failed_step_that_leaves_the_state(case, target):
    x, h, possible = RADIAL[case]
    integrator = solver(orbit(), target)
    if possible:
        end = integrator.integrate(x, h, 1)
        assert np.ptp(end.energy) < 1e-12 * abs(end.energy[0])
        assert integrator.integrate(end.x[-1], -h, 1).x[-1] == pytest.approx(x, abs=1e-11)
        return
    with pytest.raises(StepError, match="NOT_FINITE") as failed:
        integrator.integrate(x, h, 1)
    np.testing.assert_array_equal(failed.value.trajectory.x[-1], x)


def test_repulsion_and_two_dimensions():
    text = ORBIT.replace("k: 3", "k: -3").replace(", z,", ",").replace(", pz]", "]").replace(" + pz**2", "")
    text = text.replace(" + z**2", "").replace("[x, y, z]", "[x, y]").replace("0, 0.1, 0, 2, 0.3", "0, -1, 0.5")
    compilation = compile_text(text, 4)
    run = solver(compilation, "c").integrate([1, 0, -3, 0.5], 0.5, 8)
    assert len(compilation.splitting.flows) == 1
    assert np.ptp(run.energy) < 1e-13
    assert run.x[-1, 0] > 1


def test_what_is_proved_fails_for_other_increments(monkeypatch):
    system = orbit().system
    parts = split(system)
    assert [s.verdict for s in check(system, parts)] == [PROVED] * 2
    flow = parts.flows[0]
    longer = replace(flow, increment=(flow.increment[0] * 2, *flow.increment[1:]))
    assert [s.verdict for s in check(system, replace(parts, flows=(longer,)))] == [PROVED, REFUTED]
    right = kepler._Orbit.end
    monkeypatch.setattr(kepler._Orbit, "end", lambda self, c, s: (*right(self, c, s)[:2], right(self, c, s)[2] + s))
    assert any(decide_zero("", [("", e)]).verdict == REFUTED for _, e in kepler.identities())


def test_beside_other_terms_the_parts_are_as_few_as_before():
    """Both splittings, T + V and a Kepler motion with a perturbation, have two parts; here the first one is
    preferred.
    """
    system = compile_text(ORBIT.replace("hamiltonian: ", "hamiltonian: 0.7*x**2 + "), 4).system
    assert [flow.has_motion for flow in split(system).flows] == [False, False]
