"""Transposes of sums over bonds or pairs of sites, as a site receives them from each: both as a and as b.

Where the sums of b are those of a but for a sign, as forces are that act between two sites, the site gets as b what it
gets as a, for the cotangents of the other one: a product of the Hessian of the pair's energy with one vector.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from phigen.scheme.kernel import Kernel, Output
from phigen.symbolic.expression import ZERO, Expression, substitute, symbol
from phigen.symbolic.symbols import HERE, THERE, Symbol
from phigen.symbolic.verdict import PROVED, decide_zero

_OTHER = {"a": "b", "b": "a"}


def paired(ends: Mapping[str, tuple[str, str]], kernel: Kernel, back: Kernel, opposite: Collection[str] = ()) -> Kernel:
    """The transpose of a kernel of bonds or pairs that finds all that a site, as a, gets from one of them.

    ``ends`` tells of each symbol the field, or parameter, and the end; parameters at bonds that are ``opposite`` have
    the other sign seen from b. Of sums over all bonds or pairs, and of parameters at bonds, it finds what is to be
    added up over all sites and their bonds or pairs.
    """
    names = {place: s for s, place in ends.items()}
    turned = {s: symbol(names[base, _OTHER[end]]) for s, (base, end) in ends.items()}
    turned |= {p: -symbol(p) for p in opposite}
    there = {s: symbol(Symbol(THERE, k)) for k, s in enumerate(back.inputs[HERE])}
    along = dict(back.along("site"))
    fields = dict.fromkeys(ends[s][0] for s, e in along.items() if not e.is_zero)
    at_a, at_b = ([along.get(names[f, end], ZERO) for f in fields] for end in "ab")
    rest = [o for o in back.outputs if o.name != "site_bar"]
    signs = _signs(kernel.roots, turned)
    if signs:
        both = {s: symbol(s) + sign * e for (s, e), sign in zip(there.items(), signs, strict=True)}
        found = substitute(at_a, both)
        rest = [replace(o, values=tuple(Fraction(1, 2) * e for e in substitute(o.values, both))) for o in rest]
    else:
        found = [e + other for e, other in zip(at_a, substitute(at_b, turned | there), strict=True)]
    site = [names[f, "a"] for f in fields]
    values = [*found, *[ZERO] * (len(ends) - len(site))]
    site += [s for s in ends if s not in site]
    return replace(
        back,
        inputs={**back.inputs, "site": tuple(site), THERE: tuple(e.value for e in there.values())},
        outputs=(Output("site_bar", tuple(values)), *rest),
    )


def _signs(sums: Sequence[Expression], turned: Mapping[str, Expression]) -> list[int]:
    """By which factors, 1 or -1, the sums of b are those of a, if that is proved of all of them; else none."""
    found = []
    for own, other in zip(sums, substitute(sums, turned), strict=True):
        proved = (sign for sign in (-1, 1) if decide_zero("", [("", own - sign * other)]).verdict == PROVED)
        found.append(next(proved, 0))
    return found if all(found) else []
