"""Functions of phigen's own in C: polynomials where these suffice, else libm."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence, Set
from fractions import Fraction

from phigen.lanes.functions import NEAR_FUNCTIONS
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Splitting
from phigen.symbolic.economised import economised
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import topological
from phigen.symbolic.special import (
    LANE_REACH,
    SPECIAL,
    lane_coefficients,
    near_coefficients,
    order_of,
    rest_coefficients,
)
from phigen.targets import special
from phigen.targets.c.kernels import FUNCTIONS, printer
from phigen.targets.c.layout import WIDTH
from phigen.targets.polynomials import estrin
from phigen.targets.rendering import render
from phigen.targets.special import entire_used

#: The functions of the library that have a version here, under whose name flows call them.
FLOW_FUNCTIONS = tuple(f for f in NEAR_FUNCTIONS if f not in ENTIRE)


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


def called(program: Program, unprinted: Sequence[Kernel] = ()) -> list[str]:
    """The functions of phigen's own that kernels call, but those ``unprinted``: φ and its derivatives, `ENTIRE`,
    and for a splitting those that its flows call."""
    step = program.step
    flows: tuple[Kernel, ...] = ()  # loops over sites have their own
    if isinstance(step, Splitting):
        flows = (*step.flows, *step.tangents, *(step.adjoint.steps if step.adjoint else ()))
    used = {e.op for e in topological([e for kernel in flows for e in kernel.roots])}
    small = [*entire_used(program), *(f for f in FLOW_FUNCTIONS if f in used)]
    phis = [render("c", "phi.c", _phi(program, f)) for f in special.used(program, unprinted)]
    polynomial = [render("c", "polynomial.c", {"NAME": program.name})] if phis else []
    return [*polynomial, *phis, *(render("c", "small.c", _values(program, f)) for f in small)]


def near(program: Program, names: Iterable[str]) -> list[str]:
    """Versions for the loops over lanes, of small arguments only, of these functions."""
    return [render("c", "small.c", _values(program, f) | {"near": True}) for f in names]


#: The same for the loops over sites, where arguments are those of short steps: radius, number of coefficients, and the
#: value by P in z, which is t or t².
_ROWS = {
    "expm1": (Fraction(1, 4), 9, "z + z * z * {P}"),
    "sin": (Fraction(1, 2), 5, "{t} + {t} * z * {P}"),
    "versin": (Fraction(1, 2), 6, "z * {P}"),
}


def near_rows(program: Program, names: Iterable[str]) -> list[str]:
    """Versions for the loops over sites, of small arguments only: the fewest operations that keep all digits."""
    return [render("c", "row_near.c", _row_values(program, f)) for f in names]


def _row_values(program: Program, f: str) -> dict[str, object]:
    if f in ENTIRE:
        found, t = ENTIRE[f], "s"
        meaning, radius, squared, form = found.meaning, Fraction(found.radius), False, "{P}"
        coefficients = list(found.terms())
    else:
        meaning, _, _, variable, _, _ = _SMALL[f]
        (radius, count, form), t, squared = _ROWS[f], "t", variable == "z"
        first, step, sign = {"expm1": (2, 1, 1), "sin": (3, 2, -1), "versin": (2, 2, -1)}[f]
        series = _inverse_factorials(first, step, count + 8, sign)
        overall = -1 if f == "sin" else 1
        coefficients = [
            overall * c for c in economised(series, radius**2 if squared else radius, count, symmetric=not squared)
        ]
    polynomial = _nested([float(c) for c in coefficients])
    text = f"return {form.format(P=polynomial, t=t)};"
    lines = textwrap.wrap(text, WIDTH - 12, subsequent_indent="    ", break_on_hyphens=False)
    own = {"meaning": meaning, "t": t, "radius": repr(float(radius)), "squared": squared}
    return {"NAME": program.name, "function": f, "lines": lines, **own}


def _nested(coefficients: Sequence[float]) -> str:
    """Σ c_k z^k by Horner's rule."""
    *others, last = map(repr, coefficients)
    return "".join(f"({c} + z * " for c in others) + last + ")" * len(others)


def phi_lanes(program: Program, ops: Set[str]) -> list[str]:
    """φ and its derivatives for the loops over lanes, as far as these operations call them."""
    found = []
    for f in (f for f in SPECIAL if f in ops):
        first, *rest = map(repr, lane_coefficients(order_of(f)))
        before, last = rest[-2:]
        others = list(zip(rest[-3::-2], rest[-4::-2], strict=True))
        own = {"first": first, "before": before, "last": last, "others": others, "reach": repr(LANE_REACH)}
        found.append(render("c", "phi_lane.c", {"NAME": program.name, "function": f, **own}))
    return found


def _phi(program: Program, f: str) -> Mapping[str, object]:
    near, rest = near_coefficients(order_of(f)), rest_coefficients(order_of(f))
    tables = [line for name, numbers in (("near", near), ("rest", rest)) for line in _table(name, numbers)]
    given = dict(special.values(f, f)) | {"NAME": program.name, "function": f, "tables": tables}
    *closed, last = special.closed(order_of(f))
    own = {"closed": closed, "value": last.split(" = ")[1]}
    return given | own | {"near_count": len(near), "rest_count": len(rest)}


def _table(name: str, numbers: Sequence[float]) -> list[str]:
    """The declaration of a table, in lines."""
    text = f"static const double {name}[{len(numbers)}] = {{ {', '.join(map(repr, numbers))} }};"
    return textwrap.wrap(text, WIDTH - 4, subsequent_indent="    ", break_on_hyphens=False)


def _values(program: Program, f: str) -> dict[str, object]:
    if f in ENTIRE:
        found, t, form = ENTIRE[f], "s", "{P}"
        meaning, radius = found.meaning, found.radius
        own = {**FUNCTIONS, **{name: f"{program.name}_{name}" for name in ENTIRE}}
        outside = special.far(f, lambda scope: printer(scope, own), "s > 0.0 ? {0} : {1}")
        lines, value = estrin(found.terms(), t)
    else:
        meaning, radius, far, variable, coefficients, form = _SMALL[f]
        outside = {"far": far, "root": False}
        lines, value = estrin(coefficients, variable)
        t, lines = "t", [*(["const double z = t * t;"] if variable == "z" else []), *lines]
    return {
        "NAME": program.name,
        "function": f,
        "meaning": meaning,
        "t": t,
        "radius": repr(radius),
        **outside,
        "near": False,
        "lines": lines,
        "value": form.format(P=value),
    }
