"""Unread parameters: functions that share a signature mark those that they do not read, for the compiler."""

from __future__ import annotations

from phigen.ir import nodes as ir
from phigen.ir.walk import names_in


def discard_unread(function: ir.Function) -> ir.Function:
    """Return the function with a statement for each parameter that it does not read."""
    read = names_in(function.body)
    unread = (ir.Discard(p) for p in function.parameters if ir.fixed(p).symbol not in read)
    return function.with_body(*unread, *function.body)
