"""Lattices that split, for devices: one kernel for each flow and colour, and one that looks for failures."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.errors import Diagnostic, SpecError
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes.simultaneous import simultaneous
from phigen.ir.passes.temporaries import temporaries
from phigen.ir.passes.work_items import work_items
from phigen.scheme.program import Program
from phigen.scheme.steps import Sweeps
from phigen.targets.c import functions
from phigen.targets.c.loops import statements
from phigen.targets.header import plain, sentence
from phigen.targets.rendering import render


def expect_offered(program: Program, step: Sweeps) -> None:
    """Raise `SpecError` for lattices whose steps have no kernels."""
    sites = step.sites
    reasons = {
        "its steps are implicit": step.equation,
        "its sites are those of a graph, or interact in pairs": step.partners,
        "its colours have a seam": sites.seams,
        "its sums over steps are compensated": program.compensated,
        "its numbers are single": program.single,
    }
    for reason, holds in reasons.items():
        if holds:
            message = f"target device: {program.name} has no kernels, since {reason}"
            raise SpecError([Diagnostic(message, hint="take target c")])


def body(program: Program, step: Sweeps, language: str) -> str:
    """Return the text of a file; ``language`` is its prelude."""
    sites = step.sites
    values = {
        "NAME": program.name,
        "language": language,
        "n": program.dimension,
        "coordinates": ", ".join(program.coordinates),
        "neighbours": len(LatticeLoops(program, step).neighbours),
        "at_sites": f" ({', '.join(sites.parameters)})" if sites.parameters else "",
        "functions": functions.called(program),
        "kernels": [*_kernels(program, step)],
    }
    return render("c", "device_lattice.h", values)


def _kernels(program: Program, step: Sweeps) -> Iterator[tuple[str, str, list[str]]]:
    """Yield the comment, the name, and the statements of each sweep."""
    loops = LatticeLoops(program, step)
    for sweep in (sweep for part in step.parts for sweep in part):
        lowered = work_items(simultaneous(temporaries(loops.sweep(sweep))), loops)
        yield plain(sentence(sweep.kernel.purpose)), sweep.kernel.name, statements(lowered, program.name)
