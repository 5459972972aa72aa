"""Group elements that are matrices, minus 1: exp(P) and the Cayley transform of P = Σ p_i E_i, as formulas without
loops. The E_i are the basis matrices of the Lie algebra.

By the theorem of Cayley and Hamilton, Pᴺ = Σ_{j<N} q_j Pʲ for a matrix with N rows. So all powers of P, and the series
of exp, are combinations of 1, P, …, P^{N−1}. The scalar factors of these combinations satisfy a recurrence. Computing
P², …, P^{N−1} takes N − 2 products of matrices. Up to signs, the q_j are the elementary symmetric functions of the
eigenvalues. Newton's identities give them from the traces of powers of P.

In flows of a splitting, most P generate a rotation in a plane, or a shift. Then P³ = −sP with a number s, and exp(P) =
1 + sin(√s)/√s P + (1 − cos √s)/s P².
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import combinations
from math import factorial, isqrt

from phigen.attitude.group import Dense, Group
from phigen.symbolic.expression import ONE, ZERO, Expression, call, number, total
from phigen.symbolic.verdict import PROVED, decide_zero

#: Degree of the Taylor polynomial that replaces exp(P) for a matrix P. The polynomial is accurate to double precision
#: if all eigenvalues λ of P have |λ| ≤ 1/2.
EXPONENTIAL_DEGREE = 14

_HALF = number(Fraction(1, 2))

Flat = list[Expression]


def size_of(group: Group, p: Sequence[Expression]) -> Expression:
    """Return an upper bound for the squared modulus of the largest eigenvalue of P = Σ p_i E_i.

    The bound is the sum of the squares of all entries of P or, if all E_i are skew, half of this sum.
    """
    squares = total(e**2 for e in group.generator(p))
    return _HALF * squares if group.orthogonal else squares


def exponential(group: Group, p: Sequence[Expression]) -> Flat:
    """Return the entries of exp(P) − 1 for P = Σ p_i E_i. They are computed by a series that is accurate if `size_of`
    is at most 1/4.
    """
    powers, (first, *recurrence) = _powers(group, p), [*_symmetric(group, p)]
    assert first is ONE
    rows = len(powers) + 1
    # the coefficients in the theorem of Cayley and Hamilton: P^rows = Σ last_j P^j
    last = [e if (rows - j) % 2 else -ONE * e for j, e in enumerate(reversed(recurrence))]
    factors = [number(Fraction(1, factorial(j))) if j else ZERO for j in range(rows)]
    power = [ZERO] * (rows - 1) + [ONE]
    for k in range(rows, EXPONENTIAL_DEGREE + 1):
        power = [a + power[-1] * b for a, b in zip([ZERO, *power[:-1]], last, strict=True)]
        factors = [f + number(Fraction(1, factorial(k))) * a for f, a in zip(factors, power, strict=True)]
    return _combined(factors, powers)


def cayley(group: Group, p: Sequence[Expression]) -> Flat:
    """Return the entries of the matrix (1 − P/2)⁻¹(1 + P/2) − 1 = (1 − P/2)⁻¹P: the Cayley transform, minus 1, of P = Σ
    p_i E_i.

    Let A = P/2, with N rows, and let e_i be the elementary symmetric functions of its eigenvalues. Then (1 − A)⁻¹
    Σ(−1)ⁱe_i = Σ_k A^k Σ_{i < N−k} (−1)ⁱe_i.
    """
    half = [_HALF * e for e in p]
    powers, symmetric = _powers(group, half), [*_symmetric(group, half)]
    rows = len(powers) + 1
    signed = [e if i % 2 == 0 else -ONE * e for i, e in enumerate(symmetric)]
    per = ONE / total(signed)
    # The result is 2((1 − A)⁻¹ − 1). By the formula of the docstring, it is 2/Σ(−1)ⁱe_i times a combination of 1, A,
    # A², … ``sums`` has the coefficients of the combination; the first one is −(−1)ᴺe_N.
    sums = [-ONE * signed[rows], *(total(signed[: rows - k]) for k in range(1, rows))]
    return [2 * per * e for e in _combined(sums, powers)]


def _powers(group: Group, p: Sequence[Expression]) -> list[Flat]:
    """Return P, P², …, P^{N−1} for the matrix P = Σ p_i E_i with N rows."""
    rows = group.rows
    powers = [group.generator(p)]
    while len(powers) < rows - 1:
        powers.append(multiplied(powers[-1], powers[0]))
    return powers


def _symmetric(group: Group, p: Sequence[Expression]) -> Iterator[Expression]:
    """Yield the elementary symmetric functions e_0 = 1, e_1, … of the eigenvalues of P = Σ p_i E_i; the last is det P.

    If all E_i are skew, the functions of odd degree are 0.
    """
    powers = _powers(group, p)
    rows = len(powers) + 1
    traces = [ZERO, *(_trace(m, rows) for m in powers), _trace_of_product(powers[-1], powers[0], rows)]
    symmetric = [ONE]
    for k in range(1, rows + 1):
        if group.orthogonal and k % 2:
            symmetric.append(ZERO)
            continue
        signed = [(symmetric[k - i] * traces[i], i) for i in range(1, k + 1) if not (group.orthogonal and i % 2)]
        symmetric.append(total(a if i % 2 else -ONE * a for a, i in signed) / k)
    yield from symmetric


def _trace(matrix: Flat, rows: int) -> Expression:
    return total(matrix[:: rows + 1])


def _trace_of_product(a: Flat, b: Flat, rows: int) -> Expression:
    return total(a[i * rows + j] * b[j * rows + i] for i in range(rows) for j in range(rows))


def _combined(factors: Sequence[Expression], powers: Sequence[Flat]) -> Flat:
    """Return the entries of factors_0 · 1 + Σ factors_k P^k, row by row, from the ``powers`` P, P², …."""
    rows = len(powers) + 1
    return [
        total([factors[0]] * (i % (rows + 1) == 0) + [f * m[i] for f, m in zip(factors[1:], powers, strict=True)])
        for i in range(rows**2)
    ]


def multiplied(a: Sequence[Expression], b: Sequence[Expression]) -> Flat:
    """Return the product of two square matrices; the arguments and the result are lists of entries, row by row."""
    n = isqrt(len(a))
    return [total(a[i * n + k] * b[k * n + j] for k in range(n)) for i in range(n) for j in range(n)]


def flow_exponential(group: Group, p: Sequence[Expression], positive: Sequence[str]) -> Flat | None:
    """Return the entries of exp(P) − 1 for P = Σ p_i E_i in closed form; None if phigen knows no closed form.

    A closed form is known if P³ = −sP with a number or an expression s, and for sums of commuting matrices of this
    kind.
    """
    basis = [(pi, m) for pi, m in zip(p, group.matrices, strict=True) if not pi.is_zero]
    ratios = [_ratio(m) for _, m in basis]
    if all(r is not None for r in ratios) and all(_commute(a, b) for (_, a), (_, b) in combinations(basis, 2)):
        exponentials = [_of_constant(pi, m, r) for (pi, m), r in zip(basis, ratios, strict=True) if r is not None]
    else:
        plane_exponential = _of_plane(group.generator(p), positive)
        exponentials = [] if plane_exponential is None else [plane_exponential]
    result: Flat | None = None
    for e in exponentials:
        result = e if result is None else product_less_1(result, e)
    return result


def product_less_1(a: Sequence[Expression], b: Sequence[Expression]) -> Flat:
    """Return the entries of (1 + A)(1 + B) − 1 without cancellation, from those of A and B."""
    return [x + y + z for x, y, z in zip(a, b, multiplied(a, b), strict=True)]


def _ratio(matrix: Dense) -> Fraction | None:
    """Return the number s with E³ = −sE for a matrix E of numbers; None if there is no such s."""
    e = [x for row in matrix for x in row]
    cube = multiplied(multiplied(e, e), e)
    if not all(x.is_number for x in (*e, *cube)):
        return None
    values = [(Fraction(x.value), Fraction(c.value)) for x, c in zip(e, cube, strict=True)]
    s = next(-c / x for x, c in values if x)
    return s if all(c == -s * x for x, c in values) else None


def _commute(a: Dense, b: Dense) -> bool:
    first, second = ([x for row in m for x in row] for m in (a, b))
    return all((x - y).is_zero for x, y in zip(multiplied(first, second), multiplied(second, first), strict=True))


def _of_constant(p: Expression, matrix: Dense, s: Fraction) -> Flat:
    """Return the entries of exp(pE) − 1 for a matrix E of numbers with E³ = −sE.

    If s is the square of a rational number, sin and cos of √s p are used.
    """
    e = [x for row in matrix for x in row]
    root = Fraction(isqrt(s.numerator), isqrt(s.denominator)) if s > 0 else Fraction(0)
    if s > 0 and root**2 == s:
        angle = number(root) * p
        sine_factor, versine_factor = call("sin", angle) / number(root), call("versin", angle) / number(s)
    else:
        sine_factor, versine_factor = _along_and_across(number(s) * p**2)
        sine_factor, versine_factor = sine_factor * p, versine_factor * p**2
    return [sine_factor * a + versine_factor * b for a, b in zip(e, multiplied(e, e), strict=True)]


def _of_plane(generator: Flat, positive: Sequence[str]) -> Flat | None:
    """Return the entries of exp(P) − 1 if P³ = −sP for s = 0, s = −tr P² or s = −tr P²/2; None for other P."""
    square = multiplied(generator, generator)
    cube, trace = multiplied(square, generator), _trace(square, isqrt(len(square)))
    for s in (-_HALF * trace, -ONE * trace, ZERO):
        residuals = [("", a + s * b) for a, b in zip(cube, generator, strict=True)]
        if decide_zero("", residuals, positive).verdict == PROVED:
            sine_factor, versine_factor = _along_and_across(s)
            return [sine_factor * a + versine_factor * b for a, b in zip(generator, square, strict=True)]
    return None


def _along_and_across(s: Expression) -> tuple[Expression, Expression]:
    """Return sin(√s)/√s and (1 − cos √s)/s, the factors of P and P² in exp(P) − 1 for P³ = −sP."""
    return call("sinroot", s), _HALF * call("sinroot", s / 4) ** 2
