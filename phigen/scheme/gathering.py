"""Collection of constant factors, whose products are computed once, before the steps.

Every value is written as q·s·c with a number q, a factor s that does not depend on the state, and a factor c that does.
For a product, the three factors are multiplied separately. In a sum, a factor s that all terms share is factored out:
(h²x²)/4 + (h²y²)/4 becomes (h²/4)(x² + y²), with one coefficient and four operations. A number that is factored out of
a sum is multiplied into the coefficient of the product that contains the sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from phigen.scheme.lowering import cost
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import ONE, Expression, add, fold, neg, number, power, rebuild, sub


@dataclass(frozen=True)
class _Value:
    """A value as a product q·s·c of three factors: the fields ``number``, ``static`` and ``core``.

    The factor s does not depend on the state. The factor c depends on the state, or is 1.
    """

    number: Fraction
    static: Expression
    core: Expression


def _sum(a: Expression, ratio: Fraction, b: Expression) -> Expression:
    return (add if ratio > 0 else sub)(a, number(abs(ratio)) * b)


def gather(coefficients: Coefficients, roots: Sequence[Expression]) -> list[Expression]:
    """Return the expressions ``roots``. In each product, one coefficient replaces all factors that do not depend on the
    state.

    The coefficients are added to the table ``coefficients``.
    """

    def product(v: _Value) -> Expression:
        if v.static is ONE and v.number in (1, -1):
            return v.core if v.number == 1 else neg(v.core)
        factor = coefficients.slot(number(v.number) * v.static)
        return factor if v.core is ONE else factor * v.core

    def visit(e: Expression, args: list[_Value]) -> _Value:
        if coefficients.is_state_independent(e):
            return _Value(Fraction(e.value), ONE, ONE) if e.is_number else _Value(Fraction(1), e, ONE)
        if e.op == "mul":
            a, b = args
            return _Value(a.number * b.number, a.static * b.static, a.core * b.core)
        if e.op == "neg":
            return _Value(-args[0].number, args[0].static, args[0].core)
        if e.op == "pow" and e.value.denominator == 1 and e.value > 0:
            return _Value(args[0].number ** e.value, power(args[0].static, e.value), power(args[0].core, e.value))
        if e.op in ("add", "sub") and ONE not in (args[0].core, args[1].core):
            a, b = args[0], args[1] if e.op == "add" else replace(args[1], number=-args[1].number)
            if a.static is b.static:
                return _Value(a.number, a.static, _sum(a.core, b.number / a.number, b.core))
            if a.static is ONE:
                return _Value(a.number, ONE, _sum(a.core, Fraction(1), product(replace(b, number=b.number / a.number))))
            if b.static is ONE:
                return _Value(b.number, ONE, _sum(product(replace(a, number=a.number / b.number)), Fraction(1), b.core))
        return _Value(Fraction(1), ONE, rebuild(e, [product(a) for a in args]))

    return [product(v) for v in fold(roots, visit)]


def staged(increment: Sequence[Expression], coefficients: Coefficients) -> list[Expression]:
    """Return the increments with coefficients in place of state-independent values.

    Two forms are compared: the result of `gather`, and the result of `Coefficients.hoist`. The cheaper form is
    returned.
    """
    hoisted, gathered = (cost(way(coefficients.empty(), increment)) for way in (Coefficients.hoist, gather))
    return gather(coefficients, increment) if gathered < hoisted else coefficients.hoist(increment)
