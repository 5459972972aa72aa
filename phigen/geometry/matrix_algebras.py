"""Lie algebras from matrices or structure constants of specs, after a test that they define a Lie algebra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.field import Field
from phigen.geometry.lie_algebra import LieAlgebra, Representation, SparseMatrix
from phigen.geometry.linear import Span, add_multiple
from phigen.symbolic.expression import ZERO, Expression, total
from phigen.symbolic.readable import shortened
from phigen.symbolic.verdict import REFUTED, decide_zero

Matrix = tuple[tuple[Expression, ...], ...]


def from_matrices(matrices: Sequence[Matrix]) -> LieAlgebra:
    """Return the Lie algebra with these square matrices as its basis; their entries may contain parameters.

    Raises `SpecError` for matrices of different sizes, for a linearly dependent matrix, and for two matrices whose
    commutator is outside the span.
    """
    size = len(matrices[0])
    for i, m in enumerate(matrices):
        if len(m) != size or any(len(row) != size for row in m):
            raise SpecError([Diagnostic(f"lie_algebra matrices: E{i + 1} is not {size}×{size} like E1")])
    sparse = [
        {(r, c): entry for r, row in enumerate(m) for c, entry in enumerate(row) if not entry.is_zero} for m in matrices
    ]
    return algebra_of_sparse_matrices("the given algebra", size, sparse)


def algebra_of_sparse_matrices(
    name: str, size: int, matrices: Sequence[Mapping[tuple[int, int], Expression]]
) -> LieAlgebra:
    """Return the Lie algebra with these matrices as its basis. A matrix maps (row, column) to a nonzero entry.

    Raises `SpecError` for a linearly dependent matrix, and for two matrices whose commutator is outside the span.
    """
    field = Field(e for m in matrices for e in m.values())
    converted = [{position: field.convert(e) for position, e in m.items()} for m in matrices]
    span = Span(field, converted)
    if span.dependent:
        which = span.dependent[0] + 1
        raise SpecError(
            [Diagnostic(f"lie_algebra matrices: E{which} is a linear combination of the matrices before it")]
        )
    constants = {}
    for i, j in combinations(range(len(matrices)), 2):
        commutator = product(converted[i], converted[j])
        add_multiple(commutator, product(converted[j], converted[i]), -field.one)
        row = span.coordinates(commutator)
        if row is None:
            raise SpecError(
                [
                    Diagnostic(
                        f"lie_algebra matrices: the commutator [E{i + 1}, E{j + 1}] is not in the span of the matrices",
                        hint="a Lie algebra is closed under commutators; add the missing matrices",
                    )
                ]
            )
        if row:
            constants[i, j] = {k: field.expression(c) for k, c in row.items()}
    origin = f"the {size}×{size} matrices of {name}"
    defining = Representation(origin, size, tuple(dict(m) for m in matrices))
    return LieAlgebra(name, len(matrices), constants, defining)


def product(a: SparseMatrix, b: SparseMatrix) -> SparseMatrix:
    """Return the product of two sparse matrices."""
    rows: dict[int, list[tuple[int, object]]] = {}
    for (r, c), v in b.items():
        rows.setdefault(r, []).append((c, v))
    entries: SparseMatrix = {}
    for (r, c), v in a.items():
        add_multiple(entries, {(r, column): w for column, w in rows.get(c, ())}, v)
    return entries


def from_structure_constants(
    dimension: int, structure: Mapping[int, Mapping[int, Mapping[int, Expression]]]
) -> LieAlgebra:
    """Return the Lie algebra with [E_i, E_j] = Σ_k structure[i][j][k] E_k, with indices from 0.

    The bracket of a pair may be given in one order or in both. Raises `SpecError` for indices out of range, and for
    brackets that contradict antisymmetry. If the Jacobi identity fails, raises `SpecError` for the first triple.
    """
    indices = [i for i, row in structure.items() for j, ks in row.items() for i in (i, j, *ks)]
    if indices and max(indices) >= dimension:
        message = f"structure constants use E{max(indices) + 1}, but there are {dimension} coordinates"
        raise SpecError([Diagnostic(message)])
    constants: dict[tuple[int, int], dict[int, Expression]] = {}
    for i in range(dimension):
        for j in range(i, dimension):
            row = _bracket_of_pair(i, j, structure)
            if row:
                constants[i, j] = row
    algebra = LieAlgebra(f"a Lie algebra of dimension {dimension}", dimension, constants)
    _expect_jacobi(algebra)
    return algebra


def _bracket_of_pair(
    i: int, j: int, constants: Mapping[int, Mapping[int, Mapping[int, Expression]]]
) -> dict[int, Expression]:
    forward, backward = constants.get(i, {}).get(j), constants.get(j, {}).get(i)
    if i == j:
        backward = None if forward is None else dict.fromkeys(forward, ZERO)
    if forward is not None and backward is not None:
        residuals = [(f"E{k + 1}", forward.get(k, ZERO) + backward.get(k, ZERO)) for k in sorted({*forward, *backward})]
        statement = decide_zero("antisymmetry", residuals)
        if statement.verdict == REFUTED:
            claim = f"[E{i + 1}, E{j + 1}] = " + ("0" if i == j else f"−[E{j + 1}, E{i + 1}]")
            raise SpecError([Diagnostic(f"structure constants: {claim} does not hold, component {statement.detail}")])
    if i == j:
        return {}
    row = forward if forward is not None else {k: -c for k, c in (backward or {}).items()}
    return {k: c for k, c in sorted(row.items()) if not c.is_zero}


def _expect_jacobi(algebra: LieAlgebra) -> None:
    failing = failing_jacobi(algebra)
    if failing is not None:
        (i, j, k), component, residual = failing
        message = (
            f"structure constants: the Jacobi identity fails for (E{i + 1}, E{j + 1}, E{k + 1}); "
            f"the sum of the cyclic double brackets is not 0 in E{component + 1}: {shortened(residual)}"
        )
        raise SpecError([Diagnostic(message)])


def failing_jacobi(algebra: LieAlgebra) -> tuple[tuple[int, int, int], int, Expression] | None:
    """Return the first triple for which the Jacobi identity fails, with the index and the value of a nonzero component.

    Returns None if the identity is not refuted for any triple.
    """
    for triple in combinations(range(algebra.dimension), 3):
        for component, residual in jacobi_residuals(algebra, *triple).items():
            if decide_zero("Jacobi", [("", residual)]).verdict == REFUTED:
                return triple, component, residual
    return None


def jacobi_residuals(algebra: LieAlgebra, i: int, j: int, k: int) -> dict[int, Expression]:
    """Return [[E_i, E_j], E_k] + cyclic as a map: component → value, without components that are literally 0."""
    terms: dict[int, list[Expression]] = {}
    for a, b, c in ((i, j, k), (j, k, i), (k, i, j)):
        for m, v in algebra.bracket(a, b).items():
            for component, w in algebra.bracket(m, c).items():
                terms.setdefault(component, []).append(v * w)
    return {m: s for m, parts in sorted(terms.items()) if not (s := total(parts)).is_zero}
