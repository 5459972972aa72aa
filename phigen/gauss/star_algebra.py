"""Star algebras: associative algebras with an involution, whose skew elements contain a Lie algebra.

Let A be a star algebra, g a Lie subalgebra of its skew elements (a* = −a), and x̃ a functional on A that vanishes on
symmetric elements. A is a vector space with the constant two-form ω(u, v) = x̃(u v*). On A, right multiplication by
exp(ξ) with ξ ∈ g is linear and symplectic, and its momentum map is quadratic: J_ξ(G) = x̃(G ξ G*). At G = 1, J_ξ is
x̃(ξ).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from flint import fmpq_mat

from phigen.geometry.field import Field, Scalar
from phigen.geometry.linear import Span, add_multiple, kernel

Vector = dict[int, Scalar]


@dataclass(frozen=True)
class StarAlgebra:
    """Star algebra in a basis: an associative algebra with an involution a ↦ a*.

    ``table[i, j]`` is the product of the basis elements i and j; products that are 0 have no entry. ``star[i]`` is the
    image of basis element i under the involution, and ``unit`` is the unit element. ``basis`` has the elements E_a that
    span the Lie algebra g. ``frame`` has skew elements f_k by which momenta are computed: E_a = Σ_k combination[a][k]
    f_k. A point x of the phase space defines the functional x̃ on the algebra. The value of x̃ at basis element i is
    Σ_a functional[i][a] x_a.
    """

    field: Field
    dimension: int
    table: Mapping[tuple[int, int], Vector]
    star: Sequence[Vector]
    unit: Vector
    basis: Sequence[Vector]
    functional: Sequence[Vector]
    frame: Sequence[Vector]
    combination: Sequence[Vector]

    def product(self, a: Mapping[int, Scalar], b: Mapping[int, Scalar]) -> Vector:
        """Return the product of two elements."""
        product: Vector = {}
        for i, v in a.items():
            for j, w in b.items():
                if (i, j) in self.table:
                    add_multiple(product, self.table[i, j], v * w)
        return product

    def starred(self, a: Mapping[int, Scalar]) -> Vector:
        """Return a*, the image of an element a under the involution."""
        return combined(self.star, a)

    def commutator(self, a: Mapping[int, Scalar], b: Mapping[int, Scalar]) -> Vector:
        """Return the commutator ab − ba."""
        return difference(self.product(a, b), self.product(b, a), self.field.one)

    def value(self, a: Mapping[int, Scalar]) -> Vector:
        """Return x̃(a), the value of the functional x̃ of a point x.

        This value is a linear form in x: the result maps k to the coefficient of x_k.
        """
        return combined(self.functional, a)

    @cached_property
    def skew(self) -> list[Vector]:
        """A basis of the skew elements, which have a* = −a."""
        unit = self.field.one
        rows: list[Vector] = [{} for _ in range(self.dimension)]
        for i, image in enumerate(self.star):
            for k, v in image.items():
                add_multiple(rows[k], {i: v}, unit)
            add_multiple(rows[i], {i: unit}, unit)
        return kernel(self.field, rows, self.dimension)

    @property
    def sound(self) -> bool:
        """Whether all `axioms` hold."""
        return not any(any(residuals) for _, residuals in self.axioms())

    def axioms(self) -> Iterator[tuple[str, Iterator[Vector]]]:
        """Yield the axioms by which coordinates are a momentum map: the name of each axiom, and an iterator of
        residuals.

        An axiom holds if all its residuals are 0. A residual is a sparse vector, and the vector 0 has no entries.
        """
        n, unit = range(self.dimension), self.field.one
        units = [{i: unit} for i in n]
        yield "A is associative", self._associators()
        yield (
            "A has the unit 1",
            (difference(p, u, unit) for u in units for p in (self.product(self.unit, u), self.product(u, self.unit))),
        )
        yield "(ab)* = b*a* and a** = a", self._involution(units)
        yield "E_a* = −E_a", (difference(self.starred(e), e, -unit) for e in self.basis)
        yield "E_a is a combination of the frame", self._framed()
        yield "x̃(E_a) = x_a", (difference(self.value(e), {a: unit}, unit) for a, e in enumerate(self.basis))
        yield "x̃(a*) = −x̃(a)", (difference(self.value(self.starred(u)), self.value(u), -unit) for u in units)
        yield "skew elements on which all functionals x̃ vanish form an ideal", self._commutators_of_skew()

    def _associators(self) -> Iterator[Vector]:
        """Yield the residuals (ab)c − a(bc) of the associative law, for basis elements a, b, c.

        For rational coefficients, the residuals of all b and c are yielded together, in one vector for each a.
        """
        n = range(self.dimension)
        if not self.field.is_rational:
            yield from (self._associator(i, j, k) for i in n for j in n for k in n)
            return
        size, zero = self.dimension, self.field.zero
        entries = {(i, k, j): v for (i, j), row in self.table.items() for k, v in row.items()}
        left = [fmpq_mat(size, size, [entries.get((i, k, j), zero) for k in n for j in n]) for i in n]
        flat = fmpq_mat(size, size * size, [v for m in left for v in m.entries()])
        for i in n:  # basis elements e_i: left multiplication by e_i e_j is Σ_k (e_i e_j)_k left[k]
            of_products = left[i].transpose() * flat
            apart = [left[i] * m for m in left]
            together = [v for m in apart for v in m.entries()]
            yield {
                index: v - w for index, (v, w) in enumerate(zip(of_products.entries(), together, strict=True)) if v != w
            }

    def _associator(self, i: int, j: int, k: int) -> Vector:
        unit = self.field.one
        left = self.product(self.table.get((i, j), {}), {k: unit})
        return difference(left, self.product({i: unit}, self.table.get((j, k), {})), unit)

    def _involution(self, units: Sequence[Vector]) -> Iterator[Vector]:
        unit = self.field.one
        for a in units:
            yield difference(self.starred(self.starred(a)), a, unit)
            for b in units:
                reverse = self.product(self.starred(b), self.starred(a))
                yield difference(self.starred(self.product(a, b)), reverse, unit)

    def _framed(self) -> Iterator[Vector]:
        for e, parts in zip(self.basis, self.combination, strict=True):
            yield difference(combined(self.frame, parts), e, self.field.one)
        for f in self.frame:
            yield difference(self.starred(f), f, -self.field.one)

    def _commutators_of_skew(self) -> Iterator[Vector]:
        """Yield x̃([u, n]) for all skew elements u and all n in N, where N has the skew elements on which every
        functional x̃ is 0.

        These values are 0 if and only if N is an ideal of the Lie algebra of all skew elements.
        """
        rows: list[Vector] = [{} for _ in self.basis]
        for i, u in enumerate(self.skew):
            for a, v in self.value(u).items():
                rows[a][i] = v
        for null in kernel(self.field, [r for r in rows if r], len(self.skew)):
            n = combined(self.skew, null)
            for u in self.skew:
                yield self.value(self.commutator(u, n))


def combined(vectors: Sequence[Mapping[int, Scalar]], factors: Mapping[int, Scalar]) -> Vector:
    """Return Σ_k factors[k]·vectors[k]."""
    combination: Vector = {}
    for k, v in factors.items():
        add_multiple(combination, vectors[k], v)
    return combination


def difference(a: Mapping[int, Scalar], b: Mapping[int, Scalar], factor: Scalar) -> Vector:
    """Return a − factor·b."""
    result = dict(a)
    add_multiple(result, b, -factor)
    return result


def in_basis(algebra: StarAlgebra, vectors: Sequence[Vector]) -> StarAlgebra:
    """Return ``algebra`` in the basis ``vectors``. The ``vectors`` are given by their components in the present
    basis.
    """
    span = Span(algebra.field, vectors)

    def converted(a: Mapping[int, Scalar]) -> Vector:
        return span.coordinates(a) or {}

    table = {
        (i, j): converted(p)
        for i, a in enumerate(vectors)
        for j, b in enumerate(vectors)
        if (p := algebra.product(a, b))
    }
    return StarAlgebra(
        algebra.field,
        algebra.dimension,
        table,
        [converted(algebra.starred(a)) for a in vectors],
        converted(algebra.unit),
        [converted(e) for e in algebra.basis],
        [algebra.value(a) for a in vectors],
        [converted(f) for f in algebra.frame],
        algebra.combination,
    )
