"""Functions of small arguments in C: a polynomial where that suffices, else libm. Flows of splittings live on them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from fractions import Fraction

from phigen.scheme.program import Program
from phigen.scheme.steps import Splitting
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import topological
from phigen.targets.polynomials import estrin
from phigen.targets.rendering import render
from phigen.targets.special import entire_used

#: The names under which flows call functions that have a version here.
FLOW_FUNCTIONS = ("expm1", "sin", "versin")

#: Those that are polynomials near 0.
NEAR_FUNCTIONS = (*ENTIRE, *FLOW_FUNCTIONS)


def _inverse_factorials(first: int, step: int, count: int, signs: int) -> list[Fraction]:
    """±1/first!, ±1/(first + step)!, …: alternating if ``signs`` is −1."""
    return [Fraction(signs**k, math.factorial(first + k * step)) for k in range(count)]


#: Meaning, radius, value outside, coefficients of P, and the value inside by P, t and z = t².
_SMALL = {
    "expm1": ("exp(t) - 1", 0.35, "expm1(t)", "t", _inverse_factorials(2, 1, 12, 1), "t + t * t * ({P})"),
    "sin": ("sin(t)", 1.0, "sin(t)", "z", [-c for c in _inverse_factorials(3, 2, 8, -1)], "t + t * z * ({P})"),
    "versin": (
        "1 - cos(t)",
        1.0,
        "2.0 * sin(0.5 * t) * sin(0.5 * t)",
        "z",
        _inverse_factorials(2, 2, 9, -1),
        "z * ({P})",
    ),
}
_FAR = {
    "cosroot": "s > 0.0 ? cos(sqrt(s)) : cosh(sqrt(-s))",
    "sinroot": "s > 0.0 ? sin(sqrt(s)) / sqrt(s) : sinh(sqrt(-s)) / sqrt(-s)",
    "sinroot1": "({NAME}_cosroot(s) - {NAME}_sinroot(s)) / (2.0 * s)",
    "arcroot": "(1.0 - {NAME}_sinroot(s)) / s",
    "exprel": "expm1(s) / s",
    "exprel1": "(exp(s) - {NAME}_exprel(s)) / s",
}


def pieces(program: Program) -> list[str]:
    """The functions of `ENTIRE` that kernels call, and for a splitting those that flows call."""
    step = program.step
    flows = (*step.flows, *step.tangents) if isinstance(step, Splitting) else ()
    used = {e.op for e in topological([e for kernel in flows for e in kernel.roots])}
    called = [f for f in FLOW_FUNCTIONS if f in used]
    return [render("c", "small.c", _values(program, f)) for f in (*entire_used(program), *called)]


def near(program: Program, ops: Set[str]) -> list[str]:
    """Versions for the loops over lanes, of small arguments only, of the functions that these operations call."""
    return [render("c", "near.c", _values(program, f)) for f in NEAR_FUNCTIONS if f in ops]


def _values(program: Program, f: str) -> Mapping[str, object]:
    if f in ENTIRE:
        found, t, form = ENTIRE[f], "s", "{P}"
        meaning, radius, far = found.meaning, found.radius, _FAR[f]
        lines, value = estrin(found.terms(), t)
    else:
        meaning, radius, far, variable, coefficients, form = _SMALL[f]
        lines, value = estrin(coefficients, variable)
        t, lines = "t", [*(["const double z = t * t;"] if variable == "z" else []), *lines]
    return {
        "NAME": program.name,
        "function": f,
        "meaning": meaning,
        "t": t,
        "radius": repr(radius),
        "far": far.format(NAME=program.name),
        "lines": lines,
        "value": form.format(P=value),
    }
