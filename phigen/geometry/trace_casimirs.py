"""The Casimirs tr X^m on the dual of a matrix algebra whose trace form tr(E_i E_j) is non-degenerate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.geometry.field import Field, Scalar
from phigen.geometry.lie_algebra import Representation
from phigen.geometry.linear import Span, coprime_integers
from phigen.symbolic.expression import Expression
from phigen.symbolic.tower import Poly, Tower

#: Largest number of rows of matrices for which traces of powers are computed.
_LARGEST = 8
_MOST_TERMS, _MOST_PRODUCTS = 300, 100_000


def trace_casimirs(coordinates: Sequence[str], representation: Representation) -> Iterator[Expression]:
    """Yield tr X^m for m = 1, 2, … up to the number of rows, where X = Σ x_i E^i, and tr(E^i E_j) = δ_ij.

    The E_j are the matrices of the ``representation``. The coefficients of the characteristic polynomial of X are
    polynomials in these traces. Nothing is yielded if the trace form is degenerate, if a matrix contains parameters, or
    if the matrices are large. The sequence ends at the first trace with too many terms.
    """
    if representation.size > _LARGEST:
        return
    field = Field(v for m in representation.matrices for v in m.values())
    if not field.is_rational:
        return
    matrices = [{position: field.convert(v) for position, v in m.items()} for m in representation.matrices]
    form = [{j: t for j, b in enumerate(matrices) if (t := _trace(field, a, b)) != 0} for a in matrices]
    span = Span(field, form)
    if span.dependent:
        return
    tower, n = Tower(coordinates), range(representation.size)
    element = _dual_element(tower, field, coordinates, matrices, span, representation.size)
    powers = [[[tower.constant(int(i == j)) for j in n] for i in n], element]
    for m in range(1, representation.size + 1):
        if m > 2 and m % 2:
            powers.append(_times(tower, powers[-1], element))
        # tr X^m is the trace of a product of two powers of X with exponents near m/2. Entries of these powers have far
        # fewer terms than entries of X^(m-1).
        pairs = [(powers[m // 2][i][j], powers[m - m // 2][j][i]) for i in n for j in n]
        if sum(len(a) * len(b) for a, b in pairs) > _MOST_PRODUCTS:
            return
        trace = tower.combine(a * b for a, b in pairs)
        if len(trace) > _MOST_TERMS:
            return
        if trace != 0:
            integers = coprime_integers(dict(enumerate(trace.coeffs())))
            yield tower.expression(trace * (integers[0] / trace.leading_coefficient()))


def _trace(field: Field, a: dict[tuple[int, int], Scalar], b: dict[tuple[int, int], Scalar]) -> Scalar:
    result = field.zero
    for (r, c), v in a.items():
        if (c, r) in b:
            result = result + v * b[c, r]
    return result


def _dual_element(
    tower: Tower,
    field: Field,
    coordinates: Sequence[str],
    matrices: Sequence[dict[tuple[int, int], Scalar]],
    span: Span[int],
    size: int,
) -> list[list[Poly]]:
    rows = [[tower.zero for _ in range(size)] for _ in range(size)]
    for i, name in enumerate(coordinates):
        # ``span`` has the rows of the trace form. The coefficients of unit vector i in terms of these rows are row i of
        # the inverse matrix of the form.
        for j, c in (span.coordinates({i: field.one}) or {}).items():
            for (r, column), v in matrices[j].items():
                rows[r][column] = rows[r][column] + tower.variable(name) * (c * v)
    return rows


def _times(tower: Tower, a: list[list[Poly]], b: list[list[Poly]]) -> list[list[Poly]]:
    n = range(len(a))
    return [[tower.combine(a[i][k] * b[k][j] for k in n if a[i][k] != 0 and b[k][j] != 0) for j in n] for i in n]
