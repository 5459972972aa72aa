"""Transposed sweeps of lattices in two forms. In the collecting form, a site computes all contributions to its own
cotangents, including the contributions that come from its neighbours.

In the storing form, a neighbour computes its contribution and stores it for the site. Collecting is faster if
contributions are cheap, such as those of springs: the site reads the fields of its neighbours anyway, and only their
cotangents are read in addition. Storing is faster for expensive contributions, such as sines of sums over neighbours,
since the neighbour computes them only once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

from phigen.scheme.kernel import Kernel
from phigen.scheme.steps import Sites, Sweep, Sweeps
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute, symbol, symbols_of, topological, total
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.symbols import AROUND, Symbol

#: Cost, in units of an addition, of a value that a site stores for a neighbour: one loop writes it, and another loop
#: reads it.
STORED_VALUE_COST = 10


def collecting(fields: Sequence[str], step: Sweeps, sweep: Sweep, transpose: Kernel) -> Kernel | None:
    """Return the transpose of a sweep in the form in which each site collects the contributions of its neighbours.

    Returns None if there are no contributions of neighbours, if this form is not possible, or if it is more expensive
    than storing the contributions.
    """
    sites, contributions = step.sites, transpose.along("site")
    neighbour_terms = [
        (name, value) for name, value in contributions if any(sites.places[name][1]) and not value.is_zero
    ]
    if not neighbour_terms or any(sites.open_axes) or step.partners or sites.colours > 1:
        return None
    updated = {fields[f] for f in sweep.moved}
    names = {place: name for name, place in sites.places.items()}
    sums: dict[str, list[Expression]] = {}
    for name, value in neighbour_terms:
        field, offset = sites.places[name]
        contribution = _from_receiver(sites, names, updated, offset, value)
        if contribution is None or field in updated:
            return None
        sums.setdefault(field, []).append(contribution)
    cotangents = dict.fromkeys(sums, ZERO) | dict(contributions)
    if any(not cotangents[field].is_zero for field in updated if field in cotangents):
        return None
    collected_sums = {field: _by_cotangents(total([cotangents[field], *terms])) for field, terms in sums.items()}
    neighbour_names = {name for name, _ in neighbour_terms}
    values = [collected_sums.pop(name, ZERO if name in neighbour_names else value) for name, value in contributions]
    read_symbols = {s for s in symbols_of(*values, *collected_sums.values()) if s in sites.places}
    collected_sums |= dict.fromkeys(sorted(read_symbols.difference(transpose.inputs["site"], collected_sums)), ZERO)
    outputs = [
        replace(o, values=(*values, *collected_sums.values())) if o.name == "site_bar" else o for o in transpose.outputs
    ]
    collected = replace(
        transpose,
        inputs={**transpose.inputs, "site": (*transpose.inputs["site"], *collected_sums)},
        outputs=tuple(outputs),
    )
    if _cost(collected.roots) > _cost(transpose.roots) + STORED_VALUE_COST * len(
        {value for _, value in neighbour_terms}
    ):
        return None
    neighbour_symbols = tuple(s for s in symbols_of(*collected.roots) if isinstance(s, Symbol) and s.kind == AROUND)
    return replace(collected, inputs={**collected.inputs, AROUND: neighbour_symbols})


def _from_receiver(
    sites: Sites,
    names: Mapping[tuple[str, tuple[int, ...]], str],
    updated: Set[str],
    offset: Sequence[int],
    value: Expression,
) -> Expression | None:
    """Return a contribution to the site at ``offset``, written in the symbols of that site.

    ``value`` is the contribution in the symbols of the site that it comes from. Returns None if the contribution
    needs a value for which the sweep has no symbol.
    """
    renamed: dict[str, Expression] = {}
    for s in symbols_of(value):
        if isinstance(s, Symbol) and s.kind == "change_bar":
            renamed[s] = symbol(Symbol(AROUND, *s.key, *(-o for o in offset)))
        elif s in sites.places:
            field, place = sites.places[s]
            name_at_receiver = names.get((field, tuple(p - o for p, o in zip(place, offset, strict=True))))
            if name_at_receiver is None or field in updated:
                return None
            renamed[s] = symbol(name_at_receiver)
        elif isinstance(s, Symbol) and s.kind == "present":
            return None
    return substitute([value], renamed)[0]


def _by_cotangents(value: Expression) -> Expression:
    """Return an expression that is linear in cotangents as a sum of the cotangents times their factors.

    In this form the contributions of both ends of a spring have the same factor, which is computed once.
    """
    cotangents = [s for s in symbols_of(value) if isinstance(s, Symbol) and s.kind in ("change_bar", AROUND)]
    return total(e * symbol(s) for s, e in zip(cotangents, gradient(value, cotangents), strict=True))


def _cost(values: Sequence[Expression]) -> int:
    """Return the cost of computing some values, in units of an addition."""
    return sum(FUNCTIONS[e.op].cost if e.op in FUNCTIONS else bool(e.args) for e in topological(values))
