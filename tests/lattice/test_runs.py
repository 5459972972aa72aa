"""Runs of lattices: ends, rows and sections between steps, retries and resumed runs, compared with the ordinary
spec.
"""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

import phigen
import phigen.spec
from phigen.cli import group
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import expand, run_of
from phigen.lattice.states import start_of
from phigen.mpi import DistributedLattice
from phigen.runtime import lattice_series
from phigen.runtime.checkpoint import Checkpoint
from phigen.runtime.interface import BackendError
from phigen.runtime.numpy_lattice import NumpyLatticeSession
from phigen.study.lattice_errors import works

ROTORS = """\
phigen: 1
name: rotors
coordinates: [q, p]
parameters: {K: 0.7, level: 0.2}
lattice: {axes: [i], boundary: periodic}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: "p**2/2 + K*(1 - cos(q[i+1] - q))"
observables: {T: {mean: p**2/2}, C: {mean: "cos(q[i+1] - q)"}, local: p**2/2}
order: 2
runs:
"""
RUN = "sizes: [5], initial: {q: 0.4*i, p: sin(2*pi*i/N_i)}"
ROTORS += f"""\
  mix: {{{RUN}, step: 0.1, steps: 80, stop: T - 0.06, every: 0.25, section: T - level, direction: falling}}
  until: {{{RUN}, step: 0.1, until: 2.05, stride: 7}}
  both: {{{RUN}, step: 0.1, steps: 60, section: T - level, direction: both, record: [T, energy], stride: 6}}
  listed: {{{RUN}, step: 0.1, until: 2.05, at: [1.3, 0.25, 2, 2.05, 0.25]}}
  back: {{{RUN}, step: -0.1, until: -2.05, section: C - 0.5, direction: both}}
"""
DRIVEN = """\
phigen: 1
name: driven
time: t
coordinates: [q, p]
lattice: {axes: [i], boundary: open}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: "p**2/2 + (q[i+1] - q)**2/2 - 0.4*q*cos(1.3*t)"
observables: {X: {mean: q}}
order: 4
runs: {r: {sizes: [4], initial: {q: 0.3*i, p: 0}, step: 0.1, until: 3.33, every: 0.37, start: 0.5}}
"""


@pytest.fixture(scope="module")
def rotors():
    return phigen.compile(phigen.spec.loads(ROTORS), target="numpy")


@pytest.fixture(scope="module")
def written_out(rotors):
    """Return the lattice as an ordinary system, with its start."""
    spec = rotors.spec
    cell, start = cell_from_spec(spec), start_of(spec, spec.runs["mix"])
    expansion = expand(cell, start.sizes, ())
    assert run_of(expansion, spec.runs["mix"], start.state, {}).stop is None
    return phigen.compile(expansion.spec(), order=2, scheme="splitting", target="numpy"), start.state.reshape(-1)


def kinetic(states, level=0.2):
    return (states[:, 5:] ** 2).mean(axis=1) / 2 - level


def test_a_run_stops_where_the_ordinary_system_meets_the_same_expression(rotors, written_out):
    run, (solver, x0) = rotors.run("mix"), written_out
    zeros = solver.section(x0, 0.1, 80, lambda x: kinetic(x, 0.06), direction="both")
    assert run.t[-1] == pytest.approx(zeros.t[0], rel=1e-10)
    assert run.t[:-1] == pytest.approx(0.25 * np.arange(len(run) - 1), rel=1e-13)
    assert run.observables["T"][-1] == pytest.approx(0.06, abs=1e-15)
    np.testing.assert_allclose(run.x[-1].reshape(-1), zeros.x[0], atol=1e-10)
    for t, x in zip(run.t, run.x, strict=True):
        np.testing.assert_allclose(rotors.integrate(run.x[0], 0.1, until=t).x[-1] if t else run.x[0], x, atol=1e-13)


@pytest.mark.parametrize("name", ["mix", "both", "back"])
def test_crossings_of_a_section_are_those_of_the_ordinary_system(rotors, written_out, name):
    run, (solver, x0) = rotors.run(name), written_out
    h, steps = (-0.1, 21) if name == "back" else (0.1, 60)
    g = kinetic if name != "back" else lambda x: np.cos(np.diff(x[:, [0, 1, 2, 3, 4, 0]])).mean(axis=1) - 0.5
    zeros = solver.section(x0, h, steps, g, direction="falling" if name == "mix" else "both")
    inside = abs(zeros.t) <= abs(run.t[-1])
    assert sum(inside) == len(run.crossings) >= 1
    assert run.crossings.t == pytest.approx(zeros.t[inside], rel=1e-10)
    if name == "both":
        assert run.crossings.columns["T"] == pytest.approx(0.2, abs=1e-15)
        assert list(run.columns) == list(run.crossings.columns) == ["T", "energy"]
    else:
        np.testing.assert_allclose(run.crossings.x.reshape(len(run.crossings), -1), zeros.x[inside], atol=1e-10)


def test_a_run_until_a_time_ends_with_a_part_of_a_step(rotors):
    run = rotors.run("until")
    assert run.t == pytest.approx([0, 0.7, 1.4, 2.05], rel=1e-14)
    assert run.steps == 20
    live = rotors.session(run.x[0]).step(0.1, 20).step(0.05)
    np.testing.assert_allclose(run.x[-1], live.x, atol=1e-15)
    with pytest.raises(TypeError, match="either steps or until"):
        rotors.integrate(run.x[0], 0.1, 10, until=3)


def test_rows_between_steps_know_the_time_and_the_work_that_was_done():
    solver = phigen.compile(phigen.spec.loads(DRIVEN), target="numpy")
    run = solver.run()
    assert run.t == pytest.approx([*(0.5 + 0.37 * np.arange(8)), 3.33], rel=1e-14)
    fine = solver.integrate(run.x[0], 0.01, until=run.t[3], t0=0.5)
    np.testing.assert_allclose(run.x[3], fine.x[-1], atol=3e-7)
    work, _ = works(cell_from_spec(solver.spec), run)
    assert np.ptp(run.energy) > 0.1
    np.testing.assert_allclose(run.energy - work, run.energy[0], atol=1e-6)


def test_steps_that_fail_are_made_in_parts_at_the_right_times(monkeypatch):
    solver = phigen.compile(phigen.spec.loads(DRIVEN), target="numpy")
    x0, advance = np.array([[0.1, 0.2, 0.4], [0.0, 1.0, 0.0]]), NumpyLatticeSession.advance

    def failing(session, h, steps):
        if abs(h) > 0.06:
            raise BackendError("NO_CONVERGENCE", session.steps, session.state()[None])
        advance(session, h, steps)

    fine = solver.integrate(x0, 0.05, 8, 2, t0=0.3)
    monkeypatch.setattr(NumpyLatticeSession, "advance", failing)
    run = solver.integrate(x0, 0.1, 4, t0=0.3, retry=1)
    assert run.retried == (0, 1, 2, 3)
    np.testing.assert_allclose(run.x, fine.x, atol=1e-14)
    np.testing.assert_array_equal(run.t, 0.3 + 0.1 * np.arange(5))
    assert solver.integrate(x0, 0.1, until=0.65, t0=0.3, retry=1).retried == (0, 1, 2)
    with pytest.raises(phigen.StepError):
        solver.integrate(x0, 0.1, 4, t0=0.3)


def test_a_crossing_in_the_last_part_of_a_step_is_found(rotors):
    crossings = rotors.run("both").crossings.t
    assert 1.5 < crossings[0] < 1.56  # the run ends within the step that starts at 1.5
    assert list(rotors.run("both", until=1.56).crossings.t) == pytest.approx([crossings[0]], rel=1e-12)
    assert not len(rotors.run("both", until=1.52).crossings)


def test_retries_and_extremes_of_a_section_outlast_an_interrupt(rotors, tmp_path, monkeypatch):
    every = rotors.run("both", stride=1)
    k = 20 + int(np.argmin(every.columns["T"][20:35]))
    near, advance = every.columns["T"][k - 1 : k + 2], NumpyLatticeSession.advance
    lowest = near[1] - (near[2] - near[0]) ** 2 / (8 * (near[0] - 2 * near[1] + near[2]))
    level = near[1] - 0.5 * (near[1] - lowest)  # both crossings are between two steps
    monkeypatch.setattr(lattice_series, "CHECKPOINT_SECONDS", 0.0)

    def failing(session, h, steps):
        if h == 0.1:
            raise BackendError("NO_CONVERGENCE", session.steps, session.state()[None])
        advance(session, h, steps)

    def interrupt(step):
        if step == k:
            raise KeyboardInterrupt

    settings = {"stride": 1, "level": level, "steps": k + 3}
    retried = rotors.run("both", **settings)
    assert len(retried.crossings) == 2
    for retry in (0, 1):
        with monkeypatch.context() as patched:
            if retry:
                patched.setattr(NumpyLatticeSession, "advance", failing)
            whole = rotors.run("both", retry=retry, **settings)
            with pytest.raises(KeyboardInterrupt):
                rotors.run("both", retry=retry, checkpoints=tmp_path / "kept", progress=interrupt, **settings)
            resumed = rotors.run("both", retry=retry, checkpoints=tmp_path / "kept", **settings)
        assert len(resumed.crossings) == len(whole.crossings)
        np.testing.assert_array_equal(resumed.t, whole.t)
        np.testing.assert_array_equal(resumed.last, whole.last)
        np.testing.assert_array_equal(resumed.crossings.t, whole.crossings.t)


def test_times_of_a_spec_are_those_of_the_command_line(rotors, cli, spec):
    run = rotors.run("listed")
    assert list(run.t) == pytest.approx([0, 0.25, 1.3, 2, 2.05], rel=1e-14)
    np.testing.assert_allclose(run.x[2], rotors.integrate(run.x[0], 0.1, until=1.3).x[-1], atol=1e-14)
    assert len(rotors.run("listed", stride=7)) == 4
    assert list(rotors.run("listed", until=1.5).t) == pytest.approx([0, 0.25, 1.3, 1.5], rel=1e-14)
    for more in ([], ["--at", "1.3,0.25,2"]):
        ran(cli, spec, "--run", "listed", "-o", "a.npz", *more)
        with np.load("a.npz") as stored:
            np.testing.assert_array_equal(stored["x"], run.x)
    ran(cli, spec, "--run", "listed", "-o", "a.npz", "--until", "1.5")
    with np.load("a.npz") as stored:
        assert list(stored["t"]) == pytest.approx([0, 0.25, 1.3, 1.5], rel=1e-14)


def test_processes_refuse_parts_of_steps():
    lattice = object.__new__(DistributedLattice)
    lattice.solver = phigen.compile(phigen.spec.loads(ROTORS), target="numpy")
    with pytest.raises(
        TypeError, match="until is not available on several processes, which store rows after whole steps only"
    ):
        lattice.integrate(np.zeros((2, 5)), 0.1, 4, until=3)


# --- the command line


@pytest.fixture
def cli():
    """Return a function that runs a command line in this process."""
    return lambda *args: CliRunner().invoke(group, [str(a) for a in args], prog_name="phigen")


@pytest.fixture
def spec(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "rotors.yaml"
    path.write_text(ROTORS, encoding="utf-8")
    return path


def ran(cli, *args):
    result = cli("run", *args, "-t", "numpy", "-q")
    assert result.exit_code == 0, result.stderr
    return result


def test_a_table_has_a_column_for_each_number_of_a_state(cli, spec, rotors):
    output = ran(cli, spec, "-o", "a.csv", "--section", "s.csv").stdout
    run, (header, *rows) = rotors.run("mix"), spec.with_name("a.csv").read_text().splitlines()
    assert header == "t,q_0,q_1,q_2,q_3,q_4,p_0,p_1,p_2,p_3,p_4,energy,T,C"
    expected = np.column_stack([run.t, run.x.reshape(len(run), -1), run.energy, run.observed])
    np.testing.assert_array_equal([[float(v) for v in row.split(",")] for row in rows], expected)
    assert "crossing of the section T - level = 0" in output
    assert len(spec.with_name("s.csv").read_text().splitlines()) == 1 + len(run.crossings)
    result = cli("run", spec, "--sizes", "501", "-o", "a.csv")
    assert (result.exit_code, "1002 columns, more than 1000" in result.stderr) == (2, True)


def test_states_at_given_times_and_what_cannot_be(cli, spec, rotors):
    ran(cli, spec, "--run", "until", "--at", "1.3,0.25,2", "-o", "a.npz", "--plot", "a.svg")
    with np.load(spec.with_name("a.npz")) as stored:
        assert stored["t"] == pytest.approx([0, 0.25, 1.3, 2, 2.05], rel=1e-14)
        np.testing.assert_allclose(stored["x"][2], rotors.integrate(stored["x"][0], 0.1, until=1.3).x[-1], atol=1e-14)
    for option, message in (
        (["--at", "9"], "9.0 is not between 0.0 and 2.05"),
        (["--every", "-1"], "must be positive"),
        (["--every", "1", "--at", "1"], "exclude each other"),
        (["--section", "s.csv"], "has no section"),
        (["--until", "-1"], "never reached"),
        (["--extend", "-o", "no.npz"], "continues a finished run"),
    ):
        result = cli("run", spec, "--run", "until", "-t", "numpy", *option)
        assert (result.exit_code, message in " ".join(result.stderr.split())) == (2, True)


@pytest.mark.parametrize(
    ("name", "suffix", "first"), [("until", "npz", 2.1), ("until", "csv", 1.4), ("both", "npz", 2.4)]
)
def test_a_run_that_is_extended_is_the_longer_run(cli, spec, name, suffix, first):
    file, whole = (spec.with_name(f"{which}.{suffix}") for which in ("part", "whole"))
    ran(cli, spec, "--run", name, "-o", file, "--until", first)
    ran(cli, spec, "--run", name, "-o", file, "--extend", "--until", "4.2")
    ran(cli, spec, "--run", name, "-o", whole, "--until", "4.2")
    if suffix == "csv":
        rows, expected = (np.loadtxt(path, delimiter=",", skiprows=1) for path in (file, whole))
        np.testing.assert_allclose(rows, expected, rtol=1e-13, atol=1e-14)
    else:
        with np.load(file) as rows, np.load(whole) as expected:
            assert sorted(rows) == sorted(expected)
            for key in set(rows) - {"coordinates", "axes", "origin"}:
                np.testing.assert_allclose(rows[key], expected[key], rtol=1e-13, atol=1e-14)
    result = cli("run", spec, "--run", name, "-o", file, "--extend", "--set", "K=1", "--sizes", "6", "-t", "numpy")
    assert (result.exit_code, "does not hold a run of rotors" in result.stderr) == (2, True)


@pytest.mark.parametrize("more", [["--run", "mix"], ["--run", "both"], ["--run", "until", "--extend"]])
def test_an_interrupted_run_goes_on_to_the_same_files(cli, spec, monkeypatch, more):
    monkeypatch.setattr(lattice_series, "CHECKPOINT_SECONDS", 0.0)
    section = [] if "until" in more else ["--section", "s.npz"]
    name, good, count = more[1], Checkpoint.save, [0]

    def begin():
        if "--extend" in more:
            ran(cli, spec, "--run", name, "-o", "a.npz")

    def stopping(checkpoint, path):
        good(checkpoint, path)
        count[0] += 1
        if count[0] == 3:
            raise KeyboardInterrupt

    longer = ["--until", "6.05"] if "--extend" in more else []
    command = ("run", spec, "-t", "numpy", "-o", "a.npz", *section, *more, *longer)
    begin()
    assert cli(*command).exit_code == 0
    files = [spec.with_name("a.npz"), *([spec.with_name("s.npz")] if section else [])]
    whole = [path.read_bytes() for path in files]
    for path in files:
        path.unlink()
    begin()
    with monkeypatch.context() as patched:
        patched.setattr(Checkpoint, "save", stopping)
        halted = cli(*command)
    assert halted.exit_code == 130
    assert "repeat the command with --resume to continue" in " ".join(halted.stderr.split())
    assert "belongs to an interrupted run" in " ".join(cli(*command).stderr.split())
    resumed = cli(*command, "--resume")
    assert resumed.exit_code == 0
    assert "resuming from" in resumed.stderr
    with np.load(files[0]) as stored:
        assert len(stored["t"]) > 4
    assert [path.read_bytes() for path in files] == whole
    assert not list(spec.parent.glob("*.checkpoint"))


PLANETS = """\
phigen: 1
name: bodies
lattice: {pairs: all}
coordinates: [x, y, px, py]
parameters: {m: {value: [1, 0.01, 0.001], at: sites, positive: true}}
poisson: {canonical: {q: [x, y], p: [px, py]}}
hamiltonian:
  sites: (px**2 + py**2)/(2*m)
  pairs: -m[a]*m[b]/sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)
order: 2
runs:
  r:
    initial: {x: [0, 1, 2], y: [0, 0, 0], px: [0, 0, 0], py: [0, 0.01, 0.0007]}
    names: [Sun, Jupiter, "&<b>"]
    step: 0.05
    steps: 40
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('Jupiter, "&<b>"]', "Jupiter]", "names: 2 names for 3 sites"),
        ('"&<b>"]', "Sun]", "names: 'Sun' is given twice"),
        ("names: [Sun", "names: [[Sun]", "expected text, found a list"),
        ("names: [Sun", "named: [Sun", "did you mean 'names'?"),
    ],
)
def test_names_of_bodies_are_one_for_each(old, new, message):
    assert old in PLANETS
    with pytest.raises(phigen.SpecError) as error:
        phigen.compile(phigen.spec.loads(PLANETS.replace(old, new), "bodies.yaml"), target="numpy").run()
    assert message in str(error.value)
    assert str(error.value).startswith("bodies.yaml:1")


def test_names_are_for_graphs_and_pairs():
    text = "phigen: 1\nname: c\nlattice: {axes: [i]}\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
    text += "hamiltonian: p**2/2 + q**2/2\n"
    text += "runs: {r: {sizes: [2], initial: {q: 0, p: 1}, names: [a, b], step: 0.1, steps: 2}}\n"
    with pytest.raises(phigen.SpecError, match="names: sites have names only with"):
        phigen.spec.loads(text)


def test_paths_of_bodies_are_drawn_in_their_plane_with_their_names():
    pytest.importorskip("matplotlib")
    from phigen.drawing.lattice_figures import lattice_figure

    run = phigen.compile(phigen.spec.loads(PLANETS), target="numpy").run()
    paths = lattice_figure(run, {"energy": np.full(len(run), 1e-3)}, "", site_names=["Sun", "Jupiter", "&<b>"]).axes[0]
    drawn = [line.get_xydata() for line in paths.get_lines()]
    for site in range(3):
        np.testing.assert_array_equal(drawn[2 * site], run.x[:, :2, site])
        np.testing.assert_array_equal(drawn[2 * site + 1], run.x[-1:, :2, site])
    assert [text.get_text() for text in paths.texts] == ["Sun", "Jupiter", "&<b>"]
    assert (paths.get_xlabel(), paths.get_ylabel()) == ("x", "y")
