"""Gaussian elimination without pivoting, as straight-line code, for matrices with a known pattern of zeros.

The Newton matrix is I + O(h), so its pivots are near 1. The step checks them, and falls back to elimination with
pivoting. The pivots are taken from the diagonal in the order of least degree (Markowitz), so that few zeros of the
matrix become nonzero during elimination; this matters for lattices and trees.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phigen import progress
from phigen.scheme.lowering import COST
from phigen.symbolic.expression import ZERO, Expression, symbol, total
from phigen.symbolic.symbols import Symbol

#: pattern[i][j] says whether entry (i, j) of a matrix may differ from zero. Diagonal entries always may.
Pattern = Sequence[Sequence[bool]]


def pivot_order(pattern: Pattern) -> list[int]:
    """Return the order of the diagonal pivots.

    The next pivot is the one for which (entries in its row)·(entries in its column) of the remaining matrix is
    smallest. If several pivots are equal in this respect, the first of them is taken.
    """
    return [k for k, _ in _pivots(pattern)]


def operations(pattern: Pattern) -> int:
    """Return the cost of `factorise` and `Factors.solved`, in units of an addition, without building any expression."""
    return sum(price for _, price in _pivots(pattern))


def _pivots(pattern: Pattern) -> Iterator[tuple[int, int]]:
    """Yield the index of each pivot in the order of elimination, with the cost of eliminating it."""
    n = len(pattern)
    rows = [{j for j in range(n) if pattern[i][j] and j != i} for i in range(n)]
    columns = [{i for i in range(n) if pattern[i][j] and j != i} for j in range(n)]
    remaining = set(range(n))
    while remaining:
        k = min(remaining, key=lambda k: (len(rows[k]) * len(columns[k]), k))
        remaining.remove(k)
        column_length, row_length = len(columns[k]), len(rows[k])
        fill_in = sum(len(rows[k] - rows[i] - {i}) for i in columns[k])  # an entry that was 0 needs no subtraction
        yield (
            k,
            COST["reciprocal"] + column_length * (1 + 2 * row_length) - fill_in + 2 * (column_length + row_length) + 1,
        )
        for i in columns[k]:
            rows[i] = (rows[i] | rows[k]) - {i, k}
        for j in rows[k]:
            columns[j] = (columns[j] | columns[k]) - {j, k}


@dataclass(frozen=True)
class Factors:
    """Factors L and U of a matrix P L U Pᵀ with a permutation P.

    ``order`` lists the pivots, ``lower`` the multipliers by (row, pivot), ``upper`` the entries of U above the
    diagonal, and ``reciprocals`` the reciprocals of the pivots by row.
    """

    order: tuple[int, ...]
    lower: dict[tuple[int, int], Expression]
    upper: dict[tuple[int, int], Expression]
    reciprocals: tuple[Expression, ...]

    @property
    def values(self) -> tuple[Expression, ...]:
        """All numbers that `solved` reads: the reciprocal pivots, the multipliers, and the entries of the upper
        triangular factor."""
        return (*self.reciprocals, *self.lower.values(), *self.upper.values())

    def named(self, kind: str) -> Factors:
        """Return a copy of the factors in which ``Symbol(kind, 0)``, ``Symbol(kind, 1)``, … replace the `values`."""
        names: Iterator[Expression] = (symbol(Symbol(kind, k)) for k in range(len(self.values)))
        reciprocals = tuple(next(names) for _ in self.reciprocals)
        lower = {place: next(names) for place in self.lower}
        return Factors(self.order, lower, {place: next(names) for place in self.upper}, reciprocals)

    def solved(self, side: Sequence[Expression]) -> list[Expression]:
        """Return the solution of the linear equations with the right-hand side ``side``, as expressions."""
        b, x = list(side), [ZERO] * len(side)
        rows: list[list[tuple[int, Expression]]] = [[] for _ in side]
        for (k, j), e in self.upper.items():
            rows[k].append((j, e))
        for (i, k), factor in self.lower.items():
            b[i] = b[i] - factor * b[k]
        for k in reversed(self.order):
            x[k] = (b[k] - total(e * x[j] for j, e in rows[k])) * self.reciprocals[k]
        return x

    def solved_transposed(self, side: Sequence[Expression]) -> list[Expression]:
        """Return the solution of the equations with the transposed matrix P Uᵀ Lᵀ Pᵀ and the right-hand side ``side``,
        as expressions."""
        z, columns = list(side), defaultdict[int, list[tuple[int, Expression]]](list)
        for (k, j), e in self.upper.items():
            columns[j].append((k, e))
        for k in self.order:
            z[k] = (z[k] - total(e * z[m] for m, e in columns[k])) * self.reciprocals[k]
        for (i, k), factor in reversed(self.lower.items()):
            z[k] = z[k] - factor * z[i]
        return z


def factorise(pattern: Pattern) -> Factors:
    """Return the factors of a matrix with the symbol ``J:i:j`` at each entry that may be nonzero by the pattern."""
    n = len(pattern)
    a = [[symbol(Symbol("J", i, j)) if pattern[i][j] or i == j else ZERO for j in range(n)] for i in range(n)]
    lower: dict[tuple[int, int], Expression] = {}
    upper: dict[tuple[int, int], Expression] = {}
    reciprocals: list[Expression] = [ZERO] * n
    order = pivot_order(pattern)
    with progress.stage("elimination", n) as running:
        for running.done, k in enumerate(order, 1):
            later = order[running.done :]
            reciprocals[k] = 1 / a[k][k]
            columns = [j for j in later if not a[k][j].is_zero]
            upper |= {(k, j): a[k][j] for j in columns}
            for i in (i for i in later if not a[i][k].is_zero):
                factor = lower[i, k] = a[i][k] * reciprocals[k]
                for j in columns:
                    a[i][j] = a[i][j] - factor * a[k][j]
    return Factors(tuple(order), lower, upper, tuple(reciprocals))


def elimination(pattern: Pattern) -> tuple[list[Expression], tuple[Expression, ...]]:
    """Return the solution of the equations J x = r, and the reciprocals of the pivots.

    J has the symbol ``J:i:j`` where the pattern is true, and the right-hand side has the symbols ``r:i``.
    """
    factors = factorise(pattern)
    return factors.solved([symbol(Symbol("r", i)) for i in range(len(pattern))]), factors.reciprocals


def transposed_elimination(pattern: Pattern) -> tuple[list[Expression], tuple[Expression, ...]]:
    """Return the solution of the equations Jᵀ x = r, and the reciprocals of the pivots, which are those of J.

    J has the symbol ``J:i:j`` where the pattern is true, and the right-hand side has the symbols ``r:i``.
    """
    factors = factorise(pattern)
    return factors.solved_transposed([symbol(Symbol("r", i)) for i in range(len(pattern))]), factors.reciprocals


def inversion(pattern: Pattern) -> tuple[list[Expression], list[Expression]]:
    """Return J⁻¹, row by row, by Gauss–Jordan elimination, and the reciprocal pivots.

    The entry (i, j) of J is the symbol ``J:i:j`` if i = j, or if ``pattern[i][j]`` is true. All other entries are 0.
    """
    n = len(pattern)
    a = [[symbol(Symbol("J", i, j)) if pattern[i][j] or i == j else ZERO for j in range(n)] for i in range(n)]
    reciprocals: list[Expression] = []
    for k in range(n):
        reciprocals.append(1 / a[k][k])
        a[k] = [reciprocals[k] if j == k else a[k][j] * reciprocals[k] for j in range(n)]
        for i in (i for i in range(n) if i != k):
            factor = a[i][k]
            a[i] = [-(factor * a[k][j]) if j == k else a[i][j] - factor * a[k][j] for j in range(n)]
    return [e for row in a for e in row], reciprocals
