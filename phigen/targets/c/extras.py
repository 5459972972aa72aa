"""What the C code offers on request: the tangent map of a step, the modified Hamiltonian."""

from __future__ import annotations

from collections.abc import Mapping

from phigen.scheme.program import Program
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
    if "modified" in program.kernels:
        signature = _modified(program)
        lines += [
            "/* The Hamiltonian whose flow a step of size h is, up to O(h^"
            + str(modified_power(program))
            + "); constant",
            "   along a trajectory to that order. */",
            *signature[:-1],
            signature[-1] + ";\n",
        ]
    return lines


def modified_power(program: Program) -> int:
    """The first power of h that the modified Hamiltonian leaves out."""
    return program.order + (2 if program.symmetric else 1) * program.extras.modified_hamiltonian


def _modified(program: Program) -> list[str]:
    name = program.name
    arguments = [f"const {name}_params *params"]
    arguments += [f"const double gauge[{len(program.gauge)}]"] if program.gauge else []
    arguments += ["double h", f"const double x[{program.dimension}]"]
    return wrapped_arguments(f"double {name}_modified_hamiltonian(", arguments)


def modified(program: Program, values: Mapping[str, object]) -> list[str]:
    """The function of the modified Hamiltonian."""
    params = f"params != NULL ? params : &{program.name}_default_params"
    own = {
        **values,
        "modified_signature": "\n".join(_modified(program)),
        "modified_arguments": ", ".join([params, *(["gauge"] if program.gauge else []), "h", "x"]),
    }
    return [function(program, program.kernels["modified"]) + "\n", render("c", "modified.c", own)]


def _step_tangent(program: Program) -> list[str]:
    name = program.name
    arguments = [f"{name}_solver *s", "double h", f"double tangent[{program.dimension**2}]"]
    return wrapped_arguments(f"{name}_status {name}_step_tangent(", arguments)


def tangent(program: Program, values: Mapping[str, object], syntax: Syntax) -> list[str]:
    """The functions of the tangent map; they come after the driver and before the API."""
    own = {**values, "step_tangent_signature": "\n".join(_step_tangent(program))}
    pieces = [render("c", "tangent_algebra.c", own)]
    if program.driver == "splitting":
        return [*pieces, *splitting.tangent(program, own), render("c", "step_tangent.c", own)]
    if program.driver != "explicit":
        pieces += [render("c", "tangent_solve.c", own)]
    if program.driver == "explicit":
        pieces += [function(program, program.kernels["explicit_tangent"]) + "\n"]
    elif program.tangent_path:
        path = program.tangent_path
        extended = tangent_program(program)
        unused = [] if reads_coefficients(path) else ["(void)coef;"]
        own |= statements(extended, path, syntax)
        own |= {"unused": unused, "series": len(path.series), "n_twice": extended.dimension}
        missing = [k for k in kinds(path) if program.path is None or k not in kinds(program.path)]
        pieces += [render("c", f"taylor_{kind}.c", own) for kind in missing]
        pieces += [function(program, program.kernels["curvature"]) + "\n"]
        pieces += [render("c", f"tangent_{part}.c", own) for part in ("holds", "piece", "seed")]
    pieces.append(render("c", f"tangent_{program.driver}.c", own))
    return [*pieces, render("c", "step_tangent.c", own)]
