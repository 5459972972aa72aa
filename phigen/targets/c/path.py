"""The path ṁ = π(m)p as lines of C: Taylor recurrences, for the template that runs them."""

from __future__ import annotations

from collections.abc import Callable

from phigen.scheme.lowering import expand_powers
from phigen.scheme.path import Path, Series, Term
from phigen.scheme.program import Program
from phigen.symbolic.expression import Expression, symbols_of
from phigen.targets.c.kernels import printer
from phigen.targets.names import C_RESERVED, Scope

Text = Callable[[Expression], str]


def lines(program: Program, path: Path) -> dict[str, list[str]]:
    """Statements: ``fixed`` values, ``first`` coefficients, ``rules`` for order k, and ``slopes`` of the coordinates.

    ``unused`` names arguments of the function that no statement reads.
    """
    show = printer(_scope(program, path))

    def text(e: Expression) -> str:
        return show(expand_powers([e])[0])

    n = program.dimension
    derived = list(enumerate(path.series))[n:]
    roots = [*path.fixed, *(q.first for q in path.series), *(f for q in path.series for _, f in q.linear)]
    return {
        "fixed": [f"const double f{i} = {text(e)};" for i, e in enumerate(path.fixed)],
        "first": [f"s[{i}][0] = {text(q.first)};" for i, q in derived],
        "rules": [f"s[{i}][k] = {_rule(q, text, program.name)};" for i, q in derived],
        "slopes": [f"s[{i}][k + 1] = s[{slope}][k] / (k + 1);" for i, slope in enumerate(path.slopes)],
        "unused": [] if any(s.startswith("c:") for s in symbols_of(*roots)) else ["(void)coef;"],
    }


def kinds(path: Path) -> list[str]:
    """The kinds of sums over orders that the path needs, in a fixed order."""
    return [k for k in ("product", "chain", "power") if any(t.kind == k for q in path.series for t in q.terms)]


def _scope(program: Program, path: Path) -> Scope:
    scope = Scope(C_RESERVED)
    for i, c in enumerate(program.coordinates):
        scope.bind(f"p:{c}", f"p[{i}]")
    for i in range(program.coefficients):
        scope.bind(f"c:{i}", f"coef[{i}]")
    for i in range(len(path.series)):
        scope.bind(f"s:{i}", f"s[{i}][0]")
    for i in range(len(path.fixed)):
        scope.bind(f"f:{i}", f"f{i}")
    return scope


def _rule(q: Series, text: Text, name: str) -> str:
    pieces = [_linear(index, factor, text) for index, factor in q.linear]
    pieces += [("+", _term(t, name)) for t in q.terms]
    if not pieces:
        return "0.0"
    first = ("-" if pieces[0][0] == "-" else "") + pieces[0][1]
    total = " ".join([first, *(f"{sign} {p}" for sign, p in pieces[1:])])
    return f"({total}) / s[{q.divisor}][0]" if q.divisor is not None else total


def _linear(index: int, factor: Expression, text: Text) -> tuple[str, str]:
    if factor.is_number and abs(factor.value) == 1:
        return "-" if factor.value < 0 else "+", f"s[{index}][k]"
    return "+", f"{text(factor)} * s[{index}][k]"


def _term(t: Term, name: str) -> str:
    if t.kind == "power":
        exponent = f"{t.exponent.numerator}.0 / {t.exponent.denominator}.0"
        return f"{name}_power(s[{t.a}], s[{t.b}], {exponent}, k)"
    return f"{name}_{t.kind}(s[{t.a}], s[{t.b}], k)"
