"""Formulas of a flow over the time −h, from those over h: each value that is odd in h changes its sign.

In this form the inverse of a flow shares sines, exponentials and forces with the transpose of the flow.
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

#: Name of an output of a transposed flow: the state before the flow. On lattices, a transposed flow also has an input
#: with this name. This input contains values after the flow: those of the updated fields that no other input contains.
STATE_BEFORE = "state_before"

ODD, NEITHER, EVEN = -1, 0, 1

#: A sum of symbols: name of the symbol → integer factor.
Form = Mapping[str, int]


def of_coefficients(step: Splitting | Sweeps) -> dict[str, int]:
    """Return for each coefficient whether it is an odd or an even function of the duration of a flow: `ODD`, `EVEN` or
    `NEITHER`.
    """
    parities = [parity for parity, _ in _parities(step.prepare.roots, dict.fromkeys(step.prepare.inputs["h"], ODD))]
    if step.refresh:
        slots: dict[str, int] = {coefficient(k): parity for k, parity in enumerate(parities)}
        parities += [parity for parity, _ in _parities(step.refresh.roots, slots)]
    return {coefficient(k): parity for k, parity in enumerate(parities)}


def over_negative_time(values: Sequence[Expression], parities: Mapping[str, int]) -> list[Expression]:
    """Return the values with the time h replaced by −h.

    ``parities`` says for each symbol whether it is an odd or an even function of h: `ODD`, `EVEN` or `NEITHER`.
    """
    return [reversed_value for _, reversed_value in _parities(values, parities)]


def before(values: Sequence[Expression], changes: Mapping[str, Expression]) -> list[Expression]:
    """Return values at the state before a flow, as expressions in the state after it.

    ``changes`` are the increments of the inverse flow. Sub-expressions are not computed again if it is proved that the
    flow does not change them. Two kinds of sub-expressions are tried: sums, such as the sum of two spins that rotate
    about it, and arguments of functions, such as |ψ|² in a flow that changes only phases.
    """
    previous = {s: symbol(s) + change for s, change in changes.items()}

    def visit(node: Expression, args: list[tuple[Expression, Form | None]]) -> tuple[Expression, Form | None]:
        form = _form(node, [argument_form for _, argument_form in args])
        if form and _stays(form, changes):
            return node, form
        return previous.get(node.value, node) if node.op == "symbol" else rebuild(node, [e for e, _ in args]), form

    arguments = dict.fromkeys(e.args[0] for e in topological(values) if e.op in FUNCTIONS and len(e.args) == 1)
    candidates = [e for e in arguments if not previous.keys().isdisjoint(symbols_of(e)) and not _called_in(e)]
    # only expressions with at most one function, such as exp(x); with more functions the proof would be slow
    invariants = {
        e: symbol(Symbol("invariant", k))
        for k, (e, (reversed_value, _)) in enumerate(zip(candidates, fold(candidates, visit), strict=True))
        if len(_called_in(reversed_value)) < 2 and decide_zero("", [("", reversed_value - e)]).verdict == PROVED
    }
    values_of = {value.value: e for e, value in invariants.items()}
    with_symbols = fold(values, lambda e, args: invariants.get(e) or rebuild(e, args))
    return substitute([value for value, _ in fold(with_symbols, visit)], values_of)


def _called_in(value: Expression) -> set[Expression]:
    """Return the arguments of all function calls in an expression."""
    return {e.args[0] for e in topological([value]) if e.op in FUNCTIONS}


def _form(node: Expression, args: Sequence[Form | None]) -> Form | None:
    """Return a node as a sum of symbols with integer factors. ``args`` are its arguments as sums of this kind. Returns
    None if the node is no sum of this kind.
    """
    if node.op == "symbol":
        return {node.value: 1}
    if node.op not in ("add", "sub", "neg") or None in args:
        return None
    factors: dict[str, int] = {}
    for form, sign in zip(args, {"add": (1, 1), "sub": (1, -1), "neg": (-1,)}[node.op], strict=True):
        for name, factor in (form or {}).items():
            factors[name] = factors.get(name, 0) + sign * factor
    return factors


def _stays(form: Form, changes: Mapping[str, Expression]) -> bool:
    """Whether a sum of symbols is constant along a flow, because the increments ``changes`` of its symbols cancel."""
    remaining: dict[Expression, int] = {}
    for name, factor in form.items():
        if name in changes:
            change, sign = changes[name], factor
            while change.op == "neg":
                change, sign = change.args[0], -sign
            remaining[change] = remaining.get(change, 0) + sign
    return not any(remaining.values())


def _parities(values: Sequence[Expression], of_symbols: Mapping[str, int]) -> list[tuple[int, Expression]]:
    """Return a pair for each value: its parity in the duration h of a flow, and the value with −h in place of h.

    ``of_symbols`` has the parities of symbols; symbols that are not listed are even.
    """

    def visit(node: Expression, args: list[tuple[int, Expression]]) -> tuple[int, Expression]:
        parity = of_symbols.get(node.value, EVEN) if node.op == "symbol" else _parity(node, [p for p, _ in args])
        if parity == NEITHER:
            return parity, rebuild(node, [reversed_ for _, reversed_ in args])
        return parity, node if parity == EVEN else neg(node)

    return fold(values, visit)


def _parity(node: Expression, of_args: Sequence[int]) -> int:
    """Return whether a node of an expression is an odd or an even function of h: `ODD`, `EVEN` or `NEITHER`.

    ``of_args`` has the same information for each argument of the node.
    """
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
