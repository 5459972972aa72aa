"""Flows of linear equations ẇ = Aw by matrices exp(tA) − 1 that are computed as numbers before the steps.

The entries of A are functions of parameters; A has at most `MOST_ROWS` rows. The coefficients of a linear motion may
also contain values that are constant along the flow but change from step to step, such as a coordinate of another part.
Each monomial with a value of this kind is then a further unknown: q̇ = p, ṗ = −q + f is linear in q, p and f, with f as
the third unknown.

Matrix exponentials are computed by scaling and squaring. The number s is so large that ‖A/2^s‖ ≤ 1/2. The Padé
approximant of order 6 for exp(A/2^s) − 1 is F = 2(V − U)⁻¹U. V is the even part and U the odd part of the numerator.
The map F ↦ 2F + F² takes exp(A) − 1 to exp(2A) − 1, and preserves all digits for small A.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from hashlib import blake2b

from phigen.splitting.closure import LinearMotion
from phigen.splitting.ring import TIME, Monomial, Ring
from phigen.symbolic.expression import Expression, symbol, total
from phigen.symbolic.symbols import EXPONENTIAL, Symbol
from phigen.symbolic.tower import Poly

#: MOST_ROWS: the largest number of rows of the matrix A of linear equations; each step multiplies a vector by the whole
#: matrix. MOST_DEGREE: the largest degree of a monomial that is an unknown of the equations.
MOST_ROWS, MOST_DEGREE = 64, 8

#: PADE: the coefficients of the numerator of the Padé approximant of order 6 for exp. MAX_PADE_NORM: the largest norm
#: of a matrix for which the approximant is used. The error of the approximant is then at most 2·10⁻¹⁷.
PADE = tuple(Fraction(1, n) * m for m, n in ((1, 1), (1, 2), (5, 44), (1, 66), (1, 792), (1, 15840), (1, 665280)))
MAX_PADE_NORM = 0.5


@dataclass(frozen=True)
class MatrixExponential:
    """The matrix exp(tA) − 1, which is computed before the steps; ``rates`` are the entries of A, row by row."""

    rates: tuple[Expression, ...]

    @property
    def size(self) -> int:
        """The number of rows of the matrix."""
        return next(n for n in range(1, 1 + len(self.rates)) if n * n == len(self.rates))

    @property
    def exponents(self) -> list[Expression]:
        """The entries of the matrix tA, row by row."""
        return [symbol(TIME) * e for e in self.rates]

    @property
    def symbols(self) -> list[Symbol]:
        """The symbols of the entries of exp(tA) − 1, row by row; equal matrices A have equal symbols."""
        key = blake2b(b"|".join(e.digest for e in self.rates), digest_size=8).hexdigest()
        return [Symbol(EXPONENTIAL, key, k) for k in range(len(self.rates))]

    @cached_property
    def reached(self) -> list[set[int]]:
        """For each row of exp(tA) − 1, the columns whose entries may be nonzero, by the pattern of zeros of A."""
        n = range(self.size)
        columns = [{j for j in n if not self.rates[i * self.size + j].is_zero} for i in n]
        while True:
            wider = [set.union(row, *(columns[k] for k in row)) for row in columns]
            if wider == columns:
                return columns
            columns = wider

    def slopes(self, *, last: bool = False) -> dict[str, Expression]:
        """Return a dictionary: symbol of an entry of exp(tA) − 1 → time derivative of this entry. The matrix of these
        derivatives is written as A exp(tA), or as exp(tA) A if ``last``.
        """
        n, entries = self.size, self.symbols
        rates: dict[str, Expression] = {}
        for k, name in enumerate(entries):
            i, j = divmod(k, n)
            if last:
                terms = [symbol(entries[i * n + m]) * self.rates[m * n + j] for m in sorted(self.reached[i])]
            else:
                terms = [self.rates[i * n + m] * symbol(entries[m * n + j]) for m in range(n) if j in self.reached[m]]
            rates[name] = total([self.rates[k], *(e for e in terms if not e.is_zero)])
        return rates


@dataclass(frozen=True)
class StaticSolution:
    """The increments of the coordinates of a linear motion. In ``increments``, symbols stand for the entries of the
    matrix ``exponential``.
    """

    increments: tuple[Expression, ...]
    exponential: MatrixExponential


def solve(ring: Ring, motion: LinearMotion) -> StaticSolution | None:
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw, if A can be computed before the steps; else
    None.
    """
    rows = _static_rows(ring, motion)
    if rows is None:
        return None
    first = motion.basis[: len(motion.coordinates)]
    basis = [*first, *(m for m in rows if m not in first)]
    zero = ring.tower.zero
    exponential = MatrixExponential(tuple(ring.expression(rows[m].get(k, zero)) for m in basis for k in basis))
    n, names, reached = len(basis), exponential.symbols, exponential.reached
    w = [ring.expression(ring.monomial(m)) for m in basis]
    increments = [
        total(symbol(names[i * n + j]) * w[j] for j in range(n) if j in reached[i])
        for i in range(len(motion.coordinates))
    ]
    return StaticSolution(tuple(increments), exponential)


def _static_rows(ring: Ring, motion: LinearMotion) -> dict[Monomial, dict[Monomial, Poly]] | None:
    """Return linear differential equations whose coefficients depend on parameters only. The equation ż = Σ c_k z_k is
    the entry z → (z_k → c_k) of the result.

    The unknowns z are products of the monomials of the motion with values that are constant along the flow. Returns
    None if the number or the degree of the unknowns exceeds the limits.
    """
    matrix = {
        m: {k: c for k, c in zip(motion.basis, row, strict=True) if c != 0}
        for m, row in zip(motion.basis, motion.matrix, strict=True)
    }
    constant_monomial = (0,) * len(motion.basis[0])
    pending = [(constant_monomial, m) for m in reversed(motion.basis[: len(motion.coordinates)])]
    rows: dict[Monomial, dict[Monomial, Poly]] = {}
    while pending:
        factor, m = pending.pop()
        unknown = _times(factor, m)
        if unknown in rows:
            continue
        if len(rows) == MOST_ROWS or sum(unknown) > MOST_DEGREE:
            return None
        row: dict[Monomial, list[Poly]] = {}
        for k, coefficient in matrix[m].items():
            for constant, c in ring.terms(coefficient, ring.changing).items():
                row.setdefault(_times(_times(factor, constant), k), []).append(c)
                pending.append((_times(factor, constant), k))
        rows[unknown] = {k: ring.tower.combine(c) for k, c in row.items()}
    return rows


def _times(a: Monomial, b: Monomial) -> Monomial:
    return tuple(x + y for x, y in zip(a, b, strict=True))
