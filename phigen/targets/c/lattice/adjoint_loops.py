"""The loops that pull cotangents back through a kernel at sites, in two goes: see `adjoint`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from phigen.ir.passes import row_transposes
from phigen.ir.passes.row_transposes import Handed
from phigen.ir.passes.temporaries import temporaries
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.targets.c.kernels import FUNCTIONS
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.lattice.loops import Loop, told
from phigen.targets.c.loops import statements


@dataclass(frozen=True)
class Seeds:
    """Where the cotangents of what a kernel computes are read, which are symbols of a ``kind``.

    They are in the arrays of cotangents with the numbers ``bars``, or if these are empty in the variation of the row;
    the sites have the ``colour``.
    """

    kind: str
    bars: tuple[int, ...] = ()
    colour: int | None = 0


def handed_by(layout: Layout, kernel: Kernel, first: int) -> list[Handed]:
    """List the cotangents that a kernel passes to neighbours, in arrays from the first on; equal values share one."""
    arrays: dict[int, int] = {}
    contributions = []
    for name, value in kernel.along("site"):
        base, offset = layout.step.sites.places[name]
        if any(offset) and not value.is_zero:
            array = arrays.setdefault(id(value), first + len(arrays))
            contributions.append(Handed(array, layout.bar(base), offset))
    return contributions


def first_loop(
    program: Program,
    layout: Layout,
    kernel: Kernel,
    form: str,
    seeds: Seeds,
    sums: Sequence[str],
    handed: Sequence[Handed],
    begin: int,
    calls: Mapping[str, str],
    moved: Sequence[str] = (),
    received: Sequence[Handed] = (),
) -> Loop:
    """The first go of a kernel; cotangents of ``sums`` over bonds or pairs, if it finds any, are handed in arrays from
    ``begin`` on.

    ``moved`` are the fields that it finds as they were before the sweep. The cotangents passed by the flow after it
    are ``received`` before."""
    summed = len(sums) * any(o.name == "gathered_bar" for o in kernel.outputs)
    transpose = row_transposes.Transpose(
        temporaries(layout.loops(program).recomputing(kernel, sums, moved)),
        seeds.kind,
        seeds.bars,
        tuple(handed),
        begin,
        summed,
        tuple(received),
        frozenset(moved),
        seeds.colour if layout.leaves_out(seeds.colour) else None,
    )
    body = row_transposes.transposed(transpose, layout.rows(program), vectors=program.profile == "fast")
    text = statements(body, program.name, calls, layout.reserved(program, len(kernel.roots)))
    return Loop(kernel.name + form, kernel.purpose, f"{told(program)}, double *sums", text)


def copied_ends(program: Program, layout: Layout, handed: Sequence[Handed], swept: str) -> Iterator[str]:
    """Yield the copies of the ends of rows for cotangents passed along rows, if ``swept``; open ends have none."""
    if layout.step.sites.open[-1]:
        return
    for array in sorted({h.array for h in handed if h.offset[-1]}):
        yield f"{program.name}_ends(row.handed[{array}]{layout.at(0, 'row.')}, s->length, {swept});"


def handing(program: Program, layout: Layout, name: str, whom: str, handed: Sequence[Handed]) -> Loop:
    """The second go of a part: a site at an offset from another is handed what that has for it."""
    body = row_transposes.handing(handed, layout.rows(program))
    purpose = f"what sites are handed by those around that {whom}"
    return Loop(name, purpose, told(program, "params"), statements(body, program.name, FUNCTIONS))
