"""Values of expressions: floats, exact rationals, and mpmath numbers of any precision."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from typing import Any

from phigen.symbolic.arithmetic import Arithmetic
from phigen.symbolic.expression import Expression, fold, topological
from phigen.symbolic.functions import FUNCTIONS

_RATIONAL = frozenset(
    ["number", "symbol", "add", "sub", "neg", "mul", *(f.name for f in FUNCTIONS.values() if f.rational)]
)


class DomainError(ArithmeticError):
    """A function was evaluated where it has no real, finite value."""


def is_rational(*roots: Expression) -> bool:
    """Whether the values of the expressions are rational for all rational values of the symbols. Undefined values do
    not count.
    """
    return all(
        node.op in _RATIONAL or (node.op == "pow" and node.value.denominator == 1) for node in topological(roots)
    )


def evaluate(roots: Sequence[Expression], values: Mapping[str, float]) -> list[float]:
    """Return the values of the roots in double precision.

    Raises `DomainError` outside the real domain and on overflow, and `KeyError` for a symbol without a value.
    """
    with_floats = {name: float(v) for name, v in values.items()}
    return _guarded(lambda: Numbers(with_floats, float, math, math.pow).values(roots))


def evaluate_exactly(roots: Sequence[Expression], values: Mapping[str, Fraction]) -> list[Fraction]:
    """Return the exact values of expressions for which `is_rational` is true. Raises the errors of `evaluate`."""
    exact = {name: Fraction(v) for name, v in values.items()}
    return _guarded(lambda: Numbers(exact, Fraction, None, _exact_power).values(roots))


def evaluate_precisely(roots: Sequence[Expression], values: Mapping[str, Fraction], digits: int = 50) -> list[Any]:
    """Return the values of the roots as mpmath numbers with ``digits`` decimal digits. Raises the errors of `evaluate`.

    The global precision of mpmath is not changed.
    """
    return [value for value, _ in evaluate_with_scale(roots, values, digits)]


def evaluate_with_scale(
    roots: Sequence[Expression], values: Mapping[str, Fraction], digits: int = 50
) -> list[tuple[Any, Any]]:
    """Return for each root a pair (value, scale) of mpmath numbers, computed with ``digits`` decimal digits.

    The scale is the largest absolute value of an intermediate result, at least 1. A value far below its scale may be
    nothing but rounding error.
    """
    context = _mpmath_context(digits)

    def convert(v: Any) -> Any:
        return context.mpf(v.numerator) / v.denominator if isinstance(v, Fraction | int) else v

    exact = {name: convert(Fraction(v)) for name, v in values.items()}
    numbers = Numbers(exact, convert, context, lambda b, e: _precise_power(context, b, e))

    def visit(node: Expression, args: list[tuple[Any, Any]]) -> tuple[Any, Any]:
        value = numbers.visit(node, [a for a, _ in args])
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


@cache
def _mpmath_context(digits: int) -> Any:
    from mpmath.ctx_mp import MPContext  # imported here, since the import takes 60 ms

    context = MPContext()
    context.dps = digits
    return context


class Numbers(Arithmetic[Any]):
    """Arithmetic of numbers of one kind: floats, fractions or mpmath numbers. ``convert`` converts a fraction to the
    kind.

    ``library`` has the elementary functions, math or an mpmath context; None allows rational operations only.
    """

    def __init__(
        self,
        values: Mapping[str, Any],
        convert: Callable[[Any], Any],
        library: Any,
        power: Callable[[Any, Any], Any],
    ) -> None:
        self._values, self._convert, self._library, self._power = values, convert, library, power

    def constant(self, value: Fraction) -> Any:
        """Return a rational number, converted to this kind of number."""
        return self._convert(value)

    def variable(self, name: str) -> Any:
        """Return the value of the symbol ``name``."""
        return self._values[name]

    def power(self, base: Any, exponent: Fraction) -> Any:
        """Return a rational power of a number."""
        return self._power(base, exponent)

    def function(self, name: str, args: list[Any]) -> Any:
        """Return the value of a function, by the formula in its record if there is one, else by the library."""
        if name in ("pi", "E"):
            return +getattr(self._expected(name), name.lower())
        if name == "power":
            return self._power(*args)
        record = FUNCTIONS[name]
        if record.rational and record.value:
            return self._convert(record.value(None, *args))
        library = self._expected(name)
        return record.value(library, *args) if record.value else getattr(library, name)(*args)

    def _expected(self, name: str) -> Any:
        if self._library is None:
            raise DomainError(f"{name} is not rational")
        return self._library
