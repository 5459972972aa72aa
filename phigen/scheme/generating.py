"""The generating function S_h = Σ h^i S_i as code: gradient and Hessian in the cheapest form.

Two forms are compared by their operation counts. *Collected*: S_h is one polynomial in coordinates and function values,
whose coefficients depend on parameters and h only. ``prepare`` combines all orders into one set of numbers, and each
derivative is a nested Horner form. *Graph*: the recursion is not expanded, and is differentiated as a graph. In low
dimension collected polynomials are much cheaper; in high dimension their expansion is too large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from phigen import progress
from phigen.geometry.system import System
from phigen.scheme.collected import cells, collect, exceeds
from phigen.scheme.lowering import cost
from phigen.scheme.staging import Coefficients
from phigen.series.hamilton_jacobi import MOST_SLOPES, PolynomialSeries
from phigen.spec import limits
from phigen.symbolic.expression import Expression, derivatives, gradient, symbol, total
from phigen.symbolic.symbols import LEVEL, STEP


@dataclass(frozen=True)
class GeneratingFunction:
    """∇S_h (``slope``) and Hess S_h (``hessian``, full n×n) as expressions; ``form`` names the form in which they are
    written.

    ``coefficients`` is the table of their symbols ``c:k``, including coefficients that are renewed in every step. For a
    monitored system, ``elapsed`` is ∂S_h/∂e, the time that a step takes. With forces, ``free`` is p without the forces.
    """

    slope: tuple[Expression, ...]
    hessian: tuple[tuple[Expression, ...], ...]
    form: str
    terms: int
    coefficients: Coefficients
    elapsed: Expression | None = None
    free: tuple[Expression, ...] = ()

    @property
    def turning(self) -> tuple[Expression, ...]:
        """The covector that rotates a body: p without the forces, which change only the momentum of the body."""
        return self.free or self.slope

    def pushed(self, push: Sequence[Expression], coordinates: Sequence[str]) -> GeneratingFunction:
        """Return the function with p = ∇S_h + ``push``, a covector field; the Hessian is then not symmetric in
        general."""
        columns = [derivatives(push, c) for c in coordinates]
        slope = tuple(s + z for s, z in zip(self.slope, push, strict=True))
        rows = [[e + columns[j][i] for j, e in enumerate(row)] for i, row in enumerate(self.hessian)]
        return replace(self, slope=slope, hessian=tuple(map(tuple, rows)))

    def cost(self) -> int:
        """Return the cost of one evaluation of gradient and Hessian, with state-independent values computed before."""
        return self._cost

    @cached_property
    def _cost(self) -> int:
        roots = [*self.slope, *(e for i, row in enumerate(self.hessian) for e in row[i:])]
        return cost(self.coefficients.hoist(roots))


def collected_form(
    series: PolynomialSeries,
    coordinates: Sequence[str],
    static: Sequence[str],
    worth: int,
    times: Sequence[str] = (),
    increments: Sequence[str] = (),
) -> list[GeneratingFunction]:
    """Return two collected forms: with the Hessian collected entry by entry, and with the Hessian by differentiation.

    ``increments`` are inputs of a step that the series does not contain, in addition to the time. The list is empty if
    a gradient of one operation per term would cost more than ``worth``, or if the monomials would need more than
    `limits.CELLS`. Raises `OverflowError` if the polynomial is too large to be counted.
    """
    tower, n = series.tower, len(coordinates)
    h = tower.variable(STEP)
    s = tower.combine(term * h ** (i + 1) for i, term in enumerate(series.terms))
    worth = max(worth, 200)
    if len(s) > 10 * worth:  # terms share monomials in the coordinates, but rarely ten terms share one
        return []
    slopes = tower.gradient(s, coordinates)
    if cells(tower, [s, *slopes]) > limits.CELLS or exceeds(tower, slopes, coordinates, min(worth, MOST_SLOPES)):
        return []
    monitored = [tower.partial(s, LEVEL)] if LEVEL in static else []
    ring, (terms, *elapsed) = collect(tower, [s, *monitored], coordinates, times)
    first = [ring.derivative(terms, j) for j in range(n)]
    forms, both_affordable = [], sum(ring.cells(first[i], j) for j in range(n) for i in range(j + 1)) <= limits.CELLS
    for entrywise in (True, False) if both_affordable else (False,):
        table = Coefficients(static, [*times, *increments])
        slope = tuple(ring.expression(g, table) for g in first)
        if entrywise:
            rows: list[list[Expression]] = []
            with progress.stage("Hessian of the polynomial", n) as running:
                for i in range(n):
                    rows.append([ring.expression(ring.derivative(first[i], j), table) for j in range(i, n)])
                    running.done = i + 1
            hessian = _symmetric(rows)
        else:
            hessian = _differentiated(slope, coordinates)
        duration = ring.expression(elapsed[0], table) if elapsed else None
        forms.append(GeneratingFunction(slope, hessian, "collected polynomial", len(terms), table, duration))
    return forms


def graph_form(
    series: Sequence[Expression], coordinates: Sequence[str], static: Sequence[str], inputs: Sequence[str] = ()
) -> GeneratingFunction:
    """Return the gradient by one reverse sweep over the shared graph, and the Hessian by one sweep for each row.

    ``inputs`` are inputs of a step, such as the time. Raises `OverflowError` as soon as the derivatives exceed the
    budget of one kernel.
    """
    h = symbol(STEP)
    s = total(h ** (i + 1) * term for i, term in enumerate(series) if not term.is_zero)
    slope = tuple(gradient(s, coordinates))
    rows: list[list[Expression]] = []
    with progress.stage("Hessian of the graph", len(coordinates)) as running:
        for i in range(len(coordinates)):
            if not i & (i - 1) and cost([*slope, *(e for row in rows for e in row)]) > limits.OPERATIONS:
                raise OverflowError(f"more than {limits.OPERATIONS} operations for a part of the Hessian")
            rows.append(gradient(slope[i], coordinates[i:]))  # one reverse sweep for each row
            running.done = i + 1
    elapsed = derivatives([s], LEVEL)[0] if LEVEL in static else None
    return GeneratingFunction(slope, _symmetric(rows), "shared graph", 0, Coefficients(static, inputs), elapsed)


def forced_form(
    system: System, monitor: Expression, static: Sequence[str], inputs: Sequence[str] = ()
) -> GeneratingFunction:
    """Return p = τg(∇H + ζ) of a monitored system with forces, which is not a gradient and does not depend on e."""
    assert system.forces is not None
    rate = symbol(STEP) * monitor
    slope = gradient(system.hamiltonian, system.coordinates)
    pushed = tuple(rate * (s + z) for s, z in zip(slope, system.forces.covector, strict=True))
    columns = [derivatives(pushed, c) for c in system.coordinates]
    hessian = tuple(zip(*columns, strict=True))
    form, table = "its gradient times g", Coefficients(static, inputs)
    return GeneratingFunction(pushed, hessian, form, 0, table, rate, tuple(rate * s for s in slope))


def _differentiated(slope: Sequence[Expression], coordinates: Sequence[str]) -> tuple[tuple[Expression, ...], ...]:
    columns = [derivatives(slope[: j + 1], c) for j, c in enumerate(coordinates)]
    n = len(coordinates)
    return tuple(tuple(columns[max(i, j)][min(i, j)] for j in range(n)) for i in range(n))


def _symmetric(rows: Sequence[Sequence[Expression]]) -> tuple[tuple[Expression, ...], ...]:
    """Return the full symmetric matrix of upper-triangular rows: entry (i, j) is ``rows[i][j - i]`` for j ≥ i."""
    n = len(rows)
    return tuple(tuple(rows[min(i, j)][abs(i - j)] for j in range(n)) for i in range(n))
