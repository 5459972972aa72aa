"""Check of the axioms of a large bi-realisation at points, in exact arithmetic.

A proof would expand too many terms. At a point, the derivatives of α and β are matrices of numbers. Products of these
matrices give the brackets of all pairs of components.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_mat

from phigen import progress
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation, covector_names
from phigen.spec import limits
from phigen.symbolic.expression import Expression, gradient, symbols_of, topological
from phigen.symbolic.numeric import DomainError, evaluate_exactly, is_rational
from phigen.symbolic.tower import rational
from phigen.symbolic.verdict import CHECKED, REFUTED, UNDECIDED, Statement, sample_point

#: Number of points at which the axioms are checked, and largest number of points that are tried. Points outside the
#: domain are skipped.
POINTS, ATTEMPTS = 3, 16

Point = Mapping[str, Fraction]


def is_large(system: System, realisation: BiRealisation) -> bool:
    """Whether the brackets of α and β are checked at points instead of being proved.

    This is so if all functions are rational and a proof would take too long.
    """
    maps = [*realisation.alpha, *realisation.beta]
    if not is_rational(*maps, *(e for row in system.poisson for e in row)):
        return False
    # The number of products of terms in all brackets is estimated roughly. Each node counts as a term.
    sizes = sum(len(topological([e])) for e in realisation.alpha)
    return 2 * sizes**2 // system.dimension > limits.PROOF_PRODUCTS


def brackets_at_points(system: System, realisation: BiRealisation, titles: Sequence[str]) -> Iterator[Statement]:
    """Yield the statements on the brackets {α_i, α_j}, {β_i, β_j} and {α_i, β_j}, checked at points.

    ``titles`` are the names of the statements.
    """
    maps = realisation.alpha, realisation.beta
    variables = [*system.coordinates, *covector_names(system.coordinates)]
    slopes: tuple[list[list[Expression]], ...] = ([], [])
    with progress.stage("derivatives of α and β", 2 * system.dimension) as running:
        for one_map, rows in zip(maps, slopes, strict=True):
            for e in one_map:
                rows.append(gradient(e, variables))
                running.done += 1
    names = symbols_of(*(e for one_map in maps for e in one_map), *(e for row in system.poisson for e in row))
    missing = [v for v in variables if v not in names]
    failures_at_points: list[list[str]] = []
    with progress.stage("brackets at points", POINTS) as running:
        for k in range(ATTEMPTS):
            point = sample_point([*names, *missing], system.positive, k)
            try:
                failures_at_points.append(_failures(system, maps, slopes, point))
            except DomainError:
                continue
            running.done += 1
            if len(failures_at_points) == POINTS:
                break
    for title, failures in zip(
        titles, zip(*failures_at_points, strict=True) if failures_at_points else [()] * len(titles), strict=True
    ):
        yield _statement(f"bi-realisation: {title}", failures)


def _statement(name: str, failures: Sequence[str]) -> Statement:
    if not failures:
        return Statement(name, UNDECIDED, f"no point of the domain among {ATTEMPTS} tried")
    if any(failures):
        return Statement(name, REFUTED, next(filter(None, failures)))
    return Statement(name, CHECKED, f"{len(failures)} points, exactly; too large to be multiplied out")


def _failures(
    system: System,
    maps: tuple[Sequence[Expression], Sequence[Expression]],
    slopes: tuple[list[list[Expression]], ...],
    point: Point,
) -> list[str]:
    """Return three texts, for {α_i, α_j}, {β_i, β_j} and {α_i, β_j}: each names a pair whose bracket is wrong at a
    point.

    A text is "" if the brackets of all pairs are right. ``slopes`` are the derivatives of α and β.
    """
    n, names = system.dimension, system.coordinates
    values = iter(evaluate_exactly([e for one_map in slopes for row in one_map for e in row], point))
    (a_x, a_p), (b_x, b_p) = (_halves([[next(values) for _ in range(2 * n)] for _ in names]) for _ in maps)
    at_alpha, at_beta = (_tensor(system, one_map, point) for one_map in maps)

    def wrong(bracket: Any, expected: Any) -> str:
        difference = bracket - expected
        pairs = ((i, j) for i in range(n) for j in range(n) if difference[i, j] != 0)
        i, j = next(pairs, (-1, -1))
        return "" if i < 0 else f"({names[i]}, {names[j]}), at a point: {float(rational(difference[i, j])):.4g}"

    return [
        wrong(a_x * a_p.transpose() - a_p * a_x.transpose(), at_alpha),
        wrong(b_x * b_p.transpose() - b_p * b_x.transpose(), -at_beta),
        wrong(a_x * b_p.transpose() - a_p * b_x.transpose(), fmpq_mat(n, n)),
    ]


def _halves(rows: list[list[Fraction]]) -> tuple[Any, Any]:
    """Return the matrices ∂f/∂x and ∂f/∂p, where f is α or β.

    Each row of ``rows`` belongs to one component of f: its derivatives with respect to x, then those with respect to p.
    """
    n = len(rows)
    return _matrix([row[:n] for row in rows]), _matrix([row[n:] for row in rows])


def _tensor(system: System, maps: Sequence[Expression], point: Point) -> Any:
    """Return the matrix π at the image of a point (x, p) under ``maps``, which are the components of α or of β."""
    image = dict(zip(system.coordinates, evaluate_exactly(maps, point), strict=True))
    values = iter(evaluate_exactly([e for row in system.poisson for e in row], {**point, **image}))
    return _matrix([[next(values) for _ in row] for row in system.poisson])


def _matrix(rows: list[list[Fraction]]) -> Any:
    return fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in rows])
