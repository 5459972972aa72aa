"""The checks of gradients in `phigen verify`: each part of a gradient that is wrong makes a check fail."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

from phigen import spec
from phigen.api import lattice_solver_of, solver_of
from phigen.cli import group
from phigen.compiler import compile_spec
from phigen.errors import StepError
from phigen.lattice.states import start_of
from phigen.study import gradients, lattice_verification, verification
from phigen.study.meanings import meaning_of

SWING = """phigen: 1
name: t
coordinates: [q, p]
parameters: {g: 1.5, m: 0.7}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/(2*m) - g*cos(q)
order: 2
runs: {swing: {initial: [0.4, 0.3], step: 0.1, steps: 40}}
"""
SPINS = """phigen: 1
name: spins
coordinates: [x, y, z]
parameters: {J: 0.6, B: {value: 0.8, at: sites}}
poisson: {lie_algebra: {name: so(3)}}
lattice: {axes: [i], boundary: periodic}
hamiltonian: B*z**2/2 + J*z*z[i+1]
order: 2
runs: {turn: {sizes: [16], initial: {x: cos(i), y: sin(i), z: cos(2*i)/2}, step: 0.1, steps: 40}}
"""
TANGENTS, DIFFERENCES = "gradient against tangent maps", "gradient against differences"
MEMBERS = "gradients of members against single runs"


@cache
def compiled(text, **options):
    return compile_spec(spec.loads(text), tangent=True, **options)


def checked(text, change=None, target="numpy", **options):
    """Return for each check of gradients, by name, whether it passes. ``change`` modifies the results of the
    back end.
    """
    compilation = compiled(text, adjoint=True, **options)
    run = next(iter(compilation.spec.runs.values()))
    solver = (lattice_solver_of if compilation.spec.lattice else solver_of)(compilation, target)
    if change:
        pullback = solver.backend.pullback
        solver.backend.pullback = lambda *run_arguments: change(run_arguments, *pullback(*run_arguments))
    return {check.name: check.passed for check in checks(compilation, solver, run)}


def checks(compilation, solver, run):
    """Return the checks of gradients for one solver and one run."""
    h = float(run.step)
    if compilation.spec.lattice:
        subject = lattice_verification._Subject(
            compilation, {solver.target: solver}, start_of(compilation.spec, run), h
        )
        trajectory = solver.integrate(subject.start.state, h, 4, parameters=subject.start.arguments)
        return list(lattice_verification._gradients(compilation.cell, subject, trajectory))
    values, x = compilation.spec.parameters_of(run), np.array([float(v) for v in run.initial])
    subject = verification.Subject(compilation, {solver.target: solver}, {}, {}, values, x, h, 40, 0.0, None)
    states = solver.integrate(x, h, 40, 10, parameters=values).x
    return list(verification.gradient_checks(subject, verification.gauge_at(compilation, x, values), list(states)))


@pytest.mark.thin(2)
@pytest.mark.parametrize("more", ["", "monitor: 1/(1 + g*q**2)\n", "scheme: splitting\n"])
@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
def test_right_gradients_pass(target, more):
    assert checked(SWING + more, target=target) == {TANGENTS: True, DIFFERENCES: True, MEMBERS: True}


#: The motion q = 1/(5 − t) ends at t = 5, and the run at t = 4.
EXPLODING = """phigen: 1
name: t
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p*q**2
order: 2
runs: {end: {initial: [0.2, 0.3], step: 0.1, steps: 40}}
"""


def test_gradients_have_smaller_steps_where_those_of_the_run_fail():
    solver = solver_of(compiled(EXPLODING, adjoint=True), "numpy")
    end = solver.integrate(np.array([0.2, 0.3]), 0.1, 40, 40).x[-1]
    with pytest.raises(StepError):
        solver.integrate(end, 0.1, gradients.STEPS)
    assert checked(EXPLODING) == {TANGENTS: True, DIFFERENCES: True, MEMBERS: True}


def test_a_run_that_fails_with_all_steps_is_the_reason():
    solver = solver_of(compiled(SWING, adjoint=True), "numpy")
    run = gradients.of_solver(solver, np.array([0.4, 0.3]), np.ones(2), 0.1, {"g": 1.5, "m": 0.7}, 0.0)

    def fail(bars):
        raise StepError("t at step 7: NOT_CONVERGED", step=7, status="NOT_CONVERGED")

    failing = [replace(run, pullback=fail)]
    for _, value, _, reason in gradients.measured(failing, failing):
        assert value == np.inf
        assert reason == "the run of 11 steps fails, with smaller steps too: t at step 7: NOT_CONVERGED"


def slightly(run, rows, x_bar, derivatives):
    return rows, x_bar * (1 + 1e-9), derivatives


def of_a_parameter(run, rows, x_bar, derivatives):
    return rows, x_bar, derivatives * np.array([[1.0], [1.00001]])


def of_several(run, rows, x_bar, derivatives):
    return rows, x_bar * (1 + 1e-9 * (len(x_bar) > 1)), derivatives


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("change", "failed"),
    [(slightly, {TANGENTS}), (of_a_parameter, {DIFFERENCES}), (of_several, {MEMBERS})],
)
def test_wrong_gradients_are_found(change, failed):
    assert {name for name, passed in checked(SWING, change).items() if not passed} == failed


def test_the_energy_of_a_monitor_must_be_followed():
    """The wrong gradient here keeps the energy level e = −H(x₀) fixed when the start or the parameters change. The
    tangent maps also keep e fixed and agree with it, but differences of runs do not.
    """
    text = SWING + "monitor: 1/(1 + g*q**2)\n"
    compilation = compiled(text, adjoint=True)
    solver = solver_of(compilation, "numpy")
    gauge = solver.backend.module.gauge(np.array([0.4, 0.3]), g=1.5, m=0.7)
    held = solver.backend.with_gauge(gauge)

    def at_one_level(run, rows, x_bar, derivatives):
        return held.pullback(*run)

    assert {name for name, passed in checked(text, at_one_level).items() if not passed} >= {DIFFERENCES}


def of_sites(run, rows, x_bar, derivatives):
    return rows, x_bar, derivatives | {"B": np.roll(derivatives["B"], 1)}


@pytest.mark.parametrize(("change", "failed"), [(None, set()), (slightly, {TANGENTS}), (of_sites, {DIFFERENCES})])
def test_gradients_of_lattices_are_checked_on_few_sites_and_on_those_of_the_run(change, failed):
    checks = checked(SPINS, change)
    assert set(checks) == {f"{name} on {where} sites" for name in (TANGENTS, DIFFERENCES) for where in ("3", "all")}
    assert {name for name, passed in checks.items() if not passed} == {
        f"{name} on {where} sites" for name in failed for where in ("3", "all")
    }


def test_positive_parameters_of_sites_may_differ_by_powers_of_ten():
    """The parameters are like the masses of a sun and of planets. Difference quotients must change each mass by so
    little that it stays positive.
    """
    masses = "{value: 1, at: sites, positive: true}"
    text = SPINS.replace("{value: 0.8, at: sites}", masses).replace("B*z**2/2", "log(B)*z/8")
    text = text.replace("z: cos(2*i)/2}", "z: cos(2*i)/2}, parameters: {B: 10**(-i/2)}")
    assert set(checked(text).values()) == {True}


def test_what_the_spec_does_not_ask_for_is_not_measured():
    compilation = compiled(SWING)
    assert checks(compilation, solver_of(compilation, "numpy"), compilation.spec.runs["swing"]) == []


@pytest.mark.parametrize("name", [TANGENTS, DIFFERENCES, MEMBERS])
def test_rows_have_meanings(name):
    assert meaning_of(name).failure


@pytest.fixture
def only_gradients(monkeypatch):
    """Omit all checks of ``verify`` except those of gradients, which take a tenth of the time."""
    monkeypatch.setattr(verification, "_measured", lambda name, groups: tuple(groups["gradients"]()))


def test_a_wrong_gradient_is_the_exit_code_of_verify_and_forbids_a_certificate(tmp_path, monkeypatch, only_gradients):
    file, out = tmp_path / "t.yaml", tmp_path / "out"
    file.write_text(SWING + "targets: [numpy]\n")
    right = CliRunner().invoke(group, ["verify", "--quick", "--adjoint", "--json", str(file)])
    assert right.exit_code == 0, right.output
    (data,) = json.loads(right.stdout)
    assert [c["name"] for c in data["checks"]] == [TANGENTS, DIFFERENCES, MEMBERS]
    built = ["build", "-o", str(out), "--adjoint", "--certify", str(file)]
    assert CliRunner().invoke(group, built).exit_code == 0
    assert TANGENTS in (out / "t" / "t.certificate.json").read_text()
    monkeypatch.setattr(gradients, "TRANSPOSED", 0.0)
    wrong = CliRunner().invoke(group, ["verify", "--quick", "--adjoint", str(file)])
    assert wrong.exit_code == 5
    assert "differs from the transpose of the tangent maps" in wrong.stderr
    assert CliRunner().invoke(group, built).exit_code == 5
    assert not (out / "t" / "t.certificate.json").exists()
