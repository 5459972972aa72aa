"""What products of matrices of expressions cost, counted before they are made.

A matrix a' = ∂_xα + ∂_pα · Hess S_h of a large system is nearly all of its step, and a node of an expression takes some
fifty times as long to make as to count. Here a node is its number: the same for equal operations on equal operands.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from phigen import progress
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.lowering import cost
from phigen.symbolic.expression import ZERO, Expression, fold, sparse_derivatives, substitute
from phigen.symbolic.symbols import momentum

#: Rows of a matrix that are looked at first.
FIRST_ROWS = 8

#: A row of a matrix, without zeros.
SparseRow = Mapping[int, Expression]


def newton_operations(
    realisation: BiRealisation, absent: Collection[str], hessian: Sequence[SparseRow], most: int
) -> int:
    """Operations of the matrices of a Newton step, see `phigen.scheme.step`; ``most`` + 1 if there are more.

    ``absent`` are the coordinates on which S_h does not depend, so that their momenta are 0. It is an estimate from
    below: the making of the Hessian is left out, which is little where H is a polynomial of low degree. Small systems,
    whose matrices cannot have so many, are not looked at.
    """
    names, momenta = realisation.coordinates, realisation.covector
    if realisation.path or not may_have(len(names), most):
        return 0
    both = [*realisation.displacement, *realisation.increment]
    if absent:
        both = substitute(both, {momentum(c): ZERO for c in absent})
    index = {name: k for k, name in enumerate(momenta)}
    state = {*names, *momenta}
    count = OperationCount(most, lambda name: name not in state)
    left: list[SparseRow] = []
    try:
        while len(left) < len(both):  # more and more rows at once: of far too many, few are looked at
            rows = sparse_derivatives(both[len(left) : 4 * len(left) + FIRST_ROWS], momenta)
            new = [{index[p]: e for p, e in row.items()} for row in rows]
            left += new
            count.matrix(new, hessian)
            own = cost([e for row in left for e in row.values()])
            if count.operations + own > most:
                return most + 1
    except TooManyError:
        return most + 1
    return count.operations + own


def may_have(dimension: int, most: int) -> bool:
    """Whether the matrices of a step may have more than so many operations, for all that the dimension says."""
    return 4 * dimension**3 > most


def path_operations(system: System, hessian: Sequence[SparseRow], most: int) -> int:
    """Operations of Hess S_h · π, of which a step along paths has need; ``most`` + 1 if there are more."""
    tensor = [{j: e for j, e in enumerate(row) if not e.is_zero} for row in system.poisson]
    count = OperationCount(most, lambda name: name not in system.coordinates)
    try:
        return count.matrix(hessian, tensor)
    except TooManyError:
        return most + 1


class TooManyError(Exception):
    """There are more operations than were asked for."""


class OperationCount:
    """The operations of products of matrices whose sums are those of `total_at`.

    What depends on ``fixed`` symbols only costs nothing: it is computed elsewhere. Raises `TooManyError` as soon as
    there are more than ``most``.
    """

    def __init__(self, most: int, fixed: Callable[[str], bool]) -> None:
        self.operations, self._most, self._is_fixed = 0, most, fixed
        self._nodes: dict[tuple[int, int, int], int] = {}
        self._fixed: set[int] = set()
        self._leaves: dict[int, int] = {}

    def matrix(self, left: Sequence[SparseRow], right: Sequence[SparseRow]) -> int:
        """The operations of left · right beyond those that were counted before."""
        before = self.operations
        self._know([e for row in (*left, *right) for e in row.values()])
        columns = self._different([{j: self._leaves[id(e)] for j, e in row.items()} for row in right])
        with progress.stage("operations of the Newton matrix", len(left)) as running:
            for row in left:
                self._row(row, columns)
                running.done += 1
        return self.operations - before

    def _row(self, row: SparseRow, columns: Sequence[Mapping[int, int]]) -> None:
        sums: dict[int, dict[int, int]] = {}
        for k, e in row.items():
            unit, factor = e.is_number and abs(e.value) == 1, self._leaves[id(e)]
            for j, other in columns[k].items():
                sums.setdefault(j, {})[k] = other if unit else self._node(0, factor, other)
        for terms in sums.values():
            self._total(terms)

    @staticmethod
    def _different(rows: Sequence[Mapping[int, int]]) -> list[dict[int, int]]:
        """The rows without columns that are there before: equal ones make equal nodes."""
        columns: dict[int, list[tuple[int, int]]] = {}
        for k, row in enumerate(rows):
            for j, leaf in row.items():
                columns.setdefault(j, []).append((k, leaf))
        kept = set({tuple(column): j for j, column in columns.items()}.values())
        return [{j: leaf for j, leaf in row.items() if j in kept} for row in rows]

    def _know(self, leaves: Sequence[Expression]) -> None:
        def visit(node: Expression, args: list[bool]) -> bool:
            return self._is_fixed(node.value) if node.op == "symbol" else all(args)

        new = list({id(e): e for e in leaves if id(e) not in self._leaves}.values())
        for e, fixed in zip(new, fold(new, visit), strict=True):
            number = self._leaves[id(e)] = -len(self._leaves) - 1
            if fixed:
                self._fixed.add(number)

    def _total(self, terms: dict[int, int]) -> None:
        while len(terms) > 1:
            sums: dict[int, int] = {}
            for place, node in terms.items():
                half = place // 2
                sums[half] = self._node(1, sums[half], node) if half in sums else node
            terms = sums

    def _node(self, kind: int, a: int, b: int) -> int:
        key = (kind, a, b) if a < b else (kind, b, a)
        found = self._nodes.get(key)
        if found is None:
            found = self._nodes[key] = len(self._nodes) + 1
            if a in self._fixed and b in self._fixed:
                self._fixed.add(found)
            else:
                self.operations += 1
                if self.operations > self._most:
                    raise TooManyError
        return found
