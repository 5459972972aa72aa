"""Linear flows whose matrix depends on coordinates that are constant along the flow, by the theorem of Cayley and
Hamilton.
"""

from functools import cache

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm
from support import compile_text, javascript, solver

from phigen.splitting import small_matrices
from phigen.splitting.statements import check
from phigen.symbolic import remainders
from phigen.symbolic.verdict import PROVED, REFUTED

#: Two oscillators with all possible couplings; the Casimirs c and d enter through functions that are not polynomials.
COUPLED = """
coordinates: [q1, p1, q2, p2, c, d]
parameters: {k: 1.3, l: 0.7}
poisson: {brackets: {q1: {p1: 1}, q2: {p2: 1}}}
hamiltonian: (p1**2 + exp(c)*p2**2)/2 + k*q1**2/2 + l*sqrt(1 + d**2)*q2**2/2 + sin(c)*q1*q2 + d*q1*p2
casimirs: {C: c, D: d}
scheme: splitting
"""
PI = np.zeros((6, 6))
PI[0, 1] = PI[2, 3] = 1
PI -= PI.T
#: States: a generic one; one for which the matrix has two blocks; one for which all eigenvalues are equal, so that the
#: matrix is nilpotent.
STATES = {"generic": [0.4, -1.2, 0.9, 0.3, -0.5, 1.1], "blocks": [1, 2, 3, 4, 0, 0], "nilpotent": [1, 2, 3, 4, 0, 0]}


@cache
def coupled(extras=""):
    return compile_text(COUPLED + extras, 2)


def matrix(x, k, m):
    c, d = x[4:]
    return np.array(
        [
            [0, 1, 0, 0],
            [-k, 0, -np.sin(c), -d],
            [d, 0, 0, np.exp(c)],
            [-np.sin(c), 0, -m * np.sqrt(1 + d * d), 0],
        ]
    )


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_step_is_the_exponential_of_the_matrix(target):
    for name, x in STATES.items():
        k, m = (0.0, 0.0) if name == "nilpotent" else (1.3, 0.7)
        for h in (1e-3, 0.4, -5.0, 30.0):
            exact = expm(h * matrix(x, k, m)) @ x[:4]
            end = solver(coupled(), target).integrate(x, h, 1, k=k, l=m).x[-1]
            np.testing.assert_allclose(end[:4], exact, rtol=0, atol=2e-15 * (1 + abs(h)) * (1 + np.abs(exact).max()))
            assert (end[4:] == x[4:]).all()


@pytest.mark.parametrize("rows", [2, 3, 4])
def test_every_number_of_rows_up_to_four(rows):
    """x ↦ {x, z} is a linear map of an Abelian ideal; its matrix satisfies no polynomial equation of lower degree."""
    a = np.random.default_rng(rows).integers(-3, 4, size=(rows, rows)) + np.diag(np.arange(rows) + 1)
    names = [f"x{i}" for i in range(rows)]
    brackets = ", ".join(
        f"{n}: {{z: {' + '.join(f'({c})*{m}' for c, m in zip(row, names, strict=True))}}}"
        for n, row in zip(names, a, strict=True)
    )
    compilation = compile_text(
        f"coordinates: [{', '.join(names)}, z, c]\npoisson: {{brackets: {{{brackets}}}}}\nhamiltonian: exp(c)*z\n"
        "scheme: splitting\n",
        2,
    )
    assert small_matrices.BY_CAYLEY_HAMILTON in compilation.splitting.flows[0].manner
    assert {s.verdict for s in check(compilation.system, compilation.splitting)} == {PROVED}
    x = np.arange(1.0, rows + 3) / 4
    end = solver(compilation, "c").integrate(x, 0.6, 1).x[-1]
    with mpmath.workdps(40):  # scipy's exponential has errors of 7e-13 here
        exact = mpmath.expm(mpmath.mpf(0.6) * mpmath.exp(x[-1]) * mpmath.matrix(a.tolist())) * mpmath.matrix(x[:rows])
    np.testing.assert_allclose(end[:rows], [float(e) for e in exact], rtol=2e-13)


def test_targets_and_lanes_agree():
    x, integrator = np.array(STATES["generic"]), solver(coupled(), "c")
    for h in (0.3, 6.0):
        js = javascript(coupled(), f"x0: {x.tolist()}", f"s.integrate({h}, 5)", "[...s.x]")
        np.testing.assert_allclose(js, integrator.integrate(x, h, 5).x[-1], rtol=1e-13)
    states = np.random.default_rng(3).normal(size=(21, 6))
    for h in (0.05, 0.6, 3.0):
        together = np.asarray(integrator.ensemble(states, h, 4)).reshape(states.shape)
        alone = np.array([integrator.integrate(x, h, 4).x[-1] for x in states])
        np.testing.assert_allclose(together, alone, rtol=0, atol=1e-14 * np.abs(alone).max())


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_the_derivative_is_exact_and_poisson(target):
    integrator, d = solver(coupled("tangent: true\n"), target), 1e-3
    for x in map(np.array, STATES.values()):
        for h in (0.1, 3.0):
            _, tangent = integrator.step_tangent(x, h)
            assert np.abs(tangent @ PI @ tangent.T - PI).max() < 1e-14 * np.abs(tangent).max() ** 2
            ends = [[integrator.integrate(x + s * d * row, h, 1).x[-1] for s in (2, 1, -1, -2)] for row in np.eye(6)]
            slopes = np.array([(8 * (b - c) - (a - e)) / (12 * d) for a, b, c, e in ends]).T
            np.testing.assert_allclose(tangent, slopes, atol=1e-7 * np.abs(slopes).max())


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_gradients_are_differences(target):
    integrator = solver(coupled("adjoint: true\n"), target)
    x, weights, d = np.array(STATES["generic"]), np.arange(1.0, 7), 1e-5
    gradient = integrator.pullback(x, 0.7, 3, weights).parameters_bar
    for name, value in (("k", 1.3), ("l", 0.7)):
        above, below = (weights @ integrator.integrate(x, 0.7, 3, **{name: value + s}).x[-1] for s in (d, -d))
        assert gradient[name] == pytest.approx((above - below) / (2 * d), rel=1e-7)


def test_a_wrong_relation_is_refuted(monkeypatch):
    genuine = small_matrices._relation
    monkeypatch.setattr(small_matrices, "_relation", lambda ring, a: (2 * c for c in genuine(ring, a)))
    compilation = compile_text(COUPLED + "title: wrong\n", 2)
    assert REFUTED in {s.verdict for s in check(compilation.system, compilation.splitting)}


def test_the_derivatives_of_the_functions_are_differences():
    arguments = [mpmath.mpf(e) for e in ("1.3", "0.3", "-0.7", "0.2", "0.9")]

    def call(name, *values):
        rule = remainders.value if name in remainders.REMAINDERS else remainders.quotient
        return rule(int(name[-1]), mpmath.mp, *values)

    with mpmath.workdps(40):
        small = mpmath.mpf(10) ** -12
        for k, name in enumerate(remainders.REMAINDERS):
            for i, slope in enumerate(remainders.slopes(k)(call, None, *arguments)):
                above, below = ([a + s * (i == j) for j, a in enumerate(arguments)] for s in (small, -small))
                assert abs((call(name, *above) - call(name, *below)) / (2 * small) - slope) < 1e-22
