"""Simultaneous updates: all increments of a sweep at a site are computed before any field is updated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.walk import map_blocks


def simultaneous(function: ir.Function) -> ir.Function:
    """Return the function with all increments of a sweep stored in variables before any field is updated.

    A function that is no sweep, or that has a single increment, is returned unchanged.
    """
    if not function.role.is_sweep:
        return function

    def change(body: ir.Block) -> Iterator[ir.Statement]:
        stores = [s for s in body if isinstance(s, ir.Update)]
        if len(stores) < 2:
            yield from body
            return
        names = [ir.fixed(f"change{k}") for k in range(len(stores))]
        yield from (s for s in body if not isinstance(s, ir.Update))
        yield from (ir.real(n, s.value) for n, s in zip(names, stores, strict=True))
        yield from (replace(s, value=n) for n, s in zip(names, stores, strict=True))

    return map_blocks(function, change)
