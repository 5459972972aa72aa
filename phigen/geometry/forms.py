"""The matrix π_ij = {x_i, x_j} of a Poisson structure, for each form in which specs can state the structure."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.errors import Diagnostic, SpecError
from phigen.geometry import families, matrix_algebras
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.pullback import pulled_back
from phigen.geometry.shapes import LiePoisson, Matrix, Shape, recognise, skew
from phigen.spec.model import (
    CanonicalForm,
    LieAlgebraForm,
    LogCanonicalForm,
    MatrixForm,
    NambuForm,
    PoissonForm,
    ProductForm,
    PullbackForm,
)
from phigen.symbolic.expression import ONE, ZERO, Expression, gradient, symbol, symbols_of, total


def structure(form: PoissonForm, coordinates: Sequence[str]) -> tuple[Matrix, Shape]:
    """Return the matrix π that a form of a spec describes, and its shape, such as constant or Lie–Poisson.

    Raises the errors of `algebra_of_form` and `poisson_matrix`.
    """
    algebra = algebra_of_form(form, coordinates)
    matrix = poisson_matrix(form, coordinates, algebra)
    return matrix, LiePoisson(algebra) if algebra and algebra.constants else recognise(coordinates, matrix)


def poisson_matrix(form: PoissonForm, coordinates: Sequence[str], algebra: LieAlgebra | None = None) -> Matrix:
    """Return the n×n matrix π that a form of a spec describes.

    ``algebra`` is the result of `algebra_of_form`, if the caller has it. Raises `SpecError` if the size of a matrix
    does not match the number of coordinates.
    """
    n = len(coordinates)
    match form:
        case MatrixForm(entries):
            _expect_square(entries, n, "poisson matrix")
            return entries
        case CanonicalForm(q, p):
            return _canonical(coordinates, q, p)
        case LogCanonicalForm(a):
            _expect_square(a, n, "log_canonical matrix")
            x = [symbol(c) for c in coordinates]
            return tuple(tuple(a[i][j] * (x[i] * x[j]) for j in range(n)) for i in range(n))
        case NambuForm(casimirs):
            return _nambu(coordinates, casimirs)
        case ProductForm(blocks):
            return _product(coordinates, blocks)
        case PullbackForm():
            return pulled_back(form, poisson_matrix(form.of, form.coordinates), coordinates)
        case LieAlgebraForm():
            algebra = algebra or algebra_of_form(form, coordinates)
            assert algebra is not None
            return algebra.poisson(coordinates)


def algebra_of_form(form: PoissonForm, coordinates: Sequence[str]) -> LieAlgebra | None:
    """Return the Lie algebra of a form ``lie_algebra``; None for other forms. With ``sign: minus`` its bracket is
    negated.

    Raises `SpecError` for an unknown family, for a dimension other than the number of coordinates, and for matrices or
    structure constants that do not define a Lie algebra.
    """
    if not isinstance(form, LieAlgebraForm):
        return None
    if form.family:
        # The dimension is checked before the matrices are built. For a typing error such as so(1000), building the
        # matrices would take minutes.
        _expect_dimension(f"{form.family}({form.size})", families.dimension(form.family, form.size), len(coordinates))
        algebra = families.named(form.family, form.size)
    elif form.matrices:
        algebra = matrix_algebras.from_matrices(form.matrices)
    else:
        algebra = matrix_algebras.from_structure_constants(len(coordinates), form.structure_constants)
    _expect_dimension(algebra.name, algebra.dimension, len(coordinates))
    return algebra.opposite() if form.sign < 0 else algebra


def _canonical(coordinates: Sequence[str], q: Sequence[str], p: Sequence[str]) -> Matrix:
    if len(q) != len(p):
        raise SpecError([Diagnostic(f"canonical: {len(q)} positions but {len(p)} momenta")])
    index = {c: i for i, c in enumerate(coordinates)}
    upper: dict[tuple[int, int], Expression] = {}
    for position, momentum in zip(q, p, strict=True):
        i, j = index[position], index[momentum]
        upper[min(i, j), max(i, j)] = ONE if i < j else -ONE
    return skew(upper, len(coordinates))


def _product(coordinates: Sequence[str], blocks: Sequence[tuple[tuple[str, ...], PoissonForm]]) -> Matrix:
    """Return the block-diagonal π of several forms, each for some of the coordinates.

    Raises `SpecError` if a block depends on coordinates of another block.
    """
    index = {c: i for i, c in enumerate(coordinates)}
    n = range(len(coordinates))
    entries = [[ZERO for _ in n] for _ in n]
    for names, form in blocks:
        matrix = poisson_matrix(form, names)
        foreign = [s for s in symbols_of(*(e for row in matrix for e in row)) if s in index and s not in names]
        if foreign:
            message = f"product: the block ({', '.join(names)}) depends on {foreign[0]}, a coordinate of another block"
            raise SpecError([Diagnostic(message)])
        for a, row in zip(names, matrix, strict=True):
            for b, entry in zip(names, row, strict=True):
                entries[index[a]][index[b]] = entry
    return tuple(map(tuple, entries))


def _nambu(coordinates: Sequence[str], casimirs: Sequence[Expression]) -> Matrix:
    """Return π_ij = det ∂(x_i, x_j, C_1, …, C_{n−2})/∂(x_1, …, x_n), the matrix of a Nambu bracket.

    The bracket is {f, g} = det ∂(f, g, C_1, …, C_{n−2})/∂(x_1, …, x_n). For n = 3, {x_1, x_2} = ∂C/∂x_3 and cyclic, so
    that ẋ = ∇H × ∇C. Raises `SpecError` unless there are n − 2 Casimirs.
    """
    n = len(coordinates)
    if len(casimirs) != n - 2:
        raise SpecError([Diagnostic(f"nambu: {n} coordinates need {n - 2} Casimirs, not {len(casimirs)}")])
    rows = [gradient(c, coordinates) for c in casimirs]
    minors: dict[tuple[int, ...], Expression] = {}
    upper = {}
    for i in range(n):
        for j in range(i + 1, n):
            columns = [k for k in range(n) if k not in (i, j)]
            minor = _minor(rows, columns, minors)
            upper[i, j] = minor if (i + j) % 2 else -minor
    return skew(upper, n)


def _minor(
    rows: Sequence[Sequence[Expression]], columns: Sequence[int], minors: dict[tuple[int, ...], Expression]
) -> Expression:
    """Return the determinant of the last k rows, restricted to k ``columns``, by expansion along the first of these
    rows.

    ``minors`` stores each determinant under its columns. There are 2ⁿ sets of columns; without storage, the expansion
    would have n! terms.
    """
    if not columns:
        return ONE
    key = tuple(columns)
    if key not in minors:
        terms = []
        for k, column in enumerate(columns):
            entry = rows[len(rows) - len(columns)][column]
            if not entry.is_zero:
                term = entry * _minor(rows, (*columns[:k], *columns[k + 1 :]), minors)
                terms.append(term if k % 2 == 0 else -term)
        minors[key] = total(terms)
    return minors[key]


def _expect_dimension(name: str, dimension: int, coordinates: int) -> None:
    if dimension != coordinates:
        raise SpecError([Diagnostic(f"{name} has dimension {dimension}, but there are {coordinates} coordinates")])


def _expect_square(rows: Sequence[Sequence[Expression]], n: int, name: str) -> None:
    if len(rows) != n or any(len(row) != n for row in rows):
        shape = "×".join([str(len(rows)), str(len(rows[0]) if rows else 0)])
        raise SpecError([Diagnostic(f"the {name} is {shape}, but there are {n} coordinates")])
