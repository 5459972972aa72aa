"""The value of a constant expression such as ``sqrt(2)/2``, correct to the nearest double."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from phigen.symbolic.expression import Expression, fold

#: Bits of the evaluation: enough to round correctly after the cancellations of an honest formula.
PRECISION = 256


def nearest_double(expression: Expression) -> Fraction | None:
    """The double nearest to an expression without symbols, or ``None`` if it is not a finite real number.

    Doubles go first and stop at the first overflow: ``exp(exp(exp(100)))`` to 256 bits would never end.
    """
    try:
        fold([expression], lambda node, args: _finite(_apply(node, args, math, float)))
    except (ArithmeticError, ValueError, TypeError):
        return None
    import mpmath

    with mpmath.workprec(PRECISION):

        def visit(node: Expression, args: list[Any]) -> Any:
            return _apply(node, args, mpmath, lambda f: mpmath.mpf(f.numerator) / f.denominator)

        try:
            return Fraction(float(fold([expression], visit)[0]))
        except (ArithmeticError, ValueError, TypeError):  # such as a negative number to a fractional power
            return None


def _finite(value: Any) -> float:
    if isinstance(value, complex) or not math.isfinite(value):
        raise ValueError("not a finite real number")
    return float(value)


def _apply(node: Expression, args: list[Any], library: Any, number: Callable[[Fraction], Any]) -> Any:
    match node.op:
        case "number":
            return number(node.value)
        case "pi":
            return +library.pi
        case "E":
            return +library.e
        case "add":
            return args[0] + args[1]
        case "sub":
            return args[0] - args[1]
        case "neg":
            return -args[0]
        case "mul":
            return args[0] * args[1]
        case "pow":
            return args[0] ** number(node.value)
        case "power":
            return args[0] ** args[1]
        case "abs":
            return abs(args[0])
    return getattr(library, node.op)(*args)
