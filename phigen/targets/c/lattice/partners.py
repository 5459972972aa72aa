"""Sums over the bonds of a site, or over its pairs with other sites, as loops in C."""

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
    """Yield the loops that sum the terms of bonds or pairs in energies and updates of sites, from the parameters."""
    sums = layout.partners
    for gather in () if layout.sums_up else (sums.field, sums.energy, sums.varied, sums.observed):
        yield from (loop.text(program) for loop in gathering(program, layout, gather, "params"))


def gathering(program: Program, layout: Layout, gather: Gather, source: str) -> Iterator[Loop]:
    """Yield the loops that sum over all bonds of a site, or its pairs with other sites, from ``coef`` or ``params``."""
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
    """Return further arguments of short loops over bonds, with types, so that several parts of H share a loop.

    The arguments are the address of the parameters at bonds, the sign of the direction of bonds, and whether the sites
    of the chosen colour are at the other end of the bonds.
    """
    if program.profile == "fast" or layout.step.adjoint or not layout.graph:
        return {}
    arguments = {"at_bonds": "double *const *", "sign": "double "} if opposite else {}
    both = ends.chosen != "" and {"here", "there"} <= chosen_ends(layout.step)
    return arguments | ({"across": "int "} if both else {})


def bond_loop(
    program: Program, layout: Layout, ends: Ends, oriented: Set[str], arguments: Collection[str] = ()
) -> row_loops.BondLoop:
    """Return one loop over bonds or pairs, which has some ``arguments`` of `told_of_bonds`."""
    built = temporaries(layout.loops(program).sums(ends))
    at_bonds: ir.Value = ir.fixed("at_bonds") if "at_bonds" in arguments else AT_BONDS
    return row_loops.BondLoop(built, frozenset(oriented), at_bonds, "sign" in arguments, "across" in arguments)
