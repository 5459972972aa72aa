"""Staging: values that do not depend on the state move to ``prepare``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from phigen.symbolic.expression import Expression, fold, rebuild, substitute, symbol, symbols_of, topological
from phigen.symbolic.symbols import COEFFICIENT, Symbol, coefficient, kind_of


class Coefficients:
    """The table of state-independent values; `hoist` fills it and is idempotent on equal values."""

    def __init__(self, static: Iterable[str]) -> None:
        self._static = set(static)
        self.values: list[Expression] = []
        self._index: dict[int, int] = {}

    @property
    def slots(self) -> tuple[str, ...]:
        """The symbols of all coefficients so far."""
        return tuple(coefficient(k) for k in range(len(self.values)))

    def empty(self) -> Coefficients:
        """A table with the same static symbols and no values."""
        return Coefficients(self._static)

    def hoist(self, roots: Sequence[Expression]) -> list[Expression]:
        """The roots with each largest state-independent part replaced by a coefficient ``c:k``.

        Plain numbers stay where they are: a literal is cheaper than a load.
        """
        fixed: dict[int, bool] = {}
        for e in topological(roots):
            if e.op == "symbol":
                fixed[id(e)] = e.value in self._static or kind_of(e.value) == COEFFICIENT
            else:
                fixed[id(e)] = all(fixed[id(a)] for a in e.args)

        def visit(e: Expression, args: list[Expression]) -> Expression:
            if fixed[id(e)]:
                return e
            ready = [self.slot(self._written_out(a)) if fixed[id(a)] else b for a, b in zip(e.args, args, strict=True)]
            return rebuild(e, ready)

        done = fold(roots, visit)
        return [self.slot(self._written_out(r)) if fixed[id(r)] else d for r, d in zip(roots, done, strict=True)]

    def is_static(self, e: Expression) -> bool:
        """Whether an expression does not depend on the state."""
        return all(name in self._static for name in symbols_of(e))

    def slot(self, e: Expression) -> Expression:
        """The coefficient that stands for a state-independent expression; a number stands for itself."""
        if e.is_number:
            return e
        k = self._index.get(id(e))
        if k is None:
            k = self._index[id(e)] = len(self.values)
            self.values.append(e)
        return symbol(coefficient(k))

    def _written_out(self, e: Expression) -> Expression:
        """The expression with coefficients that occur in it replaced by what they stand for."""
        used = [n for n in symbols_of(e) if isinstance(n, Symbol) and n.kind == COEFFICIENT]
        return substitute([e], {n: self.values[int(n.key[0])] for n in used})[0] if used else e
