"""The generating function S_h = Σ h^i S_i as formulas: its gradient and Hessian in the cheapest form.

Two forms are compared by their operation counts. *Collected*: S_h is one polynomial in coordinates and function values,
with coefficients that depend only on parameters and h. ``prepare`` computes these coefficients once, for all orders in
h together. Each derivative is evaluated in nested Horner form. *Graph*: the recursion for the S_i is not expanded, but
differentiated as a graph of shared sub-expressions. In low dimension the collected form is much cheaper; in high
dimension its expansion is too large.
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
    """The generating function of a step as expressions: ``slope`` is ∇S_h and ``hessian`` the full n×n matrix
    Hess S_h.

    ``form`` says in words how the expressions are written, for instance as polynomials. ``terms`` is the number of
    terms of a polynomial. ``coefficients`` is the table of the symbols ``c:k`` in the expressions. The table includes
    coefficients that every step computes anew. For a monitored system, ``elapsed`` is the duration of a step, ∂S_h/∂e
    with the energy level e. If the spec has a force field ζ, which is added to ∇H, then ``slope`` is ∇S_h + hζ, and
    ``free`` is ∇S_h.
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
        """The covector p from which the rotation of a body is computed. Forces do not contribute to p: they change only
        the momentum.
        """
        return self.free or self.slope

    def pushed(self, push: Sequence[Expression], coordinates: Sequence[str]) -> GeneratingFunction:
        """Return the function with p = ∇S_h + ``push`` in place of ∇S_h, and with the derivatives of p in place of the
        Hessian.

        The covector field ``push`` is no gradient in general. The matrix in place of the Hessian is then not symmetric.
        """
        columns = [derivatives(push, c) for c in coordinates]
        slope = tuple(s + z for s, z in zip(self.slope, push, strict=True))
        rows = [[e + columns[j][i] for j, e in enumerate(row)] for i, row in enumerate(self.hessian)]
        return replace(self, slope=slope, hessian=tuple(map(tuple, rows)))

    def cost(self) -> int:
        """Return the cost of one evaluation of gradient and Hessian, in units of an addition. Values that do not depend
        on the state are not counted.
        """
        return self._cost

    @cached_property
    def _cost(self) -> int:
        roots = [*self.slope, *(e for i, row in enumerate(self.hessian) for e in row[i:])]
        return cost(self.coefficients.hoist(roots))


def collected_form(
    series: PolynomialSeries,
    coordinates: Sequence[str],
    static: Sequence[str],
    other_cost: int,
    times: Sequence[str] = (),
    increments: Sequence[str] = (),
) -> list[GeneratingFunction]:
    """Return S_h as a collected polynomial: a list of at most two forms.

    In the first form each entry of the Hessian is a polynomial. In the second form the Hessian is the derivative of the
    Horner form of the gradient. ``increments`` are the symbols of noise increments, on which coefficients may depend.
    ``other_cost`` is the cost of another form of S_h, in units of an addition. The list is empty if the number of
    monomials is much larger than ``other_cost``, or if the number of exponents exceeds `limits.CELLS`. Raises
    `OverflowError` if the polynomial is too large to be counted.
    """
    tower, n = series.tower, len(coordinates)
    h = tower.variable(STEP)
    s = tower.combine(term * h ** (i + 1) for i, term in enumerate(series.terms))
    other_cost = max(other_cost, 200)
    if len(s) > 10 * other_cost:  # terms may share a monomial in the coordinates, but rarely ten of them
        return []
    slopes = tower.gradient(s, coordinates)
    if cells(tower, [s, *slopes]) > limits.CELLS or exceeds(tower, slopes, coordinates, min(other_cost, MOST_SLOPES)):
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
    """Return the gradient and the Hessian of S_h as graphs with shared sub-expressions.

    One reverse sweep over the graph of S_h gives the gradient. For each component of the gradient, a reverse sweep over
    the graph of this component gives a row of the Hessian.
    ``inputs`` are symbols that change from step to step, such as the time. Raises `OverflowError` as soon as the
    derivatives have more operations than one kernel may have.
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
    """Return the covector p = τg(∇H + ζ) and its derivatives, for a system with a monitor g and forces. The step uses p
    in place of ∇S_h.

    τ is the step size in the time of the monitor, and ζ is the covector force. p is not a gradient, and does not depend
    on the energy level e.
    """
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
    """Return the full symmetric matrix from its upper triangle: entry (i, j) is ``rows[i][j - i]`` for j ≥ i."""
    n = len(rows)
    return tuple(tuple(rows[min(i, j)][abs(i - j)] for j in range(n)) for i in range(n))
