"""Bi-realisation of a linear π, on the dual of a Lie algebra, by the Cayley transform.

The transform is τ(P) = (1 − P/2)⁻¹(1 + P/2) for P = Σ p_i E_i, where the matrices E_i are a faithful representation of
the algebra. The coordinates of a matrix of the algebra are its coefficients in the basis E_1, E_2, …, and ⟨x, ·⟩ is the
scalar product with x. Then α_i = ⟨x, coordinates of (1 + P/2)E_i(1 − P/2)⟩, that is

    α_i = x_i − ½(πp)_i − ¼⟨x, coordinates of P E_i P⟩,    β(x, p) = α(x, −p),    β − α = πp.

This requires that P E_i P is in the algebra for all P and i. An equivalent condition is that E_a E_i E_b + E_b E_i E_a
is in the algebra for all a, i, b. The condition holds for so(n), sp(2n), gl(n), sl(2), su(2), se(n), aff(n) and
heisenberg(n), but not for sl(3). The article `PAPER` of `phigen.realisations.protocol`, example so(n), has 4 instead of
2 in both denominators of τ(P).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain

from phigen import progress
from phigen.geometry.field import Field, Scalar
from phigen.geometry.lie_algebra import LieAlgebra, Representation
from phigen.geometry.linear import Span, add_multiple
from phigen.geometry.matrix_algebras import failing_jacobi
from phigen.geometry.representations import candidates, indecomposable_parts, restricted
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.extension import dual_of
from phigen.realisations.protocol import PAPER, BiRealisation, covector_symbols, refuse, reversed_covector
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ONE, Expression, number, symbol
from phigen.symbolic.horner import Powers, sparse_horner
from phigen.symbolic.readable import shortened

KIND = "cayley"

Sparse = dict[tuple[int, int], Scalar]
#: The forms ⟨x, coordinates of P E_i P⟩ in the formula at the head of the file, for all i: (i, a, b, k) with a ≤ b →
#: coefficient of p_a p_b x_k in form i.
Trilinear = dict[tuple[int, int, int, int], Expression]


@dataclass(frozen=True)
class _Escape:
    """Indices i, a, b of basis matrices of a Lie algebra for which E_a E_i E_b + E_b E_i E_a is not in the algebra.
    Then this representation of the Lie algebra gives no Cayley bi-realisation; another one may.
    """

    i: int
    a: int
    b: int


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the Cayley bi-realisation of a linear or affine π. The bi-realisation is symmetric.

    Raises `SpecError` if π is neither linear nor affine, or if no known faithful representation satisfies the condition
    at the head of the file. In the second case, the message names the representations that were tried, with a product
    outside the algebra for each.
    """
    dual = dual_of(system)
    if dual is None:
        raise refuse(f"birealisation {KIND} needs a linear or affine π; this π is {system.shape}")
    terms, explanation = closed_product(dual.algebra)
    n, size = system.dimension, dual.algebra.dimension
    if any(i < n <= b for i, _, b, _ in terms):  # a term contains p_z of the central extension
        raise refuse(f"birealisation {KIND} is not defined for this affine π", "try exponential")
    x = [symbol(c) for c in system.coordinates]
    increment = hamiltonian_vector_field(system.poisson, covector_symbols(system.coordinates))
    quadratic: list[dict[Powers, Expression]] = [{} for _ in range(size)]
    for (i, a, b, k), c in terms.items():
        quadratic[i][(*(((a, 2),) if a == b else ((a, 1), (b, 1))), (size + k, 1))] = c
    displacement = []
    for i in range(n):
        curvature = _factored(quadratic[i], [*dual.p, *dual.x])
        displacement.append(-(number(Fraction(1, 2)) * increment[i]) - number(Fraction(1, 4)) * curvature)
    alpha = tuple(xi + d for xi, d in zip(x, displacement, strict=True))
    beta = tuple(reversed_covector(alpha, system.coordinates))
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        tuple(displacement),
        increment,
        True,  # symmetric: β(x, p) = α(x, −p)
        explanation=f"π is {'linear' if size == n else 'affine'}: Cayley transform, {explanation}; symmetric",
        reference=f"{PAPER}, the proposition on Lie–Poisson structures and its example so(n); in the Cayley transform "
        "of this example, the denominators 4 must be 2",
    )


def closed_representation(algebra: LieAlgebra) -> Representation | None:
    """Return a faithful representation in which P E_i P is in the algebra for all P = Σ p_a E_a; None if none
    is known.
    """
    declared = [algebra.representation] if algebra.representation else []
    if not declared and len(indecomposable_parts(algebra)) > 1:
        return None
    return next((r for r in chain(declared, candidates(algebra)) if trilinear(algebra, r) is not None), None)


def trilinear(algebra: LieAlgebra, representation: Representation) -> Trilinear | None:
    """Return the forms ⟨x, coordinates of P E_i P⟩ with P = Σ p_a E_a, or None if some P E_i P is not in the
    algebra.

    The matrices E_a are those of the ``representation``.
    """
    form = _product(algebra, representation)
    return None if isinstance(form, _Escape) else form


def _factored(terms: dict[Powers, Expression], variables: Sequence[Expression]) -> Expression:
    """Return a sum of monomials in Horner form. A coefficient that all terms share up to sign is factored out.

    For so(3) the result is p_i (p·x). Then p·x is one node of the expression graph, shared by all components.
    """
    common = next(iter(terms.values()), ONE)
    if any(c is not common and c is not -common for c in terms.values()):
        return sparse_horner(terms, variables)
    return common * sparse_horner({m: ONE if c is common else -ONE for m, c in terms.items()}, variables)


def closed_product(algebra: LieAlgebra) -> tuple[Trilinear, str]:
    """Return the forms ⟨x, coordinates of P E_i P⟩ with P = Σ p_a E_a, and a description of the representation.

    The representation is the first one in which P E_i P is in the algebra. If there is none, raises `SpecError` with
    the representations that were tried.
    """
    failures: dict[str, str] = {}
    if algebra.representation is not None:
        form = _product(algebra, algebra.representation)
        if not isinstance(form, _Escape):
            return form, f"with {algebra.representation.name}"
        failures[algebra.representation.name] = _refusal(algebra, algebra.representation, form)
    terms: Trilinear = {}
    kinds: dict[str, list[str]] = {}
    for part in indecomposable_parts(algebra):
        ideal = restricted(algebra, part)
        for representation in candidates(ideal):
            form = _product(ideal, representation)
            if not isinstance(form, _Escape):
                terms |= {(part[i], part[a], part[b], part[k]): c for (i, a, b, k), c in form.items()}
                kinds.setdefault(representation.name, []).append(f"({', '.join(ideal.labels)})")
                break
            failures[representation.name] = _refusal(ideal, representation, form)
        else:
            _expect_poisson(algebra)
            failures = failures or {"": f"no faithful representation of {ideal.name} was found"}
            raise refuse(
                f"birealisation {KIND} does not apply to {algebra.name}: {'; '.join(failures.values())}",
                "the kind exponential needs no representation; "
                "a closed faithful representation can be given as lie_algebra: {matrices: […]}",
            )
    if len(kinds) == 1 and max(map(len, kinds.values())) == 1:
        return terms, f"with {next(iter(kinds))}"
    return terms, "with " + "; ".join(f"{name} for {', '.join(parts)}" for name, parts in kinds.items())


def _expect_poisson(algebra: LieAlgebra) -> None:
    """Raise `SpecError` if a linear π violates the Jacobi identity.

    No matrices can represent the structure constants of this π.
    """
    failing = failing_jacobi(algebra)
    if failing is not None:
        triple, component, residual = failing
        labels = ", ".join(algebra.label(i) for i in triple)
        raise refuse(
            f"birealisation {KIND} does not apply: π is linear, but its Jacobi identity fails for ({labels})",
            f"the cyclic double brackets add up to a multiple of {algebra.label(component)}: {shortened(residual)}",
        )


def _refusal(algebra: LieAlgebra, representation: Representation, escape: _Escape) -> str:
    e_i, e_a, e_b = (algebra.label(m) for m in (escape.i, escape.a, escape.b))
    product = f"{e_a}·{e_i}·{e_a}" if escape.a == escape.b else f"{e_a}·{e_i}·{e_b} + {e_b}·{e_i}·{e_a}"
    return f"in {representation.name}, {product} leaves the algebra"


def _product(algebra: LieAlgebra, representation: Representation) -> Trilinear | _Escape:
    """Return the forms ⟨x, coordinates of P E_i P⟩ with P = Σ p_a E_a, or the first product that is not in the
    algebra.
    """
    field = Field(v for m in representation.matrices for v in m.values())
    matrices: list[Sparse] = [
        {position: field.convert(v) for position, v in m.items()} for m in representation.matrices
    ]
    span = Span(field, matrices)
    rows = [_by_row(m) for m in matrices]
    beginning: dict[int, list[int]] = {}  # row → indices of the matrices with nonzero entries in this row
    for b, row in enumerate(rows):
        for r in row:
            beginning.setdefault(r, []).append(b)
    terms: Trilinear = {}
    with progress.stage("Cayley transform", algebra.dimension) as running:
        for i in range(algebra.dimension):
            running.done = i
            images: dict[tuple[int, int], Sparse] = {}  # (a, b), a ≤ b → E_a E_i E_b + E_b E_i E_a
            for a, matrix in enumerate(matrices):
                left = _times(matrix, rows[i])
                for b in sorted({b for _, c in left for b in beginning.get(c, ())}):
                    add_multiple(images.setdefault((min(a, b), max(a, b)), {}), _times(left, rows[b]), field.one)
            for (a, b), image in sorted(images.items(), key=lambda item: item[0]):
                coordinates = span.coordinates(image)
                if coordinates is None:
                    return _Escape(i, a, b)
                for k, c in coordinates.items():
                    terms[i, a, b, k] = field.expression(c)
    return terms


def _by_row(m: Sparse) -> dict[int, list[tuple[int, Scalar]]]:
    rows: dict[int, list[tuple[int, Scalar]]] = {}
    for (r, c), v in m.items():
        rows.setdefault(r, []).append((c, v))
    return rows


def _times(a: Sparse, rows: dict[int, list[tuple[int, Scalar]]]) -> Sparse:
    entries: Sparse = {}
    for (r, c), v in a.items():
        for column, w in rows.get(c, ()):
            position = r, column
            value = entries[position] + v * w if position in entries else v * w
            if value == 0:
                del entries[position]
            else:
                entries[position] = value
    return entries
