"""Star algebras of quaternionic type: quaternions over a commutative algebra K, with the Lie algebra g as skew
elements.

A star algebra is an associative algebra with an involution *. Its skew elements a have a* = −a. Here the star algebra
is A = K ⊕ g. Its products are ab = β(a, b) + ½[a, b] for a, b in g, and K commutes with all elements. β is symmetric,
and its values are linear maps of g that commute with the bracket. A exists if there is a β with [[a, b], c] = 4(β(b,
c)a − β(a, c)b). K is the algebra of linear maps that the values of β and the identity generate. Examples of A are: the
quaternions for so(3), the 2×2 matrices for sl(2), the quaternions with complex coefficients for so(3,1), and the
quaternions with dual coefficients for se(3). Heisenberg algebras have β = 0, and so(4) gives two copies of so(3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import isqrt

from phigen.gauss.star_algebra import StarAlgebra, Vector, difference, in_basis
from phigen.geometry.field import Field, Scalar
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.linear import Span, add_multiple, kernel
from phigen.symbolic.tower import rational

#: Linear map from a Lie algebra to itself, as a sparse matrix: (row, column) → entry.
Map = dict[tuple[int, int], Scalar]

#: Largest dimension of a Lie algebra for which phigen looks for a map β as in the head of this file. The search solves
#: linear equations, whose number of unknowns grows as the third power of the dimension.
MOST_QUATERNIONIC = 12


def quaternionic(algebra: LieAlgebra) -> StarAlgebra | None:
    """Return the star algebra of quaternionic type that contains a Lie algebra.

    Returns None if there is none, or if the Lie algebra has more than `MOST_QUATERNIONIC` dimensions.
    """
    m, field = algebra.dimension, algebra.field
    if m > MOST_QUATERNIONIC:
        return None
    ad = [[{k: field.convert(v) for k, v in algebra.bracket(i, j).items()} for j in range(m)] for i in range(m)]
    maps = _centroid(ad, field)
    form = _form(ad, maps, field)
    if form is None:
        return None
    scalars = _generated(form, m, field)
    candidate = _assembled(ad, form, scalars, field)
    return _split(candidate, len(scalars)) if candidate.sound else None


def _centroid(ad: Sequence[Sequence[Vector]], field: Field) -> list[Map]:
    """Return a basis of the linear maps φ of a Lie algebra with φ[a, b] = [φa, b]; the first is the identity."""
    m = len(ad)
    rows: list[dict[int, Scalar]] = []
    for i in range(m):
        for j in range(m):
            equations: dict[int, dict[int, Scalar]] = {}
            for k, v in ad[i][j].items():
                for row in range(m):
                    add_multiple(equations.setdefault(row, {}), {row * m + k: v}, field.one)
            for k in range(m):  # the components of [φ e_i, e_j] = Σ_k φ_ki [e_k, e_j]
                for row, v in ad[k][j].items():
                    add_multiple(equations.setdefault(row, {}), {k * m + i: v}, -field.one)
            rows += [e for e in equations.values() if e]
    maps = [{divmod(index, m): v for index, v in vector.items()} for vector in kernel(field, rows, m * m)]
    identity = {(i, i): field.one for i in range(m)}
    independent = Span(field, [identity, *maps])
    return [v for k, v in enumerate([identity, *maps]) if k not in independent.dependent]


def _form(ad: Sequence[Sequence[Vector]], maps: Sequence[Map], field: Field) -> dict[tuple[int, int], Map] | None:
    """Return the symmetric form β with [[a, b], c] = 4(β(b, c)a − β(a, c)b), whose values are combinations of
    ``maps``.

    The result maps each pair (i, j) to the linear map β(e_i, e_j), with basis elements e_i. Returns None if β does not
    exist.
    """
    m, count = len(ad), len(maps)
    pair_numbers = {(i, j): k for k, (i, j) in enumerate((i, j) for i in range(m) for j in range(i + 1))}
    four, last = field.number(4), len(pair_numbers) * count

    def unknowns(i: int, j: int, component: int, sign: Scalar) -> Iterator[tuple[int, dict[int, Scalar]]]:
        """Yield the terms of the vector sign·4·β(e_i, e_j)e_c, where β(e_i, e_j) is an unknown linear map and c is
        ``component``.

        Each term is a pair: a row of the vector, and a linear form in the unknowns. The unknowns are the coefficients
        of each β(e_i, e_j) in the basis ``maps``.
        """
        pair_number = pair_numbers[max(i, j), min(i, j)]
        for number, phi in enumerate(maps):
            for (row, column), v in phi.items():
                if column == component:
                    yield row, {pair_number * count + number: four * v * sign}

    rows: list[dict[int, Scalar]] = []
    for a in range(m):
        for b in range(a):
            for c in range(m):
                equations: dict[int, dict[int, Scalar]] = {}
                for row, term in (*unknowns(b, c, a, field.one), *unknowns(a, c, b, -field.one)):
                    add_multiple(equations.setdefault(row, {}), term, field.one)
                for k, v in ad[a][b].items():
                    for row, w in ad[k][c].items():
                        add_multiple(equations.setdefault(row, {}), {last: v * w}, -field.one)
                rows += [e for e in equations.values() if e]
    solution = next((v for v in kernel(field, rows, last + 1) if last in v), None)
    if solution is None:
        return None
    form: dict[tuple[int, int], Map] = {}
    for (i, j), pair_number in pair_numbers.items():
        value: Map = {}
        for number, phi in enumerate(maps):
            if pair_number * count + number in solution:
                add_multiple(value, phi, solution[pair_number * count + number])
        form[i, j] = form[j, i] = value
    return form


def _generated(form: Mapping[tuple[int, int], Map], m: int, field: Field) -> list[Map]:
    """Return a basis of the algebra that is generated by the identity and the values of the form β, which are linear
    maps.

    The identity is the first element of the basis.
    """
    basis: list[Map] = [{(i, i): field.one for i in range(m)}]
    pending = [value for value in form.values() if value]
    while pending:
        value = _normalised(pending.pop())
        if Span(field, [*basis, value]).dimension == len(basis):
            continue
        basis.append(value)
        pending += [product for a in basis for b in basis if (product := _composed(a, b))]
    return basis


def _normalised(a: Map) -> Map:
    """Return a linear map divided by its first nonzero entry, which becomes 1. Products with the result need fewer
    multiplications.
    """
    first = a[min(a)]
    return {position: v / first for position, v in a.items()}


def _composed(a: Mapping[tuple[int, int], Scalar], b: Mapping[tuple[int, int], Scalar]) -> Map:
    product: Map = {}
    for (i, k), v in a.items():
        add_multiple(product, {(i, j): w for (row, j), w in b.items() if row == k}, v)
    return product


def _assembled(
    ad: Sequence[Sequence[Vector]], form: Mapping[tuple[int, int], Map], scalars: Sequence[Map], field: Field
) -> StarAlgebra:
    """Return the star algebra K ⊕ g of a Lie algebra g, where K is the commutative algebra with the basis
    ``scalars``.

    The basis of the star algebra has the elements of K, then 2e for each basis element e of g. The products are 2a·2b =
    4β(a, b) + 2[a, b] with the ``form`` β. The caller checks the axioms.
    """
    m, count, unit = len(ad), len(scalars), field.one
    span, twice_unit, one_half = Span(field, scalars), field.number(2), unit / field.number(2)
    table: dict[tuple[int, int], Vector] = {}
    for k, phi in enumerate(scalars):
        for n, psi in enumerate(scalars):
            table[k, n] = span.coordinates(_composed(phi, psi)) or {}
        for j in range(m):
            image = {count + row: v for (row, column), v in sorted(phi.items()) if column == j}
            table[k, count + j] = table[count + j, k] = image
    for i in range(m):
        for j in range(m):
            value = span.coordinates(form[i, j]) or {}
            scalar = {k: v * twice_unit * twice_unit for k, v in value.items()}
            table[count + i, count + j] = scalar | {count + k: v for k, v in ad[i][j].items()}
    basis = [{count + j: one_half} for j in range(m)]
    star = [{k: unit if k < count else -unit} for k in range(count + m)]
    functional: list[Vector] = [{}] * count + [{j: twice_unit} for j in range(m)]
    table = {position: v for position, v in table.items() if v}
    coordinate_vectors = [{j: unit} for j in range(m)]
    return StarAlgebra(field, count + m, table, star, {0: unit}, basis, functional, basis, coordinate_vectors)


def _split(algebra: StarAlgebra, count: int) -> StarAlgebra:
    """Return a star algebra K ⊕ g as the direct sum of two algebras, by a rational idempotent of K, the commutative
    part.

    ``count`` is the dimension of K. If it is not 2, or if there is no rational idempotent, the algebra is returned
    unchanged.
    """
    field, unit = algebra.field, algebra.field.one
    idempotent = _idempotent(algebra) if count == 2 else None
    if idempotent is None:
        return algebra
    parts: list[Vector] = []
    for factor in (idempotent, difference(algebra.unit, idempotent, unit)):
        images = [algebra.product(factor, {i: unit}) for i in range(algebra.dimension)]
        dependent = Span(field, images).dependent
        parts += [image for i, image in enumerate(images) if i not in dependent]
    sum_of_two = in_basis(algebra, parts)
    frame = [{i: unit} for i, image in enumerate(sum_of_two.star) if image == {i: -unit}]
    span = Span(field, frame)
    return replace(sum_of_two, frame=frame, combination=[span.coordinates(e) or {} for e in sum_of_two.basis])


def _idempotent(algebra: StarAlgebra) -> Vector | None:
    """Return an idempotent, other than 0 and 1, in the commutative part span(1, k) of a star algebra.

    If k² = p + qk and r² = p + q²/4, the idempotent is (1 + (k − q/2)/r)/2. Returns None if r is not rational.
    """
    field = algebra.field
    if not field.is_rational:
        return None
    square = algebra.table.get((1, 1), {})
    p, q = (rational(square.get(i, field.zero)) for i in (0, 1))
    discriminant = p + q * q / 4
    if discriminant <= 0:
        return None
    r = Fraction(isqrt(discriminant.numerator), isqrt(discriminant.denominator))
    if r * r != discriminant:
        return None
    return {0: field.number(Fraction(1, 2) - q / (4 * r)), 1: field.number(1 / (2 * r))}
