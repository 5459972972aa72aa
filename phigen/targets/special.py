"""Template values that all languages share, for φ and its derivatives, entire functions, elliptic functions and
others.

φ is the function of the exponential bi-realisation, φ(s) = (1 − w cot w)/s with w = √s/2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

from phigen.scheme.kernel import Kernel
from phigen.scheme.lowering import expand_powers
from phigen.scheme.program import Program
from phigen.splitting.matrices import MAX_PADE_NORM, PADE
from phigen.symbolic import elliptic, remainders
from phigen.symbolic.elliptic import ELLIPTIC
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import Expression, call, symbol, symbols_of, topological
from phigen.symbolic.special import MIDDLE, NEAR, POLE, SPECIAL, near_coefficients, order_of, rest_coefficients
from phigen.symbolic.universal import ANOMALY, MOST_ITERATIONS, RADIAL
from phigen.targets.names import Scope
from phigen.targets.printer import Printer
from phigen.targets.reserved import Reserved

#: Largest number of halvings of t when exponentials of small matrices are computed. If more halvings were needed, the
#: exponential would overflow.
MOST_HALVINGS = 14

#: Number of iterations after which the arithmetic–geometric mean of any two doubles has converged.
MOST_MEANS = 16

_MEANING = (
    "(1 - w cot w)/s with w = sqrt(s)/2; for s < 0, (1 - w coth w)/s with w = sqrt(-s)/2.",
    "The derivative of (1 - w cot w)/s, w = sqrt(s)/2.",
    "The second derivative of (1 - w cot w)/s, w = sqrt(s)/2.",
)
_POLE_PART = ("2.0 * pole", "2.0 * pole * pole", "4.0 * pole * pole * pole")
_CLOSED = (
    "phi0 = (1.0 - c) / s",
    "phi1 = (0.5 * s * phi0 * phi0 - 1.5 * phi0 + 0.125) / s",
    "phi2 = (0.5 * phi0 * phi0 - 2.5 * phi1 + s * phi0 * phi1) / s",
)


def used(program: Program, unprinted: Sequence[Kernel] = ()) -> list[str]:
    """Return the functions of `SPECIAL` that kernels of a program call, in the order of `SPECIAL`. Calls in the kernels
    ``unprinted`` do not count.
    """
    kernels = [kernel for kernel in program.kernels if kernel not in unprinted]
    ops = {e.op for e in topological([e for kernel in kernels for e in kernel.roots])}
    return [name for name in SPECIAL if name in ops]


def values(function: str, name: str) -> Mapping[str, object]:
    """Return the values for the template of φ or of a derivative of φ; ``name`` is the name of the function in the
    output.
    """
    order = order_of(function)
    near, rest = near_coefficients(order), rest_coefficients(order)
    return {
        "name": name,
        "order": order,
        "meaning": _MEANING[order],
        "near": repr(NEAR),
        "middle": repr(MIDDLE),
        "pole": repr(POLE),
        "pole_part": _POLE_PART[order],
        "near_last": repr(near[-1]),
        "near_others": [repr(c) for c in near[-2::-1]],
        "rest_last": repr(rest[-1]),
        "rest_others": [repr(c) for c in rest[-2::-1]],
        "closed": closed(order),
    }


def closed(order: int) -> tuple[str, ...]:
    """Return statements that compute φ, and its derivatives up to ``order``, in closed form.

    The statements are valid in C and in Python. They read the variable c = w cot w; the head of the module defines φ
    and w.
    """
    return _CLOSED[: order + 1]


def turns(*, single: bool) -> dict[str, object]:
    """Return constants for subtracting multiples of π from w = √s/2: 1/π, an upper and a lower part of π, and a limit
    of s.

    The sum of the two parts is π. The upper part has 33 bits, so its products with integers up to 2^20 are exact. In
    single precision, the upper part has 8 bits, and the integers go up to 2^16. For s up to the limit, no larger
    integer is needed.
    """
    bits, most = (6, 2.0**16) if single else (31, 2.0**20)
    upper = math.floor(math.pi * 2.0**bits) / 2.0**bits
    lower = (math.pi - upper) + _BEYOND_PI
    limit = float(f"{0.95 * (2.0 * math.pi * most) ** 2:.1e}")  # rounded to two digits
    return {"reciprocal": repr(1.0 / math.pi), "upper": repr(upper), "lower": repr(lower), "limit": repr(limit)}


#: The difference π − (the double nearest to π).
_BEYOND_PI = 1.2246467991473532e-16


class _Calls:
    """Stand-in for a math library: each of its functions returns an expression, the call of the function."""

    def __getattr__(self, name: str) -> Callable[..., Expression]:
        return lambda *arguments: call(name, *arguments)


def _closed_forms(function: str) -> list[Expression]:
    """Return the closed forms of a function of `ENTIRE`: one for s > 0 and one for s < 0, or a single one for both.

    The symbol ``root`` stands for √|s|.
    """
    return [form(_Calls(), symbol("s"), symbol("root")) for form in ENTIRE[function].closed]


def full_range(function: str, printer: Callable[[Scope], Printer], choice: str) -> dict[str, object]:
    """Return two template values for a function of s that `ENTIRE` lists: ``full_range``, the text of the closed form,
    and ``root``, which says whether the text contains the variable root = √|s|.

    ``choice`` is the format of a conditional in the language: {0} is the value for s > 0, {1} for s < 0.
    """
    forms = _closed_forms(function)
    texts = [printer(Scope(Reserved()))(expand_powers([form])[0]) for form in forms]
    return {"full_range": choice.format(*texts) if len(texts) > 1 else texts[0], "root": "root" in symbols_of(*forms)}


def entire_used(program: Program) -> list[str]:
    """Return the functions of `ENTIRE` that kernels of a program call, directly or through other functions. They are in
    the order of `ENTIRE`.
    """
    ops = {e.op for e in topological([e for kernel in program.kernels for e in kernel.roots])}
    for f in (f for f in ENTIRE if f in ops):
        ops = ops | {e.op for e in topological(_closed_forms(f))}
    return [name for name in ENTIRE if name in ops]


def calls_anomaly(program: Program) -> bool:
    """Whether kernels call the universal anomaly of Kepler motions."""
    return any(e.op == ANOMALY for e in topological([e for kernel in program.kernels for e in kernel.roots]))


def elliptic_used(program: Program) -> list[str]:
    """Return the elliptic functions that kernels of a program call. If there are any, the first function of `ELLIPTIC`
    is included, since the others call it.
    """
    ops = {e.op for e in topological([e for kernel in program.kernels for e in kernel.roots])}
    called = [name for name in (*ELLIPTIC, elliptic.THIRD) if name in ops]
    return called if not called or called[0] == ELLIPTIC[0] else [ELLIPTIC[0], *called]


def remainders_used(program: Program) -> list[str]:
    """Return the functions of `phigen.symbolic.remainders` that kernels of a program call.

    Exponentials of small matrices need these functions.
    """
    ops = {e.op for e in topological([e for kernel in program.kernels for e in kernel.roots])}
    return [name for name in (*remainders.REMAINDERS, *remainders.QUOTIENTS) if name in ops]


def remainder_values(names: Sequence[str]) -> dict[str, object]:
    """Return template values for functions that exponentials of small matrices need.

    ``names`` are functions of `phigen.symbolic.remainders`. The values include the index of each function in the list
    of all these functions.
    """
    places = {name: k for k, name in enumerate((*remainders.REMAINDERS, *remainders.QUOTIENTS))}
    reach = remainders.MAX_ROOT
    return {
        "names": [(name, places[name], _described(places[name])) for name in names],
        "terms": remainders.TERMS,
        "end": remainders.TERMS + 1,
        "reach": repr(reach),
        **{f"reach{k}": repr(reach**k) for k in (2, 3, 4)},
        "most": MOST_HALVINGS,
        "lane_part": repr(2.0**-remainders.LANE_DOUBLINGS),
    }


def _described(place: int) -> str:
    """Return the comment that says what a function of `phigen.symbolic.remainders` returns."""
    return f"Coefficient {place % 4} of the {'remainder' if place < 4 else 'quotient'}."


#: Integrals of elliptic functions, computed by Carlson's integrals. Each entry has four texts: the comment, the
#: template of Carlson's integral, and its arguments in two cases. The first case is the integral up to t, the second
#: the integral over half a turn. In the arguments, cc, dd and s*s are the squares of cn, dn and S, and ratio is R/P;
#: `phigen.symbolic.elliptic` defines S, P and R.
_INTEGRALS = {
    elliptic.SQUARES: ("The integral over t of S**2 with S = sn/sqrt(P)", "carlson", "cc, dd, 1.0", "0.0, ratio, 1.0"),
    elliptic.RATIOS: (
        "The integral over t of S**2/dn**2 with S = sn/sqrt(P)", "carlson", "cc, 1.0, dd", "0.0, 1.0, ratio"
    ),
    elliptic.THIRD: (
        "The integral over t of S**2/(1 - n*S**2) with S = sn/sqrt(P), n <= 0", "carlson_third",
        "cc, dd, 1.0 - n * (s * s)", "0.0, ratio, 1.0 - n / P",
    ),
}  # fmt: skip


def elliptic_texts(
    names: Sequence[str],
    render: Callable[[str, Mapping[str, object]], str],
    spelling: Callable[[str], str] = lambda name: name,
) -> list[str]:
    """Return the definitions of elliptic functions: of the amplitude, of Carlson's integrals, and of functions that
    call these.

    ``render`` renders a template, and ``spelling`` returns the names of Carlson's integrals in the language.
    """
    values: dict[str, object] = {
        "part": repr(2.0**-elliptic.DOUBLINGS),
        "doublings": elliptic.DOUBLINGS,
        "series": _nested_series(),
        "ratio": repr(elliptic.MEAN_RATIO),
        "most": MOST_MEANS,
        "circle": repr(2 * math.pi),
        # If the spread of the three arguments is at most this fraction of their mean, the error of the final polynomial
        # is below a rounding error.
        "spread": repr((2.2e-16 / 4) ** (-1 / 6)),
        "duplications": elliptic.LANE_DUPLICATIONS,
    }
    texts = [render("amplitude", values)] if ELLIPTIC[0] in names else []
    integrals = [name for name in names if name in _INTEGRALS]
    texts += [render(template, values) for template in dict.fromkeys(_INTEGRALS[name][1] for name in integrals)]
    for name in integrals:
        meaning, template, arguments, whole = _INTEGRALS[name]
        forms = {"function": name, "meaning": meaning, "arguments": arguments, "whole": whole}
        third = {"carlson": spelling(template), "third": name == elliptic.THIRD}
        texts.append(render("amplitude_integral", {**values, **forms, **third}))
    return texts


def _nested_series() -> str:
    """Return the power series of S/t (see `phigen.symbolic.elliptic`) in x and y as text, by Horner's rule."""
    return _nested([_nested([repr(float(c)) for c in row], "x") for row in elliptic.series()], "y")


def _nested(coefficients: Sequence[str], variable: str) -> str:
    *others, last = coefficients
    text = last
    for c in reversed(others):
        text = f"{c} + {variable} * ({text})"
    return text


def stumpff() -> tuple[list[Fraction], list[Fraction]]:
    """Return the coefficients of c2 = (1 - cos x)/x² and of c3 = (x - sin x)/x³ as series in x². The series have as
    many terms as full precision needs for x² ≤ 1.
    """
    count = len(ENTIRE["arcroot"].terms())
    c2 = [Fraction((-1) ** n, math.factorial(2 * n + 2)) for n in range(count)]
    return c2, [ENTIRE["arcroot"].coefficient(n) for n in range(count)]


def anomaly_values(*, single: bool = False) -> dict[str, object]:
    """Return the values that the templates of the universal anomaly have in all languages; ``single`` is for 32-bit
    numbers.

    ``unit`` is the relative error of a rounding. The iteration ends when the relative error is below ``rounding``,
    about a tenth of ``unit``.
    """
    if single:
        return {"most": MOST_ITERATIONS, "radial": "1e-12", "unit": "1.2e-7", "rounding": "1e-8"}
    return {"most": MOST_ITERATIONS, "radial": repr(RADIAL), "unit": "2.3e-16", "rounding": "2e-17"}


def largest_exponential(program: Program) -> int:
    """Return the number of rows of the largest matrix whose exponential ``prepare`` computes; 0 if there is none."""
    return max((n for _, n in program.step.prepare.exponentials), default=0)


def transposes_exponentials(program: Program) -> bool:
    """Whether the reverse pass goes through exponentials of matrices that depend on parameters."""
    return program.step.adjoint is not None and program.step.adjoint.prepare.exponents is not None


def exponential_constants() -> dict[str, object]:
    """Return the constants in the templates of the matrix exponential."""
    return {"pade": ", ".join(repr(float(c)) for c in PADE), "reach": repr(MAX_PADE_NORM)}
