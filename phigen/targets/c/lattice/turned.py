"""Sweeps with the fields in another order: parts of H that differ in nothing else are made by the same loop."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.steps import Sites, Sweep
from phigen.symbolic.expression import natural_key, substitute, symbol
from phigen.symbolic.symbols import GATHERED, Symbol

#: Most fields of a site whose orders are tried: there are 6 of 3.
MOST_FIELDS = 3


def orders(fields: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """All orders of some fields but their own; none where they are many."""
    own = tuple(fields)
    return (order for order in permutations(own) if order != own and len(own) <= MOST_FIELDS)


def turned_increments(sites: Sites, fields: Sequence[str], order: Sequence[str]) -> dict[str, str]:
    """Increments of noise in an order of the fields: where each field has a source, that of its own is meant for it."""
    if len(sites.increments) != len(order):
        return {}
    own = dict(zip(fields, sites.increments, strict=False))
    return {own[f]: own[g] for f, g in zip(fields, order, strict=False)}


def turned(sites: Sites, fields: Sequence[str], order: Sequence[str], sweep: Sweep) -> Sweep | None:
    """A sweep as a function of other fields: in place of those of an ``order`` it has the ``fields``, one by one.

    None where it would read neighbours that no sweep reads.
    """
    into = dict(zip(order, fields, strict=True))
    into |= {there: own for own, there in turned_increments(sites, fields, order).items()}
    known = {place: name for name, place in (*sites.places.items(), *sites.ends.items())}
    kernels = [sweep.kernel, *(sweep.gather.kernels if sweep.gather else ())]
    names: dict[str, str] = {}
    for s in (s for kernel in kernels for s in (*kernel.inputs.get("site", ()), *kernel.inputs.get("gathered", ()))):
        if isinstance(s, Symbol) and s.kind == GATHERED:
            names[s] = Symbol(GATHERED, into[str(s.key[0])])
            continue
        field, where = sites.ends[s] if s in sites.ends else sites.places[s]
        name = known.get((into.get(field, field), where))
        if name is None:
            return None
        names[s] = name
    moved = [fields.index(into[fields[i]]) for i in sweep.moved]
    places = sorted(range(len(moved)), key=moved.__getitem__)
    gather = sweep.gather and replace(
        sweep.gather,
        ends=tuple(replace(e, kernel=_renamed(e.kernel, names)) for e in sweep.gather.ends),
        names=tuple(names.get(n, n) for n in sweep.gather.names),
    )
    kernel = _renamed(sweep.kernel, names, places)
    return replace(sweep, kernel=kernel, moved=tuple(sorted(moved)), gather=gather, tangent=None)


def _renamed(kernel: Kernel, names: Mapping[str, str], places: Sequence[int] = ()) -> Kernel:
    """The kernel with other symbols, and its values in the order of ``places``."""
    values = substitute(kernel.roots, {old: symbol(new) for old, new in names.items()})
    inputs = {
        key: tuple(sorted((names.get(s, s) for s in symbols), key=natural_key))
        if key in ("site", "gathered")
        else symbols
        for key, symbols in kernel.inputs.items()
    }
    chosen = tuple(values[i] for i in places or range(len(values)))
    return replace(kernel, inputs=inputs, outputs=(Output(kernel.outputs[0].name, chosen),))
