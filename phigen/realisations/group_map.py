"""Bi-realisation of a linear π by a map τ from the Lie algebra to its group. The spec states τ.

Let the matrices E_i be a basis of the algebra. τ is a function of P = Σ p_i E_i, or of the p_i, and agrees with e^P to
first order at p = 0. Its right and left trivialised derivatives R and L are defined by (∂τ/∂p_j) τ⁻¹ = Σ_k R_kj E_k and
τ⁻¹ ∂τ/∂p_j = Σ_k L_kj E_k. Then

    β = R^{−T} x,    α = L^{−T} x.

Column i of R⁻¹ solves Σ_j (∂τ/∂p_j) (R⁻¹)_ji = E_i τ. Column i of L⁻¹ solves the same equation with τ E_i on the
right-hand side. The bi-realisation is symmetric if and only if τ(−p) = τ(p)⁻¹. For τ = (1 − P/2)⁻¹(1 + P/2) it equals
the bi-realisation of the kind ``cayley``.
"""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.field import Field, Scalar
from phigen.geometry.lie_algebra import LieAlgebra, Representation
from phigen.geometry.representations import candidates
from phigen.geometry.shapes import LiePoisson
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.matrix_function import Matrix, MatrixFunction, identity, multiplied
from phigen.realisations.protocol import (
    PAPER,
    BiRealisation,
    covector_names,
    covector_symbols,
    is_symmetric,
    refuse,
    simplified_differences,
)
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ZERO, Expression, derivatives, substitute, symbol, total
from phigen.symbolic.readable import shortened
from phigen.symbolic.symbols import MATRIX
from phigen.symbolic.verdict import decide_zero

KIND = "group-map"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the bi-realisation of a linear π by the map τ in ``choice.tau``.

    τ is a rational function of the symbol `MATRIX`, or a matrix of expressions in the symbols ``p:NAME``. Raises
    `SpecError` if π is not linear, if no faithful matrices are known, if τ(0) is not 1 or dτ(0) not the identity, and
    if the derivative of τ is not in the algebra.
    """
    if not isinstance(system.shape, LiePoisson):
        raise refuse(f"birealisation {KIND} needs a linear π, the dual of a Lie algebra; this π is {system.shape}")
    if choice.tau is None:
        raise refuse(f"birealisation {KIND} needs tau", "tau: (1 + P/2)/(1 - P/2), or a matrix in p_NAME")
    representation = _representation(system.shape.algebra)
    tau = _matrix(system, representation, choice.tau)
    _expect_tangent(system, representation, tau)
    inverse = _Trivialised(system, representation, tau)
    x = [symbol(c) for c in system.coordinates]
    beta, alpha = (
        tuple(total(xj * row[i] for xj, row in zip(x, rows, strict=True)) for i in range(len(x)))
        for rows in (inverse.solved(left=True), inverse.solved(left=False))
    )
    symmetric = is_symmetric(alpha, beta, system.coordinates)
    flow = hamiltonian_vector_field(system.poisson, covector_symbols(system.coordinates))
    difference = simplified_differences(beta, alpha)
    flow_statement = decide_zero("β − α = πp", [("", d - f) for d, f in zip(difference, flow, strict=True)])
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        simplified_differences(alpha, x),
        flow if flow_statement.verdict == "proved" else difference,
        symmetric,
        explanation=f"π is linear: the map τ that the spec gives, with {representation.name}; "
        + ("symmetric" if symmetric else "not symmetric, so order k takes S_1 … S_k"),
        reference=f"{PAPER}, the proposition on Lie–Poisson structures; τ given in the spec",
    )


def _representation(algebra: LieAlgebra) -> Representation:
    representation = algebra.representation or next(candidates(algebra), None)
    if representation is None:
        raise refuse(
            f"birealisation {KIND}: no faithful matrices of {algebra.name} are known",
            "give them as lie_algebra: {matrices: […]}",
        )
    return representation


def _dense(representation: Representation) -> list[Matrix]:
    n = range(representation.size)
    return [[[m.get((r, c), ZERO) for c in n] for r in n] for m in representation.matrices]


def _matrix(system: System, representation: Representation, tau: Expression | Sequence[Sequence[Expression]]) -> Matrix:
    """Return the map τ of the spec as a matrix of expressions in the components of p.

    A function of the symbol `MATRIX` is evaluated at P = Σ p_i E_i. Raises `SpecError` for a matrix of the wrong size.
    """
    size = representation.size
    if not isinstance(tau, Expression):
        if len(tau) != size or any(len(row) != size for row in tau):
            raise refuse(f"birealisation {KIND}: tau is not {size}×{size} like {representation.name}")
        return [list(row) for row in tau]
    p = covector_symbols(system.coordinates)
    basis = _dense(representation)
    combined = [
        [total(pi * m[r][c] for pi, m in zip(p, basis, strict=True) if not m[r][c].is_zero) for c in range(size)]
        for r in range(size)
    ]
    return MatrixFunction(combined, MATRIX).values([tau])[0]


def _expect_tangent(system: System, representation: Representation, tau: Matrix) -> None:
    """Raise `SpecError` unless the map τ of the spec satisfies τ(0) = 1 and, at p = 0, ∂τ/∂p_j = E_j."""
    size, zero = representation.size, dict.fromkeys(covector_names(system.coordinates), ZERO)
    try:
        at_zero = [substitute(row, zero) for row in tau]
        slopes = [[substitute(derivatives(row, name), zero) for row in tau] for name in zero]
    except ZeroDivisionError:
        raise refuse(f"birealisation {KIND}: tau has no value at p = 0") from None
    _expect_equal(at_zero, identity(size), "tau(0) is not the identity", system)
    for name, slope, E in zip(system.coordinates, slopes, _dense(representation), strict=True):
        _expect_equal(slope, E, f"the derivative of tau along p_{name} at 0 is not the matrix of {name}", system)


def _expect_equal(a: Matrix, b: Matrix, message: str, system: System) -> None:
    for r, (row, other_row) in enumerate(zip(a, b, strict=True)):
        for c, (u, v) in enumerate(zip(row, other_row, strict=True)):
            if not decide_zero("", [("", u - v)], system.positive).holds:
                raise refuse(
                    f"birealisation {KIND}: {message}: entry ({r + 1}, {c + 1}) is {shortened(u)}, not {shortened(v)}",
                    "τ(0) = 1 and dτ(0) = id are needed, as for (1 + P/2)/(1 - P/2)",
                )


class _Trivialised:
    """Solver of the linear equations for R⁻¹ and L⁻¹.

    R and L are the right and left trivialised derivatives of τ, the map from the Lie algebra to its group that the spec
    states. The equations are solved by elimination, with rational functions of p and of the functions of p that occur
    in τ.
    """

    def __init__(self, system: System, representation: Representation, tau: Matrix) -> None:
        self._names = system.coordinates
        self._basis = _dense(representation)
        self._tau = tau
        slopes = [[derivatives(row, name) for row in tau] for name in covector_names(system.coordinates)]
        flat = [e for m in (tau, *slopes, *self._basis) for row in m for e in row]
        self._field = Field(flat)
        self._columns = [[self._field.convert(e) for row in m for e in row] for m in slopes]

    def solved(self, *, left: bool) -> list[list[Expression]]:
        """Return R⁻¹ if ``left``, else L⁻¹, as a list of rows. The matrices R and L are the trivialised derivatives of
        the map τ.

        The entries c_j of column i solve Σ_j (∂τ/∂p_j) c_j = E_i τ. For L⁻¹ the right-hand side is τ E_i.
        """
        n = len(self._basis)
        sides = []
        for E in self._basis:
            product = multiplied(E, self._tau) if left else multiplied(self._tau, E)
            sides.append([self._field.convert(e) for row in product for e in row])
        rows = [[column[k] for column in (*self._columns, *sides)] for k in range(len(sides[0]))]
        reduced = self._eliminated(rows, n)
        return [[self._field.expression(v) for v in row[n:]] for row in reduced]

    def _eliminated(self, rows: list[list[Scalar]], n: int) -> list[list[Scalar]]:
        """Return the rows of the equations with the first n columns reduced to the identity.

        The equations are those at the head of the module, for the map τ of the spec. Raises `SpecError` if dτ is
        singular, and if the equations have no solution. Without a solution, (∂τ/∂p_j) τ⁻¹ is not in the Lie algebra.
        """
        reduced: list[list[Scalar]] = []
        for k in range(n):
            pivot = next((r for r in rows if r[k] != 0), None)
            if pivot is None:
                raise refuse(f"birealisation {KIND}: tau is not a local diffeomorphism: dτ is singular for all p")
            rows.remove(pivot)
            scale = self._field.one / pivot[k]
            pivot = [v * scale for v in pivot]
            rows, reduced = ([_without(r, pivot, k) for r in part] for part in (rows, reduced))
            reduced.append(pivot)
        for row in rows:
            escaping = next((i for i, v in enumerate(row[n:]) if v != 0), None)
            if escaping is not None:
                raise refuse(
                    f"birealisation {KIND}: tau does not stay in the group: its derivative leaves the algebra "
                    f"(no combination of the ∂τ/∂p is τ times the matrix of {self._names[escaping]})",
                    "relations between functions of p, such as sin² + cos² = 1, are not used here",
                )
        return reduced


def _without(row: list[Scalar], pivot: list[Scalar], k: int) -> list[Scalar]:
    factor = row[k]
    return row if factor == 0 else [v - factor * w for v, w in zip(row, pivot, strict=True)]
