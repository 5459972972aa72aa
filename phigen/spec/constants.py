"""The value of a constant expression such as ``sqrt(2)/2``, correct to the nearest double."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from phigen.symbolic.expression import Expression, fold
from phigen.symbolic.numeric import Numbers, evaluate_precisely

#: Decimal digits of the evaluation. A double has 16. The other digits are a reserve, since terms of the formula may
#: cancel.
DIGITS = 77


def nearest_double(expression: Expression) -> Fraction | None:
    """Return the double nearest to an expression without symbols, or None if it is not a finite real number.

    The expression is evaluated in doubles, and then with 77 digits. An overflow in doubles ends the evaluation, because
    ``exp(exp(exp(100)))`` with 77 digits would never end.
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
