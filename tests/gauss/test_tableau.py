"""Coefficients of Gauss collocation: right to rounding, and symplectic without rounding."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from phigen.gauss.statements import check
from phigen.gauss.tableau import DOUBLE, SINGLE, continuation, gauss_nodes, tableau

STAGES = range(1, 9)


@pytest.mark.parametrize("stages", STAGES)
def test_nodes_and_weights_are_those_of_legendre(stages):
    method = tableau(stages)
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    assert method.nodes == pytest.approx((1 + nodes) / 2, abs=1e-15)
    assert method.weights == pytest.approx(weights / 2, abs=1e-15)


def test_nodes_have_more_digits_than_are_used():
    """c = 1/2 − √3/6 of two stages, by 3 = (3 − 6c)²."""
    c = gauss_nodes(2)[0]
    assert abs((3 - 6 * c) ** 2 - 3) < Fraction(1, 10**50)


@pytest.mark.parametrize("stages", STAGES)
def test_mixing_is_symplectic_without_rounding(stages):
    """μ_ij + μ_ji = 1 in exact arithmetic, and reversing the order of the stages gives the adjoint method."""
    for precision, digits in ((DOUBLE, np.float64), (SINGLE, np.float32)):
        table = tableau(stages, precision)
        mu = [[Fraction(v) for v in row] for row in table.mixing]
        assert set(table.defects) == {0}
        assert all(mu[i][j] + mu[stages - 1 - i][stages - 1 - j] == 1 for i in range(stages) for j in range(stages))
        assert np.array_equal(table.mixing, np.array(table.mixing, dtype=digits))


@pytest.mark.parametrize("stages", STAGES)
def test_stages_integrate_polynomials(stages):
    """Σ_j a_ij c_j^k = c_i^{k+1}/(k+1) for k < s."""
    method = tableau(stages)
    a = np.array(method.mixing) * method.weights
    c = np.array(method.nodes)
    for k in range(stages):
        assert a @ c**k == pytest.approx(c ** (k + 1) / (k + 1), abs=4e-16)


@pytest.mark.parametrize("stages", [2, 4, 8])
def test_prediction_extrapolates_slow_signals(stages):
    """Of f = cos(ωt) the offsets at the next step's stages follow from the last step's to a small part."""
    method, omega = tableau(stages), 0.5
    c, b = np.array(method.nodes), np.array(method.weights)
    offsets = np.array(method.prediction) @ (b * np.cos(omega * (c - 1)))
    assert offsets == pytest.approx(np.sin(omega * c) / omega, abs={2: 0.1, 4: 3e-3, 8: 1e-4}[stages])


@pytest.mark.parametrize("stages", STAGES)
def test_continuation_is_exact_for_polynomials(stages):
    """Of f = t^k with k < s, t from the end of the last step, the next step's offsets are c^{k+1}/(k+1)."""
    method = tableau(stages)
    c, b = np.array(method.nodes), np.array(method.weights)
    for k in range(stages):
        offsets = np.array(continuation(stages)) @ (b * (c - 1) ** k)
        assert offsets == pytest.approx(c ** (k + 1) / (k + 1), abs=1e-16 * np.abs(continuation(stages)).max() + 1e-15)


def test_coefficients_that_are_rounded_one_by_one_are_refuted():
    """a_ij/b_j in floating point misses the identity, and the check says so."""
    from support import compiled

    compilation = compiled("henon_heiles", 8, "gauss")
    exact = tableau(4)
    a = np.array(exact.mixing) * exact.weights
    rounded = replace(exact, mixing=tuple(map(tuple, (a / exact.weights).tolist())))
    assert any(rounded.defects)
    verdicts = [
        next(iter(check(compilation.system, compilation.system, compilation.gauss, t))).verdict
        for t in (exact, rounded)
    ]
    assert verdicts == ["proved", "refuted"]
