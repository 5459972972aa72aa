"""A kernel as lines of assignments, with names chosen: what C and NumPy printing share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phigen.scheme.lowering import Assignment, assign, expand_powers
from phigen.scheme.program import Kernel
from phigen.symbolic.expression import Expression, fold, raw, symbol, topological


@dataclass(frozen=True)
class Store:
    """``array[index] = value``."""

    array: str
    index: int
    value: Expression


@dataclass(frozen=True)
class Code:
    """A kernel lowered: assignments in order, then the stores of its outputs; ``used`` are its input symbols."""

    assignments: tuple[Assignment, ...]
    stores: tuple[Store, ...]
    used: frozenset[str]


def lower(kernel: Kernel) -> Code:
    """The kernel as assignments and stores."""
    roots = kernel.roots
    named = [e for _, e in kernel.named]
    expanded = expand_powers([*roots, *named])
    names = {
        id(e): name for (name, _), e in zip(kernel.named, expanded[len(roots) :], strict=True) if e.args
    }
    assignments, trees = assign(expanded[: len(roots)], names)
    places = [(o.name, i) for o in kernel.outputs for i in range(len(o.values))]
    stores = tuple(Store(a, i, t) for (a, i), t in zip(places, trees, strict=True))
    nodes = topological(expanded[: len(roots)])
    return Code(tuple(assignments), stores, frozenset(e.value for e in nodes if e.op == "symbol"))


def parts(code: Code, size: int) -> list[Code]:
    """The code cut into pieces of at most ``size`` assignments, each store in the last piece it needs.

    Long functions compile in quadratic time. A temporary ``t:k`` that a later piece reads becomes ``w:j``, an
    entry of a workspace array.
    """
    if len(code.assignments) <= size:
        return [code]
    chunks = [code.assignments[i : i + size] for i in range(0, len(code.assignments), size)]
    home = {a.target: k for k, chunk in enumerate(chunks) for a in chunk}
    stores: list[list[Store]] = [[] for _ in chunks]
    for s in code.stores:
        stores[max((home.get(n, 0) for n in _reads([s.value])), default=0)].append(s)
    crossing: dict[str, str] = {}
    for k, chunk in enumerate(chunks):
        for n in _reads([*(a.value for a in chunk), *(s.value for s in stores[k])]):
            if n in home and home[n] != k and n not in crossing:
                crossing[n] = f"w:{len(crossing)}"
    return [_renamed(chunk, stores[k], crossing) for k, chunk in enumerate(chunks)]


def _reads(values: Sequence[Expression]) -> list[str]:
    return [e.value for e in topological(values) if e.op == "symbol"]


def _renamed(chunk: Sequence[Assignment], stores: Sequence[Store], names: dict[str, str]) -> Code:
    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "symbol":
            return symbol(names.get(e.value, e.value))
        return raw(e.op, tuple(args), e.value) if e.args else e

    values = fold([*(a.value for a in chunk), *(s.value for s in stores)], visit)
    assignments = tuple(
        Assignment(names.get(a.target, a.target), v) for a, v in zip(chunk, values[: len(chunk)], strict=True)
    )
    kept = tuple(Store(s.array, s.index, v) for s, v in zip(stores, values[len(chunk) :], strict=True))
    return Code(assignments, kept, frozenset(_reads(values)))
