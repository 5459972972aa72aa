"""Faithful matrix representations of Lie algebras, found from the structure constants.

Each indecomposable part of an algebra gets a representation of its own: the first one in this list that is faithful and
accepted by the caller.

- the defining matrices of a named family with the same structure constants, or with the negated ones
- the adjoint representation, if the centre is 0
- the adjoint representation with added nilpotent 2×2 blocks, if no element of the centre except 0 lies in [g, g]
- the affine representation of a two-step nilpotent algebra
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from phigen.geometry.families import families_of_dimension, named
from phigen.geometry.field import Field, Scalar
from phigen.geometry.lie_algebra import LieAlgebra, Representation
from phigen.geometry.linear import Span, kernel
from phigen.symbolic.expression import Expression

Sparse = dict[tuple[int, int], Scalar]
#: Largest dimension of an algebra whose structure constants are compared with those of named families.
_LARGEST_MATCHED = 45


def known_representation(algebra: LieAlgebra) -> Representation | None:
    """Return the matrices that the spec gives for an algebra. Without these, return the matrices of a named
    family.

    The family must have the same structure constants, or the negated ones. If there is no such family, the result is
    None.
    """
    return algebra.representation or next(_matching_families(algebra), None)


def candidates(algebra: LieAlgebra) -> Iterator[Representation]:
    """Yield the faithful representations that phigen constructs, in the order of preference."""
    yield from _matching_families(algebra)
    field = algebra.field
    adjoint = _adjoint(algebra, field)
    centre = kernel(field, _rows_of(adjoint, field), algebra.dimension)
    if not centre:
        yield _named(f"the adjoint {algebra.dimension}×{algebra.dimension} matrices", algebra.dimension, adjoint, field)
        return
    yield from _with_blocks(algebra, adjoint, centre, field)
    yield from _two_step(algebra, adjoint, field)


def indecomposable_parts(algebra: LieAlgebra) -> list[list[int]]:
    """Return the finest partition of the basis elements in which each part spans an ideal.

    A part is a sorted list of indices from 0.
    """
    part = list(range(algebra.dimension))
    for (i, j), row in algebra.constants.items():
        merged = {part[m] for m in (i, j, *row)}
        least = min(merged)
        part = [least if p in merged else p for p in part]
    return [[i for i, p in enumerate(part) if p == label] for label in sorted(set(part))]


def restricted(algebra: LieAlgebra, part: Sequence[int]) -> LieAlgebra:
    """Return the ideal that the basis elements with the indices ``part`` span, with these elements as its basis."""
    position = {i: new_index for new_index, i in enumerate(part)}
    constants = {
        (position[i], position[j]): {position[k]: c for k, c in row.items()}
        for (i, j), row in algebra.constants.items()
        if i in position
    }
    labels = tuple(algebra.label(i) for i in part)
    name = algebra.name if len(part) == algebra.dimension else f"its part {', '.join(labels)}"
    return LieAlgebra(name, len(part), constants, None, labels)


def _matching_families(algebra: LieAlgebra) -> Iterator[Representation]:
    if not algebra.field.is_rational or algebra.dimension > _LARGEST_MATCHED or not algebra.constants:
        return
    for family, size in families_of_dimension(algebra.dimension):
        family_algebra = named(family, size)
        for candidate in (family_algebra, family_algebra.opposite()):
            rep = candidate.representation
            if rep is not None and _plain(candidate) == _plain(algebra):
                yield rep


def _plain(algebra: LieAlgebra) -> dict[tuple[int, int], dict[int, Expression]]:
    # Expressions built in the same way are the same object, so the constants of two algebras can be compared by ==.
    return {ij: dict(row) for ij, row in algebra.constants.items() if row}


def _adjoint(algebra: LieAlgebra, field: Field) -> list[Sparse]:
    n = range(algebra.dimension)
    return [{(k, j): field.convert(c) for j in n for k, c in algebra.bracket(i, j).items()} for i in n]


def _rows_of(matrices: Sequence[Sparse], field: Field) -> list[dict[int, Scalar]]:
    """Return the linear equations for the coefficients v in Σ v_i·matrices[i] = 0, as sparse rows."""
    rows: dict[tuple[int, int], dict[int, Scalar]] = {}
    for i, m in enumerate(matrices):
        for position, v in m.items():
            rows.setdefault(position, {})[i] = v
    return [rows[position] for position in sorted(rows)]


def _with_blocks(
    algebra: LieAlgebra, adjoint: list[Sparse], centre: list[dict[int, Scalar]], field: Field
) -> Iterator[Representation]:
    """Yield the adjoint representation, extended by 2×2 blocks (0 χ; 0 0) that make it faithful on the centre.

    There is one block for each dimension of the centre. χ is a linear form that vanishes on [g, g], where g is the
    algebra. If there are too few linear forms that vanish on [g, g], nothing is yielded. Nilpotent blocks add nothing
    to the products P E_i P in the Cayley transform, where E_i is a basis element and P = Σ p_k E_k. Diagonal blocks
    would add cubic terms.
    """
    derived = [{k: field.convert(c) for k, c in row.items()} for row in algebra.constants.values()]
    forms: list[dict[int, Scalar]] = []
    central_values: list[dict[int, Scalar]] = []  # for each form: index in ``centre`` → value
    for form in kernel(field, derived, algebra.dimension):
        values = {m: v for m, z in enumerate(centre) if (v := _pairing(form, z, field)) != 0}
        if values and not Span(field, [*central_values, values]).dependent:
            forms.append(form)
            central_values.append(values)
    if len(forms) < len(centre):
        return
    n = algebra.dimension
    matrices = [dict(m) for m in adjoint]
    for extra, form in enumerate(forms):
        for i, value in form.items():
            matrices[i][n + 2 * extra, n + 2 * extra + 1] = value
    yield _named(f"the adjoint matrices and {len(forms)} nilpotent 2×2 block(s)", n + 2 * len(forms), matrices, field)


def _pairing(form: dict[int, Scalar], vector: dict[int, Scalar], field: Field) -> Scalar:
    result = field.zero
    for i, v in form.items():
        if i in vector:
            result = result + v * vector[i]
    return result


def _two_step(algebra: LieAlgebra, adjoint: list[Sparse], field: Field) -> Iterator[Representation]:
    """Yield the matrices (½ad_X X; 0 0) on the space g ⊕ R, where g is the Lie algebra and X runs over its
    basis.

    These matrices represent g if [[g, g], g] = 0; for other algebras nothing is yielded.
    """
    derived = [set(row) for row in algebra.constants.values()]
    touched = sorted({k for row in derived for k in row})
    if any(adjoint[k] for k in touched) and not _is_two_step(algebra, adjoint, field):
        return
    n = algebra.dimension
    one_half = field.one / field.number(2)
    matrices = [
        {position: v * one_half for position, v in m.items()} | {(i, n): field.one} for i, m in enumerate(adjoint)
    ]
    yield _named("the affine matrices of a two-step nilpotent algebra", n + 1, matrices, field)


def _is_two_step(algebra: LieAlgebra, adjoint: list[Sparse], field: Field) -> bool:
    for i, j in combinations(range(algebra.dimension), 2):
        image: Sparse = {}
        for k, c in algebra.bracket(i, j).items():
            for position, v in adjoint[k].items():
                image[position] = image.get(position, field.zero) + field.convert(c) * v
        if any(v != 0 for v in image.values()):
            return False
    return True


def _named(name: str, size: int, matrices: Sequence[Sparse], field: Field) -> Representation:
    return Representation(
        name, size, tuple({position: field.expression(v) for position, v in sorted(m.items())} for m in matrices)
    )
