"""Search for Casimirs of a Poisson tensor, by a method for each form of the tensor.

Candidates come from these sources, in this order:

- the Casimirs that define a Nambu bracket
- the Casimirs of the blocks of a product and, if the spec states π in other coordinates (a pull-back), the Casimirs in
  those coordinates
- linear functions, from the kernel of a constant π
- monomials x^u, from the kernel of the matrix A of a log-canonical π
- on the dual of a matrix algebra with a non-degenerate trace form: polynomials of degree up to 3, then traces tr X^m
- polynomials of increasing degree, by linear algebra

A candidate that depends on declared or earlier Casimirs is dropped. `phigen.geometry.checks` proves that each result is
a Casimir.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction

from phigen import progress
from phigen.geometry.field import Field, Scalar
from phigen.geometry.forms import structure
from phigen.geometry.linear import coprime_integers, kernel
from phigen.geometry.polynomial_casimirs import polynomial_casimirs
from phigen.geometry.rank import generic_ranks
from phigen.geometry.representations import known_representation
from phigen.geometry.shapes import Canonical, Constant, LiePoisson, LogCanonical, Matrix, Shape
from phigen.geometry.trace_casimirs import trace_casimirs
from phigen.spec.model import NambuForm, PoissonForm, ProductForm, PullbackForm
from phigen.symbolic.expression import Expression, call, gradient, number, power, product, substitute, symbol, total

#: Largest degree of the polynomials in the search for Casimirs.
DEGREE = 4


def found_casimirs(
    coordinates: Sequence[str],
    poisson: Matrix,
    shape: Shape,
    form: PoissonForm,
    declared: Mapping[str, Expression],
    used_names: Collection[str],
) -> tuple[dict[str, Expression], tuple[str, ...]]:
    """Return further Casimirs, independent of the declared ones, and notes for the user.

    The Casimirs get the names C1, C2, …; names in ``used_names`` are skipped. The search ends when the number of
    independent Casimirs equals the corank of π. If fewer are found, the notes say which parts of the search were
    omitted.
    """
    slopes = [gradient(c, coordinates) for c in declared.values()]
    ranks = generic_ranks([poisson, slopes])
    if ranks is None:
        return {}, ("no Casimirs were searched for: no point of the domain of π was found",)
    rank, independent = ranks
    missing = len(coordinates) - rank - independent
    casimirs: list[Expression] = []
    notes: list[str] = []
    if missing > 0:
        with progress.stage("Casimirs", missing) as running:
            for candidate in _candidates(coordinates, poisson, shape, form, notes):
                slope = gradient(candidate, coordinates)
                ranks = generic_ranks([[*slopes, slope]])
                if ranks is None or ranks[0] <= independent:
                    continue
                slopes, independent = [*slopes, slope], ranks[0]
                casimirs.append(candidate)
                running.done = len(casimirs)
                if len(casimirs) == missing:
                    notes = []
                    break
    names = (f"C{i}" for i in range(1, len(casimirs) + len(used_names) + 1) if f"C{i}" not in used_names)
    return dict(zip(names, casimirs, strict=False)), tuple(notes)


def _candidates(
    coordinates: Sequence[str], poisson: Matrix, shape: Shape, form: PoissonForm, notes: list[str]
) -> Iterator[Expression]:
    """Yield functions that may be Casimirs; append a note to ``notes`` for each part of the search that is omitted."""
    if isinstance(form, NambuForm):
        yield from form.casimirs
        return
    if isinstance(form, ProductForm):
        for names, inner in form.blocks:
            yield from _candidates(names, *structure(inner, names), inner, [])
    if isinstance(form, PullbackForm):
        forward = dict(zip(form.coordinates, form.map, strict=True))
        for casimir in _candidates(form.coordinates, *structure(form.of, form.coordinates), form.of, []):
            yield substitute([casimir], forward)[0]
    match shape:
        case Constant(matrix) | Canonical(matrix=matrix):
            yield from _linear(coordinates, matrix)
            return
        case LogCanonical(a):
            yield from _monomial(coordinates, a)
            return
        case LiePoisson(algebra):
            # Sparse polynomials of degree up to 3 come first. Then come traces, which have many terms but may have any
            # degree.
            yield from polynomial_casimirs(coordinates, poisson, shape, 3, [])
            representation = known_representation(algebra)
            if representation is not None:
                yield from trace_casimirs(coordinates, representation)
    yield from polynomial_casimirs(coordinates, poisson, shape, DEGREE, notes)


def _linear(coordinates: Sequence[str], matrix: Matrix) -> Iterator[Expression]:
    field, vectors = _kernel(matrix)
    for vector in vectors:
        scaled = coprime_integers(vector) if field.is_rational else vector
        yield total(
            (number(v) if isinstance(v, int) else field.expression(v)) * symbol(coordinates[i])
            for i, v in sorted(scaled.items())
        )


def _monomial(coordinates: Sequence[str], a: Matrix) -> Iterator[Expression]:
    """Yield Casimirs of a log-canonical π with the matrix A: x^u for each u in a basis of the kernel of A.

    If u contains parameters, the Casimir is ½ Σ u_i log x_i² instead of x^u.
    """
    field, vectors = _kernel(a)
    for vector in vectors:
        if field.is_rational:
            yield product(power(symbol(coordinates[i]), u) for i, u in sorted(coprime_integers(vector).items()))
        else:
            logarithms = (
                field.expression(u) * call("log", power(symbol(coordinates[i]), 2)) for i, u in sorted(vector.items())
            )
            yield number(Fraction(1, 2)) * total(logarithms)


def _kernel(matrix: Matrix) -> tuple[Field, list[dict[int, Scalar]]]:
    field = Field(e for row in matrix for e in row)
    rows = [{j: field.convert(e) for j, e in enumerate(row) if not e.is_zero} for row in matrix]
    return field, kernel(field, rows, len(matrix))
