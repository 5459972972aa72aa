"""The named Lie algebras of specs, for every size: basis, order of the basis, and faithful real matrices.

E_ij is the matrix with a single 1, in row i and column j. The table has the bases E_1, E_2, … of the algebras. Let
[E_i, E_j] = Σ c_ij^k E_k. With ``sign: plus``, {x_i, x_j} = Σ c_ij^k x_k; ``sign: minus`` negates all brackets.

================ ============================================================================================
so(3)            L_1, L_2, L_3 with [L_1, L_2] = L_3 and cyclic (L_k v = e_k × v). The free rigid body in the
                 body frame, {x_1, x_2} = −x_3, is ``sign: minus``.
so(n), n ≠ 3     E_ij − E_ji for i < j in the order 12, 13, 14, …, 23, 24, …; [12, 13] = −23, [12, 23] = 13
se(2)            J, T_1, T_2 with [J, T_1] = T_2, [J, T_2] = −T_1
se(3)            L_1, L_2, L_3, T_1, T_2, T_3 with [L_1, L_2] = L_3, [L_1, T_2] = T_3 and cyclic. Heavy tops in
                 the body frame (angular momentum, direction of gravity) are ``sign: minus``.
se(n), n > 3     the basis of so(n), then T_1 … T_n
sl(n)            H_i = E_ii − E_{i+1,i+1}, then E_ij with i < j, then E_ij with i > j, row by row;
                 sl(2) is H, E, F with [H, E] = 2E, [H, F] = −2F, [E, F] = H
gl(n)            E_11, E_12, …, row by row
su(2)            −iσ_1/2, −iσ_2/2, −iσ_3/2 with [e_1, e_2] = e_3 and cyclic
su(n), n > 2     E_ij − E_ji (i < j), i(E_ij + E_ji) (i < j), i(E_kk − E_{k+1,k+1}); as real 2n×2n matrices
sp(2n)           matrices (A B; C −Aᵀ), B and C symmetric: first those with A = E_ij, row by row; then those with
                 B = E_ij + E_ji (i < j) or B = E_ii, in the order 11, 12, …, 22, …; then the same for C
heisenberg(n)    q_1 … q_n, p_1 … p_n, z with [q_i, p_i] = z
aff(1)           a, b with [a, b] = b; aff(n) is gl(n), then the translations of Rⁿ
================ ============================================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.matrix_algebras import algebra_of_sparse_matrices
from phigen.spec.names import FAMILIES
from phigen.symbolic.expression import number

#: Sparse matrix: (row, column), both from 0, → nonzero entry.
Entries = dict[tuple[int, int], Fraction]


def _unit(i: int, j: int, value: int = 1) -> Entries:
    return {(i, j): Fraction(value)}


def _upper(n: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(n) for j in range(i + 1, n)]


def _all(n: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(n) for j in range(n)]


def _rotations(n: int) -> list[Entries]:
    if n == 2:
        return [_unit(1, 0) | _unit(0, 1, -1)]
    if n == 3:
        return [_unit(2, 1) | _unit(1, 2, -1), _unit(0, 2) | _unit(2, 0, -1), _unit(1, 0) | _unit(0, 1, -1)]
    return [_unit(i, j) | _unit(j, i, -1) for i, j in _upper(n)]


def _so(n: int) -> tuple[int, list[Entries]]:
    return n, _rotations(n)


def _se(n: int) -> tuple[int, list[Entries]]:
    return n + 1, _rotations(n) + [_unit(i, n) for i in range(n)]


def _sl(n: int) -> tuple[int, list[Entries]]:
    diagonal = [_unit(i, i) | _unit(i + 1, i + 1, -1) for i in range(n - 1)]
    lower_positions = [(i, j) for i, j in _all(n) if i > j]
    return n, diagonal + [_unit(i, j) for i, j in _upper(n) + lower_positions]


def _gl(n: int) -> tuple[int, list[Entries]]:
    return n, [_unit(i, j) for i, j in _all(n)]


def _su(n: int) -> tuple[int, list[Entries]]:
    real = [_unit(i, j) | _unit(j, i, -1) for i, j in _upper(n)]
    imaginary = [_unit(i, j) | _unit(j, i) for i, j in _upper(n)]
    imaginary += [_unit(k, k) | _unit(k + 1, k + 1, -1) for k in range(n - 1)]
    basis = [_complexified(m, {}) for m in real] + [_complexified({}, m) for m in imaginary]
    if n == 2:  # basis −iσ_1/2, −iσ_2/2, −iσ_3/2 with the Pauli matrices σ
        basis = [{position: -v / 2 for position, v in m.items()} for m in (basis[1], basis[0], basis[2])]
    return 2 * n, basis


def _complexified(real: Entries, imaginary: Entries) -> Entries:
    """Return the real 2n×2n matrix that represents the complex n×n matrix a + ib.

    Each complex entry becomes a 2×2 block (a −b; b a). So rows and columns alternate between real and imaginary parts.
    """
    real_entries = {}
    for (i, j), v in real.items():
        real_entries[2 * i, 2 * j] = real_entries[2 * i + 1, 2 * j + 1] = v
    for (i, j), v in imaginary.items():
        real_entries[2 * i, 2 * j + 1], real_entries[2 * i + 1, 2 * j] = -v, v
    return real_entries


def _sp(size: int) -> tuple[int, list[Entries]]:
    n = size // 2
    symmetric = [(i, j) for i in range(n) for j in range(i, n)]
    basis = [_unit(i, j) | _unit(n + j, n + i, -1) for i, j in _all(n)]
    basis += [_unit(i, n + j) | _unit(j, n + i) for i, j in symmetric]
    basis += [_unit(n + i, j) | _unit(n + j, i) for i, j in symmetric]
    return size, basis


def _heisenberg(n: int) -> tuple[int, list[Entries]]:
    q, p = [_unit(0, i + 1) for i in range(n)], [_unit(i + 1, n + 1) for i in range(n)]
    return n + 2, [*q, *p, _unit(0, n + 1)]


def _aff(n: int) -> tuple[int, list[Entries]]:
    return n + 1, [_unit(i, j) for i, j in _all(n)] + [_unit(i, n) for i in range(n)]


#: For each family, a function of the size n. It returns the number of rows of a basis matrix, and a list of the basis
#: matrices.
_BASES: dict[str, Callable[[int], tuple[int, list[Entries]]]] = {
    "so": _so, "se": _se, "sl": _sl, "gl": _gl, "su": _su, "sp": _sp, "heisenberg": _heisenberg, "aff": _aff,
}  # fmt: skip


def dimension(family: str, size: int) -> int:
    """Return the dimension of the Lie algebra with this family and size, such as so(4).

    Raises `SpecError` for an unknown family, and for a size that the family does not have.
    """
    if family not in FAMILIES:
        families = ", ".join(f"{name}(n)" for name in FAMILIES)
        raise SpecError([Diagnostic(f"unknown Lie algebra {family}({size})", hint=f"known families: {families}")])
    smallest, dimension_of = FAMILIES[family]
    if size < smallest:
        raise SpecError([Diagnostic(f"{family}({size}) does not exist: its size is at least {smallest}")])
    if family == "sp" and size % 2:
        raise SpecError([Diagnostic(f"sp({size}): the size of the matrices must be even: sp(2), sp(4), …")])
    return dimension_of(size)


def named(family: str, size: int) -> LieAlgebra:
    """Return the Lie algebra with this family and size, such as so(4), with its defining matrices.

    Raises the errors of `dimension`.
    """
    dimension(family, size)
    matrix_size, basis = _BASES[family](size)
    matrices = [{position: number(v) for position, v in sorted(m.items())} for m in basis]
    return algebra_of_sparse_matrices(f"{family}({size})", matrix_size, matrices)


def families_of_dimension(dimension: int) -> list[tuple[str, int]]:
    """Return the pairs (family, size) of all named Lie algebras with this dimension."""
    families = []
    for name, (smallest, dimension_of) in FAMILIES.items():
        step = 2 if name == "sp" else 1
        size = smallest
        while dimension_of(size) < dimension:
            size += step
        if dimension_of(size) == dimension:
            families.append((name, size))
    return families
