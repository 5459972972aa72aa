"""Star algebras of simple Lie algebras without known matrices, as quotients of universal enveloping algebras.

A star algebra is an associative algebra with an involution *. Its skew elements a (a* = −a) contain the Lie algebra.

Let g be sl(n), so(n), sp(2n), or a real form of these. Its star algebra is A = K ⊕ g ⊕ S ⊕ Z. Here K is spanned by 1. S
is a g-module of symmetric elements (f* = f) such that all anticommutators ab + ba of a, b in g are in K ⊕ S. Z is
spanned by a central skew element z, and is only needed for sl(n) and su(n). S is an eigenspace of the Casimir operator
on Sym² g. For a and b in g and f in S, the products are

    ab = ½[a, b] + c κ(a, b) + σ(a, b),    af = ½ a▷f + μ τ(a, f) + ν ⟨a, f⟩ z,    az = ι(a).

Here κ is the Killing form, σ the projection on S, and τ the transpose of σ. a▷f is the action of a on f, ι is an
isomorphism of g and S, and ⟨a, ι(b)⟩ = κ(a, b). The condition that these products represent g gives linear equations
for c, μ and ν. All other products in A follow from the three products above. The Lie algebras gl(n) and u(n) have the
star algebras of sl(n) and su(n), where z spans their centre.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isqrt
from typing import Any

from flint import fmpq, fmpq_mat

from phigen.gauss.matrices import MOST_UNKNOWNS
from phigen.gauss.star_algebra import StarAlgebra, Vector
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.symbolic.tower import rational

#: Largest dimension of the Lie algebra: the dimension of sp(6). The star algebra of sp(6) has 36 dimensions, which is
#: MOST_UNKNOWNS.
MOST_SIMPLE = 21

#: Largest number of nonzero structure constants of a star algebra. For the Lie algebras that phigen knows by name there
#: are at most 1,700 of these constants, also after permuting and scaling the basis. For so(5) in a dense basis there
#: are 4,000. Then the tangent map of a stage takes 120,000 operations, more than programs may have.
MOST_TERMS = 2000


def enveloping(lie: LieAlgebra) -> StarAlgebra | None:
    """Return the star algebra of a simple Lie algebra, or of the sum of a simple and a one-dimensional Lie
    algebra.

    Returns None if there is no star algebra of this kind, or only one that exceeds MOST_UNKNOWNS or MOST_TERMS.
    """
    field, m = lie.field, lie.dimension
    if not field.is_rational or m > MOST_SIMPLE:
        return None
    ad = [_matrix(m, m) for _ in range(m)]
    for i in range(m):
        for j in range(m):
            for k, c in lie.bracket(i, j).items():
                ad[i][k, j] = _number(rational(field.convert(c)))
    parts = _derived_and_centre(ad, m)
    if parts is None:
        return None
    basis, inverse, simple = parts
    inner = [_restricted(ad, basis, inverse, k, simple) for k in range(simple)]
    for module in _modules(inner, centre=m - simple):
        rows = module.products()
        algebra = rows and _assembled(lie, module, rows, basis, inverse)
        if algebra and sum(map(len, algebra.table.values())) <= MOST_TERMS and algebra.sound:
            return algebra
    return None


def _number(value: Any) -> fmpq:
    exact = Fraction(value)
    return fmpq(exact.numerator, exact.denominator)


def _matrix(rows: int, columns: int) -> fmpq_mat:
    return fmpq_mat(rows, columns)


def _kernel(a: fmpq_mat) -> list[list[fmpq]]:
    """Return a basis of the kernel of a matrix."""
    reduced, rank = a.rref()
    columns, pivots, row = a.ncols(), [], 0
    for j in range(columns):
        if row < rank and reduced[row, j] != 0:
            pivots.append(j)
            row += 1
    free_columns = [j for j in range(columns) if j not in pivots]
    vectors = []
    for j in free_columns:
        vector = [fmpq(0)] * columns
        vector[j] = fmpq(1)
        for r, pivot in enumerate(pivots):
            vector[pivot] = -reduced[r, j]
        vectors.append(vector)
    return vectors


def _derived_and_centre(ad: Sequence[fmpq_mat], m: int) -> tuple[fmpq_mat, fmpq_mat, int] | None:
    """Return a basis of a Lie algebra g that is adapted to [g, g] and the centre: the basis as rows, its inverse, and
    dim [g, g].

    ``ad`` are the adjoint matrices of g, and ``m`` is dim g. The rows span [g, g] first, then the centre. Returns None
    if [g, g] and the centre do not span g, or if the centre has more than one dimension.
    """
    brackets = fmpq_mat(m * m, m, [ad[i][k, j] for i in range(m) for j in range(m) for k in range(m)])
    reduced, rank = brackets.rref()
    centre = _kernel(fmpq_mat(m * m, m, [ad[i][k, j] for k in range(m) for j in range(m) for i in range(m)]))
    if rank + len(centre) != m or len(centre) > 1:
        return None
    rows = [[reduced[r, j] for j in range(m)] for r in range(rank)] if rank < m else _unit_rows(m)
    basis = fmpq_mat(m, m, [v for row in [*rows, *centre] for v in row])
    try:
        return basis, basis.inv(), rank
    except ZeroDivisionError:
        return None


def _unit_rows(m: int) -> list[list[fmpq]]:
    return [[fmpq(int(i == j)) for j in range(m)] for i in range(m)]


def _restricted(ad: Sequence[fmpq_mat], basis: fmpq_mat, inverse: fmpq_mat, k: int, simple: int) -> fmpq_mat:
    """Return the adjoint matrix ad e_k of basis element ``k`` of [g, g], in the basis of [g, g].

    ``ad`` are the adjoint matrices of the Lie algebra g, and ``simple`` is dim [g, g]. ``basis`` is the basis of g that
    `_derived_and_centre` returns, and ``inverse`` its inverse.
    """
    m = len(ad)
    total = _matrix(m, m)
    for i in range(m):
        total = total + ad[i] * basis[k, i]
    adjoint_matrix = inverse.transpose() * total * basis.transpose()
    return fmpq_mat(simple, simple, [adjoint_matrix[i, j] for i in range(simple) for j in range(simple)])


def _modules(ad: Sequence[fmpq_mat], centre: int) -> Iterator[_Module]:
    """Yield the candidates for the module S in the star algebra A = K ⊕ g ⊕ S ⊕ Z at the head of the file.

    Each of the families sl(n), so(n) and sp(2n) gives at most one candidate: the family must contain a Lie algebra with
    the dimension of g. Modules with the smallest dimension come first. ``ad`` are the adjoint matrices of g, and
    ``centre`` is the dimension of the centre of the whole Lie algebra, which is the sum of g and the centre.
    """
    m = len(ad)
    form = fmpq_mat(m, m, [_trace(a * b) for a in ad for b in ad])
    if m < 8 or form.det() == 0:
        return
    eigenvalues: list[tuple[int, Fraction, bool]] = []
    n = isqrt(m + 1)
    if n * n == m + 1:
        eigenvalues.append((m, Fraction(1), True))  # sl(n): S has the dimension of g
    n = (1 + isqrt(1 + 8 * m)) // 2
    if n * (n - 1) == 2 * m and not centre:
        eigenvalues.append(
            (n * (n + 1) // 2 - 1, Fraction(n, n - 2), False)
        )  # so(n): S has the symmetric matrices of trace 0
    n = (isqrt(1 + 8 * m) - 1) // 4
    if n * (2 * n + 1) == m and not centre:
        # sp(2n): S consists of the skew-Hamiltonian matrices of trace 0
        eigenvalues.append((n * (2 * n - 1) - 1, Fraction(n, n + 1), False))
    for size, eigenvalue, central in sorted(eigenvalues):
        if 1 + m + size + central > MOST_UNKNOWNS:
            continue
        tensors = _eigenspace(ad, form, eigenvalue)
        if len(tensors) == size:
            yield _Module(ad, form, tensors, central)


def _trace(a: fmpq_mat) -> fmpq:
    return sum((a[i, i] for i in range(a.nrows())), fmpq(0))


def _eigenspace(ad: Sequence[fmpq_mat], form: fmpq_mat, eigenvalue: Fraction) -> list[fmpq_mat]:
    """Return a basis of an eigenspace of the Casimir operator on symmetric tensors over a Lie algebra g.

    ``ad`` are the adjoint matrices of g, and ``form`` is the Killing form. The operator is normalised so that it has
    the eigenvalue 1 on g.
    """
    m = len(ad)
    flat = fmpq_mat(m * m, m, [ad[a][i, p] for i in range(m) for p in range(m) for a in range(m)])
    # The matrix of Σ κ^ab ad_a ⊗ ad_b with the Killing form κ. Rows are pairs (i, p), and columns are pairs (j, q).
    crossed = flat * form.inv() * flat.transpose()
    pairs = [(i, j) for i in range(m) for j in range(i + 1)]
    half = _number((eigenvalue - 2) / 2)
    matrix = _matrix(len(pairs), len(pairs))
    for row, (i, j) in enumerate(pairs):
        for column, (p, q) in enumerate(pairs):
            entry = crossed[i * m + p, j * m + q]
            if p != q:
                entry = entry + crossed[i * m + q, j * m + p]
            matrix[row, column] = entry - (half if row == column else 0)
    tensors = []
    for vector in _kernel(matrix):
        tensor = _matrix(m, m)
        for (i, j), value in zip(pairs, vector, strict=True):
            tensor[i, j] = tensor[j, i] = value
        tensors.append(tensor)
    return tensors


@dataclass(frozen=True)
class _Module:
    """The module S of symmetric elements in the star algebra A = K ⊕ g ⊕ S ⊕ Z of a simple Lie algebra g.

    ``tensors`` are symmetric tensors over g that span S. If ``central``, Z is spanned by a central element z, otherwise
    Z = 0. ``ad`` are the adjoint matrices of g, and ``form`` is the Killing form.
    """

    ad: Sequence[fmpq_mat]
    form: fmpq_mat
    tensors: Sequence[fmpq_mat]
    central: bool

    @property
    def size(self) -> int:
        """The dimension of the star algebra A that the head of the file defines."""
        return 1 + len(self.ad) + len(self.tensors) + self.central

    def products(self) -> list[fmpq_mat] | None:
        """Return the matrices of left multiplication by the basis elements of the star algebra A = K ⊕ g ⊕ S ⊕ Z.

        Returns None if the factors c, μ, ν or the isomorphism ι in the products of A do not exist; see the text at the
        head of this file.
        """
        m, d = len(self.ad), len(self.tensors)
        lowered = [self.form * s * self.form for s in self.tensors]
        flat = fmpq_mat(d, m * m, [q[i, j] for q in lowered for i in range(m) for j in range(m)])
        gram = flat * flat.transpose()
        extract = flat.transpose() * gram.inv()
        action = [self._action(a, lowered, extract) for a in self.ad]
        metric = fmpq_mat(d, d, [_trace(q * s) for q in lowered for s in self.tensors]).inv()
        raised = [s * self.form for s in self.tensors]
        # ``right_factors`` has the matrix of the map a ↦ τ(a, f) for each basis element f of S. The head of the file
        # defines S and τ.
        right_factors = [_combination(raised, [metric[k, k2] for k in range(d)]) for k2 in range(d)]
        iota = _isomorphism(self.ad, action) if self.central else None
        if self.central and iota is None:
            return None
        factors = self._factors(lowered, action, right_factors, iota)
        if factors is None:
            return None
        left = [self._left_multiplication(a, factors, lowered, action, right_factors, iota) for a in range(m)]
        return self._completed(left, lowered, factors, iota)

    def _action(self, a: fmpq_mat, lowered: Sequence[fmpq_mat], extract: fmpq_mat) -> fmpq_mat:
        """Return the matrix of the action of a basis element of the Lie algebra on the module S of symmetric elements.
        ``a`` is the adjoint matrix of the basis element.
        """
        m, d = a.nrows(), len(lowered)
        images = [a.transpose() * q + q * a for q in lowered]
        return fmpq_mat(d, m * m, [e[i, j] for e in images for i in range(m) for j in range(m)]) * extract

    def _factors(
        self,
        lowered: Sequence[fmpq_mat],
        action: Sequence[fmpq_mat],
        right_factors: Sequence[fmpq_mat],
        iota: fmpq_mat | None,
    ) -> tuple[fmpq, fmpq, fmpq] | None:
        """Return the factors c, μ, ν in the products of the star algebra; see the text at the head of this file.

        The factors solve linear equations for a few pairs of elements of the Lie algebra. Returns None if there is no
        solution. A solution may still violate axioms of a star algebra; `enveloping` checks these at the end.
        """
        m, d, rows = len(self.ad), len(self.tensors), list[list[fmpq]]()
        pairing = None if iota is None else self.form * iota.inv()  # ⟨a, ι(b)⟩ = κ(a, b) defines the pairing ⟨a, f⟩
        for a, b in ((0, 1), (1, 2), (0, m - 1)):
            bracket = [self.ad[a][k, b] for k in range(m)]
            twice = _combination(self.ad, bracket)
            for x in range(m):
                first_sum = sum_of(right_factors, [lowered[k][b, x] for k in range(d)], a, m)
                second_sum = sum_of(right_factors, [lowered[k][a, x] for k in range(d)], b, m)
                for i in range(m):
                    form_part = self.form[b, x] * (i == a) - self.form[a, x] * (i == b)
                    rows.append([form_part, first_sum[i] - second_sum[i], fmpq(0), twice[i, x] / 4])
            if iota is None or pairing is None:
                continue
            rotated = _combination(action, bracket)
            for f in range(d):
                ab = [right_factors[f][i, b] for i in range(m)]
                ba = [right_factors[f][i, a] for i in range(m)]
                for k in range(d):
                    first = sum((lowered[k][a, i] * ab[i] - lowered[k][b, i] * ba[i] for i in range(m)), fmpq(0))
                    second = pairing[b, f] * iota[k, a] - pairing[a, f] * iota[k, b]
                    rows.append([fmpq(0), first, second, rotated[k, f] / 4])
        kernel = _kernel(fmpq_mat(len(rows), 4, [v for row in rows for v in row]))
        solution = next((v for v in kernel if v[3] != 0), None)
        if solution is None:
            return None
        c, mu, nu = (-v / solution[3] for v in solution[:3])
        return c, mu, nu

    def _left_multiplication(
        self,
        a: int,
        factors: tuple[fmpq, fmpq, fmpq],
        lowered: Sequence[fmpq_mat],
        action: Sequence[fmpq_mat],
        right_factors: Sequence[fmpq_mat],
        iota: fmpq_mat | None,
    ) -> fmpq_mat:
        """Return the matrix of left multiplication in the star algebra by basis element ``a`` of the Lie algebra."""
        m, d, (c, mu, nu) = len(self.ad), len(self.tensors), factors
        left = _matrix(self.size, self.size)
        left[1 + a, 0] = fmpq(1)
        for b in range(m):
            left[0, 1 + b] = c * self.form[a, b]
            for k in range(m):
                left[1 + k, 1 + b] = self.ad[a][k, b] / 2
            for k in range(d):
                left[1 + m + k, 1 + b] = lowered[k][a, b]
        pairing = None if iota is None else self.form * iota.inv()
        for f in range(d):
            for k in range(m):
                left[1 + k, 1 + m + f] = mu * right_factors[f][k, a]
            for k in range(d):
                left[1 + m + k, 1 + m + f] = action[a][k, f] / 2
            if pairing is not None:
                left[self.size - 1, 1 + m + f] = nu * pairing[a, f]
        if iota is not None:
            for k in range(d):
                left[1 + m + k, self.size - 1] = iota[k, a]
        return left

    def _completed(
        self,
        left: Sequence[fmpq_mat],
        lowered: Sequence[fmpq_mat],
        factors: tuple[fmpq, fmpq, fmpq],
        iota: fmpq_mat | None,
    ) -> list[fmpq_mat] | None:
        """Return the matrices of left multiplication by all basis elements of the star algebra K ⊕ g ⊕ S ⊕ Z at the
        head of the file.

        ``left`` has the matrices for the basis elements of g. The other matrices follow if products of elements of g
        span S; otherwise the function returns None.
        """
        m, d, size = len(self.ad), len(self.tensors), self.size
        identity = fmpq_mat(size, size, [fmpq(int(i == j)) for i in range(size) for j in range(size)])
        pairs = [(a, b) for a in range(m) for b in range(a + 1)]
        values = fmpq_mat(d, len(pairs), [q[a, b] for q in lowered for a, b in pairs])
        pivot_rows = _pivots(values)
        if len(pivot_rows) < d:
            return None
        square = fmpq_mat(d, d, [values[k, c] for k in range(d) for c in pivot_rows])
        symmetric = []
        for c in pivot_rows:  # left multiplication by σ(a, b) = ½(ab + ba) − c κ(a, b)
            a, b = pairs[c]
            product = left[a] * left[b] + left[b] * left[a]
            symmetric.append(product * fmpq(1, 2) - identity * (factors[0] * self.form[a, b]))
        inverse = square.inv()
        by_module = [_combination(symmetric, [inverse[c, k] for c in range(d)]) for k in range(d)]
        everything = [identity, *left, *by_module]
        if iota is not None:
            everything.append(self._centre(left, by_module, factors, iota))
        return everything

    def _centre(
        self, left: Sequence[fmpq_mat], by_module: Sequence[fmpq_mat], factors: tuple[fmpq, fmpq, fmpq], iota: fmpq_mat
    ) -> fmpq_mat:
        """Return the matrix of left multiplication by the central element z.

        The matrix follows from af + fa = 2(μ τ(a, f) + ν ⟨a, f⟩ z); see the text at the head of this file. Here a is an
        element of the Lie algebra, and f an element of S with ⟨a, f⟩ ≠ 0.
        """
        m, d, pairing = len(self.ad), len(self.tensors), self.form * iota.inv()
        a, f = next((a, f) for a in range(m) for f in range(d) if pairing[a, f] != 0)
        anticommutator = (left[a] * by_module[f] + by_module[f] * left[a]) * fmpq(1, 2)
        skew = [left[a][1 + k, 1 + m + f] for k in range(m)]
        return (anticommutator - _combination(left, skew)) * (1 / (factors[2] * pairing[a, f]))


def sum_of(matrices: Sequence[fmpq_mat], factors: Sequence[fmpq], column: int, rows: int) -> list[fmpq]:
    """Return column ``column`` of the matrix Σ_k factors[k]·matrices[k]. The matrices have ``rows`` rows."""
    nonzero_terms = [(m, f) for m, f in zip(matrices, factors, strict=True) if f != 0]
    return [sum((m[i, column] * f for m, f in nonzero_terms), fmpq(0)) for i in range(rows)]


def _combination(matrices: Sequence[fmpq_mat], factors: Sequence[fmpq]) -> fmpq_mat:
    total = _matrix(matrices[0].nrows(), matrices[0].ncols())
    for matrix, factor in zip(matrices, factors, strict=True):
        if factor != 0:
            total = total + matrix * factor
    return total


def _pivots(a: fmpq_mat) -> list[int]:
    """Return the indices of columns that form a basis of the column space."""
    reduced, rank = a.rref()
    pivots: list[int] = []
    for j in range(a.ncols()):
        if len(pivots) < rank and reduced[len(pivots), j] != 0:
            pivots.append(j)
    return pivots


def _isomorphism(ad: Sequence[fmpq_mat], action: Sequence[fmpq_mat]) -> fmpq_mat | None:
    """Return an invertible matrix ι with D_x ι = ι ad_x for all elements x of a Lie algebra; None if there is none.

    ``ad`` has the adjoint matrices ad_x of the basis of the Lie algebra. ``action`` has the matrices D_x by which the
    basis acts on S, the module of symmetric elements.
    """
    m, d = len(ad), action[0].nrows()
    rows: list[fmpq] = []
    for weights in ([fmpq(1 + k % 3) for k in range(m)], [fmpq(1 - 2 * (k % 2) + k) for k in range(m)]):
        image, preimage = _combination(action, weights), _combination(ad, weights)
        for i in range(d):
            for j in range(m):
                row = [fmpq(0)] * (d * m)
                for k in range(d):
                    row[k * m + j] = row[k * m + j] + image[i, k]
                for k in range(m):
                    row[i * m + k] = row[i * m + k] - preimage[k, j]
                rows += row
    for vector in _kernel(fmpq_mat(2 * d * m, d * m, rows)):
        iota = fmpq_mat(d, m, vector)
        if d == m and iota.det() != 0:
            return iota
    return None


def _assembled(
    lie: LieAlgebra, module: _Module, left: Sequence[fmpq_mat], basis: fmpq_mat, inverse: fmpq_mat
) -> StarAlgebra:
    """Return the star algebra A = K ⊕ g ⊕ S ⊕ Z at the head of the file. ``left`` has the matrices of left
    multiplication by the basis elements of A.

    The rows of ``basis`` are a basis of the Lie algebra ``lie``: first elements that span g = [lie, lie], then one of
    the centre if there is a centre. ``inverse`` is the inverse of ``basis``.
    """
    field, size, simple, m = lie.field, module.size, len(module.ad), lie.dimension

    def vector(entries: Sequence[fmpq]) -> Vector:
        return {k: field.number(Fraction(int(v.p), int(v.q))) for k, v in enumerate(entries) if v != 0}

    table = {(i, j): vector([left[i][k, j] for k in range(size)]) for i in range(size) for j in range(size)}
    skew = {*range(1, 1 + simple), *([size - 1] if module.central else [])}
    star = [{k: -field.one if k in skew else field.one} for k in range(size)]
    # The basis of the star algebra consists of 1, a basis of [lie, lie], a basis of S, and z. In this basis, row k of
    # ``basis`` is the element with the index row_numbers[k].
    row_numbers = [*range(1, 1 + simple), *([size - 1] if m > simple else [])]
    elements = [{row_numbers[r]: v for r, v in vector([inverse[a, r] for r in range(m)]).items()} for a in range(m)]
    functional: list[Vector] = [{} for _ in range(size)]
    for r, row_number in enumerate(row_numbers):
        functional[row_number] = vector([basis[r, a] for a in range(m)])
    units = [{a: field.one} for a in range(m)]
    table = {position: row for position, row in table.items() if row}
    return StarAlgebra(field, size, table, star, {0: field.one}, elements, functional, elements, units)
