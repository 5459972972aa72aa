"""Transposed sweeps of lattices that collect: each site computes itself what those around would hand to it.

So it is where the shares of neighbours are cheap, as those of springs are: what they read is read here anyway, and
cotangents of neighbours are all that is new. Where they are dear, such as sines of sums over neighbours, each is found
once, at its own site, and handed over.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

from phigen.scheme.kernel import Kernel
from phigen.scheme.steps import Sites, Sweep, Sweeps
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute, symbol, symbols_of, topological, total
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.symbols import AROUND, Symbol

#: What a value costs that is handed over, in additions: it is written, and read again by another loop.
HANDING = 10


def collecting(fields: Sequence[str], step: Sweeps, sweep: Sweep, back: Kernel) -> Kernel | None:
    """The transpose of a sweep that collects; None where it hands nothing over, or had better do so."""
    sites, along = step.sites, back.along("site")
    given = [(name, value) for name, value in along if any(sites.places[name][1]) and not value.is_zero]
    if not given or any(sites.open) or step.partners or sites.colours > 1:
        return None
    moved = {fields[f] for f in sweep.moved}
    names = {place: name for name, place in sites.places.items()}
    sums: dict[str, list[Expression]] = {}
    for name, value in given:
        field, offset = sites.places[name]
        taken = _seen_from(sites, names, moved, offset, value)
        if taken is None or field in moved:
            return None
        sums.setdefault(field, []).append(taken)
    own = dict.fromkeys(sums, ZERO) | dict(along)
    if any(not own[field].is_zero for field in moved if field in own):
        return None
    found = {field: _by_cotangents(total([own[field], *terms])) for field, terms in sums.items()}
    beside = {name for name, _ in given}
    values = [found.pop(name, ZERO if name in beside else value) for name, value in along]
    read = {s for s in symbols_of(*values, *found.values()) if s in sites.places}
    found |= dict.fromkeys(sorted(read.difference(back.inputs["site"], found)), ZERO)
    outputs = [replace(o, values=(*values, *found.values())) if o.name == "site_bar" else o for o in back.outputs]
    collected = replace(back, inputs={**back.inputs, "site": (*back.inputs["site"], *found)}, outputs=tuple(outputs))
    if _cost(collected.roots) > _cost(back.roots) + HANDING * len({value for _, value in given}):
        return None
    around = tuple(s for s in symbols_of(*collected.roots) if isinstance(s, Symbol) and s.kind == AROUND)
    return replace(collected, inputs={**collected.inputs, AROUND: around})


def _seen_from(
    sites: Sites,
    names: Mapping[tuple[str, tuple[int, ...]], str],
    moved: Set[str],
    offset: Sequence[int],
    value: Expression,
) -> Expression | None:
    """What a site gives to that at an offset from it, in terms of what is around that; None where that reads less."""
    turned: dict[str, Expression] = {}
    for s in symbols_of(value):
        if isinstance(s, Symbol) and s.kind == "change_bar":
            turned[s] = symbol(Symbol(AROUND, *s.key, *(-o for o in offset)))
        elif s in sites.places:
            field, place = sites.places[s]
            other = names.get((field, tuple(p - o for p, o in zip(place, offset, strict=True))))
            if other is None or field in moved:
                return None
            turned[s] = symbol(other)
        elif isinstance(s, Symbol) and s.kind == "present":
            return None
    return substitute([value], turned)[0]


def _by_cotangents(value: Expression) -> Expression:
    """A sum over cotangents, each times what it is multiplied by in all terms: the shares of both ends of a spring are
    multiplied by the same."""
    cotangents = [s for s in symbols_of(value) if isinstance(s, Symbol) and s.kind in ("change_bar", AROUND)]
    return total(e * symbol(s) for s, e in zip(cotangents, gradient(value, cotangents), strict=True))


def _cost(values: Sequence[Expression]) -> int:
    """Of computing some values, in additions."""
    return sum(FUNCTIONS[e.op].cost if e.op in FUNCTIONS else bool(e.args) for e in topological(values))
