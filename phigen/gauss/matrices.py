"""Star algebras of matrix Lie algebras.

Let the matrices ρ represent a Lie algebra. If there is an invertible bilinear form B with ρᵀB + Bρ = 0, then the
associative algebra that the ρ and 1 generate has the involution a ↦ B⁻¹aᵀB. If there is no form of this kind, ρ ⊕ −ρᵀ
takes the place of ρ. For this representation there is a form, which pairs the two summands. So the number of unknowns
is at most n² for so(n) and so(p, q) with p + q = n, 4n² for sp(2n), and 2n² for su(n), sl(n) and gl(n).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phigen.gauss.star_algebra import StarAlgebra, Vector, combined
from phigen.geometry.field import Field, Scalar
from phigen.geometry.lie_algebra import LieAlgebra, SparseMatrix
from phigen.geometry.linear import Span, add_multiple, kernel
from phigen.geometry.matrix_algebras import product
from phigen.geometry.representations import known_representation

#: Largest dimension of a star algebra. The vector field at one stage takes about dimension^(3/2) operations.
MOST_UNKNOWNS = 36


def of_matrices(lie: LieAlgebra) -> StarAlgebra | None:
    """Return the star algebra of a Lie algebra with known matrices of rational entries; None for other Lie algebras."""
    representation, field = known_representation(lie), lie.field
    if not field.is_rational:
        return None
    try:
        matrices = (
            [{position: field.convert(e) for position, e in m.items()} for m in representation.matrices]
            if representation
            else _affine(lie)
        )
    except KeyError:  # entries contain parameters
        return None
    if not matrices:
        return None
    n = representation.size if representation else 1 + max(j for m in matrices for _, j in m)
    form = _form(matrices, n, field)
    if form is None:
        matrices = [_doubled(m, n, field) for m in matrices]
        form = {(i, (i + n) % (2 * n)): field.one for i in range(2 * n)}
        n = 2 * n
    hull = _hull([_unit(n, field), *matrices], n, field)
    return _assembled(hull, matrices, form, n, field) if hull else None


def _affine(lie: LieAlgebra) -> list[SparseMatrix]:
    """Return matrices that represent the Lie algebra by affine maps of an abelian ideal; [] if there is no such ideal.

    The ideal is the radical of the Killing form. Let P be a projection of the Lie algebra onto the ideal. Then an
    element X is represented by the matrix of ad X on the ideal, with the additional column P(X).
    """
    m, field = lie.dimension, lie.field
    ad = [{(k, j): field.convert(c) for j in range(m) for k, c in lie.bracket(i, j).items()} for i in range(m)]
    ideal = kernel(field, [{j: v for j, b in enumerate(ad) if (v := _trace(a, b, field)) != 0} for a in ad], m)
    span, size = Span(field, ideal), len(ideal)
    if not ideal or size == m:
        return []
    action: list[SparseMatrix] = []
    for a in ad:
        images = [_applied(a, t) for t in ideal]
        columns = [span.coordinates(image) for image in images]
        if any(column is None for column in columns):
            return []
        action.append({(k, q): v for q, column in enumerate(columns) for k, v in (column or {}).items()})
    projection = _projection(lie, ideal, action)
    if projection is None or size < 2:
        return []
    return [
        {**linear, **{(k, size): v for k in range(size) if (v := projection.get(k * m + i, field.zero)) != 0}}
        for i, linear in enumerate(action)
    ]


def _projection(lie: LieAlgebra, ideal: Sequence[Vector], action: Sequence[SparseMatrix]) -> Vector | None:
    """Return a linear projection P of the Lie algebra onto an ideal such that P([X, Y]) = X P(Y) − Y P(X) for all X, Y.

    Entry k·m + i of the returned vector is the entry of the matrix P in row k and column i, where m is the dimension of
    the Lie algebra. Returns None if there is no P with this property.
    """
    m, size, field = lie.dimension, len(ideal), lie.field
    last = size * m
    rows: list[Vector] = []
    for q, t in enumerate(ideal):
        for k in range(size):
            row = {k * m + i: v for i, v in t.items()}
            rows.append({**row, last: -field.one} if k == q else row)
    for i in range(m):
        for j in range(i):
            for k in range(size):
                row = {k * m + n: field.convert(c) for n, c in lie.bracket(i, j).items()}
                for (position, q), v in action[i].items():
                    if position == k:
                        add_multiple(row, {q * m + j: v}, -field.one)
                for (position, q), v in action[j].items():
                    if position == k:
                        add_multiple(row, {q * m + i: v}, field.one)
                rows.append(row)
    return next((v for v in kernel(field, [r for r in rows if r], last + 1) if last in v), None)


def _applied(a: SparseMatrix, vector: Mapping[int, Scalar]) -> Vector:
    image: Vector = {}
    for (i, j), v in a.items():
        if j in vector:
            add_multiple(image, {i: v}, vector[j])
    return image


def _unit(n: int, field: Field) -> SparseMatrix:
    return {(i, i): field.one for i in range(n)}


def _transposed(a: SparseMatrix) -> SparseMatrix:
    return {(j, i): v for (i, j), v in a.items()}


def _doubled(a: SparseMatrix, n: int, field: Field) -> SparseMatrix:
    """Return the block matrix a ⊕ −aᵀ for a matrix a with n rows."""
    return {**a, **{(n + j, n + i): -v for (i, j), v in a.items()}}


def _form(matrices: Sequence[SparseMatrix], n: int, field: Field) -> SparseMatrix | None:
    """Return an invertible form B, symmetric or skew, with mᵀB + Bm = 0 for all matrices m.

    For each form in a basis of the solutions, the symmetric part and the skew part are tried. Returns None if none of
    these parts is invertible.
    """
    rows: list[dict[int, Scalar]] = []
    for m in matrices:
        equations: dict[tuple[int, int], dict[int, Scalar]] = {}
        for (k, i), v in m.items():
            for j in range(n):
                add_multiple(equations.setdefault((i, j), {}), {k * n + j: v}, field.one)
                add_multiple(equations.setdefault((j, i), {}), {j * n + k: v}, field.one)
        rows += [e for e in equations.values() if e]
    for vector in kernel(field, rows, n * n):
        entries = {divmod(index, n): v for index, v in vector.items()}
        for sign in (field.one, -field.one):
            form = dict(entries)
            add_multiple(form, _transposed(entries), sign)
            if _inverse(form, n, field) is not None:
                return form
    return None


def _inverse(a: SparseMatrix, n: int, field: Field) -> SparseMatrix | None:
    columns = [{i: v for (i, j), v in a.items() if j == k} for k in range(n)]
    span = Span(field, columns)
    if span.dimension < n:
        return None
    inverse: SparseMatrix = {}
    for j in range(n):
        for i, v in (span.coordinates({j: field.one}) or {}).items():
            inverse[i, j] = v
    return inverse


def _hull(generators: Sequence[SparseMatrix], n: int, field: Field) -> list[SparseMatrix]:
    """Return a sparse basis of the associative algebra that is generated by ``generators``, matrices with ``n`` rows.

    Returns [] if the algebra has more than MOST_UNKNOWNS dimensions.
    """
    basis: list[SparseMatrix] = []
    pending = list(generators)
    while pending:
        candidate = pending.pop(0)
        if Span(field, [*basis, candidate]).dimension == len(basis):
            continue
        basis.append(candidate)
        if len(basis) > MOST_UNKNOWNS:
            return []
        pending += [product(candidate, g) for g in generators[1:]]
    vectors = [{i * n + j: v for (i, j), v in m.items()} for m in basis]
    reduced = kernel(field, kernel(field, vectors, n * n), n * n)
    return [{divmod(index, n): v for index, v in vector.items()} for vector in reduced]


def _assembled(
    hull: Sequence[SparseMatrix], matrices: Sequence[SparseMatrix], form: SparseMatrix, n: int, field: Field
) -> StarAlgebra | None:
    span = Span(field, hull)
    inverse = _inverse(form, n, field) or {}

    def coordinates(a: Mapping[tuple[int, int], Scalar]) -> Vector:
        return span.coordinates(a) or {}

    table = {(i, j): coordinates(p) for i, a in enumerate(hull) for j, b in enumerate(hull) if (p := product(a, b))}
    star = [coordinates(product(inverse, product(_transposed(a), form))) for a in hull]
    basis = [coordinates(m) for m in matrices]
    functional = _functional(hull, star, matrices, basis, field)
    if functional is None:
        return None
    coordinate_vectors = [{a: field.one} for a in range(len(basis))]
    unit = coordinates(_unit(n, field))
    algebra = StarAlgebra(field, len(hull), table, star, unit, basis, functional, basis, coordinate_vectors)
    return algebra if algebra.sound else None


def _functional(
    hull: Sequence[SparseMatrix],
    star: Sequence[Vector],
    matrices: Sequence[SparseMatrix],
    basis: Sequence[Vector],
    field: Field,
) -> list[Vector] | None:
    """Return the values of the functional x̃ at the basis elements ``hull`` of a matrix algebra, as linear forms in a
    point x.

    x̃(E_a) = x_a for the matrices E_a of the Lie algebra. x̃ vanishes on symmetric elements, and on those skew elements
    that are orthogonal to the Lie algebra by the trace form tr ab. Returns None if there is no such functional.
    """
    half = field.one / field.number(2)
    skew: list[Vector] = []
    for i in range(len(hull)):
        part: Vector = {i: half}
        add_multiple(part, star[i], -half)
        skew.append(part)
    traces = [{i: t for i, a in enumerate(hull) if (t := _trace(a, m, field)) != 0} for m in matrices]
    symmetric: list[Vector] = []
    for i in range(len(hull)):
        part = {i: half}
        add_multiple(part, star[i], half)
        symmetric.append(part)
    # The linear equations below say that an element of the algebra is skew and orthogonal to the Lie algebra.
    rows = [{i: v[k] for i, v in enumerate(symmetric) if k in v} for k in range(len(hull))]
    solutions = kernel(field, [*traces, *(r for r in rows if r)], len(hull))
    if Span(field, skew).dimension == len(basis):  # all skew elements are in the Lie algebra, as for se(n)
        solutions = []
    span = Span(field, [*basis, *solutions])
    if span.dimension < len(basis) + len(solutions):
        return None
    values = []
    for part in skew:
        value = span.coordinates(combined([part], {0: field.one}))
        if value is None:
            return None
        values.append({a: v for a, v in value.items() if a < len(basis)})
    return values


def _trace(a: SparseMatrix, b: SparseMatrix, field: Field) -> Scalar:
    result = field.zero
    for (i, j), v in a.items():
        if (j, i) in b:
            result = result + v * b[j, i]
    return result
