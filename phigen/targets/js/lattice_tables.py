"""Lattices in JavaScript: kernels as loops over the sites, and the tables that the runtime reads."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops, bounds
from phigen.ir.passes.by_tables import by_tables
from phigen.ir.passes.simultaneous import simultaneous
from phigen.ir.passes.temporaries import temporaries
from phigen.scheme.program import Program
from phigen.scheme.steps import Sweep, Sweeps
from phigen.targets import lattice_values
from phigen.targets.features import switches
from phigen.targets.header import facts
from phigen.targets.js.loops import function
from phigen.targets.js.printing import camel, key, properties, wrapped
from phigen.targets.rendering import render

#: A space at which lines are not broken.
_FIXED = "\N{NO-BREAK SPACE}"


def features(program: Program, step: Sweeps) -> dict[str, bool]:
    """Return all switches of the runtime for a lattice, by name."""
    return switches(program) | lattice_values.switches(step) | {"SPLIT": step.equation is None}


def tables(program: Program, step: Sweeps) -> str:
    """Return the text of the constants and tables of a lattice."""
    values = _tables(program, step)
    listed = [render("js", "lattice.mjs", _facts(program, step))]
    listed += [render("js", f"{part}.mjs", values) for part in ("lattice_tables", "lattice_schedule")]
    lines = "\n".join(listed).splitlines()
    broken = [wrapped(line, "") if line.startswith("const") else [line] for line in lines]
    return "\n".join(part for parts in broken for part in parts).replace(_FIXED, " ")


def _facts(program: Program, step: Sweeps) -> dict[str, object]:
    """Return the values for the template of the public constants."""
    return {
        "contents": [f" * {line}".rstrip() for line in _contents(program, step)],
        **facts(program, json.dumps, key, "null"),
        **lattice_values.tables(program, step, json.dumps),
        "kinds": json.dumps(step.casimir_kinds),
        "reductions": json.dumps([[r.kind, r.over] for r in program.observables.reductions]),
        "properties": properties(program.parameters),
    }


def _tables(program: Program, step: Sweeps) -> dict[str, object]:
    """Return the tables that the runtime reads, as template values."""
    loops = LatticeLoops(program, step)
    return {
        **lattice_values.tables(program, step, json.dumps),
        "near": json.dumps(loops.neighbours),
        "bounds": json.dumps([bounds(w.key) for w in loops.weights]),
        "wanted": json.dumps([[s.key[0], list(s.key[1:])] for s in loops.seams]),
        "sums": step.sums,
        "gathers": lattice_values.switches(step)["GATHER"],
        "unit": "stages" if step.equation else "flows",
        "schedule": f"[{', '.join(f'[{part},{_FIXED}{row}]' for part, row in step.schedule.flows_of_run)}]",
        "flows": f"[{', '.join(map(_listed, step.parts))}]",
        "body_axes": json.dumps(step.relative.axes) if step.relative else "",
        "mass": json.dumps(step.relative.mass) if step.relative else "",
        "remainder": step.relative.remainder if step.relative else "",
        "tangents": f"[{', '.join(map(_listed, step.tangents))}]" if step.tangents else "",
    }


def kernels(program: Program, step: Sweeps) -> Iterator[str]:
    """Yield the text of the functions of all kernels, as loops over sites, bonds or pairs."""
    lattice, names = LatticeLoops(program, step), {camel(kernel.name) for kernel in step.kernels}
    for built in _functions(lattice):
        lowered = by_tables(simultaneous(temporaries(built)), lattice)
        yield function(lowered, names)


def _functions(lattice: LatticeLoops) -> Iterator[ir.Function]:
    step = lattice.step
    for sweep in step.sweeps:
        yield from map(lattice.sums, sweep.gather.ends if sweep.gather else ())
        yield lattice.sweep(sweep)
    for gather in step.others.gathers:
        yield from map(lattice.sums, gather.ends)
    yield from map(lattice.stage, step.equation.kernels if step.equation else ())
    yield from map(lattice.observable, (*lattice.program.observables.kernels, *step.rate_kernels))


def _contents(program: Program, step: Sweeps) -> list[str]:
    sizes = ", ".join(f"N_{axis}" for axis in step.sites.axes)
    options = [
        "x0: [...]",
        *(["t0"] if program.time else []),
        f"sizes: [{sizes}]",
        *(["bonds: [...]"] if step.others.graph else []),
        "params: { ... }",
    ]
    how = "iterations over all sites" if step.equation else "flows of parts of H"
    return [
        f"import {{ Solver, StepError }} from './{program.name}.mjs';",
        f"const solver = new Solver({{ {', '.join(options)} }});",
        "solver.integrate(h, steps); then solver.x, .field(name), .t, .hamiltonian(), .density(), .casimirs()",
        "",
        f"Contents: the system and its formulas; the class Solver; the sites; the step, by {how}.",
    ]


def _listed(part: Sequence[Sweep]) -> str:
    return f"[{', '.join(camel(sweep.kernel.name) for sweep in part)}]"
