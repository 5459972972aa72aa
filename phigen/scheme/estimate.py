"""Counts of operations in products of symbolic matrices. The products themselves are not built.

The matrix a' = ∂_xα + ∂_pα · Hess S_h makes up nearly all of the step of a large system. Building a node of an
expression graph takes some fifty times as long as counting it. For the count, a node is represented by an integer;
equal operations on equal operands get the same integer, and are counted once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from phigen import progress
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.lowering import cost
from phigen.symbolic.expression import ZERO, Expression, fold, sparse_derivatives, substitute
from phigen.symbolic.symbols import momentum

#: The operations of a matrix are counted in batches of rows. This is the number of rows in the first batch. A few rows
#: are enough to recognise a matrix with far more operations than the limit.
FIRST_ROWS = 8

#: The nonzero entries of a matrix row, by the index of the column.
SparseRow = Mapping[int, Expression]


def newton_operations(
    realisation: BiRealisation, absent: Collection[str], hessian: Sequence[SparseRow], limit: int
) -> int:
    """Return the number of operations of the matrices in a Newton step; ``limit`` + 1 if there are more than
    ``limit``.

    ``hessian`` is Hess S_h by rows. ``absent`` are the coordinates that S_h does not depend on; their momenta ∂S_h/∂x_i
    are 0. The count is a lower bound: it omits the computation of the Hessian, which is small if H is a polynomial of
    low degree. The result is 0 for steps along paths, and for small systems, whose matrices never exceed the limit.
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
        # rows are counted in growing batches, so that for a huge matrix the limit is reached after few rows
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
    """Whether the matrices of a step may need more than ``limit`` operations. A product of full n×n matrices needs
    about 2n³."""
    return 4 * dimension**3 > limit


def path_operations(system: System, hessian: Sequence[SparseRow], limit: int) -> int:
    """Return how many operations compute the matrix Hess S_h · π for a step along paths.

    S_h is the generating function. The result is ``limit`` + 1 if there are more than ``limit`` operations.
    """
    tensor = [{j: e for j, e in enumerate(row) if not e.is_zero} for row in system.poisson]
    count = OperationCount(limit, lambda name: name not in system.coordinates)
    try:
        return count.matrix(hessian, tensor)
    except TooManyError:
        return limit + 1


class TooManyError(Exception):
    """Error of a count that has exceeded its limit."""


class OperationCount:
    """Counter of the operations in products of matrices.

    The counter counts sums of several terms as `phigen.symbolic.expression.total_at` adds them, in pairs.
    Sub-expressions that contain only symbols for which ``is_fixed`` is true are not counted, since they are computed
    once before the steps. Raises `TooManyError` as soon as the number of operations exceeds the limit.
    """

    def __init__(self, limit: int, is_fixed: Callable[[str], bool]) -> None:
        self.operations, self._most, self._is_fixed = 0, limit, is_fixed
        self._nodes: dict[tuple[int, int, int], int] = {}
        self._fixed: set[int] = set()
        self._leaves: dict[int, int] = {}

    def matrix(self, left: Sequence[SparseRow], right: Sequence[SparseRow]) -> int:
        """Return the number of operations of the product left · right, without those that earlier products already
        contain."""
        operations_before = self.operations
        self._know([e for row in (*left, *right) for e in row.values()])
        columns = self._distinct_columns([{j: self._leaves[id(e)] for j, e in row.items()} for row in right])
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
    def _distinct_columns(rows: Sequence[Mapping[int, int]]) -> list[dict[int, int]]:
        """Return the rows of a matrix after columns that repeat another column are removed. A repeated column adds no
        operations.
        """
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
