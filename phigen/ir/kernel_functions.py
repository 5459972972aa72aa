"""Builder of the functions of kernels: straight-line code that reads entries of arrays, and stores results to
arrays.

The functions need no lowering. The passes `zeros`, `output_order`, `cutting` and `simd_lanes` of `phigen.ir.passes`
change the functions before they are printed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from phigen.ir import nodes as ir
from phigen.scheme.kernel import SCALARS, Kernel
from phigen.scheme.lowering import assign, expand_powers
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.symbols import Symbol


def kernel_function(
    kernel: Kernel, members: Mapping[str, str], arrays: Mapping[str, str] | None = None, *, named: bool = False
) -> ir.Function:
    """Return the function of a kernel: declarations of the values that it reads, temporaries, then stores.

    ``members`` maps parameters of the system to their names in the record of parameters; ``arrays`` renames arguments.
    With ``named``, parameters of the system get variables. Values that have no name in the spec never get a variable. A
    value without a variable is read from its array or record wherever it is used.
    """
    arguments = [*kernel.inputs, *(o.name for o in kernel.outputs)]
    names = {argument: ir.fixed((arrays or {}).get(argument, argument)) for argument in arguments}
    roots = kernel.roots
    expanded = expand_powers([*roots, *(e for _, e in kernel.named)])
    named_values = zip(kernel.named, expanded[len(roots) :], strict=True)
    assignments, trees = assign(expanded[: len(roots)], {id(e): name for (name, _), e in named_values if e.args})
    places = (ir.entry(names[o.name], i) for o in kernel.outputs for i in range(len(o.values)))
    body = (
        *_reads(kernel, {*symbols_of(*expanded[: len(roots)])}, members, names, named=named),
        *(ir.real(a.target, a.value) for a in assignments),
        *(ir.Assign(place, tree) for place, tree in zip(places, trees, strict=True)),
    )
    parameters = tuple(name.text for name in names.values())
    return ir.Function(kernel.name, kernel.purpose, kernel.role, parameters, body)


def _reads(
    kernel: Kernel, used: set[str], members: Mapping[str, str], names: Mapping[str, ir.Name], *, named: bool
) -> Iterator[ir.Statement]:
    """Yield the declarations of those inputs of a kernel whose symbols are in ``used``."""
    for argument, symbols in kernel.inputs.items():
        for i, s in enumerate(symbols):
            if s not in used:
                continue
            if argument == "params":
                place: ir.Value = ir.Member(names[argument], members[s])
                yield ir.real(s, place) if named else ir.in_place(s, place)
            else:
                place = names[argument] if argument in SCALARS else ir.entry(names[argument], i)
                internal = argument in SCALARS or isinstance(s, Symbol)
                yield ir.in_place(s, place) if internal else ir.real(s, place)
