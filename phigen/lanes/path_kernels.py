"""Kernels of steps along Karasev's paths in SIMD lanes, with one path in each lane.

A path is a solution of ṁ = π(m)p; docs/mathematics.md explains Karasev's construction. Paths are computed by Taylor
series. This module also counts the values on the stack that the series need.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.path import NodeSeries, PathSlopes
from phigen.scheme.steps import Path, PathAdjoint, PathLanes
from phigen.symbolic.expression import Expression, substitute, symbol
from phigen.symbolic.symbols import FIXED, SERIES, Symbol, momentum

#: Largest number of Taylor terms of a path about its middle. The runtime has the same constant, with the same value.
MAX_TERMS = 16

#: Numbers of Taylor terms to try for the derivatives of paths; SLOPE_TERMS_BACK is for solvers with a reverse pass. The
#: first number whose series fit on the stack is used.
SLOPE_TERMS = (12, 8)
SLOPE_TERMS_BACK = (MAX_TERMS, 12, 8)


def stack(step: Path, slopes: PathSlopes, dimension: int, slope_terms: int) -> tuple[int, int]:
    """Return how many additional values paths need on the stack in each lane, as two numbers.

    The first number is for each stage. The second number is for one Taylor expansion, whose derivatives have
    ``slope_terms`` terms.
    """
    n, path, used = (
        dimension,
        step.recurrences,
        len(step.back.used) if step.back else 0,
    )
    series = len(path.series) * (MAX_TERMS + 3) + len(slopes.series) * (slope_terms + 2)
    fixed = len(path.fixed) + len(slopes.fixed)
    return n + 2 * n * n, series + fixed + n * (2 * n + used) * (slope_terms + 4) + 2 * n * n + 8 * n


def kernels(step: Path, lanes: PathLanes, coordinates: Sequence[str]) -> list[Kernel]:
    """Return the kernels of blocks. In a block, several steps along Karasev's paths are solved together, one in each
    SIMD lane.
    """
    momentum = Kernel("momentum", "the momenta p = grad S_h(y)", lanes.curvature.inputs, lanes.curvature.outputs[:1])
    curvature, *further = traced(step, lanes.slopes, lanes.curvature, coordinates)
    return [curvature, momentum, *further, lanes.along_mean, lanes.invert]


def back(path: PathAdjoint) -> list[Kernel]:
    """Return the additional kernels for the reverse pass through steps along Karasev's paths."""
    return [path.slope]


def traced(step: Path, slopes: PathSlopes, curvature: Kernel, coordinates: Sequence[str]) -> list[Kernel]:
    """Return the kernels that start the Taylor series of a path and of its derivatives.

    One kernel computes p = ∇S_h and the Hessian of S_h. The other kernels compute the coefficients of order 0 of all
    series.
    """
    path = step.recurrences
    coef, covector = curvature.inputs["coef"], tuple(momentum(c) for c in coordinates)
    values = _resolved(path.series, path.fixed, {})
    base = [*_symbols(SERIES, path.series), *_symbols(FIXED, path.fixed)]
    further = _resolved(slopes.series, slopes.fixed, {s: symbol(s) for s in base}, len(path.series), len(path.fixed))
    return [
        curvature,
        Kernel(
            "values",
            "the values of all series at one point",
            {"coef": coef, "p": covector, "m": tuple(coordinates)},
            (Output("value", values[0]), Output("fixed", values[1])),
        ),
        Kernel(
            "slope_values",
            "the values of the series that derivatives need",
            {
                "coef": coef,
                "p": covector,
                "value": _symbols(SERIES, path.series),
                "fixed": _symbols(FIXED, path.fixed),
            },
            (Output("slope", further[0]), Output("slope_fixed", further[1])),
        ),
    ]


def _symbols(kind: str, values: Sequence[object]) -> tuple[Symbol, ...]:
    """Return one symbol of this ``kind`` for each of ``values``. The symbols are numbered from 0."""
    return tuple(Symbol(kind, i) for i in range(len(values)))


def _resolved(
    series: Sequence[NodeSeries],
    fixed: Sequence[Expression],
    known: Mapping[str, Expression],
    first: int = 0,
    first_fixed: int = 0,
) -> tuple[tuple[Expression, ...], tuple[Expression, ...]]:
    """Return two tuples of expressions: the coefficients of order 0 of ``series``, and the values ``fixed``, which are
    constant along a path.

    The coefficients contain no symbols of constant values, of earlier series, or of ``known``: these symbols are
    replaced by their expressions. ``first`` is the number of the first series, and ``first_fixed`` the number of the
    first constant value.
    """
    values_by_symbol = dict(known) | {Symbol(FIXED, first_fixed + i): e for i, e in enumerate(fixed)}
    values = []
    for i, q in enumerate(series):
        (value,) = substitute([q.first], values_by_symbol)
        values_by_symbol[Symbol(SERIES, first + i)] = value
        values.append(value)
    return tuple(values), tuple(fixed)
