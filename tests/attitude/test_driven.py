"""Attitudes with forces, noise and monitors, compared with numerical solutions of q̇ = ½ q ∇H for the quaternion q."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import compile_text, javascript, solver

from phigen.proofs import attitude as proofs
from phigen.runtime.interface import BackendError
from phigen.symbolic.verdict import PROVED

BODY = """coordinates: [x, y, z]
poisson: {lie_algebra: {name: so(3), sign: minus}}
hamiltonian: x**2/2 + y**2/4 + z**2/6 + 0.1*x*z
casimirs: {C: x**2 + y**2 + z**2}
reconstruct: quaternion
gauge: none
"""
PUSHED = "forces: {covector: {x: 0.3*y*z}, vector: {z: 0.4 - 0.2*z, y: -0.1*y}}\n"
NOISE = "noise: {a: {hamiltonian: x, amplitude: 0.3}, b: {hamiltonian: y**2, amplitude: 0.2}}\n"
SPLIT = BODY.replace("x**2/2 + y**2/4 + z**2/6 + 0.1*x*z", "x**2/2 + y**2/4 + z**2/6 - 2") + "scheme: splitting\n"
CASES = {
    "pushed": BODY + PUSHED,
    "pushed and monitored": BODY + PUSHED + "monitor: 1/(1 + y**2)\n",
    "damped, along paths": BODY + "damping: 0.2\nbirealisation: karasev\n",
    "momenta in space": BODY.replace("minus", "plus") + PUSHED,
    "monitored": BODY + "monitor: 1/(1 + y**2)\n",
    "monitored by log": SPLIT + "monitor: log\nruns: {r: {initial: [0.5, 0.8, -0.4], step: 0.1, steps: 1}}\n",
    "split in time": SPLIT.replace("y**2/4 + z**2/6 - 2", "y**2/2*cos(t) + z**2/2*cos(t)") + "time: t\n",
    "split and shaken": SPLIT + NOISE,
    "split and pushed": SPLIT + "forces: {vector: {z: 0.4 - 0.2*z, y: -0.1*y}}\n",
    "shaken": BODY + NOISE,
}
pytestmark = pytest.mark.few("pushed", "damped, along paths", "monitored by log", "shaken", "split in time", of=CASES)
#: Cases for which the order is also measured with a method of order 4.
HIGHER = ("pushed", "pushed and monitored", "monitored", "monitored by log", "split in time")
START, SPAN = [0.5, 0.8, -0.4], 2.0
DRAWN = np.random.default_rng(3).normal(size=(8, 2)) * np.sqrt(SPAN / 8)


@cache
def made(case, order=2):
    return compile_text(CASES[case] + f"order: {order}\n")


def product(a, b):
    """Return the product of two quaternions (w, x, y, z)."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def slope(case, t, x):
    if "time" in case:
        return np.array([x[0], x[1] * np.cos(t), x[2] * np.cos(t)])
    if case in ("monitored by log", "split and shaken", "split and pushed"):
        return x / [1, 2, 3]
    return np.array([x[0] + 0.1 * x[2], x[1] / 2, x[2] / 3 + 0.1 * x[0]])


@cache
def reference(case, end):
    """Return x and the quaternion at the time ``end``, integrated by DOP853. With noise, the integration has eight
    pieces, in each of which the noise is constant.
    """
    integrator, state = solver(made(case), "numpy"), np.array([*START, 1.0, 0, 0, 0])

    def moving(t, y, push):
        x, q, rate, when = y[:3], y[3:], slope(case, t, y[:3]), [t] * ("time" in case)
        field = integrator.vector_field(x, *when)
        if "shaken" in case:
            extra = push[0] * 0.3 * np.array([1, 0, 0]) + push[1] * 0.2 * np.array([0, 2 * x[1], 0])
            rate, field = rate + extra, field + np.cross(x, extra)
        spin = np.array([0, *rate / 2])
        return [*field, *(product(spin, q) if "space" in case else product(q, spin))]

    pieces = DRAWN if "shaken" in case else [None]
    for push in pieces:
        h = end / len(pieces)
        increment = None if push is None else push / h
        state = solve_ivp(moving, (0, h), state, args=(increment,), method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return state


def along(n, parts):
    """Return the increments of the noise for n steps along a path that is a straight line in each eighth of the time. A
    step uses ``parts`` equal increments of each source.
    """
    return np.tile(np.repeat(DRAWN, n // 8, axis=0) / (n // 8) / parts, parts)


def final(case, n, order=2, target="numpy"):
    """Return the last state and attitude of n steps as one array, and the time."""
    about = {"increments": along(n, len(CASES[case].split("scheme")))} if "shaken" in case else {}
    run = solver(made(case, order), target).integrate(START, SPAN / n, n, n, **about)
    return np.array([*run.x[-1], *run.attitude[-1]]), run.t[-1]


@pytest.mark.thin(2)
@pytest.mark.parametrize(("case", "order"), [(c, k) for c in CASES for k in (2, 4) if k == 2 or c in HIGHER])
def test_momentum_and_attitude_have_the_order(case, order):
    """If the group element that updates the attitude contained the term hζ of a force covector ζ, or if the momentum
    lacked it, the attitude of a damped body would have an error of order 0.
    """
    errors = []
    for n in (16, 32):
        state, t = final(case, n, order)
        errors.append(np.abs(state - reference(case, t)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)


@pytest.mark.thin(3)
@pytest.mark.parametrize("case", CASES)
def test_c_and_javascript_agree_with_numpy(case):
    expected = final(case, 16)[0]
    assert final(case, 16, 2, "c")[0] == pytest.approx(expected, abs=1e-13)
    if "shaken" not in case:  # the noise of the cases "shaken" is given by increments
        run = javascript(made(case), f"x0: {START}", f"s.integrate({SPAN / 16}, 16)", "[...s.x, ...s.attitude]")
        assert run == pytest.approx(expected, abs=1e-13)


def test_the_attitude_is_that_of_the_state_where_an_increment_is_refused():
    backend, h = solver(made("shaken"), "c").backend, 0.1
    increments = np.array([[0.1, -0.2], [0.3, np.nan]])
    stopped, whole = backend.start(np.array(START), {}), backend.start(np.array(START), {})
    whole.advance_along(h, increments[:1])
    with pytest.raises(BackendError, match="BAD_ARGUMENT"):
        stopped.advance_along(h, increments)
    assert (stopped.steps, [*stopped.state(), *stopped.element()]) == (1, [*whole.state(), *whole.element()])


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("target", ["c", "numpy"])
@pytest.mark.parametrize("case", CASES)
def test_members_have_the_bits_of_runs_alone(case, target):
    """Each member has its own step size, start time, path of the noise and attitude. Stored rows have the bits of
    single runs. Without stored rows, the last attitude agrees to round-off.
    """
    integrator, count = solver(made(case), target), 3
    rng = np.random.default_rng(1)
    x0, q0, h = rng.normal(size=(count, 3)), rng.normal(size=(count, 4)), np.array([0.1, 0.07, 0.11])
    timed = {"t0": np.array([0.0, 0.4, 2.0])} if integrator.interface.time else {}
    drawn = {"seed": 5, "member": 3} if integrator.interface.noise else {}
    members = integrator.attitudes(x0, h, 10, 4, attitude0=q0, **timed, **drawn)
    ends = integrator.attitudes(x0, h, 10, attitude0=q0, **timed, **drawn)
    for m in range(count):
        member_values = {name: values[m] for name, values in timed.items()}
        member_values |= {"seed": 5, "member": 3 + m} if drawn else {}
        alone = integrator.integrate(x0[m], h[m], 10, 4, attitude0=q0[m], **member_values)
        assert np.array_equal(members.x[:, m], alone.x)
        assert np.array_equal(members.attitude[:, m], alone.attitude)
        assert ends.attitude[m] == pytest.approx(alone.attitude[-1], abs=1e-15)


@pytest.mark.parametrize("case", ["monitored", "monitored by log", "shaken", "split and shaken"])
def test_the_momentum_in_space_is_constant(case):
    """A monitor and noise enter the step by Hamiltonians, so the attitude moves with the momentum, and the momentum in
    space is constant.
    """
    run = solver(made(case), "c").integrate(START, 0.1, 2000, 50)
    w, u = run.attitude[:, :1], run.attitude[:, 1:]
    in_space = run.x + 2 * (w * np.cross(u, run.x) + np.cross(u, np.cross(u, run.x)))
    assert np.abs(in_space - START).max() < 1e-13


@pytest.mark.parametrize("case", CASES)
def test_what_is_stated_is_proved_and_no_more(case):
    stated = list(proofs.check(made(case)))
    assert stated
    assert all(s.holds if "split" in CASES[case] else s.verdict == PROVED for s in stated)
    states_momentum = any("Ad*" in s.name for s in stated)
    assert "split" in CASES[case] or states_momentum == (
        not any(word in CASES[case] for word in ("covector", "damping"))
    )
