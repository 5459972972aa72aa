"""`monitor: log` of pairs: explicit steps that are equal in τ, K = log(A + e) − log(−B)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from node import asked
from scipy.integrate import solve_ivp
from solvers import COMMAND
from tools import write

import phigen
from phigen.cli import group
from phigen.compiler import compile_spec, emit
from phigen.errors import SpecError, StepError
from phigen.spec import loads

BODIES = """\
phigen: 1
name: bodies
lattice: {pairs: all}
coordinates: [x, y, px, py]
parameters: {m: {value: [1, 0.3, 0.2], at: sites, positive: true}}
poisson: {canonical: {q: [x, y], p: [px, py]}}
hamiltonian:
  sites: (px**2 + py**2)/(2*m)
  pairs: -m[a]*m[b]/sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)
observables: {closest: {min: "sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)", over: pairs}}
scheme: splitting
monitor: log
runs: {meet: {initial: {x: [0, 1, 1.4], y: [0, 0, 0.1], px: 0, py: [-0.3, 0.25, 0.05]}, step: 0.02, steps: 40}}
"""
X0 = np.array([[0, 1, 1.4], [0, 0, 0.1], [0, 0, 0], [-0.3, 0.25, 0.05]])
PYTHAGOREAN = "pythagorean"


def newton(t, y, m):
    """Return the derivatives of positions and momenta of bodies in a plane under gravity."""
    q, p = y.reshape(2, 2, -1)
    apart = q[:, :, None] - q[:, None, :]
    distance = np.sqrt((apart**2).sum(0))
    np.fill_diagonal(distance, np.inf)
    return np.concatenate([(p / m).ravel(), -(apart * (m[:, None] * m / distance**3)).sum(2).ravel()])


def reference(x0, m, *times):
    """Return the states at some times, by steps of DOP853 with tolerances of 1e-13."""
    solved = solve_ivp(newton, (0, times[-1]), x0.ravel(), "DOP853", times, rtol=1e-13, atol=1e-13, args=(m,))
    return solved.y.T.reshape(len(times), *x0.shape)


@pytest.mark.slow
def test_three_bodies_that_fall_towards_each_other_pass_an_encounter():
    # Two of the masses 3, 4, 5 approach to 0.0097, a hundredth of their initial distance.
    solver = phigen.compile(PYTHAGOREAN)
    run = solver.run("fall", step=0.1, until=5, every=1.25)
    np.testing.assert_allclose(run.t, [0, 1.25, 2.5, 3.75, 5], rtol=0, atol=1e-14)
    every_step = solver.integrate(run.x[0], 0.1, until=5)
    assert every_step.observables["closest"].min() < 0.01
    assert np.abs(every_step.energy / every_step.energy[0] - 1).max() < 1e-10
    exact = reference(run.x[0], np.array([3.0, 4, 5]), 4.9, 5)
    np.testing.assert_allclose([run.at([4.9])[0], run.x[-1]], exact, rtol=0, atol=1e-9)


def test_states_at_a_time_have_the_order_of_the_method():
    end, m = 1.3, np.array([1, 0.3, 0.2])
    (exact,) = reference(X0, m, end)
    for order in (2, 4, 6):
        solver = phigen.compile(loads(BODIES), order=order, target="numpy")
        errors = [np.abs(solver.integrate(X0, h, until=end, m=m).x[-1] - exact).max() for h in (0.02, 0.01)]
        assert np.log2(errors[0] / errors[1]) > order - 0.4, (order, errors)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_step_is_a_poisson_map_for_a_fixed_level(target):
    solver = phigen.compile(loads(BODIES), target=target, tangent=True, order=4)
    h, unit = 0.08, np.eye(X0.size).reshape(-1, *X0.shape)
    level = {"gauge": -solver.hamiltonian(X0)}
    _, columns = solver.step_tangent(X0, h, unit, **level)
    slope = columns.reshape(X0.size, -1).T
    canonical = np.kron(np.array([[0, 1], [-1, 0]]), np.eye(X0.size // 2))
    np.testing.assert_allclose(slope @ canonical @ slope.T, canonical, rtol=0, atol=2e-13)
    apart = 1e-5
    for k in range(X0.size):
        ends = [solver.step(X0 + s * apart * unit[k], h, **level) for s in (1, -1)]
        np.testing.assert_allclose(columns[k], (ends[0] - ends[1]) / (2 * apart), rtol=0, atol=1e-7)


def test_the_level_of_the_start_is_held():
    solver = phigen.compile(loads(BODIES), target="numpy")
    there = solver.integrate(X0, 0.05, 3).x[-1]
    back = solver.integrate(there, -0.05, 3, gauge=-solver.hamiltonian(X0)).x[-1]
    np.testing.assert_allclose(back, X0, rtol=0, atol=1e-14)
    assert np.abs(solver.integrate(there, -0.05, 3).x[-1] - X0).max() > 1e-8
    with pytest.raises(ValueError, match="one finite number"):
        solver.integrate(X0, 0.05, 3, gauge=[1, 2])


def test_pairs_have_the_steps_of_the_ordinary_system(tmp_path):
    (tmp_path / "bodies.yaml").write_text(BODIES)
    shown = ["show", str(tmp_path / "bodies.yaml"), "--expand", "3"]
    listed = CliRunner().invoke(group, shown, prog_name="phigen").stdout
    ordinary = phigen.compile(loads(f"{listed}scheme: splitting\nmonitor: log\n"), target="numpy", order=4)
    expected = ordinary.run("meet")
    for target in ("c", "numpy"):
        run = phigen.compile(loads(BODIES), target=target, order=4).run("meet")
        np.testing.assert_allclose(run.x.reshape(len(run), -1), expected.x, rtol=0, atol=1e-13)
        np.testing.assert_allclose(run.t, expected.t, rtol=1e-13)
        np.testing.assert_allclose(run.tau, expected.tau, rtol=1e-13)


def test_steps_and_tangents_of_javascript_are_those_of_numpy(tmp_path):
    compilation = compile_spec(loads(BODIES), tangent=True)
    write(tmp_path, emit(compilation.program, "js", COMMAND))
    options = {"x0": X0.ravel().tolist(), "params": {"m": [1, 0.3, 0.2]}}
    begun = f"const s = new module.Solver({json.dumps(options)}); s.integrate(0.02, 7); "
    body = (
        f"{begun} const v = s.stepTangent(0.02, [{json.dumps(X0.ravel().tolist())}]); return [[...s.x], s.t, [...v[0]]]"
    )
    x, t, carried = asked(tmp_path / "bodies.mjs", body)
    solver = phigen.compile(loads(BODIES), target="numpy", tangent=True)
    run = solver.integrate(X0, 0.02, 8)
    np.testing.assert_allclose(np.reshape(x, X0.shape), run.x[-1], rtol=0, atol=1e-14)
    assert abs(t - run.t[-1]) < 1e-15
    level = -solver.hamiltonian(X0)
    expected = solver.step_tangent(run.x[-2], 0.02, X0[None], gauge=level)[1]
    np.testing.assert_allclose(np.reshape(carried, X0.shape), expected[0], rtol=0, atol=1e-13)


@pytest.mark.slow
def test_bodies_that_several_threads_share_have_the_steps_of_numpy():
    angle = 2 * np.pi * np.arange(600) / 600
    x0 = np.array([np.cos(angle), np.sin(angle), 0.001 * np.sin(3 * angle), 0.001 * np.cos(2 * angle)])
    runs = [
        phigen.compile(loads(BODIES), target=target, order=2).integrate(x0, 0.1, 2, m=np.full(600, 1 / 600))
        for target in ("c", "c", "numpy")
    ]
    np.testing.assert_array_equal(runs[0].x, runs[1].x)
    # Forces of neighbours, which are some 100 times their sum, cancel.
    np.testing.assert_allclose(runs[0].x[-1], runs[2].x[-1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(runs[0].t[-1], runs[2].t[-1], rtol=1e-13)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_a_start_without_attraction_is_refused_and_a_step_to_a_collision_fails(target):
    repelling = BODIES.replace("pairs: -m[a]", "pairs: k*m[a]").replace("{m:", "{k: -1, m:")
    solver = phigen.compile(loads(repelling), target=target)
    with pytest.raises(StepError, match="is not negative at the start"):
        solver.integrate(X0, 0.1, 1, k=1.0)
    session = solver.session(X0)
    with pytest.raises(StepError, match="not finite"):
        session.x = X0 * np.array([0, 0, 1, 1])[:, None]  # all bodies at one place
    np.testing.assert_array_equal(session.x, X0)
    session.step(0.02)
    assert session.t > 0


def test_sessions_kicks_and_copies_take_the_level_of_their_state():
    solver = phigen.compile(loads(BODIES))
    session = solver.session(X0).step(0.02, 2)
    twin = session.copy()
    before = session.t
    session.kick(0.01 * np.ones_like(X0))
    kicked, t = session.x, session.t
    session.step(0.02, 3)
    fresh = solver.session(kicked).step(0.02, 3)
    assert t == before
    np.testing.assert_allclose(session.x, fresh.x, rtol=0, atol=1e-14)
    assert abs(session.t - t - fresh.t) < 1e-14
    twin.step(0.02, 3)
    np.testing.assert_array_equal(twin.x, solver.integrate(X0, 0.02, 5).x[-1])


def phi(*command: str) -> str:
    result = CliRunner().invoke(group, [str(c) for c in command], prog_name="phigen")
    assert result.exit_code == 0, result.output
    return result.output


def test_runs_are_continued_with_the_times_and_the_level_of_one_run(tmp_path):
    spec = tmp_path / "bodies.yaml"
    spec.write_text(BODIES)
    said = phi("run", spec, "--until", "0.5", "--every", "0.1", "-o", tmp_path / "half.npz")
    assert "in τ and a part of one" in said
    phi("run", spec, "--until", "1", "--every", "0.1", "-o", tmp_path / "half.npz", "--extend")
    phi("run", spec, "--until", "1", "--every", "0.1", "-o", tmp_path / "whole.npz")
    with np.load(tmp_path / "half.npz") as half, np.load(tmp_path / "whole.npz") as whole:
        np.testing.assert_allclose(half["t"], np.linspace(0, 1, 11), rtol=0, atol=1e-15)
        np.testing.assert_allclose(half["t"], whole["t"], rtol=0, atol=1e-15)
        # A shorter step that ends at t = 0.5 is another map of the same order.
        np.testing.assert_allclose(half["x"], whole["x"], rtol=0, atol=1e-4)
        assert whole["tau"][-1] == pytest.approx(float(whole["steps"]) * 0.02, abs=0.02)


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_an_interrupted_run_goes_on_with_the_same_bits(tmp_path, target):
    solver, steps_made = phigen.compile(loads(BODIES), target=target), []

    def stop(steps_done: int) -> None:
        steps_made.append(steps_done)
        if steps_done == 6:
            raise KeyboardInterrupt

    options = {"checkpoints": tmp_path / "state", "output": tmp_path / "frames.npz"}
    with pytest.raises(KeyboardInterrupt):
        solver.integrate(X0, 0.02, 12, 3, progress=stop, **options)
    resumed, whole = solver.integrate(X0, 0.02, 12, 3, **options), solver.integrate(X0, 0.02, 12, 3)
    np.testing.assert_array_equal(resumed.x, whole.x)
    np.testing.assert_array_equal(resumed.t, whole.t)
    np.testing.assert_array_equal(resumed.tau, whole.tau)


def test_sections_and_stops_are_met_at_physical_times():
    text = BODIES.replace(
        "step: 0.02, steps: 40", "step: 0.02, until: 3, stop: closest - 0.1, section: closest - 0.3, direction: falling"
    )
    run = phigen.compile(loads(text)).run()
    assert run.observables["closest"][-1] == pytest.approx(0.1, abs=1e-13)
    there = phigen.compile(loads(BODIES)).integrate(X0, 0.02, until=float(run.t[-1]))
    np.testing.assert_allclose(there.x[-1], run.x[-1], rtol=0, atol=1e-12)
    assert len(run.crossings)
    assert np.allclose(run.crossings.observables["closest"], 0.3, rtol=0, atol=1e-13)


REFUSED = {
    "chain": (
        "lattice: {axes: [i]}\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
        "hamiltonian: p**2/2 - 1/(1 + q**2)\nmonitor: log\n",
        "for pairs only",
    ),
    "formula": (BODIES.replace("monitor: log", "monitor: x**2"), "has no splitting"),
    "series": (BODIES.replace("scheme: splitting", "scheme: series"), "split in two"),
    "adjoint": (BODIES + "adjoint: true\n", "gradients"),
    "damped": (BODIES + "damping: 0.1\n", "not offered with forces"),
    "repelling": (BODIES.replace("pairs: -m", "pairs: m"), "needs a part that is negative"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_has_no_monitor_is_refused_at_its_place(case):
    text, message = REFUSED[case]
    head = "" if text.startswith("phigen") else "phigen: 1\nname: refused\n"
    with pytest.raises(SpecError, match=message) as error:
        phigen.compile(loads(head + text))
    line = (head + text).split("monitor:")[0].count("\n") + 1
    assert error.value.diagnostics[0].location.line == line


def test_verify_holds_the_level(tmp_path):
    spec = Path(tmp_path / "bodies.yaml")
    spec.write_text(BODIES.replace("scheme:", "order: 4\nscheme:"))
    assert "Poisson identity on 3 sites" in phi("verify", spec, "--quick")
