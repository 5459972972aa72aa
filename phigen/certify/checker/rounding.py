"""Programs of floating-point operations, enclosed together with their rounding errors, by python-flint's balls."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, reduce
from typing import Any, TypeAlias

from flint import arb, fmpq, fmpq_poly

Ball: TypeAlias = Any  # a flint.arb
Balls: TypeAlias = list[Any]

U, TINY, BALL, ZERO = arb(2) ** -53, arb(2) ** -1074, arb(0, 1), arb(0)
CARRY = U * arb("1.01")  # largest compensation term of a coordinate of size 1
LIBM: Mapping[str, tuple[Callable[[Ball], Ball], Callable[[Ball], Ball]]] = {  # functions with their derivatives
    "sqrt": (arb.sqrt, lambda x: 1 / (2 * x.sqrt())), "exp": (arb.exp, arb.exp), "expm1": (arb.expm1, arb.exp),
    "log": (arb.log, lambda x: 1 / x), "log1p": (arb.log1p, lambda x: 1 / (1 + x)), "sin": (arb.sin, arb.cos),
    "cos": (arb.cos, lambda x: -x.sin()), "tan": (arb.tan, lambda x: 1 + square(x.tan())), "sinh": (arb.sinh, arb.cosh),
    "cosh": (arb.cosh, arb.sinh), "tanh": (arb.tanh, lambda x: 1 - square(x.tanh())),
}  # fmt: skip
LESS_ACCURATE = ("sinh", "cosh", "tanh")  # twice the error of the others, as glibc documents
TERMS = 90  # the coefficients of all series are at most 2^(1-n), so for |s| <= 1 the rest is at most 2^(2-TERMS)
SERIES: Mapping[str, Callable[[int], fmpq]] = {  # coefficient n of functions that the C computes by polynomials
    "cosroot": lambda n: fmpq((-1) ** n, math.factorial(2 * n)),
    "sinroot": lambda n: fmpq((-1) ** n, math.factorial(2 * n + 1)),
    "arcroot": lambda n: fmpq((-1) ** n, math.factorial(2 * n + 3)),
    "exprel": lambda n: fmpq(1, math.factorial(n + 1)),
    "expm1": lambda n: fmpq(min(n, 1), math.factorial(n)),
    "sin": lambda n: fmpq((-1) ** (n // 2) * (n % 2), math.factorial(n)),
    "versin": lambda n: fmpq((-1) ** (n // 2 + 1) * (n > 0 and 1 - n % 2), math.factorial(n)),
    "phi0": lambda n: abs(fmpq.bernoulli(2 * n + 2)) / math.factorial(2 * n + 2),
    "phi1": lambda n: (n + 1) * SERIES["phi0"](n + 1),
    "phi2": lambda n: (n + 1) * SERIES["phi1"](n + 1),
}


class RefusedError(Exception):
    """Refusal of a certificate, or of what cannot be certified; a hint says what to do."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


def demand(condition: bool, message: str) -> None:
    """Raise `RefusedError` unless a condition holds."""
    if not condition:
        raise RefusedError(message)


def mag(x: Ball) -> Ball:
    """The largest absolute value in a ball."""
    demand(x.is_finite(), "a value is not bounded")
    return x.abs_upper()


def square(x: Ball) -> Ball:
    """The square of a ball, which is not negative; x**2 is no number where the ball contains 0."""
    low, high = x.abs_lower(), x.abs_upper()
    return (low * low).union(high * high)


def top(values: Iterable[Ball]) -> Ball:
    """The largest of some balls, or a ball that contains it."""
    return reduce(arb.max, values)


def interval(ends: Sequence[float]) -> Ball:
    """The ball around an interval."""
    return arb(ends[0]).union(arb(ends[1]))


class Tape:
    """Operations in order, each with derivatives by its operands and a bound for its error alone; or ``exact``."""

    def __init__(self, series: Mapping[str, Any], ulps: float, exact: bool = False) -> None:
        self.parents: list[tuple[tuple[int, Any], ...]] = []
        self.local: Balls = []
        self.series, self.ulps, self.exact = series, ulps, exact

    def value(
        self, x: Ball, parents: tuple[tuple[int, Any], ...] = (), local: Ball = ZERO, power: bool = False
    ) -> Value:
        """Append an operation; its enclosure contains the exact value and the computed one."""
        self.parents.append(parents)
        self.local.append(ZERO if self.exact else local)
        return Value(self, len(self.local) - 1, x if self.exact else x + BALL * local, power)

    def number(self, c: float, local: Ball = ZERO) -> Value:
        """Append a constant."""
        return self.value(arb(c), (), local, abs(math.frexp(c)[0]) == 0.5)

    def function(self, name: str, a: Value) -> Value:
        """Append a function of libm, or one that the C computes by a polynomial."""
        if name in LIBM:
            x = LIBM[name][0](a.x)
            ulps = self.ulps * (2 if name in LESS_ACCURATE else 1)
            error = U * mag(x) * (1 if name == "sqrt" else 2 * ulps * (1 + 9 * U)) + TINY
            return self.value(x, ((a.index, LIBM[name][1](a.x)),), error)
        polynomial, name = self.series[name], name.split(":")[1]
        r, c, rest = mag(a.x), coefficients(name), arb(2) ** (2 - TERMS)
        demand(r < min(polynomial["radius"], 1), f"the argument of {name} reaches {float(r):.3g}")
        inner = Tape(self.series, self.ulps)
        rounding = inner.error(play(polynomial, inner.number, s=[inner.value(a.x)])["value"][0])
        p = play(polynomial, lambda number, _: fmpq(*number.as_integer_ratio()), s=[fmpq_poly([0, 1])])["value"][0]
        missed = horner([abs(p[n] - c[n]) for n in range(TERMS)], r) + rest
        x, slope = horner(c, a.x), horner([n * c[n] for n in range(1, TERMS)], a.x)
        return self.value(x + BALL * rest, ((a.index, slope + BALL * TERMS * rest),), rounding + missed)

    def derivatives(self, output: Value) -> list[Ball | None]:
        """Enclosures of the derivatives of an output by each operation, by reverse differentiation; None is 0."""
        slopes: list[Ball | None] = [None] * output.index + [arb(1)]
        for k in range(output.index, -1, -1):
            for parent, slope in self.parents[k] if slopes[k] is not None else ():
                slopes[parent] = slopes[k] * slope + (ZERO if slopes[parent] is None else slopes[parent])
        return slopes

    def error(self, output: Value, slopes: list[Ball | None] | None = None) -> Ball:
        """Bound for the error of an output, by the mean value theorem for all errors of operations at once."""
        pairs = zip(slopes or self.derivatives(output), self.local, strict=False)
        return sum((mag(slope) * local for slope, local in pairs if slope is not None), ZERO)


class Value:
    """The result of an operation on a tape; ``power`` says that it is a power of 2, which multiplies exactly."""

    def __init__(self, tape: Tape, index: int, x: Ball, power: bool) -> None:
        self.tape, self.index, self.x, self.power = tape, index, x, power

    def __neg__(self) -> Value:
        return self.tape.value(-self.x, ((self.index, -1),))

    def __add__(self, other: Value, sign: int = 1) -> Value:
        x = self.x + sign * other.x
        return self.tape.value(x, ((self.index, 1), (other.index, sign)), U * mag(x))

    def __sub__(self, other: Value) -> Value:
        return self.__add__(other, -1)

    def __mul__(self, other: Value) -> Value:
        x = square(self.x) if self is other else self.x * other.x
        local = TINY if self.power or other.power else U * mag(x) + TINY
        return self.tape.value(x, ((self.index, other.x), (other.index, self.x)), local)

    def __truediv__(self, other: Value) -> Value:
        demand(0 not in other.x, "a denominator may be 0")
        x = self.x / other.x
        return self.tape.value(x, ((self.index, 1 / other.x), (other.index, -x / other.x)), U * mag(x) + TINY)


@cache
def coefficients(name: str) -> list[fmpq]:
    """The first coefficients of a function of `SERIES`."""
    return [SERIES[name](n) for n in range(TERMS)]


def horner(coefficients: Sequence[Any], s: Ball) -> Ball:
    """The value of a polynomial."""
    value = ZERO
    for c in reversed(coefficients):
        value = value * s + arb(c)
    return value


def play(kernel: Mapping[str, Any], number: Callable[..., Any], **inputs: Any) -> dict[str, list[Any]]:
    """The outputs of a kernel. Literals of many digits may stand for a rational number that rounds to them."""
    v: list[Any] = []
    for op, *a in kernel["operations"]:
        match op:
            case "input":
                v.append(inputs[a[0]][a[1]])
            case "number":
                v.append(number(a[0], U * abs(a[0]) if len(repr(a[0])) > 15 else ZERO))
            case "neg":
                v.append(-v[a[0]])
            case "add" | "sub" | "mul" | "div":
                x, y = v[a[0]], v[a[1]]
                v.append(x + y if op == "add" else x - y if op == "sub" else x * y if op == "mul" else x / y)
            case _:
                v.append(v[a[0]].tape.function(op, v[a[0]]))
    return {name: [v[i] for i in indices] for name, indices in kernel["outputs"].items()}
