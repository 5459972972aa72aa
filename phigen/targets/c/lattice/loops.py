"""Kernels of lattices in C as loops over the sites of a row segment, and the order of the passes that produce these
loops.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes import row_loops, row_transposes
from phigen.ir.passes.forms import FULL_RANGE, IN_LANES, calling, forms_of
from phigen.ir.passes.open_ends import divided_at_ends
from phigen.ir.passes.simultaneous import simultaneous
from phigen.ir.passes.temporaries import temporaries
from phigen.lanes.in_lanes import Rows
from phigen.scheme.bond_ends import over_ends
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.pair_transposes import transposed_at_ends
from phigen.scheme.program import Program
from phigen.scheme.steps import Ends, Gather, Sweep
from phigen.scheme.sweep_facts import chosen_ends
from phigen.symbolic.symbols import HERE, Symbol
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.layout import comment
from phigen.targets.c.loops import function
from phigen.targets.header import plain, sentence

#: Pattern of names such as H_1, which parts of H have in comments.
_PART = re.compile(r"\bH_\d+")

#: Number of doubles in the buffer for densities of observables: two memory pages, a quarter of the L1 cache. If a
#: solver has more observables than this, the buffer is larger.
_BUFFER = 1024

#: The versions of elementary functions that are called, by form (`phigen.ir.passes.forms`).
Forms = Mapping[str, Mapping[str, str]]


def printed(program: Program, loop: ir.Function, purposes: Iterable[str] = (), *, inline: bool = True) -> str:
    """Return the text of a loop with a comment that states its purpose.

    ``purposes`` are the purposes of all loops with the same code; by default, the comment has the purpose of the loop.
    """
    sentences = [plain(sentence(purpose)) for purpose in _merged_purposes(purposes or (loop.doc,))]
    lines = [line for text in sentences for line in comment(text, "   ")]
    lines[0] = f"/* {lines[0].strip()}"
    return "\n".join([*lines[:-1], f"{lines[-1]} */", function(loop, program, "static inline" if inline else "static")])


def _merged_purposes(purposes: Iterable[str]) -> Iterator[str]:
    """Yield the purposes of a loop. Purposes that differ only in the part of H become one sentence that names all
    parts.
    """
    grouped: dict[str, dict[str, None]] = {}
    for purpose in purposes:
        part, _, manner = purpose.rpartition(": ")
        name = _PART.search(manner)
        text, entry = (f"{part}: {{}}", manner) if part or not name else (manner.replace(name[0], "{}"), name[0])
        grouped.setdefault(text, {})[entry] = None
    for text, entries in grouped.items():
        yield text.removeprefix(": ").replace("{}", ("; " if ": " in text else ", ").join(entries))


def code(loop: ir.Function) -> tuple[tuple[str, ...], ir.Block]:
    """Return the parameters and statements of a loop. Loops for which these are equal have equal code."""
    return loop.parameters, loop.body


def share(densities: Kernel) -> int:
    """Return the number of sites for which the densities of observables are computed in one pass. The number is limited
    by the size of the buffer.
    """
    return max(1, _BUFFER // len(densities.roots))


@dataclass(frozen=True)
class RowLoops:
    """Builder of the loops over the sites of one lattice. Each loop runs over a row segment."""

    layout: Layout

    @property
    def program(self) -> Program:
        """The program of the lattice."""
        return self.layout.program

    @property
    def fast(self) -> bool:
        """Whether the code is optimised for speed, not for length."""
        return self.program.profile == "fast"

    @property
    def sites(self) -> LatticeLoops:
        """The builder of loops before they are lowered to rows."""
        return self.layout.lattice

    @property
    def versions(self) -> Mapping[str, str]:
        """The versions of elementary functions that a loop with a single form calls. In the profile ``fast``, these are
        the versions for SIMD lanes. In other profiles, these are the versions for all arguments.
        """
        return IN_LANES if self.fast else FULL_RANGE

    def forms(self, rows: Rows | None, loops: Iterable[ir.Function]) -> Forms:
        """Return the forms of ``loops``: for the suffix of each form, the versions of elementary functions that are
        called.

        There are two forms, for small arguments and for all arguments, if one of the ``loops`` calls a function whose
        fast version fails at large arguments. ``rows`` has the data on loops over sites in SIMD lanes; if it is None,
        there is a single form.
        """
        if rows is None:
            return {"": self.versions}
        return forms_of(loops, rows.small_argument, rows.limited, self.versions)

    def after_passes(self, loop: ir.Function, form: str, versions: Mapping[str, str]) -> Iterator[ir.Function]:
        """Yield the loop after all passes that come before the lowering. In the profile ``fast``, there may be a second
        loop, for sites near open ends.
        """
        full_range_doc = f"as {self.program.name}_{loop.name}_near, with functions for arguments of any size"
        doc = full_range_doc if form == "_full_range" else loop.doc
        loop = replace(loop, name=loop.name + form, doc=doc)
        for part in divided_at_ends(loop) if self.fast else [loop]:
            yield calling(simultaneous(temporaries(part)), versions)

    def sweep(self, sweep: Sweep, form: str, versions: Mapping[str, str]) -> list[ir.Function]:
        """Return the loops of a sweep, which update some fields of the sites of a row, or the variations of these
        fields.
        """
        loops = self.after_passes(self.sites.sweep(sweep), form, versions)
        compensated = self.program.compensated
        return [row_loops.sweep(loop, self.layout, passed=not self.fast, compensated=compensated) for loop in loops]

    def stage(self, kernel: Kernel, form: str, versions: Mapping[str, str], *, adds: bool) -> list[ir.Function]:
        """Return the loops of a kernel of a stage, which assign their results to the arrays of the row, or add them if
        ``adds``.
        """
        fields = self.program.coordinates
        outputs = [Symbol("out", f) for f in fields]
        if kernel.role is Role.OWN_SLOPE:
            outputs = [Symbol("out", f, g) for f in fields for g in fields]
        loops = self.after_passes(self.sites.stage(kernel), form, versions)
        return [row_loops.stage(loop, self.layout, outputs, adds=adds) for loop in loops]

    def sums(self, gather: Gather | None, *, swept: bool = False) -> Iterator[ir.Function]:
        """Yield the row functions that sum over all bonds of a site, or over all pairs of the site with another
        site.

        If ``swept`` is true, a sweep reads the sums. Then the row functions may have additional arguments, see
        `bond_arguments`.
        """
        partners = self.layout.partners
        of_parts = [sums for _, sums in partners.of_parts]
        observed = not swept and gather in (partners.energy, partners.field, partners.observed, *of_parts)
        for number, (ends, oriented) in enumerate(over_ends(gather) if gather else ()):
            arguments = self.bond_arguments(ends, oriented) if swept else ()
            one = self._bond_loop(ends, oriented, {} if observed else self.versions, arguments)
            over = row_loops.over_bonds(one, self.layout, first=number == 0) if self.layout.graph else None
            yield over or row_loops.over_pairs(one, self.layout)

    def bond_arguments(self, ends: Ends, oriented: frozenset[str]) -> tuple[str, ...]:
        """Return the additional arguments of a loop over bonds; () if it has none. By these arguments several parts of
        H share a loop, in profiles other than ``fast``. `BondLoop` explains the arguments.
        """
        if self.fast or self.layout.step.adjoint or not self.layout.graph:
            return ()
        both = ends.chosen != "" and {"here", "there"} <= chosen_ends(self.layout.step)
        return (*["at_bonds", "sign"] * bool(oriented), *["across"] * both)

    def _bond_loop(
        self, ends: Ends, oriented: frozenset[str], versions: Mapping[str, str], arguments: tuple[str, ...] = ()
    ) -> row_loops.BondLoop:
        return row_loops.BondLoop(calling(temporaries(self.sites.sums(ends)), versions), oriented, arguments)

    def transposed_sums(
        self, ends: Ends, oriented: frozenset[str], kernel: Kernel, first: int, *, summed: bool
    ) -> Iterator[ir.Function]:
        """Yield the transposes of a loop that sums over bonds or pairs, one for each end; see `transposed_at_ends`.

        The cotangents of the sums are in the arrays with numbers from ``first`` on.
        """
        places = self.layout.step.sites.ends
        for end, bonds, transpose in transposed_at_ends(places, ends, oriented, kernel, summed=summed):
            built = calling(temporaries(self.sites.transposed_sums(bonds, transpose)), self.versions)
            name, purpose = kernel.name, "contributions of all sums over bonds or pairs to the cotangents of a site"
            if not ends.of_all:
                receiver = "the site of a sum" if end == "a" else "the sites in a sum"
                name, purpose = (
                    f"{kernel.name}_{end}",
                    f"contributions of sums over bonds or pairs to the cotangents of {receiver}",
                )
            of_bonds = row_transposes.BondTranspose(
                replace(built, name=name, doc=purpose), end, first, len(transpose.inputs[HERE]), oriented
            )
            yield row_transposes.transposed_sums(of_bonds, self.layout)

    def observable(self, kernel: Kernel) -> ir.Function:
        """Return the function that fills arrays over the sites with the values of a kernel.

        The function first calls other functions, which compute sums over bonds or pairs. There is one exception: on a
        graph, if steps have no implicit stages, only observables need the sums. In this case the function computes the
        sums itself, in inner loops over the bonds of each site.
        """
        gather, several = self.layout.partners.sums_of(kernel), kernel.role is Role.OBSERVABLES
        apart = ir.Constant(share(kernel)) if several else row_loops.SITES
        built, meant = temporaries(self.sites.observable(kernel)), over_ends(gather)
        built = replace(built, name=f"{kernel.name}_row", doc=f"{kernel.purpose}, at the sites of a row")
        if meant and self.layout.sums_up:
            sums = [self._bond_loop(ends, oriented, {}) for ends, oriented in meant]
            return row_loops.observable_with_bonds(built, self.layout, sums, apart)
        return row_loops.observable(built, self.layout, [ends.kernel.name for ends, _ in meant], apart)


def observables(loops: RowLoops) -> Sequence[str]:
    """Return the text of the functions of observables."""
    program = loops.program
    observed = (*program.observables.kernels, *loops.layout.step.rate_kernels)
    kernels = (kernel for kernel in observed if kernel.roots)
    return [printed(program, loops.observable(kernel), inline=False) for kernel in kernels]
