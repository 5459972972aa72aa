"""The parts of a C solver that depend on the kind of step. The functions of a `StepText` return these parts, and
`phigen.targets.c.emitter` inserts the parts into the files of the solver.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from phigen.ir import nodes as ir
from phigen.ir import path_functions
from phigen.ir.path_functions import TERMS, adjoint_program, tangent_program
from phigen.lanes.in_lanes import Blocks, Lanes, Packs, Traces
from phigen.scheme.kernel import Kernel
from phigen.scheme.path import PathSlopes, Recurrences
from phigen.scheme.program import Program
from phigen.scheme.steps import Gauss, Newton, Path, PathAdjoint, Splitting
from phigen.targets.c import gauss, splitting
from phigen.targets.c.kernels import function
from phigen.targets.c.lanes import packed_kernels, packed_step, printed_back
from phigen.targets.c.loops import commented, table

#: Constants of generated C: name, value and comment.
Sizes = list[tuple[str, int, str]]
Switches = Mapping[str, bool]


@dataclass(frozen=True)
class StepText:
    """The parts of a solver that depend on the kind of step. Each field is a function. It receives the step, and may
    also receive the program, the lanes and the switches.

    ``texts`` returns files that the runtime includes. ``declared`` returns the sizes that are declared with the struct
    of the solver. ``constants`` and ``last_constants`` return further sizes; the sizes of SIMD lanes are printed
    between them. Kernels are printed in this order: ``kernels``, the kernels of the gauge and the monitor,
    ``tangents``, ``transposes``. ``trail`` returns the number of values that a step stores on the tape. ``packed``
    prints the kernels for SIMD batches of members.
    """

    texts: Callable[[Program, Any, Lanes | None, Switches], dict[str, str]] = lambda program, step, lanes, has: {}
    declared: Callable[[Any, Lanes | None], Sizes] = lambda step, lanes: []
    constants: Callable[[Program, Any], Sizes] = lambda program, step: []
    last_constants: Callable[[Any], Sizes] = lambda step: []
    kernels: Callable[[Any, Switches], list[Kernel | None]] = lambda step, has: []
    tangents: Callable[[Any], list[Kernel | None]] = lambda step: []
    transposes: Callable[[Any], Sequence[Kernel | None]] = lambda step: step.adjoint.steps
    trail: Callable[[Program, Any, Lanes | None], int] = lambda program, step, lanes: (
        program.dimension * step.maps(len(program.fractions))
    )
    packed: Callable[[Program, Any, Packs], list[str]] = lambda program, step, packs: packed_kernels(program, packs)


def _max_iterations(step: Newton | Path) -> Sizes:
    return [("MAX_ITERATIONS", step.inner.max_iterations, "largest number of iterations for an implicit step")]


def _newton_kernels(step: Newton, has: Switches) -> list[Kernel | None]:
    unrolled = [step.eliminate] if has["UNROLLED"] else []
    transposed = [step.eliminate_transposed] if has["UNROLLED_TRANSPOSE"] else []
    return [step.prepare, step.main, *unrolled, *transposed]


def _path_kernels(step: Path, has: Switches) -> list[Kernel | None]:
    return [step.prepare, step.main, *([step.eliminate] if has["UNROLLED"] else [])]


def _path_texts(program: Program, step: Path, lanes: Lanes | None, has: Switches) -> dict[str, str]:
    texts = {"path_model.h": _path(program, step.recurrences, "path")}
    if step.tangent:
        varied = _path(tangent_program(program), step.tangent.recurrences, "tangent")
        texts["tangent_model.h"] = "" if step.adjoint else function(program, step.tangent.curvature) + "\n"
        texts["tangent_model.h"] += varied
    if step.back:
        texts["adjoint_path.h"] = _adjoint_path(program, step.back)
    if isinstance(lanes, Blocks | Traces) and lanes.path and (has["BLOCKS"] or has["TRACED"]):
        texts["path_model_lanes.h"] = _path_in_lanes(program, step, lanes.path)
    return texts


def _path_constants(program: Program, step: Path) -> Sizes:
    sizes = _max_iterations(step)
    sizes.append(
        ("TERMS", TERMS, "largest number of Taylor terms of a path; a path that needs more is divided into pieces")
    )
    sizes.append(
        (
            "SERIES",
            len(step.recurrences.series),
            "number of Taylor series of a path: of the coordinates, then of intermediate results",
        )
    )
    sizes.append(("FIXED", max(1, len(step.recurrences.fixed)), "number of values that are constant along a path"))
    if step.tangent:
        varied = step.tangent.recurrences
        sizes.append(("TANGENT_SERIES", len(varied.series), "Taylor series of a path and its derivative"))
        sizes.append(("TANGENT_FIXED", max(1, len(varied.fixed)), "values that are constant along the path"))
    if step.back:
        back, n = step.back, program.dimension
        sizes.append(
            ("BACK", 3 * n + len(back.used), "number of values on a path in the reverse pass: state and cotangents")
        )
        sizes.append(("BACK_SERIES", len(back.recurrences.series), "Taylor series of a path in the reverse pass"))
        sizes.append(("BACK_FIXED", max(1, len(back.recurrences.fixed)), "values that are constant along the path"))
    return sizes


def _adjoint_path(program: Program, path: PathAdjoint) -> str:
    """Return the text of the recurrences for paths in the reverse pass, and the text of a list: the indices of the
    coefficients that π depends on.
    """
    used, extended = ir.ConstantTable("back_used", tuple(path.used) or (0,)), adjoint_program(program, path)
    said = "The coefficients that the slope of a path depends on." if path.used else "No coefficient enters the slope."
    comment = f"/* {said} */"
    return f"{comment}\n{table(used, program)}\n\n{_path(extended, path.recurrences, 'back')}"


def _path(program: Program, path: Recurrences, kind: str) -> str:
    """Return the text of the recurrences for a path or for a tangent path."""
    return "\n".join(commented(f, program) for f in path_functions.functions(program, path, kind))


def _path_in_lanes(program: Program, step: Path, slopes: PathSlopes) -> str:
    """Return the text of the recurrences for a path and for its derivatives in SIMD lanes."""
    used = step.back.used if step.back else ()
    listed = path_functions.lane_functions(program, step.recurrences, slopes, used)
    return "\n".join(commented(f, program) for f in listed)


def path_sizes(slopes: PathSlopes, slope_terms: int) -> Sizes:
    """Return constants of the C for derivatives of paths in SIMD lanes: numbers of Taylor terms, of series and of
    values that are constant along a path.
    """
    return [
        ("SLOPE_TERMS", slope_terms, "largest number of Taylor terms of derivatives of a path"),
        ("SLOPE_SERIES", max(1, len(slopes.series)), "further Taylor series that derivatives of a path need"),
        ("SLOPE_FIXED", max(1, len(slopes.fixed)), "further constant values that derivatives of a path need"),
    ]


def _gauss_texts(program: Program, step: Gauss, lanes: Lanes | None, has: Switches) -> dict[str, str]:
    return {"gauss_tables.h": gauss.tables(program, step, lanes, batched=has["STAGE_GROUPS"])}


def _gauss_kernels(step: Gauss, has: Switches) -> list[Kernel | None]:
    return gauss.scalar_kernels(step, staged=has["STAGED"])


def _splitting_texts(program: Program, step: Splitting, lanes: Lanes | None, has: Switches) -> dict[str, str]:
    texts = {
        "flows.h": splitting.printed(program, step),
        "tangent_flows.h": splitting.tangent(program, step) if has["TANGENT"] else "",
        "adjoint_flows.h": splitting.adjoint(program, step, step.adjoint) if step.adjoint else "",
    }
    if has["BATCHED"] and isinstance(lanes, Packs):
        texts["adjoint_flows_lanes.h"] = printed_back(program, step, lanes)
    return texts


#: The parts of the C that depend on the kind of step, for each kind. `phigen.targets.c.lattice` prints the C of
#: lattices.
STEP_TEXTS: Mapping[str, StepText] = {
    "newton": StepText(constants=lambda program, step: _max_iterations(step), kernels=_newton_kernels),
    "explicit": StepText(
        kernels=lambda step, has: [step.prepare, step.main],
        tangents=lambda step: [step.tangent],
    ),
    "path": StepText(texts=_path_texts, constants=_path_constants, kernels=_path_kernels),
    "gauss": StepText(
        texts=_gauss_texts,
        declared=gauss.declared,
        constants=gauss.constants,
        kernels=_gauss_kernels,
        transposes=lambda step: (),
        trail=gauss.trail,
    ),
    "splitting": StepText(
        texts=_splitting_texts, last_constants=splitting.sizes, packed=packed_step, transposes=lambda step: ()
    ),
}


def text_of(program: Program) -> StepText:
    """Return the entry of `STEP_TEXTS` for the step of a program. Raises `KeyError` for a lattice."""
    return STEP_TEXTS[program.step.kind.name]
