"""A lattice as a Python module, whose kernels work on whole arrays over the sites."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.passes.temporaries import temporaries
from phigen.ir.passes.whole_arrays import WholeArrays, identical, transposed_sums_name
from phigen.scheme.kernel import Kernel
from phigen.scheme.policies import POLICIES
from phigen.scheme.program import Program
from phigen.scheme.steps import BACK, Gather, Sweep, Sweeps
from phigen.spec.names import OVER
from phigen.targets import lattice_values
from phigen.targets.header import facts
from phigen.targets.numpy import functions
from phigen.targets.numpy.language import listed, quoted
from phigen.targets.numpy.loops import function
from phigen.targets.policies import PYTHON
from phigen.targets.rendering import render

#: Names of the templates for the implicit steps of lattices by the series.
_SERIES = ("lattice_series", "lattice_predictors", "lattice_newton")


def body(program: Program, step: Sweeps, prepare: str) -> str:
    """Return the text of the module without its header; ``prepare`` is the text of the functions that compute
    coefficients.
    """
    values: dict[str, object] = {
        **facts(program, listed, quoted, "None"),
        **lattice_values.tables(program, step, listed),
        **{name: PYTHON.text(policy) for name, policy in POLICIES.items()},
        "schedule": repr(tuple(step.schedule.flows_of_run)),
        "by_colour": repr(step.by_colour),
    }
    values["sized"] = bool(program.time or program.noise or step.relative)
    values |= _of_bodies(step)
    arguments = {"t0": "0.0"} if program.time else {}
    arguments |= {"seed": "0", "member": "0", "step0": "0"} if program.noise else {}
    values["arguments"] = "".join(f", {name}={value}" for name, value in arguments.items())
    values["passed"] = "".join(f", {name}={name}" for name in arguments)
    graph = step.others.graph
    values["equation"] = step.equation is not None
    values["adjoint"] = step.adjoint is not None
    flows = "(part, _), _ in sites.schedule" if step.by_colour else "part, _ in SCHEDULE"
    swept = f"sum(len(PARTS[part]) for {flows})" if any(step.parts) else "1"  # at least 1, even if no field changes
    values["of_step"] = "2 * len(SCHEDULE)" if step.equation else swept
    values["extremes"] = any(ends.extremes for ends in step.others.observed.ends)
    values["pairs"] = step.partners is not None and not graph
    values["by_colour"] = step.by_colour
    values["sites"] = "_Coloured" if step.by_colour else "_Graph" if graph else "_Sites"
    values["flow"] = "(part, sites.colour), row" if step.by_colour else "part, row"
    values["flows"] = "sites.schedule" if step.by_colour else "SCHEDULE"
    graphs = ["lattice_graph", *(["lattice_colours"] if step.by_colour else [])] if graph else []
    drawing = ["lattice_noise", "philox"] if program.noise else []
    parts = ["lattice", "lattice_sites", *graphs, *drawing, *(_SERIES if step.equation else ("lattice_splitting",))]
    parts += ["lattice_monitor"] * (step.rates is not None)
    parts += ["lattice_bodies"] * (step.relative is not None)
    parts += ["lattice_steps", *(["lattice_tangent"] if program.extras.tangent else [])]
    pieces = [render("numpy", f"{part}.py", values) for part in parts]
    if step.adjoint:
        kind = "series" if step.equation else "splitting"
        pieces += [render("numpy", f"lattice_adjoint{part}.py", values) for part in (f"_{kind}", "")]
    pieces += [render("numpy", "lattice_observables.py", {**values, **_reductions(program)}), prepare]
    pieces += functions.called(program)
    pieces += _functions(LatticeLoops(program, step))
    return "\n\n".join(piece.strip("\n") + "\n" for piece in pieces)


def _of_bodies(step: Sweeps) -> dict[str, object]:
    """Return the template values for bodies in relative coordinates."""
    relative = step.relative
    if not relative:
        return {"relative": False}
    return {
        "relative": True,
        "jacobi": relative.jacobi,
        "momenta": relative.momenta,
        "mass": relative.mass,
        "remainder": relative.remainder,
        "body_axes": listed(relative.axes),
    }


def _reductions(program: Program) -> dict[str, object]:
    """Return the reductions of observables as values for templates.

    ``reduced`` lists the array methods that reduce densities, each with the indices of the observables for which it is
    called. The other values are the indices of observables that are means over bonds, or over pairs.
    """
    reductions = program.observables.reductions
    methods = ["mean" if r.kind == "mean" and r.over == "sites" else r.kind.replace("mean", "sum") for r in reductions]
    rows = {m: [k for k, method in enumerate(methods) if method == m] for m in dict.fromkeys(methods)}
    means = {over: [k for k, r in enumerate(reductions) if (r.kind, r.over) == ("mean", over)] for over in OVER}
    return {"reduced": [*rows.items()], "over_bonds": means["bonds"], "over_pairs": means["pairs"]}


def _table(name: str, comment: str, parts: Iterable[Iterable[Sweep]], suffix: str = "") -> str:
    rows = [[f"_{sweep.kernel.name}{suffix}, " for sweep in part] for part in parts]
    listed = ["    (" + "".join(row).rstrip() + ")," for row in rows]  # () for a part that updates no field
    return "\n".join([f"# {comment}", f"{name} = (", *listed, ")\n"])


def _functions(loops: LatticeLoops) -> Iterator[str]:
    """Yield the text of the functions of all kernels; those that compute sums over bonds or pairs come first."""
    step, lowering = loops.step, WholeArrays(loops)

    def summed(gather: Gather) -> ir.Function:
        return lowering.sums([temporaries(loops.sums(ends)) for ends in gather.ends])

    if step.partners and not step.others.graph:
        yield render("numpy", "pairs.py", {"extremes": any(ends.extremes for ends in step.others.observed.ends)})
    gathers = [s.gather for s in step.sweeps if s.gather]
    gathers += [g for g in step.others.gathers if g.names]
    yield from (function(summed(gather)) for gather in gathers)
    swept = [lowering.sweep(temporaries(loops.sweep(sweep))) for sweep in step.sweeps]
    yield from map(function, identical(swept))
    if step.equation:
        stages = step.equation.kernels
        yield from (function(lowering.stage(temporaries(loops.stage(kernel)))) for kernel in stages)
    else:
        sweeps_of_part = "For each part of H, the functions that apply its flow to all sites ('sweeps')."
        yield _table("PARTS", sweeps_of_part, step.parts)
        if loops.program.extras.tangent:
            derivatives = (
                "For each part of H, the functions that multiply a tangent vector by the derivatives of its sweeps."
            )
            yield _table("TANGENTS", derivatives, step.tangents)
    yield from _transposes(loops, lowering, {k.name: k for k in step.adjoint.steps}) if step.adjoint else ()
    for kernel in (*loops.program.observables.kernels, *step.rate_kernels):
        yield function(lowering.observable(temporaries(loops.observable(kernel))))


def _transposes(loops: LatticeLoops, lowering: WholeArrays, kernels: Mapping[str, Kernel]) -> Iterator[str]:
    """Yield the text of the transposed sweeps or, for implicit steps, of the transposed kernels of a stage.

    The last text is a list of the transposes of each part.
    """
    step = loops.step

    def swept(sweep: Sweep) -> ir.Function:
        kernel = kernels[sweep.kernel.name + BACK]
        return lowering.transposed_sweep(temporaries(loops.transposed(kernel, sweep.gather, sweep)), sweep.moved)

    def summed(gather: Gather) -> ir.Function:
        listed = [loops.transposed_sums(ends, kernels[ends.kernel.name + BACK]) for ends in gather.ends]
        return lowering.transposed_sums([*map(temporaries, listed)], transposed_sums_name(gather.kernels[0].name))

    def staged(kernel: Kernel) -> ir.Function:
        seed = next(array for array in kernel.inputs if array.endswith("_bar"))
        gather = step.others.field if step.partners and kernel.inputs["gathered"] else None
        return lowering.transposed_stage(temporaries(loops.transposed(kernel, gather)), seed)

    sweeps = [sweep for part in step.parts for sweep in part]
    yield from map(function, identical([*map(swept, sweeps)]))
    yield from (function(summed(sweep.gather)) for sweep in sweeps if sweep.gather)
    if step.equation:
        if step.others.field.names:
            yield function(summed(step.others.field))
        stages = (step.equation.relax, step.equation.advance)
        yield from (function(staged(kernels[kernel.name + BACK])) for kernel in stages)
    else:
        transposed = (
            "For each part of H, the transposed sweeps: they map cotangents after a sweep to cotangents before it."
        )
        yield _table("PARTS_BACK", transposed, step.parts, BACK)
