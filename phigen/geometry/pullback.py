"""Poisson structures that a spec states in other coordinates y = ψ(x): the inverse of ψ, and π in the coordinates x."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.linear import inverse_matrix
from phigen.geometry.shapes import Matrix, skew
from phigen.spec.model import PullbackForm
from phigen.symbolic.expression import (
    ZERO,
    Expression,
    call,
    derivatives,
    power,
    substitute,
    symbol,
    symbols_of,
    topological,
    total,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.tower import Tower
from phigen.symbolic.verdict import decide_zero


@dataclass(frozen=True)
class Coordinates:
    """A change of coordinates y = ψ(x).

    ``forward`` is ψ as expressions in x, and ``backward`` is ψ⁻¹ as expressions in y. ``jacobian[i][a]`` is ∂x_i/∂y_a
    at y = ψ(x), as an expression in x.
    """

    forward: tuple[Expression, ...]
    backward: tuple[Expression, ...]
    jacobian: Matrix


def change_of_coordinates(form: PullbackForm, coordinates: Sequence[str]) -> Coordinates:
    """Return the change of coordinates of a ``pullback`` form, with the inverse of its map.

    Raises `SpecError` if the inverse in the spec is wrong, or if the spec has none and phigen finds none.
    """
    _expect_size(form, coordinates)
    backward = form.inverse or _inverse(form, coordinates)
    forward = dict(zip(form.coordinates, form.map, strict=True))
    composed = substitute(backward, forward)
    statement = decide_zero("inverse", [(c, e - symbol(c)) for c, e in zip(coordinates, composed, strict=True)])
    if not statement.holds:
        detail = f"{statement.detail}; residual {statement.residual}"
        raise SpecError(
            [Diagnostic(f"pullback: the functions under `inverse` are not the inverse of those under `map` ({detail})")]
        )
    columns = [derivatives(form.map, c) for c in coordinates]
    return Coordinates(form.map, backward, inverse_matrix([list(row) for row in zip(*columns, strict=True)]))


def pulled_back(form: PullbackForm, inner: Matrix, coordinates: Sequence[str]) -> Matrix:
    """Return π_ij = Σ ∂x_i/∂y_a {y_a, y_b} ∂x_j/∂y_b as functions of x; ``inner`` is the matrix {y_a, y_b}."""
    change = change_of_coordinates(form, coordinates)
    foreign = [s for s in symbols_of(*(e for row in inner for e in row)) if s in coordinates]
    if foreign:
        raise SpecError(
            [Diagnostic(f"pullback: the form depends on {foreign[0]}, which is not one of its coordinates")]
        )
    forward = dict(zip(form.coordinates, change.forward, strict=True))
    n = len(coordinates)
    inner_brackets = [substitute(row, forward) for row in inner]
    upper = {}
    for i in range(n):
        for j in range(i + 1, n):
            a, b = change.jacobian[i], change.jacobian[j]
            upper[i, j] = _simplified(total(a[k] * inner_brackets[k][m] * b[m] for k in range(n) for m in range(n)))
    return skew(upper, n)


def _expect_size(form: PullbackForm, coordinates: Sequence[str]) -> None:
    if len(form.coordinates) != len(coordinates):
        message = f"pullback: the map has {len(form.coordinates)} components for {len(coordinates)} coordinates"
        raise SpecError([Diagnostic(message)])


def _inverse(form: PullbackForm, coordinates: Sequence[str]) -> tuple[Expression, ...]:
    """Return x as a function of y. Each step solves one equation that contains a single unknown coordinate.

    Raises `SpecError` if no equation with a single unknown is left that phigen can solve.
    """
    of_affine = _of_affine_map(form, coordinates)
    if of_affine is not None:
        return of_affine
    left = dict(zip(form.coordinates, form.map, strict=True))
    solutions: dict[str, Expression] = {}
    while left:
        solution = _next_solved(left, solutions, coordinates)
        if solution is None:
            unknown = [c for c in coordinates if c not in solutions]
            raise SpecError(
                [
                    Diagnostic(
                        f"pullback: the map could not be inverted symbolically for {', '.join(unknown)}",
                        hint="give the other direction too, as inverse: {x1: …}",
                    )
                ]
            )
        y, x, value = solution
        solutions[x] = _simplified(value)
        del left[y]
    return tuple(solutions[c] for c in coordinates)


def _of_affine_map(form: PullbackForm, coordinates: Sequence[str]) -> tuple[Expression, ...] | None:
    """Return the inverse x = J⁻¹(y − ψ(0)) of the map y = ψ(x) if its Jacobian matrix J is constant, else None."""
    columns = [[_simplified(e) for e in derivatives(form.map, c)] for c in coordinates]
    if any(s in coordinates for s in symbols_of(*(e for column in columns for e in column))):
        return None
    origin = substitute(form.map, dict.fromkeys(coordinates, ZERO))
    shifted = [symbol(y) - e for y, e in zip(form.coordinates, origin, strict=True)]
    try:
        rows = inverse_matrix([list(row) for row in zip(*columns, strict=True)])
    except ZeroDivisionError:
        raise SpecError([Diagnostic("pullback: the map is not invertible, its Jacobian matrix is singular")]) from None
    return tuple(total(v * s for v, s in zip(row, shifted, strict=True)) for row in rows)


def _next_solved(
    left: Mapping[str, Expression], solutions: Mapping[str, Expression], coordinates: Sequence[str]
) -> tuple[str, str, Expression] | None:
    for y, e in left.items():
        (substituted,) = substitute([e], solutions)
        unknown = [c for c in coordinates if c not in solutions and c in symbols_of(substituted)]
        if len(unknown) == 1:
            value = _solved_for(substituted, symbol(y), unknown[0])
            if value is not None:
                return y, unknown[0], value
    return None


def _solved_for(e: Expression, value: Expression, x: str) -> Expression | None:
    """Return the solution x of the equation e(x) = value; None if phigen cannot solve it.

    An equation that is linear in x is solved directly. Otherwise the operations of e are inverted one after another.
    """
    slope = _simplified(derivatives([e], x)[0])
    if x not in symbols_of(slope):
        (constant,) = substitute([e], {x: ZERO})
        return (value - constant) / slope
    dependent = [a for a in e.args if x in symbols_of(a)]
    if len(dependent) != 1:
        return None
    argument = dependent[0]
    independent = [a for a in e.args if a is not argument]
    match e.op:
        case "add":
            return _solved_for(argument, value - independent[0], x)
        case "sub":
            right_side = value + independent[0] if e.args[0] is argument else independent[0] - value
            return _solved_for(argument, right_side, x)
        case "neg":
            return _solved_for(argument, -value, x)
        case "mul":
            return _solved_for(argument, value / independent[0], x)
        case "pow" if e.value == -1 or (e.value.numerator == 1 and e.value > 0):
            return _solved_for(argument, power(value, 1 / Fraction(e.value)), x)
        case op if op in FUNCTIONS and (inverse := FUNCTIONS[op].inverse):
            return _solved_for(argument, call(inverse, value), x)
    return None


def _simplified(e: Expression) -> Expression:
    """Return the normal form of an expression in its ring, or the expression itself if it has fewer operations."""
    tower = Tower(symbols_of(e), [e])
    return min(tower.expression(tower.convert(e)), e, key=lambda f: sum(1 for node in topological([f]) if node.args))
