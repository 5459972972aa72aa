"""Operation counts of products of matrices of expressions, before the products are built.

The matrix a' = ∂_xα + ∂_pα · Hess S_h makes up nearly all of the step of a large system. Building a node of an
expression takes some fifty times as long as counting it. Here a node is represented by a number, which is the same for
equal operations on equal operands.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from phigen import progress
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.lowering import cost
from phigen.symbolic.expression import ZERO, Expression, fold, sparse_derivatives, substitute
from phigen.symbolic.symbols import momentum

#: Number of rows of a matrix that are counted first; a matrix far beyond the limit is recognised by a few rows.
FIRST_ROWS = 8

#: The nonzero entries of a row of a matrix, by column.
SparseRow = Mapping[int, Expression]


def newton_operations(
    realisation: BiRealisation, absent: Collection[str], hessian: Sequence[SparseRow], limit: int
) -> int:
    """Return the operations of the matrices of a Newton step (`phigen.scheme.step`); ``limit`` + 1 if there are more.

    ``absent`` are the coordinates that S_h does not depend on; the corresponding momenta are 0. The count is a lower
    bound: it omits the computation of the Hessian, which is small if H is a polynomial of low degree. For small
    systems, whose matrices are always below the limit, the result is 0.
    """
    names, momenta = realisation.coordinates, realisation.covector
    if realisation.path or not may_have(len(names), limit):
        return 0
    expressions = [*realisation.displacement, *realisation.increment]
    if absent:
        expressions = substitute(expressions, {momentum(c): ZERO for c in absent})
    index = {name: k for k, name in enumerate(momenta)}
    state = {*names, *momenta}
    count = OperationCount(limit, lambda name: name not in state)
    rows_so_far: list[SparseRow] = []
    try:
        # the number of rows grows from batch to batch, so few rows of a huge matrix are counted
        while len(rows_so_far) < len(expressions):
            rows = sparse_derivatives(expressions[len(rows_so_far) : 4 * len(rows_so_far) + FIRST_ROWS], momenta)
            new_rows = [{index[p]: e for p, e in row.items()} for row in rows]
            rows_so_far += new_rows
            count.matrix(new_rows, hessian)
            entry_cost = cost([e for row in rows_so_far for e in row.values()])
            if count.operations + entry_cost > limit:
                return limit + 1
    except TooManyError:
        return limit + 1
    return count.operations + entry_cost


def may_have(dimension: int, limit: int) -> bool:
    """Whether a system of this dimension can have more than ``limit`` operations in the matrices of a step."""
    return 4 * dimension**3 > limit


def path_operations(system: System, hessian: Sequence[SparseRow], limit: int) -> int:
    """Return the operations of Hess S_h · π in a step along paths; ``limit`` + 1 if there are more."""
    tensor = [{j: e for j, e in enumerate(row) if not e.is_zero} for row in system.poisson]
    count = OperationCount(limit, lambda name: name not in system.coordinates)
    try:
        return count.matrix(hessian, tensor)
    except TooManyError:
        return limit + 1


class TooManyError(Exception):
    """The number of operations exceeds the limit."""


class OperationCount:
    """Counter of the operations of products of matrices, with sums as in `total_at`.

    Expressions in fixed symbols only are not counted, since they are computed once. Raises `TooManyError` as soon as
    there are more operations than the limit.
    """

    def __init__(self, limit: int, is_fixed: Callable[[str], bool]) -> None:
        self.operations, self._most, self._is_fixed = 0, limit, is_fixed
        self._nodes: dict[tuple[int, int, int], int] = {}
        self._fixed: set[int] = set()
        self._leaves: dict[int, int] = {}

    def matrix(self, left: Sequence[SparseRow], right: Sequence[SparseRow]) -> int:
        """Return the operations of left · right that are not shared with products counted before."""
        operations_before = self.operations
        self._know([e for row in (*left, *right) for e in row.values()])
        columns = self._different([{j: self._leaves[id(e)] for j, e in row.items()} for row in right])
        with progress.stage("operations of the Newton matrix", len(left)) as running:
            for row in left:
                self._row(row, columns)
                running.done += 1
        return self.operations - operations_before

    def _row(self, row: SparseRow, columns: Sequence[Mapping[int, int]]) -> None:
        sums: dict[int, dict[int, int]] = {}
        for k, e in row.items():
            unit, factor = e.is_number and abs(e.value) == 1, self._leaves[id(e)]
            for j, right_entry in columns[k].items():
                sums.setdefault(j, {})[k] = right_entry if unit else self._node(0, factor, right_entry)
        for terms in sums.values():
            self._total(terms)

    @staticmethod
    def _different(rows: Sequence[Mapping[int, int]]) -> list[dict[int, int]]:
        """Return the rows without repeated columns: equal columns lead to equal nodes."""
        columns: dict[int, list[tuple[int, int]]] = {}
        for k, row in enumerate(rows):
            for j, leaf in row.items():
                columns.setdefault(j, []).append((k, leaf))
        distinct = set({tuple(column): j for j, column in columns.items()}.values())
        return [{j: leaf for j, leaf in row.items() if j in distinct} for row in rows]

    def _know(self, leaves: Sequence[Expression]) -> None:
        def visit(node: Expression, args: list[bool]) -> bool:
            return self._is_fixed(node.value) if node.op == "symbol" else all(args)

        new_leaves = list({id(e): e for e in leaves if id(e) not in self._leaves}.values())
        for e, is_fixed in zip(new_leaves, fold(new_leaves, visit), strict=True):
            number = self._leaves[id(e)] = -len(self._leaves) - 1
            if is_fixed:
                self._fixed.add(number)

    def _total(self, terms: dict[int, int]) -> None:
        while len(terms) > 1:
            sums: dict[int, int] = {}
            for position, node in terms.items():
                parent = position // 2
                sums[parent] = self._node(1, sums[parent], node) if parent in sums else node
            terms = sums

    def _node(self, kind: int, a: int, b: int) -> int:
        key = (kind, a, b) if a < b else (kind, b, a)
        node = self._nodes.get(key)
        if node is None:
            node = self._nodes[key] = len(self._nodes) + 1
            if a in self._fixed and b in self._fixed:
                self._fixed.add(node)
            else:
                self.operations += 1
                if self.operations > self._most:
                    raise TooManyError
        return node
