"""The flow of a free rigid body, as one part of H: elliptic functions, steps of any size, derivatives."""

import math
from functools import cache
from itertools import product

import mpmath
import numpy as np
import pytest
from scipy import integrate, special
from support import compile_text, javascript, solver

from phigen.attitude import free_bodies
from phigen.proofs import attitude as attitudes
from phigen.splitting import euler
from phigen.splitting.statements import check
from phigen.symbolic import elliptic
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

SO3 = "coordinates: [x, y, z]\npoisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}}}\n"
BODY = (
    f"{SO3}parameters: {{A: 1, B: 2, C: 3}}\nhamiltonian: (x**2/A + y**2/B + z**2/C)/2\nscheme: splitting\n"
    "casimirs: {S: x**2 + y**2 + z**2}\nruns: {one: {initial: [0.3, -0.5, 0.8], step: 0.1, steps: 10}}\n"
)
#: Moments of inertia: three different ones, symmetric bodies, and nearly symmetric ones.
MOMENTS = [(1, 2, 3), (1, 1, 3), (3, 2, 2), (1, 1 + 1e-9, 2)]
#: Starts: near the separatrix, on it, on the axes, elsewhere, and at rest.
STARTS = [
    (1e-2, 1, 1e-2), (1e-8, 1, 0), (np.sqrt(3) / 2, 0, 0.5), (1, 0, 0), (0, 1, 0), (0, 0, -1), (0.3, -0.5, 0.8),
    (0, 0, 0),
]  # fmt: skip
STEPS = (1e-3, 0.7, -4.0, 30.0)


@cache
def body(extras=""):
    return compile_text(BODY + extras, 4)


def expected(x, moments, h):
    """Return the end of a step by a Taylor method in 30 digits, which does not use elliptic functions."""
    with mpmath.workdps(30):
        a = [1 / mpmath.mpf(m) for m in moments]
        factors = [a[2] - a[1], a[0] - a[2], a[1] - a[0]]
        x, count = [mpmath.mpf(float(e)) for e in x], 1 + int(abs(h) * 2)
        for _ in range(count):
            x = _taylor(x, factors, mpmath.mpf(h) / count)
        return np.array([float(e) for e in x])


def _taylor(x, factors, h, order=28):
    terms = [[e] for e in x]
    for n in range(order):
        sums = [
            factors[i] * mpmath.fdot(terms[(i + 1) % 3], list(reversed(terms[(i + 2) % 3]))) / (n + 1) for i in range(3)
        ]
        for listed, e in zip(terms, sums, strict=True):
            listed.append(e)
    return [mpmath.polyval(list(reversed(listed)), h) for listed in terms]


@pytest.mark.thin(4)
@pytest.mark.parametrize("moments", MOMENTS)
def test_a_step_of_any_size_ends_on_the_orbit_to_rounding(moments):
    """The derivative of the flow multiplies the rounding errors of the start by at most 1e3 in these steps."""
    values = dict(zip("ABC", moments, strict=True))
    for start, h in product(STARTS, STEPS):
        x = np.array(start)
        exact = expected(x, moments, h)
        for target in ("c", "numpy"):
            end = solver(body(), target).integrate(x, h, 1, **values).x[-1]
            allowed = 3e-16 + 2e-15 * abs(h) * (1 if abs(h) < 10 else 1e4)
            np.testing.assert_allclose(end, exact, rtol=0, atol=allowed, err_msg=f"{start}, h = {h}, {target}")
            for weights in (np.ones(3), 1 / np.array(moments)):
                assert abs(weights @ end**2 - weights @ x**2) <= 3e-15 * (weights @ x**2)


def test_small_increments_have_all_digits():
    """Compensated sums add increments to the state, so the error relative to the increment matters, not that relative
    to the state.
    """
    x, h = np.array([0.3, -0.5, 0.8]), 1e-6
    integrator = solver(compile_text(BODY.replace("scheme", "profile: small\nscheme"), 4), "c")
    session = integrator.session(np.array(x))
    session.step(h, 1000)
    np.testing.assert_allclose(session.x - x, expected(x, (1, 2, 3), 1000 * h) - x, rtol=1e-12)


def test_targets_agree_and_javascript_has_the_flow():
    x = np.array([0.3, -0.5, 0.8])
    for h in (0.4, 11.0):
        c = solver(body(), "c").integrate(x, h, 5).x[-1]
        js = javascript(body(), f"x0: {x.tolist()}", f"s.integrate({h}, 5)", "[...s.x]")
        np.testing.assert_allclose(js, c, rtol=0, atol=3e-15)


def test_members_in_lanes_are_those_one_by_one():
    """Some steps exceed the range of the lane functions, and some states are at rest."""
    integrator = solver(body("adjoint: true\n"), "c")
    states = np.concatenate([np.array(STARTS), np.random.default_rng(2).normal(size=(29, 3))])
    for h in (0.05, 0.7, 6.0):
        together = integrator.ensemble(states, h, 4)
        alone = [integrator.integrate(x, h, 4).x[-1] for x in states]
        np.testing.assert_allclose(np.asarray(together).reshape(len(states), 3), alone, rtol=0, atol=1e-14)
    weights = np.tile([1.0, -2.0, 0.5], (len(states), 1))
    batched = integrator.pullback(states, 0.3, 3, weights).x0_bar
    alone = [integrator.pullback(x, 0.3, 3, w).x0_bar for x, w in zip(states, weights, strict=True)]
    np.testing.assert_allclose(batched, alone, rtol=0, atol=1e-13)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_the_derivative_of_the_flow_is_exact_and_poisson(target):
    integrator, d = solver(body("tangent: true\n"), target), 1e-5
    for start, h in product(STARTS[:-1], (0.1, 2.0, 9.0)):
        x = np.array(start)
        end, tangent = integrator.step_tangent(x, h)
        moved = tangent @ _bracket(x) @ tangent.T
        assert np.abs(moved - _bracket(end)).max() < 1e-15 * (1 + np.abs(tangent).max() ** 2)
        ends = [[integrator.integrate(x + s * d * row, h, 1).x[-1] for s in (2, 1, -1, -2)] for row in np.eye(3)]
        slopes = np.array([(8 * (b - c) - (a - e)) / (12 * d) for a, b, c, e in ends]).T
        np.testing.assert_allclose(tangent, slopes, atol=1e-9 * max(1, np.abs(slopes).max() ** 3))


def _bracket(x):
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_gradients_along_state_and_moments_are_differences(target):
    integrator = solver(body("adjoint: true\n"), target)
    x, weights, d = np.array([0.3, -0.5, 0.8]), np.array([1, -2, 0.5]), 1e-5
    for h in (0.7, 5.0):
        gradient = integrator.pullback(x, h, 3, weights)
        for name, value in (("A", 1.0), ("B", 2.0), ("C", 3.0)):
            above, below = (weights @ integrator.integrate(x, h, 3, **{name: value + s}).x[-1] for s in (d, -d))
            assert gradient.parameters_bar[name] == pytest.approx((above - below) / (2 * d), rel=1e-7)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_derivatives_are_exact_where_the_state_is_on_the_separatrix_to_the_last_digit(target):
    """On the separatrix two of the E_i are equal, in floating point too, and their derivatives are not."""
    x, weights, moments, d = np.array([0.5, 0, 1]), np.array([1, -2, 0.5]), np.array([0.25, 1, 4]), 1e-3
    integrator = solver(body("adjoint: true\n"), target)

    def value(*shifts):
        ends = integrator.integrate(x + shifts[:3], 0.2, 3, **dict(zip("ABC", moments + shifts[3:], strict=True)))
        return weights @ ends.x[-1]

    gradient = integrator.pullback(x, 0.2, 3, weights, **dict(zip("ABC", moments, strict=True)))
    f = [[value(*(s * d * row)) for s in (2, 1, -1, -2)] for row in np.eye(6) * ([1] * 3 + [*moments / 4])]
    slopes = np.array([(8 * (b - c) - (a - e)) / (12 * d) for a, b, c, e in f]) / ([1] * 3 + [*moments / 4])
    assert np.abs(slopes).min() > 0.01
    np.testing.assert_allclose([*gradient.x0_bar, *gradient.parameters_bar.values()], slopes, rtol=0, atol=1e-7)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_body_about_its_middle_axis_does_not_turn_over_by_rounding(target):
    integrator = solver(body("adjoint: true\n"), target)
    for h, y in product((100.0, -100.0, 1e3), (1.0, 2 / 3, 0.3, *np.linspace(0.7, 2, 30))):
        x = np.array([0.0, y, 0.0])
        for moments in ((0.25, 1, 4), (1, 2, 3), (5, 3, 2)):
            end = integrator.integrate(x, h, 1, **dict(zip("ABC", moments, strict=True))).x[-1]
            np.testing.assert_array_equal(end, x)


def test_the_flow_is_proved_and_a_wrong_sign_is_refuted(monkeypatch):
    assert {s.verdict for s in check(body().system, body().splitting)} == {PROVED}
    genuine = euler._ends
    monkeypatch.setattr(euler, "_ends", lambda x, f, sigma, s, *rest: genuine(x, f, sigma, -s, *rest))
    assert decide_zero("", list(euler.identities()), ()).verdict == REFUTED


def test_the_time_of_turning_over_has_all_digits_close_to_the_separatrix():
    """The difference of P and Q is 1e-16 here. The errors are those of C in the middle of a reversal, 2e-16 over C."""
    for start, h, allowed in (((1e-8, 1, 1e-8), 70.0, 3e-8), ((1e-8, 1, 1.7e-8), 120.0, 1e-15)):
        x = np.array(start)
        exact = expected(x, (1, 2, 3), h)
        for target in ("c", "numpy"):
            end = solver(body(), target).integrate(x, h, 1).x[-1]
            np.testing.assert_allclose(end, exact, rtol=0, atol=allowed)


def _attitude(x, moments, h, sign):
    """Return the attitude after a time by a method of order 8, a rotation matrix; ``sign`` is −1 for momenta in
    space.
    """
    inverse = 1 / np.array(moments)

    def rates(_, y):
        spin = inverse * y[9:]
        skew, g = _bracket(spin), y[:9].reshape(3, 3)
        return np.concatenate([(skew @ g if sign < 0 else g @ skew).ravel(), sign * np.cross(y[9:], spin)])

    y = integrate.solve_ivp(rates, (0, h), [*np.eye(3).ravel(), *x], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return y[:9].reshape(3, 3)


def _matrix(q):
    """Return the matrix of a quaternion, or a matrix unchanged."""
    if np.size(q) == 9:
        return np.reshape(q, (3, 3))
    skew = _bracket(q[1:])
    return np.eye(3) + 2 * q[0] * skew + 2 * skew @ skew


#: The sign of the bracket, and the kind of attitude.
ATTITUDES = [(1, "quaternion"), *(pytest.param(-1, kind, marks=pytest.mark.slow) for kind in ("quaternion", "matrix"))]


@pytest.mark.parametrize(("sign", "kind"), ATTITUDES)
def test_the_attitude_of_the_exact_flow_is_exact(sign, kind):
    """The attitude is exact for steps of any size, all orders of the moments, momenta in the body and in space, in all
    targets.
    """
    spatial = BODY.replace("-", "+") if sign < 0 else BODY
    spatial = spatial.replace("+0.5", "-0.5").replace("y: +z, z: y}, y: {z: +x", "y: z, z: -y}, y: {z: x")
    compiled = compile_text(f"{spatial}reconstruct: {kind}\n", 4)
    assert compiled.splitting.flows[0].has_motion
    assert kind == "quaternion" or {s.verdict for s in attitudes.check(compiled)} == {PROVED}
    for moments, start, h in ((MOMENTS[0], 2, 0.7), ((3, 1, 2), 6, -4.0), ((2, 3, 1), 0, 30.0), ((2, 2, 2), 6, 2.0),
                              (MOMENTS[1], 5, 9.0), (MOMENTS[0], 7, 1.0), (MOMENTS[3], 6, 0.01)):  # fmt: skip
        x, values = np.array(STARTS[start]), dict(zip("ABC", moments, strict=True))
        final_attitudes = [
            solver(compiled, target).integrate(x, h, 1, **values).attitude[-1] for target in ("c", "numpy")
        ]
        if start == 2:
            final_attitudes.append(javascript(compiled, f"x0: {x.tolist()}", f"s.integrate({h}, 1)", "[...s.attitude]"))
        exact = _attitude(x, moments, h, sign)
        for q in final_attitudes:
            np.testing.assert_allclose(_matrix(q), exact, rtol=0, atol=1e-12 if abs(h) < 10 else 1e-11)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_attitudes_lose_digits_only_where_the_momentum_turns_over(target):
    """The error grows as 1/(1 + x·x'/|x|²), where x' is the end of the step; 1 + x·x'/|x|² is 2e-8 after the time 69.8,
    and 2 after two reversals. Short steps lose no digits.
    """
    x, solve = np.array([1e-4, 1.0, 0.7e-4]), solver(body("reconstruct: quaternion\n"), target)
    for h, allowed in ((69.818, 2.5e-8), (140.0, 2e-12)):
        run, short = solve.integrate(x, h, 1), solve.integrate(x, h / 500, 500)
        nu = 1 + run.x[-1] @ x / (x @ x)
        assert (nu < 2e-8) == (h < 100)
        np.testing.assert_allclose(_matrix(run.attitude[-1]), _matrix(short.attitude[-1]), rtol=0, atol=allowed)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_quaternions_of_long_steps_keep_their_length(target):
    """The real part of a quaternion may be negative; a correction of its length with the wrong sign would
    increase it.
    """
    x = np.array([0.3, 0.2, 1.0])
    run = solver(body("reconstruct: quaternion\n"), target).integrate(x, -50.0, 40)
    space = [_matrix(q) @ y for q, y in zip(run.attitude, run.x, strict=True)]
    np.testing.assert_allclose(space, np.broadcast_to(x, (41, 3)), rtol=0, atol=1e-14)


def test_a_wrong_rate_of_the_attitude_is_refuted(monkeypatch):
    """The residual is evaluated at numbers, since a refutation by polynomials takes ten seconds."""
    ((_, residual),) = free_bodies._angle((0, 2, 1))
    values = {s: 0.3 + 0.17 * k for k, s in enumerate(sorted(symbols_of(residual), key=str))}
    assert abs(evaluate([residual], values)[0]) < 1e-13
    monkeypatch.setattr(
        free_bodies._SortedAxes, "linear", property(lambda axes: (axes.weights[0], axes.betas[2] * axes.n))
    )
    ((_, residual),) = free_bodies._angle((0, 2, 1))
    assert abs(evaluate([residual], values)[0]) > 1e-2


def test_where_the_body_is_split_in_rotations():
    named = compile_text(BODY + "composition: blanes-moan\n", 4)
    linear = compile_text(BODY.replace("/2\nscheme", "/2 + 0.1*x\nscheme"), 4)
    hyperbolic = BODY.replace("y: {z: -x}", "y: {z: x}").replace("casimirs: {S: x**2 + y**2 + z**2}\n", "")
    other_brackets = compile_text(hyperbolic, 4)
    assert len(named.splitting.flows) == 2
    assert not any(f.has_motion for c in (named, other_brackets) for f in c.splitting.flows)
    assert [f.has_motion for f in linear.splitting.flows].count(True) == 1


#: Pairs (t√P, Q/P), with small arguments, many revolutions, and both ends of the modulus.
ARGUMENTS = [(u, m) for u in (1e-3, 0.3, 0.999, 1.001, 2.5, -7.0, 300.0) for m in (0, 1e-12, 0.3, 0.9, 1 - 1e-4)]


@pytest.mark.parametrize("p", [1.0, 0.0625])
def test_the_amplitude_is_that_of_jacobi(p):
    for u, m in ARGUMENTS:
        t = u / np.sqrt(p)
        kappa = elliptic.value(math, t, p, (1 - m) * p)
        s, c, square = elliptic.functions_of(kappa, p, (1 - m) * p)
        sn, cn, dn, _ = special.ellipj(u, m)
        computed = [np.sqrt(p) * s, c, np.sqrt(square)]
        np.testing.assert_allclose(computed, [sn, cn, dn], rtol=0, atol=1e-14 * (1 + abs(u)))


def test_the_integrals_are_those_of_the_second_kind():
    """∫sn² dt is (u − E(am))/m, and Carlson's R_D agrees with that of mpmath."""
    for u, m in ARGUMENTS:
        if m > 1e-3:
            _, _, _, phi = special.ellipj(u, m)
            exact = (u - special.ellipeinc(phi, m)) / m
            if abs(u) > 0.1:
                assert elliptic.squares(math, u, 1.0, 1 - m) == pytest.approx(exact, rel=1e-12)
    for x, y, z in ((0.5, 0.7, 1), (0, 1, 1e-3), (0.2, 1, 0.3), (0, 1e-9, 1)):
        assert elliptic.carlson(math, x, y, z) == pytest.approx(float(mpmath.elliprd(x, y, z)), rel=3e-15)
