"""Lattices for devices. There is a kernel for each flow and colour, each sum over bonds or pairs, and each
observable.
"""

from __future__ import annotations

from collections.abc import Iterator

from phigen.ir import nodes as ir
from phigen.ir import walk
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes.simultaneous import simultaneous
from phigen.ir.passes.temporaries import temporaries
from phigen.ir.passes.work_items import kernel_arrays, work_items
from phigen.scheme.program import Program
from phigen.scheme.steps import Gather, Sweeps
from phigen.targets.c import functions
from phigen.targets.c.loops import statements
from phigen.targets.c.real import rendered
from phigen.targets.header import plain, sentence

#: The arrays that kernels receive as arguments: their types, and comments on their contents.
_ARRAYS = {
    "neighbours": ("const int", "neighbours[n * count + i]: the number of neighbour n of site i"),
    "weights": ("const double", "weights[n * count + i]: 0 for terms beyond open ends, else 1"),
    "on_seams": ("const double", "on_seams[n * count + i]: 1 where term n of the sweep begins on a seam, else 0"),
    "at_sites": ("const double", "at_sites[n * count + i]: parameter n at site i"),
    "dw": ("const double", "dw[n * count + i]: the increment of the noise of source n"),
    "x": ("double", "x[n * count + i]: field n at site i"),
    "start": (
        "const double",
        "start[n * count + i]: field n at the start of a stage; x then has its solution y",
    ),
    "varied": ("const double", "varied[n * count + i]: a variation of the fields"),
    "out": ("double", "out[n * count + i]: result n at site i, of kernels that do not update x"),
    "starts": ("const int", "starts[i] to starts[i + 1]: the places of the bonds of site i in the next arrays"),
    "others": ("const int", "others[b]: the other site of bond b"),
    "at_bonds": ("const double", "at_bonds[n * starts[count] + b]: parameter n at bond b"),
    "colours": ("const int", "colours[i]: the colour of site i"),
    "colour": ("int", "colour: the flow is that of the terms of H at sites of this colour"),
    "sums": ("double", "sums[n * count + i]: sum n over the bonds or pairs of site i"),
    "adds": ("int", "adds: 1 if a kernel adds to sums, 0 if it overwrites them"),
}


def body(program: Program, step: Sweeps, language: str) -> str:
    """Return the text of the file without its header comment. ``language`` is the text of the macros for the
    differences between OpenCL C, CUDA and HIP.
    """
    loops = LatticeLoops(program, step)
    arrays = kernel_arrays(loops)
    numbers = [*loops.numbers, *([program.time] if program.time else [])]
    compensated = f"; x[({program.dimension} + n) * count + i]: its compensation term" if program.compensated else ""
    comments = {name: _ARRAYS[name][1] for name in arrays}
    comments["x"] += compensated
    if step.sites.parameters:
        comments["at_sites"] += f" ({', '.join(step.sites.parameters)})"
    if step.sites.at_bonds:
        comments["at_bonds"] += f" ({', '.join(step.sites.at_bonds)})"
    values = {
        "NAME": program.name,
        "language": language,
        "n": program.dimension,
        "coordinates": ", ".join(program.coordinates),
        "neighbours": len(loops.neighbours),
        "numbers": f" ({', '.join(numbers)})" if numbers else "",
        "arrays": list(comments.values()),
        "arguments": ", ".join(_argument(name, program.name) for name in arrays),
        "implicit": step.equation is not None,
        "functions": functions.called(program, device=True),
        "kernels": [*_kernels(loops)],
    }
    return rendered(program, "device_lattice.h", values)


def _argument(name: str, prefix: str) -> str:
    kind = _ARRAYS[name][0]
    return f"int {name}" if kind == "int" else f"{prefix}_GLOBAL {kind} *{name}"


def _kernels(loops: LatticeLoops) -> Iterator[tuple[str, str, list[str]]]:
    """Yield the comment, the name, and the statements of each kernel."""
    for built in _functions(loops):
        if not any(isinstance(s, ir.Store) for s in walk.statements(built.body)):
            continue
        lowered = work_items(simultaneous(temporaries(built)), loops)
        yield plain(sentence(built.doc)), built.name, statements(lowered, loops.program)


def _functions(loops: LatticeLoops) -> Iterator[ir.Function]:
    step = loops.step

    def summed(gather: Gather | None) -> Iterator[ir.Function]:
        return map(loops.sums, gather.ends if gather else ())

    for sweep in (sweep for part in step.parts for sweep in part):
        yield from summed(sweep.gather)
        yield loops.sweep(sweep)
    gathers = [step.others.energy, step.others.field, step.others.observed]
    gathers += map(step.others.sums_of, step.rate_kernels)
    if step.equation:
        yield from map(loops.stage, (step.equation.relax, step.equation.advance, step.equation.slope))
        gathers.append(step.others.varied)
    for gather in gathers:
        yield from summed(gather)
    yield from map(loops.observable, (*loops.program.observables.kernels, *step.rate_kernels))
