"""Kernels as functions in C and JavaScript."""

import re

import pytest
from systems import compiled

from phigen.scheme.kernel import Kernel, Output
from phigen.symbolic.expression import ZERO, symbol
from phigen.targets.c import kernels
from phigen.targets.js.emitter import _function as javascript

PROGRAM = compiled("pendulum_euler").program
x, y = symbol("x"), symbol("y")


def kernel(*values):
    """Return a kernel of x and y with an array of the values as one output, and a single value as another."""
    return Kernel("k", "a kernel", {"at": ("x", "y")}, (Output("first", (x,)), Output("matrix", values)))


def test_what_is_mostly_zero_is_cleared_and_the_rest_is_stored():
    sparse = kernel(x, *[ZERO] * 7, x * y)
    text = kernels.function(PROGRAM, sparse)
    assert "= 0.0;" not in text
    assert re.findall(r"PHI_CLEAR.*|matrix\[\d\] =", text) == [
        "PHI_CLEAR_FIRST(matrix, 9);",
        "matrix[0] =",
        "matrix[8] =",
    ]
    assert [line for line in javascript(sparse).splitlines() if "  matrix" in line] == [
        "  matrix.fill(0, 0, 9);",
        "  matrix[0] = x;",
        "  matrix[8] = x * y;",
    ]


def test_few_zeros_are_stored_like_all_else():
    assert "PHI_CLEAR" not in kernels.function(PROGRAM, kernel(x, ZERO, y))


@pytest.mark.parametrize("size", [1, 3])
def test_a_kernel_in_parts_is_cleared_before_the_first_of_them(size, monkeypatch):
    monkeypatch.setattr(kernels, "LONGEST_FUNCTION", size)
    text = kernels.function(PROGRAM, kernel(x, *[ZERO] * 20, x * y, x + y))
    *parts, whole = text.split("\nstatic void ")
    assert not any("PHI_CLEAR" in part for part in parts)
    assert whole.index("PHI_CLEAR_FIRST(matrix, 23") < whole.index("_part1(")
