"""Definitions of elementary functions in generated C: polynomials for small arguments, formulas with libm for all
others.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from phigen.lanes.lane_functions import SMALL_ARGUMENT_FUNCTIONS
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.symbolic.economised import economised
from phigen.symbolic.elliptic import ELLIPTIC
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import topological
from phigen.symbolic.remainders import LANE_DOUBLINGS, QUOTIENTS, REMAINDERS
from phigen.symbolic.special import (
    LANE_REACH,
    MIDDLE,
    NEAR,
    SPECIAL,
    lane_coefficients,
    near_coefficients,
    order_of,
    rest_coefficients,
)
from phigen.symbolic.universal import ANOMALY
from phigen.targets import special
from phigen.targets.c.language import FUNCTIONS, printer
from phigen.targets.c.layout import WIDTH
from phigen.targets.c.real import rendered
from phigen.targets.polynomials import estrin
from phigen.targets.special import entire_used

#: Functions of the C library for which generated code has a version with a polynomial for small arguments. Flows call
#: this version.
FLOW_FUNCTIONS = tuple(
    f for f in SMALL_ARGUMENT_FUNCTIONS if f not in (*ENTIRE, ANOMALY, *ELLIPTIC, *REMAINDERS, *QUOTIENTS)
)


#: In single precision, terms of a series are omitted if they are smaller than the first term times this number. The
#: number is a quarter of a rounding error.
_SINGLE_NEGLIGIBLE = 2.0**-26

C = TypeVar("C", float, Fraction)


@dataclass(frozen=True)
class Small:
    """Elementary function with a series for small arguments t: Σ_k s_k z^k/(first + k·step)!.

    The factors s_k alternate between the two ``signs``. If ``step`` is 2, z is t²; if ``step`` is 1, z is t.
    ``full_range`` is a formula for all arguments. ``flows`` describes the version that flows call: the largest |t|, the
    number of terms, and a formula in which P is the sum. In the same way, ``rows`` describes the version for loops over
    sites. This version has the fewest operations.
    """

    meaning: str
    full_range: str
    first: int
    step: int
    signs: tuple[int, int]
    flows: tuple[float, int, str]
    rows: tuple[Fraction, int, str]

    def terms(self, count: int) -> list[Fraction]:
        """Return the first ``count`` coefficients of the series as exact fractions."""
        return [Fraction(self.signs[k % 2], math.factorial(self.first + k * self.step)) for k in range(count)]


_QUARTER, _HALF, _TWICE = Fraction(1, 4), Fraction(1, 2), "2.0 * sin(0.5 * t) * sin(0.5 * t)"

#: Descriptions of the functions in `FLOW_FUNCTIONS`, by name.
_SMALL = {
    "expm1": Small(
        "exp(t) - 1", "expm1(t)", 2, 1, (1, 1), (0.35, 12, "t + t * t * ({P})"), (_QUARTER, 9, "z + z * z * {P}")
    ),
    "sin": Small("sin(t)", "sin(t)", 3, 2, (-1, 1), (1.0, 8, "t + t * z * ({P})"), (_HALF, 5, "{t} + {t} * z * {P}")),
    "versin": Small("1 - cos(t)", _TWICE, 2, 2, (1, -1), (1.0, 9, "z * ({P})"), (_HALF, 6, "z * {P}")),
}


def called(program: Program, unprinted: Sequence[Kernel] = (), *, device: bool = False) -> list[str]:
    """Return the definitions of special functions that the kernels of a program call.

    Among the special functions are φ (see `phigen.symbolic.special`), its derivatives, the functions of `ENTIRE`, and
    elliptic functions. If the step is a splitting, the functions of `FLOW_FUNCTIONS` that flows call are defined too.
    Calls of φ and its derivatives in the kernels ``unprinted`` do not count. On a ``device``, φ is computed without the
    library function tan.
    """
    # Loops over the sites of a lattice call other versions of elementary functions, so only the flows of systems
    # without a lattice count here.
    used = {e.op for e in topological([e for kernel in program.step.flow_kernels for e in kernel.roots])}
    small = [*entire_used(program), *(f for f in FLOW_FUNCTIONS if f in used)]
    names = special.used(program, unprinted)
    if device and names and SPECIAL[0] not in names:  # the derivatives of φ call φ
        names = [SPECIAL[0], *names]
    phis = [rendered(program, "phi_device.c" if device else "phi.c", _phi(program, f, device=device)) for f in names]
    polynomial = [rendered(program, "polynomial.c", {})] if phis else []
    anomaly = [_anomaly(program)] if special.calls_anomaly(program) else []
    functions = [_small_argument_function(program, f) for f in small]
    elliptic = _elliptic(program, special.elliptic_used(program), near=False)
    elliptic += _remainders(program, special.remainders_used(program), near=False)
    return [*polynomial, *phis, *functions, *anomaly, *elliptic, *_exponentials(program)]


def _exponentials(program: Program) -> list[str]:
    """Return the definition of the matrix exponential, for the largest matrix in ``prepare``; [] if there is none."""
    rows, adjoint = special.largest_exponential(program), special.transposes_exponentials(program)
    if not rows:
        return []
    values = {"NAME": program.name, "entries": (2 * rows if adjoint else rows) ** 2, "adjoint": adjoint}
    return [rendered(program, "matrix_exponential.c", {**values, **special.exponential_constants()})]


def near(program: Program, names: Iterable[str]) -> list[str]:
    """Return the definitions of functions for loops over lanes. The functions are correct only for small arguments."""
    listed = list(names)
    others = [f for f in listed if f not in (*ELLIPTIC, *REMAINDERS, *QUOTIENTS)]
    texts = [
        _anomaly(program, near=True) if f == ANOMALY else _small_argument_function(program, f, near=True)
        for f in others
    ]
    texts += _elliptic(program, [f for f in ELLIPTIC if f in listed], near=True)
    return texts + _remainders(program, [f for f in (*REMAINDERS, *QUOTIENTS) if f in listed], near=True)


def _small_argument_function(program: Program, f: str, **values: object) -> str:
    """Return the definition of a function by a polynomial for small arguments and a formula for all others."""
    return rendered(program, "small.c", _values(program, f) | values)


def _remainders(program: Program, names: Sequence[str], *, near: bool) -> list[str]:
    """Return the definitions of the functions that exponentials of small matrices need."""
    doublings = LANE_DOUBLINGS if near else "halvings"
    values = {"NAME": program.name, "near": near, "doublings": doublings, **special.remainder_values(names)}
    return [rendered(program, "remainders.c", values)] if names else []


def _elliptic(program: Program, names: Sequence[str], *, near: bool) -> list[str]:
    """Return the definitions of the elliptic functions that free rigid bodies need."""
    return special.elliptic_texts(
        names, lambda template, values: rendered(program, f"{template}.c", {"near": near, **values})
    )


def _anomaly(program: Program, *, near: bool = False) -> str:
    """Return the definition of the universal anomaly of Kepler motions. It contains two series with the same powers,
    for the Stumpff functions c2 and c3.
    """
    c2, c3 = special.stumpff()
    count = max(len(needed(program, c, 1.0)) for c in (c2, c3))
    c2, c3 = c2[:count], c3[:count]
    lines, first = estrin(c2, "z", "a")
    (_, *others), second = estrin(c3, "z", "e")
    values = {"NAME": program.name, "near": near, "lines": [*lines, *others], "c2": first, "c3": second}
    return rendered(program, "anomaly.c", values | special.anomaly_values(single=program.single))


def near_rows(program: Program, names: Iterable[str]) -> list[str]:
    """Return the definitions of functions for loops over sites. The functions are correct only for small
    arguments.

    Their polynomials have the fewest terms that give full precision.
    """
    return [
        _anomaly(program, near=True) if f == ANOMALY else rendered(program, "row_near.c", _row_values(program, f))
        for f in names
    ]


def _row_values(program: Program, f: str) -> dict[str, object]:
    if f in ENTIRE:
        entire, t = ENTIRE[f], "s"
        meaning, radius, squared, form = entire.meaning, Fraction(entire.radius), False, "{P}"
        coefficients = needed(program, entire.terms(), entire.radius)
    else:
        small, t = _SMALL[f], "t"
        (radius, count, form), meaning, squared = small.rows, small.meaning, small.step == 2
        reach = radius**2 if squared else radius
        count = min(count, len(needed(program, small.terms(count), float(reach))))
        coefficients = economised(small.terms(count + 8), reach, count, symmetric=not squared)
    polynomial = _nested([float(c) for c in coefficients])
    text = f"return {form.format(P=polynomial, t=t)};"
    lines = textwrap.wrap(text, WIDTH - 12, subsequent_indent="    ", break_on_hyphens=False)
    values = {"meaning": meaning, "t": t, "radius": repr(float(radius)), "squared": squared}
    return {"NAME": program.name, "function": f, "lines": lines, **values}


def _nested(coefficients: Sequence[float]) -> str:
    """Return Σ c_k z^k as text, by Horner's rule."""
    *others, last = map(repr, coefficients)
    return "".join(f"({c} + z * " for c in others) + last + ")" * len(others)


def phi_lanes(program: Program, ops: Set[str]) -> list[str]:
    """Return the definitions of φ(s) = (1 − w cot w)/s, w = √s/2, and of its derivatives, for use in loops over lanes.
    Only the functions in ``ops`` are defined.
    """
    texts = []
    for f in (f for f in SPECIAL if f in ops):
        first, *rest = map(repr, lane_coefficients(order_of(f)))
        before, last = rest[-2:]
        others = list(zip(rest[-3::-2], rest[-4::-2], strict=True))
        values = {"first": first, "before": before, "last": last, "others": others, "reach": repr(LANE_REACH)}
        texts.append(rendered(program, "phi_lane.c", {"NAME": program.name, "function": f, **values}))
    return texts


def _phi(program: Program, f: str, *, device: bool) -> Mapping[str, object]:
    near = needed(program, near_coefficients(order_of(f)), NEAR)
    rest = needed(program, rest_coefficients(order_of(f)), MIDDLE)
    tables = [line for name, numbers in (("central", near), ("rest", rest)) for line in _table(name, numbers)]
    values = dict(special.values(f, f)) | {"NAME": program.name, "function": f, "tables": tables}
    *closed, last = special.closed(order_of(f))
    closed_form = {"closed": closed[1:] if device else closed, "value": last.split(" = ")[1]}
    reduction = special.turns(single=program.single) if device else {}
    return (
        values
        | closed_form
        | reduction
        | {"derivative": order_of(f) > 0}
        | {"near_count": len(near), "rest_count": len(rest)}
    )


def needed(program: Program, coefficients: Sequence[C], reach: float) -> list[C]:
    """Return the coefficients of a series that the precision of a program needs for arguments up to ``reach``."""
    if not program.single:
        return list(coefficients)
    least = _SINGLE_NEGLIGIBLE * abs(float(coefficients[0]))
    last = max(n for n, c in enumerate(coefficients) if abs(float(c)) * reach**n >= least)
    return list(coefficients[: last + 1])


def _table(name: str, numbers: Sequence[float]) -> list[str]:
    """Return the lines that declare a table of numbers in C."""
    text = f"static const double {name}[{len(numbers)}] = {{ {', '.join(map(repr, numbers))} }};"
    first, *rest = textwrap.wrap(text, WIDTH - 4, subsequent_indent="    ", break_on_hyphens=False)
    return [first.replace("static const", "PHI_LOCAL_TABLE", 1), *rest]


def _values(program: Program, f: str) -> dict[str, object]:
    if f in ENTIRE:
        entire, t, form = ENTIRE[f], "s", "{P}"
        meaning, radius = entire.meaning, entire.radius
        names = {**FUNCTIONS, **{name: f"{program.name}_{name}" for name in ENTIRE}}
        outside = special.full_range(f, lambda scope: printer(scope, names), "s > 0.0 ? {0} : {1}")
        lines, value = estrin(needed(program, entire.terms(), radius), t)
    else:
        small, t = _SMALL[f], "t"
        (radius, count, form), meaning, squared = small.flows, small.meaning, small.step == 2
        outside = {"full_range": small.full_range, "root": False}
        terms = needed(program, small.terms(count), radius**2 if squared else radius)
        lines, value = estrin(terms, "z" if squared else "t")
        lines = ["const double z = t * t;"] * squared + lines
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
