"""``phigen check``, ``show``, ``run``, ``new``, ``schema``, ``list`` and ``demo``: what they print and write, and their
exit codes.
"""

import csv
import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from cli_specs import NOT_POISSON
from systems import slow_but

from phigen import resources, spec
from phigen.api import compilation_of
from phigen.errors import SpecError
from phigen.report.method import method_section
from phigen.scheme import discretisation

SPECS = resources.bundled_specs()


# -- phigen check


def test_check_groups_statements_and_never_says_just_ok(phigen):
    result = phigen("check", SPECS / "rigid_body.yaml")
    assert result.exit_code == 0
    for group in ("Poisson tensor", "Casimirs", "Bi-realisation (exponential)", "Hamilton–Jacobi series"):
        assert group in result.stdout
    assert "proved               {α_i, α_j} = π_ij∘α" in result.stdout
    assert "S_2, S_4, S_6 = 0" in result.stdout
    assert "3 generic points" in result.stdout


def test_check_says_that_nothing_was_proved_of_what_is_too_large(phigen, monkeypatch):
    monkeypatch.setattr(discretisation, "MOST_OPERATIONS", 50)
    result = phigen("check", SPECS / "rigid_body.yaml")
    assert result.exit_code == 3
    assert "rigid_body.yaml: nothing was proved\n" in result.stderr
    assert "error: the matrices of a step would take more than 50 operations" in result.stderr
    assert "hint: ask for a lower order" in result.stderr


def test_check_refutes_with_residual_and_goes_on(phigen, write):
    write("good.yaml")
    result = phigen("check", write("bad.yaml", NOT_POISSON), "good.yaml")
    assert result.exit_code == 5
    assert "refuted              Jacobi identity" in result.stdout
    assert "residual: -x*y" in result.stdout
    assert "S_2 = 0" in result.stdout  # a statement about good.yaml


def test_one_wrong_bracket_is_one_error_and_not_those_that_follow_from_it(phigen, write):
    path = write("bad.yaml", f"{NOT_POISSON}casimirs: {{C: x + y**2}}\ninvariants: {{F: x*y}}\n")
    for result in (phigen("build", path), phigen("check", path)):
        assert result.exit_code == 5
        assert result.stderr.count("refuted: ") + result.stderr.count(": refuted (") == 1, result.stderr
    assert "depend on a refuted statement: Casimirs, invariants, the method" in result.stdout
    assert "Casimirs, invariants" in phigen("build", path).stderr


def test_a_casimir_for_another_order_of_the_basis_gets_a_hint(phigen, write):
    algebra = "coordinates: [p1, p2, p3, m1, m2, m3]\npoisson: {lie_algebra: {name: se(3)}}\nhamiltonian: m1**2\n"
    result = phigen("check", write("a.yaml", f"phigen: 1\nname: a\n{algebra}casimirs: {{C: p1**2 + p2**2 + p3**2}}\n"))
    assert result.exit_code == 5
    assert "hint: coordinates stand for the basis of se(3) in its order" in result.stderr


def test_wrong_birealisation_is_one_error_in_the_names_of_the_spec(phigen, write):
    head = "phigen: 1\nname: a\ncoordinates: [x, y]\npoisson: {log_canonical: [[0, 1], [-1, 0]]}\nhamiltonian: x + y\n"
    maps = "alpha: [x - x*y*p_y/2, y + x*y*p_x/2], beta: [x + x*y*p_y/2, y - x*y*p_x/2]"
    result = phigen("build", write("a.yaml", f"{head}birealisation: {{kind: custom, {maps}}}\ninvariants: {{F: x}}\n"))
    assert result.stderr.count(": refuted (") == 2  # one for the maps, one for the invariant x
    assert "p:" not in result.stderr
    assert "p_x=" in result.stderr


def test_check_shows_the_geometry_where_no_birealisation_applies(phigen, write):
    path = write("a.yaml")
    poisson = "poisson: {matrix: [[0, 1 + x**2], [-1 - x**2, 0]]}"
    head = f"phigen: 1\nname: a\ncoordinates: [x, y]\n{poisson}\nhamiltonian: x*y\n"
    path.write_text(head + "birealisation: log-canonical\n")
    result = phigen("check", path)
    assert result.exit_code == 1
    assert "proved               Jacobi identity" in result.stdout
    assert "a.yaml:6:" in result.stderr


def test_check_json_holds_every_statement(phigen, write):
    (record,) = json.loads(phigen("check", "--json", write("bad.yaml", NOT_POISSON)).stdout)
    verdicts = {s["name"]: s["verdict"] for s in record["statements"]}
    assert verdicts["π is skew"] == "proved"
    assert verdicts["Jacobi identity"] == "refuted"
    assert record["refuted"] >= 1


def test_check_refutes_the_wrong_sign_of_the_paper(phigen, in_tmp):
    Path("lv.yaml").write_text(
        "phigen: 1\nname: lv\ncoordinates: [x, y]\npoisson: {log_canonical: [[0, 1], [-1, 0]]}\nhamiltonian: x + y\n"
        "birealisation:\n  kind: custom\n"
        "  alpha: [x*exp(y*p_y/2), y*exp(-x*p_x/2)]\n  beta: [x*exp(-y*p_y/2), y*exp(x*p_x/2)]\n"
    )
    result = phigen("check", "lv.yaml")
    assert result.exit_code == 5
    assert "refuted              {α_i, α_j} = π_ij∘α" in result.stdout


# -- phigen show


def test_show_prints_the_series_of_mathematics(phigen, in_tmp):
    result = phigen("show", SPECS / "harmonic_oscillator.yaml", "--json")
    series = json.loads(result.stdout)["series"]
    assert list(series) == ["S_1", "S_3"]


def test_show_log_canonical_s3_and_modified_hamiltonian(phigen):
    shown = json.loads(phigen("show", SPECS / "lotka_volterra.yaml", "--order", "4", "--json").stdout)
    x1, x2, x3 = 2.0, 3.0, 5.0
    value = eval(shown["series"]["S_3"]["formula"], {"x1": x1, "x2": x2, "x3": x3})
    assert value == pytest.approx((x1 + x2) * (x1 + x3) * (x2 + x3) / 24)
    second = json.loads(phigen("show", SPECS / "lotka_volterra.yaml", "--order", "2", "--json").stdout)
    correction = eval(second["modified_hamiltonian"]["coefficient"], {"x1": x1, "x2": x2, "x3": x3})
    assert correction == pytest.approx(-value)
    assert second["modified_hamiltonian"]["power"] == 2


def test_a_series_with_too_many_terms_is_shown_up_to_the_limit(phigen, in_tmp, monkeypatch):
    """The printed series ends before the first term that is too long when expanded. Generated code does not expand
    terms: it evaluates the series as a graph of shared subexpressions.
    """
    monkeypatch.setattr("phigen.spec.limits.SERIES_TERMS", 8)
    series = json.loads(phigen("show", SPECS / "henon_heiles.yaml", "--order", 6, "--json").stdout)
    assert (list(series["series"]), series["series_not_written_from"]) == (["S_1", "S_3"], 5)
    assert series["modified_hamiltonian"] is None
    shown = phigen("show", SPECS / "henon_heiles.yaml", "--order", 6)
    assert "S_h = h S_1 + h^3 S_3 + …" in shown.stdout
    assert "from S_5 on there are too many terms" in shown.stdout
    assert "\\cdots \\\\" in phigen("show", SPECS / "henon_heiles.yaml", "--order", 6, "--latex").stdout
    reported = method_section(compilation_of(spec.load(SPECS / "henon_heiles.yaml"), order=6))
    assert "From S_5 on there are too many terms" in reported


def test_series_of_a_composition_is_that_of_its_stages(phigen, write):
    path = write("a.yaml")
    path.write_text(path.read_text().replace("order: 2", "order: 4\ncomposition: triple-jump"))
    assert "S_2 = 0 (hence the order 2 of each stage)" in phigen("check", path).stdout
    assert "order 4, composed of 3 stages of order 2 from S_1" in phigen("show", path).stdout
    shown = json.loads(phigen("show", path, "--json").stdout)
    assert (shown["order"], shown["terms"], shown["modified_hamiltonian"]) == (4, 1, None)


def test_series_of_a_path_is_proved_beyond_the_formal_degree(phigen, write):
    path = write("a.yaml")
    text = path.read_text().replace("order: 2", "order: 6\nbirealisation: karasev")
    path.write_text(text.replace("canonical: {q: [q], p: [p]}", "brackets: {q: {p: 1 + q**2}}").split("runs:")[0])
    result = phigen("check", path)
    assert result.exit_code == 0
    assert "S_2, S_4, S_6 = 0" in result.stdout


def test_show_abbreviates_unless_full(phigen):
    path = SPECS / "rigid_body.yaml"
    assert " terms)" in phigen("show", path).stdout
    full = phigen("show", path, "--full").stdout
    assert "…" not in "".join(line for line in full.splitlines() if line.strip().startswith("S_5"))


def test_show_says_what_auto_picked_and_why(phigen):
    assert "auto picked exponential" in phigen("show", SPECS / "rigid_body.yaml").stdout


@pytest.mark.parametrize("name", ["rigid_body", "kepler", "poisson_not_hamiltonian", "pendulum_euler"])
def test_latex_is_balanced_and_complete(phigen, name):
    latex = phigen("show", SPECS / f"{name}.yaml", "--latex").stdout
    assert latex.count("{") == latex.count("}")
    assert latex.count("\\begin") == latex.count("\\end") > 4
    assert "\\alpha" in latex
    assert "S_{1}" in latex
    assert ":" not in latex


@pytest.mark.slow
def test_latex_defines_what_it_uses(phigen):
    """The output defines λ of the gauge and φ of the exponential map, and shows the modified Hamiltonian up to the
    requested term.
    """
    latex = phigen("show", SPECS / "rigid_body.yaml", "--latex", "--modified", "2").stdout
    assert "\\varphi(s) &= \\frac{1}{s}" in latex
    assert "S_{1} &= H - \\lambda_{C} C = " in latex
    assert "\\tilde{H} &= H + h^{6} H_{6} + h^{8} H_{8} + \\cdots" in latex
    assert latex.count("  H_{8} &= ") == 1


def test_modified_hamiltonian_in_latex_is_refused_where_it_is_not_computed(phigen):
    options = ("--scheme", "splitting", "--latex")
    assert "H_{2} &= " in phigen("show", SPECS / "henon_heiles.yaml", *options).stdout
    result = phigen("show", SPECS / "henon_heiles.yaml", *options, "--modified", "1")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "not computed for a step by splitting" in result.stderr


def test_show_names_each_correction_once(phigen):
    """For order 2 the modified Hamiltonian has the correction H_2 = −S_3. With --modified 1 a general algorithm
    computes this correction. In both cases it is printed once, in the same way.
    """
    pages = [
        phigen("show", SPECS / "lotka_volterra.yaml", "--order", "2", *m).stdout for m in ([], ["--modified", "1"])
    ]
    assert pages[0] == pages[1]
    assert pages[0].count("  H_2 = (-x1**2*x2 ") == 1


def test_show_writes_phi_and_says_what_it_is(phigen):
    shown = phigen("show", SPECS / "kowalevski_top.yaml").stdout
    assert "phi0" not in shown
    assert "where φ(s) = " in shown


def test_show_says_that_the_maps_of_a_path_are_series(phigen):
    for options in ([], ["--latex"]):
        shown = phigen("show", SPECS / "sklyanin_gyrostat.yaml", *options).stdout
        lines = shown.replace("\\\\\n    &\\quad", "").splitlines()
        maps = [line.rstrip("\\ ") for line in lines if line.strip().startswith(("α_", "\\alpha_", "\\beta_"))]
        assert len(maps) >= 4
        assert all(line.endswith(("+ …", "+ \\cdots")) for line in maps)


# -- phigen run


def summary(phigen, *args):
    result = phigen("run", *args, "--json")
    assert result.exit_code == 0, result.stderr

    def no_json(word):
        raise AssertionError(f"{word} is not JSON")

    return json.loads(result.stdout, parse_constant=no_json)


@pytest.mark.thin(2)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_run_stores_what_it_integrates(phigen, write, target):
    path = write("a.yaml")
    document = summary(phigen, path, "-t", target, "-o", "x.csv")
    with Path("x.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0][:3] == ["t", "q", "p"]
    assert len(rows) == 52
    assert [float(v) for v in rows[-1][1:3]] == list(document["final"].values())
    summary(phigen, path, "-t", target, "-o", "x.npz")
    with np.load("x.npz") as stored:
        assert stored["x"][-1].tolist() == list(document["final"].values())


def test_run_summary_compares_with_closed_form_and_classical_methods(phigen, write):
    document = summary(phigen, write("a.yaml"))
    of_phigen, rk4 = document["methods"]
    assert of_phigen["method"] == "phigen, order 2"
    assert 1e-4 < of_phigen["exact"]["error"] < 1e-2
    assert 1e-7 < rk4["exact"]["error"] < 1e-5
    assert of_phigen["energy"]["error"] < 1e-14  # the midpoint rule conserves quadratic invariants
    assert rk4["energy"]["error"] > 1e-7
    shown = phigen("run", "a.yaml").stdout
    assert "against closed form" in shown
    assert "rk4" in shown


def test_run_overrides(phigen):
    path = SPECS / "rigid_body.yaml"
    options = ["--step", "0.01", "--steps", "7", "--set", "I1=3/2", "--set", "x2=0.25", "--order", "4"]
    document = summary(phigen, path, *options)
    assert (document["step"], document["steps"], document["order"]) == (0.01, 7, 4)
    assert document["parameters"]["I1"] == 1.5
    assert document["initial"]["x2"] == 0.25
    assert summary(phigen, path, "--run", "tumbling", "--steps", "5")["parameters"]["I1"] == 1.0


@pytest.mark.parametrize("wrong", ["I1", "I1=", "I1=a", "J=1", "I1=-1", "I1=nan", "I1=1/0"])
def test_wrong_setting_is_a_usage_error(phigen, wrong):
    assert phigen("run", SPECS / "rigid_body.yaml", "--set", wrong).exit_code == 2


def test_run_falls_back_to_numpy_and_says_so(phigen, write, without_compiler):
    result = phigen("run", write("a.yaml"))
    assert result.exit_code == 0
    assert "no C compiler" in result.stderr
    assert "target numpy" in result.stdout


@pytest.mark.thin(2)
@pytest.mark.parametrize("named", ["/there/is/none", 'gcc "', "true"])
def test_a_compiler_that_is_named_is_used_or_refused(phigen, write, monkeypatch, named):
    monkeypatch.setenv("CC", named)
    for command in (["run", write("a.yaml")], ["build", "a.yaml", "--compile"]):
        result = phigen(*command)
        assert result.exit_code == 6
        assert result.stderr.startswith("error: ") or "\nerror: " in result.stderr
        assert named in result.stderr
        assert result.stdout == ""
    assert not list(Path("generated").rglob("*.so*"))
    assert phigen("run", "a.yaml", "-t", "numpy").exit_code == 0


def test_run_without_runs_explains(phigen, write):
    path = write("a.yaml")
    path.write_text(path.read_text().split("runs:")[0])
    result = phigen("run", path)
    assert result.exit_code == 1
    assert "no runs" in result.stderr


def test_output_of_unknown_kind_is_refused_before_the_work(phigen, write):
    assert phigen("run", write("a.yaml"), "-o", "x.xls").exit_code == 2


# -- phigen new, phigen schema, phigen list, phigen demo


@pytest.mark.slow
def test_new_writes_a_spec_that_checks_builds_and_runs(phigen, in_tmp):
    assert phigen("new", "mysystem").exit_code == 0
    assert spec.load("mysystem.yaml").name == "mysystem"
    for command in ("check", "build", "run", "show"):
        assert phigen(command, "mysystem.yaml").exit_code == 0
    assert phigen("new", "mysystem").exit_code == 2
    assert phigen("new", "other", "-o", "-").stdout.startswith("#")
    assert not Path("other.yaml").exists()


@pytest.mark.parametrize("name", ["Bad", "../up", "int", "", "x" * 99])
def test_new_refuses_names_that_cannot_be(phigen, in_tmp, name):
    assert phigen("new", name).exit_code == 2
    assert not list(Path().iterdir())


def test_schema_accepts_the_starter(phigen):
    from ruamel.yaml import YAML

    schema = json.loads(phigen("schema").stdout)
    jsonschema.validate(YAML(typ="safe").load(spec.starter("a")), schema)


def test_list_shows_every_bundled_spec(phigen):
    listed = json.loads(phigen("list", "--json").stdout)
    assert {s["name"] for s in listed} == {p.stem for p in SPECS.rglob("*.yaml")}
    table = phigen("list").stdout
    assert all(s["title"] in table for s in listed)
    assert phigen("list", "--path", "kepler").stdout.strip() == str(SPECS / "kepler.yaml")
    assert "did you mean 'kepler'" in phigen("list", "--path", "keplr").stderr


@pytest.mark.parametrize("target", slow_but(["c"], ["c", "numpy"]))
def test_demo_keeps_the_casimir_at_roundoff_up_to_the_singularity(phigen, target):
    result = phigen("demo", "-t", target)
    assert result.exit_code == 0
    assert "0.2553851" in result.stdout
    cells = next(line for line in result.stdout.splitlines() if line.strip().startswith("0.255 ")).split()
    x2, x8, x_rk, c2, c8, c_rk = map(float, cells[2:])
    assert max(c2, c8) < 1e-13 < 1e-6 < c_rk
    assert x8 < 1e-8 < x2 < x_rk


def test_check_reports_targets_that_cannot_have_the_solver(phigen, in_tmp):
    """Like ``phigen build``, ``phigen check`` reports an error for each target of the spec that cannot have the solver,
    with the place in the spec.
    """
    text = (SPECS / "pendulum_euler.yaml").read_text(encoding="utf-8")
    without_targets = "\n".join(line for line in text.splitlines() if not line.startswith(("targets", "adjoint")))
    Path("p.yaml").write_text(without_targets + "\nadjoint: true\ntargets: [c, js]\n", encoding="utf-8")
    line = Path("p.yaml").read_text(encoding="utf-8").splitlines().index("targets: [c, js]") + 1
    for command in ("check", "build"):
        result = phigen(command, "p.yaml")
        assert result.exit_code == 1
        assert (
            f"p.yaml:{line}:1: error: pendulum_euler: gradients (adjoint) are not offered in JavaScript"
            in result.stderr
        )


def test_all_triples_that_fail_the_jacobi_identity_are_listed_on_request(phigen, write):
    """With -v, check lists the triples of coordinates whose cyclic sum in the Jacobi identity is not 0, with the sum.
    In this example the sum vanishes only for (a, b, d).
    """
    brackets = "{a: {b: c, c: a*d, d: 1}, b: {c: a, d: b}, c: {d: c}}"
    text = f"phigen: 1\nname: j\ncoordinates: [a, b, c, d]\npoisson: {{brackets: {brackets}}}\nhamiltonian: a\n"
    path = write("j.yaml", text)
    sums = {"(a, b, c)": "a*b - c*d", "(a, c, d)": "-a*d + d", "(b, c, d)": "-2*a + 1"}
    listed = [f"{triple}: {value}" for triple, value in sums.items()]
    assert all(line in phigen("check", "-v", path).stdout for line in listed)
    assert not any(line in phigen("check", path).stdout for line in listed)
    (jacobi,) = (s for s in json.loads(phigen("check", "--json", path).stdout)[0]["statements"] if "failing" in s)
    assert jacobi["failing"] == sums


def test_quiet_checks_print_what_does_not_hold(phigen, write):
    good = phigen("check", "-q", write("good.yaml"), "harmonic_oscillator")
    assert (good.exit_code, good.stdout, good.stderr) == (0, "", "")
    refuted = phigen("check", "-q", write("bad.yaml", NOT_POISSON))
    assert refuted.exit_code == 5
    assert "refuted              Jacobi identity" in refuted.stdout
    assert "  proved " not in refuted.stdout


def test_python_suggests_names_that_are_near():
    with pytest.raises(SpecError, match=r"there is no file 'keplr', and .*\n  hint: did you mean 'kepler'\?"):
        spec.load("keplr")
