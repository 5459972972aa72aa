"""Runs whose energy error is too large to trust are warned about, with a step that mends it."""

import json
import re

import pytest

ORBIT = """phigen: 1
name: orbit
coordinates: [q1, q2, p1, p2]
poisson: {canonical: {q: [q1, q2], p: [p1, p2]}}
hamiltonian: (p1**2 + p2**2)/2 - 1/sqrt(q1**2 + q2**2 + 1/100)
order: 4
scheme: splitting
runs: {r: {initial: [1, 0, 0, 0.6], step: STEP, duration: 42}}
"""
CHAIN = """phigen: 1
name: chain
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + (q[i+1] - q)**2/2 + (q[i+1] - q)**4/4
order: 4
runs: {r: {sizes: [12], initial: {q: 5*sin(2*pi*i/N_i), p: 0}, step: STEP, steps: 200}}
"""


@pytest.mark.parametrize("spec", [ORBIT, CHAIN], ids=["system", "lattice"])
def test_a_large_energy_error_is_a_warning_with_a_step_that_mends_it(phigen, write, spec):
    path = write("large.yaml", spec.replace("STEP", "0.6"))
    found = phigen("run", path, "-t", "numpy")
    assert found.exit_code == 0
    assert re.search(r"warning: the energy error reaches .* of the energy at the start", found.stderr)
    assert f"phigen tune {path}" in found.stderr
    step = re.search(r"hint: try --step (\S+);", found.stderr).group(1)
    mended = phigen("run", path, "-t", "numpy", "--step", step, "--json")
    assert not mended.stderr, step
    errors = json.loads(mended.stdout)
    assert (errors.get("errors") or {"energy": errors["methods"][0]["energy"]["error"]})["energy"] < 0.01
    assert "warning" not in phigen("run", path, "-t", "numpy", "-q").stderr


@pytest.mark.slow  # it compiles the solver and RK4
@pytest.mark.parametrize(("order", "warned"), [(2, True), (6, False)])
def test_an_energy_error_that_rk4_does_not_make_at_equal_cost_is_a_warning(phigen, order, warned):
    found = phigen("run", "kepler", "--order", order, "--step", 0.1, "--steps", 1000, "-t", "c", "--json")
    assert found.exit_code == 0
    error = json.loads(found.stdout)["methods"][0]["energy"]["error"]
    assert (1e-3 < error < 0.1) == warned
    said = re.search(
        r"warning: the energy error reaches (\S+) of .*; RK4 with .* reaches (\S+) in this run", found.stderr
    )
    assert bool(said) == warned, found.stderr
    if said:
        assert float(said[1]) == pytest.approx(error, rel=0.1)
        assert 1e-9 < float(said[2]) < error / 2
        assert "hint: try --order 4, or --step" in found.stderr


def test_an_energy_that_noise_changes_is_no_error(phigen):
    found = phigen("run", "thermal_spin", "-t", "numpy", "--steps", "100", "-v")
    assert found.exit_code == 0
    assert "energy error" not in found.stderr
    assert "largest change" in found.stdout
