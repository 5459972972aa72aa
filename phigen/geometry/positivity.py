"""Statements that an expression is positive, or nowhere negative, with a proof by its form or a check at starts of
runs.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction

from phigen.symbolic.expression import Expression, fold
from phigen.symbolic.numeric import DomainError, evaluate
from phigen.symbolic.readable import shortened
from phigen.symbolic.verdict import CHECKED, PROVED, REFUTED, UNDECIDED, Statement

#: The two statements that the form of an expression can prove about the sign of its values.
POSITIVE, NOT_NEGATIVE = "positive", "not negative"
_ALWAYS = {"exp": POSITIVE, "cosh": POSITIVE, "abs": NOT_NEGATIVE, "pi": POSITIVE, "E": POSITIVE}


def positivity(name: str, e: Expression, positive: Collection[str], starts: Sequence[Mapping[str, float]]) -> Statement:
    """Return the statement that ``e`` is positive.

    The statement is refuted if ``e`` is not positive at one of the ``starts`` of runs. Otherwise it counts as proved if
    the form of ``e`` shows that ``e`` is nowhere negative. The detail of the statement says whether ``e`` may be 0. If
    the form decides nothing, the statement is checked at the starts, or undecided if there are none. The symbols
    ``positive`` are positive.
    """
    for point in starts:
        try:
            (value,) = evaluate([e], point)
        except DomainError:
            return Statement(name, REFUTED, "no value where a run starts", shortened(e))
        if not value > 0:
            return Statement(name, REFUTED, f"{value:.6g} where a run starts", shortened(e))
    sign = sign_of(e, positive)
    if sign == POSITIVE:
        return Statement(name, PROVED, "by its form")
    if sign == NOT_NEGATIVE:
        return Statement(name, PROVED, "by its form, except where it is 0")
    if starts:
        return Statement(name, CHECKED, f"at the start of each run; a step fails where {name} does not hold")
    return Statement(name, UNDECIDED, f"the spec has no runs; a step fails where {name} does not hold")


def not_negative(
    name: str, e: Expression, positive: Collection[str], points: Sequence[Mapping[str, float]]
) -> Statement | None:
    """Return the statement that ``e`` is nowhere negative, decided by the form of ``e`` or else at some
    ``points``.

    Returns None if the form decides nothing and there are no points.
    """
    if _sign_of_negative(e, positive) == POSITIVE:
        return Statement(name, REFUTED, "negative by its form", shortened(e))
    if sign_of(e, positive):
        return Statement(name, PROVED, "by its form")
    for point in points:
        try:
            (value,) = evaluate([e], point)
        except DomainError:
            return Statement(name, REFUTED, "no value where a run starts", shortened(e))
        if value < 0:
            return Statement(name, REFUTED, f"{value:.6g} where a run starts", shortened(e))
    return Statement(name, CHECKED, f"at the starts of runs, {len(points)}") if points else None


def _sign_of_negative(e: Expression, positive: Collection[str]) -> str | None:
    if e.op == "number":
        return POSITIVE if e.value < 0 else None
    if e.op == "mul":
        first, second = e.args
        if first.op == "number" and first.value < 0:
            return sign_of(second, positive)
        return sign_of(second, positive) if _sign_of_negative(first, positive) == POSITIVE else None
    return sign_of(e.args[0], positive) if e.op == "neg" else None


def sign_of(e: Expression, positive: Collection[str]) -> str | None:
    """Return the sign of an expression if it follows from the form of the expression, else None.

    The symbols ``positive`` count as positive.
    """

    def visit(e: Expression, args: list[str | None]) -> str | None:
        if e.op == "number":
            return POSITIVE if e.value > 0 else NOT_NEGATIVE if e.value == 0 else None
        if e.op == "neg":  # the sign is known if the argument is a negative number, or a product with a negative number
            return _sign_of_negative(e.args[0], positive)
        if e.op == "symbol":
            return POSITIVE if e.value in positive else None
        if e.op == "add":
            return None if None in args else POSITIVE if POSITIVE in args else NOT_NEGATIVE
        if e.op == "mul":
            if e.args[0] is e.args[1]:
                return args[0] or NOT_NEGATIVE
            return None if None in args else NOT_NEGATIVE if NOT_NEGATIVE in args else POSITIVE
        if e.op == "pow":
            # If the denominator of the exponent is even, the power is defined only for bases ≥ 0, and is not negative.
            exponent = Fraction(e.value)
            is_even = exponent.denominator % 2 == 0 or exponent.numerator % 2 == 0
            sign = args[0] or (NOT_NEGATIVE if is_even else None)
            # 1/0 has no value, so the inverse of a value that is not negative is positive
            return POSITIVE if sign and exponent < 0 else sign
        return _ALWAYS.get(e.op)

    (result,) = fold([e], visit)
    return result
