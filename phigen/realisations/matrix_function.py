"""Evaluation of a rational function of a matrix P, such as (1 + P/2)/(1 − P/2), to a matrix of expressions."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from phigen.geometry.linear import inverse_matrix
from phigen.realisations.protocol import refuse
from phigen.symbolic.arithmetic import Arithmetic
from phigen.symbolic.expression import ONE, ZERO, Expression, add, rebuild, sub, total

Matrix = list[list[Expression]]


def identity(size: int) -> Matrix:
    """Return the identity matrix."""
    return [[ONE if r == c else ZERO for c in range(size)] for r in range(size)]


def multiplied(a: Matrix, b: Matrix) -> Matrix:
    """Return the product of two matrices of expressions, computed without terms that are 0."""
    columns = list(zip(*b, strict=True))
    return [[total(u * v for u, v in zip(row, column, strict=True)) for column in columns] for row in a]


class MatrixFunction(Arithmetic[Matrix]):
    """Evaluation of an expression at a matrix P. A number or parameter c in the expression stands for the
    matrix c·1.

    All values are functions of P and therefore commute, so left and right quotients are equal.
    """

    def __init__(self, argument: Matrix, name: str) -> None:
        """Prepare the evaluation at the matrix ``argument``, for which the symbol ``name`` stands in expressions."""
        self._argument, self._size, self._name = argument, len(argument), name

    def visit(self, node: Expression, args: list[Matrix]) -> Matrix:
        """Return the value of a node from the values of its arguments, which are matrices. Raises `SpecError` for
        functions that are not rational.
        """
        if node.op == "symbol" and node.value == self._name:
            return self._argument
        if all(self._is_scalar(a) for a in args) and node.op not in ("add", "sub", "neg", "mul"):
            return self._scaled(rebuild(node, [a[0][0] for a in args]))
        match node.op:  # matrices are lists of rows, without operators
            case "add":
                return _entrywise(add, args[0], args[1])
            case "sub":
                return _entrywise(sub, args[0], args[1])
            case "neg":
                return [[-v for v in row] for row in args[0]]
            case "mul":
                return multiplied(args[0], args[1])
        return super().visit(node, args)

    def power(self, base: Matrix, exponent: Fraction) -> Matrix:
        """Return an integer power of a matrix."""
        return self._power(base, int(exponent)) if exponent.denominator == 1 else self.function("pow", [base])

    def function(self, name: str, args: list[Matrix]) -> Matrix:
        """Raise `SpecError`, since elementary functions of a matrix are not rational."""
        raise refuse(
            f"birealisation group-map: tau uses {name} of a matrix; it must be a rational function of P",
            "use kind: exponential for τ = exp(P), or write tau as a matrix of entries",
        )

    def _power(self, base: Matrix, n: int) -> Matrix:
        if n < 0:
            try:
                base, n = [list(row) for row in inverse_matrix(base)], -n
            except ZeroDivisionError:
                raise refuse("birealisation group-map: tau divides by a matrix that is singular for all p") from None
        result = base
        for _ in range(n - 1):
            result = multiplied(result, base)
        return result

    def _scaled(self, e: Expression) -> Matrix:
        return [[e if r == c else ZERO for c in range(self._size)] for r in range(self._size)]

    def _is_scalar(self, m: Matrix) -> bool:
        return all(v.is_zero if r != c else v is m[0][0] for r, row in enumerate(m) for c, v in enumerate(row))


def _entrywise(combine: Callable[[Expression, Expression], Expression], a: Matrix, b: Matrix) -> Matrix:
    return [[combine(u, v) for u, v in zip(row, other_row, strict=True)] for row, other_row in zip(a, b, strict=True)]
