"""Shapes of Poisson tensors, such as constant or Lie–Poisson. The form in which a spec states π does not
matter.

Coefficients may contain parameters, and functions of parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phigen.geometry.identities import polynomial_by_identity
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.symbolic.expression import ZERO, Expression, symbols_of
from phigen.symbolic.tower import Poly, Tower

Matrix = tuple[tuple[Expression, ...], ...]
#: Polynomial in the coordinates: exponents → coefficient, which is an expression in the parameters.
Terms = dict[tuple[int, ...], Expression]


@dataclass(frozen=True)
class Constant:
    """Shape of a π that does not depend on the coordinates."""

    matrix: Matrix

    def __str__(self) -> str:
        return "constant"


@dataclass(frozen=True)
class Canonical:
    """Shape of a constant π with {q_i, p_i} = 1, whose other brackets are 0. The coordinates in ``rest`` are
    Casimirs.
    """

    q: tuple[str, ...]
    p: tuple[str, ...]
    rest: tuple[str, ...]
    matrix: Matrix

    def __str__(self) -> str:
        pairs = ", ".join(f"({q}, {p})" for q, p in zip(self.q, self.p, strict=True))
        return f"canonical in {pairs}" + (f" with the Casimirs {', '.join(self.rest)}" if self.rest else "")


@dataclass(frozen=True)
class LogCanonical:
    """Shape {x_i, x_j} = a_ij x_i x_j with constants a_ij, the matrix ``a``."""

    a: Matrix

    def __str__(self) -> str:
        return "log-canonical"


@dataclass(frozen=True)
class LiePoisson:
    """Shape {x_i, x_j} = Σ_k c_ij^k x_k, on the dual of a Lie algebra. The Jacobi identity is not checked here."""

    algebra: LieAlgebra

    def __str__(self) -> str:
        return f"Lie–Poisson, {self.algebra.name}"


@dataclass(frozen=True)
class Affine:
    """Shape {x_i, x_j} = Σ_k c_ij^k x_k + b_ij, from a Lie algebra with a cocycle b.

    ``extension`` is the central extension by b. Its last basis element z is the additional one: [E_i, E_j] = Σ_k c_ij^k
    E_k + b_ij z. π is the Lie–Poisson tensor of the extension at z = 1. The Jacobi identity is not checked here.
    """

    extension: LieAlgebra

    def __str__(self) -> str:
        return f"affine, {self.extension.name}"


@dataclass(frozen=True)
class General:
    """Shape of a π that has none of the other shapes."""

    def __str__(self) -> str:
        return "general"


Shape = Constant | Canonical | LogCanonical | LiePoisson | Affine | General


def recognise(coordinates: Sequence[str], poisson: Matrix) -> Shape:
    """Return the first shape in this list that π has: constant or canonical, log-canonical, Lie–Poisson, affine,
    general.
    """
    upper = {(i, j): poisson[i][j] for j in range(len(coordinates)) for i in range(j)}
    terms = coordinate_terms(coordinates, list(upper.values()))
    if terms is None:
        return General()
    entries = dict(zip(upper, terms, strict=True))
    return (
        _constant(coordinates, entries, poisson)
        or _log_canonical(len(coordinates), entries)
        or _lie_poisson(coordinates, entries)
        or _affine(coordinates, entries)
        or General()
    )


def coordinate_terms(coordinates: Sequence[str], expressions: Sequence[Expression]) -> list[Terms] | None:
    """Return the expressions as polynomials in the coordinates; None if one of them is not a polynomial.

    Polynomials that are written as other functions, such as x·(sin² + cos²), are recognised.
    """
    names = list(coordinates) + [s for s in symbols_of(*expressions) if s not in coordinates]
    tower = Tower(names, expressions)
    terms_of_coordinates = []
    for e, element in zip(expressions, tower.convert_all(expressions), strict=True):
        terms = _split(tower, element, coordinates)
        if terms is None:
            same = polynomial_by_identity(e, coordinates)
            if same is None:
                return None
            (terms,) = coordinate_terms(coordinates, [same]) or [{}]
        terms_of_coordinates.append(terms)
    return terms_of_coordinates


def _split(tower: Tower, element: Poly, coordinates: Sequence[str]) -> Terms | None:
    if element == 0:  # a shortcut, since most entries of large structures are 0
        return {}
    size = len(coordinates)
    degrees = element.degrees()
    for position, g in enumerate(tower.generators, len(tower.symbols)):
        if degrees[position] and tower.depends_on(tower.variable(g.name), coordinates):
            return None
    groups: dict[tuple[int, ...], dict[tuple[int, ...], object]] = {}
    for monomial, c in element.to_dict().items():
        exponents = tuple(int(e) for e in monomial[:size])
        groups.setdefault(exponents, {})[(0,) * size + tuple(monomial[size:])] = c
    parts = {e: tower.context.from_dict(part) for e, part in groups.items()}
    return {e: tower.expression(part) for e, part in sorted(parts.items()) if not tower.is_zero(part)}


def _constant(coordinates: Sequence[str], entries: dict[tuple[int, int], Terms], poisson: Matrix) -> Shape | None:
    origin = (0,) * len(coordinates)
    if any(set(terms) - {origin} for terms in entries.values()):
        return None
    values = {ij: terms[origin] for ij, terms in entries.items() if terms}
    partners = [index for ij in sorted(values) for index in ij]
    units = all(v.is_number and abs(v.value) == 1 for v in values.values())
    matrix = skew(values, len(coordinates))
    if not values or not units or len(set(partners)) < len(partners):
        return Constant(matrix)
    pairs = sorted(ij if values[ij].value == 1 else (ij[1], ij[0]) for ij in values)
    unpaired = tuple(c for i, c in enumerate(coordinates) if i not in partners)
    q = tuple(coordinates[i] for i, _ in pairs)
    return Canonical(q, tuple(coordinates[j] for _, j in pairs), unpaired, matrix)


def _log_canonical(n: int, entries: dict[tuple[int, int], Terms]) -> Shape | None:
    a: dict[tuple[int, int], Expression] = {}
    for (i, j), terms in entries.items():
        monomial = tuple(1 if k in (i, j) else 0 for k in range(n))
        if set(terms) - {monomial}:
            return None
        if terms:
            a[i, j] = terms[monomial]
    return LogCanonical(skew(a, n))


def _lie_poisson(coordinates: Sequence[str], entries: dict[tuple[int, int], Terms]) -> Shape | None:
    constants: dict[tuple[int, int], dict[int, Expression]] = {}
    for ij, terms in sorted(entries.items()):
        if any(sum(exponents) != 1 for exponents in terms):
            return None
        if terms:
            constants[ij] = {exponents.index(1): c for exponents, c in sorted(terms.items(), reverse=True)}
    n = len(coordinates)
    name = f"a Lie algebra of dimension {n}"
    return LiePoisson(LieAlgebra(name, n, constants, None, tuple(coordinates)))


def _affine(coordinates: Sequence[str], entries: dict[tuple[int, int], Terms]) -> Shape | None:
    constants: dict[tuple[int, int], dict[int, Expression]] = {}
    n = len(coordinates)
    for ij, terms in sorted(entries.items()):
        if any(sum(exponents) > 1 for exponents in terms):
            return None
        row = {(*exponents, 1 - sum(exponents)).index(1): c for exponents, c in terms.items()}
        if row:
            constants[ij] = dict(sorted(row.items()))
    name = f"a Lie algebra of dimension {n} with a cocycle"
    return Affine(LieAlgebra(name, n + 1, constants, None, (*coordinates, "1")))


def skew(upper: dict[tuple[int, int], Expression], n: int) -> Matrix:
    """Return the skew n×n matrix with the entries ``upper`` above the diagonal: (row, column) → entry.

    All other entries above the diagonal are 0.
    """

    def entry(i: int, j: int) -> Expression:
        return upper.get((i, j), ZERO) if i < j else -upper.get((j, i), ZERO)

    return tuple(tuple(entry(i, j) for j in range(n)) for i in range(n))
