"""The value of a constant expression such as ``sqrt(2)/2``, correct to the nearest double."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from phigen.symbolic.expression import Expression, fold
from phigen.symbolic.numeric import Numbers, evaluate_precisely

#: Number of digits of the evaluation: sufficient for correct rounding after the cancellations of usual formulas.
DIGITS = 77


def nearest_double(expression: Expression) -> Fraction | None:
    """Return the double nearest to an expression without symbols, or None if it is not a finite real number.

    The expression is first evaluated in doubles; the evaluation stops at the first overflow. With 77 digits,
    ``exp(exp(exp(100)))`` would never end.
    """
    floats = Numbers({}, float, math, math.pow)
    try:
        fold([expression], lambda node, args: _finite(floats.visit(node, args)))
        (value,) = evaluate_precisely([expression], {}, DIGITS)
    except (ArithmeticError, ValueError, TypeError):
        return None
    return Fraction(float(value))


def _finite(value: Any) -> float:
    if isinstance(value, complex) or not math.isfinite(value):
        raise ValueError("not a finite real number")
    return float(value)
