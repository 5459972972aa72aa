"""Paths that are too long for one Taylor expansion, and paths that leave the domain or reach infinity."""

import mpmath
import numpy as np
import pytest
from precise_path import PATH_DIGITS, PrecisePathStep, PreciseSystem, by_paths, compile_paths
from support import BODY, TARGETS, RawC, gradient, slow_but, solver, values

from phigen import StepError

EPS = np.finfo(float).eps

#: Systems with linear H: coordinates, bracket, H, start and step size. Then p = h ∇H is constant, and a step is the
#: exact flow for any length of the path.
LONG = [
    ("[x, y, z]", "{matrix: [[0, -z, y], [z, 0, -x], [-y, x, 0]]}", "3*x - y + 2*z", (0.3, -0.8, 0.5), 9.0),
    ("[x, y]", "{brackets: {x: {y: x*y}}}", "x - 2*y", (0.4, 0.3), 9.0),
    ("[x, y]", "{brackets: {x: {y: 1 + sin(x)*cos(y)}}}", "x + y/3", (0.4, 0.3), 25.0),
    ("[x, y]", "{brackets: {x: {y: 1/(1 + x**2 + y**2)}}}", "x + y/3", (0.4, 0.3), 9.0),
    ("[x, y, z]", "{nambu: [x*y*z + sqrt(1 + x**2)]}", "x + y - z/2", (0.4, 0.3, 0.2), 2.0),
]


LONG_TEXT = """coordinates: [x, y, z]
poisson: {{matrix: [[0, -z, y], [z, 0, -x], [-y, x, 0]]}}
hamiltonian: {hamiltonian}
"""


@pytest.mark.thin(3)
@pytest.mark.parametrize("target", slow_but(["c"], TARGETS))
@pytest.mark.parametrize(("coordinates", "form", "hamiltonian", "start", "h"), slow_but(LONG[1:4], LONG))
def test_long_path_is_followed_in_pieces(coordinates, form, hamiltonian, start, h, target):
    compilation = compile_paths(f"coordinates: {coordinates}\npoisson: {form}\nhamiltonian: {hamiltonian}\n", 2)
    with mpmath.workdps(PATH_DIGITS):
        system = PreciseSystem(compilation, {})
        p = [h * v for v in values(gradient(compilation.system.hamiltonian, system.coordinates), system.at(start))]
        end = [float(v) for v in system.path([mpmath.mpf(v) for v in start], p)[0]]
    solve = solver(compilation, target)
    assert np.max(np.abs(solve.step(start, h=h) - end)) < 200 * EPS * max(1, *np.abs(end))
    assert np.max(np.abs(solve.step(end, h=-h) - start)) < 2000 * EPS * max(1, *np.abs(end))


@pytest.mark.slow
@pytest.mark.parametrize("target", slow_but(["c"], TARGETS))
def test_mean_of_a_path_in_pieces_enters_the_equation(target):
    text = LONG_TEXT.format(hamiltonian="3*x - y + 2*z + (x**2 + y*z)/40")
    compilation, start, h = compile_paths(text, 2), (0.3, -0.8, 0.5), 1.0
    image = [float(v) for v in PrecisePathStep(compilation, {}, h)(start)]
    assert np.max(np.abs(solver(compilation, target).step(start, h=h) - image)) < 100 * EPS
    plain = compile_paths(LONG_TEXT.format(hamiltonian="3*x - y + 2*z"), 2)
    assert np.max(np.abs(solver(plain, target).step(start, h=h) - image)) > 1e-3


def test_rotation_by_many_turns_keeps_the_norm():
    compilation = compile_paths(BODY.replace("x1**2/2 + x2**2/4 + x3**2/6", "x1"), 2)
    start = np.array([0.2, 0.5, -0.7])
    for h in (1.0, 10.0, 60.0):
        end = solver(compilation, "c").step(start, h=h)
        assert abs(end @ end - start @ start) < 100 * EPS
        turned = np.cos(h) * start[1] + np.sin(h) * start[2], np.cos(h) * start[2] - np.sin(h) * start[1]
        assert np.max(np.abs(end[1:] - turned)) < 100 * EPS * h or np.max(np.abs(end[1:] - _other(h, start))) < 1e-12


def _other(h, start):
    return np.cos(h) * start[1] - np.sin(h) * start[2], np.cos(h) * start[2] + np.sin(h) * start[1]


POLE = """coordinates: [x, y]
poisson: {brackets: {x: {y: x**2}}}
hamiltonian: y
"""


def test_path_to_infinity_is_reported_and_the_state_kept():
    # The solution x(h) = x/(1 - h x) of x' = x² becomes infinite at h = 1/x.
    compilation, start = compile_paths(POLE, 2), (0.5, 0.25)
    raw = RawC(compilation)
    raw.init(start)
    assert raw.step(1.0) == 0
    assert abs(raw.x[0] - 1) < 4 * EPS
    for h in (1.0, 1.5, -np.inf, 1e300):
        before = raw.x.copy(), int(raw.counters[0])
        assert raw.step(h) != 0
        assert np.array_equal(raw.x, before[0])
        assert raw.counters[0] == before[1]
    assert raw.step(-1.0) == 0
    assert abs(raw.x[0] - 0.5) < 4 * EPS
    for target in TARGETS:
        with pytest.raises(StepError):
            solver(compilation, target).step(start, h=3.0)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", TARGETS)
def test_path_out_of_the_domain_is_reported(target):
    compilation = compile_paths("coordinates: [x, y]\npoisson: {brackets: {x: {y: log(x)}}}\nhamiltonian: y - x*y\n", 2)
    solve = solver(compilation, target)
    assert np.isfinite(solve.step((0.5, 0.1), h=0.2)).all()
    with pytest.raises(StepError):
        solve.step((-0.5, 0.1), h=0.2)
    with pytest.raises(StepError) as caught:
        solve.integrate((0.5, 0.1), h=50.0, steps=4)
    assert caught.value.trajectory.x[-1] == pytest.approx([0.5, 0.1])


def test_mean_out_of_the_domain_of_the_hamiltonian_is_reported_and_the_state_kept():
    text = "coordinates: [x, y]\npoisson: {brackets: {x: {y: 1}}}\nhamiltonian: sqrt(x) + 3*y\n"
    compilation = compile_paths(text, 2)
    raw = RawC(compilation)
    raw.init((0.5, 0.25))
    assert raw.step(-1.0) != 0
    assert list(raw.x) == [0.5, 0.25]
    assert raw.step(1.0) == 0
    with pytest.raises(StepError):
        solver(compilation, "numpy").step((0.5, 0.25), h=-1.0)


@pytest.mark.parametrize("target", TARGETS)
def test_one_member_that_fails_does_not_fail_the_others(target):
    solve = solver(compile_paths(POLE, 2), target)
    states = np.array([[0.2, 0.1], [2.0, 0.1], [0.4, 0.3]])
    with pytest.raises(StepError):
        solve.ensemble(states, h=1.0, steps=1)
    good = solve.ensemble(states[[0, 2]], h=1.0, steps=1)
    assert np.max(np.abs(good[:, 0] - states[[0, 2], 0] / (1 - states[[0, 2], 0]))) < 4 * EPS


def test_steps_too_large_for_the_equation_fail_cleanly():
    compilation = compile_paths(BODY.replace("x1**2/2", "x1**2*x2**2"), 4)
    raw = RawC(compilation)
    raw.init((1.0, 0.7, -0.4))
    statuses = set()
    for h in np.geomspace(0.1, 1000, 30):
        before = raw.x.copy()
        status = raw.step(h)
        statuses.add(status)
        if status:
            assert np.array_equal(raw.x, before)
        else:
            assert abs(raw.x @ raw.x - 1.65) < 1e-13
    assert 0 in statuses
    assert len(statuses) > 1


@pytest.mark.parametrize("target", slow_but(["c"], TARGETS))
def test_steps_where_the_approximate_matrix_gains_little_are_solved_in_time(target):
    """The approximate Newton matrix is exact up to O(h²). With these large step sizes an iteration with it gains less
    than a digit, and the solver must still converge.
    """
    solve = solver(by_paths("rigid_body", 4), target)
    for h in (0.95, 1.0, 1.05, 1.1):
        x = solve.integrate((0.1, 1.0, 0.1), h=h, steps=20).x
        assert np.ptp(np.sum(x**2, axis=1)) < 30 * EPS
