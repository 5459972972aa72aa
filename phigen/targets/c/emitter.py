"""Emission of a program as C source: `NAME.h` and `NAME.c`.

The parts that depend on the formulas of a system are printed: sizes, constants, kernels (`printed`). All other code is
the runtime: C in ``templates/c/runtime``, which `amalgamation` assembles for the `features` of the program.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from phigen.lanes.in_lanes import LANES, Blocks, Lanes, Packs, Rows, Traces, in_lanes
from phigen.scheme.kernel import Kernel
from phigen.scheme.policies import PredictorPolicy
from phigen.scheme.program import MAX_NORMAL_VARIATE, Attitude, Noise, Program, StackBound
from phigen.scheme.steps import Adjoint
from phigen.spec.model import Parameter
from phigen.targets.c import functions
from phigen.targets.c.amalgamation import Amalgam
from phigen.targets.c.features import switches
from phigen.targets.c.gauss import policy as gauss_policy
from phigen.targets.c.gauss import with_frames
from phigen.targets.c.kernels import declaration, function
from phigen.targets.c.lanes import KNOTS, remembered, travels
from phigen.targets.c.lanes import printed as kernels_in_lanes
from phigen.targets.c.language import members
from phigen.targets.c.layout import fitted
from phigen.targets.c.misra import compliant
from phigen.targets.c.real import real_of, rendered
from phigen.targets.c.step_text import Sizes, path_sizes, text_of
from phigen.targets.c.tokens import without_word
from phigen.targets.header import header_lines, plain, right_hand_side, sealed
from phigen.targets.policies import C, policies_of
from phigen.targets.rendering import render

#: Cost model of blocks, in which several steps are solved together. An iteration of a vectorised block takes, for each
#: step in the block, 1/PASSES of the time in which one step alone is evaluated. The share is 1/PASSES_OF_CALLS for two
#: kinds of blocks: blocks that call library functions, since they are not vectorised, and blocks of steps along paths,
#: since they also compute derivatives.
PASSES, PASSES_OF_CALLS = 2, 1

#: Number of attempts to solve a stage of an implicit step: first with the predictor, then without it.
ATTEMPTS = 2

#: A file with more lines than this begins with a table of contents.
FEW_SCREENS = 240


def emit(program: Program, command: str, *, single_file: bool = False) -> dict[str, str]:
    """Return the generated files by their names. With ``single_file`` there is only `NAME.c`, which needs no header."""
    program = with_frames(program)
    name, lines = program.name, header_lines(program, command)
    amalgam, header, code = runtime_of(program)
    declarations, definitions = amalgam.texts(header, code)
    if program.profile == "certified":
        declarations, definitions = compliant(declarations), compliant(definitions)
    declared = declarations + "\n#ifdef __cplusplus\n}\n#endif\n"
    defined = unrestricted(program, definitions)
    headers = "\n".join(sorted(amalgam.headers))
    if single_file:
        body = fitted(f"{headers}\n{declared}\n{defined}")
        return {f"{name}.c": _sealed(lines, body)}
    guard = f"{name.upper()}_H"
    header = fitted(f"#ifndef {guard}\n#define {guard}\n{declared}#endif /* {guard} */\n")
    body = fitted(f'#include "{name}.h"\n{headers}\n\n{defined}')
    return {f"{name}.h": _sealed(_declared_lines(program), header), f"{name}.c": _sealed(lines, body)}


def unrestricted(program: Program, code: str) -> str:
    """Return code that all compilers accept, including those that refuse ``restrict``: those of C++, and Microsoft's C
    compiler.

    The profile ``fast`` and code with loops over lanes or sites keep the keyword, since it makes loops faster. There, a
    macro removes the keyword for the compilers that refuse it. In all other code the keyword is left out.
    """
    if program.profile != "fast" and not program.step.kind.sites and "_EACH_LANE" not in code:
        return without_word(code, "restrict")
    return render("c", "restrict.c", {"code": code.strip()})


def runtime_of(program: Program) -> tuple[Amalgam, str, str]:
    """Return the object that assembles the C code of a solver, and the names of two files of the runtime. The header of
    the solver begins with the first file, and the source with the second.
    """
    lanes = in_lanes(program)
    has = switches(program, lanes)
    constants, real = policies(program, staged=has["STAGED"]), real_of(program)
    step = program.step.swept
    if step is None:
        return Amalgam(program.name, has, constants | printed(program, lanes, has), real), "solver.h", "runtime.c"
    from phigen.targets.c.lattice import adjoint as lattice_adjoint
    from phigen.targets.c.lattice import layout as lattice_layout
    from phigen.targets.c.lattice import model as lattice_model
    from phigen.targets.c.lattice.sweep_functions import parameters, sweeps

    assert isinstance(lanes, Rows)
    has |= lattice_layout.switches(lattice_layout.layout_of(program, step)) | {"NEAR": bool(lanes.limited)}
    texts = {
        "declarations.h": lattice_model.declarations(program, step),
        "model.h": lattice_model.model(program, step),
        "sweeps.h": sweeps(program, step, lanes),
        "parameters.h": parameters(program, step),
    }
    if step.adjoint:
        texts["adjoint_sweeps.h"] = lattice_adjoint.printed(program, step, step.adjoint, lanes)
    return Amalgam(program.name, has, constants | texts, real), "lattice.h", "lattice.c"


def policies(program: Program, *, staged: bool = False) -> dict[str, str]:
    """Return headers that define constants of the solver, such as tolerances and limits of iterations. The result maps
    file names to texts.

    Sizes of arrays are left out, since they are declared with the struct of the solver. ``staged`` is true for Gauss
    methods with their stages in lanes.
    """
    sizes = ("DIFFERENCES", "DIRECTIONS")
    policy_by_name = policies_of(program) | {"gauss_policy": gauss_policy(single=program.single, staged=staged)}
    real = real_of(program)
    spelling = replace(C, rounded=lambda value: real.number(real.threshold(value))) if program.single else C
    texts = {f"{name}.h": spelling.text(policy, sizes) for name, policy in policy_by_name.items()}
    return {file: text.replace("PHI_", f"{program.name}_") for file, text in texts.items()}


def _declared_lines(program: Program) -> list[str]:
    """Return the lines of the comment at the head of the declarations. All other facts on the solver are in the source
    file.
    """
    name = program.name
    return [
        f"The declarations of {name}.c. DO NOT EDIT: phigen detects changes by the checksum below.",
        f"SPDX-License-Identifier: {program.about.license}",
    ]


def _sealed(lines: Sequence[str], body: str) -> str:
    chapters = [line[len(_CHAPTER) : -len(_END)] for line in body.splitlines() if _is_chapter(line)]
    long = chapters and body.count("\n") > FEW_SCREENS
    contents = textwrap.wrap(f"Contents: {'; '.join(chapters)}", 100, subsequent_indent="  ") if long else []
    return sealed([*lines, *contents], body)


_CHAPTER, _END = "/* ---- ", " ---- */"


def _is_chapter(line: str) -> bool:
    return line.startswith(_CHAPTER) and line.endswith(_END)


def printed(program: Program, lanes: Lanes | None, has: Mapping[str, bool]) -> dict[str, str]:
    """Return the texts that are printed for a program: a map from names of files, which the runtime includes, to their
    texts.
    """
    step = program.step
    texts = text_of(program).texts(program, step, lanes, has)
    if lanes and (has["BLOCKS"] or has["PACKS"] or has["TRACED"] or has["STAGED"]):
        packed = partial(text_of(program).packed, program, step)
        texts["model_lanes.h"] = "\n".join(kernels_in_lanes(program, lanes, packed, batched=has["STAGE_GROUPS"]))
    declarations = rendered(program, "declarations.h", declared_values(program, lanes, has))
    return {"declarations.h": declarations, "model.h": model(program, lanes, has, texts.values()), **texts}


def declared_values(program: Program, lanes: Lanes | None, has: Mapping[str, bool]) -> dict[str, object]:
    """Return the values for the template of the public declarations."""
    member, step = members(program), program.step
    public: Sizes = [
        ("DIM", program.dimension, f"coordinates: {', '.join(program.coordinates)}"),
        ("ORDER", program.order, "order of the method"),
        ("CASIMIRS", len(program.casimirs), f"Casimirs: {', '.join(program.casimirs) or 'none'}"),
    ]
    if program.observed:
        public.append(("OBSERVABLES", len(program.observed), f"observables: {', '.join(program.observed)}"))
    if program.modified:
        public.append(("MODIFIED_POWER", program.modified.power, "power of h in the error of the modified Hamiltonian"))
    sizes: Sizes = [("STAGES", len(program.fractions), "number of stages of a step")] if has["COMPOSED"] else []
    also = f", and of {_renewing(program)}" if program.step.refresh else ""
    sizes.append(
        ("COEFFICIENTS", max(1, program.step.coefficients), f"number of coefficients: functions of params and h{also}")
    )
    sizes += _of_noise(program.noise) if program.noise else []
    if program.held:
        names = ", ".join(f"`{name}`" for name in program.held)
        held = f"number of Casimirs whose multiples are subtracted from H: {names}"
        sizes.append(
            (
                "GAUGES",
                len(program.held),
                "number of entries of gauge: only the energy level e" if program.monitor else held,
            )
        )
    sizes += _of_attitude(program.attitude) if program.attitude else []
    if has["ADJOINT"]:
        trail = text_of(program).trail(program, step, lanes)
        sizes.append(("TRAIL", trail, "doubles on the tape, the data for the reverse pass, for each step"))
        if has["EACH"]:
            batch = 1 if step.kind.flows else LANES * _packs_back(lanes, has)
            sizes.append(
                ("TRAIL_EACH", trail * max(1, batch), "doubles on the tape for each step of a batch of members")
            )
    if has["PREDICTED"] and not has["RECURRENCES"] and not has["GAUSS"]:
        predictor = PredictorPolicy()
        sizes.append(
            (
                "DIFFERENCES",
                predictor.differences,
                "entries of the predictor; more would amplify rounding errors",
            )
        )
    sizes += text_of(program).declared(step, lanes)
    if program.profile == "certified" and step.kind.implicit and step.inner_solve:
        most = ATTEMPTS * step.inner_solve.max_iterations * len(program.fractions)
        sizes.append(("MOST_EVALUATIONS", most, "largest number of evaluations of the kernel in a step"))
    if has["RECURRENCES"]:
        memory = remembered(program, lanes)
        sizes.append(("REMEMBERED", memory["REMEMBERED"], "number of past solutions that the recurrence is fitted to"))
        sizes.append(("WINDOW", memory["WINDOW"], "largest number of past solutions in the recurrence"))
        sizes.append(("AHEAD", memory["AHEAD"], "number of solutions that the recurrence predicts"))
    return {
        "NAME": program.name,
        "noise": program.noise is not None,
        "version": program.version,
        "sha256": program.about.spec_sha256,
        "defaults": _defaults(program),
        "members": [(f"double {member[p.name]};", _member_comment(p, member[p.name])) for p in program.parameters]
        or [("char unused;", "this system has no parameters")],
        "public": public,
        "sizes": sizes,
        "compiler": program.stack.compiler if program.stack else "",
        "stack": _stack(program.stack, program.name) if program.stack else [],
        "observables": [
            (said, [declaration(program, k, name=name, returning=one) for k, name, one in kernels])
            for said, kernels in _state_functions(program)
        ],
    }


def _stack(bound: StackBound, name: str) -> Sizes:
    """Return the numbers of bytes of stack that the solver needs, as constants with comments.

    The functions `NAME_init` and `NAME_step` have a constant each. Another constant holds for all functions.
    """
    return [
        ("STACK_OF_INIT", bound.init, f"from {name}_init on"),
        ("STACK_OF_STEP", bound.step, f"from {name}_step on"),
        ("STACK", bound.longest, "from any function on"),
    ]


#: Kernels that become public functions. An entry has the kernel, the name of the function, and whether the function
#: returns its only output, instead of storing it.
Exported = list[tuple[Kernel, str, bool]]


def _state_functions(program: Program) -> Iterator[tuple[str, Exported]]:
    """Yield the public functions that are evaluated at a state, in groups. Each group has a comment for the header."""
    seen, noise, monitor, modified = program.observables, program.noise, program.monitor, program.modified
    at = " at the time t" if program.time else ""
    yield (
        f"The Hamiltonian{at}; the Casimirs; the right-hand side {right_hand_side(program)}"
        f"{', with the forces zeta and f' * program.forced}. params may be NULL.",
        [(seen.energy, "hamiltonian", True), (seen.casimirs, "casimirs", False), (seen.vector_field, "", False)],
    )
    if seen.named:
        yield (
            f"The observables{at}, in the order of {program.name}_OBSERVABLES. params may be NULL.",
            [(seen.named, "observables", False)],
        )
    if noise and noise.fields:
        comment = (
            "For each source of noise with the amplitude sigma and the Hamiltonian g: the vector field"
            " sigma pi(x) grad g(x). params may be NULL."
        )
        yield comment, [(noise.fields, "", False)]
    if monitor:
        yield (
            "The monitor dt/dtau at x, the physical time per unit of tau. params may be NULL.",
            [(monitor.rate, "", True)],
        )
    if modified:
        error = f"O(h^{program.name}_MODIFIED_POWER)"
        comment = (
            f"The modified Hamiltonian: a step of size h is the flow of this function, and conserves it, up to {error}."
        )
        yield comment, [(modified.kernel, "modified_hamiltonian", True)]


def _renewing(program: Program) -> str:
    """Return in words what the coefficients of `refresh` depend on: the time, the noise, or both."""
    arguments = {"the time": program.time, "the noise": program.noise}
    return " and ".join(name for name, present in arguments.items() if present)


def _of_noise(noise: Noise) -> Sizes:
    names = ", ".join(noise.sources)
    return [
        ("SOURCES", len(noise.sources), f"sources of noise: {names}"),
        ("DRAWS", noise.draws, "number of increments of all sources of noise in a step"),
        ("PARTS", noise.parts, "number of increments of one source of noise in a step"),
    ]


def _of_attitude(attitude: Attitude) -> Sizes:
    from phigen.scheme.attitude import SIZE_OF_COVECTOR

    group, rate, rows = attitude.group, attitude.rate, attitude.group.rows
    shown = f"entries of an attitude: a matrix with {rows} rows" if rows else "entries of an attitude: a quaternion"
    sizes = [("ATTITUDE_SIZE", rows**2 or 4, shown)]
    element = f"matrix with {rows} rows" if rows else "quaternion" + " and a position" * bool(group.translation)
    sizes.append(("ELEMENT", group.size, f"entries of a group element, which is a {element}"))
    sizes += [("ROWS_OF_ATTITUDE", rows, "rows of an attitude matrix")] if rows else []
    covector = f"entries of a covector, then {SIZE_OF_COVECTOR}"
    sizes += [("COVECTOR", len(group.matrices) + 1, covector)] if attitude.exponential else []
    return sizes + ([("RATE", len(rate.roots), "entries of the rate of the gauge rotation")] if rate else [])


def _defaults(program: Program) -> str:
    """Return the default values of the parameters as an initialiser in C."""
    return ", ".join(repr(float(p.value)) for p in program.parameters) or "0"


def _member_comment(parameter: Parameter, member: str) -> str:
    """Return the comment on a member of the parameter struct. If the parameter has another name in the spec, the
    comment begins with this name.
    """
    comment = plain(parameter.description) or f"default {float(parameter.value)!r}"
    comment += f" [{plain(parameter.unit)}]" * bool(parameter.unit)
    return comment if member == parameter.name else f"{parameter.name}: {comment}"


def _constants(program: Program, lanes: Lanes | None, has: Mapping[str, bool]) -> Sizes:
    sizes: Sizes = []
    step = program.step
    if step.refresh:
        sizes.append(
            ("PREPARED", step.prepared, "number of coefficients that depend on params and h only; they come first")
        )
    sizes += text_of(program).constants(program, step)
    if has["ADJOINT"]:
        sizes += [("RENEWED_OF_ROW", step.renewed, "coefficients of a row that depend on the time")] * bool(
            step.refresh
        )
    if has["RECURRENCES"]:
        checks = remembered(program, lanes)["CHECKS"]
        sizes.append(
            ("CHECKS", checks, "number of past solutions that test a fitted recurrence; the fit leaves them out")
        )
    if has["BLOCKS"] and isinstance(lanes, Blocks):
        passes = PASSES if lanes.vectorised and not has["PATH"] else PASSES_OF_CALLS
        sizes.append(
            (
                "PASSES",
                passes,
                "for each step in a block, an iteration takes the time of one evaluation divided by this number",
            )
        )
        if lanes.factors:
            entries = len(lanes.factors.factorise.roots)
            sizes.append(("FACTORS", entries, "entries of the factors of a Newton matrix"))
    if isinstance(lanes, Blocks | Traces) and lanes.path and (has["BLOCKS"] or has["TRACED"]):
        sizes += path_sizes(lanes.path, lanes.slope_terms)
    if has["ALONG"] and step.back:
        sizes.append(("USED", len(step.back.used), "coefficients that the slope of a path depends on"))
    if has["BATCHED"]:
        sizes.append(("BACK_PACKS", _packs_back(lanes, has), "SIMD batches (packs) of members in one reverse pass"))
    return sizes + text_of(program).last_constants(step)


def _packs_back(lanes: Lanes | None, has: Mapping[str, bool]) -> int:
    """Return the number of SIMD batches of members in one reverse pass; 0 if members are treated one by one."""
    if not has["BATCHED"]:
        return 0
    return lanes.reverse_packs if isinstance(lanes, Packs) else 1


def model(program: Program, lanes: Lanes | None, has: Mapping[str, bool], others: Iterable[str]) -> str:
    """Return the text of the file ``model.h``: the constants and functions of a program. ``others`` are further printed
    texts.
    """
    step = program.step
    body = functions.called(program, device=has["DEVICE"])
    kernels_of_step = text_of(program).kernels(step, has)
    kernels_of_step += program.choice
    kernels_of_step += [program.monitor.elapsed] if program.monitor and not has["STAGED"] else []
    kernels_of_step += text_of(program).tangents(step)
    turned = program.attitude
    kernels_of_step += [turned.exponential, turned.turn, turned.rate] if turned else []
    if step.refresh and not step.kind.flows:
        body.append(function(program, step.refresh, name="at_step" if program.noise else "at_time"))
    if step.adjoint:
        kernels_of_step += text_of(program).transposes(step)
        kernels_of_step += _of_adjoint(program, step.adjoint)
        if step.adjoint.refresh:
            body.append(function(program, step.adjoint.refresh, name="at_time_adjoint"))
    body += [function(program, kernel) for kernel in kernels_of_step if kernel]
    for _, kernels in _state_functions(program):
        body += [function(program, k, name=name, exported=True, returning=one) for k, name, one in kernels]
    text = "\n".join(body)
    member = members(program)
    asked = [
        f"isfinite(params->{member[p.name]})"
        + (f" && params->{member[p.name]} {'>' if p.positive else '>='} 0.0" if p.bound else "")
        for p in program.parameters
    ]
    schedule, solve = step.flow_schedule, step.inner_solve
    values = {
        "NAME": program.name,
        "defaults": "" if has["DEVICE"] else _defaults(program),
        "constants": _constants(program, lanes, has),
        "tolerance": repr(solve.tolerance) if solve and (has["NEWTON"] or has["BLOCKS"]) else "",
        "asked": " && ".join(asked),
        "fractions": ", ".join(map(repr, program.fractions)) if has["COMPOSED"] else "",
        "knots": KNOTS,
        "travels": [", ".join(map(repr, row)) for row in travels(program.fractions)]
        if has["BLOCKS"] and has["COMPOSED"] and not has["PATH"]
        else [],
        "times": ", ".join(map(repr, schedule.times)) if schedule else "",
        "multiples": ", ".join(map(repr, schedule.multiples)) if schedule else "",
        "path_slopes": ", ".join(map(str, step.path.slopes)) if step.path and (has["BLOCKS"] or has["TRACED"]) else "",
        "apart": not has["DEVICE"]
        and (has["PACKS"] or has["BATCHED"] or any("_APART" in part for part in [text, *others])),
    }
    values["middles"] = ", ".join(map(repr, program.midpoints))
    values["moments"] = ", ".join(map(repr, schedule.moments)) if schedule else ""
    values["middles"] = rendered(program, "middles.c", values) if step.refresh and program.time else ""
    values["bound"] = repr(MAX_NORMAL_VARIATE) if program.noise else ""
    return rendered(program, "constants.c", values) + text


def _of_adjoint(program: Program, adjoint: Adjoint) -> list[Kernel]:
    """Return the kernels of the reverse pass that do not depend on the kind of step, and those for paths."""
    path = [adjoint.path.curvature, adjoint.path.slope] if adjoint.path else []
    kernels = [*path, *([adjoint.prepare] if program.parameters or program.monitor else [])]
    return [*kernels, program.monitor.level] if program.monitor and program.monitor.level else kernels
