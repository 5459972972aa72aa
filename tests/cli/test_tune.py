"""``phigen tune`` from end to end: its proposed lines, pasted into the spec, give the accuracy that it printed."""

import json
import re
from pathlib import Path

import pytest

from phigen import resources
from phigen.runtime.origin import read_origin

SPECS = resources.bundled_specs()


def paste(source, proposal):
    """Return the text ``source`` of a spec, with the proposed lines in place of its lines with the same keys."""
    keys = "|".join(["terms", *(line.split(":")[0] for line in proposal["lines"])])
    head = re.sub(rf"(?m)^({keys}):.*\n(?:[ \t]+.*\n)*", "", source)
    for line in proposal["run_lines"]:
        head = re.sub(rf"(?m)^    {line.split(':')[0]}: .*$", f"    {line}", head)
    return head + "\n".join(proposal["lines"]) + "\n"


@pytest.mark.slow
def test_pasted_lines_reach_the_accuracy_at_the_proposed_step(phigen, in_tmp):
    path = SPECS / "henon_heiles.yaml"
    result = phigen(
        "tune", path, "--accuracy", "1e-6", "--horizon", "500", "--budget", "3", "--json", "--plot", "w.svg"
    )
    assert result.exit_code == 0, result.stderr
    assert str(read_origin(in_tmp / "w.svg")).endswith(" by tune")
    document = json.loads(result.stdout)
    best = document["winner"]
    assert best["error"] <= 1e-6
    assert best["seconds_per_unit_time"] <= 1.1 * min(f["seconds_per_unit_time"] for f in document["finalists"])
    assert {c["method"] for c in document["classical"]} <= {"RK4 in C", "DOP853 in C"}
    assert "Hénon" not in result.stdout
    text = paste(path.read_text(encoding="utf-8"), document)
    Path("henon_heiles.yaml").write_text(text, encoding="utf-8")
    run = json.loads(phigen("run", "henon_heiles.yaml", "--json").stdout)
    assert run["step"] * run["steps"] == pytest.approx(500, abs=best["step"])
    assert (run["step"], run["order"]) == (best["step"], best["order"])
    of_phigen = run["methods"][0]
    # The run stores fewer states than tune measures.
    assert of_phigen["energy"]["error"] == pytest.approx(best["measured_error"], rel=0.25)
    assert "up to t = 500" in Path("w.svg").read_text(encoding="utf-8")


@pytest.mark.slow
def test_table_names_the_proposal_and_the_lines(phigen):
    result = phigen("tune", SPECS / "harmonic_oscillator.yaml", "--measure", "orbit", "--budget", "3", "-q")
    assert result.exit_code == 0, result.stderr
    assert "error of the orbit at most 1e-08" in result.stdout
    assert re.search(r"(?m)^order: \d+$", result.stdout)
    assert re.search(r"(?m)^    step: ", result.stdout)
    assert result.stderr == ""


@pytest.mark.slow
def test_accuracy_beyond_rounding_is_not_reached_and_that_is_explained(phigen):
    result = phigen(
        "tune", SPECS / "henon_heiles.yaml", "--accuracy", "1e-15", "--horizon", "1e6", "--budget", "2", "--json"
    )
    assert result.exit_code == 5
    assert json.loads(result.stdout)["winner"] is None
    assert "no setting reaches 1e-15 up to t = 1e+06" in result.stderr
    assert "rounding" in result.stderr


SINGLE = """phigen: 1
name: single
coordinates: [q, p]
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: 3*p**2/4 - sqrt(q**2/9 + 1)/2 + 3*q/8
order: 4
real: float
runs: {r: {initial: [-1.012, 0.959], step: 0.05, steps: 20}}
"""


@pytest.mark.slow
def test_single_precision_has_an_accuracy_that_it_can_reach(phigen, write):
    path = write("single.yaml", SINGLE)
    result = phigen("tune", path, "--budget", "3", "-q")
    assert result.exit_code == 0, result.stderr
    assert "energy error at most 0.0001 up to" in result.stdout
    result = phigen("tune", path, "--budget", "3", "-q", "--accuracy", "1e-8")
    assert result.exit_code == 5
    assert "smaller steps do not help: the remaining error is rounding in single precision" in result.stderr
    assert "hint: ask for less accuracy or set real: double" in result.stderr


@pytest.mark.slow
def test_chaotic_orbits_have_no_reference_over_long_times(phigen):
    result = phigen("tune", SPECS / "henon_heiles.yaml", "--run", "chaotic", "--measure", "orbit", "--budget", "3")
    assert result.exit_code == 5
    assert "chaotic" in result.stderr
    assert "--measure energy" in result.stderr or "--measure be energy" in result.stderr


def test_run_beyond_the_end_of_its_solution_is_explained(phigen):
    result = phigen("tune", SPECS / "lotka_volterra.yaml", "--horizon", "1", "--budget", "3")
    assert result.exit_code == 7
    assert "ends at t = 0.25538" in result.stderr


WRONG = ["--accuracy 0", "--horizon -1", "--budget nan", "--plot x.gif", "--plot none/x.png", "--run none"]


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_usage(phigen, wrong):
    assert phigen("tune", SPECS / "henon_heiles.yaml", *wrong.split()).exit_code == 2


@pytest.mark.slow
def test_without_compiler_numpy_is_timed(phigen, without_compiler):
    result = phigen("tune", SPECS / "harmonic_oscillator.yaml", "--horizon", "3", "--budget", "3", "--json")
    assert result.exit_code == 0, result.stderr
    assert "using NumPy" in result.stderr
    document = json.loads(result.stdout)
    assert document["winner"]["error"] <= 1e-8
    assert {c["method"] for c in document["classical"]} <= {"RK4 in Python", "DOP853 in Python"}


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


@pytest.mark.slow  # the parts of the search have faster tests in tests/tuning/test_lattice_problem.py
def test_lattices_are_tuned_by_the_same_search(phigen, in_tmp):
    Path("chain.yaml").write_text(CHAIN, encoding="utf-8")
    asked = ["--accuracy", "1e-6", "--horizon", "40", "--budget", "1", "--json"]
    result = phigen("tune", "chain.yaml", *asked)
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    best = document["winner"]
    assert document["sizes"] == [24]
    assert document["unit"]["kind"] == "relative"
    assert best["error"] <= 1e-6
    assert best["seconds_per_unit_time"] <= 1.1 * min(f["seconds_per_unit_time"] for f in document["finalists"])
    Path("chain.yaml").write_text(paste(CHAIN, document), encoding="utf-8")
    run = json.loads(phigen("run", "chain.yaml", "--json").stdout)
    assert (run["step"], run["order"], run["frames"] // 10) == (best["step"], best["order"], 2)
    assert run["errors"]["energy"] == pytest.approx(best["measured_error"], rel=0.5)


REFUSED = {
    "noise: {kick: {hamiltonian: q, amplitude: 0.1}}": "for systems with noise",
    "damping: 0.1": "--measure orbit",
    "time: t": "for systems whose H depends on the time",
}


@pytest.mark.parametrize("line", REFUSED)
def test_what_has_no_error_of_the_energy_is_not_tuned_by_it(phigen, in_tmp, line):
    Path("chain.yaml").write_text(CHAIN.replace("order: 2", line), encoding="utf-8")
    result = phigen("tune", "chain.yaml")
    assert (result.exit_code, REFUSED[line] in result.stderr) == (1, True)
