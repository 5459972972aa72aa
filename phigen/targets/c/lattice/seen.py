"""Observables of sites, the energy, Casimirs and the right-hand side, as loops in C."""

from __future__ import annotations

from phigen.ir import nodes as ir
from phigen.ir.passes import row_loops
from phigen.ir.passes.temporaries import temporaries
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.program import Program
from phigen.targets.c.lattice.ends import over_ends
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.lattice.loops import seen_calls
from phigen.targets.c.lattice.partners import bond_loop
from phigen.targets.c.layout import comment
from phigen.targets.c.loops import statements
from phigen.targets.header import plain, sentence

#: Doubles that the densities of observables take, unless there are more observables: two pages, a quarter of the
#: nearest cache.
_BUFFER = 1024


def share(densities: Kernel) -> int:
    """Return the number of sites whose densities of observables are computed in one go."""
    return max(1, _BUFFER // len(densities.roots))


def seen_loop(program: Program, layout: Layout, kernel: Kernel) -> str:
    """Return the function that fills arrays over the sites with the values of a kernel.

    What bonds or pairs add is summed before, or at each site where nothing else needs these sums.
    """
    gather, several = layout.partners.sums_of(kernel), kernel.role is Role.OBSERVABLES
    apart = ir.Constant(share(kernel)) if several else row_loops.SITES
    built, rows, meant = temporaries(layout.loops(program).observable(kernel)), layout.rows(program), over_ends(gather)
    if meant and layout.sums_up:
        sums = [bond_loop(program, layout, ends, oriented) for ends, oriented in meant]
        body = row_loops.observable_with_bonds(built, rows, sums, apart)
    else:
        body = row_loops.observable(built, rows, [ends.kernel.name for ends, _ in meant], apart)
    head = comment(f"/* {plain(sentence(kernel.purpose + ', at the sites of a row'))} */")
    head.append(
        f"static void {program.name}_{kernel.name}_row(const {program.name}_row *row, double *restrict out)\n{{"
    )
    return "\n".join(
        [
            *head,
            statements(body, program.name, seen_calls(program), layout.reserved(program, len(kernel.roots))) + "}\n",
        ]
    )
