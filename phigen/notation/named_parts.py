"""Formulas with names for parts that occur more than once, so that large expressions are readable."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from phigen.symbolic.expression import ZERO, Expression, fold, raw, substitute, symbol, symbols_of, topological
from phigen.symbolic.readable import LONGEST, Formula, expanded
from phigen.symbolic.readable import readable as as_text
from phigen.symbolic.symbols import MOMENTUM, PART, Symbol, kind_of, plain

#: A part with fewer leaves than this gets no name, nor one whose name saves fewer leaves.
SMALL, WORTH = 3, 4

#: Names are used if they shorten the whole to this fraction.
WORTH_NAMES = 0.75

#: Expressions with fewer leaves get no names for shared parts.
SHORT = 40

#: The name of a shared part in a text.
_SHARED = re.compile(r"σ_\d+\b")


@dataclass(frozen=True)
class Readable:
    """``forms`` of the expressions that were given, in the symbols ``part:1``, ``part:2``, … whose meaning is in
    ``parts``. ``size`` counts the names and numbers of all of them."""

    parts: tuple[tuple[str, Expression], ...]
    forms: tuple[Formula | Expression, ...]
    size: int


def readable(expressions: Sequence[Expression]) -> Readable:
    """The expressions expanded, as they stand, or with names for shared parts: the shortest form."""
    plain, named = _partly_named(expressions), _all_named(expressions)
    return named if plain.size > SHORT and named.size < WORTH_NAMES * plain.size else plain


def _all_named(expressions: Sequence[Expression]) -> Readable:
    named, roots = with_names(expressions)
    return Readable(named, tuple(roots), sum(map(leaves, [*roots, *(e for _, e in named)])))


def _partly_named(expressions: Sequence[Expression]) -> Readable:
    """Short expressions expanded or as they stand; names for the shared parts of long ones."""
    trees = fold(expressions, lambda e, sizes: sum(sizes) or 1)
    forms: dict[int, Formula | Expression] = {}
    for i, (e, form) in enumerate(zip(expressions, expanded(expressions, None), strict=True)):
        if form is not None and leaves(form) < min(trees[i], SHORT):
            forms[i] = form
        elif trees[i] <= SHORT:
            forms[i] = e
    long = [i for i in range(len(expressions)) if i not in forms]
    parts, roots = with_names([expressions[i] for i in long])
    forms |= dict(zip(long, roots, strict=True))
    listed = tuple(forms[i] for i in range(len(expressions)))
    return Readable(parts, listed, sum(map(leaves, [*listed, *(e for _, e in parts)])))


def texts(named: Mapping[str, Expression], most: int | None) -> list[tuple[str, str]]:
    """Expressions as pairs of a name and a text of ``most`` terms, as they stand or expanded.

    If names for shared parts shorten the whole, they are used: σ_1, σ_2, …, with their texts at the end.
    """
    expressions = [*named.values()]
    plainly = as_text(expressions, most)
    if max(map(len, plainly), default=0) > LONGEST:
        shared, roots = with_names(expressions)
        names = [*named, *(plain(name) for name, _ in shared)]
        shown = as_text([*roots, *(e for _, e in shared)], most, vanishing(shared))
        named_texts = _met([*zip(names, shown, strict=True)], len(named))
        if sum(len(text) for _, text in named_texts) < WORTH_NAMES * sum(map(len, plainly)):
            return named_texts
    return list(zip(named, plainly, strict=True))


def vanishing(shared: Sequence[tuple[str, Expression]]) -> list[str]:
    """The names of those shared parts that are 0 where all covectors are."""
    zeros: dict[str, Expression] = {}
    for name, part in shared:
        zeros |= {s: ZERO for s in symbols_of(part) if kind_of(s) == MOMENTUM}
        if substitute([part], zeros)[0].is_zero:
            zeros[name] = ZERO
    return [name for name, _ in shared if name in zeros]


def _met(listed: Sequence[tuple[str, str]], count: int) -> list[tuple[str, str]]:
    """The first ``count`` texts, followed by the parts that occur in them, directly or not, renumbered."""
    met = {name for _, text in listed[:count] for name in _SHARED.findall(text)}
    for name, text in reversed(listed[count:]):
        if name in met:
            met |= {*_SHARED.findall(text)}
    used_names = [name for name, _ in listed[count:] if name in met]
    numbers = {name: plain(Symbol(PART, k)) for k, name in enumerate(used_names, 1)}
    shown = [*listed[:count], *((name, text) for name, text in listed[count:] if name in met)]
    return [(numbers.get(name, name), _SHARED.sub(lambda match: numbers[match[0]], text)) for name, text in shown]


def short(expressions: Sequence[Expression]) -> list[Formula | Expression]:
    """The expressions as they stand, or expanded where that is shorter."""
    forms = zip(expressions, expanded(expressions, None), strict=True)
    return [form if form is not None and leaves(form) < leaves(e) else e for e, form in forms]


def leaves(form: Formula | Expression) -> int:
    """The number of names and numbers in a formula as it is written."""
    if isinstance(form, Expression):
        return fold([form], lambda e, sizes: sum(sizes) or 1)[0]
    return (form.divisor != 1) + sum(
        (abs(c) != 1) + sum(leaves(base) for base, _ in monomial) for c, monomial in form.terms
    )


def with_names(roots: Sequence[Expression]) -> tuple[tuple[tuple[str, Expression], ...], list[Expression]]:
    """Names for long parts that occur more than once, and the roots in terms of these."""
    uses: dict[int, int] = {}
    order = topological(roots)
    for e in order:
        for a in e.args:
            uses[id(a)] = uses.get(id(a), 0) + 1
    for r in roots:
        uses[id(r)] = uses.get(id(r), 0) + 1
    parts: list[tuple[str, Expression]] = []
    trees: dict[int, Expression] = {}
    sizes: dict[int, int] = {}
    for e in order:
        tree = raw(e.op, tuple(trees[id(a)] for a in e.args), e.value)
        size = sum(sizes[id(a)] for a in e.args) or 1
        if size >= SMALL and (uses[id(e)] - 1) * (size - 1) >= WORTH and e.op != "neg":
            parts.append((Symbol(PART, len(parts) + 1), tree))
            tree, size = symbol(parts[-1][0]), 1
        trees[id(e)], sizes[id(e)] = tree, size
    return tuple(parts), [trees[id(r)] for r in roots]
