"""`Solver.run` and `LatticeSolver.run`: named runs of a spec from Python."""

import pickle

import numpy as np
import pytest

import phigen
import phigen.spec
from phigen.errors import SpecError
from phigen.lattice.states import start_of

DRIVEN = """\
phigen: 1
name: driven
time: t
coordinates: [q, p]
parameters: {A: 0.5, omega: 2}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - cos(q) - A*q*cos(omega*t)
order: 2
runs:
  strided: {initial: [1, 0], step: 0.1, steps: 200, start: 0.5, stride: 7, parameters: {A: 0.6}}
  until: {initial: [1, 0], step: 0.1, until: 5.03, start: 0.5}
  timed: {initial: [1, 0], step: 0.1, until: 5.03, start: 0.5, every: 0.26}
  backwards: {initial: [1, 0], step: -0.1, steps: 33, start: 0.5, every: 0.26}
  stopped: {initial: [1, 0], step: 0.1, steps: 200, stop: q + A*cos(t), start: 0.5}
  stopped_and_timed: {initial: [1, 0], step: 0.1, steps: 200, stop: q + 0.2, every: 0.4}
  never_stopped: {initial: [0.1, 0], step: 0.1, steps: 20, stop: q - 30, stride: 6}
"""

MONITORED = """\
phigen: 1
name: comet
coordinates: [x, y, u, v]
poisson: {canonical: {q: [x, y], p: [u, v]}}
hamiltonian: (u**2 + v**2)/2 - 1/sqrt(x**2 + y**2)
monitor: (x**2 + y**2)**(3/4)
order: 4
runs:
  steps: {initial: [1, 0, 0, 0.6], step: 0.1, steps: 30, stride: 4}
  timed: {initial: [1, 0, 0, 0.6], step: 0.1, steps: 30, every: 0.5}
  until: {initial: [1, 0, 0, 0.6], step: 0.1, until: 2, every: 0.7}
  stopped: {initial: [1, 0, 0, 0.6], step: 0.1, steps: 90, stop: y - x/3}
"""

DISORDERED = """\
phigen: 1
name: chain
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {k: 1, B: {value: {random: normal, seed: 5}, at: sites}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + k*(q[i+1] - q)**2/2 + B*q**4/4
order: 2
runs:
  wave: {sizes: [12], initial: {q: sin(2*pi*i/N_i), p: 0}, step: 0.05, steps: 20, stride: 6, parameters: {k: 2}}
"""


@pytest.mark.parametrize(
    ("text", "target"),
    [
        pytest.param(DRIVEN, "c", id="driven-c"),
        pytest.param(DRIVEN, "numpy", id="driven-numpy", marks=pytest.mark.slow),
        pytest.param(MONITORED, "c", id="monitored-c", marks=pytest.mark.slow),
        pytest.param(MONITORED, "numpy", id="monitored-numpy", marks=pytest.mark.slow),
    ],
)
def test_run_has_the_rows_of_the_command(text, target, tmp_path, monkeypatch):
    from click.testing import CliRunner

    from phigen.cli import group

    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.yaml").write_text(text)
    solver = phigen.compile("s.yaml", target=target)
    assert solver.runs == tuple(phigen.spec.loads(text).runs)
    for name in solver.runs:
        line = ["run", "s.yaml", "--run", name, "--target", target, "--output", f"{name}.npz"]
        assert CliRunner().invoke(group, line, prog_name="phigen").exit_code == 0
        written, trajectory = np.load(f"{name}.npz"), solver.run(name)
        np.testing.assert_allclose(trajectory.t, written["t"], rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(trajectory.x, written["x"], rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(trajectory.energy, written["energy"], rtol=1e-11, atol=1e-12)


def test_rows_of_monitored_runs_are_compared_with_no_estimate_of_their_end():
    """With a monitor, steps are unequal in time, so neither the number of steps until a time nor the time after a
    number of steps is known in advance.
    """
    text = MONITORED[: MONITORED.index("runs:")].replace("(x**2 + y**2)**(3/4)", "(x**2 + y**2)**(3/4)/10")
    runs = """runs:
  until: {initial: [1, 0, 0, 0.6], step: 0.5, until: 0.9, stride: 9}
  fast: {initial: [1, 0, 0, 0.6], step: 0.001, steps: 8, at: [0.0005, 0.0007]}
"""
    solver = phigen.compile(phigen.spec.loads(text + runs), target="numpy")
    until = solver.run("until")
    assert len(until.t) > 2
    assert until.tau[1] == pytest.approx(4.5)
    assert until.t[-1] == pytest.approx(0.9)
    slow = text.replace("/10", "*100") + runs.replace("[0.0005, 0.0007]", "[0.05, 0.7]")
    assert phigen.compile(phigen.spec.loads(slow), target="numpy").run("fast").t[1:3] == pytest.approx([0.05, 0.7])


def test_arguments_take_the_place_of_settings():
    solver = pickle.loads(pickle.dumps(phigen.compile(phigen.spec.loads(DRIVEN))))
    by_hand = solver.integrate([0.3, 0.2], 0.05, 40, 9, t0=0.5, A=0.6, omega=1.5)
    run = solver.run(x0=[0.3, 0.2], step=0.05, steps=40, stride=9, omega=1.5)
    np.testing.assert_array_equal(run.x, by_hand.x)
    assert run.parameters == {"A": 0.6, "omega": 1.5}
    assert solver.run("until", every=0.5).t[1:3] == pytest.approx([1.0, 1.5])
    assert solver.run("strided", until=1.73).t[-1] == pytest.approx(1.73)
    assert solver.run("timed", stride=5).t[1] == pytest.approx(1.0)
    np.testing.assert_array_equal(solver.run(q=0.3, p=0.2, step=0.05, steps=40, stride=9, omega=1.5).x, by_hand.x)
    rows = solver.run("strided", at=[1.7, 0.9])
    assert rows.t[:-1] == pytest.approx([0.5, 0.9, 1.7])
    np.testing.assert_allclose(rows.x[1:3], solver.run("strided", stride=1).at([0.9, 1.7]), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"name": "strided_"}, "did you mean 'strided'?"),
        ({"steps": 3, "until": 3.0}, "either steps or until"),
        ({"stride": 3, "every": 3.0}, "either stride or every"),
        ({"until": -1.0}, "never reached"),
        ({"every": 1.0, "at": [1.0]}, "either every or at"),
        ({"at": [0.25]}, "before the start"),
        ({"at": [1e3]}, "after the end"),
        ({"x0": [0.3, 0.2], "q": 0.1}, "either x0 or initial values"),
        ({"every": 0.0}, "every = 0.0 is not positive"),
        ({"every": float("nan")}, "every must be a finite number"),
        ({"steps": 0}, "steps must be at least 1"),
        ({"B": 1.0}, "unknown parameter 'B'"),
        ({"seed": 1}, "seed"),
    ],
)
def test_wrong_settings_are_refused(settings, message):
    solver = phigen.compile(phigen.spec.loads(DRIVEN), target="numpy")
    with pytest.raises((ValueError, TypeError), match=message.replace("?", r"\?")):
        solver.run(**settings)


def test_a_solver_without_runs_says_so():
    text = DRIVEN[: DRIVEN.index("runs:")]
    with pytest.raises(ValueError, match="has no runs"):
        phigen.compile(phigen.spec.loads(text), target="numpy").run()


@pytest.mark.parametrize("target", ["c", "numpy"])
def test_lattice_runs_at_its_sizes_and_at_others(target):
    spec = phigen.spec.loads(DISORDERED)
    solver = phigen.compile(spec, target=target)
    start = start_of(spec, spec.runs["wave"])
    by_hand = solver.integrate(start.state, 0.05, 20, 6, parameters=start.arguments)
    np.testing.assert_array_equal(solver.run("wave").x, by_hand.x)
    rows = solver.run("wave", at=[0.1, 0.73])
    assert rows.t == pytest.approx([0, 0.1, 0.73, 1.0])
    np.testing.assert_allclose(rows.x[1:3], by_hand.at([0.1, 0.73]), rtol=0, atol=1e-12)
    other = solver.run(sizes=[16], steps=3, k=0.5)
    assert other.x.shape == (2, 2, 16)
    assert other.parameters["k"] == 0.5
    assert other.parameters["B"].shape == (16,)
    with pytest.raises(ValueError, match="sizes must have one number for each axis"):
        solver.run(sizes=[4, 4])


def test_a_start_that_does_not_fit_other_sizes_is_refused():
    listed = DISORDERED.replace("sizes: [12], initial: {q: sin(2*pi*i/N_i)", "sizes: [4], initial: {q: [1, 2, 3, 4]")
    solver = phigen.compile(phigen.spec.loads(listed), target="numpy")
    assert solver.run().x.shape[-1] == 4
    with pytest.raises(SpecError, match="4 values, not 6"):
        solver.run(sizes=[6])


def test_lattices_are_loaded_and_compiled(tmp_path):
    file = tmp_path / "chain.yaml"
    file.write_text(DISORDERED)
    lattice = phigen.load(file)
    assert isinstance(lattice, phigen.LatticeSystem)
    assert repr(lattice) == "<LatticeSystem chain: (q, p) at each site, on axes i>"
    assert lattice.spec.runs["wave"].steps == 20
    np.testing.assert_array_equal(phigen.compile(lattice).run().x, phigen.compile(file).run().x)


def test_a_failing_row_keeps_those_before_it():
    text = DRIVEN.replace("p**2/2 - cos(q)", "p**2/2 - q**4").replace("[1, 0]", "[2, 2]")
    solver = phigen.compile(phigen.spec.loads(text), target="numpy")
    with pytest.raises(phigen.StepError) as failure:
        solver.run("timed", every=0.05)
    assert len(failure.value.trajectory) > 1
    assert np.isfinite(failure.value.trajectory.x).all()
