"""Entire functions for the formulas of exact flows. They avoid divisions by a frequency, which may be 0.

- ``cosroot``(s) = cos(√s) and ``sinroot``(s) = sin(√s)/√s. For s = −r < 0 their values are cosh(√r) and sinh(√r)/√r.
  With these functions, one formula holds for rotations and for hyperbolic motions; cosroot² + s·sinroot² = 1
- ``arcroot``(s) = (√s − sin √s)/√s³
- ``exprel``(s) = (e^s − 1)/s
- ``sinroot1``, ``arcroot1`` and ``exprel1`` are the derivatives of sinroot, arcroot and exprel, for tangent maps

The functions are internal to phigen: a spec cannot use them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from typing import Any

#: Terms of a power series are omitted in double precision if they are smaller than this fraction of its first term.
NEGLIGIBLE = 1e-17

_HALF = Fraction(1, 2)


@dataclass(frozen=True)
class Entire:
    """An entire function Σ c_n s^n: its power series for |s| ≤ ``radius``, and a closed form for larger |s|.

    ``closed`` has two closed forms, for s > 0 and for s < 0, or a single one for both signs. A closed form is a
    function of three arguments: a library of functions (math, an mpmath context, or a printer of formulas), s, and
    √|s|. ``known`` writes the function in terms of well-known functions, for s > 0. ``slopes`` is the derivative, as in
    `phigen.symbolic.functions`, or None. ``meaning`` is the comment in generated code.
    """

    meaning: str
    coefficient: Callable[[int], Fraction]
    closed: tuple[Callable[[Any, Any, Any], Any], ...]
    known: Callable[..., Any]
    slopes: Callable[..., tuple[Any, ...]] | None
    radius: float

    def terms(self) -> list[Fraction]:
        """Return the coefficients c_n of the terms that double precision needs for |s| ≤ ``radius``, c_0 first."""
        first = abs(self.coefficient(0))
        n = next(n for n in count(1) if abs(self.coefficient(n)) * self.radius**n < NEGLIGIBLE * first)
        return [self.coefficient(k) for k in range(n)]


def _factorial(n: int) -> Fraction:
    return Fraction(1, math.factorial(n))


ENTIRE: dict[str, Entire] = {
    "cosroot": Entire(
        "cos(sqrt(s)), cosh(sqrt(-s)) for negative s",
        lambda n: (-1) ** n * _factorial(2 * n),
        (lambda f, s, root: f.cos(root), lambda f, s, root: f.cosh(root)),
        lambda call, s: call("cos", s**_HALF),
        lambda call, f, s: (-_HALF * call("sinroot", s),),
        1.0,
    ),
    "sinroot": Entire(
        "sin(sqrt(s))/sqrt(s), sinh(sqrt(-s))/sqrt(-s) for negative s",
        lambda n: (-1) ** n * _factorial(2 * n + 1),
        (lambda f, s, root: f.sin(root) / root, lambda f, s, root: f.sinh(root) / root),
        lambda call, s: call("sin", s**_HALF) / s**_HALF,
        lambda call, f, s: (call("sinroot1", s),),
        1.0,
    ),
    "sinroot1": Entire(
        "The derivative of sin(sqrt(s))/sqrt(s)",
        lambda n: (-1) ** (n + 1) * (n + 1) * _factorial(2 * n + 3),
        (lambda f, s, root: (f.cosroot(s) - f.sinroot(s)) / (2 * s),),
        lambda call, s: (call("cosroot", s) - call("sinroot", s)) / (2 * s),
        None,
        1.0,
    ),
    "arcroot": Entire(
        "(sqrt(s) - sin(sqrt(s)))/sqrt(s)**3, with sinh for negative s",
        lambda n: (-1) ** n * _factorial(2 * n + 3),
        (lambda f, s, root: (1 - f.sinroot(s)) / s,),
        lambda call, s: (1 - call("sinroot", s)) / s,
        lambda call, f, s: (call("arcroot1", s),),
        1.0,
    ),
    "arcroot1": Entire(
        "The derivative of (sqrt(s) - sin(sqrt(s)))/sqrt(s)**3",
        lambda n: (-1) ** (n + 1) * (n + 1) * _factorial(2 * n + 5),
        (lambda f, s, root: (f.sinroot(s / 4) ** 2 / 2 - 3 * f.arcroot(s)) / (2 * s),),
        lambda call, s: (call("sinroot", s / 4) ** 2 / 2 - 3 * call("arcroot", s)) / (2 * s),
        None,
        4.0,
    ),
    "exprel": Entire(
        "(exp(s) - 1)/s",
        lambda n: _factorial(n + 1),
        (lambda f, s, root: f.expm1(s) / s,),
        lambda call, s: (call("exp", s) - 1) / s,
        lambda call, f, s: (call("exprel1", s),),
        0.5,
    ),
    "exprel1": Entire(
        "The derivative of (exp(s) - 1)/s",
        lambda n: (n + 1) * _factorial(n + 2),
        (lambda f, s, root: (f.exp(s) - f.exprel(s)) / s,),
        lambda call, s: (call("exp", s) - call("exprel", s)) / s,
        None,
        0.5,
    ),
}


class _Library:
    """A library of functions, extended by the closed forms of the functions of `ENTIRE`."""

    def __init__(self, library: Any) -> None:
        self._library = library

    def __getattr__(self, name: str) -> Any:
        return (lambda s: by_closed_form(self._library, name, s)) if name in ENTIRE else getattr(self._library, name)


def by_closed_form(library: Any, name: str, s: Any) -> Any:
    """Return the value of a function of `ENTIRE` by its closed form, which is inaccurate for small s."""
    forms = ENTIRE[name].closed
    return forms[0 if s > 0 else -1](_Library(library), s, library.sqrt(abs(s)))


def in_double(name: str, s: float) -> float:
    """Return the value of a function of `ENTIRE` in double precision, by the algorithm of generated code."""
    function = ENTIRE[name]
    if abs(s) > function.radius:
        return float(by_closed_form(math, name, s))
    value = 0.0
    for c in reversed(function.terms()):
        value = value * s + float(c)
    return value


def precisely(context: Any, name: str, s: Any) -> Any:
    """Return the value of a function of `ENTIRE` in an mpmath context; its last few digits may be wrong."""
    function = ENTIRE[name]
    if abs(s) > 1:
        return by_closed_form(context, name, s)
    value = context.zero
    for n in reversed(range(context.dps // 2 + 20)):
        c = function.coefficient(n)
        value = value * s + context.mpf(c.numerator) / c.denominator
    return value


def value(library: Any, name: str, s: Any) -> Any:
    """Return the value of a function of `ENTIRE`.

    ``library`` is `math`, for double precision, or an mpmath context, for the precision of this context.
    """
    return in_double(name, s) if library is math else precisely(library, name, s)
