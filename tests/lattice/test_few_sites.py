"""Gradients of lattices of one and two sites, where GMRES solves the equations exactly in as many iterations as
unknowns.
"""

import random

import numpy as np
import pytest

import phigen
import phigen.spec

H, STEPS = 0.1, 4
GRAPH, PAIRS = "{graph: links}", "{pairs: all}"


def drawn(seed):
    """Return the spec of a lattice with the scheme series: oscillators or vortices, with a random energy of pairs or
    bonds.
    """
    source = random.Random(seed)
    lattice, key = source.choice([(GRAPH, "bonds"), (PAIRS, "pairs")])
    c = source.randint(2, 9)
    site = source.choice([f"q**2/{c} + p**2/2", f"q**2/{c}", f"p**2/2 + cos(q)/{c}"])
    pair = source.choice(
        ["log(1 + (q[a] - q[b])**2 + (p[a] - p[b])**2)/4", "(q[a] - q[b])**2/2", "J*q[a]*q[b]*(p[a] + p[b])"]
    )
    return (
        f"phigen: 1\nname: t\nlattice: {lattice}\ncoordinates: [q, p]\nparameters: {{J: 0.7}}\nscheme: series\n"
        f'poisson: {{canonical: {{q: [q], p: [p]}}}}\nhamiltonian: {{sites: "{site}", {key}: "{pair}"}}\norder: 2\n'
    )


def bonds(text, sites):
    """Return both directions of the only possible bond, for a graph."""
    links = np.array([[0, 1], [1, 0]]) if sites > 1 else np.empty((0, 2), int)
    return {"bonds": links} if GRAPH in text else {}


@pytest.mark.parametrize("sites", [1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_gradients_of_few_sites_are_differences(seed, sites):
    text, rng = drawn(seed), np.random.default_rng(seed)
    solver, more = phigen.compile(phigen.spec.loads(text), target="numpy", adjoint=True), bonds(text, sites)
    x, bar, along = rng.uniform(-1, 1, (3, 2, sites))
    x0_bar = solver.pullback(x, H, STEPS, bar, **more).x0_bar

    def end(e):
        return np.sum(bar * solver.integrate(x + e * along, H, STEPS, STEPS, **more).x[-1])

    assert np.sum(x0_bar * along) == pytest.approx((end(1e-4) - end(-1e-4)) / 2e-4, rel=1e-6, abs=1e-9)
    assert not solver.pullback(x, H, STEPS, np.zeros_like(bar), **more).x0_bar.any()


@pytest.mark.slow
@pytest.mark.parametrize("sites", [1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_c_agrees_with_numpy_about_few_sites(seed, sites):
    text, rng = drawn(seed), np.random.default_rng(seed)
    in_c, numpy = (phigen.compile(phigen.spec.loads(text), target=t, adjoint=True) for t in ("c", "numpy"))
    x, bar = rng.uniform(-1, 1, (2, 2, sites))
    for cotangent in (bar, 0 * bar):
        one, two = (s.pullback(x, H, STEPS, cotangent, **bonds(text, sites)).x0_bar for s in (in_c, numpy))
        assert one == pytest.approx(two, rel=1e-12, abs=1e-13)
