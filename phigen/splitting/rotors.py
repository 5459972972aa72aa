"""Free rigid bodies in H: sums of squares of three coordinates with the brackets of so(3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from phigen.splitting.euler import CYCLIC, EulerMotion
from phigen.splitting.flow import Term
from phigen.splitting.ring import Ring
from phigen.symbolic.tower import Poly, rational


def rotors(ring: Ring, terms: Sequence[Term]) -> Iterator[tuple[EulerMotion, Poly]]:
    """Yield the free rigid bodies in H, each with its Hamiltonian as an element of the ring.

    The Hamiltonian of a body is a sum of squares of three coordinates. These coordinates have the brackets of so(3), up
    to factors of the same sign, and no brackets with other coordinates. No two of the three moments of inertia may be
    the same function of the parameters.
    """
    supports = [{*ring.support(t.element)} for t in terms]
    for triple in combinations(range(len(ring.coordinates)), 3):
        if not _rotates(ring, triple):
            continue
        within_triple = [t.element for t, support in zip(terms, supports, strict=True) if support <= {*triple}]
        coefficients = ring.terms(ring.tower.combine(within_triple), ring.state)
        squares = [_power(ring, i, 2) for i in triple]
        element = ring.tower.combine(coefficients[m] * ring.monomial(m) for m in squares if m in coefficients)
        field = ring.field(element) if element != 0 else []
        factors = [
            _factor(ring, field[i], triple[j], triple[k]) for i, (j, k) in zip(triple, CYCLIC, strict=True) if field
        ]
        names = tuple(ring.coordinates[i] for i in triple)
        level_expressions = [ring.expression(f) for f in factors if f is not None]
        if len(level_expressions) == 3:
            yield EulerMotion(names, tuple(level_expressions), ring.expression(element)), element


def _rotates(ring: Ring, triple: tuple[int, ...]) -> bool:
    """Whether three coordinates have the brackets of so(3), up to factors, and no brackets with other coordinates.

    The brackets are {x_i, x_j} = β_k x_k for cyclic i, j, k, with numbers β_k of the same sign.
    """
    if any({*ring.brackets_of[i]} != {*triple} - {i} for i in triple):
        return False
    numbers = []
    for i, (j, k) in zip(triple, CYCLIC, strict=True):
        entry = ring.terms(ring.poisson[triple[j]][triple[k]], ring.state)
        factor = entry.get(_power(ring, i, 1))
        if len(entry) != 1 or factor is None or not factor.is_constant():
            return False
        numbers.append(rational(factor.leading_coefficient()))
    return all(n > 0 for n in numbers) or all(n < 0 for n in numbers)


def _factor(ring: Ring, rate: Poly, j: int, k: int) -> Poly | None:
    """Return the factor α of a rate α x_j x_k; None if α is 0 or the rate has another form."""
    product = tuple(a + b for a, b in zip(_power(ring, j, 1), _power(ring, k, 1), strict=True))
    terms = ring.terms(rate, ring.state)
    return terms.get(product) if len(terms) == 1 else None


def _power(ring: Ring, coordinate: int, exponent: int) -> tuple[int, ...]:
    variable = ring.tower.names.index(ring.coordinates[coordinate])
    return tuple(exponent * (v == variable) for v in range(len(ring.tower.gens)))
