"""Staging: values that do not depend on the state move to ``prepare``, or to ``refresh``.

Symbols are of three stages. *Static* ones, parameters and the step size, are known before the first step; *inputs* of a
step, such as the time in its middle, are new in every step; all others belong to the state, and change with every
evaluation. What depends on static symbols only is computed by ``prepare``, once; what depends on inputs too by
``refresh``, once in every stage of a step. Both fill one table, that of the coefficients ``c:0``, ``c:1``, …, in which
the static ones come first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from phigen.scheme.kernel import Kernel, Output
from phigen.splitting.matrices import MatrixExponential
from phigen.symbolic.expression import Expression, fold, rebuild, substitute, symbol, symbols_of, topological, total
from phigen.symbolic.symbols import COEFFICIENT, RENEWED, Symbol, coefficient, kind_of

T = TypeVar("T")

#: What the inputs of a step are.
INPUTS = {"t": "the time", "dw": "the increments of the noise"}

#: The argument of kernels that is the table of coefficients, and the output of ``refresh``, its last part.
TABLE, NOW = "coef", "now"


class Coefficients:
    """The table of state-independent values; `hoist` fills it and is idempotent on equal values.

    ``values`` are those of ``prepare``, ``renewed`` those that depend on ``inputs`` of a step. Between them lie the
    entries of ``exponentials``, exp(tA) − 1. Of these two nobody knows the place in the table before it is full: until
    `settled` they are symbols of their own kinds.
    """

    def __init__(self, static: Iterable[str], inputs: Iterable[str] = ()) -> None:
        self._static, self._inputs = set(static), set(inputs)
        self.values: list[Expression] = []
        self.renewed: list[Expression] = []
        self.exponentials: list[MatrixExponential] = []
        self._index: dict[int, Symbol] = {}

    @property
    def slots(self) -> tuple[str, ...]:
        """The symbols of all coefficients of ``prepare`` so far."""
        return tuple(coefficient(k) for k in range(len(self.values)))

    @property
    def table(self) -> tuple[str, ...]:
        """The symbols of all coefficients so far, those that are renewed in each step last."""
        entries = (name for e in self.exponentials for name in e.symbols)
        return (*self.slots, *entries, *(Symbol(RENEWED, k) for k in range(len(self.renewed))))

    @property
    def everything(self) -> list[Expression]:
        """What the symbols of the table stand for; of entries of an exponential, a sum of all that they depend on."""
        sums = (total(e.exponents) for e in self.exponentials for _ in e.rates)
        return [*self.values, *sums, *self.renewed]

    @property
    def prepared(self) -> list[Expression]:
        """What ``prepare`` stores: the values, and the entries of tA, which `blocks` take the exponentials of."""
        return [*self.values, *(e for exponential in self.exponentials for e in exponential.exponents)]

    @property
    def blocks(self) -> tuple[tuple[int, int], ...]:
        """Where the matrices tA begin in the table, with their sizes."""
        found, start = [], len(self.values)
        for exponential in self.exponentials:
            found.append((start, exponential.size))
            start += exponential.size**2
        return tuple(found)

    def include(self, exponentials: Iterable[MatrixExponential]) -> None:
        """Make room for matrix exponentials, each once."""
        self.exponentials += [e for e in dict.fromkeys(exponentials) if e not in self.exponentials]

    def empty(self) -> Coefficients:
        """A table with the same symbols and no values."""
        return Coefficients(self._static, self._inputs)

    def hoist(self, roots: Sequence[Expression]) -> list[Expression]:
        """The roots with each largest state-independent part replaced by a coefficient ``c:k``.

        Plain numbers stay where they are: a literal is cheaper than a load.
        """
        return self._hoisted(roots, lambda name: self._is_fixed(name) or self._is_new(name))

    def _hoisted(self, roots: Sequence[Expression], early: Callable[[str], bool]) -> list[Expression]:
        fixed: dict[int, bool] = {}
        for e in topological(roots):
            fixed[id(e)] = early(e.value) if e.op == "symbol" else all(fixed[id(a)] for a in e.args)

        def visit(e: Expression, args: list[Expression]) -> Expression:
            if fixed[id(e)]:
                return e
            ready = [self.slot(self._written_out(a)) if fixed[id(a)] else b for a, b in zip(e.args, args, strict=True)]
            return rebuild(e, ready)

        done = fold(roots, visit)
        return [self.slot(self._written_out(r)) if fixed[id(r)] else d for r, d in zip(roots, done, strict=True)]

    def is_static(self, e: Expression) -> bool:
        """Whether an expression does not depend on the state."""
        return all(name in self._static or name in self._inputs for name in symbols_of(e))

    def written_out(self, roots: Sequence[Expression]) -> list[Expression]:
        """The roots with all coefficients replaced by what they stand for."""
        return [self._written_out(e) for e in roots]

    def slot(self, e: Expression) -> Expression:
        """The coefficient that stands for a state-independent expression; a number stands for itself."""
        if e.is_number:
            return e
        found = self._index.get(id(e))
        if found is None:
            new = any(map(self._is_new, symbols_of(e)))
            kept = self.renewed if new else self.values
            found = self._index[id(e)] = Symbol(RENEWED if new else COEFFICIENT, len(kept))
            kept.append(e)
        return symbol(found)

    def refresh(self, **inputs: Sequence[str]) -> Kernel | None:
        """The kernel that computes what depends on the inputs of a step, None if nothing does.

        Call it before ``prepare`` is made, for which it may find more values.
        """
        if not self.renewed:
            return None
        if not self.values:  # the first part of the table must not be empty, for the second to lie elsewhere
            self.slot(symbol(min(self._static)))
        values = tuple(self._hoisted(self.renewed, self._is_fixed))
        return Kernel(
            "refresh",
            f"everything that depends on {' and '.join(INPUTS[name] for name in inputs)}, but not on the state",
            {TABLE: self.slots, **{name: tuple(symbols) for name, symbols in inputs.items()}},
            (Output(NOW, values),),
        )

    def settled(self, made: T) -> T:
        """What was made with a table that is full now: kernels, recurrences, in whatever frozen dataclasses and tuples.

        Every coefficient has its place: those that are renewed in each step come after those that are not.
        """
        late = self.table[len(self.values) :]
        if not late:
            return made
        places = [coefficient(len(self.values) + k) for k in range(len(late))]
        names: dict[str, Expression] = {name: symbol(place) for name, place in zip(late, places, strict=True)}
        listed = list(_expressions(made))
        renamed = {id(e): r for e, r in zip(listed, substitute(listed, names), strict=True)}
        settled: T = _rebuilt(made, renamed, (*self.slots, *places))
        return settled

    def _is_fixed(self, name: str) -> bool:
        return name in self._static or kind_of(name) == COEFFICIENT

    def _is_new(self, name: str) -> bool:
        return name in self._inputs or kind_of(name) == RENEWED

    def _written_out(self, e: Expression) -> Expression:
        """The expression with coefficients that occur in it replaced by what they stand for."""
        used = [n for n in symbols_of(e) if isinstance(n, Symbol) and n.kind in (COEFFICIENT, RENEWED)]
        tables = {COEFFICIENT: self.values, RENEWED: self.renewed}
        return substitute([e], {n: tables[n.kind][int(n.key[0])] for n in used})[0] if used else e


def _expressions(made: Any) -> Iterable[Expression]:
    """All expressions inside tuples and dataclasses."""
    if isinstance(made, Expression):
        yield made
    elif isinstance(made, tuple):
        for part in made:
            yield from _expressions(part)
    elif is_dataclass(made):
        for f in fields(made):
            yield from _expressions(getattr(made, f.name))


def _rebuilt(made: Any, renamed: dict[int, Expression], slots: tuple[str, ...]) -> Any:
    """The same with other expressions; kernels that read the table are told of all of it."""
    if isinstance(made, Expression):
        return renamed[id(made)]
    if isinstance(made, tuple):
        return tuple(_rebuilt(part, renamed, slots) for part in made)
    if not is_dataclass(made) or isinstance(made, type):
        return made
    parts: dict[str, Any] = {f.name: _rebuilt(getattr(made, f.name), renamed, slots) for f in fields(made)}
    if isinstance(made, Kernel) and TABLE in made.inputs and made.outputs[0].name != NOW:
        parts["inputs"] = {**made.inputs, TABLE: slots}
    return replace(made, **parts)
