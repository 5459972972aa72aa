"""Random formulas as sympy expressions, their text in a spec, and functions of NumPy that evaluate them.

Nothing here uses phigen: the derivatives are those of sympy.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy

Expr = sympy.Expr
Symbol = sympy.Symbol

#: The name of the time in all drawn systems.
TIME = Symbol("t")


def text(expression: Expr) -> str:
    """Return a formula as a spec has it."""
    return str(sympy.sstr(expression))


def symbols(names: Iterable[str]) -> tuple[Symbol, ...]:
    """Return symbols without assumptions, so that equal names are equal symbols."""
    return tuple(Symbol(name) for name in names)


def small(source: random.Random) -> sympy.Rational:
    """Return a rational between −3 and 3 that is not 0."""
    return sympy.Rational(source.choice([-3, -2, -1, 1, 2, 3]), source.choice([1, 2, 3]))


def bounded(source: random.Random, argument: Expr) -> Expr:
    """Return a function of an argument that is smooth on the whole line, and grows slowly."""
    shapes: list[Callable[[Expr], Expr]] = [
        sympy.sin,
        sympy.cos,
        sympy.tanh,
        sympy.atan,
        lambda z: sympy.exp(-(z**2)),
        lambda z: sympy.sqrt(1 + z**2),
        lambda z: 1 / (2 + z**2),
        lambda z: sympy.log(2 + z**2),
        lambda z: sympy.exp(z / 3),
    ]
    return source.choice(shapes)(argument)


def monomial(source: random.Random, among: Sequence[Symbol], degree: int) -> Expr:
    """Return a product of up to ``degree`` symbols."""
    product = sympy.Integer(1)
    for _ in range(source.randint(1, degree)):
        product *= source.choice(list(among))
    return product


def linear(source: random.Random, among: Sequence[Symbol]) -> Expr:
    """Return a combination of one or two symbols."""
    chosen = source.sample(list(among), min(len(among), source.randint(1, 2)))
    return sympy.Add(*(small(source) * v for v in chosen))


def numeric(expressions: Sequence[Expr], arguments: Sequence[Symbol]) -> Callable[..., list[Any]]:
    """Return a function of NumPy with the values of expressions, for arguments that are numbers or arrays."""
    stand_ins = [Symbol(f"v{k}") for k in range(len(arguments))]
    renamed = dict(zip(arguments, stand_ins, strict=True))
    return sympy.lambdify(stand_ins, [sympy.sympify(e).xreplace(renamed) for e in expressions], "numpy", cse=True)


def gradient(expression: Expr, along: Sequence[Symbol]) -> list[Expr]:
    """Return the derivatives of an expression."""
    return [sympy.diff(expression, v) for v in along]


def values_of(expression: Expr, numbers: Mapping[str, Any]) -> Any:
    """Return the value of an expression where its symbols are numbers or arrays."""
    names = sorted(str(s) for s in expression.free_symbols)
    (value,) = numeric([expression], symbols(names))(*(numbers[name] for name in names))
    return np.asarray(value, dtype=float)
