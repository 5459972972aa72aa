"""The path ṁ = π(m)p as statements: Taylor recurrences, for the templates that run them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from phigen.scheme.lowering import expand_powers
from phigen.scheme.path import ConvolutionTerm, NodeSeries, Recurrences
from phigen.scheme.program import Program
from phigen.scheme.steps import PathAdjoint
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import FIXED, SERIES, Symbol, coefficient, cotangent, momentum, variation
from phigen.targets.names import Scope
from phigen.targets.printer import Printer
from phigen.targets.reserved import Reserved

Text = Callable[[Expression], str]

#: Largest number of Taylor terms of a path; a path that needs more is divided into pieces.
TERMS = 30


@dataclass(frozen=True)
class Syntax:
    """Spelling of statements and sums in a target; the defaults are those of C."""

    printer: Callable[[Scope], Printer]
    slope: str  # the statement that sets coefficient k + 1 of coordinate i
    sums: str  # the name of a sum over orders, by its {kind} or {Kind}
    covector: str = "p[{i}]"  # component i of p
    fixed: str = "f[{i}] = {value};"  # the statement that defines fixed value i
    held: str = "f[{i}]"  # that value
    first: str = "s[{i}][0] = {value};"  # the statement that sets the first coefficient of series i
    following: str = "s[{i}][k] = {value};"  # the statement that sets coefficient k ≥ 1 of series i


def statements(program: Program, path: Recurrences, syntax: Syntax) -> dict[str, list[str]]:
    """Return statements by purpose: ``fixed`` values, ``first`` coefficients, ``rules`` for order k, ``slopes``.

    ``nodes`` set e[i], the values of the derived series at one point, and ``field`` the value of ṁ, without semicolons.
    """
    show = syntax.printer(_scope(program, path, syntax, "s[{i}][0]"))
    show_node = syntax.printer(_scope(program, path, syntax, "e[{i}]"))

    def text(e: Expression) -> str:
        return show(expand_powers([e])[0])

    derived = list(enumerate(path.series))[program.dimension :]
    return {
        "fixed": [syntax.fixed.format(i=i, value=text(e)) for i, e in enumerate(path.fixed)],
        "first": [syntax.first.format(i=i, value=text(q.first)) for i, q in derived],
        "rules": [syntax.following.format(i=i, value=_rule(q, text, syntax.sums)) for i, q in derived],
        "slopes": [syntax.slope.format(i=i, slope=slope) for i, slope in enumerate(path.slopes)],
        "nodes": [f"e[{i}] = {show_node(expand_powers([q.first])[0])}" for i, q in derived],
        "field": [f"field[{i}] = e[{slope}]" for i, slope in enumerate(path.slopes)],
    }


def tangent_program(program: Program) -> Program:
    """Return the program with the coordinates of its tangent path: the state, then its variation."""
    return replace(program, coordinates=(*program.coordinates, *map(variation, program.coordinates)))


def adjoint_program(program: Program, path: PathAdjoint) -> Program:
    """Return the program with the coordinates of the path of the reverse pass: the state, then all cotangents."""
    names = program.coordinates
    bars = [
        *map(cotangent, names),
        *(cotangent(momentum(c)) for c in names),
        *(cotangent(coefficient(k)) for k in path.used),
    ]
    return replace(program, coordinates=(*names, *bars))


def recurrences(program: Program) -> list[Recurrences]:
    """Return the recurrences of the path, of its tangent path and of its reverse pass, [] for steps without paths."""
    step = program.step
    back = step.back.recurrences if step.back else None
    return [path for path in (step.path, step.varied_path, back) if path]


def kinds(path: Recurrences) -> list[str]:
    """Return the kinds of sums over orders that the path needs, in a fixed order."""
    return [k for k in ("product", "chain", "power") if any(t.kind == k for q in path.series for t in q.terms)]


def _scope(program: Program, path: Recurrences, syntax: Syntax, series: str) -> Scope:
    scope = Scope(Reserved())
    for i, c in enumerate(program.coordinates):
        scope.bind(momentum(c), syntax.covector.format(i=i))
    for i in range(program.step.coefficients):
        scope.bind(coefficient(i), f"coef[{i}]")
    for i in range(len(path.series)):
        scope.bind(Symbol(SERIES, i), series.format(i=i))
    for i in range(len(path.fixed)):
        scope.bind(Symbol(FIXED, i), syntax.held.format(i=i))
    return scope


def _rule(q: NodeSeries, text: Text, sums: str) -> str:
    pieces = [_linear(index, factor, text) for index, factor in q.linear]
    pieces += [("+", _term(t, sums)) for t in q.terms]
    if not pieces:
        return "0.0"
    first = ("-" if pieces[0][0] == "-" else "") + pieces[0][1]
    total = " ".join([first, *(f"{sign} {p}" for sign, p in pieces[1:])])
    return f"({total}) / s[{q.divisor}][0]" if q.divisor is not None else total


def _linear(index: int, factor: Expression, text: Text) -> tuple[str, str]:
    if factor.is_number and abs(factor.value) == 1:
        return "-" if factor.value < 0 else "+", f"s[{index}][k]"
    return "+", f"{text(factor)} * s[{index}][k]"


def _term(t: ConvolutionTerm, sums: str) -> str:
    function = sums.format(kind=t.kind, Kind=t.kind.capitalize())
    if t.kind == "power":
        exponent = f"{t.exponent.numerator}.0 / {t.exponent.denominator}.0"
        return f"{function}(s[{t.a}], s[{t.b}], {exponent}, k)"
    return f"{function}(s[{t.a}], s[{t.b}], k)"
