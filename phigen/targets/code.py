"""Kernels as sequences of assignments, for the printers of all languages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from phigen.scheme.kernel import SCALARS, Kernel
from phigen.scheme.lowering import Assignment, assign, expand_powers
from phigen.symbolic.expression import Expression, fold, raw, symbol, topological
from phigen.symbolic.symbols import WORK, Symbol
from phigen.targets.names import Scope


@dataclass(frozen=True)
class StoreStatement:
    """The statement ``array[index] = value``."""

    array: str
    index: int
    value: Expression


@dataclass(frozen=True)
class Code:
    """A lowered kernel: assignments in order, then stores of its outputs; ``used`` are the input symbols it reads."""

    assignments: tuple[Assignment, ...]
    stores: tuple[StoreStatement, ...]
    used: frozenset[str]
    cleared: tuple[tuple[str, int], ...] = ()  # arrays that are set to zero before, with their sizes

    @property
    def kept(self) -> list[int]:
        """The indices of the entries of the workspace that the code assigns."""
        targets = [a.target for a in self.assignments]
        return [int(t.key[0]) for t in targets if isinstance(t, Symbol) and t.kind == WORK]


def lower(kernel: Kernel) -> Code:
    """Return a kernel as assignments and stores."""
    roots = kernel.roots
    named = [e for _, e in kernel.named]
    expanded = expand_powers([*roots, *named])
    names = {id(e): name for (name, _), e in zip(kernel.named, expanded[len(roots) :], strict=True) if e.args}
    assignments, trees = assign(expanded[: len(roots)], names)
    places = [(o.name, i) for o in kernel.outputs for i in range(len(o.values))]
    stores = tuple(StoreStatement(a, i, t) for (a, i), t in zip(places, trees, strict=True))
    nodes = topological(expanded[: len(roots)])
    return Code(tuple(assignments), stores, frozenset(e.value for e in nodes if e.op == "symbol"))


def bound(
    kernel: Kernel,
    code: Code,
    scope: Scope,
    parameter: Callable[[str], str],
    entry: Callable[[str, int, str], str],
    *,
    named: bool,
) -> list[tuple[str, str]]:
    """Bind the used inputs of a kernel in a scope; return the names of inputs that get a variable, and their values.

    ``parameter`` prints a parameter by its name, ``entry`` an entry of an array, or a number, by argument, index and
    symbol. Entries whose symbols are internal to phigen are printed in place; so are parameters unless ``named``.
    """
    names = []
    for argument, symbols in kernel.inputs.items():
        for i, s in enumerate(symbols):
            if s not in code.used:
                continue
            place = parameter(s) if argument == "params" else entry(argument, i, s)
            has_variable = named if argument == "params" else not (argument in SCALARS or isinstance(s, Symbol))
            if has_variable:
                names.append((scope[s], place))
            else:
                scope.bind(s, place)
    return names


#: Number of entries of an array that are always zero, from which on the array is cleared in one statement.
MANY_ZEROS = 6


def with_zeros_first(code: Code) -> Code:
    """Return code that clears arrays with many zeros first, and stores only their other entries."""
    zeros, sizes = Counter(s.array for s in code.stores if s.value.is_zero), Counter(s.array for s in code.stores)
    cleared = {array: sizes[array] for array, count in zeros.items() if count >= MANY_ZEROS}
    stores = tuple(s for s in code.stores if not (s.array in cleared and s.value.is_zero))
    return replace(code, stores=stores, cleared=tuple(cleared.items()))


def parts(code: Code, size: int) -> list[Code]:
    """Return the code in pieces of at most ``size`` statements, with each store as early as its value is known.

    Long functions compile in quadratic time. A temporary that a later piece reads becomes an entry of a workspace
    array, a symbol of the kind `WORK`.
    """
    if len(code.assignments) + len(code.stores) <= size:
        return [code]
    position = {a.target: k for k, a in enumerate(code.assignments)}
    ready: dict[int, list[StoreStatement]] = {}
    for s in code.stores:
        ready.setdefault(max((position.get(n, 0) for n in _reads([s.value])), default=0), []).append(s)
    statements: list[Assignment | StoreStatement] = [] if code.assignments else list(code.stores)
    for k, a in enumerate(code.assignments):
        statements += [a, *ready.get(k, [])]
    chunks = [statements[i : i + size] for i in range(0, len(statements), size)]
    home = {s.target: k for k, chunk in enumerate(chunks) for s in chunk if isinstance(s, Assignment)}
    crossing: dict[str, str] = {}
    for k, chunk in enumerate(chunks):
        for n in _reads([s.value for s in chunk]):
            if n in home and home[n] != k and n not in crossing:
                crossing[n] = Symbol(WORK, len(crossing))
    return [_renamed(chunk, crossing) for chunk in chunks]  # arrays are cleared before the first


def _reads(values: Sequence[Expression]) -> list[str]:
    return [e.value for e in topological(values) if e.op == "symbol"]


def _renamed(chunk: Sequence[Assignment | StoreStatement], names: dict[str, str]) -> Code:
    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "symbol":
            return symbol(names.get(e.value, e.value))
        return raw(e.op, tuple(args), e.value) if e.args else e

    values = fold([s.value for s in chunk], visit)
    assignments, stores = [], []
    for s, v in zip(chunk, values, strict=True):
        if isinstance(s, Assignment):
            assignments.append(Assignment(names.get(s.target, s.target), v))
        else:
            stores.append(StoreStatement(s.array, s.index, v))
    return Code(tuple(assignments), tuple(stores), frozenset(_reads(values)))
