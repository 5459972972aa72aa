"""Second derivation, by sympy, of the maps α and β of Karasev's bi-realisation, to check the compiler.

For constant p, a path m(s) with 0 ≤ s ≤ 1 solves dm/ds = π(m)p. Let x be its mean, and m(s) = x + m_1(s) + m_2(s) + …
with m_k of degree k in p. Then

    dm_k/ds = part of degree k of Σ_ν π_ν(x)p (m_1 + … + m_{k−1})^ν,    π_ν = ∂^ν π(x)/ν!,
    ∫₀¹ m_k ds = 0.

The first solution is m_1 = (s − ½) πp. The maps are the ends of the path, α = m(0) and β = m(1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import sympy

from phigen.series.reference import Index, Series, Source, taylor
from phigen.series.reference_functions import Functions


def paths(poisson: Any, x: Sequence[Any], p: Sequence[Any], s: Any) -> Iterator[list[Any]]:
    """Yield, without end, the terms m_1(s), m_2(s), … of the path, each as n expressions in x, p and s.

    ``poisson`` is the matrix π(x).
    """
    path_terms: list[list[Any]] = []
    while True:
        path_terms.append(_part(poisson, path_terms, x, p, s))
        yield path_terms[-1]


def _part(poisson: Any, lower_terms: Sequence[Sequence[Any]], x: Sequence[Any], p: Sequence[Any], s: Any) -> list[Any]:
    """Return the term m_k of the path; ``lower_terms`` are m_1 … m_{k−1}."""
    degree, n = len(lower_terms), len(x)
    tensor = [[taylor(poisson[a, b], x, degree) for b in range(n)] for a in range(n)]
    operands = [c for row in tensor for entry in row for c in entry.values()]
    functions = Functions([*operands, *p, s, *(m for part in lower_terms for m in part)])
    deviation = Series(functions, lambda k, j: functions.element(lower_terms[j - 1][k]))
    return [_centred(functions, _velocity(functions, deviation, row, p, degree), s) for row in tensor]


def _velocity(functions: Functions, deviation: Series, row: Sequence[Any], p: Sequence[Any], degree: int) -> Any:
    """Return one component of the part of π(m)p that has the degree ``degree`` + 1 in p.

    This part is p times the part of π(m) that has the degree ``degree``. ``deviation`` is m − x. ``row`` is the
    row of π for this component; it has the Taylor coefficients of each entry.
    """
    return functions.total(
        deviation.combined(entry, degree) * functions.element(pb) for entry, pb in zip(row, p, strict=True)
    )


def _centred(functions: Functions, velocity: Any, s: Any) -> Any:
    """Return the antiderivative of ``velocity`` in s that has the mean 0 over 0 ≤ s ≤ 1."""
    time, rational = functions.element(s), sympy.QQ
    return functions.expression(
        functions.total(
            c * (time ** (e + 1) * rational(1, e + 1) - rational(1, (e + 1) * (e + 2)))
            for (e,), c in functions.split(velocity, [s]).items()
        )
    )


def source_of_paths(poisson: Any, x: Sequence[Any], p: Sequence[Any], time: int = 0) -> Source:
    """Return a `Source` for α, the start m(0) of the path (``time`` 0), or for β, its end m(1) (``time`` 1)."""
    s = sympy.Dummy("s")
    following = paths(poisson, x, p, s)
    parts: list[list[Any]] = []

    def source(degree: int) -> list[dict[Index, Any]]:
        while len(parts) < degree:
            parts.append([m.subs(s, time) for m in next(following)])
        functions = Functions([*p, *(m for part in parts for m in part)])
        end_point = [functions.total(functions.element(part[k]) for part in parts[:degree]) for k in range(len(x))]
        return [{mu: functions.expression(c) for mu, c in functions.split(e, p).items()} for e in end_point]

    return source
