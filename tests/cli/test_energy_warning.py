"""The warning of ``phigen run`` about an energy error that is too large, with a step size that would reduce it."""

import json
import re

import numpy as np
import pytest

from phigen.api import compilation_of, solver_of
from phigen.cli import energy_warning
from phigen.geometry.conservation import RELATIVE, Unit
from phigen.study import classical
from phigen.study.summary import Drift
from phigen.tuning.equal_work import rk4_energy_error
from phigen.tuning.problem import SystemProblem

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
    result = phigen("run", path, "-t", "numpy")
    assert result.exit_code == 0
    assert re.search(r"warning: the energy error reaches .* of the energy at the start", result.stderr)
    assert f"phigen tune {path}" in result.stderr
    step = re.search(r"hint: try --step (\S+);", result.stderr).group(1)
    mended = phigen("run", path, "-t", "numpy", "--step", step, "--json")
    assert not mended.stderr, step
    errors = json.loads(mended.stdout)
    assert (errors.get("errors") or {"energy": errors["methods"][0]["energy"]["error"]})["energy"] < 0.01
    assert "warning" not in phigen("run", path, "-t", "numpy", "-q").stderr


FORCED = """phigen: 1
name: forced
coordinates: [q, p]
time: t
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q) - q*cos(2*t)/2
forces: {vector: {p: -p/10}}
order: 4
runs: {far: {initial: [-1.03, 0.3], start: 3.63, step: -0.1, steps: 50, at: [0.33, -1, -1.37]}}
"""


def test_an_integral_along_few_states_is_no_reason_to_distrust_them(phigen, write):
    """The energy error is ten times the energy, and so is the error of the integral, but its estimate is smaller."""
    path = write("forced.yaml", FORCED)
    result = phigen("run", path, "-t", "numpy", "--json")
    (errors,) = json.loads(result.stdout)["methods"]
    assert errors["energy"]["error"] > 1
    assert "do not trust" not in result.stderr
    assert "too far apart" in phigen("run", path, "-t", "numpy").stdout


def test_a_large_error_of_the_energy_balance_is_a_warning(phigen, write):
    spec = ORBIT.replace("1/100)", "1/100) + q1*cos(t)/1000").replace("order: 4", "order: 4\ntime: t")
    result = phigen("run", write("driven.yaml", spec.replace("STEP", "1.2")), "-t", "numpy")
    assert "error of the energy balance" in result.stdout
    assert re.search(r"warning: the energy error reaches .* of the energy at the start", result.stderr)


@pytest.mark.slow  # it compiles the solver and RK4
@pytest.mark.parametrize(("order", "warned"), [(2, True), (6, False)])
def test_an_energy_error_that_rk4_does_not_make_at_equal_cost_is_a_warning(phigen, order, warned):
    result = phigen("run", "kepler", "--order", order, "--step", 0.1, "--steps", 1000, "-t", "c", "--json")
    assert result.exit_code == 0
    error = json.loads(result.stdout)["methods"][0]["energy"]["error"]
    assert (1e-3 < error < 0.1) == warned
    said = re.search(
        r"warning: the energy error reaches (\S+) of .*; RK4 with .* reaches (\S+) in this run", result.stderr
    )
    assert bool(said) == warned, result.stderr
    if said:
        assert float(said[1]) == pytest.approx(error, rel=0.1)
        assert 1e-9 < float(said[2]) < error / 2
        assert "hint: try --order 4, or --step" in result.stderr


@pytest.mark.slow  # it compiles the solver and RK4
def test_rk4_is_compared_in_double_precision_with_a_solver_in_single(phigen, write):
    """RK4 in double precision has an error of 6e-7 here at equal cost. In single precision its error would be above
    1e-6.
    """
    spec = (
        ORBIT.replace("order: 4\nscheme: splitting", "order: 2\nreal: float")
        .replace("0, 0.6", "0, 0.9")
        .replace("STEP", "0.1")
    )
    result = phigen("run", write("single.yaml", spec), "-t", "c")
    said = re.search(r"the energy error reaches (\S+) of .*; RK4 with .* reaches (\S+) in this run", result.stderr)
    assert said, result.stderr
    assert float(said[2]) < 1e-5 < 1e-3 < float(said[1])


@pytest.mark.parametrize(
    ("error", "steps", "target", "compared"),
    [
        (5e-3, 1000, "c", True),
        (5e-4, 1000, "c", False),
        (0.2, 1000, "c", False),
        (5e-3, 1_000_001, "c", False),
        (5e-3, 1000, "numpy", False),
    ],
)
def test_runs_that_cannot_be_warned_about_are_not_compared_with_rk4(error, steps, target, compared):
    compilation = compilation_of("kepler", order=2)
    drift = Drift(error, Unit(kind=RELATIVE))
    assert energy_warning.compares_with_rk4(compilation, target, drift, steps) == compared
    for unknown in (Drift(error, Unit()), Drift(error, Unit(kind=RELATIVE, moves=True))):
        assert not energy_warning.compares_with_rk4(compilation, target, unknown, steps)


@pytest.mark.slow
def test_a_method_that_breaks_down_at_once_has_infinite_errors(phigen, write, monkeypatch):
    """RK4 is replaced by a method whose first step is not a number, so that it has no row after the start."""
    monkeypatch.setitem(classical.METHODS, "rk4", (lambda f, x, h: np.full_like(x, np.nan), 4))
    path = write("broken.yaml", ORBIT.replace("STEP", "0.01, compare: [rk4]"))
    ours, rk4 = json.loads(phigen("run", path, "-t", "numpy", "--json").stdout)["methods"]
    assert (ours["good"], rk4["good"]) == (4201, 1)
    assert ours["energy"]["error"] < 1
    assert rk4["energy"]["error"] is None
    assert re.search(r"energy +\S+ +inf ", phigen("run", path, "-t", "numpy").stdout)


def test_rk4_without_a_finite_energy_has_an_infinite_error(monkeypatch):
    """The states of RK4 may be finite numbers outside of the domain of H, where the energy is not a number."""
    compilation = compilation_of("kepler", order=2)
    system = SystemProblem(np.array([1.0, 0, 0, 0.9]), {"mu": 1.0}, 0.1, 1.0, system=compilation.system)
    monkeypatch.setattr(SystemProblem, "energies", lambda self, states: np.where(np.arange(len(states)), np.nan, 1.0))
    solver = solver_of(compilation, "numpy").backend
    assert rk4_energy_error(compilation, solver, system) == np.inf


def test_an_energy_that_noise_changes_is_no_error(phigen):
    result = phigen("run", "thermal_spin", "-t", "numpy", "--steps", "100", "-v")
    assert result.exit_code == 0
    assert "energy error" not in result.stderr
    assert "largest change" in result.stdout
