"""Entire functions in which flows are written, so that there is no division by a frequency that may be 0.

- ``cosroot``(s) = cos √s, ``sinroot``(s) = sin(√s)/√s: with cosh and sinh for s < 0, one formula for rotations and
  hyperbolic motions; cosroot² + s·sinroot² = 1
- ``arcroot``(s) = (√s − sin √s)/√s³
- ``exprel``(s) = (e^s − 1)/s
- ``sinroot1``, ``arcroot1`` and ``exprel1`` are the derivatives of sinroot, arcroot and exprel, for tangent maps

They are internal to phigen: a spec cannot use them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from typing import Any

#: Relative size of terms of series, compared with the first term, below which they are omitted in double precision.
NEGLIGIBLE = 1e-17

_HALF = Fraction(1, 2)


@dataclass(frozen=True)
class Entire:
    """A function Σ c_n s^n: its coefficients, and the closed form for |s| > ``radius``.

    ``closed`` has the forms for s > 0 and for s < 0, or one for both, as functions of a library of functions, s and
    √|s|. The library is math, an mpmath context, or a printer of formulas. ``known`` is the form for s > 0 in terms of
    well-known functions. ``slopes`` is the derivative, as in `phigen.symbolic.functions`; None without a derivative.
    ``meaning`` is the comment in generated code.
    """

    meaning: str
    coefficient: Callable[[int], Fraction]
    closed: tuple[Callable[[Any, Any, Any], Any], ...]
    known: Callable[..., Any]
    slopes: Callable[..., tuple[Any, ...]] | None
    radius: float

    def terms(self) -> list[Fraction]:
        """The coefficients that double precision needs for |s| ≤ ``radius``."""
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
        "the derivative of sin(sqrt(s))/sqrt(s)",
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
        "the derivative of (sqrt(s) - sin(sqrt(s)))/sqrt(s)**3",
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
        "the derivative of (exp(s) - 1)/s",
        lambda n: (n + 1) * _factorial(n + 2),
        (lambda f, s, root: (f.exp(s) - f.exprel(s)) / s,),
        lambda call, s: (call("exp", s) - call("exprel", s)) / s,
        None,
        0.5,
    ),
}


class _Library:
    """A library of functions that also has those of `ENTIRE`, by their closed forms."""

    def __init__(self, library: Any) -> None:
        self._library = library

    def __getattr__(self, name: str) -> Any:
        return (lambda s: by_closed_form(self._library, name, s)) if name in ENTIRE else getattr(self._library, name)


def by_closed_form(library: Any, name: str, s: Any) -> Any:
    """Return the value for s that is not small, with functions of a library."""
    forms = ENTIRE[name].closed
    return forms[0 if s > 0 else -1](_Library(library), s, library.sqrt(abs(s)))


def in_double(name: str, s: float) -> float:
    """Return the value in double precision, as the generated code computes it."""
    function = ENTIRE[name]
    if abs(s) > function.radius:
        return float(by_closed_form(math, name, s))
    value = 0.0
    for c in reversed(function.terms()):
        value = value * s + float(c)
    return value


def precisely(context: Any, name: str, s: Any) -> Any:
    """Return the value in an mpmath context, to its precision except for a few digits."""
    function = ENTIRE[name]
    if abs(s) > 1:
        return by_closed_form(context, name, s)
    value = context.zero
    for n in reversed(range(context.dps // 2 + 20)):
        c = function.coefficient(n)
        value = value * s + context.mpf(c.numerator) / c.denominator
    return value


def value(library: Any, name: str, s: Any) -> Any:
    """Return the value in the precision of the library: double for `math`, else that of an mpmath context."""
    return in_double(name, s) if library is math else precisely(library, name, s)
