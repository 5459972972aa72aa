"""The Moon about an oblate Earth on T*R³ × so(3)*: motions and spin in one part, few steps, and exact invariants."""

from functools import cache

import numpy as np
import pytest
from support import TARGETS, javascript, solver
from systems import spec_of

from phigen import compiler
from phigen.compiler import compile_spec
from phigen.splitting.parts import split

SPEC = spec_of("earth_moon")
START = np.array([float(v) for v in SPEC.runs["years"].initial])
MONTH = 27.3
#: Energy of the orbit; errors are relative to it. The energy of the spin is larger.
ORBIT = 1.2


@cache
def earth_moon():
    return compile_spec(SPEC)


def energy_error(integrator, steps_of_month, months=40):
    run = solver(integrator, "c").integrate(
        START, MONTH / steps_of_month, months * steps_of_month, stride=steps_of_month
    )
    return np.abs(run.energy - run.energy[0]).max() / ORBIT


def test_orbit_and_spin_are_one_part_and_the_oblateness_is_the_small_one():
    a, b = earth_moon().splitting.flows
    assert a.has_motion
    assert not b.has_motion
    assert earth_moon().splitting.small == 1
    assert earth_moon().program.step.composition == "aba-10-6-4"


@pytest.mark.slow
def test_two_steps_a_month_are_as_good_as_forty_of_kinetic_energy_and_potential(monkeypatch):
    """Compare methods of order 4 of both splittings at an energy error of 1e-8."""
    monkeypatch.setattr(compiler, "split", lambda system, **_: split(system, motions=False))
    plain = compile_spec(SPEC)
    assert not any(flow.has_motion for flow in plain.splitting.flows)
    assert energy_error(earth_moon(), 2) < 1e-8
    assert energy_error(plain, 40) > 1e-8


def test_spin_and_total_angular_momentum_are_kept_to_rounding():
    run = solver(earth_moon(), "c").integrate(START, 3, 3000, stride=100)
    q, p, s = run.x.reshape(-1, 3, 3).transpose(1, 0, 2)
    total = np.cross(q, p) + s
    assert np.ptp(np.linalg.norm(s, axis=1)) < 1e-13
    assert np.ptp(total, axis=0).max() < 1e-13 * np.linalg.norm(total[0])
    assert np.ptp(s, axis=0).max() > 1e-3  # the spin precesses


def test_a_step_is_a_poisson_map():
    integrator = solver(compile_spec(SPEC, tangent=True), "c")
    end, tangent = integrator.step_tangent(START, 5.0)

    def poisson(x):
        s1, s2, s3 = x[6:]
        spin = np.array([[0, s3, -s2], [-s3, 0, s1], [s2, -s1, 0]])
        zero, one = np.zeros((3, 3)), np.eye(3)
        return np.block([[zero, one, zero], [-one, zero, zero], [zero, zero, spin]])

    defect = tangent @ poisson(START) @ tangent.T - poisson(end)
    assert np.abs(defect).max() < 1e-13 * np.abs(tangent).max() ** 2


def test_targets_agree():
    ends = [solver(earth_moon(), target).integrate(START, 3, 20).x[-1] for target in TARGETS]
    ends.append(javascript(earth_moon(), f"x0: {START.tolist()}", "s.integrate(3, 20)", "[...s.x]"))
    np.testing.assert_allclose(ends, ends[:1] * len(ends), rtol=0, atol=1e-11)


@pytest.mark.slow
def test_gradients_are_differences():
    integrator = solver(compile_spec(SPEC, adjoint=True), "c")
    bar, d = np.random.default_rng(3).normal(size=9), 1e-4

    def value(oblateness):
        return float(bar @ integrator.integrate(START, 3, 30, J2=oblateness).x[-1])

    points = [value(0.00108263 + s * d) for s in (2, 1, -1, -2)]
    slope = (8 * (points[1] - points[2]) - (points[0] - points[3])) / (12 * d)
    assert integrator.pullback(START, 3, 30, bar).parameters_bar["J2"] == pytest.approx(slope, rel=1e-7)
