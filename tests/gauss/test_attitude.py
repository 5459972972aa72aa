"""Attitudes from Gauss steps: the quaternion of the group element, for body and space frames, and with a position."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import compile_text, solver

BODY = """coordinates: [x1, x2, x3]
poisson: {{lie_algebra: {{name: so(3), sign: {sign}}}}}
hamiltonian: (x1**2 + x2**2/2 + x3**2/3)/2{more}
casimirs: {{C: x1**2 + x2**2 + x3**2}}
reconstruct: quaternion
scheme: gauss
"""
MOTION = """coordinates: [m1, m2, m3, p1, p2, p3]
poisson: {{lie_algebra: {{name: se(3), sign: {sign}}}}}
hamiltonian: (m1**2 + m2**2/2 + m3**2/3)/2 + p1**2/3 + p2**2/5 + p3**2/4 + m1*p2/5
reconstruct: quaternion
scheme: gauss
"""
START = np.array([0.8, -0.5, 0.7])


def rotation(q):
    """Return the rotation matrix of a unit quaternion."""
    w, u = q[0], q[1:]
    return np.stack([v + 2 * (w * np.cross(u, v) + np.cross(u, np.cross(u, v))) for v in np.eye(3)], axis=-1)


def hat(v):
    """Return the matrix of the map u ↦ v × u."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.thin(2, of_all=1)
@pytest.mark.parametrize("target", ["c", "small", "numpy"])
@pytest.mark.parametrize("sign", ["minus", "plus"])
def test_momentum_in_the_other_frame_is_constant_for_large_steps(sign, target):
    """The attitude transforms the momentum between body and space frame; in the other frame the momentum is constant
    for any step size. This includes the rotation that `gauge: auto` causes when it subtracts a multiple of a Casimir
    from a quadratic H.
    """
    profile = "profile: small\n" if target == "small" else ""
    text = BODY.format(sign=sign, more="") + profile
    run = solver(compile_text(text, 8), "numpy" if target == "numpy" else "c").integrate(START, 1.5, 50)
    turned = rotation(run.attitude[-1])
    other = turned @ run.x[-1] if sign == "minus" else turned.T @ run.x[-1]
    assert other == pytest.approx(START, abs=2e-13)


@pytest.mark.parametrize("sign", ["minus", "plus"])
def test_attitude_and_position_have_the_order_of_the_method(sign):
    """Errors of attitude g and position decrease with the order of the method, compared with a solution of ġ = gΩ or ġ
    = Ωg by DOP853, where Ω is the matrix of the angular velocity.
    """
    compilation = compile_text(MOTION.format(sign=sign), 4)
    method, start = solver(compilation, "c"), np.array([*START, 0.4, -0.6, 0.3])
    left = sign == "plus"

    def field(t, y):
        m, p, turned = y[:3], y[3:6], y[9:].reshape(3, 3)
        omega = np.array([m[0] + p[1] / 5, m[1] / 2, m[2] / 3])
        v = np.array([2 * p[0] / 3, 2 * p[1] / 5 + m[0] / 5, p[2] / 2])
        moved = [np.cross(m, omega) + np.cross(p, v), np.cross(p, omega)]
        position = np.cross(omega, y[6:9]) + v if left else turned @ v
        change = hat(omega) @ turned if left else turned @ hat(omega)
        momenta = [-moved[0], -moved[1]] if left else moved
        return np.concatenate([*momenta, position, change.ravel()])

    begin = np.concatenate([start, np.zeros(3), np.eye(3).ravel()])
    exact = solve_ivp(field, (0.0, 4.0), begin, method="DOP853", rtol=3e-14, atol=1e-14).y[:, -1]
    errors = []
    for n in (40, 80):
        run = method.integrate(start, 4.0 / n, n)
        final = np.concatenate([run.position[-1], rotation(run.attitude[-1]).ravel()])
        errors.append(np.abs(final - exact[6:]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.2)
    assert errors[1] < 1e-4


def test_members_have_the_attitudes_of_single_runs():
    method = solver(compile_text(BODY.format(sign="minus", more=" + x1*x2**2/5"), 8), "c")
    starts = np.array([START, -START, 2 * START])
    together = method.attitudes(starts, 0.2, 10)
    for k, start in enumerate(starts):
        assert together.attitude[k] == pytest.approx(method.integrate(start, 0.2, 10).attitude[-1], abs=1e-15)
