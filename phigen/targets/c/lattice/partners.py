"""What bonds, or pairs of sites, add up at a site, as loops in C."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Set

from phigen.ir import nodes as ir
from phigen.ir.passes import row_loops
from phigen.ir.passes.by_rows import AT_BONDS
from phigen.ir.passes.temporaries import temporaries
from phigen.scheme.program import Program
from phigen.scheme.steps import Ends, Gather
from phigen.targets.c.lattice.ends import over_ends
from phigen.targets.c.lattice.layout import Layout, chosen_ends
from phigen.targets.c.lattice.loops import Loop, in_loops, seen_calls, told
from phigen.targets.c.loops import statements


def partners(program: Program, layout: Layout) -> Iterator[str]:
    """What bonds or pairs add to energies, and to what moves sites, from the parameters."""
    own = layout.partners
    for gather in () if layout.sums_up else (own.field, own.energy, own.varied, own.observed):
        yield from (loop.text(program) for loop in gathering(program, layout, gather, "params"))


def gathering(program: Program, layout: Layout, gather: Gather, source: str) -> Iterator[Loop]:
    """What all bonds, or pairs with other sites, add up at some sites, from ``coef`` or ``params``."""
    seen = source == "params" and gather in (layout.partners.energy, layout.partners.field, layout.partners.observed)
    calls = seen_calls(program) if seen else in_loops(program)
    for number, (ends, opposite) in enumerate(over_ends(gather)):
        more = told_of_bonds(program, layout, ends, opposite) if source == "coef" else {}
        one = bond_loop(program, layout, ends, opposite, more)
        rows = layout.rows(program)
        body = row_loops.over_bonds(one, rows, first=number == 0) if layout.graph else row_loops.over_pairs(one, rows)
        text = statements(body, program.name, calls, layout.reserved(program, len(ends.kernel.roots)))
        arguments = ", ".join([told(program, source), *(f"{kind}{name}" for name, kind in more.items())])
        yield Loop(ends.kernel.name, ends.kernel.purpose, arguments, text)


def told_of_bonds(program: Program, layout: Layout, ends: Ends, opposite: Set[str]) -> dict[str, str]:
    """What short loops over bonds are told besides, with its type, so that one is for several parts of H.

    That is where the parameters at bonds are, the sign of the direction of bonds, and whether the sites of the colour
    that is chosen lie across them.
    """
    if program.profile == "fast" or layout.step.adjoint or not layout.graph:
        return {}
    told = {"at_bonds": "double *const *", "sign": "double "} if opposite else {}
    both = ends.chosen != "" and {"here", "there"} <= chosen_ends(layout.step)
    return told | ({"across": "int "} if both else {})


def bond_loop(
    program: Program, layout: Layout, ends: Ends, oriented: Set[str], told: Collection[str] = ()
) -> row_loops.BondLoop:
    """Return the function of one loop over bonds or pairs, which is ``told`` some of `told_of_bonds`."""
    built = temporaries(layout.loops(program).sums(ends))
    at_bonds: ir.Value = ir.fixed("at_bonds") if "at_bonds" in told else AT_BONDS
    return row_loops.BondLoop(built, frozenset(oriented), at_bonds, "sign" in told, "across" in told)
