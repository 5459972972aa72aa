"""The scripts of docs/gradients.md solve the tasks of that page."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("scipy")

FOLDER = Path(__file__).parent.parent / "docs/gradients"


def task(name):
    """Import a script of docs/gradients.md as a module."""
    specification = spec_from_file_location(name, FOLDER / f"{name}.py")
    module = module_from_spec(specification)
    sys.modules[name] = module
    specification.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_moments_of_inertia_are_found_to_their_errors():
    module = task("moments_of_inertia")
    unknown, errors = module.main()
    assert np.all(np.abs(unknown - module.TRUE) < 3 * errors)
    assert np.all(errors[:2] < 0.02)


def test_orbit_closes_and_its_multipliers_are_those_of_a_symplectic_map():
    start, period, multipliers, history = task("periodic_orbit").main()
    assert history[-1] < 1e-13
    assert 5 < period < 8
    assert np.abs(start).max() < 1
    assert np.prod(multipliers) == pytest.approx(1, abs=1e-9)
    assert np.sort(np.abs(multipliers - 1))[:2].max() < 1e-4  # a double eigenvalue: half of the digits


@pytest.mark.slow
def test_hamiltonian_is_learned_to_the_noise():
    module = task("learned_hamiltonian")
    coefficients, losses = module.main()
    assert np.abs(coefficients - module.TRUE).max() < 0.005
    assert losses[-1] < module.NOISE**2


@pytest.mark.slow
def test_network_with_the_bracket_stays_on_the_leaf_without_learning_anything(monkeypatch):
    jax = pytest.importorskip("jax")
    module = task("learned_network")
    monkeypatch.setattr(module, "LONG", 100.0)
    monkeypatch.setattr(module, "HELD_OUT", 10.0)
    monkeypatch.setattr(module, "RECORDS", 8)
    # Other tests check gradients of flows and of solvers, so this test replaces the two functions that train models.
    monkeypatch.setattr(module, "fitted", lambda records: module.TRUE)
    monkeypatch.setattr(module, "trained", lambda run, weights, *_: (weights, [0.0]))
    with jax.enable_x64(True):
        results, _ = module.main()
    by_bracket, by_field, by_formula = results.values()
    assert by_bracket[2] < 1e-12
    assert by_field[2] > 1e-2
    assert by_formula[0] < 1e-12
