"""Coefficients of Gauss collocation: correct to rounding, and exactly symplectic after rounding."""

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
    """Nodes are computed with more digits than double precision: the first node for two stages, c = 1/2 − √3/6,
    satisfies (3 − 6c)² = 3 to 50 digits.
    """
    c = gauss_nodes(2)[0]
    assert abs((3 - 6 * c) ** 2 - 3) < Fraction(1, 10**50)


@pytest.mark.parametrize("stages", STAGES)
def test_mixing_is_symplectic_without_rounding(stages):
    """The rounded coefficients μ_ij = a_ij/b_j satisfy μ_ij + μ_ji = 1, the condition of symplecticity, exactly. They
    also satisfy the condition of a symmetric (self-adjoint) method exactly.
    """
    for precision, digits in ((DOUBLE, np.float64), (SINGLE, np.float32)):
        table = tableau(stages, precision)
        mu = [[Fraction(v) for v in row] for row in table.mixing]
        assert set(table.defects) == {0}
        assert all(mu[i][j] + mu[stages - 1 - i][stages - 1 - j] == 1 for i in range(stages) for j in range(stages))
        assert np.array_equal(table.mixing, np.array(table.mixing, dtype=digits))


@pytest.mark.parametrize("stages", STAGES)
def test_stages_integrate_polynomials(stages):
    """The stages integrate polynomials of degree below s: Σ_j a_ij c_j^k = c_i^{k+1}/(k+1) for k < s."""
    method = tableau(stages)
    a = np.array(method.mixing) * method.weights
    c = np.array(method.nodes)
    for k in range(stages):
        assert a @ c**k == pytest.approx(c ** (k + 1) / (k + 1), abs=4e-16)


@pytest.mark.parametrize("stages", [2, 4, 8])
def test_prediction_extrapolates_slow_signals(stages):
    """For a slow signal f = cos(ωt), the integrals of f up to the stages of the next step, predicted by the values of
    the last step, have small errors.
    """
    method, omega = tableau(stages), 0.5
    c, b = np.array(method.nodes), np.array(method.weights)
    offsets = np.array(method.prediction) @ (b * np.cos(omega * (c - 1)))
    assert offsets == pytest.approx(np.sin(omega * c) / omega, abs={2: 0.1, 4: 3e-3, 8: 1e-4}[stages])


@pytest.mark.parametrize("stages", STAGES)
def test_continuation_is_exact_for_polynomials(stages):
    """For f = t^k with k < s, the number of stages, and t counted from the end of the last step, the predicted
    integrals up to the stages of the next step are exactly c^{k+1}/(k+1).
    """
    method = tableau(stages)
    c, b = np.array(method.nodes), np.array(method.weights)
    for k in range(stages):
        offsets = np.array(continuation(stages)) @ (b * (c - 1) ** k)
        assert offsets == pytest.approx(c ** (k + 1) / (k + 1), abs=1e-16 * np.abs(continuation(stages)).max() + 1e-15)


def test_coefficients_that_are_rounded_one_by_one_are_refuted():
    """Coefficients a_ij/b_j that are rounded one by one violate μ_ij + μ_ji = 1, and the proof reports that."""
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
