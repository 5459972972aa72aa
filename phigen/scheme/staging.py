"""Staging: values that do not depend on the state are computed before the steps, or once in each stage of a step.

There are three kinds of symbols. *Static* symbols, parameters and the step size, are known before the first step.
*Inputs* of a step, such as the time in its middle, are new in every step. All other symbols belong to the state and
change with every evaluation. The kernel ``prepare`` computes, before the steps, the values that depend only on static
symbols. The kernel ``refresh`` computes, once in every stage of a step, the values that also depend on inputs. Both
fill one table of coefficients ``c:0``, ``c:1``, …, with the static values first.
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

#: The inputs of a step that change from step to step, with their description in generated code.
INPUTS = {"t": "the time", "dw": "the increments of the noise"}

#: TABLE names the argument of kernels that holds all coefficients. NOW names the output of the kernel ``refresh``. The
#: values of this output stand at the end of the table.
TABLE, NOW = "coef", "now"


class Coefficients:
    """The table of the coefficients ``c:k`` of a program: expressions that do not depend on the state.

    No expression occurs twice. The table has three groups of entries, in this order: the expressions ``values``, which
    ``prepare`` computes; the entries of the matrices exp(tA) − 1 in ``exponentials``; and the ``renewed`` expressions,
    which depend on the inputs of a step. The places of the second and the third group are unknown until the table is
    complete. Until then their entries have provisional symbols, which `settled` replaces.
    """

    def __init__(self, static: Iterable[str], inputs: Iterable[str] = ()) -> None:
        self._static, self._inputs = set(static), set(inputs)
        self.values: list[Expression] = []
        self.renewed: list[Expression] = []
        self.exponentials: list[MatrixExponential] = []
        self._index: dict[int, Symbol] = {}

    @property
    def slots(self) -> tuple[str, ...]:
        """The symbols of the coefficients that ``prepare`` computes: those that have been requested so far."""
        return tuple(coefficient(k) for k in range(len(self.values)))

    @property
    def table(self) -> tuple[str, ...]:
        """The symbols of all coefficients that have been requested so far. The last symbols are those of coefficients
        that change from step to step.
        """
        return (*self.prepared_symbols, *(Symbol(RENEWED, k) for k in range(len(self.renewed))))

    @property
    def prepared_symbols(self) -> tuple[str, ...]:
        """The symbols of all values that ``prepare`` computes: those of `slots`, and the entries of matrix
        exponentials."""
        return (*self.slots, *(name for e in self.exponentials for name in e.symbols))

    @property
    def everything(self) -> list[Expression]:
        """The expressions of all coefficients, to find the symbols on which a coefficient depends.

        An entry of exp(tA) − 1 is represented by the sum of all entries of tA.
        """
        sums = (total(e.exponents) for e in self.exponentials for _ in e.rates)
        return [*self.values, *sums, *self.renewed]

    @property
    def prepared(self) -> list[Expression]:
        """The values that ``prepare`` stores: the expressions that depend only on parameters and the step size, then
        the entries of the matrices tA.

        The generated code replaces each of these matrices, listed in `blocks`, by exp(tA) − 1.
        """
        return [*self.values, *(e for exponential in self.exponentials for e in exponential.exponents)]

    @property
    def blocks(self) -> tuple[tuple[int, int], ...]:
        """Two numbers for each matrix tA whose exponential is in the table: the index of its first entry in the table,
        and its number of rows.
        """
        blocks, start = [], len(self.values)
        for exponential in self.exponentials:
            blocks.append((start, exponential.size))
            start += exponential.size**2
        return tuple(blocks)

    def include(self, exponentials: Iterable[MatrixExponential]) -> None:
        """Add matrix exponentials to the table; those that it already has are skipped."""
        self.exponentials += [e for e in dict.fromkeys(exponentials) if e not in self.exponentials]

    def empty(self) -> Coefficients:
        """Return an empty table that accepts the same symbols as this table."""
        return Coefficients(self._static, self._inputs)

    def hoist(self, roots: Sequence[Expression]) -> list[Expression]:
        """Return the roots with each maximal state-independent sub-expression replaced by a coefficient ``c:k``.

        Plain numbers are not replaced: a literal is cheaper than a load from the table.
        """
        return self._hoisted(roots, lambda name: self._is_fixed(name) or self._is_new(name))

    def _hoisted(self, roots: Sequence[Expression], is_hoisted: Callable[[str], bool]) -> list[Expression]:
        hoisted: dict[int, bool] = {}
        for e in topological(roots):
            hoisted[id(e)] = is_hoisted(e.value) if e.op == "symbol" else all(hoisted[id(a)] for a in e.args)

        def visit(e: Expression, args: list[Expression]) -> Expression:
            if hoisted[id(e)]:
                return e
            arguments = [
                self.slot(self._written_out(a)) if hoisted[id(a)] else b for a, b in zip(e.args, args, strict=True)
            ]
            return rebuild(e, arguments)

        replaced = fold(roots, visit)
        return [self.slot(self._written_out(r)) if hoisted[id(r)] else d for r, d in zip(roots, replaced, strict=True)]

    def is_state_independent(self, e: Expression) -> bool:
        """Whether an expression does not depend on the state: all its symbols are parameters, the step size, or inputs
        of a step such as the time.
        """
        return all(name in self._static or name in self._inputs for name in symbols_of(e))

    def written_out(self, roots: Sequence[Expression]) -> list[Expression]:
        """Return the expressions ``roots``, in which each symbol of a coefficient is replaced by the expression of the
        coefficient.
        """
        return [self._written_out(e) for e in roots]

    def slot(self, e: Expression) -> Expression:
        """Return the symbol of the coefficient that stands for an expression. A missing coefficient is added to the
        table.

        The expression must not depend on the state. If it is a number, the number itself is returned.
        """
        if e.is_number:
            return e
        name = self._index.get(id(e))
        if name is None:
            is_renewed = any(map(self._is_new, symbols_of(e)))
            entries = self.renewed if is_renewed else self.values
            name = self._index[id(e)] = Symbol(RENEWED if is_renewed else COEFFICIENT, len(entries))
            entries.append(e)
        return symbol(name)

    def refresh(self, **inputs: Sequence[str]) -> Kernel | None:
        """Return the kernel ``refresh`` of the coefficients that depend on inputs of a step, if there are any.

        This kernel must be built before ``prepare``, since it may add values that ``prepare`` computes.
        """
        if not self.renewed:
            return None
        if not self.values:  # the static part of the table must not be empty: `refresh` writes after it
            self.slot(symbol(min(self._static)))
        values = tuple(self._hoisted(self.renewed, self._is_fixed))
        return Kernel(
            "refresh",
            f"compute the coefficients that depend on {' and '.join(INPUTS[name] for name in inputs)}",
            {TABLE: self.slots, **{name: tuple(symbols) for name, symbols in inputs.items()}},
            (Output(NOW, values),),
        )

    def settled(self, unsettled: T) -> T:
        """Return a copy of an object with the final symbols of all coefficients, now that the table is complete.

        The object consists of kernels, recurrences, and other frozen dataclasses and tuples.
        """
        provisional = self.table[len(self.values) :]
        if not provisional:
            return unsettled
        final_symbols = [coefficient(len(self.values) + k) for k in range(len(provisional))]
        names: dict[str, Expression] = {
            name: symbol(place) for name, place in zip(provisional, final_symbols, strict=True)
        }
        expressions = list(_expressions(unsettled))
        renamed = {id(e): r for e, r in zip(expressions, substitute(expressions, names), strict=True)}
        settled: T = _rebuilt(unsettled, renamed, (*self.slots, *final_symbols))
        return settled

    def _is_fixed(self, name: str) -> bool:
        return name in self._static or kind_of(name) == COEFFICIENT

    def _is_new(self, name: str) -> bool:
        return name in self._inputs or kind_of(name) == RENEWED

    def _written_out(self, e: Expression) -> Expression:
        """Return the expression with each of its coefficients replaced by the expression that it stands for."""
        coefficient_symbols = [n for n in symbols_of(e) if isinstance(n, Symbol) and n.kind in (COEFFICIENT, RENEWED)]
        tables = {COEFFICIENT: self.values, RENEWED: self.renewed}
        return (
            substitute([e], {n: tables[n.kind][int(n.key[0])] for n in coefficient_symbols})[0]
            if coefficient_symbols
            else e
        )


def _expressions(tree: Any) -> Iterable[Expression]:
    """Yield all expressions inside nested tuples and dataclasses."""
    if isinstance(tree, Expression):
        yield tree
    elif isinstance(tree, tuple):
        for part in tree:
            yield from _expressions(part)
    elif is_dataclass(tree):
        for f in fields(tree):
            yield from _expressions(getattr(tree, f.name))


def _rebuilt(tree: Any, renamed: dict[int, Expression], slots: tuple[str, ...]) -> Any:
    """Return a copy of nested tuples and dataclasses in which each expression is replaced.

    ``renamed`` maps the ``id`` of an old expression to the new one. Kernels that read the table of coefficients receive
    all of its ``slots`` as input.
    """
    if isinstance(tree, Expression):
        return renamed[id(tree)]
    if isinstance(tree, tuple):
        return tuple(_rebuilt(part, renamed, slots) for part in tree)
    if not is_dataclass(tree) or isinstance(tree, type):
        return tree
    parts: dict[str, Any] = {f.name: _rebuilt(getattr(tree, f.name), renamed, slots) for f in fields(tree)}
    if isinstance(tree, Kernel) and TABLE in tree.inputs and tree.outputs[0].name != NOW:
        parts["inputs"] = {**tree.inputs, TABLE: slots}
    return replace(tree, **parts)
