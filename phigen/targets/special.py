"""What the templates of φ and its derivatives, and of entire functions, are filled with, in C and in NumPy."""

from __future__ import annotations

from collections.abc import Mapping

from phigen.scheme.program import Program
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import topological
from phigen.symbolic.special import MIDDLE, NEAR, POLE, SPECIAL, near_coefficients, order_of, rest_coefficients

_MEANING = (
    "(1 - w cot w)/s with w = sqrt(s)/2, coth for negative s: the function of the exponential bi-realisation.",
    "The derivative of (1 - w cot w)/s, w = sqrt(s)/2.",
    "The second derivative of (1 - w cot w)/s, w = sqrt(s)/2.",
)
_POLE_PART = ("2.0 * pole", "2.0 * pole * pole", "4.0 * pole * pole * pole")
_CLOSED = (
    "phi0 = (1.0 - c) / s",
    "phi1 = (0.5 * s * phi0 * phi0 - 1.5 * phi0 + 0.125) / s",
    "phi2 = (0.5 * phi0 * phi0 - 2.5 * phi1 + s * phi0 * phi1) / s",
)


def used(program: Program) -> list[str]:
    """The functions of `SPECIAL` that the kernels call, in order."""
    ops = {e.op for e in topological([e for kernel in program.kernels for e in kernel.roots])}
    return [name for name in SPECIAL if name in ops]


def values(function: str, name: str) -> Mapping[str, object]:
    """The values of the template for one function, which is called ``name`` in the output."""
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
    """The closed form of a derivative of φ, and what it needs, from c = w cot w, in C and in Python."""
    return _CLOSED[: order + 1]


_FAR = {
    "cosroot": "np.where(s > 0.0, np.cos(np.sqrt(np.abs(s))), np.cosh(np.sqrt(np.abs(s))))",
    "sinroot": "np.where(s > 0.0, np.sin(np.sqrt(np.abs(s))), np.sinh(np.sqrt(np.abs(s)))) / np.sqrt(np.abs(s))",
    "sinroot1": "(_cosroot(s) - _sinroot(s)) / (2.0 * s)",
    "arcroot": "(1.0 - _sinroot(s)) / s",
    "exprel": "np.expm1(s) / s",
    "exprel1": "(np.exp(s) - _exprel(s)) / s",
}
#: What the closed form of a function calls.
NEEDS = {"sinroot1": ("cosroot", "sinroot"), "arcroot": ("sinroot",), "exprel1": ("exprel",)}


def entire_used(program: Program) -> list[str]:
    """The functions of `ENTIRE` that the kernels call, and those that these need, in order."""
    ops = {e.op for e in topological([e for kernel in program.kernels for e in kernel.roots])}
    ops |= {needed for f in NEEDS if f in ops for needed in NEEDS[f]}
    return [name for name in ENTIRE if name in ops]


def entire_values(function: str) -> Mapping[str, object]:
    """The values of the template for one function of `ENTIRE` in NumPy."""
    found = ENTIRE[function]
    last, *others = [repr(float(c)) for c in reversed(found.terms())]
    return {
        "function": function,
        "meaning": found.meaning,
        "radius": repr(found.radius),
        "last": last,
        "others": others,
        "far": _FAR[function],
    }
