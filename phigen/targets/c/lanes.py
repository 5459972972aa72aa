"""What the C code does for several steps or members at once: blocks of steps in `integrate`, and ensembles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from typing import Any

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Factorisation, Implicit, Newton, Path, PathLanes
from phigen.symbolic.expression import topological
from phigen.symbolic.special import LANE_REACH, SPECIAL, lane_coefficients, order_of
from phigen.targets.c import paths
from phigen.targets.c.kernels import FUNCTIONS, LANE_FORMULAS, LANE_FUNCTIONS, LANES, each_lane, function
from phigen.targets.rendering import render

#: Bytes that the working arrays of a block, or of a group of members, may take on the stack.
MOST_STACK = 256 * 1024

#: Passes over a block that cost, per step, what an evaluation at one point costs: with loops that are vectorised, and
#: with loops that are not as they call functions of the library, or with derivatives of paths, of which an evaluation
#: at one point has no need.
PASSES, PASSES_OF_CALLS = 2, 1

#: Corrections below which the next pass goes on with the matrices of the last, as its error is then of third order.
FROZEN = 1e-5

#: Functions that are instructions, or arithmetic.
INLINE = {"abs", "sqrt", "sign", "inv"}

#: Templates in the order in which they call one another.
_MODELS = ("sizes", "correct", "largest", "near_lanes", "solved")
_BLOCKS = ("chain", "block", "march", "block_step", "choose_guess", "integrate_blocks")
_GUESSES = ("group", "group_guess", "group_fit", "stay_near")
_GROUPS = (*_GUESSES, "group_solve", "group_advance", "group_leave", "group_step", "group_run", "ensemble")

#: Those of which there are others for matrices with many zeros.
_DENSE = ("correct", "chain", "group_advance")

_MEMBERS = [
    "double effort;  /* evaluations that a single step takes, for each stage */",
    "int pause;      /* steps to make singly before a block is tried */",
    "int setback;    /* the last pause, halved with every block that succeeds */",
    "int foreseeing; /* whether blocks are guessed by recurrences */",
    "int passes;     /* that the last block took which was guessed by Runge-Kutta steps */",
    "size_t doubt;   /* steps to wait before recurrences are tried again */",
    "size_t retry;   /* steps after which that is */",
]

_RESET = [
    f"s->pause = {2 * LANES};",
    "s->setback = s->foreseeing = 0;",
    "s->doubt = s->retry = 0;",
    "s->effort = 0.0;",
    "s->passes = INT_MAX;",
]

#: Terms of the series of exp(r) − 1 for |r| ≤ ½ log 2, and the largest argument of exp in a lane.
_EXP_TERMS, _EXP_REACH = 14, 700.0

#: Terms of the series of artanh(f) − f for |f| ≤ tan²(π/8).
_LOG_TERMS = 11

#: Terms of the series of sin(r) − r for |r| ≤ π/2; π in parts of 28 bits, whose multiples are exact, and a rest (Cody
#: and Waite, Software Manual for the Elementary Functions, 1980); the largest argument for which that holds.
_SINE_TERMS, _SINE_REACH = 11, 1e6
_PI = 3.141592651605606, 1.9841871479187034e-09, 1.1442377452219664e-17


def blocks(program: Program) -> bool:
    """Whether `integrate` takes blocks of steps: not for explicit steps, long paths (`paths.applies`), what would need
    too much stack, or where the spec says no."""
    step = program.step
    able = isinstance(step, Newton) or (isinstance(step, Path) and step.lanes is not None)
    return program.lanes and able and _block_size(program, paths.SLOPE_TERMS[-1]) <= MOST_STACK


def _block_size(program: Program, slope_terms: int) -> int:
    n = program.dimension
    more, once = paths.stack(program, slope_terms)
    return 8 * LANES * (len(program.fractions) * (program.step.coefficients + 4 * n + 3 * n * n + more) + once)


def _slope_terms(program: Program) -> int:
    return next(k for k in paths.SLOPE_TERMS if _block_size(program, k) <= MOST_STACK)


def vectorised(program: Program) -> bool:
    """Whether compilers can make vector instructions of the lanes: not of calls to functions of the library."""
    if not blocks(program):
        return False
    calls = set(FUNCTIONS) - set(LANE_FUNCTIONS) - set(LANE_FORMULAS) - INLINE
    return not calls & _operations(program)


def _operations(program: Program) -> set[str]:
    """What the kernels that are evaluated in lanes call."""
    match program.step:
        case Newton(linearise=linearise):
            kernels = [linearise]
        case Path() as step if step.lanes:
            kernels = paths.kernels(program, step, step.lanes)
        case _:
            kernels = []
    return {e.op for e in topological([e for kernel in kernels for e in kernel.roots])}


def groups(program: Program, rows: int) -> bool:
    """Whether ensembles are integrated in groups, each with so many rows of values and weights on the stack."""
    n = program.dimension
    if not blocks(program):
        return False
    values = (
        len(program.fractions) * (program.step.coefficients + rows * n)
        + 7 * n
        + 3 * n * n
        + sum(paths.stack(program, _slope_terms(program)))
    )
    return 8 * LANES * values <= MOST_STACK


def values(program: Program, memory: Mapping[str, int]) -> Mapping[str, object]:
    """What the templates of this room read; ``memory`` says how many values are remembered."""
    step = program.step
    grouped = groups(program, memory["fitted"] + memory["window"])
    return {
        "lanes": LANES,
        "each_lane": each_lane(program),
        "floor": "0.0" if isinstance(step, Implicit) and step.inner.relative else "1e-6",
        "frozen": repr(FROZEN),
        "passes": PASSES if vectorised(program) and not isinstance(step, Path) else PASSES_OF_CALLS,
        "model_members": _matrices(program) + paths.model_members(program) if blocks(program) else [],
        "ensemble_how": f"{LANES} are integrated\n   side by side, and with OpenMP such groups in parallel."
        if grouped
        else "Each is integrated by itself.",
        "ensemble_templates": _GROUPS if grouped else ("ensemble_members",),
        "group_size": "LANES",
        "clang_loop": "vectorize(assume_safety)",
        "block_members": _MEMBERS if blocks(program) else [],
        **_group_values(program),
        "block_reset": _RESET if blocks(program) else [],
    }


def factors_of(program: Program) -> Factorisation | None:
    """The factors of the Newton matrix, if it has so many zeros that they are kept, not its inverse."""
    return program.step.factors if isinstance(program.step, Newton) else None


def _matrices(program: Program) -> list[str]:
    """The matrices of a model."""
    lanes, n, factors = f"{program.name}_lanes", program.dimension, factors_of(program)
    if factors is None:
        said = "a residual r of alpha(y) = x takes inverse r from y, and gain r from the increment"
        return [f"/* {said} */", f"{lanes} inverse[{n * n}], slope[{n * n}], gain[{n * n}];"]
    said = "of the Jacobian of alpha(y); that of the increment; what corrections take from the increment"
    return [f"/* {said} */", f"{lanes} factor[{len(factors.factorise.roots)}], slope[{n * n}], gained[{n}];"]


def _templates(program: Program, names: Sequence[str]) -> list[str]:
    return [f"{name}_sparse" if factors_of(program) and name in _DENSE else name for name in names]


def _group_values(program: Program) -> Mapping[str, object]:
    """What is particular to each member of an ensemble: the gauge, where it is chosen at the start."""
    gauges = len(program.gauge.casimirs) if program.gauge else 0
    if not gauges:
        return {"group_gauge": (), "group_join": (), "init_member": "init(&s, params, x)"}
    return {
        "group_gauge": [f"double gauge[{LANES}][{gauges}]; /* of each member */"],
        "group_join": ["memcpy(group->gauge[lane], s.gauge, sizeof s.gauge);"],
        "init_member": "init_gauge(&s, params, x, group->gauge[lane])",
    }


def pieces(program: Program, values: Mapping[str, Any]) -> list[str]:
    """`integrate` and `ensemble`, with what they need."""
    ensemble: tuple[str, ...] = values["ensemble_templates"]
    if not blocks(program):
        return [render("c", f"{template}.c", values) for template in ("integrate", *ensemble)]
    found = [render("c", f"{template}.c", values) for template in ("lanes", "table")]
    found += lane_functions(program, _operations(program))
    match program.step:
        case Newton() as step:
            found += _stages(program, step, values)
        case Path() as step if step.lanes:
            found += _paths(program, step, step.lanes, values)
    names = _templates(program, (*_BLOCKS, *ensemble, "lanes_end"))
    return found + [render("c", f"{template}.c", values) for template in names]


def _stages(program: Program, step: Newton, values: Mapping[str, Any]) -> list[str]:
    """A stage in all lanes, for alpha and beta that are formulas."""
    factors = step.factors
    found = [function(program, step.linearise, lanes=True, sparse=factors is not None) + "\n"]
    found.append(function(program, _without_matrices(step.linearise), lanes=True) + "\n")
    if factors:
        found.append(function(program, factors.factorise, lanes=True) + "\n")
        found.append(function(program, factors.substitute, lanes=True) + "\n")
        found.append(function(program, factors.substitute, lanes=True, single=True, shared=["side"]) + "\n")
        found.append(render("c", "tabulate_sparse.c", values))
    elif step.invert:
        found.append(function(program, step.invert, lanes=True) + "\n")
        found.append(render("c", "tabulate_unrolled.c", values))
    else:
        found.append(render("c", "tabulate.c", values))
    return found + [render("c", f"{template}.c", values) for template in _templates(program, (*_MODELS, "update"))]


def _paths(program: Program, step: Path, several: PathLanes, values: Mapping[str, Any]) -> list[str]:
    """A stage in all lanes, for alpha and beta that are the ends of a path."""
    kernels = paths.kernels(program, step, several)
    found = [function(program, kernel, lanes=True) + "\n" for kernel in kernels]
    found += [render("c", f"{template}.c", values) for template in _MODELS]
    return found + paths.pieces(program, step, several, values, _slope_terms(program))


def lane_functions(program: Program, ops: Set[str]) -> list[str]:
    """Versions for the loops over lanes of the functions that these operations call."""
    needed = ops | {f for f in LANE_FUNCTIONS for op in ops & set(LANE_FORMULAS) if f"{{{f}}}" in LANE_FORMULAS[op]}
    found = [render("c", "phi_lane.c", _phi(program, f)) for f in SPECIAL if f in needed]
    found += [render("c", "expm1_lane.c", _exponential(program, f)) for f in ("exp", "expm1") if f in needed]
    found += [render("c", "log_lane.c", _logarithm(program))] if "log" in needed else []
    return found + [render("c", "sine_lane.c", _sine(program, f)) for f in ("sin", "cos") if f in needed]


def _without_matrices(kernel: Kernel) -> Kernel:
    """What a pass needs that goes on with the matrices of the last."""
    outputs = tuple(o for o in kernel.outputs if "jacobian" not in o.name)
    needed = set(topological([v for o in outputs for v in o.values]))
    named = tuple((name, value) for name, value in kernel.named if value in needed)
    return replace(kernel, name="evaluate", outputs=outputs, named=named)


def _phi(program: Program, name: str) -> Mapping[str, object]:
    return {
        "name": f"{program.name}_{name}",
        "reach": repr(LANE_REACH),
        **_alternating(lane_coefficients(order_of(name))),
    }


def _alternating(coefficients: Sequence[float]) -> Mapping[str, object]:
    """A polynomial, given by an odd number of coefficients, as c_0 + two sums over every second term."""
    first, *rest = map(repr, coefficients)
    before, last = rest[-2:]
    others = list(zip(rest[-3::-2], rest[-4::-2], strict=True))
    return {"first": first, "before": before, "last": last, "others": others}


def _exponential(program: Program, name: str) -> Mapping[str, object]:
    coefficients = [1 / math.factorial(k) for k in range(2, _EXP_TERMS + 1)]
    return {
        "name": f"{program.name}_{name}",
        "meaning": {"exp": "exp(u)", "expm1": "exp(u) - 1"}[name],
        "rest": {"exp": "power", "expm1": "(power - 1.0)"}[name],
        "reach": repr(_EXP_REACH),
        **_alternating(coefficients),
    }


def _logarithm(program: Program) -> Mapping[str, object]:
    coefficients = [1 / (2 * k + 1) for k in range(1, _LOG_TERMS + 1)]
    return {
        "name": f"{program.name}_log",
        **_alternating(coefficients),
    }


def _sine(program: Program, name: str) -> Mapping[str, object]:
    coefficients = [(-1) ** k / math.factorial(2 * k + 1) for k in range(1, _SINE_TERMS + 1)]
    return {
        "name": f"{program.name}_{name}",
        "meaning": f"{name} u",
        "shift": {"sin": "0.0", "cos": "0.5"}[name],
        "pi_1": repr(_PI[0]),
        "pi_2": repr(_PI[1]),
        "pi_3": repr(_PI[2]),
        "reach": repr(_SINE_REACH),
        **_alternating(coefficients),
    }
