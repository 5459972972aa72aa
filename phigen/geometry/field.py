"""Arithmetic for structure constants: the rational numbers Q or, if the constants contain parameters, Q(parameters)."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx

from phigen.symbolic.arithmetic import Arithmetic
from phigen.symbolic.expression import Expression, number, topological
from phigen.symbolic.horner import horner
from phigen.symbolic.tower import rational

#: Element of a `Field`: ``flint.fmpq`` or `Ratio`. Both types have + − * / and can be compared with 0.
Scalar = Any

_ARITHMETIC = frozenset({"number", "symbol", "add", "sub", "neg", "mul"})


class Ratio:
    """Quotient of two polynomials over Q in lowest terms; the leading coefficient of the denominator is 1."""

    __slots__ = ("denominator", "numerator")

    def __init__(self, numerator: Any, denominator: Any) -> None:
        if denominator == 0:
            raise ZeroDivisionError("division by zero")
        common = numerator.gcd(denominator)
        numerator, denominator = numerator / common, denominator / common
        leading = denominator.leading_coefficient()
        self.numerator, self.denominator = numerator / leading, denominator / leading

    def __add__(self, other: Ratio) -> Ratio:
        return Ratio(
            self.numerator * other.denominator + other.numerator * self.denominator,
            self.denominator * other.denominator,
        )

    def __sub__(self, other: Ratio) -> Ratio:
        return self + (-other)

    def __neg__(self) -> Ratio:
        return Ratio(-self.numerator, self.denominator)

    def __mul__(self, other: Ratio) -> Ratio:
        return Ratio(self.numerator * other.numerator, self.denominator * other.denominator)

    def __truediv__(self, other: Ratio) -> Ratio:
        return Ratio(self.numerator * other.denominator, self.denominator * other.numerator)

    def __pow__(self, exponent: int) -> Ratio:
        if exponent < 0:
            return Ratio(self.denominator**-exponent, self.numerator**-exponent)
        return Ratio(self.numerator**exponent, self.denominator**exponent)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, int):
            return bool(self.numerator == other * self.denominator)
        return isinstance(other, Ratio) and bool(
            self.numerator * other.denominator == other.numerator * self.denominator
        )

    __hash__ = None  # type: ignore[assignment]


class Field(Arithmetic[Scalar]):
    """The smallest field Q(symbols) that contains some expressions. Its elements have the type `Scalar`.

    Functions of parameters, such as ``sqrt(l)``, and constants such as ``pi`` count as independent symbols. So an
    element that is 0 only because of a relation between functions counts as nonzero. This affects only the recognition
    of algebraic structures; statements about them are proved in a `Tower`.
    """

    def __init__(self, expressions: Iterable[Expression] = ()) -> None:
        roots = list(expressions)
        self._atoms: list[Expression] = []
        self._index: dict[int, int] = {}
        for node in topological(roots):
            if node.op == "symbol" or (node.op not in _ARITHMETIC and not _integer_power(node)):
                self._index[id(node)] = len(self._atoms)
                self._atoms.append(node)
        self.is_rational = not self._atoms
        self._context = fmpq_mpoly_ctx.get([f"v{i}" for i in range(len(self._atoms))] or ["v0"], Ordering.degrevlex)
        self.zero = self.number(0)
        self.one = self.number(1)

    def number(self, value: int | Fraction) -> Scalar:
        """Return a rational number as an element of the field."""
        value = Fraction(value)
        rational = fmpq(value.numerator, value.denominator)
        return rational if self.is_rational else Ratio(self._context.constant(rational), self._context.constant(1))

    def convert(self, e: Expression) -> Scalar:
        """Return an expression as an element of the field. Raises `KeyError` for a symbol that the field lacks."""
        if e.is_number:
            return self.number(e.value)
        return self.values([e])[0]

    def visit(self, node: Expression, args: list[Scalar]) -> Scalar:
        """Return the element for a node of an expression, from the elements for its arguments."""
        if id(node) in self._index:
            return Ratio(self._context.gens()[self._index[id(node)]], self._context.constant(1))
        return super().visit(node, args)

    def constant(self, value: Fraction) -> Scalar:
        """Return a rational number as an element of the field."""
        return self.number(value)

    def variable(self, name: str) -> Scalar:
        """Raise `KeyError`: the field does not contain the symbol ``name``. Symbols of the field are converted by
        `visit`.
        """
        raise KeyError(name)

    def power(self, base: Scalar, exponent: Fraction) -> Scalar:
        """Return an integer power of an element. Raises `KeyError` for other powers."""
        if exponent.denominator != 1:
            raise KeyError(str(exponent))
        return base ** int(exponent)

    def function(self, name: str, args: list[Scalar]) -> Scalar:
        """Raise `KeyError`: the field does not contain this function. Functions in the field are converted by
        `visit`.
        """
        raise KeyError(name)

    def expression(self, element: Scalar) -> Expression:
        """Return an element of the field as an expression."""
        if self.is_rational:
            return number(rational(element))
        top, bottom = (self._polynomial(p) for p in (element.numerator, element.denominator))
        return top if bottom.is_number and bottom.value == 1 else top / bottom

    def _polynomial(self, polynomial: Any) -> Expression:
        size = len(self._atoms)
        terms = polynomial.to_dict().items()
        return horner({tuple(int(e) for e in m)[:size]: number(rational(c)) for m, c in terms}, self._atoms)


def _integer_power(node: Expression) -> bool:
    return node.op == "pow" and node.value.denominator == 1
