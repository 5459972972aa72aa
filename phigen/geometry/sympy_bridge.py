"""Between sympy and `Expression`: systems built in Python from sympy, and formulas for LaTeX.

The only module that imports sympy; it is imported where it is needed, since that takes a quarter of a second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import sympy

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System, build_system
from phigen.spec.model import MatrixForm, Parameter
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import (
    EULER,
    FUNCTIONS,
    OWN,
    PI,
    Expression,
    call,
    fold,
    number,
    power,
    product,
    symbol,
    symbols_of,
    total,
)
from phigen.symbolic.special import SPECIAL, order_of
from phigen.symbolic.symbols import plain

#: sympy's names of functions where they differ.
_FROM_SYMPY = {"Abs": "abs"}
_TO_SYMPY = {"abs": "Abs"}


def expression(value: Any) -> Expression:
    """A sympy expression or a number as an `Expression`; Floats as the decimals they print.

    Raises `SpecError` for functions and constants that phigen does not have. Text is refused: parsing it with
    sympy would evaluate it as Python.
    """
    if isinstance(value, str):
        raise SpecError([Diagnostic(f"{value!r} is text, not a sympy expression")])
    return _convert(sympy.sympify(value, strict=True), {})


def _convert(e: Any, known: dict[Any, Expression]) -> Expression:
    found = known.get(e)
    if found is None:
        found = known[e] = _node(e, [_convert(a, known) for a in e.args])
    return found


def _node(e: Any, args: list[Expression]) -> Expression:
    if e.is_Symbol:
        return symbol(e.name)
    if e.is_Rational:
        return number(Fraction(int(e.p), int(e.q)))
    if e.is_Float and e.is_finite:
        return number(Fraction(str(e)))
    if e is sympy.pi:
        return PI
    if e is sympy.E:
        return EULER
    if e.is_Add:
        return total(args)
    if e.is_Mul:
        return product(args)
    if isinstance(e, sympy.Pow):
        return power(args[0], args[1])
    name = type(e).__name__
    name = _FROM_SYMPY.get(name, name)
    if FUNCTIONS.get(name) == len(args) and (name == "sign" or name not in OWN):
        return call(name, *args)
    raise SpecError([Diagnostic(f"{e} has no counterpart in phigen", hint=f"known functions: {', '.join(FUNCTIONS)}")])


def to_sympy(e: Expression) -> Any:
    """The expression in sympy, e.g. for ``sympy.latex``; the symbol ``p:x`` becomes ``p_x``."""

    def visit(node: Expression, args: list[Any]) -> Any:
        match node.op:
            case "number":
                return sympy.Rational(node.value.numerator, node.value.denominator)
            case "symbol":
                return sympy.Symbol(plain(node.value).replace("λ_", "lambda_"), real=True)
            case "pi":
                return sympy.pi
            case "E":
                return sympy.E
            case "add":
                return args[0] + args[1]
            case "sub":
                return args[0] - args[1]
            case "neg":
                return -args[0]
            case "mul":
                return args[0] * args[1]
            case "pow":
                return args[0] ** sympy.Rational(node.value.numerator, node.value.denominator)
            case "power":
                return args[0] ** args[1]
        if node.op == "expm1":
            return sympy.exp(args[0]) - 1
        if node.op == "versin":
            return 1 - sympy.cos(args[0])
        if node.op == "log1p":
            return sympy.log(1 + args[0])
        if node.op == "inv":
            return 1 / args[0]
        if node.op in ENTIRE:
            return _entire(node.op, *args)
        if node.op in SPECIAL:
            return sympy.Function(r"\varphi" + "'" * order_of(node.op))(*args)
        return getattr(sympy, _TO_SYMPY.get(node.op, node.op))(*args)

    return fold([e], visit)[0]


def _entire(name: str, s: Any) -> Any:
    """A function of `ENTIRE`, as its closed form for s > 0."""
    root = sympy.sqrt(s)
    cos, sin, relative = sympy.cos(root), sympy.sin(root) / root, (sympy.exp(s) - 1) / s
    closed = {"cosroot": cos, "sinroot": sin, "sinroot1": (cos - sin) / (2 * s), "arcroot": (1 - sin) / s}
    return (closed | {"exprel": relative, "exprel1": (sympy.exp(s) - relative) / s})[name]


def system(
    coordinates: Sequence[Any],
    poisson: Any,
    hamiltonian: Any,
    parameters: Mapping[Any, Any] | None,
    casimirs: Mapping[str, Any] | None,
    invariants: Mapping[str, Any] | None,
    name: str,
) -> System:
    """See `System.from_sympy`."""
    names = tuple(_name(c) for c in coordinates)
    matrix = sympy.Matrix(poisson)
    rows = tuple(tuple(expression(matrix[i, j]) for j in range(matrix.cols)) for i in range(matrix.rows))
    given = tuple(_parameter(p, value) for p, value in (parameters or {}).items())
    formulas = {key: expression(e) for key, e in {**(casimirs or {}), **(invariants or {})}.items()}
    energy = expression(hamiltonian)
    _expect_known(names, given, [*(e for row in rows for e in row), energy, *formulas.values()])
    return build_system(
        name,
        names,
        given,
        MatrixForm(rows),
        energy,
        casimirs={key: formulas[key] for key in casimirs or {}},
        invariants={key: formulas[key] for key in invariants or {}},
    )


def _name(given: Any) -> str:
    return given if isinstance(given, str) else str(given.name)


def _parameter(given: Any, value: Any) -> Parameter:
    default = expression(value)
    if not default.is_number:
        raise SpecError([Diagnostic(f"parameter {_name(given)}: its default {value} is not a rational number")])
    positive = not isinstance(given, str) and given.is_positive is True
    return Parameter(_name(given), default.value, positive)


def _expect_known(names: Sequence[str], parameters: Sequence[Parameter], roots: Sequence[Expression]) -> None:
    everything = [*names, *(p.name for p in parameters)]
    doubled = sorted(n for n in set(everything) if everything.count(n) > 1)
    if doubled:
        raise SpecError([Diagnostic(f"{doubled[0]} is declared twice")])
    unknown = [s for s in symbols_of(*roots) if s not in everything]
    if unknown:
        raise SpecError([Diagnostic(f"unknown symbol {unknown[0]}: it is neither a coordinate nor a parameter")])
