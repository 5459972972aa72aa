"""Attitudes for Gauss steps: the group element of a step as a rotation, by a homomorphism to dual quaternions.

A dual quaternion q + εr with ε² = 0 stands for the rotation q and the translation 2r q̄. The homomorphism maps the
basis elements of the Lie algebra that generate rotations to ½i, ½j, ½k or, for the opposite sign of the brackets, to
−½i, −½j, −½k. It maps the basis elements that generate translations to ½εi, ½εj, ½εk or, for the opposite sign, to
−½εi, −½εj, −½εk. It maps all other basis elements to 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from phigen.attitude.elements import product as quaternion_product
from phigen.attitude.group import Group
from phigen.gauss.realisation import AlgebraBlock
from phigen.gauss.stage_map import StageMap, offset_element, offsets_of
from phigen.gauss.star_algebra import StarAlgebra, Vector, combined
from phigen.geometry.field import Scalar
from phigen.geometry.linear import Span
from phigen.symbolic.expression import ONE, Expression, number, total

#: Dual quaternion q + εr by its eight components: those of q, then those of r.
Dual = list[Scalar]


def group_element(points: StageMap, attitude: Group) -> list[Expression] | None:
    """Return the attitude increment of a Gauss step as a list of functions of the unknowns: the components of q − 1,
    where q is a quaternion.

    If the group of the attitude has translations, the three components of the translation are appended. Returns None if
    the coordinates that belong to rotations do not all belong to one group element, or if there is no homomorphism to
    dual quaternions.
    """
    for group, places in zip(points.realisation.groups, points.places, strict=True):
        if set(attitude.rotation) <= set(group.indices):
            images = _images(group, attitude)
            return None if images is None else _element(points, group, places, images, attitude)
    return None


def _element(
    points: StageMap, group: AlgebraBlock, places: Sequence[int], images: Sequence[Dual], attitude: Group
) -> list[Expression]:
    algebra = group.algebra
    offsets = offset_element(group, offsets_of(points, places))
    w = [
        total(algebra.field.expression(image[k]) * z for image, z in zip(images, offsets, strict=True) if image[k])
        for k in range(8)
    ]
    if attitude.spatial:  # then a step multiplies the attitude by G⁻¹ from the left
        w = [w[0], *(-v for v in w[1:4]), w[4], *(-v for v in w[5:])]
    inverse = [ONE + w[0], *(-v for v in w[1:4])]
    translation = quaternion_product(w[4:], inverse)[1:]
    return [*w[:4], *(number(2) * v for v in translation)] if attitude.translation else w[:4]


def _images(group: AlgebraBlock, attitude: Group) -> list[Dual] | None:
    """Return the image of each basis element of the star algebra under a homomorphism to dual quaternions.

    The head of the module says how the homomorphism maps rotations and translations of the attitude. Returns None if
    there is no such homomorphism.
    """
    algebra, field = group.algebra, group.algebra.field
    half = field.one / field.number(2)
    scale = half if attitude.spatial else -half
    elements, images = [algebra.unit], [_dual(algebra, 0, field.one)]
    for a, i in enumerate(group.indices):
        image = [field.zero] * 8
        for shift, triple in ((0, attitude.rotation), (4, attitude.translation)):
            if i in triple:
                image = _dual(algebra, shift + 1 + list(triple).index(i), scale)
        elements.append(algebra.basis[a])
        images.append(image)
    _generate(algebra, elements, images)
    span = Span(field, elements)
    if span.dimension < algebra.dimension:
        return None
    of_basis = [_combination(algebra, span.coordinates({i: field.one}) or {}, images) for i in range(algebra.dimension)]
    return of_basis if _is_homomorphism(algebra, of_basis) else None


def _dual(algebra: StarAlgebra, offset: int, value: Scalar) -> Dual:
    return [value if k == offset else algebra.field.zero for k in range(8)]


def _combination(algebra: StarAlgebra, factors: Vector, images: Sequence[Dual]) -> Dual:
    rows = [{k: v for k, v in enumerate(image) if v} for image in images]
    value = combined(rows, factors)
    return [value.get(k, algebra.field.zero) for k in range(8)]


def _generate(algebra: StarAlgebra, elements: list[Vector], images: list[Dual]) -> None:
    """Append products of elements, and the products of their images, until the elements span the algebra.

    Each new product is linearly independent of the elements before it. The function returns early if there is no such
    product.
    """
    generators = len(elements)
    for k in count():
        if k == len(elements) or Span(algebra.field, elements).dimension == algebra.dimension:
            return
        for g in range(generators):
            value = algebra.product(elements[k], elements[g])
            if value and Span(algebra.field, [*elements, value]).dimension > Span(algebra.field, elements).dimension:
                elements.append(value)
                images.append(_multiplied(images[k], images[g]))


def _multiplied(a: Dual, b: Dual) -> Dual:
    """Return the product of two dual quaternions."""
    real_part = _times(a[:4], b[:4])
    return [*real_part, *(u + v for u, v in zip(_times(a[:4], b[4:]), _times(a[4:], b[:4]), strict=True))]


def _times(a: Sequence[Scalar], b: Sequence[Scalar]) -> Dual:
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    ]


def _is_homomorphism(algebra: StarAlgebra, images: Sequence[Dual]) -> bool:
    """Whether the image of each product of two basis elements is the product of their images."""
    n = range(algebra.dimension)
    return all(
        _multiplied(images[i], images[j]) == _combination(algebra, algebra.table.get((i, j), {}), images)
        for i in n
        for j in n
    )
