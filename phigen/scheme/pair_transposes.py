"""Transposes of sums over the bonds or pairs of each site of a lattice: a site collects its cotangents from its
bonds.

A site is the end a of some bonds and the end b of others. A bond adds one term at its end a, and one term at its end b.
Often these terms are equal up to the sign, as for forces between two sites. Then one formula is sufficient: the
transpose of the term at a, applied to the sum or the difference of the cotangents of the two sites. For forces, this
formula is a matrix times a vector; the matrix is the Hessian of the energy of the pair.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.steps import Ends
from phigen.symbolic.expression import ZERO, Expression, substitute, symbol
from phigen.symbolic.symbols import HERE, THERE, Symbol
from phigen.symbolic.verdict import PROVED, decide_zero

_OTHER = {"a": "b", "b": "a"}


#: Values of `Ends.end` and of `Ends.chosen` after an exchange of the two sites of a bond.
_OPPOSITE = {"": "", "a": "b", "b": "a"}
_CHOSEN = {"": "", "here": "there", "there": "here"}


def transposed_at_ends(
    places: Mapping[str, tuple[str, str]], ends: Ends, opposite: Collection[str], transpose: Kernel, *, summed: bool
) -> list[tuple[str, Ends, Kernel]]:
    """Return the loops over bonds or pairs in which each site collects its own cotangents.

    No two sites write to the same place. A loop is given by three values: the end of the bonds or pairs at which the
    site lies; the bonds or pairs; and the kernel. If every bond or pair contributes to both of its sites, there is one
    loop. Then its kernel computes the sums over bonds or pairs too, if ``summed`` is true. If ``ends`` selects an end
    or a colour, there are two loops. In the first, the site is the end b of its bonds, and the loop reads the
    cotangents of the sites at the ends a. In the second, the site is the end a.
    """
    if ends.of_all:
        combined = paired(places, ends.kernel, transpose, opposite)
        sums = [o for o in ends.kernel.outputs if summed]
        transposes = [("a", ends, replace(combined, outputs=(*combined.outputs, *sums)))]
    else:
        reversed_ends = replace(ends, end=_OPPOSITE[ends.end], chosen=_CHOSEN[ends.chosen])
        transposes = [
            (end, bonds, _at_end(places, transpose, end)) for end, bonds in (("b", reversed_ends), ("a", ends))
        ]
    return [(end, bonds, kernel) for end, bonds, kernel in transposes if any(not e.is_zero for e in kernel.roots)]


def _at_end(ends: Mapping[str, tuple[str, str]], kernel: Kernel, end: str) -> Kernel:
    """Return a copy of a transposed kernel for one ``end`` of a bond or pair, "a" or "b". The cotangents of the site at
    the opposite end are replaced by 0.

    Some cotangents belong to neither end, such as those of parameters of bonds. The copy for the end b computes them,
    and the copy for the end a has 0 in their place.
    """
    outputs = []
    for o in kernel.outputs:
        names = kernel.inputs["site"] if o.name == "site_bar" else ()
        selected = [ends[n][1] == end for n in names] if names else [end == "b"] * len(o.values)
        values = tuple(e if keep else ZERO for e, keep in zip(o.values, selected, strict=True))
        outputs.append(replace(o, values=values))
    return replace(kernel, outputs=tuple(outputs))


def paired(
    ends: Mapping[str, tuple[str, str]], kernel: Kernel, transpose: Kernel, opposite: Collection[str] = ()
) -> Kernel:
    """Return the transpose of a kernel of bonds or pairs, with all contributions of a bond added at its end a.

    ``ends`` maps each symbol to a pair: a field or parameter, and an end. ``opposite`` lists the parameters of bonds
    that change their sign if the two ends of a bond are exchanged. Some outputs contribute to sums over the whole
    lattice, or to parameters of bonds. A loop over all sites and their bonds or pairs must add these outputs up.
    """
    names = {place: s for s, place in ends.items()}
    exchanged = {s: symbol(names[base, _OTHER[end]]) for s, (base, end) in ends.items()}
    exchanged |= {p: -symbol(p) for p in opposite}
    at_b_seeds = {s: symbol(Symbol(THERE, k)) for k, s in enumerate(transpose.inputs[HERE])}
    cotangents = dict(transpose.along("site"))
    fields = dict.fromkeys(ends[s][0] for s, e in cotangents.items() if not e.is_zero)
    at_a, at_b = ([cotangents.get(names[f, end], ZERO) for f in fields] for end in "ab")
    remaining_outputs = [o for o in transpose.outputs if o.name != "site_bar"]
    signs = _signs(kernel.roots, exchanged)
    if signs:
        combined = {s: symbol(s) + sign * e for (s, e), sign in zip(at_b_seeds.items(), signs, strict=True)}
        contributions = substitute(at_a, combined)
        remaining_outputs = [
            replace(o, values=tuple(Fraction(1, 2) * e for e in substitute(o.values, combined)))
            for o in remaining_outputs
        ]
    else:
        contributions = [
            e + other_value for e, other_value in zip(at_a, substitute(at_b, exchanged | at_b_seeds), strict=True)
        ]
    site = [names[f, "a"] for f in fields]
    values = [*contributions, *[ZERO] * (len(ends) - len(site))]
    site += [s for s in ends if s not in site]
    return replace(
        transpose,
        inputs={**transpose.inputs, "site": tuple(site), THERE: tuple(e.value for e in at_b_seeds.values())},
        outputs=(Output("site_bar", tuple(values)), *remaining_outputs),
    )


def _signs(sums: Sequence[Expression], exchanged: Mapping[str, Expression]) -> list[int]:
    """Return the factors, 1 or −1, by which the ``sums`` at the end b of a bond differ from those at the end a.

    ``exchanged`` has the symbols after an exchange of the ends. The list is empty unless every factor is proved.
    """
    signs = []
    for value, other_sum in zip(sums, substitute(sums, exchanged), strict=True):
        proved_signs = (sign for sign in (-1, 1) if decide_zero("", [("", value - sign * other_sum)]).verdict == PROVED)
        signs.append(next(proved_signs, 0))
    return signs if all(signs) else []
