"""Printing of expression trees as infix text: the common part of the printers of C, JavaScript and Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

from phigen.symbolic.expression import Expression, fold

#: Binding strengths of sums, of products, and of atoms. They decide where parentheses are needed. Inside products, a
#: unary minus is in parentheses.
SUM, PRODUCT, ATOM = 1, 2, 3

Printed = tuple[str, int]


class Printer:
    """Printer of expressions after lowering (`phigen.scheme.lowering`), for one language."""

    def __init__(
        self,
        name: Callable[[str], str],
        functions: Mapping[str, str],
        constants: Mapping[str, str],
        power: str,
        whole: Callable[[int], str] = "{}.0".format,
        real: Callable[[float], str] = repr,
    ) -> None:
        """Make a printer for a language.

        ``name`` returns the identifier of a symbol. ``functions`` and ``constants`` map names in expressions to texts
        of the language. ``power`` is the format of a power. ``whole`` prints an integer, ``real`` any other number.
        """
        self.name, self.functions, self.constants, self.power = name, functions, constants, power
        self.whole, self.real = whole, real

    def __call__(self, e: Expression) -> str:
        """Return an expression as text."""
        return self.bound(e)[0]

    def bound(self, e: Expression) -> Printed:
        """Return an expression as text, and the binding strength of its outermost operator."""
        return fold([e], self._visit)[0]

    def literal(self, value: Fraction) -> Printed:
        """Return a rational number as text, with its binding strength.

        The text is exact if the number is a double. Otherwise it is a quotient of integers, or the shortest text of the
        nearest double.
        """
        if value < 0:
            return "-" + self.literal(-value)[0], SUM
        if value.denominator == 1 and value < 2**53:
            return self.whole(value.numerator), ATOM
        as_float = value.numerator / value.denominator
        if Fraction(as_float) == value or value.denominator > 10**6 or value.numerator > 10**6:
            return self.real(as_float), ATOM
        return f"{self.whole(value.numerator)} / {self.whole(value.denominator)}", PRODUCT

    def _visit(self, e: Expression, args: list[Printed]) -> Printed:
        match e.op:
            case "number":
                return self.literal(e.value)
            case "symbol":
                return self.name(e.value), ATOM
            case "add":
                return f"{_in(args[0], SUM)} + {_in(args[1], PRODUCT)}", SUM
            case "sub":
                return f"{_in(args[0], SUM)} - {_in(args[1], PRODUCT)}", SUM
            case "neg":
                return f"-{_in(args[0], ATOM)}", SUM
            case "mul":
                for divisor, other in ((1, 0), (0, 1)):
                    if e.args[divisor].op == "pow" and e.args[divisor].value == -1:
                        return (
                            f"{_in(args[other], PRODUCT)} / {args[divisor][0].removeprefix(f'{self.whole(1)} / ')}",
                            PRODUCT,
                        )
                return f"{_in(args[0], PRODUCT)} * {_in(args[1], ATOM)}", PRODUCT
            case "pow":
                return self._power(e.value, args[0])
            case "pi" | "E":
                return self.constants[e.op], ATOM
            case op if "{0}" in self.functions[op]:
                return self.functions[op].format(*(a for a, _ in args)), ATOM
            case _:
                return f"{self.functions[e.op]}({', '.join(a for a, _ in args)})", ATOM

    def _power(self, exponent: Fraction, base: Printed) -> Printed:
        if exponent == 2:
            inner = _in(base, ATOM)
            return f"{inner} * {inner}", PRODUCT
        if exponent == -1:
            return f"{self.whole(1)} / {_in(base, ATOM)}", PRODUCT
        if exponent == Fraction(1, 2):
            return f"{self.functions['sqrt']}({base[0]})", ATOM
        if exponent == Fraction(1, 3):
            return f"{self.functions['cbrt']}({base[0]})", ATOM
        return f"{self.power}({base[0]}, {self.literal(exponent)[0]})", ATOM


def _in(part: Printed, level: int) -> str:
    return part[0] if part[1] >= level else f"({part[0]})"
