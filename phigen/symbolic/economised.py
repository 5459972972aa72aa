"""Chebyshev economisation of power series, in exact arithmetic: nearly the same accuracy with fewer terms."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction


def economised(
    coefficients: Sequence[Fraction], radius: Fraction, terms: int, *, symmetric: bool = False
) -> list[Fraction]:
    """Return the coefficients of a power series with ``terms`` terms that approximates Σ c_k z^k.

    The approximation holds for 0 ≤ z ≤ radius or, if ``symmetric``, for −radius ≤ z ≤ radius. The method is that of C.
    Lanczos, Applied Analysis, 1956. Each step subtracts the multiple of a Chebyshev polynomial that removes the highest
    power. No other way to remove this power changes the sum less.
    """
    scaled = [c * radius**k for k, c in enumerate(coefficients)]
    while len(scaled) > terms:
        chebyshev = _chebyshev(len(scaled) - 1, [0, 2] if symmetric else [-2, 4])
        multiple = scaled[-1] / chebyshev[-1]
        scaled = [c - multiple * t for c, t in zip(scaled, chebyshev, strict=True)][:-1]
    return [c / radius**k for k, c in enumerate(scaled)]


def _chebyshev(degree: int, twice: Sequence[int]) -> list[int]:
    """Return the coefficients of a Chebyshev polynomial T_n(y), written as a polynomial in u, where n is the
    ``degree``.

    The variables are related by 2y = ``twice[0]`` + ``twice[1]`` u.
    """
    previous, last = [1], [twice[0] // 2, twice[1] // 2]
    if degree == 0:
        return previous
    for _ in range(degree - 1):
        following = [0] * (len(last) + 1)
        for k, c in enumerate(last):
            following[k] += twice[0] * c
            following[k + 1] += twice[1] * c
        for k, c in enumerate(previous):
            following[k] -= c
        previous, last = last, following
    return last
