"""Builders of functions on the parameters of a lattice: checks, copies into rows, and sums of derivatives.

A parameter of a lattice has one value for all sites, or a value at each site or bond. ``members`` maps parameters to
their names in the record of parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.passes.function_parameters import typed_function
from phigen.spec.model import Parameter

S, PARAMS, K, NULL = (ir.fixed(name) for name in ("s", "params", "k", "NULL"))
BAR, PARAMS_BAR, DERIVATIVES = (ir.fixed(name) for name in ("bar", "params_bar", "derivatives"))
_TYPES: Mapping[str, ir.ParameterType] = {
    "s": ir.RecordType("solver"),
    "params": ir.RecordType("params"),
    "params_bar": ir.RecordType("params_bar", mutable=True),
    "derivatives": ir.Pointer(),
    "sites": ir.Type.SIZE,
    "bonds": ir.Type.SIZE,
}


def are_allowed(parameters: Sequence[Parameter], members: Mapping[str, str], *, graph: bool) -> ir.Function:
    """Return the function that returns 1 if all parameters are finite and have the required signs, else 0."""
    body, conditions = list[ir.Statement](), list[ir.Value]()
    for p in parameters:
        array, zero = ir.Member(PARAMS, members[p.name]), ir.Constant(0.0)
        if p.at == "all":
            conditions.append(ir.Called("isfinite", (array,)))
            conditions += [ir.Binary(">" if p.positive else ">=", array, zero)] if p.bound else []
            continue
        wrong: ir.Value = ir.Prefix("not", ir.Called("isfinite", (ir.Entry(array, K),)))
        if p.bound:
            wrong = ir.Binary("or", wrong, ir.Binary("<=" if p.positive else "<", ir.Entry(array, K), zero))
        refusal = (ir.Return(ir.Constant(0)),)
        if p.values is not None:
            body.append(ir.If(ir.Binary("==", array, NULL), refusal))
        is_array, search = ir.Binary("!=", array, NULL), (ir.If(wrong, refusal),)
        body.append(ir.Loop("search", search, "k", ir.Constant(0), ir.fixed(p.at), condition=is_array))
    value = ir.joined("and", *conditions) if conditions else ir.Constant(1)
    names = ("params", "sites", *["bonds"] * graph)
    doc = "Whether all parameters are finite and within their bounds"
    function = typed_function("allowed", doc, names, (*body, ir.Return(value)), _TYPES)
    return replace(function, returns=ir.Type.FLAG)


def copies(
    parameters: Sequence[Parameter], members: Mapping[str, str], arrays: Sequence[str], at_bonds: Sequence[str]
) -> Iterator[ir.Function]:
    """Yield the functions that copy parameters from arrays of the caller. Parameters at sites are copied into the rows
    of ``arrays``, and parameters at bonds into ``at_bonds``.
    """
    sites, bonds = ([p for p in parameters if p.at == at] for at in ("sites", "bonds"))
    types = {**_TYPES, "s": ir.RecordType("solver", mutable=True)}
    if sites:
        body = [
            ir.Call("put_parameter", (S, _row("x", arrays.index(p.name)), _of(PARAMS, p, members), _default(p)))
            for p in sites
        ]
        doc = "Copy the parameters that may vary between sites to arrays of the solver"
        yield typed_function("put_parameters", doc, ("s", "params"), (*body, _copied(sites, members)), types)
    if bonds:
        number = ir.Entry(ir.Member(S, "number"), K)
        selected = (
            (p, ir.Select(ir.Binary("!=", array, NULL), ir.Entry(array, number), _default(p)))
            for p in bonds
            for array in [_of(PARAMS, p, members)]
        )
        each = tuple(ir.Assign(ir.Entry(_row("at_bonds", at_bonds.index(p.name)), K), value) for p, value in selected)
        count = ir.Entry(ir.Member(S, "bonds"), ir.Member(S, "sites"))
        loop = ir.Loop("entries", each, "k", ir.Constant(0), count)
        doc = "Copy the parameters at bonds, in the order of the bonds of each site"
        yield typed_function("put_at_bonds", doc, ("s", "params"), (loop, _copied(bonds, members)), types)


def _copied(parameters: Sequence[Parameter], members: Mapping[str, str]) -> ir.Assign:
    """Return the statement that sets the pointers in ``params`` to null. The statement comes after the loop that copies
    the arrays of the caller.
    """
    first, *others = (_of(ir.Member(S, "params"), p, members) for p in parameters)
    return ir.Assign(first, NULL, too=tuple(others))


def sums_of_derivatives(
    parameters: Sequence[Parameter], members: Mapping[str, str], bars: Mapping[str, int]
) -> Iterator[ir.Function]:
    """Yield the functions that add derivatives with respect to parameters to arrays of the caller.

    ``bars`` maps each parameter at sites or bonds to the number of its cotangent array. A parameter with one value for
    all sites has one derivative.
    """
    numbers = [p for p in parameters if p.at == "all"]
    if numbers:
        body = tuple(
            ir.Assign(_of(PARAMS_BAR, p, members), ir.entry(DERIVATIVES, k), adds=True) for k, p in enumerate(numbers)
        )
        doc = "Add the derivatives with respect to those parameters that have one value for all sites"
        yield typed_function("add_numbers", doc, ("derivatives", "params_bar"), body, _TYPES)
    by_name = {p.name: p for p in parameters}
    calls = tuple(
        ir.Call(f"add_at_{p.at}", (S, ir.entry(BAR, bar), _of(PARAMS_BAR, p, members)))
        for name, bar in bars.items()
        for p in [by_name[name]]
    )
    doc = "Add the derivatives with respect to those parameters that have a value at each site or bond"
    yield typed_function("add_arrays", doc, ("s", "bar", "params_bar"), calls, _TYPES)


def _of(record: ir.Value, parameter: Parameter, members: Mapping[str, str]) -> ir.Member:
    return ir.Member(record, members[parameter.name])


def _row(array: str, number: int) -> ir.Entry:
    return ir.entry(ir.Member(S, array), number)


def _default(parameter: Parameter) -> ir.Constant:
    return ir.Constant(float(parameter.value))
