"""Code for sites in loops: variables for indices, the index of a site's value in an array, and the loop over pairs."""

from __future__ import annotations

from collections.abc import Iterable

from phigen.ir import nodes as ir

SITE, OTHER, SITES, COUNT = (ir.fixed(name) for name in ("i", "j", "sites", "count"))


def of_array(site: ir.Value, number: int) -> ir.Value:
    """Return the index of the value at a site, in a sequence of arrays over all sites; ``number`` is the number of the
    array.
    """
    if number == 0:
        return site
    return ir.Binary("+", site, COUNT if number == 1 else ir.Binary("*", ir.Constant(number), COUNT))


def over_pairs(body: Iterable[ir.Statement], selection: ir.Selection = ir.ALL_SITES) -> ir.Loop:
    """Return the loop over the sites with which a site forms pairs; ``selection`` may exclude some of them."""
    other = ir.If(ir.Binary("==", OTHER, SITE), (ir.Continue(),))
    high = ir.Member(SITES, "massive") if selection.massive else COUNT
    return ir.Loop("plain", (other, *body), "j", ir.Constant(selection.first), high)
