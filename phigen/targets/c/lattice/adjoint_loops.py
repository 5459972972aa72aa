"""The loops of the reverse pass of a kernel at sites, in two traversals: see `adjoint`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from phigen.ir import nodes as ir
from phigen.ir.passes import row_transposes
from phigen.ir.passes.row_transposes import Handed
from phigen.scheme.kernel import Kernel
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.lattice.loops import RowLoops


@dataclass(frozen=True)
class Seeds:
    """The place of the cotangents of the values of a kernel, which are symbols of a ``kind``.

    They are in the arrays of cotangents with the numbers ``bars``, or if these are empty in the variation of the row;
    the sites have the ``colour``.
    """

    kind: str
    bars: tuple[int, ...] = ()
    colour: int | None = None


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


@dataclass(frozen=True)
class First:
    """The first loop of the transpose of a kernel.

    Cotangents of ``sums`` over bonds or pairs, if it computes any, are stored in arrays from ``begin`` on. It
    recomputes the fields ``recomputed`` before the sweep. The cotangents passed by the flow after it are ``received``.
    """

    loops: RowLoops
    kernel: Kernel
    seeds: Seeds
    sums: Sequence[str]
    handed: tuple[Handed, ...]
    begin: int
    recomputed: tuple[str, ...] = ()
    received: tuple[Handed, ...] = ()

    @property
    def on_sites(self) -> ir.Function:
        """The loop on the level of sites."""
        return self.loops.sites.recomputing(self.kernel, self.sums, self.recomputed, self.seeds.colour)

    def loops_of(self, form: str, versions: Mapping[str, str]) -> list[ir.Function]:
        """Return the loops of one form, by rows."""
        summed = len(self.sums) * any(o.name == "gathered_bar" for o in self.kernel.outputs)
        return [
            row_transposes.transposed(
                row_transposes.Transpose(
                    loop,
                    self.seeds.kind,
                    self.seeds.bars,
                    self.handed,
                    self.begin,
                    summed,
                    self.received,
                    frozenset(self.recomputed),
                ),
                self.loops.rows,
                vectors=self.loops.fast,
            )
            for loop in self.loops.after_passes(self.on_sites, form, versions)
        ]
