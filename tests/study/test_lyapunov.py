"""Lyapunov exponents of systems whose exponents are known."""

import numpy as np
import pytest
from support import compiled

from phigen import api, spec
from phigen.study.lyapunov import lattice_spectrum, spectrum

#: H = a q1 p1 + b q2 p2: the exponents are ±a, ±b. The last coordinate is a Casimir.
SADDLE = """
phigen: 1
name: saddle
coordinates: [q1, q2, p1, p2, c]
parameters: {a: 1.5, b: 0.25}
poisson: {canonical: {q: [q1, q2], p: [p1, p2]}}
hamiltonian: a*q1*p1 + b*q2*p2
order: 10
"""


def solver(source, target="c", order=None):
    return api.compile(source, target, order, tangent=True)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_linear_saddle_has_its_eigenvalues(target):
    exponents = spectrum(solver(spec.loads(SADDLE), target), [0, 0, 0, 0, 1], 0.05, 2000)
    # The initial tangent vectors along the axes are eigenvectors of the flow, so the only error is that of the method
    # of order 10.
    assert np.max(np.abs(exponents.exponents - [1.5, 0.25, 0, -0.25, -1.5])) < 1e-12
    assert exponents.t == 100


def test_backwards_in_time_growth_and_decay_change_places():
    exponents = spectrum(solver(spec.loads(SADDLE)), [0, 0, 0, 0, 1], -0.05, 500)
    assert np.max(np.abs(exponents.exponents - [1.5, 0.25, 0, -0.25, -1.5])) < 1e-12


def test_strongly_unstable_steps_lose_no_direction():
    """A step multiplies lengths by e^4 and e^-4. Unless the tangent vectors are made orthogonal often enough, rounding
    errors hide the small exponents.
    """
    exponents = spectrum(solver(spec.loads(SADDLE)), [0, 0, 0, 0, 1], 0.4, 400, {"a": 10.0, "b": 0.1})
    assert np.max(np.abs(exponents.exponents[[1, 2, 3]] - [0.1, 0, -0.1])) < 1e-10
    assert abs(exponents.pairing) < 1e-10


@pytest.mark.slow
def test_exponents_of_an_integrable_system_fall_like_log_t_over_t():
    exponents = spectrum(solver(compiled("rigid_body").spec), [0.45, 0.0, 0.89], 0.05, 8000)
    bound = 3 * np.log(exponents.times) / exponents.times
    assert np.all(np.abs(exponents.history[exponents.times > 20]) < bound[exponents.times > 20, None])
    assert exponents.uncertainty < 0.05


@pytest.mark.slow
def test_a_chaotic_orbit_has_a_positive_exponent_and_its_mirror_image():
    henon_heiles = solver(compiled("henon_heiles").spec)
    chaotic = spectrum(henon_heiles, [0, -0.15, 0.4747806515732606, 0], 0.1, 20_000)
    assert 0.03 < chaotic.largest < 0.08  # 0.045 in the literature on this energy, 1/8
    assert abs(chaotic.total) < 1e-13
    assert chaotic.pairing < 2e-3
    regular = spectrum(henon_heiles, [0, 0.1, 0.3966526605792183, 0], 0.1, 20_000)
    assert regular.largest < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("target", "steps"), [("c", 400), ("numpy", 100)])
def test_directions_across_the_leaves_add_zeros(target, steps):
    """The top has two Casimirs. The tangent maps leave the differentials of Casimirs unchanged, so two exponents vanish
    like 1/t.
    """
    exponents = spectrum(solver(compiled("lagrange_top").spec, target), [0.2, -0.1, 3.0, 0.6, 0.0, 0.8], 0.05, steps)
    middle = np.sort(np.abs(exponents.exponents))[:2]
    assert np.all(middle < 0.3 / exponents.t)
    assert abs(exponents.total) < 1e-12  # se(3) is unimodular: volume is conserved


def test_growth_is_followed_along_the_trajectory_that_is_integrated():
    """`tangents` follows the trajectory of `integrate` bit for bit, with the same gauge and the same compensation of
    rounding errors.
    """
    body = solver(compiled("rigid_body").spec)
    states = [x for x, _ in body.tangents([0.01, 1, 0.01], 0.1, 50)]
    assert np.array(states).tolist() == body.integrate([0.01, 1, 0.01], 0.1, 50).x[1:].tolist()


def test_a_solver_without_tangents_is_refused():
    with pytest.raises(TypeError, match="tangent=True"):
        spectrum(api.compile(spec.loads(SADDLE)), [0, 0, 0, 0, 1], 0.05, 10)


#: A ring of pendulums upside down: a wave of number m has the exponents ± sqrt(1 - 0.8 sin²(πm/6)).
UPSIDE_DOWN = """
phigen: 1
name: upside_down
lattice: {axes: [i]}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - q**2/2 + (q[i+1] - q)**2/10
order: 6
"""


def test_a_lattice_has_the_exponents_of_its_waves():
    exponents = lattice_spectrum(solver(spec.loads(UPSIDE_DOWN), "numpy"), np.zeros((2, 6)), 0.25, 400, 4)
    grown = exponents.history * exponents.times[:, np.newaxis]
    # By this time the tangent vectors have turned into the directions of growth.
    late = np.flatnonzero(exponents.times > 60)[0]
    rates = (grown[-1] - grown[late]) / (exponents.t - exponents.times[late])
    assert np.max(np.abs(rates - np.sqrt([1, 0.8, 0.8, 0.4]))) < 1e-4
    with pytest.raises(ValueError, match="1 to 12 exponents, not 13"):
        lattice_spectrum(solver(spec.loads(UPSIDE_DOWN), "numpy"), np.zeros((2, 6)), 0.1, 400, 13)
