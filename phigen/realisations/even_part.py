"""The even part of b(M_p)x − x, with b(z) = z/(1 − e^{−z}), in closed form.

On the dual of a Lie algebra, M = M_p is the matrix with M_p x = π(x)p. The even part is Σ_{k≥1} B_{2k}/(2k)! M^{2k} x
with Bernoulli numbers B. Let N = M², and let φ be the function of `phigen.symbolic.special`. Then the even part is
Nφ(−N)x. It has these closed forms:

    N^k x = 0 for some k     a finite sum
    N(N + s) = 0             N x φ(s)
    N(N + s)² = 0            N (φ(s) x − φ'(s)(N + s) x)

In the last case φ(−N) = φ(s) − φ'(s)(N + s) plus terms with the factor (N + s)², whose product with N is 0. The number
s is a quadratic polynomial in p. For so(3), where Nx = p×(p×x), it is |p|²; for sl(2), 4 det P with the 2×2 matrix P of
p; for se(3), the squared length of the rotation part of p. If −s is the only nonzero eigenvalue of N, and m its
multiplicity, then s = −tr N/m. So s follows from the structure constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

from flint import fmpq, fmpq_mat

from phigen.geometry.ideals import applied, ideal_projections
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.representations import indecomposable_parts, restricted
from phigen.symbolic.expression import ZERO, Expression, call, number, substitute, symbol, symbols_of, total
from phigen.symbolic.numeric import DomainError, evaluate_exactly
from phigen.symbolic.special import coefficient
from phigen.symbolic.symbols import plain
from phigen.symbolic.tower import Poly, Tower
from phigen.symbolic.verdict import sample_point

Vector = list[Expression]


@dataclass(frozen=True)
class EvenPart:
    """The even part of b(M_p)x − x, with b(z) = z/(1 − e^{−z}) and M_p x = π(x)p, in closed form.

    ``values`` are the components of Σ_{k≥1} B_{2k}/(2k)! M_p^{2k} x, with Bernoulli numbers B. ``forms`` describes, for
    the user, the closed form in each ideal of the algebra.
    """

    values: tuple[Expression, ...]
    forms: tuple[str, ...]


def even_part(algebra: LieAlgebra, x: Sequence[Expression], p: Sequence[Expression]) -> EvenPart | None:
    """Return the even part of b(M_p)x − x with b(z) = z/(1 − e^{−z}) in closed form; None if no formula here
    applies.

    The vector x is in the dual of the algebra, p is in the algebra, and M_p x = π(x)p. The components of x and p may be
    any expressions; for a central extension, some are constants. Each summand of a direct sum of algebras has its own
    closed form.
    """
    values: Vector = [ZERO] * algebra.dimension
    forms: list[str] = []
    for part in _parts(algebra):
        ideal = restricted(algebra, part)
        closed = _of_ideal(ideal, [x[i] for i in part], [p[i] for i in part])
        if closed is None:
            return None
        for i, value in zip(part, closed.values, strict=True):
            values[i] = value
        forms += closed.forms
    return EvenPart(tuple(values), tuple(forms))


def _parts(algebra: LieAlgebra) -> list[list[int]]:
    """Return ideals of the algebra that commute with each other. An ideal is a list of indices of basis elements that
    span it.

    Each basis element that has nonzero brackets is in exactly one ideal. An ideal also contains the central basis
    elements that occur in its brackets. So two ideals may share a central element, such as the element that a central
    extension adds. All other central basis elements are left out, since π does not depend on them.
    """
    touching = {m for ij in algebra.constants for m in ij}
    inner = {ij: {k: c for k, c in row.items() if k in touching} for ij, row in sorted(algebra.constants.items())}
    parts = indecomposable_parts(LieAlgebra(algebra.name, algebra.dimension, inner))
    outer = [{k for (i, _), row in algebra.constants.items() if i in part for k in row} for part in parts]
    return [sorted({*part, *added}) for part, added in zip(parts, outer, strict=True) if part[0] in touching]


def _of_ideal(ideal: LieAlgebra, x: Vector, p: Vector) -> EvenPart | None:
    """Return the even part of b(M_p)x − x in closed form, for an ideal that is spanned by basis elements (see
    `even_part`).

    If there is no closed form for the whole ideal, the closed forms for its direct summands are added. The direct
    summands need not be spanned by basis elements. Returns None if one of them has no closed form.
    """
    closed = _closed(ideal, x, p)
    if closed is not None:
        return closed
    projections = ideal_projections(ideal)
    if len(projections) < 2:
        return None
    # Let M_p be the matrix with M_p x = π(x)p, and e_a the projections onto the direct summands of the ideal. Then M_p
    # = Σ M_{e_a p}, and M_{e_a p} M_{e_b p} = 0 for a ≠ b.
    summands = [_closed(ideal, x, applied(e, p, ZERO)) for e in projections]
    closed_summands = [s for s in summands if s is not None]
    if len(closed_summands) < len(summands):
        return None
    values = tuple(total(column) for column in zip(*(s.values for s in closed_summands), strict=True))
    return EvenPart(values, tuple(form for s in closed_summands for form in s.forms))


def matrix_of(algebra: LieAlgebra, p: Sequence[Expression]) -> list[Vector]:
    """Return the matrix M_p with M_p x = π(x)p: its entry (i, k) is Σ_j c_ij^k p_j."""
    n = range(algebra.dimension)
    terms: list[list[list[Expression]]] = [[[] for _ in n] for _ in n]
    for i in n:
        for j in n:
            for k, c in algebra.bracket(i, j).items() if not p[j].is_zero else ():
                terms[i][k].append(c * p[j])
    return [[total(entry) for entry in row] for row in terms]


def times(matrix: Sequence[Sequence[Expression]], vector: Sequence[Expression]) -> Vector:
    """Return the product of a matrix and a vector, without zero terms."""
    return [total(m * v for m, v in zip(row, vector, strict=True) if not (m.is_zero or v.is_zero)) for row in matrix]


def _closed(algebra: LieAlgebra, x: Vector, p: Vector) -> EvenPart | None:
    matrix = matrix_of(algebra, p)
    flat = [m for row in matrix for m in row]
    tower = Tower(symbols_of(*flat, *x), [*flat, *x])
    if all(tower.is_zero(m) for m in tower.convert_all(flat)):
        return EvenPart(tuple([ZERO] * len(x)), ())
    s = _root(tower, matrix)
    if s is None:
        return None
    if tower.is_zero(s):
        return _nilpotent(tower, matrix, x)
    return _semisimple(tower, matrix, x, s)


def _root(tower: Tower, matrix: Sequence[Vector]) -> Poly | None:
    """Return a polynomial s in p such that 0 and −s may be the only eigenvalues of M², where M is the ``matrix``.

    s is computed from the traces of M² and M⁴. Returns None if the traces exclude such an s. Otherwise the caller must
    prove that s has this property.
    """
    n = range(len(matrix))
    if not _may_have_root(matrix):
        return None
    flat = tower.convert_all([m for row in matrix for m in row])
    m = [flat[i * len(matrix) : (i + 1) * len(matrix)] for i in n]
    square = [[tower.combine(m[i][k] * m[k][j] for k in n if m[i][k] != 0 and m[k][j] != 0) for j in n] for i in n]
    trace = tower.combine(square[i][i] for i in n)
    of_square = tower.combine(square[i][j] * square[j][i] for i in n for j in n)
    for multiplicity in range(1, len(matrix) + 1):
        if tower.is_zero(of_square * multiplicity - trace * trace):
            return trace * tower.constant(Fraction(-1, multiplicity))
    return None


def _may_have_root(matrix: Sequence[Vector]) -> bool:
    """Whether (tr M²)² = k tr M⁴ for some k = 1, …, n at a sample point, where n is the number of rows of M.

    The equation holds if M² has a single nonzero eigenvalue, whose multiplicity is k. This test comes before the
    symbolic one, since symbolic squares of large matrices take long.
    """
    flat, n = [e for row in matrix for e in row], len(matrix)
    try:
        values = evaluate_exactly(flat, sample_point(symbols_of(*flat), (), 0))
    except DomainError:
        return True
    square = fmpq_mat(n, n, [fmpq(v.numerator, v.denominator) for v in values]) ** 2
    trace, of_square = (sum(m[i, i] for i in range(n)) for m in (square, square * square))
    return any(of_square * m == trace * trace for m in range(1, n + 1))


def _nilpotent(tower: Tower, matrix: Sequence[Vector], x: Vector) -> EvenPart | None:
    terms: list[Vector] = []
    power = times(matrix, x)
    for k in range(len(matrix)):
        power = times(matrix, power)
        if k % 2 == 0:  # here power = N^{k/2+1} x with N = M²
            if _vanish(tower, power):
                break
            terms.append([number((-1) ** (k // 2) * coefficient(0, k // 2)) * v for v in power])
    else:
        return None
    form = f"a finite sum of {len(terms) + 1} terms" if terms else "no even part"
    values = tuple(total(column) for column in zip(*terms, strict=True)) if terms else (ZERO,) * len(x)
    return EvenPart(values, (f"nilpotent, {form}",))


def _semisimple(tower: Tower, matrix: Sequence[Vector], x: Vector, root: Poly) -> EvenPart | None:
    s = tower.expression(root)
    first = times(matrix, times(matrix, x))  # N x with N = M²
    residual = [a + s * b for a, b in zip(times(matrix, times(matrix, first)), first, strict=True)]  # (N + s) N x
    simplest = f"φ(s), s = {_shown(s)}"
    if _vanish(tower, residual):
        return EvenPart(tuple(call("phi0", s) * v for v in first), (f"M⁴ = −s M², hence {simplest}",))
    last = [a + s * b for a, b in zip(times(matrix, times(matrix, residual)), residual, strict=True)]
    if not _vanish(tower, last):
        return None
    values = tuple(call("phi0", s) * v - call("phi1", s) * w for v, w in zip(first, residual, strict=True))
    return EvenPart(values, (f"M²(M² + s)² = 0, hence φ(s) and φ'(s), s = {_shown(s)}",))


def _vanish(tower: Tower, vector: Sequence[Expression]) -> bool:
    with suppress(DomainError):  # A test at a point comes first: the expansion of a nonzero element may be too large.
        if any(evaluate_exactly(vector, sample_point(symbols_of(*vector), (), 0))):
            return False
    return all(tower.is_zero(v) for v in tower.convert_all(vector))


def _shown(s: Expression) -> str:
    formula = str(substitute([s], {name: symbol(plain(name)) for name in symbols_of(s)})[0])
    return formula if len(formula) < 60 else "a quadratic form in p"
