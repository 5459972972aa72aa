"""Loop-invariant code motion: values that are the same at all sites are declared before the loop."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.ir import nodes as ir
from phigen.ir.walk import map_blocks

#: Values that are equal in all iterations of a loop over sites, bonds or pairs.
INVARIANT = ir.Coefficient | ir.SystemParameter | ir.Time


def loop_invariant(function: ir.Function) -> ir.Function:
    """Return the function with the declarations of invariant values moved out of its loops."""

    def moved(body: ir.Block) -> Iterator[ir.Statement]:
        for s in body:
            if isinstance(s, ir.Loop):
                yield from filter(_is_invariant, s.body)
                s = s.with_body(x for x in s.body if not _is_invariant(x))
            yield s

    return map_blocks(function, moved)


def _is_invariant(s: ir.Statement) -> bool:
    return isinstance(s, ir.Declare) and all(isinstance(value, INVARIANT) for _, value in s.items)
