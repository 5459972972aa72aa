"""Evaluation of formulas in MathML: an independent reader, whose numbers tests compare with the values of the
expressions that were written as MathML.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from xml.etree import ElementTree

from phigen.notation import mathml

_TIMES, _APPLY = "\u2062", "\u2061"
_OPERATORS = {"−": "-", "+": "+", _TIMES: "*", "·": "*", "/": "/", "(": "(", ")": ")", ",": ",", "…": "DOTS"}
_FUNCTIONS = {
    "exp": math.exp, "log": math.log, "sin": math.sin, "cos": math.cos, "tan": math.tan, "arcsin": math.asin,
    "arccos": math.acos, "arctan": math.atan, "atan2": math.atan2, "sinh": math.sinh, "cosh": math.cosh,
    "tanh": math.tanh, "arsinh": math.asinh, "arcosh": math.acosh, "artanh": math.atanh,
    "sgn": lambda v: math.copysign(1, v) if v else 0.0, "choose": lambda a, b, c: b if a > 0 else c,
}  # fmt: skip


def value_of(markup: str, names: Mapping[str, float], functions: Mapping[str, object] | None = None) -> float:
    """Return the number that an element denotes, with ``names`` as the values of identifiers."""
    root = ElementTree.fromstring(markup)
    known = {text_of(ElementTree.fromstring(mathml.name(n))): v for n, v in names.items()}
    table = {**_FUNCTIONS, **(functions or {})}
    python = _Reader(known, set(table)).read(root)
    return eval(python, {"F": table, "K": {**known, "π": math.pi, "e": math.e}, "__builtins__": {"abs": abs}})


def text_of(element: ElementTree.Element) -> str:
    """Return an identifier with its subscripts as text on one line: x_1, p_(x_1)."""
    if len(element) == 2 and element.tag == "msub":
        return f"{text_of(element[0])}_({text_of(element[1])})"
    return (element.text or "").strip() + "".join(map(text_of, element))


class _Reader:
    def __init__(self, known: Mapping[str, float], functions: set[str]) -> None:
        self.known, self.functions = known, functions

    def read(self, e: ElementTree.Element) -> str:
        children = list(e)
        match e.tag:
            case "mn":
                return e.text or ""
            case "mi" | "msub":
                return f"K[{text_of(e)!r}]"
            case "mfrac":
                return f"(({self.read(children[0])})/({self.read(children[1])}))"
            case "msqrt":
                return f"(({self.row(children)})**0.5)"
            case "mroot":
                return f"(({self.read(children[0])})**(1/({self.read(children[1])})))"
            case "msup":
                assert children[0].tag != "msup", "ambiguous: an exponent of a power or of its exponent"
                return f"(({self.read(children[0])})**({self.read(children[1])}))"
            case "msubsup":
                base = f"K[{text_of(children[0]) + '_(' + text_of(children[1]) + ')'!r}]"
                return f"(({base})**({self.read(children[2])}))"
            case "mrow" | "math":
                return self.row(children)
        raise ValueError(f"unexpected element {e.tag}")

    def row(self, children: list[ElementTree.Element]) -> str:
        """Return the value of a row of elements. Between two operands an operator must stand, as MathML gives adjacent
        elements no meaning.
        """
        if len(children) > 1 and children[0].tag == "mo" and children[0].text == "|":
            return f"abs({self.row(children[1:-1])})"
        parts, operand = "", False
        place = 0
        while place < len(children):
            e = children[place]
            follows = children[place + 1] if place + 1 < len(children) else None
            if follows is not None and follows.tag == "mo" and follows.text == _APPLY:
                assert not operand
                parts += self.call(e, children[place + 2])
                operand, place = True, place + 3
                continue
            if e.tag == "mo":
                parts, operand = parts + _OPERATORS[e.text or ""], e.text == ")"
            else:
                assert not operand, "two operands without an operator"
                parts, operand = parts + f"({self.read(e)})", True
            place += 1
        return parts

    def call(self, function: ElementTree.Element, arguments: ElementTree.Element) -> str:
        name = function[0] if function.tag == "msup" else function
        assert name.text in self.functions
        called = f"F[{name.text!r}]{self.read(arguments)}"
        return f"(({called})**({self.read(function[1])}))" if function.tag == "msup" else called
