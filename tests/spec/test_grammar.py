"""Expressions mean what Python readers expect, and printing and parsing agree."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from phigen.spec.grammar import AllowedNames, constant, parse
from phigen.spec.names import SPEC_FUNCTIONS
from phigen.symbolic.expression import (
    EULER,
    PI,
    Expression,
    add,
    call,
    fold,
    mul,
    neg,
    number,
    power,
    sqrt,
    sub,
    symbol,
    text,
)

NAMES = ("x", "y", "lambda")
SCOPE = AllowedNames({name: symbol(name) for name in NAMES})
X, Y = symbol("x"), symbol("y")


def parsed(source: str, scope: AllowedNames = SCOPE) -> Expression:
    errors: list[str] = []
    result = parse(source, scope, lambda message, index, hint="", *, limit=False: errors.append(message))
    assert not errors, errors
    assert result is not None
    return result


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("-x**2", neg(power(X, 2))),
        ("(-x)**2", power(X, 2)),
        ("x**-1/2", mul(number(Fraction(1, 2)), power(X, -1))),
        ("x - y - 1", sub(sub(X, Y), number(1))),
        ("x/y/2", mul(mul(X, power(Y, -1)), number(Fraction(1, 2)))),
        ("--x", X),
        ("+x", X),
        ("x**(1/2)", sqrt(X)),
        ("sqrt(x)", sqrt(X)),
        ("x**0.5", sqrt(X)),
        ("x**y", call("power", X, Y)),
        ("E**x", call("exp", X)),
        ("E**2", power(EULER, 2)),
        ("2*pi", mul(number(2), PI)),
        ("atan2(y, x)", call("atan2", Y, X)),
        (" x\n +\ty ", add(X, Y)),
        ("0.1", number(Fraction(1, 10))),
        ("1e-3", number(Fraction(1, 1000))),
        (".5E+1", number(5)),
        ("2.", number(2)),
        ("007", number(7)),
        ("0**0", number(1)),
    ],
)
def test_expression_means(source: str, expected: Expression) -> None:
    assert parsed(source) is expected


def test_declared_names_win_over_constants() -> None:
    scope = AllowedNames({"pi": symbol("pi"), "E": symbol("E")})
    assert parsed("pi*E", scope) is mul(symbol("pi"), symbol("E"))


def arithmetic() -> st.SearchStrategy[str]:
    """Strategy for texts of arithmetic with small integers, in which each operator occurs next to each other one."""
    digits = st.integers(0, 9).map(str)

    def extend(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        pair = st.tuples(inner, st.sampled_from(["+", "-", " * ", "/"]), inner).map("".join)
        signed = st.tuples(st.sampled_from("+-"), inner).map("".join)
        raised = st.tuples(inner, st.sampled_from(["**2", "**-1", "**-2**2", "**1**3"])).map("".join)
        return pair | signed | raised | inner.map("({})".format)

    return st.recursive(digits, extend, max_leaves=8)


@given(arithmetic())
@example("-2**2")
@example("2**3**2")
@example("2**-1*3")
@example("8/2/2*3-1-1")
def test_arithmetic_agrees_with_python(source: str) -> None:
    # ``eval`` is safe here, because the text was made by this test; phigen never evaluates a text. All integers except
    # exponents become Fractions.
    exact = re.sub(r"(?<![*\d])(?<!\*\*-)(\d+)", r"F(\1)", source)
    try:
        expected = eval(exact, {"F": Fraction, "__builtins__": {}})
        # A power with a fractional exponent is no Fraction in Python; such texts are skipped.
        assume(isinstance(expected, Fraction) and abs(expected) < 10**30 and expected.denominator < 10**30)
    except (ZeroDivisionError, OverflowError):
        assume(False)
    errors: list[str] = []
    result = parse(source, SCOPE, lambda message, index, hint="", *, limit=False: errors.append(message))
    assume(not errors or "range" not in errors[0])
    assert result is number(expected), errors


def trees() -> st.SearchStrategy[Expression]:
    """Strategy for expressions with nodes of every kind."""
    numbers = st.fractions(-9, 9, max_denominator=12).map(number)
    leaves = st.sampled_from([*(symbol(n) for n in NAMES), PI, EULER]) | numbers
    unary = sorted(f for f, arity in SPEC_FUNCTIONS.items() if arity == 1 and f != "sqrt")
    exponents = st.sampled_from([-3, -2, -1, 2, 3, Fraction(1, 2), Fraction(-1, 2), Fraction(2, 3), Fraction(-5, 3)])

    def extend(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
        binary = st.sampled_from([add, sub, mul])
        nonzero = inner.filter(lambda e: not e.is_number)
        return (
            st.builds(lambda f, a, b: f(a, b), binary, inner, inner)
            | st.builds(neg, inner)
            | st.builds(power, nonzero, exponents)
            | st.builds(lambda a, b: mul(a, power(b, -1)), inner, nonzero)
            | st.builds(call, st.sampled_from(unary), nonzero)
            | st.builds(lambda a, b: call("atan2", a, b), inner, nonzero)
            | st.builds(lambda a, b: call("power", a, b), nonzero, nonzero)
        )

    return st.recursive(leaves, extend, max_leaves=12)


def value(e: Expression, point: dict[str, float]) -> float:
    """Return the value in double precision. Raise an error unless it is real and its absolute value is at most 10⁶."""

    def visit(node: Expression, args: list[float]) -> float:
        simple: dict[str, Any] = {
            "add": lambda: args[0] + args[1],
            "sub": lambda: args[0] - args[1],
            "neg": lambda: -args[0],
            "mul": lambda: args[0] * args[1],
            "pow": lambda: math.pow(args[0], node.value),
            "power": lambda: math.pow(args[0], args[1]),
            "number": lambda: float(node.value),
            "symbol": lambda: point[node.value],
            "pi": lambda: math.pi,
            "E": lambda: math.e,
            "abs": lambda: abs(args[0]),
        }
        result = simple[node.op]() if node.op in simple else getattr(math, node.op)(*args)
        if not math.isfinite(result) or abs(result) > 1e6:
            raise OverflowError
        return float(result)

    return fold([e], visit)[0]


@given(trees(), st.tuples(*[st.floats(0.1, 3)] * 3))
def test_printed_expression_parses_to_equal_values(tree: Expression, point: tuple[float, ...]) -> None:
    errors: list[str] = []
    printed = text(tree)
    again = parse(printed, SCOPE, lambda message, index, hint="", *, limit=False: errors.append(message))
    if errors:  # a spec refuses some trees, for instance the logarithm of a negative number
        assert all(
            re.search("not defined|division by zero|not a real number|has no power|out of range", m) for m in errors
        )
        return
    assert again is not None
    if again is tree:
        return
    at = dict(zip(NAMES, point, strict=True))
    try:
        expected = value(tree, at)
        parsed_value = value(again, at)
    except (ValueError, ArithmeticError):
        return
    assert parsed_value == pytest.approx(expected, rel=1e-6, abs=1e-6), printed


@given(st.text(alphabet="x12.e+-*/(), \nsinqrt^_'\"[]{}=λ0abs", max_size=40))
def test_any_text_gives_an_expression_or_an_error_inside_it(source: str) -> None:
    places: list[int] = []
    result = parse(source, SCOPE, lambda message, index, hint="", *, limit=False: places.append(index))
    assert (result is None) == bool(places)
    assert all(0 <= place <= len(source) for place in places)


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("1/3", Fraction(1, 3)),
        ("sqrt(2)/2", Fraction(0.7071067811865476)),
        ("sqrt(4)", Fraction(2)),
        ("pi", Fraction(math.pi)),
        ("E", Fraction(math.e)),
        ("log(1 - 1e-30*pi)", Fraction(-3.1415926535897933e-30)),  # in double precision it would be 0
        ("2**(1/3)", Fraction(2 ** (1 / 3))),
        ("abs(-1/3)", Fraction(1, 3)),
        ("atan2(1, 1)", Fraction(math.pi / 4)),
        ("2**pi", Fraction(8.824977827076287)),
    ],
)
def test_constant_is_exact_or_the_nearest_double(source: str, expected: Fraction) -> None:
    assert constant(parsed(source)) == expected


@pytest.mark.parametrize(
    "source", ["exp(exp(exp(100)))", "(1 - sqrt(2))**(1/2)", "asin(pi)", "1/sin(0*pi)", "log(-pi)"]
)
def test_constant_without_a_finite_real_value_is_none(source: str) -> None:
    errors: list[str] = []
    result = parse(source, SCOPE, lambda message, index, hint="", *, limit=False: errors.append(message))
    assert errors or constant(result) is None  # type: ignore[arg-type]
