"""Formulas in which common subexpressions have names, σ_1, σ_2, …, so that large expressions can be displayed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from phigen.symbolic.expression import ZERO, Expression, fold, raw, substitute, symbol, symbols_of, topological
from phigen.symbolic.readable import LONGEST, Formula, expanded
from phigen.symbolic.readable import readable as as_text
from phigen.symbolic.symbols import MOMENTUM, PART, Symbol, kind_of, plain

#: A subexpression gets a name if it has at least SMALL leaves (symbols and numbers), and if the name saves at least
#: WORTH leaves in the whole formula.
SMALL, WORTH = 3, 4

#: Names are used if they shorten the formulas, definitions included, to less than this fraction of their length.
WORTH_NAMES = 0.75

#: Expressions with at most this number of leaves (symbols and numbers) get no names for common subexpressions.
SHORT = 40

#: Pattern of the name of a common subexpression in a text, such as σ_1.
_SHARED = re.compile(r"σ_\d+\b")


@dataclass(frozen=True)
class Readable:
    """Formulas with named common subexpressions.

    ``forms`` are the formulas. They contain symbols ``part:1``, ``part:2``, …, whose definitions are in ``parts``.
    ``size`` is the number of symbols and numbers in all formulas and definitions.
    """

    parts: tuple[tuple[str, Expression], ...]
    forms: tuple[Formula | Expression, ...]
    size: int


def readable(expressions: Sequence[Expression]) -> Readable:
    """Return expressions in a form for display: multiplied out, unchanged, or with names for common subexpressions.

    A name has one definition, which holds in all expressions. Names are used in those expressions that are long without
    names or, if this makes the formulas much shorter, in all expressions.
    """
    unnamed_form, named_form = _partly_named(expressions), _all_named(expressions)
    return (
        named_form if unnamed_form.size > SHORT and named_form.size < WORTH_NAMES * unnamed_form.size else unnamed_form
    )


def _all_named(expressions: Sequence[Expression]) -> Readable:
    definitions, roots = with_names(expressions)
    return Readable(definitions, tuple(roots), sum(map(leaves, [*roots, *(e for _, e in definitions)])))


def _partly_named(expressions: Sequence[Expression]) -> Readable:
    """Return each expression unchanged or multiplied out, whichever is shorter. If the shorter form is long, the
    unchanged expression is returned, with names for its common subexpressions.
    """
    trees = fold(expressions, lambda e, sizes: sum(sizes) or 1)
    forms: dict[int, Formula | Expression] = {}
    for i, (e, form) in enumerate(zip(expressions, expanded(expressions, None), strict=True)):
        if form is not None and leaves(form) < min(trees[i], SHORT):
            forms[i] = form
        elif trees[i] <= SHORT:
            forms[i] = e
    long_indices = [i for i in range(len(expressions)) if i not in forms]
    parts, roots = with_names([expressions[i] for i in long_indices])
    forms |= dict(zip(long_indices, roots, strict=True))
    ordered_forms = tuple(forms[i] for i in range(len(expressions)))
    return Readable(parts, ordered_forms, sum(map(leaves, [*ordered_forms, *(e for _, e in parts)])))


def texts(named_expressions: Mapping[str, Expression], max_terms: int | None) -> list[tuple[str, str]]:
    """Return expressions as pairs of a name and a text, unchanged or multiplied out, whichever is shorter.

    At most ``max_terms`` terms of an expression are displayed; None displays all. If names for common subexpressions
    shorten the texts, they are used, and the pairs (σ_1, its definition), … follow.
    """
    expressions = [*named_expressions.values()]
    plainly = as_text(expressions, max_terms)
    if max(map(len, plainly), default=0) > LONGEST:
        subexpressions, roots = with_names(expressions)
        names = [*named_expressions, *(plain(name) for name, _ in subexpressions)]
        printed = as_text([*roots, *(e for _, e in subexpressions)], max_terms, vanishing(subexpressions))
        named_texts = _met([*zip(names, printed, strict=True)], len(named_expressions))
        if sum(len(text) for _, text in named_texts) < WORTH_NAMES * sum(map(len, plainly)):
            return named_texts
    return list(zip(named_expressions, plainly, strict=True))


def vanishing(subexpressions: Sequence[tuple[str, Expression]]) -> list[str]:
    """Return the names of those subexpressions that are 0 if all momenta are 0.

    ``subexpressions`` are pairs (name, definition).
    """
    zeros: dict[str, Expression] = {}
    for name, part in subexpressions:
        zeros |= {s: ZERO for s in symbols_of(part) if kind_of(s) == MOMENTUM}
        if substitute([part], zeros)[0].is_zero:
            zeros[name] = ZERO
    return [name for name, _ in subexpressions if name in zeros]


def _met(name_texts: Sequence[tuple[str, str]], count: int) -> list[tuple[str, str]]:
    """Return the first ``count`` texts, and the definitions of the subexpressions that they contain.

    Subexpressions that are not displayed are dropped, and the others are renumbered from 1.
    """
    met = {name for _, text in name_texts[:count] for name in _SHARED.findall(text)}
    for name, text in reversed(name_texts[count:]):
        if name in met:
            met |= {*_SHARED.findall(text)}
    used_names = [name for name, _ in name_texts[count:] if name in met]
    numbers = {name: plain(Symbol(PART, k)) for k, name in enumerate(used_names, 1)}
    reached = [*name_texts[:count], *((name, text) for name, text in name_texts[count:] if name in met)]
    return [(numbers.get(name, name), _SHARED.sub(lambda match: numbers[match[0]], text)) for name, text in reached]


def short(expressions: Sequence[Expression]) -> list[Formula | Expression]:
    """Return for each expression the shorter form, unchanged or multiplied out."""
    forms = zip(expressions, expanded(expressions, None), strict=True)
    return [form if form is not None and leaves(form) < leaves(e) else e for e, form in forms]


def leaves(form: Formula | Expression) -> int:
    """Return the number of symbols and numbers in a formula, repetitions included."""
    if isinstance(form, Expression):
        return fold([form], lambda e, sizes: sum(sizes) or 1)[0]
    return (form.divisor != 1) + sum(
        (abs(c) != 1) + sum(leaves(base) for base, _ in monomial) for c, monomial in form.terms
    )


def with_names(roots: Sequence[Expression]) -> tuple[tuple[tuple[str, Expression], ...], list[Expression]]:
    """Return definitions of names for common subexpressions, in order of use, and the ``roots`` with these names."""
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
