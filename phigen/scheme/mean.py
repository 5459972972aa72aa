"""Derivatives of the ends of a path with respect to its mean y, from those with respect to its middle m.

The runtime computes a path as a Taylor series about its middle. Let the path take the time from −1 to 1 under the
covector p/2, so that it starts at α and ends at β. If ``even`` and ``odd`` are the sums over the even and the odd terms
of its Taylor series, then α = even − odd and β − α = 2 odd. The same relations hold for derivatives. Each sum of
derivatives is an n×2n matrix: first the derivatives with respect to m, then those with respect to p.
"""

from __future__ import annotations

from collections.abc import Sequence

from phigen.scheme.elimination import inversion
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.step import Matrix
from phigen.symbolic.expression import ONE, ZERO, Expression, substitute, symbol, total
from phigen.symbolic.symbols import Symbol


def along_mean(n: int) -> Kernel:
    """Return the kernel that differentiates α and β − α with respect to the mean y of a path with n
    coordinates.

    Let m be the middle of the path. The inputs of the kernel are Hess S_h, and the derivatives of three functions of m
    and p: ``even`` and ``odd``, which the text of this module defines, and the mean of the path. Let M and N be the
    derivatives of the mean with respect to m and p. For fixed p, the derivative of m with respect to y is M⁻¹. If p =
    ∇S_h(y) varies with y, the derivative of m is M⁻¹ (1 − N Hess S_h).
    """
    inputs = {name: tuple(Symbol(name, i) for i in range(2 * n * n)) for name in ("even", "odd", "mean")}
    inputs["hessian"] = tuple(Symbol("hessian", i) for i in range(n * n))
    hessian = _matrix([symbol(s) for s in inputs["hessian"]], n, n, 0)
    even, odd, mean = ([symbol(s) for s in inputs[name]] for name in ("even", "odd", "mean"))
    start, difference = [a - b for a, b in zip(even, odd, strict=True)], [2 * b for b in odd]
    inverse, reciprocals = _inverse(_matrix(mean, n, 2 * n, 0))
    follows = _times(inverse, _plus(_identity(n), _times(_matrix(mean, n, 2 * n, n), hessian), -1))
    path_rows, mean_rows = [], []
    for value in (start, difference):
        by_m, by_p = _matrix(value, n, 2 * n, 0), _matrix(value, n, 2 * n, n)
        path_rows.append(_times(by_m, inverse))
        mean_rows.append(_plus(_times(by_m, follows), _times(by_p, hessian)))
    named_rows = zip(
        ("alpha_y", "increment_y", "jacobian", "increment_jacobian"), (*path_rows, *mean_rows), strict=True
    )
    outputs = [Output(name, tuple(e for row in matrix for e in row)) for name, matrix in named_rows]
    purpose = "derivatives of alpha and beta - alpha with respect to the mean of a path"
    return Kernel("along_mean", purpose, inputs, (*outputs, Output("reciprocal", tuple(reciprocals))))


def _matrix(values: Sequence[Expression], n: int, width: int, first: int) -> Matrix:
    return [[values[i * width + first + j] for j in range(n)] for i in range(n)]


def _identity(n: int) -> Matrix:
    return [[ONE if i == j else ZERO for j in range(n)] for i in range(n)]


def _plus(a: Matrix, b: Matrix, sign: int = 1) -> Matrix:
    return [[x + y if sign > 0 else x - y for x, y in zip(r, q, strict=True)] for r, q in zip(a, b, strict=True)]


def _times(a: Matrix, b: Matrix) -> Matrix:
    return [[total(x * r[j] for x, r in zip(row, b, strict=True)) for j in range(len(b))] for row in a]


def _inverse(a: Matrix) -> tuple[Matrix, list[Expression]]:
    n = len(a)
    inverse, reciprocals = inversion([[True] * n] * n)
    values: dict[str, Expression] = {Symbol("J", i, j): a[i][j] for i in range(n) for j in range(n)}
    substituted = substitute([*inverse, *reciprocals], values)
    return _matrix(substituted, n, n, 0), substituted[n * n :]
