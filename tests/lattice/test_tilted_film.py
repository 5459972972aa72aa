"""The film with a tilted axis of anisotropy: its step is a Poisson map of order two."""

from functools import cache

import numpy as np
import pytest
from systems import spec_of

from phigen.api import lattice_solver_of
from phigen.compiler import compile_spec

#: Shape of states: the components first, then the sites.
SHAPE = (3, 3, 4)


@cache
def film():
    return compile_spec(spec_of("tilted_film"), tangent=True)


def spins():
    x = np.random.default_rng(5).normal(size=SHAPE)
    return x / np.linalg.norm(x, axis=0)


def brackets(x):
    """Return the matrix π of {x, y} = z and its cyclic permutations at each site."""
    x, y, z = x.reshape(3, -1)
    zero = np.zeros_like(x)
    entries = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]])
    return np.einsum("abs,st->asbt", entries, np.eye(x.size)).reshape(3 * x.size, -1)


def field(x):
    """Return ẋ = ∇H × x, the equations of motion written by hand, with J = 1, K = 0.5, a = 0.6, B = 0.1."""
    axis = np.array([np.sin(0.6), 0, np.cos(0.6)])[:, None, None]
    neighbours = sum(np.roll(x, shift, along) for shift in (1, -1) for along in (1, 2))
    slope = -neighbours - 2 * 0.5 * (axis * x).sum(axis=0) * axis - 0.1 * np.array([0, 0, 1])[:, None, None]
    return np.cross(slope, x, axis=0)


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_a_step_is_a_poisson_map(target):
    solver, x = lattice_solver_of(film(), target), spins()
    units = np.eye(x.size).reshape(-1, *SHAPE)
    after, carried = solver.step_tangent(x, 0.3, units)
    matrix = carried.reshape(x.size, x.size).T
    np.testing.assert_allclose(matrix @ brackets(x) @ matrix.T, brackets(after), rtol=0, atol=1e-14)


def test_it_solves_the_equations_of_motion_with_order_two():
    solver, x, time = lattice_solver_of(film(), "numpy"), spins(), 0.8
    exact, h = x, time / 400
    for _ in range(400):
        a = field(exact)
        b = field(exact + h / 2 * a)
        c = field(exact + h / 2 * b)
        exact = exact + h / 6 * (a + 2 * b + 2 * c + field(exact + h * c))
    errors = [np.abs(solver.integrate(x, time / n, n).x[-1] - exact).max() for n in (8, 16, 32)]
    assert errors[-1] < 1e-2
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2, abs=0.2)
