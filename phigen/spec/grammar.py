"""The grammar of expressions: a precedence parser from text to `Expression`.

::

    sum      = product (("+" | "-") product)*
    product  = sign (("*" | "/") sign)*
    sign     = ("-" | "+") sign | power
    power    = atom ["**" sign]
    atom     = number | name | indexed | function "(" sum ("," sum)* ")" | "(" sum ")" | choice
    choice   = "if" "(" sum ("<" | "<=" | ">" | ">=") sum "," sum "," sum ")"

Piecewise functions such as ``if`` are allowed in observables and ``stop`` only. Names with an index, such as
``x[i+1]``, are allowed in lattices; `phigen.spec.indices` reads them. Precedences are those of Python: ``-x**2`` is
−(x²) and ``2**3**2`` is 2⁹.

Nothing is ever evaluated as Python. Decimals are exact rationals. The size of constants and exponents is checked before
anything is computed with them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Protocol

from phigen.spec import limits
from phigen.spec.indices import Indices
from phigen.spec.names import PIECEWISE_FUNCTIONS, SPEC_FUNCTIONS
from phigen.spec.problems import counted, did_you_mean, shown
from phigen.spec.yaml_source import describe
from phigen.symbolic.expression import (
    EULER,
    ONE,
    PI,
    Expression,
    add,
    call,
    mul,
    neg,
    number,
    power,
    sqrt,
    sub,
    symbol,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.symbols import Symbol

CONSTANTS = {"pi": PI, "E": EULER}
#: Names of functions in other languages, with their names in specs.
OTHER_FUNCTIONS = {"ln": "log", "fabs": "abs", "arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2"}


class Report(Protocol):
    """Function that receives an error in an expression; ``index`` is the position of the error in the text."""

    def __call__(self, message: str, index: int, hint: str = "", *, limit: bool = False) -> None: ...


@dataclass(frozen=True)
class AllowedNames:
    """The names that an expression may use.

    ``names`` maps each allowed name to its expression. ``refused`` has names that exist but are not allowed here, each
    with a message and a hint. If ``open``, unknown names are accepted as symbols. ``indices`` describes the names that
    may have an index; it is None if no name may have one. If ``piecewise``, functions without a derivative are allowed
    (`phigen.spec.names.PIECEWISE_FUNCTIONS`).
    """

    names: Mapping[str, Expression]
    refused: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    open: bool = False
    indices: Indices | None = None
    piecewise: bool = False

    def lookup(self, name: str) -> Expression | None:
        """Return the expression that a name stands for; None if the name is unknown or refused.

        A declared name takes precedence over the constants pi and E.
        """
        if name in self.names:
            return self.names[name]
        if name in self.refused:
            return None
        return CONSTANTS.get(name) or (symbol(name) if self.open and name not in SPEC_FUNCTIONS else None)

    def unknown(self, name: str) -> tuple[str, str]:
        """Return the message and the hint for a name for which `lookup` returns None."""
        if name in self.refused:
            return self.refused[name]
        if name.lower() in ("nan", "inf", "infinity"):
            return f"{shown(name)} is not a finite number", ""
        if name == "t":
            return "the name 't' is not declared", "if t is the time, add time: t to the spec"
        hint = did_you_mean(name, [*self.names, *CONSTANTS])
        if name == "e" and "E" not in self.names and hint == "did you mean 'E'?":
            hint = "if e is Euler's number, write E; otherwise declare e, for example under parameters"
        return f"the name {shown(name)} is not declared", hint


_TOKEN = re.compile(
    r"[ \t\n]*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<operator>\*\*|[<>]=?|[-+*/(),\[\]])"
    r"|(?P<end>\Z)"
    r"|(?P<other>(?s:.)))"
)
_CHARACTER_HINTS = {
    "^": "write powers with **",
    "−": "write the minus sign as -",
    "–": "write the minus sign as -",
    "·": "write products with *",
    "×": "write products with *",
    "²": "write squares with **2",
    "³": "write cubes with **3",
    "√": "write square roots as sqrt(…)",
    "π": "write the constant as pi",
    "{": "parentheses of expressions are ( )",
    "=": "an expression has no = sign",
    ".": "a name contains no point",
    "'": "expressions are formulas of numbers, names and functions, not Python",
    '"': "expressions are formulas of numbers, names and functions, not Python",
    ":": "expressions are formulas of numbers, names and functions, not Python",
}

#: Characters that users may write instead of operators, with the operators. The parser reports the character, and
#: continues as if the operator stood there, so that later errors in the expression are reported too.
_MEANT = {"^": "**", "−": "-", "–": "-", "·": "*", "×": "*"}


@dataclass(frozen=True)
class Token:
    """A lexical element at the character ``index`` of the text; ``kind`` is number, name, operator or end."""

    kind: str
    text: str
    index: int


class _AbandonedError(Exception):
    """Raised after a syntax error that has been reported, since the rest of the expression cannot be read."""


def tokens(source: str, report: Report) -> list[Token] | None:
    """Return the tokens of an expression; the last one has the kind ``end``. None after a reported error."""
    if len(source) > limits.EXPRESSION_LENGTH:
        message = f"the expression has {len(source)} characters, more than the limit of {limits.EXPRESSION_LENGTH}"
        report(message, 0, "give names to parts of the expression, under definitions", limit=True)
        return None
    result: list[Token] = []
    reported: set[str] = set()
    for match in _TOKEN.finditer(source):
        kind = match.lastgroup
        assert kind is not None
        text, index = match.group(kind), match.start(kind)
        if kind == "other" and text not in reported:
            shape = shown(text) if text.isascii() and text.isprintable() else describe(text)
            report(f"the character {shape} does not belong in an expression", index, _CHARACTER_HINTS.get(text, ""))
            reported.add(text)
        if kind == "other":
            if text not in _MEANT:
                return None
            kind, text = "operator", _MEANT[text]
        result.append(Token(kind, text, index))
        if kind == "end":
            break
    return result


def names_in(source: str) -> list[str]:
    """Return the names in an expression, in the order of the text, with repetitions. Errors are not reported."""
    token_list = tokens(source, lambda message, index, hint="", *, limit=False: None)
    return [t.text for t in token_list or [] if t.kind == "name"]


def parse(source: str, scope: AllowedNames, report: Report) -> Expression | None:
    """Return the expression that a text stands for; None after errors, which are passed to ``report``.

    Reading ends at the first syntax error; until then, all unknown names and undefined values are reported.
    """
    failed = False

    def note(message: str, index: int, hint: str = "", *, limit: bool = False) -> None:
        nonlocal failed
        failed = True
        report(message, index, hint, limit=limit)

    source_tokens = tokens(source, note)
    if source_tokens is None:
        return None
    try:
        result = Parser(source_tokens, scope, note).whole()
    except _AbandonedError:
        return None
    return None if failed else result


class Parser:
    """Parser from tokens to an expression, with a method for each rule of the grammar."""

    nothing = symbol(Symbol("unknown", ""))  # stands for a part with an error while the other parts are read

    def __init__(self, source_tokens: list[Token], scope: AllowedNames, report: Report) -> None:
        self.tokens, self.scope, self.report = source_tokens, scope, report
        self.position = self.depth = self.nodes = 0
        self.unknown: set[str] = set()

    # --- reading tokens

    @property
    def here(self) -> Token:
        return self.tokens[self.position]

    def accept(self, *operators: str) -> Token | None:
        token = self.here
        if token.kind != "operator" or token.text not in operators:
            return None
        self.position += 1
        return token

    def advance(self) -> Token:
        """Return the current token and go to the next one, except at the end token, which stays current."""
        token = self.here
        self.position += token.kind != "end"
        return token

    def abandon(self, message: str, index: int, hint: str = "", *, limit: bool = False) -> _AbandonedError:
        self.report(message, index, hint, limit=limit)
        return _AbandonedError()

    def count(self, token: Token) -> None:
        self.nodes += 1
        if self.nodes > limits.EXPRESSION_NODES:
            message = f"the expression has more than {limits.EXPRESSION_NODES} numbers, names and operators"
            raise self.abandon(
                message, token.index, "give names to parts of the expression, under definitions", limit=True
            )

    def nested(self, rule: Callable[[], Expression], token: Token) -> Expression:
        self.depth += 1
        if self.depth > limits.EXPRESSION_DEPTH:
            message = f"the expression is nested deeper than {limits.EXPRESSION_DEPTH} levels"
            raise self.abandon(
                message, token.index, "give names to parts of the expression, under definitions", limit=True
            )
        result = rule()
        self.depth -= 1
        return result

    # --- the rules of the grammar

    def whole(self) -> Expression:
        if self.here.kind == "end":
            raise self.abandon("the expression is empty", 0)
        result = self.sum()
        if self.here.kind != "end":
            raise self.misplaced()
        return result

    def misplaced(self) -> _AbandonedError:
        """Report a token that cannot stand after a complete operand, and return the exception to raise."""
        token, previous = self.here, self.tokens[self.position - 1]
        if token.text in ("[", "]"):
            return self.bracket(token)
        if token.text in (")", ","):
            hint = "there is no ( before it" if token.text == ")" else "write decimals with a point, such as 1.5"
            return self.abandon(f"unexpected {token.text!r}", token.index, hint)
        if previous.kind == "number" and token.text.startswith("_"):
            return self.abandon(
                f"unexpected {shown(token.text)} after a number", token.index, "write numbers without _, such as 1000"
            )
        if token.text[0] in "<>":
            return self.abandon(
                f"unexpected {token.text!r}",
                token.index,
                "comparisons are allowed only inside if(a < b, …), in observables and stop",
            )
        hint = f"write products with *: {previous.text[-20:]}*{token.text[:20]}"
        measured = previous.kind == "number" and previous.text != "0" and token.kind == "name"
        if measured and self.scope.lookup(token.text) is None:
            hint += "; numbers have no units, but a parameter may have the key unit"
        return self.abandon(f"an operator is missing before {shown(token.text)}", token.index, hint)

    def sum(self) -> Expression:
        left = self.product()
        while token := self.accept("+", "-"):
            self.count(token)
            right = self.product()
            left = self.bounded((add if token.text == "+" else sub)(left, right), token)
        return left

    def product(self) -> Expression:
        left = self.sign()
        while token := self.accept("*", "/"):
            self.count(token)
            following = self.here.index
            right = self.sign()
            if token.text == "/":
                if right.is_zero:
                    self.report("division by zero", following)
                    right = ONE
                right = self.raised(right, Fraction(-1), token)
            left = self.bounded(mul(left, right), token)
        return left

    def sign(self) -> Expression:
        token = self.accept("-", "+")
        if token is None:
            return self.power()
        self.count(token)
        operand = self.nested(self.sign, token)
        return neg(operand) if token.text == "-" else operand

    def power(self) -> Expression:
        start, base = self.here, self.atom()
        token = self.accept("**")
        if token is None:
            return base
        self.count(token)
        exponent = self.nested(self.sign, token)
        if exponent.is_number:
            return self.raised(base, exponent.value, token)
        if base is EULER:
            return call("exp", exponent)
        if base.is_number and base.value < 0:
            message = f"the negative number {base.value} has no power with an exponent that varies"
            self.report(message, start.index, "use an integer as exponent")
            return base
        return call("power", base, exponent)

    def atom(self) -> Expression:
        token = self.here
        self.position += 1
        if token.kind == "end":
            raise self.abandon("the expression ends too early", token.index)
        if token.kind == "operator" and token.text == "(":
            result = self.nested(self.sum, token)
            self.close(token)
            return result
        self.count(token)
        if token.kind == "number":
            return self.number(token)
        if token.kind == "name":
            if self.here.text == "[" and self.scope.indices:
                return self.scope.indices.read(self, token)
            return self.call(token) if self.here.text == "(" else self.name(token)
        if token.text in ("[", "]"):
            raise self.bracket(token)
        previous = self.tokens[self.position - 2].text if self.position > 1 else ""
        hint = "write powers with **; there is no //" if token.text == "/" and previous == "/" else ""
        raise self.abandon(f"unexpected {token.text!r}", token.index, hint)

    def bracket(self, token: Token) -> _AbandonedError:
        """Report the token ``[`` or ``]`` where no index may stand, and return the exception to raise."""
        follows = token.text == "[" and self.position and self.tokens[self.position - 1].kind == "name"
        hint = "neighbours, x[i+1], are for specs with lattice:" if follows else "parentheses of expressions are ( )"
        return self.abandon(f"the character {token.text!r} does not belong in an expression", token.index, hint)

    def close(self, opening: Token) -> None:
        if self.accept(")"):
            return
        if self.here.kind == "end":
            raise self.abandon("this ( is never closed", opening.index)
        raise self.misplaced()

    # --- atoms

    def number(self, token: Token) -> Expression:
        mantissa, _, exponent = token.text.lower().partition("e")
        # The number of digits is checked before the conversion, since the integer 1e999999999 would fill the memory.
        digits = len(mantissa) + abs(int(exponent or 0)) if len(exponent) < 6 else math.inf
        value = Fraction(token.text) if digits <= 2 * len(str(limits.DENOMINATOR)) else None
        if value is None or not limits.number_is_bounded(value):
            message = f"the number {token.text[:40]} is out of range"
            self.report(message, token.index, "constants are below 1e40, with at most 79 decimals", limit=True)
            return ONE
        return number(value)

    def name(self, token: Token) -> Expression:
        value = self.scope.lookup(token.text)
        if value is not None:
            return value
        if token.text in SPEC_FUNCTIONS:
            message = f"the function {token.text} needs an argument"
            raise self.abandon(message, token.index, f"write {token.text}(…)")
        if token.text not in self.unknown:
            self.unknown.add(token.text)
            message, hint = self.scope.unknown(token.text)
            self.report(message, token.index, hint)
        return symbol(Symbol("unknown", token.text))

    def call(self, token: Token) -> Expression:
        opening = self.here
        self.position += 1
        arity = SPEC_FUNCTIONS.get(token.text)
        if arity is None and token.text in PIECEWISE_FUNCTIONS and token.text not in self.scope.names:
            return self.piecewise(token, opening)
        if arity is None:
            declared = token.text in self.scope.names or token.text in CONSTANTS
            function_names = [*SPEC_FUNCTIONS, *(PIECEWISE_FUNCTIONS if self.scope.piecewise else ())]
            guess = did_you_mean(token.text, function_names, OTHER_FUNCTIONS) or "functions are " + ", ".join(
                function_names
            )
            hint = f"write products with *: {token.text}*(…)" if declared else guess
            raise self.abandon(f"{shown(token.text)} is not a function", token.index, hint)
        arguments = [] if self.here.text == ")" else [self.nested(self.sum, opening)]
        while arguments and self.accept(","):
            arguments.append(self.nested(self.sum, opening))
        self.close(opening)
        if len(arguments) != arity:
            signature = "1 argument" if arity == 1 else f"{arity} arguments"
            self.report(f"{token.text} takes {signature}, not {len(arguments)}", token.index)
            return ONE
        return self.applied(token, arguments)

    def piecewise(self, token: Token, opening: Token) -> Expression:
        """Read the arguments of a piecewise function. Return the function as an expression that uses ``choose`` or
        ``sign``.

        ``token`` is the name of the function, ``opening`` its parenthesis; both have been read.
        """
        name = token.text
        if not self.scope.piecewise:
            hint = "phigen needs derivatives of H, brackets, Casimirs and all other formulas on which steps depend"
            raise self.abandon(f"{name} is allowed in observables and stop only", token.index, hint)
        arguments = [self.nested(self.condition if name == "if" else self.sum, opening)]
        while self.accept(","):
            arguments.append(self.nested(self.sum, opening))
        self.close(opening)
        arity = PIECEWISE_FUNCTIONS[name]
        if len(arguments) != arity:
            signature = "a condition and 2 values" if name == "if" else counted(arity, "argument")
            hint = f"write {name}(a, {name}(b, c))" if arity == 2 and len(arguments) > 2 else ""
            self.report(f"{name} takes {signature}, not {counted(len(arguments), 'argument')}", token.index, hint)
            return ONE
        return _PIECEWISE[name](*arguments)

    def condition(self) -> Expression:
        """Read a comparison, and return an expression that is positive exactly where the comparison is true."""
        left = self.sum()
        token = self.accept("<", "<=", ">", ">=")
        if token is None:
            raise self.abandon("if needs a comparison", self.here.index, "if(x > 0, a, b)")
        self.count(token)
        right = self.sum()
        difference = sub(left, right) if token.text[0] == ">" else sub(right, left)
        if token.text.endswith("="):
            return call("choose", neg(difference), number(Fraction(-1)), ONE)
        return difference

    # --- operations that can be undefined or too large

    def applied(self, token: Token, arguments: list[Expression]) -> Expression:
        function, first = token.text, arguments[0]
        if all(a.is_number for a in arguments) and not _defined(function, *(a.value for a in arguments)):
            argument_text = ", ".join(str(a.value) for a in arguments)
            self.report(f"{function}({argument_text}) is not defined", token.index)
            return ONE
        return sqrt(first) if function == "sqrt" else call(function, *arguments)

    def raised(self, base: Expression, exponent: Fraction, token: Token) -> Expression:
        """Return base ** exponent. A power that is undefined or too large is reported, and the result is 1."""
        if abs(exponent) > limits.EXPONENT:
            message = f"the exponent {_brief(exponent)} is out of range"
            self.report(
                message, token.index, f"exponents are between -{limits.EXPONENT} and {limits.EXPONENT}", limit=True
            )
            return ONE
        if base.is_zero and exponent < 0:
            self.report(f"0**({exponent}) is a division by zero", token.index)
            return ONE
        if base.is_number and base.value < 0 and exponent.denominator != 1:
            self.report(f"({base.value})**({exponent}) is not a real number", token.index)
            return ONE
        head = base.args[0] if base.op in ("mul", "neg") else base
        if head.is_number and exponent.denominator == 1:
            size = max(abs(head.value.numerator), head.value.denominator)
            if size > 1 and math.log10(size) * float(abs(exponent)) > 81:
                message = f"the constant {_brief(head.value)}**{exponent} is out of range"
                self.report(message, token.index, "constants are below 1e40", limit=True)
                return ONE
        return self.bounded(power(base, exponent), token)

    def bounded(self, result: Expression, token: Token) -> Expression:
        """Return ``result`` unchanged. If a constant or an exponent in it is out of range, report this, and return 1.

        Constant folding can make constants that are out of range, as in 1e30*1e30.
        """
        parts = [result, *result.args]
        for part in [*parts, *(a for p in parts[1:] for a in p.args)]:
            if part.is_number and not limits.number_is_bounded(part.value):
                self.report(
                    f"the constant {_brief(part.value)} is out of range",
                    token.index,
                    "constants are below 1e40",
                    limit=True,
                )
                return ONE
            if part.op == "pow" and abs(part.value) > limits.EXPONENT:
                self.report(f"the exponent {_brief(part.value)} is out of range", token.index, limit=True)
                return ONE
        return result


#: Piecewise functions as expressions; ``choose(a, b, c)`` is b where a > 0, else c. The value heaviside(0) is 1.
_PIECEWISE: Mapping[str, Callable[..., Expression]] = {
    "sign": lambda a: call("sign", a),
    "heaviside": lambda a: call("choose", neg(a), number(Fraction(0)), ONE),
    "min": lambda a, b: call("choose", sub(b, a), a, b),
    "max": lambda a, b: call("choose", sub(a, b), a, b),
    "if": lambda a, b, c: call("choose", a, b, c),
}


def _brief(value: Fraction) -> str:
    printed = str(value)
    return printed if len(printed) <= 40 else f"{float(value):.3e}"


def _defined(function: str, *arguments: Fraction) -> bool:
    return arguments[0] >= 0 if function == "sqrt" else FUNCTIONS[function].defined(*arguments)


def constant(expression: Expression) -> Fraction | None:
    """Return the value of an expression without symbols; None if it is not a finite real number.

    The value is exact if the expression was folded to a rational. Otherwise it is the nearest double.
    """
    if expression.is_number:
        value: Fraction = expression.value
        return value
    from phigen.spec.constants import nearest_double

    return nearest_double(expression)
