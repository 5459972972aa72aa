"""Data with which the runtime launches the kernels of a lattice on a device."""

from __future__ import annotations

from phigen.ir.lattice_loops import LatticeLoops, bounds
from phigen.ir.launches import LatticeLaunches, SiteLaunch, SumLaunch
from phigen.ir.passes.work_items import kernel_arrays
from phigen.scheme.program import Program
from phigen.scheme.steps import Gather, Sweeps


def launches(program: Program, step: Sweeps) -> LatticeLaunches:
    """Return the data for launching the kernels of a lattice."""
    loops = LatticeLoops(program, step)
    parts = tuple(
        tuple(
            SiteLaunch(s.kernel.name, _sums(s.gather), 0, _colour(s.colour, step), s.omits_seams, s.window)
            for s in part
        )
        for part in step.parts
    )
    others = {}
    for kernel in (step.equation.relax, step.equation.advance, step.equation.slope) if step.equation else ():
        gather = step.others.varied if kernel.reads_variations else step.others.field
        sums = _sums(gather if kernel.inputs["gathered"] else None)
        others[kernel.name] = SiteLaunch(kernel.name, sums, len(kernel.roots))
    for kernel in (k for k in (*program.observables.kernels, *step.rate_kernels) if k.roots):
        others[kernel.name] = SiteLaunch(kernel.name, _sums(step.others.sums_of(kernel)), len(kernel.roots))
    return LatticeLaunches(
        parts,
        others,
        kernel_arrays(loops),
        tuple(loops.neighbours),
        tuple(tuple(bounds(w.key)) for w in loops.weights),
        tuple((int(s.key[0]), tuple(int(o) for o in s.key[1:])) for s in loops.seams),
        loops.numbers,
        tuple((r.kind, r.over) for r in program.observables.reductions),
    )


def _colour(colour: int | None, step: Sweeps) -> int | None:
    return colour if step.sites.colours > 1 else None


def _sums(gather: Gather | None) -> tuple[SumLaunch, ...]:
    ends = gather.ends if gather else ()
    return tuple(
        SumLaunch(e.kernel.name, e.end, e.chosen, len(e.kernel.roots), "params" in e.kernel.inputs) for e in ends
    )
