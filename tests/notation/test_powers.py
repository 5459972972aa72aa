"""Casimirs of log-canonical structures, written as products of powers."""

import math

import pytest

from phigen.geometry.system import system_from_spec
from phigen.notation.powers import as_powers
from phigen.spec import loads
from phigen.symbolic.expression import call, symbol
from phigen.symbolic.numeric import evaluate

TEXT = "phigen: 1\nname: l\ncoordinates: [x1, x2, x3]\nparameters: {k: 0.4}\nhamiltonian: x1 + x2 + x3\n"


@pytest.mark.parametrize("row", ["k, 2", "k - 1, 3/2", "2*k, -k"])
def test_casimirs_with_parameters_in_exponents_are_products_of_powers(row):
    """The printed product of powers has the value of the Casimir."""
    a, b = row.split(", ")
    matrix = f"[[0, 1, {a}], [-1, 0, {b}], [-({a}), -({b}), 0]]"
    system = system_from_spec(loads(f"{TEXT}poisson: {{log_canonical: {matrix}}}\n"))
    (casimir,) = system.casimirs.values()
    written = as_powers(casimir)
    assert written.startswith("log|")
    assert "log(" not in written
    values = {"x1": 0.7, "x2": 1.9, "x3": 2.3, "k": 0.4}
    shown = math.log(abs(eval(written.removeprefix("log|").removesuffix("|"), {}, values)))
    assert shown == pytest.approx(float(evaluate([casimir], values)[0]), rel=1e-13)


def test_other_functions_are_left_as_they_are():
    x = symbol("x1")
    for function in (x * x, call("log", x**2) + 1, call("log", x)):
        assert as_powers(function) is None
