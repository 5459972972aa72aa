"""Frames: quaternions with which momenta are quadratic forms with constant coefficients.

Let 1, i, j, k be the basis of a copy of the quaternions in a star algebra (an associative algebra with an involution
*). On this copy, the functional x̃ of `phigen.gauss.star_algebra` is x̃(q) = y·Im q with a vector y. There is a
quaternion F, called the *frame*, with y = F* k F. Let U = FG be the unknown in place of the group element G. Then the
momenta are x̃(GaG*) = k̃(UaU*) with k̃(q) = (Im q)_3, which does not depend on x. The value of U at the end of a step
is the frame at the start of the next step. Left multiplication by F commutes with the vector field, so a step with the
unknown U is the step with the unknown G. F is determined only up to a left factor exp(tk), and all choices give the
same step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phigen.gauss.star_algebra import StarAlgebra, Vector
from phigen.geometry.field import Scalar

#: Indices of the basis elements 1, i, j, k of a copy of the quaternions in a star algebra.
Copy = tuple[int, int, int, int]


def quaternion_copies(algebra: StarAlgebra) -> tuple[Copy, ...]:
    """Return the copies of the quaternions whose direct sum is the algebra; () if the algebra is no direct sum of
    copies.

    The basis elements 1, i, j, k of each copy must be elements of the basis of the algebra.
    """
    field, n = algebra.field, range(algebra.dimension)
    if not field.is_rational or algebra.dimension % 4:
        return ()
    copies: list[Copy] = []
    for u in sorted(algebra.unit):
        skew = [i for i in n if i != u and algebra.table.get((u, i))]
        if len(skew) != 3:
            return ()
        a, b, c = skew
        copy: Copy = (u, a, b, c) if algebra.table.get((a, b), {}).get(c, field.zero) == field.one else (u, b, a, c)
        copies.append(copy)
    expected = {at: row for copy in copies for at, row in _products(copy, field.one).items()}
    products = {at: row for at, row in algebra.table.items() if row}
    starred = all(algebra.star[i] == {i: field.one if i in algebra.unit else -field.one} for i in n)
    sums = algebra.unit == dict.fromkeys((copy[0] for copy in copies), field.one)
    real = not any(algebra.functional[copy[0]] for copy in copies)
    return tuple(copies) if sums and real and starred and products == expected else ()


def _products(copy: Copy, one: Scalar) -> dict[tuple[int, int], Vector]:
    """Return the products of the basis elements 1, i, j, k of one copy of the quaternions.

    ``copy`` has the indices of these basis elements. ``one`` is the number 1 in the field of the coefficients.
    """
    u, i, j, k = copy
    products = {(u, u): {u: one}}
    for a, b, c in ((i, j, k), (j, k, i), (k, i, j)):
        products |= {(u, a): {a: one}, (a, u): {a: one}, (a, a): {u: -one}, (a, b): {c: one}, (b, a): {c: -one}}
    return products


def momentum_form(
    algebra: StarAlgebra, copies: Sequence[Copy], element: Mapping[int, Scalar]
) -> dict[tuple[int, int], Scalar]:
    """Return k̃(U a U*) as a quadratic form in the components of U, where a is the argument ``element``.

    Both U and a are elements of the star algebra, a direct sum of copies of the quaternions. The functional k̃ adds the
    k-components of all copies. The result maps pairs (i, j) with i ≤ j to the coefficient of U_i U_j.
    """
    unit, last = algebra.field.one, {copy[3] for copy in copies}
    form: dict[tuple[int, int], Scalar] = {}
    for i in range(algebra.dimension):
        left = algebra.product({i: unit}, element)
        for j in range(algebra.dimension):
            value = sum(
                (v for k, v in algebra.product(left, algebra.starred({j: unit})).items() if k in last),
                algebra.field.zero,
            )
            if value != 0:
                at = (min(i, j), max(i, j))
                form[at] = form.get(at, algebra.field.zero) + value
    return {at: v for at, v in form.items() if v != 0}
