"""Sharing of loops between sweeps over a lattice: parts of H that differ only by a permutation of the fields use one
loop."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations

from phigen.scheme.bond_ends import over_ends
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.steps import Gather, Sites, Sweep
from phigen.symbolic.expression import natural_key, substitute, symbol
from phigen.symbolic.symbols import GATHERED, Symbol
from phigen.symbolic.verdict import PROVED, decide_zero

#: Largest number of fields of a site, or of parameters of a bond, whose permutations are tried: 3 fields have 6 orders.
MOST_FIELDS = 3


def orders(fields: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield the orders of ``fields`` that differ from the present order, cyclic permutations first.

    Nothing is yielded for more than `MOST_FIELDS` fields.
    """
    original = tuple(fields)
    round_ = [original[k:] + original[:k] for k in range(1, len(original))]
    permuted = dict.fromkeys([*round_, *permutations(original)]) if len(original) <= MOST_FIELDS else ()
    return (order for order in permuted if order != original)


def turned_increments(sites: Sites, fields: Sequence[str], order: Sequence[str]) -> dict[str, str]:
    """Return new names for the symbols of noise increments, for a permutation of the fields.

    The symbol for ``fields[k]`` becomes the symbol for the field ``order[k]``. The result is empty unless each field
    has exactly one source of noise.
    """
    if len(sites.increments) != len(order):
        return {}
    increments = dict(zip(fields, sites.increments, strict=False))
    return {increments[f]: increments[g] for f, g in zip(fields, order, strict=False)}


def other_ways(sites: Sites, gather: Gather) -> Iterator[tuple[Gather, tuple[str, ...], float]]:
    """Yield equivalent forms of the sums over bonds.

    In some forms, parameters of bonds are permuted; in others, all bonds are reversed. Each item consists of the sums,
    the order of the parameters, and a sign. The order is () if it is unchanged. The sign is −1 if bonds are reversed.
    Bonds are reversed only if every contribution provably changes its sign with the direction of the bond.
    """
    loops = over_ends(gather)
    if len(loops) != 1 or not loops[0][1]:
        return
    ends, opposite = loops[0]
    original = tuple(sites.at_bonds)
    reversed_ = [
        ("", e + r)
        for e, r in zip(
            ends.kernel.roots, substitute(ends.kernel.roots, {p: -symbol(p) for p in opposite}), strict=True
        )
    ]
    sides = (1.0, -1.0) if decide_zero("", reversed_).verdict == PROVED else (1.0,)
    for order in permutations(original) if len(original) <= MOST_FIELDS else (original,):
        names = dict(zip(order, original, strict=True))
        for side in sides:
            if (order, side) != (original, 1.0):
                reordered_ends = tuple(replace(e, kernel=_signed(_renamed(e.kernel, names), side)) for e in gather.ends)
                yield replace(gather, ends=reordered_ends), () if order == original else order, side


def _signed(kernel: Kernel, sign: float) -> Kernel:
    """Return the kernel with its values negated if ``sign`` is negative, else unchanged."""
    values = tuple(-e if sign < 0 else e for e in kernel.roots)
    return replace(kernel, outputs=(Output(kernel.outputs[0].name, values),))


def turned(sites: Sites, fields: Sequence[str], order: Sequence[str], sweep: Sweep) -> Sweep | None:
    """Return a sweep with renamed fields: the field ``order[k]`` becomes the field ``fields[k]``.

    Returns None if the renamed sweep would read a neighbour for which the lattice has no symbol.
    """
    into = dict(zip(order, fields, strict=True))
    into |= {old_symbol: new_symbol for new_symbol, old_symbol in turned_increments(sites, fields, order).items()}
    symbol_of_place = {place: name for name, place in (*sites.places.items(), *sites.ends.items())}
    kernels = [sweep.kernel, *(sweep.gather.kernels if sweep.gather else ())]
    names: dict[str, str] = {}
    for s in (s for kernel in kernels for s in (*kernel.inputs.get("site", ()), *kernel.inputs.get("gathered", ()))):
        if isinstance(s, Symbol) and s.kind == GATHERED:
            names[s] = Symbol(GATHERED, into[str(s.key[0])])
            continue
        field, site = sites.ends[s] if s in sites.ends else sites.places[s]
        name = symbol_of_place.get((into.get(field, field), site))
        if name is None:
            return None
        names[s] = name
    new_order = [fields.index(into[fields[i]]) for i in sweep.moved]
    value_order = sorted(range(len(new_order)), key=new_order.__getitem__)
    gather = sweep.gather and replace(
        sweep.gather,
        ends=tuple(replace(e, kernel=_renamed(e.kernel, names)) for e in sweep.gather.ends),
        names=tuple(names.get(n, n) for n in sweep.gather.names),
    )
    kernel = _renamed(sweep.kernel, names, value_order)
    return replace(sweep, kernel=kernel, moved=tuple(sorted(new_order)), gather=gather, tangent=None)


def _renamed(kernel: Kernel, names: Mapping[str, str], places: Sequence[int] = ()) -> Kernel:
    """Return the kernel with its symbols renamed by ``names``; its values are permuted to the order of ``places``, if
    given."""
    values = substitute(kernel.roots, {old_name: symbol(new_name) for old_name, new_name in names.items()})
    inputs = {
        key: tuple(sorted((names.get(s, s) for s in symbols), key=natural_key))
        if key in ("site", "gathered", "bonds")
        else symbols
        for key, symbols in kernel.inputs.items()
    }
    ordered_values = tuple(values[i] for i in places or range(len(values)))
    return replace(kernel, inputs=inputs, outputs=(Output(kernel.outputs[0].name, ordered_values),))
