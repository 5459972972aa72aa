"""Formulas of an implicit step: solve α(y, ∇S_h(y)) = x for y, then x' = x + (β − α)(y, ∇S_h(y)).

With a(y) = α(y, ∇S_h(y)) − y and d(y) = (β − α)(y, ∇S_h(y)), an iteration of Newton's method is

    J(y) δ = (y − x) + a(y),     y ← y − δ,     J = ∂_xα + ∂_pα · Hess S_h = I + a'(y).

To first order, the increment x' − x at the corrected y is d − M δ with M = d'(y). So after the last correction d need
not be evaluated again. If the equation y = x − a(y) is triangular, as for a one-sided realisation with a separable
Hamiltonian, it is solved by substitution, and the step is explicit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from phigen import progress
from phigen.scheme.generating import GeneratingFunction
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    sparse_derivatives,
    substitute,
    symbol,
    symbols_of,
    total_at,
)
from phigen.symbolic.symbols import momentum

Matrix = list[list[Expression]]
SparseRow = dict[int, Expression]


@dataclass(frozen=True)
class Linearised:
    """The vectors and matrices of a Newton iteration at y, with p = ∇S_h(y).

    ``displacement`` is α − y, and ``increment`` is β − α. ``jacobian`` is the Newton matrix J, the derivative of α with
    respect to y. ``increment_jacobian`` is the derivative of β − α with respect to y.
    """

    displacement: list[Expression]
    increment: list[Expression]
    jacobian: Matrix
    increment_jacobian: Matrix


def at_momenta(
    expressions: Sequence[Expression], coordinates: Sequence[str], slope: Sequence[Expression]
) -> list[Expression]:
    """Return the expressions with the momenta p replaced by ``slope``, which is ∇S_h."""
    return substitute(expressions, {momentum(c): g for c, g in zip(coordinates, slope, strict=True)})


def linearise(
    displacement: Sequence[Expression],
    increment: Sequence[Expression],
    coordinates: Sequence[str],
    generating: GeneratingFunction,
) -> Linearised:
    """Return α − y and β − α at p = ∇S_h(y) with their total derivatives with respect to y."""
    n = len(coordinates)
    # Components of p that are 0 are substituted first, which shortens the formulas: the H of a large system may depend
    # on few coordinates.
    absent: dict[str, Expression] = {
        momentum(c): ZERO for c, g in zip(coordinates, generating.slope, strict=True) if g.is_zero
    }
    maps = substitute([*displacement, *increment], absent)
    by_x = _rows(maps, coordinates)
    by_p = _rows(maps, [momentum(c) for c in coordinates])
    expressions = [*maps, *(e for row in (*by_x, *by_p) for e in row.values())]
    values = at_momenta(expressions, coordinates, generating.slope)
    slopes = iter(values[2 * n :])
    by_x, by_p = ([{j: next(slopes) for j in row} for row in rows] for rows in (by_x, by_p))
    hessian = [{j: e for j, e in enumerate(row) if not e.is_zero} for row in generating.hessian]
    jacobians = []
    with progress.stage("Newton matrix", 2 * n) as running:
        for x_part, p_part in zip(by_x, by_p, strict=True):
            jacobians.append(_total_derivative_row(x_part, p_part, hessian))
            running.done += 1
    jacobian = [[e + (ONE if i == j else ZERO) for j, e in enumerate(row)] for i, row in enumerate(jacobians[:n])]
    return Linearised(values[:n], values[n : 2 * n], jacobian, jacobians[n:])


def _rows(expressions: Sequence[Expression], names: Sequence[str]) -> list[SparseRow]:
    """Return the nonzero derivatives of each expression with respect to ``names``: index of the name → derivative."""
    index = {name: j for j, name in enumerate(names)}
    return [{index[name]: d for name, d in row.items()} for row in sparse_derivatives(expressions, names)]


def _total_derivative_row(x_part: SparseRow, p_part: SparseRow, hessian: Sequence[SparseRow]) -> list[Expression]:
    """Return a row of ∂_x f + ∂_p f · Hess S_h, the derivative of a map f(x, ∇S_h(x)).

    ``x_part`` is the same row of ∂_x f, and ``p_part`` is the same row of ∂_p f.
    """
    n = len(hessian)
    products: list[SparseRow] = [{} for _ in range(n)]
    for k, e in p_part.items():
        for j, curvature in hessian[k].items():
            products[j][k] = e * curvature
    return [x_part.get(j, ZERO) + total_at(products[j]) for j in range(n)]


def explicit_order(displacement: Sequence[Expression], coordinates: Sequence[str]) -> list[int] | None:
    """Return the order in which substitution solves the equations y_i = x_i − a_i(y) for the y_i, or None.

    The order lists the indices i. There is none if the equations depend on one another in a cycle. ``displacement`` is
    a(y).
    """
    index = {c: i for i, c in enumerate(coordinates)}
    graph = {i: [index[s] for s in symbols_of(a) if s in index] for i, a in enumerate(displacement)}
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError:
        return None


def explicit_increment(
    displacement: Sequence[Expression],
    increment: Sequence[Expression],
    coordinates: Sequence[str],
    order: Sequence[int],
) -> list[Expression]:
    """Return the increment of an explicit step as a function of x.

    The equation y = x − a(y), where a is ``displacement``, is solved by substitution, one component of y after another.
    ``order`` lists the indices of the components.
    """
    solutions: dict[str, Expression] = {}
    for i in order:
        (shift,) = substitute([displacement[i]], solutions)
        solutions[coordinates[i]] = symbol(coordinates[i]) - shift
    return substitute(increment, solutions)
