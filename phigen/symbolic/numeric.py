"""Values of expressions: floats, exact rationals, and mpmath numbers of any precision."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from phigen.symbolic import entire
from phigen.symbolic.expression import Expression, fold, topological
from phigen.symbolic.special import SPECIAL, in_double, order_of, precisely

_RATIONAL = frozenset({"number", "symbol", "add", "sub", "neg", "mul", "abs", "sign"})


class DomainError(ArithmeticError):
    """A function was evaluated where it has no real, finite value."""


def is_rational(*roots: Expression) -> bool:
    """Whether rational values of the symbols give rational values of the roots, wherever they are defined."""
    return all(
        node.op in _RATIONAL or (node.op == "pow" and node.value.denominator == 1) for node in topological(roots)
    )


def evaluate(roots: Sequence[Expression], values: Mapping[str, float]) -> list[float]:
    """Values of the roots in double precision.

    Raises `DomainError` outside the real domain, on overflow, and KeyError for a symbol without value.
    """
    with_floats = {name: float(v) for name, v in values.items()}
    return _guarded(lambda: fold(roots, _visitor(with_floats, float, math, math.pow)))


def evaluate_exactly(roots: Sequence[Expression], values: Mapping[str, Fraction]) -> list[Fraction]:
    """Exact values of roots for which `is_rational` holds; raises `DomainError` and KeyError as `evaluate`."""
    exact = {name: Fraction(v) for name, v in values.items()}
    return _guarded(lambda: fold(roots, _visitor(exact, Fraction, None, _exact_power)))


def evaluate_precisely(roots: Sequence[Expression], values: Mapping[str, Fraction], digits: int = 50) -> list[Any]:
    """Values of the roots as mpmath numbers with that many digits; raises as `evaluate`.

    The global precision of mpmath is left alone.
    """
    return [value for value, _ in evaluate_with_scale(roots, values, digits)]


def evaluate_with_scale(
    roots: Sequence[Expression], values: Mapping[str, Fraction], digits: int = 50
) -> list[tuple[Any, Any]]:
    """Pairs (value, scale) of mpmath numbers; scale is the largest magnitude met below the root, at least 1.

    A value that is tiny against its scale may be nothing but rounding error.
    """
    context = _mpmath_context(digits)

    def convert(v: Fraction) -> Any:
        return context.mpf(v.numerator) / v.denominator

    exact = {name: convert(Fraction(v)) for name, v in values.items()}
    value_of = _visitor(exact, convert, context, lambda b, e: _precise_power(context, b, e))

    def visit(node: Expression, args: list[tuple[Any, Any]]) -> tuple[Any, Any]:
        value = value_of(node, [a for a, _ in args])
        if not isinstance(value, context.mpf) or not context.isfinite(value):
            raise DomainError(f"{node.op} has no finite real value here")
        return value, max([context.one, abs(value), *(scale for _, scale in args)])

    return _guarded(lambda: fold(roots, visit))


def _guarded(compute: Callable[[], list[Any]]) -> list[Any]:
    try:
        return compute()
    except (ZeroDivisionError, ValueError, OverflowError, TypeError) as error:
        raise DomainError(str(error)) from error


def _exact_power(base: Any, exponent: Fraction) -> Any:
    if exponent.denominator != 1:
        raise DomainError("a root is not rational")
    return base ** int(exponent)


def _precise_power(context: Any, base: Any, exponent: Any) -> Any:
    if not isinstance(exponent, Fraction):
        return context.power(base, exponent)
    if exponent.denominator == 1:
        return base ** int(exponent)
    return context.root(base, exponent.denominator) ** exponent.numerator


def _mpmath_context(digits: int) -> Any:
    from mpmath.ctx_mp import MPContext  # here: importing it takes 60 ms

    context = MPContext()
    context.dps = digits
    return context


def _inverse(value: Any) -> Any:
    if value <= 0:
        raise ValueError("inv of a value that is not positive")
    return 1 / value


def _visitor(
    values: Mapping[str, Any], convert: Callable[[Any], Any], library: Any, power: Callable[[Any, Any], Any]
) -> Callable[[Expression, list[Any]], Any]:
    """The value of a node from those of its arguments, functions taken from ``library`` (math or an mpmath context)."""

    def visit(node: Expression, args: list[Any]) -> Any:
        match node.op:
            case "number":
                return convert(node.value)
            case "symbol":
                return values[node.value]
            case "add":
                return args[0] + args[1]
            case "sub":
                return args[0] - args[1]
            case "neg":
                return -args[0]
            case "mul":
                return args[0] * args[1]
            case "pow":
                return power(args[0], node.value)
            case "power":
                return power(args[0], args[1])
            case "abs":
                return abs(args[0])
            case "sign":
                return convert((args[0] > 0) - (args[0] < 0))
        if library is None:
            raise DomainError(f"{node.op} is not rational")
        if node.op == "versin":
            return 2 * library.sin(args[0] / 2) ** 2
        if node.op == "inv":
            return _inverse(args[0])
        if node.op in ("pi", "E"):
            return +getattr(library, node.op.lower())
        if node.op in entire.ENTIRE:
            in_floats = library is math
            return entire.in_double(node.op, args[0]) if in_floats else entire.precisely(library, node.op, args[0])
        if node.op in SPECIAL:
            order = order_of(node.op)
            return in_double(order, args[0]) if library is math else precisely(library, order, args[0])
        return getattr(library, node.op)(*args)

    return visit
