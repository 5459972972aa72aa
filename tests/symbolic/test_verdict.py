"""Statements are proved, refuted or checked numerically, the last at sample points."""

import subprocess
import sys
from fractions import Fraction

import pytest

from phigen.symbolic.expression import PI, call, number, power, sqrt, symbol
from phigen.symbolic.symbols import GAUGE, Symbol, momentum
from phigen.symbolic.verdict import CHECKED, PROVED, REFUTED, UNDECIDED, decide_zero, sample_point

x, y, a = symbol("x"), symbol("y"), symbol("a")


def test_polynomial_identity_is_proved():
    assert decide_zero("s", [("", (x + y) ** 2 - x**2 - 2 * x * y - y**2)]).verdict == PROVED


def test_relations_between_functions_are_used_in_proofs():
    root = sqrt(x**2 + 1)
    circle = call("sin", x) ** 2 + call("cos", x) ** 2 - 1
    assert decide_zero("s", [("", root**2 - x**2 - 1), ("", circle), ("", call("exp", x) * call("exp", -x) - 1)]).holds
    assert decide_zero("s", [("", circle)]).verdict == PROVED


def test_nonzero_residual_is_refuted_with_label_point_and_residual():
    statement = decide_zero("s", [("first", x - x), ("second", x - y)])
    assert statement.verdict == REFUTED
    assert not statement.holds
    assert statement.detail.startswith("second, at x=")
    assert statement.residual == "x - y"
    assert str(statement).startswith("s: refuted (second, at x=")


def test_a_constant_residual_is_refuted_without_a_point():
    statement = decide_zero("s", [("(x, y)", number(-2))])
    assert str(statement).startswith("s: refuted ((x, y), everywhere -2)")


@pytest.mark.parametrize(
    ("residual", "shown"),
    [
        (call("sin", x) ** 2 * y + call("cos", x) ** 2 * y + y, "2*y"),
        ((x**3 + x * y**2) * power(x**2 + y**2, Fraction(-3, 2)), "x/sqrt(x**2 + y**2)"),
        (x * (x + 1) / (x + 2) + 2 * (x + 1) / (x + 2), "x + 1"),
        (sqrt(x + 1) ** 3 - x * sqrt(x + 1) - y, "-y + sqrt(1 + x)"),
        (symbol(momentum("x")) * number(Fraction(1, 3)) * (y * a), "a*p_x*y/3"),
        (symbol(Symbol(GAUGE, "C")) - x, "λ_C - x"),
    ],
)
def test_residual_is_simplified_without_a_change_of_value_and_in_the_names_of_specs(residual, shown):
    statement = decide_zero("s", [("", residual)])
    assert statement.residual == shown
    assert ":" not in statement.detail.partition(": ")[0]


def test_identity_beyond_the_ring_is_checked_and_says_how():
    statement = decide_zero("s", [("", call("sin", 2 * x) - 2 * call("sin", x) * call("cos", x))])
    assert statement.verdict == CHECKED
    assert statement.holds
    assert statement.detail == "8 points, relative tolerance 1e-40"


def test_difference_far_below_double_precision_is_still_refuted():
    tiny = number(Fraction(1, 10**30))
    assert decide_zero("s", [("", call("sin", 2 * x) - 2 * call("sin", x) * call("cos", x) + tiny)]).verdict == REFUTED


def test_constant_identity_needs_one_point():
    statement = decide_zero("s", [("", call("sin", PI))])
    assert statement.verdict == CHECKED
    assert statement.detail.startswith("1 points")


def test_points_outside_the_domain_are_skipped():
    statement = decide_zero("s", [("", call("log", x * y) - call("log", x) - call("log", y))])
    assert statement.verdict == CHECKED
    assert statement.detail.startswith("8 points")


def test_empty_domain_is_undecided_and_does_not_hold():
    statement = decide_zero("s", [("", call("log", -(x**2)) - call("log", -2 * x**2))])
    assert statement.verdict == UNDECIDED
    assert not statement.holds


def test_positive_parameters_stay_positive():
    assert decide_zero("s", [("", call("abs", a) - a)], positive=["a"]).verdict == CHECKED
    assert decide_zero("s", [("", call("abs", a) - a)]).verdict == REFUTED


def test_no_residuals_is_a_proof():
    assert decide_zero("s", [], detail="0 components").detail == "0 components"


@pytest.mark.parametrize("index", range(12))
def test_sample_points_are_moderate_rationals(index):
    point = sample_point(["x", "y", "l"], ["l"], index)
    assert all(Fraction(1, 20) <= abs(v) <= 4 for v in point.values())
    assert point["l"] > 0
    assert index % 2 or all(v > 0 for v in point.values())


def test_covectors_are_sampled_near_zero():
    # A bi-realisation is defined near p = 0; at large p a root may be on another branch.
    covector = [momentum("x"), momentum("y")]
    assert all(abs(v) <= Fraction(1, 8) for k in range(9) for v in sample_point(covector, [], k).values())


def test_points_and_verdicts_do_not_depend_on_the_hash_seed():
    code = (
        "from phigen.symbolic.expression import *\nfrom phigen.symbolic.verdict import *\n"
        "x,y=symbol('x'),symbol('y')\nprint(decide_zero('s', [('', call('sin', x*y) - x)]))"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code], env={"PYTHONHASHSEED": s, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True, text=True, check=True,
        ).stdout
        for s in ("0", "1")
    }  # fmt: skip
    assert len(outputs) == 1
