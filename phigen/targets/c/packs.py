"""Ensembles of explicit steps and splittings: packs of members, one in each lane, and groups of packs."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from phigen.scheme.lowering import expand_powers
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Implicit, Splitting
from phigen.symbolic.expression import Expression, topological
from phigen.targets.c import splitting
from phigen.targets.c.kernels import FUNCTIONS, LANE_FORMULAS, LANE_FUNCTIONS, LANES, function, lane_calls
from phigen.targets.c.lanes import INLINE, MOST_STACK, lane_functions
from phigen.targets.c.small import NEAR_FUNCTIONS, near
from phigen.targets.rendering import render

#: Packs in a group: with fewer the processor waits, with more nothing is gained.
PACKS = 4

#: Steps of a group before its members are looked at.
STRETCH = 32

#: Powers that are left after lowering and call no function.
_ARITHMETIC = (Fraction(2), Fraction(-1), Fraction(1, 2))


def packed(program: Program) -> bool:
    """Whether the members of an ensemble are put into packs: where steps are explicit, all members have the same
    coefficients, every function has a version for lanes, and the spec does not say no."""
    explicit = not isinstance(program.step, Implicit) and not program.gauge
    states = 2 * PACKS * LANES * 3 * program.dimension
    return explicit and program.lanes and not _calls(program) and 8 * states <= MOST_STACK


def _calls(program: Program) -> set[str]:
    """The functions without a version for lanes that a step calls."""
    nodes = topological(expand_powers(_values_of_steps(program)))
    known = {*LANE_FUNCTIONS, *LANE_FORMULAS, *NEAR_FUNCTIONS, *INLINE}
    powers = {"pow" for e in nodes if e.op == "pow" and e.value not in _ARITHMETIC}
    return ({e.op for e in nodes} & set(FUNCTIONS)) - known | powers


def _values_of_steps(program: Program) -> list[Expression]:
    match program.step:
        case Explicit(increment=kernel):
            return kernel.roots
        case Splitting(flows=flows):
            return [e for flow in flows for e in flow.roots]
    return []


def _operations(program: Program) -> set[str]:
    return {e.op for e in topological(_values_of_steps(program))}


def _two_ways(program: Program) -> bool:
    """Whether flows call functions that are polynomials near 0: where these do not reach, there is a longer way."""
    return isinstance(program.step, Splitting) and bool(_operations(program) & set(NEAR_FUNCTIONS))


def values(program: Program) -> Mapping[str, object]:
    """What the templates of this room read."""
    if not packed(program):
        return {}
    name, arguments = program.name, "(&group->s, group->pack, group->packs, steps);"
    one = [f"{name}_steps_lanes{arguments}", f"{name}_group_lost(group, lost);"]
    two = [
        f"if (!group->far) {name}_steps_lanes{arguments}",
        f"if (group->far || {name}_group_lost(group, lost) > 0) {{",
        "    memcpy(group->pack, before, sizeof before);",
        f"    {name}_steps_far_lanes{arguments}",
        f"    group->far = {name}_group_lost(group, lost) == 0;",
        "}",
    ]
    far = _two_ways(program)
    start = f"{name}_lanes start[{program.dimension}]; /* x where a step began; in it, carry is moved */"
    return {
        "pack_members": [start] if isinstance(program.step, Splitting) else [],
        "packs": PACKS,
        "stretch": STRETCH,
        "group_size": "GROUP",
        # Loops over lanes that clang unrolls first make it look for vectors in the loops around them.
        "clang_loop": "vectorize(assume_safety) unroll(disable)",
        "group_members": ["int far;   /* whether arguments of functions are too large for polynomials */"] * far,
        "attempts": two if far else one,
        "ensemble_how": f"{PACKS * LANES} are integrated\n   side by side, and with OpenMP such groups in parallel.",
    }


def pieces(program: Program, values: Mapping[str, object]) -> list[str]:
    """`integrate` and `ensemble`, with what they need."""
    found = [render("c", f"{template}.c", values) for template in ("integrate", "lanes")]
    found += lane_functions(program, _operations(program))
    found.append(render("c", "pack.c", values))
    match program.step:
        case Explicit(increment=kernel):
            found.append(function(program, kernel, lanes=True, shared=["coef"]) + "\n")
            found.append(render("c", "explicit_lanes.c", values))
        case Splitting() as step:
            short = {f: f"{program.name}_{f}_near" for f in NEAR_FUNCTIONS}
            found += [*near(program, _operations(program)), render("c", "add_lanes.c", values)]
            found += splitting.in_lanes(program, step, values, "", {**lane_calls(program), **short})
            if _two_ways(program):
                found += splitting.in_lanes(program, step, values, "_far", lane_calls(program))
    templates = ("pack_group", "pack_run", "ensemble", "lanes_end")
    return found + [render("c", f"{template}.c", values) for template in templates]
