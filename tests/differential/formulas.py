"""Random formulas as sympy expressions, their text in specs, and NumPy functions that evaluate them.

This module imports nothing of phigen; derivatives are computed by sympy.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy

Expr = sympy.Expr
Symbol = sympy.Symbol

#: Symbol of the time in all random systems.
TIME = Symbol("t")


def text(expression: Expr) -> str:
    """Return a formula as text in the syntax of specs."""
    return str(sympy.sstr(expression))


def symbols(names: Iterable[str]) -> tuple[Symbol, ...]:
    """Return symbols without assumptions such as real=True, as sympy treats symbols with different assumptions as
    different.
    """
    return tuple(Symbol(name) for name in names)


def small(source: random.Random) -> sympy.Rational:
    """Return a random rational between −3 and 3 that is not 0."""
    return sympy.Rational(source.choice([-3, -2, -1, 1, 2, 3]), source.choice([1, 2, 3]))


def bounded(source: random.Random, argument: Expr) -> Expr:
    """Return a random function of the argument that is smooth on the whole line and has moderate derivatives."""
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
    """Return a random product of 1 to ``degree`` of the symbols."""
    product = sympy.Integer(1)
    for _ in range(source.randint(1, degree)):
        product *= source.choice(list(among))
    return product


def linear(source: random.Random, among: Sequence[Symbol]) -> Expr:
    """Return a random linear combination of one or two of the symbols."""
    chosen = source.sample(list(among), min(len(among), source.randint(1, 2)))
    return sympy.Add(*(small(source) * v for v in chosen))


def numeric(expressions: Sequence[Expr], arguments: Sequence[Symbol]) -> Callable[..., list[Any]]:
    """Return a function that evaluates the expressions by NumPy, for arguments that are numbers or arrays."""
    stand_ins = [Symbol(f"v{k}") for k in range(len(arguments))]
    renamed = dict(zip(arguments, stand_ins, strict=True))
    return sympy.lambdify(stand_ins, [sympy.sympify(e).xreplace(renamed) for e in expressions], "numpy", cse=True)


def gradient(expression: Expr, along: Sequence[Symbol]) -> list[Expr]:
    """Return the derivatives of an expression along symbols."""
    return [sympy.diff(expression, v) for v in along]


def values_of(expression: Expr, numbers: Mapping[str, Any]) -> Any:
    """Return the value of an expression; ``numbers`` has numbers or arrays as values of its symbols."""
    names = sorted(str(s) for s in expression.free_symbols)
    (value,) = numeric([expression], symbols(names))(*(numbers[name] for name in names))
    return np.asarray(value, dtype=float)
