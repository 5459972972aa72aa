"""Assembly of the one-step map: solve α(y, ∇S_h(y)) = x for y, then x' = x + (β − α)(y, ∇S_h(y)).

With a(y) = α(y, ∇S_h(y)) − y and d(y) = (β − α)(y, ∇S_h(y)) a Newton step is

    J(y) δ = (y − x) + a(y),     y ← y − δ,     J = ∂_xα + ∂_pα · Hess S_h = I + a'(y),

and the increment at the corrected y is d − M δ to first order, M = d'(y): the last correction costs no
second evaluation. Where the equation y = x − a(y) is triangular (a one-sided realisation with a separable
Hamiltonian), it is solved by substitution and the step is explicit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from phigen.scheme.generating import GeneratingFunction
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    derivatives,
    substitute,
    symbol,
    symbols_of,
    total,
)
from phigen.symbolic.symbols import momentum

Matrix = list[list[Expression]]


@dataclass(frozen=True)
class Linearised:
    """What one Newton iteration needs at y: a, d (n), J, M (n×n)."""

    displacement: list[Expression]
    increment: list[Expression]
    jacobian: Matrix
    increment_jacobian: Matrix


def at_momenta(
    expressions: Sequence[Expression], coordinates: Sequence[str], slope: Sequence[Expression]
) -> list[Expression]:
    """The expressions with the covector p put equal to ∇S_h."""
    return substitute(expressions, {momentum(c): g for c, g in zip(coordinates, slope, strict=True)})


def linearise(
    displacement: Sequence[Expression],
    increment: Sequence[Expression],
    coordinates: Sequence[str],
    generating: GeneratingFunction,
) -> Linearised:
    """a, d and their total derivatives along y, with p = ∇S_h(y)."""
    n = len(coordinates)
    both = [*displacement, *increment]
    by_x = _columns(both, coordinates)
    by_p = _columns(both, [momentum(c) for c in coordinates])
    flat = [*both, *(e for row in by_x for e in row), *(e for row in by_p for e in row)]
    flat = at_momenta(flat, coordinates, generating.slope)
    values, flat = flat[: 2 * n], flat[2 * n :]
    x_part = [flat[i * n : (i + 1) * n] for i in range(2 * n)]
    p_part = [flat[(2 * n + i) * n : (2 * n + i + 1) * n] for i in range(2 * n)]
    hessian = generating.hessian
    jacobians = [
        [x_part[i][j] + total(p_part[i][k] * hessian[k][j] for k in range(n)) for j in range(n)] for i in range(2 * n)
    ]
    jacobian = [[e + (ONE if i == j else ZERO) for j, e in enumerate(row)] for i, row in enumerate(jacobians[:n])]
    return Linearised(values[:n], values[n:], jacobian, jacobians[n:])


def _columns(expressions: Sequence[Expression], names: Sequence[str]) -> Matrix:
    columns = [derivatives(expressions, name) for name in names]
    return [[column[i] for column in columns] for i in range(len(expressions))]


def explicit_order(displacement: Sequence[Expression], coordinates: Sequence[str]) -> list[int] | None:
    """An order in which y_i = x_i − a_i(y) can be solved by substitution, or None if there is a cycle."""
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
    """The increment as a function of x, the equation for y having been solved in the given order."""
    solved: dict[str, Expression] = {}
    for i in order:
        (shift,) = substitute([displacement[i]], solved)
        solved[coordinates[i]] = symbol(coordinates[i]) - shift
    return substitute(increment, solved)
