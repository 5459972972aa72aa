"""Lattices on the command line: ``phigen show``, ``check`` and ``verify``, expansions, and systems that become
lattices.
"""

from __future__ import annotations

import json

import pytest
from lattice.lattices import LATTICES

from phigen import compiler
from phigen.spec import loads


@pytest.fixture
def lattice(tmp_path):
    """Return a function that writes the lattice of a name to a file, and returns the path."""

    def write(name):
        path = tmp_path / f"{name}.yaml"
        path.write_text(LATTICES[name], encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("name", ["toda", "fput_open"])
def test_an_expansion_compiles_as_an_ordinary_spec(phigen, lattice, name):
    printed = phigen("show", lattice(name), "--expand", "4").stdout
    compilation = compiler.compile_proved(loads(printed), scheme="splitting")
    assert compilation.spec.name == f"{name.partition('_')[0]}_4"


def test_the_starter_of_a_lattice_reads_and_is_proved(phigen, tmp_path):
    path = tmp_path / "chain.yaml"
    assert phigen("new", "chain", "--lattice", "-o", path).exit_code == 0
    result = phigen("check", path)
    assert (result.exit_code, "C is a Casimir (at every site, for all sizes)" in result.stdout) == (0, True)


def test_show_prints_the_cell(phigen, lattice):
    shown = phigen("show", lattice("toda")).stdout
    assert "{a, b[i+1]} = -a/2" in shown
    assert "da/dt = (a*b - a*b[i+1])/2" in shown
    assert "Π A = a" in shown


def test_show_writes_latex_with_all_indices(phigen, lattice):
    shown = phigen("show", lattice("spins_2"), "--latex").stdout
    assert r"\{x_{i, j}, y_{i, j}\} &= z_{i, j}" in shown
    assert r"x_{i + 1, j} x_{i, j}" in shown
    assert r"H &= \sum_{a < b}" in phigen("show", lattice("vortices"), "--latex").stdout


def test_show_cancels_common_factors(phigen, tmp_path):
    spec = tmp_path / "growth.yaml"
    spec.write_text(
        "phigen: 1\nname: growth\nlattice: {axes: [i]}\ncoordinates: [u, v]\nparameters: {d: 2}\n"
        "poisson: {brackets: {u: {v: u*v*(u + v)/d**2}}}\nhamiltonian: d*log(u + v)\ninvariants: {I: d*u/d**2}\n",
        encoding="utf-8",
    )
    assert "  du/dt = u*v/d\n  dv/dt = -u*v/d\n" in phigen("show", spec).stdout
    assert "I = u/d\n" in phigen("show", spec).stdout
    assert json.loads(phigen("show", spec, "--json").stdout)["rates"] == {"du/dt": "u*v/d", "dv/dt": "-u*v/d"}
    assert r"\dot{u}_{i} &= \frac{u_{i} v_{i}}{d}" in phigen("show", spec, "--latex").stdout


def test_show_describes_a_cell_for_machines(phigen, lattice):
    shown = json.loads(phigen("show", lattice("spin_graph"), "--json").stdout)
    assert (shown["lattice"]["relation"], shown["parameters"]["J"]["at"]) == ("graph", "bonds")
    assert shown["casimirs"] == {"C": {"value": "z**2 + (x**2 + y**2)", "at": "sites"}}


def test_check_refutes_a_wrong_invariant_of_a_lattice_at_its_place(phigen, lattice):
    path = lattice("toda")
    path.write_text(path.read_text(encoding="utf-8").replace("b**3/3 + 2", "b**3/3 - 2"), encoding="utf-8")
    result = phigen("check", path)
    assert (result.exit_code, "refuted              K is invariant" in result.stdout) == (5, True)


def test_a_run_names_the_sizes_of_its_expansion(phigen, lattice):
    printed = phigen("show", lattice("spins_2"), "--expand", "quench").stdout
    assert loads(printed).name == "spins_3x2"
    assert len(loads(printed).runs["quench"].initial) == 18


@pytest.mark.parametrize(
    ("sizes", "code", "message"),
    [
        ("3", 2, "sizes must be 2 positive integers, for the axes i, j; got 3"),
        ("a", 2, "'a' does not state sizes, such as 3x3, or the name of a run: quench"),
        ("1x4", 1, "sizes are at least 2x2"),
        ("20x20", 3, "1200 coordinates; an ordinary spec has at most 256"),
    ],
)
def test_sizes_that_do_not_fit_say_so(phigen, lattice, sizes, code, message):
    result = phigen("show", lattice("spins_2"), "--expand", sizes)
    assert (result.exit_code, message in " ".join(result.stderr.split())) == (code, True)


def test_runs_of_a_system_that_becomes_a_lattice_have_whole_steps(phigen, tmp_path):
    """Runs of lattices end with a whole step and store states after whole steps. So the run up to t = 3.05 becomes a
    run of 30 steps of 0.1.
    """
    text = """phigen: 1
name: ring
coordinates: [q0, q1, q2, q3, p0, p1, p2, p3]
poisson: {canonical: {q: [q0, q1, q2, q3], p: [p0, p1, p2, p3]}}
hamiltonian: (p0**2 + p1**2 + p2**2 + p3**2)/2 + ((q1 - q0)**2 + (q2 - q1)**2 + (q3 - q2)**2 + (q0 - q3)**2)/2
runs: {r: {initial: [1, 0, 0, 0, 0, 0, 0, 0], step: 0.1, until: 3.05, every: 0.5, stop: q0 + 9}}
"""
    (tmp_path / "ring.yaml").write_text(text, encoding="utf-8")
    shown = loads(phigen("show", tmp_path / "ring.yaml", "--lattice").stdout)
    assert shown.runs["r"].steps == 30


def test_show_prints_the_lattice_of_a_system_written_out(phigen):
    shown = loads(phigen("show", "spin_chain5", "--lattice").stdout)
    assert shown.lattice.axes == ("i",)
    result = phigen("show", "kepler", "--lattice")
    assert (result.exit_code, "kepler is not recognised as a lattice" in result.stderr) == (1, True)


START = """\
phigen: 1
name: start
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {k: {value: "2 - i", at: sites, positive: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + k*(q[i+1] - q)**2/2
runs:
  a: {sizes: [6], initial: {q: 1, p: 0}, step: 0.1, steps: 10}
  b: {sizes: [2], initial: {q: [1, 2, 3], p: 0}, step: 0.1, steps: 10}
"""


@pytest.mark.parametrize("command", ["check", "run"])
def test_values_that_do_not_fit_are_refused_at_the_place_of_their_formula(phigen, tmp_path, command):
    path = tmp_path / "start.yaml"
    path.write_text(START)
    result = phigen(command, path)
    assert result.exit_code == 1
    said = "start.yaml:5:25: error: k: the parameter is positive by declaration, but -3 at site 5"
    assert said in result.stderr
    assert ("start.yaml:10:29: error: q: 3 values, not 2" in result.stderr) == (command == "check")


def test_verify_says_at_which_states_a_lattice_is_examined(phigen, tmp_path):
    path = tmp_path / "start.yaml"
    path.write_text(START.replace('"2 - i"', "1").replace("steps: 10}", "steps: 400}"))
    result = phigen("verify", path, "--run", "a", "--quick")
    assert "evaluated at the start, after every 4 steps and at the end" in result.stdout, result.stdout
    assert "at least 3.7, stated 4" in result.stdout or "at least 1.7, stated 2" in result.stdout


def test_check_says_that_nothing_is_proved_of_a_spec_with_errors(phigen, tmp_path):
    path = tmp_path / "start.yaml"
    path.write_text(START.replace("hamiltonian: p**2", "hamiltonian: r**2"))
    result = phigen("check", path)
    assert (result.exit_code, result.stdout) == (1, "")
    assert f"{path}: nothing was proved, because the spec has errors" in result.stderr


def test_parameters_with_which_no_step_can_be_made_end_a_run(phigen, tmp_path):
    spec = tmp_path / "chain.yaml"
    spec.write_text(
        "phigen: 1\nname: chain\nlattice: {axes: [i]}\ncoordinates: [q, p]\nparameters: {k: 2}\n"
        "poisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: p**2/(2*(k - 1)) + (q[i+1] - q)**2/2\n"
        "scheme: splitting\nruns:\n"
        "  one: {sizes: [4], initial: {q: 0.1, p: 1}, parameters: {k: 1}, step: 0.1, steps: 3}\n",
        encoding="utf-8",
    )
    result = phigen("run", spec, "-t", "numpy")
    assert "error: chain: no step can be made with k = 1.0" in result.stderr
    assert (result.exit_code, "internal error" in result.stderr) == (7, False)


def test_check_does_not_compute_starts_that_fill_the_memory(phigen, lattice):
    spec = lattice("toda")
    spec.write_text(spec.read_text(encoding="utf-8").replace("sizes: [4]", "sizes: [2000000000]"), encoding="utf-8")
    result = phigen("check", spec)
    assert result.exit_code == 0, result.stderr
    assert "the start of the run waves is not examined: more than 1000000 sites" in result.stderr
