"""``phigen tune`` as a user meets it: its lines, pasted into the spec, give what it promised."""

import json
import re
from pathlib import Path

import pytest

from phigen import resources
from phigen.runtime.origin import read_origin

SPECS = resources.bundled_specs()


def paste(source, found):
    """The spec with the proposed lines."""
    keys = "|".join(["terms", *(line.split(":")[0] for line in found["lines"])])
    head = re.sub(rf"(?m)^({keys}):.*\n(?:[ \t]+.*\n)*", "", source)
    for line in found["run_lines"]:
        head = re.sub(rf"(?m)^    {line.split(':')[0]}: .*$", f"    {line}", head)
    return head + "\n".join(found["lines"]) + "\n"


@pytest.mark.slow
def test_pasted_lines_reach_the_accuracy_at_the_proposed_step(phigen, in_tmp):
    path = SPECS / "henon_heiles.yaml"
    done = phigen("tune", path, "--accuracy", "1e-6", "--horizon", "500", "--budget", "3", "--json", "--plot", "w.svg")
    assert done.exit_code == 0, done.stderr
    assert str(read_origin(in_tmp / "w.svg")).endswith(" by tune")
    found = json.loads(done.stdout)
    best = found["winner"]
    assert best["error"] <= 1e-6
    assert best["seconds_per_unit_time"] <= 1.1 * min(f["seconds_per_unit_time"] for f in found["finalists"])
    assert {c["method"] for c in found["classical"]} <= {"RK4 in C", "DOP853 in C"}
    assert "Hénon" not in done.stdout
    text = paste(path.read_text(encoding="utf-8"), found)
    Path("henon_heiles.yaml").write_text(text, encoding="utf-8")
    run = json.loads(phigen("run", "henon_heiles.yaml", "--json").stdout)
    assert run["step"] * run["steps"] == pytest.approx(500, abs=best["step"])
    assert (run["step"], run["order"]) == (best["step"], best["order"])
    own = run["methods"][0]
    assert own["energy"]["error"] == pytest.approx(best["measured_error"], rel=0.25)  # it stores fewer states
    assert "up to t = 500" in Path("w.svg").read_text(encoding="utf-8")


@pytest.mark.slow
def test_table_names_the_proposal_and_the_lines(phigen):
    done = phigen("tune", SPECS / "harmonic_oscillator.yaml", "--measure", "orbit", "--budget", "3", "-q")
    assert done.exit_code == 0, done.stderr
    assert "error of the orbit at most 1e-08" in done.stdout
    assert re.search(r"(?m)^order: \d+$", done.stdout)
    assert re.search(r"(?m)^    step: ", done.stdout)
    assert done.stderr == ""


@pytest.mark.slow
def test_accuracy_beyond_rounding_is_not_reached_and_that_is_explained(phigen):
    done = phigen(
        "tune", SPECS / "henon_heiles.yaml", "--accuracy", "1e-15", "--horizon", "1e6", "--budget", "2", "--json"
    )
    assert done.exit_code == 5
    assert json.loads(done.stdout)["winner"] is None
    assert "no setting reaches 1e-15 up to t = 1e+06" in done.stderr
    assert "rounding" in done.stderr


@pytest.mark.slow
def test_chaotic_orbits_have_no_reference_over_long_times(phigen):
    done = phigen("tune", SPECS / "henon_heiles.yaml", "--run", "chaotic", "--measure", "orbit", "--budget", "3")
    assert done.exit_code == 5
    assert "chaotic" in done.stderr
    assert "--measure energy" in done.stderr or "--measure be energy" in done.stderr


def test_run_beyond_the_end_of_its_solution_is_explained(phigen):
    done = phigen("tune", SPECS / "lotka_volterra.yaml", "--horizon", "1", "--budget", "3")
    assert done.exit_code == 7
    assert "ends at t = 0.25538" in done.stderr


WRONG = ["--accuracy 0", "--horizon -1", "--budget nan", "--plot x.gif", "--plot none/x.png", "--run none"]


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_usage(phigen, wrong):
    assert phigen("tune", SPECS / "henon_heiles.yaml", *wrong.split()).exit_code == 2


@pytest.mark.slow
def test_without_compiler_numpy_is_timed(phigen, without_compiler):
    done = phigen("tune", SPECS / "harmonic_oscillator.yaml", "--horizon", "3", "--budget", "3", "--json")
    assert done.exit_code == 0, done.stderr
    assert "using NumPy" in done.stderr
    found = json.loads(done.stdout)
    assert found["winner"]["error"] <= 1e-8
    assert {c["method"] for c in found["classical"]} <= {"RK4 in Python", "DOP853 in Python"}


CHAIN = """phigen: 1
name: chain
lattice: {axes: [i], boundary: periodic}
coordinates: [q, p]
parameters: {a: 0.5, m: {value: 1 + i/N_i, at: sites, positive: true}}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: "p**2/(2*m) + (q[i+1] - q)**2/2 + a*q**4/4"
order: 2
runs:
  wave:
    sizes: [24]
    initial: {q: sin(2*pi*i/N_i), p: 0}
    step: 0.05
    steps: 2000
    stride: 100
"""


@pytest.mark.slow  # its pieces are in tests/tuning/test_lattice_problem.py
def test_lattices_are_tuned_by_the_same_search(phigen, in_tmp):
    Path("chain.yaml").write_text(CHAIN, encoding="utf-8")
    asked = ["--accuracy", "1e-6", "--horizon", "40", "--budget", "1", "--json"]
    done = phigen("tune", "chain.yaml", *asked)
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    best = found["winner"]
    assert found["sizes"] == [24]
    assert found["unit"]["kind"] == "relative"
    assert best["error"] <= 1e-6
    assert best["seconds_per_unit_time"] <= 1.1 * min(f["seconds_per_unit_time"] for f in found["finalists"])
    Path("chain.yaml").write_text(paste(CHAIN, found), encoding="utf-8")
    run = json.loads(phigen("run", "chain.yaml", "--json").stdout)
    assert (run["step"], run["order"], run["frames"] // 10) == (best["step"], best["order"], 2)
    assert run["errors"]["energy"] == pytest.approx(best["measured_error"], rel=0.5)


REFUSED = {
    "noise: {kick: {hamiltonian: q, amplitude: 0.1}}": "where there is noise",
    "damping: 0.1": "--measure orbit",
    "time: t": "where H depends on the time",
}


@pytest.mark.parametrize("line", REFUSED)
def test_what_has_no_error_of_the_energy_is_not_tuned_by_it(phigen, in_tmp, line):
    Path("chain.yaml").write_text(CHAIN.replace("order: 2", line), encoding="utf-8")
    done = phigen("tune", "chain.yaml")
    assert (done.exit_code, REFUSED[line] in done.stderr) == (1, True)
