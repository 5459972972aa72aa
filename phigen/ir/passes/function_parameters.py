"""Parameters of functions: their types, and statements that mark unread parameters as unused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phigen.ir import nodes as ir
from phigen.ir.walk import names_in
from phigen.scheme.kernel import Role


def discard_unread(function: ir.Function) -> ir.Function:
    """Return the function with a statement for each parameter that it never reads. The statements mark these parameters
    as unused.
    """
    read = names_in(function.body)
    unread = (ir.Discard(p) for p in function.parameters if ir.fixed(p).symbol not in read)
    return function.with_body(*unread, *function.body)


def typed_function(
    name: str, doc: str, parameters: Sequence[str], body: ir.Block, types: Mapping[str, ir.ParameterType]
) -> ir.Function:
    """Return a function whose parameters have the types in ``types``. Parameters that are never read are marked as
    unused.
    """
    listed = tuple((p, types[p]) for p in parameters if p in types)
    return discard_unread(ir.Function(name, doc, Role.OTHER, tuple(parameters), body, listed))
