"""Loops over the bonds of a site of a lattice. The ends of a bond are called a and b. One loop serves both ends if the
formulas at a and at b differ only in the signs of parameters.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

from phigen.scheme.steps import Ends, Gather
from phigen.symbolic.expression import substitute, symbol
from phigen.symbolic.verdict import PROVED, decide_zero

#: Words between the purpose of a kernel and the condition on the bonds to which it applies, such as "begin at a".
ONE_END = "; only for bonds that"


def over_ends(gather: Gather) -> list[tuple[Ends, frozenset[str]]]:
    """Return the loops over the bonds of a site. Each loop comes with the set of the parameters that change their sign
    at the end b.

    Parameters of bonds may depend on the direction of a bond. Often the contributions at the ends a and b differ only
    in the signs of some parameters. If this is proved, one loop is sufficient for both ends. Otherwise each end has its
    own loop, and the sets are empty.
    """
    apart = [(e, frozenset[str]()) for e in gather.ends]
    if len(apart) != 2 or gather.ends[0].chosen != gather.ends[1].chosen:
        return apart
    first, other_end = gather.ends
    bond_parameters = [p for p in first.kernel.inputs.get("bonds", ()) if p in other_end.kernel.inputs.get("bonds", ())]
    for opposite in (c for size in range(1, 1 + len(bond_parameters)) for c in combinations(bond_parameters, size)):
        values_at_other_end = substitute(other_end.kernel.roots, {p: -symbol(p) for p in opposite})
        differences = [("", a - b) for a, b in zip(first.kernel.roots, values_at_other_end, strict=True)]
        if decide_zero("", differences).verdict == PROVED:
            name = first.kernel.name.removesuffix(f"_{first.end}")
            purpose = first.kernel.purpose.partition(ONE_END)[0]
            kernel = replace(first.kernel, name=name, purpose=purpose)
            return [(replace(first, kernel=kernel, end=""), frozenset(opposite))]
    return apart
