"""Flows over the time −h, written term by term: what is odd in h changes its sign, and what is even stays.

So a flow is undone with the sines, exponentials and forces that its transpose reads: they are computed once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phigen.scheme.steps import Splitting, Sweeps
from phigen.symbolic.expression import (
    Expression,
    fold,
    neg,
    rebuild,
    substitute,
    symbol,
    symbols_of,
    topological,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.symbols import Symbol, coefficient
from phigen.symbolic.verdict import PROVED, decide_zero

#: The output of a transpose that is the moved values before the flow, and the input of those that it reads for that.
UNDONE = "undone"

ODD, NEITHER, EVEN = -1, 0, 1

#: A sum of symbols, each with its factor.
Form = Mapping[str, int]


def of_coefficients(step: Splitting | Sweeps) -> dict[str, int]:
    """How the coefficients of a flow follow the sign of its time."""
    found = [parity for parity, _ in _parities(step.prepare.roots, dict.fromkeys(step.prepare.inputs["h"], ODD))]
    if step.refresh:
        slots: dict[str, int] = {coefficient(k): parity for k, parity in enumerate(found)}
        found += [parity for parity, _ in _parities(step.refresh.roots, slots)]
    return {coefficient(k): parity for k, parity in enumerate(found)}


def turned_back(values: Sequence[Expression], parities: Mapping[str, int]) -> list[Expression]:
    """The values over the time −h."""
    return [turned for _, turned in _parities(values, parities)]


def before(values: Sequence[Expression], changes: Mapping[str, Expression]) -> list[Expression]:
    """Values of the state before a flow, which is that after it with ``changes``.

    What is the same before and after is not computed once more: sums, as that of two spins which turn about it, and
    arguments of functions, as |ψ|² that moves only phases, where that is proved.
    """
    moved = {s: symbol(s) + change for s, change in changes.items()}

    def visit(node: Expression, args: list[tuple[Expression, Form | None]]) -> tuple[Expression, Form | None]:
        form = _form(node, [of for _, of in args])
        if form and _stays(form, changes):
            return node, form
        return moved.get(node.value, node) if node.op == "symbol" else rebuild(node, [e for e, _ in args]), form

    called = dict.fromkeys(e.args[0] for e in topological(values) if e.op in FUNCTIONS and len(e.args) == 1)
    read = [e for e in called if not moved.keys().isdisjoint(symbols_of(e)) and not _called_in(e)]
    kept = {
        e: symbol(Symbol("kept", k))
        for k, (e, (other, _)) in enumerate(zip(read, fold(read, visit), strict=True))
        if len(_called_in(other)) < 2 and decide_zero("", [("", other - e)]).verdict == PROVED  # of more it takes long
    }
    held = {value.value: e for e, value in kept.items()}
    without = fold(values, lambda e, args: kept.get(e) or rebuild(e, args))
    return substitute([found for found, _ in fold(without, visit)], held)


def _called_in(value: Expression) -> set[Expression]:
    """The arguments of all functions in a value."""
    return {e.args[0] for e in topological([value]) if e.op in FUNCTIONS}


def _form(node: Expression, args: Sequence[Form | None]) -> Form | None:
    """A node as a sum of symbols, if that is what it is."""
    if node.op == "symbol":
        return {node.value: 1}
    if node.op not in ("add", "sub", "neg") or None in args:
        return None
    found: dict[str, int] = {}
    for form, sign in zip(args, {"add": (1, 1), "sub": (1, -1), "neg": (-1,)}[node.op], strict=True):
        for name, factor in (form or {}).items():
            found[name] = found.get(name, 0) + sign * factor
    return found


def _stays(form: Form, moved: Mapping[str, Expression]) -> bool:
    """Whether what the flow changes in a sum cancels, term by term."""
    left: dict[Expression, int] = {}
    for name, factor in form.items():
        if name in moved:
            change, sign = moved[name], factor
            while change.op == "neg":
                change, sign = change.args[0], -sign
            left[change] = left.get(change, 0) + sign
    return not any(left.values())


def _parities(values: Sequence[Expression], of_symbols: Mapping[str, int]) -> list[tuple[int, Expression]]:
    """Whether values are odd or even in the time, and what they are over −h; symbols that are not listed are even."""

    def visit(node: Expression, args: list[tuple[int, Expression]]) -> tuple[int, Expression]:
        parity = of_symbols.get(node.value, EVEN) if node.op == "symbol" else _parity(node, [p for p, _ in args])
        if parity == NEITHER:
            return parity, rebuild(node, [turned for _, turned in args])
        return parity, node if parity == EVEN else neg(node)

    return fold(values, visit)


def _parity(node: Expression, of_args: Sequence[int]) -> int:
    """That of a number, a sum, a product, a power or a value of a function."""
    if all(parity == EVEN for parity in of_args):
        return EVEN
    first = of_args[0]
    if node.op in ("add", "sub", "neg"):
        return first if len({*of_args}) == 1 else NEITHER
    if node.op == "mul":
        return first * of_args[1]
    if node.op == "pow":
        return first ** int(node.value) if node.value.denominator == 1 and first else NEITHER
    known = {"odd": ODD, "even": EVEN}.get(FUNCTIONS[node.op].parity, NEITHER) if node.op in FUNCTIONS else NEITHER
    return known if first == ODD else NEITHER
