"""What the C code offers on request: the tangent map of a step, the modified Hamiltonian."""

from __future__ import annotations

from collections.abc import Mapping

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Newton, Path, PathTangent, Splitting
from phigen.targets.c import splitting
from phigen.targets.c.kernels import function, wrapped_arguments
from phigen.targets.path import Syntax, kinds, reads_coefficients, statements, tangent_program
from phigen.targets.rendering import render


def declarations(program: Program) -> list[str]:
    """The lines of the header for the extras."""
    lines = []
    if program.extras.tangent:
        lines += [
            f"/* One step as {program.name}_step makes it, and its derivative: tangent[i * {program.dimension} + j] is",
            "   that of the new x_i along the old x_j, to round-off, with any gauge held fixed. On failure both are",
            "   as before. */",
            *_step_tangent(program)[:-1],
            _step_tangent(program)[-1] + ";\n",
        ]
    if program.modified:
        signature = _modified(program)
        lines += [
            "/* The Hamiltonian whose flow a step of size h is, up to O(h^"
            + str(program.modified.power)
            + "); constant",
            "   along a trajectory to that order. */",
            *signature[:-1],
            signature[-1] + ";\n",
        ]
    return lines


def _modified(program: Program) -> list[str]:
    name = program.name
    arguments = [f"const {name}_params *params"]
    arguments += [f"const double gauge[{len(program.gauge.casimirs)}]"] if program.gauge else []
    arguments += ["double h", f"const double x[{program.dimension}]"]
    return wrapped_arguments(f"double {name}_modified_hamiltonian(", arguments)


def modified(program: Program, kernel: Kernel, values: Mapping[str, object]) -> list[str]:
    """The function of the modified Hamiltonian."""
    params = f"params != NULL ? params : &{program.name}_default_params"
    own = {
        **values,
        "modified_signature": "\n".join(_modified(program)),
        "modified_arguments": ", ".join([params, *(["gauge"] if program.gauge else []), "h", "x"]),
    }
    return [function(program, kernel) + "\n", render("c", "modified.c", own)]


def _step_tangent(program: Program) -> list[str]:
    name = program.name
    arguments = [f"{name}_solver *s", "double h", f"double tangent[{program.dimension**2}]"]
    return wrapped_arguments(f"{name}_status {name}_step_tangent(", arguments)


def tangent(program: Program, values: Mapping[str, object], syntax: Syntax) -> list[str]:
    """The functions of the tangent map; they come after the step and before the API."""
    own = {**values, "step_tangent_signature": "\n".join(_step_tangent(program))}
    pieces = [render("c", "tangent_algebra.c", own)]
    match program.step:
        case Splitting() as step:
            pieces += splitting.tangent(program, step, own)
        case Explicit(tangent=kernel) if kernel:
            pieces += [function(program, kernel) + "\n", render("c", "tangent_explicit.c", own)]
        case Newton():
            pieces += [render("c", f"tangent_{part}.c", own) for part in ("solve", "newton")]
        case Path(tangent=varied) as step if varied:
            pieces += [render("c", "tangent_solve.c", own), *_path(program, step, varied, own, syntax)]
    return [*pieces, render("c", "step_tangent.c", own)]


def _path(program: Program, step: Path, varied: PathTangent, values: Mapping[str, object], syntax: Syntax) -> list[str]:
    """The path with its variation, and what follows from it."""
    path, extended = varied.recurrences, tangent_program(program)
    unused = [] if reads_coefficients(path) else ["(void)coef;"]
    own = {**values, **statements(extended, path, syntax)}
    own |= {"unused": unused, "series": len(path.series), "n_twice": extended.dimension}
    missing = [k for k in kinds(path) if k not in kinds(step.recurrences)]
    pieces = [render("c", f"taylor_{kind}.c", own) for kind in missing]
    pieces += [function(program, varied.curvature) + "\n"]
    return pieces + [render("c", f"tangent_{part}.c", own) for part in ("holds", "piece", "seed", "path")]
