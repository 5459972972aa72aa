"""Evaluation of expressions in any kind of arithmetic: numbers, arrays, intervals, elements of a ring."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from phigen.symbolic.expression import Expression, topological

T = TypeVar("T")

#: An empty table. It is the default of `Arithmetic.values`: no values are known before the evaluation.
NOTHING: Mapping[int, Any] = MappingProxyType({})


class Arithmetic(Generic[T]):
    """Base class of the kinds of arithmetic. Expressions are evaluated to values of type T, which has ``+`` and
    ``-``.
    """

    def constant(self, value: Fraction) -> T:
        """Return a rational number as a value of type T."""
        raise NotImplementedError

    def variable(self, name: str) -> T:
        """Return the value of the symbol ``name``."""
        raise NotImplementedError

    def product(self, a: T, b: T) -> T:
        """Return the product of two values."""
        return a * b  # type: ignore[operator, no-any-return]

    def power(self, base: T, exponent: Fraction) -> T:
        """Return a rational power of a value."""
        raise NotImplementedError

    def function(self, name: str, args: list[T]) -> T:
        """Return the value of the function ``name`` at the arguments ``args``.

        The names are those of `phigen.symbolic.functions.FUNCTIONS`. The constants ``pi`` and ``E`` count as functions
        without arguments.
        """
        raise NotImplementedError

    def visit(self, node: Expression, args: list[Any]) -> T:
        """Return the value of a node; ``args`` are the values of its arguments."""
        match node.op:
            case "number":
                return self.constant(node.value)
            case "symbol":
                return self.variable(node.value)
            case "add":
                return args[0] + args[1]  # type: ignore[no-any-return]
            case "sub":
                return args[0] - args[1]  # type: ignore[no-any-return]
            case "neg":
                return -args[0]  # type: ignore[no-any-return]
            case "mul":
                return self.product(args[0], args[1])
            case "pow":
                return self.power(args[0], node.value)
        return self.function(node.op, args)

    def values(self, roots: Sequence[Expression], computed: Mapping[int, T] = NOTHING) -> list[T]:
        """Return the values of expressions.

        A shared node is computed once; its value is dropped after its last use. ``computed`` maps the ``id`` of nodes
        to known values; nodes that are needed only to compute these values are not visited.
        """
        order = topological(roots, computed)
        uses = Counter(id(a) for node in order for a in node.args)
        uses.update(map(id, roots))
        values = {i: computed[i] for i in uses if i in computed} if computed else {}
        for node in order:
            values[id(node)] = self.visit(node, [values[id(a)] for a in node.args])
            for a in node.args:
                uses[id(a)] -= 1
                if not uses[id(a)]:
                    del values[id(a)]
        return [values[id(r)] for r in roots]
