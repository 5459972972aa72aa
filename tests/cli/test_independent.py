"""``phigen check --independent``: what is shown, and the exit codes."""

import json
import re
from fractions import Fraction

import pytest

from phigen.series import hamilton_jacobi


def test_each_term_has_a_verdict_and_the_seconds_of_both(phigen, write):
    write("a.yaml", order=4)
    result = phigen("check", "--independent", "a.yaml")
    assert result.exit_code == 0
    lines = result.stdout.partition("Second derivation, by sympy alone\n")[2].splitlines()
    shown = [
        re.match(r" +proved +(S_\d|∇S_h|axioms of α and β up to degree 1 in p) \(.*in \d+\.\d\d s", e) for e in lines
    ]
    assert [m and m[1] for m in shown] == ["S_1", "S_2", "S_3", "∇S_h", "axioms of α and β up to degree 1 in p"]
    assert all("by phigen in" in line for line in lines[:3])


def test_json_has_the_terms_that_were_asked_for(phigen, write):
    write("a.yaml")
    result = phigen("check", "--independent", "--terms", "4", "--json", "a.yaml")
    assert result.exit_code == 0
    (record,) = json.loads(result.stdout)
    assert [c["term"] for c in record["independent"]] == [1, 2, 3, 4, None, None]
    assert {c["verdict"] for c in record["independent"]} == {"proved"}
    assert set(record["independent"][0]["seconds"]) == {"phigen", "sympy"}
    assert "independent" not in json.loads(phigen("check", "--json", "a.yaml").stdout)[0]


def test_what_is_refuted_is_an_error_with_its_code(phigen, write, monkeypatch):
    monkeypatch.setattr(hamilton_jacobi, "Fraction", lambda a, b: Fraction(a, max(b - 1, 1)))
    write("a.yaml", order=4)
    result = phigen("check", "--independent", "a.yaml")
    assert result.exit_code == 5
    assert re.search(r"refuted +S_3 \(at .*: .*, not .*\n +residual: ", result.stdout)
    assert "a.yaml: refuted by the second derivation: S_3, ∇S_h" in result.stderr


def test_the_free_gauge_is_a_symbol_of_both(phigen):
    from phigen import resources

    path = resources.bundled_specs() / "rigid_body.yaml"
    result = phigen("check", "--independent", "--terms", "3", path)
    assert result.exit_code == 0
    assert "S_3 (18 terms" in result.stdout


def test_when_the_time_is_up_the_exit_code_is_that_of_a_limit(phigen, write):
    write("a.yaml")
    result = phigen("check", "--independent", "--seconds", "0.0001", "a.yaml")
    assert result.exit_code == 3
    assert "S_1 was not derived a second time: the time limit was reached; nothing was compared" in result.stderr


def test_a_splitting_has_nothing_to_compare(phigen, write):
    write("a.yaml")
    result = phigen("check", "--independent", "--scheme", "splitting", "a.yaml")
    assert result.exit_code == 0
    assert "a.yaml: splitting has no series" in result.stderr


@pytest.mark.parametrize("options", [["--terms", "3"], ["--seconds", "3"], ["--independent", "--terms", "99"]])
def test_options_that_say_nothing_are_usage_errors(phigen, write, options):
    write("a.yaml")
    assert phigen("check", *options, "a.yaml").exit_code == 2
