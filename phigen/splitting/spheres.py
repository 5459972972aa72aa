"""Motions on spheres in closed form: ẋ = (β·x)x − |x|²β for some of the coordinates x, such as double-bracket damping
of spins.

The flow maps x to its mirror image in the line through 0 and y = x − e, where e is given below. The mirror image is x +
2(y(y·e)/|y|² − e). This formula is accurate for small e, and preserves |x| for any rounding of e.

If β is constant, the flow is that of a Lorentz boost on the sphere: e = |x|β tanh(θ/2)/|β| with θ = t|x||β|.

If β = (v·x)w with w parallel to v, the cotangent of the angle between x and v decays exponentially. Let x_v be the
component of x along v, and T = tanh(t|x|²(v·w)/2). Then x moves to the direction of u = x + T(x − 2x_v), and e =
−|x|T(x − 2x_v)/(|x| + |u|).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce

from phigen.splitting.ring import TIME, Monomial, Ring
from phigen.symbolic.expression import Expression, call, sqrt, symbol, total
from phigen.symbolic.tower import Poly

#: Descriptions of the two motions, for reports.
BOOSTED, DRAWN = "moved on a sphere, as by a boost", "moved on a sphere along meridians"


def solve(ring: Ring, field: Sequence[Poly]) -> tuple[dict[int, Expression], str] | None:
    """Return the increments along a vector field on spheres, by the index of the coordinate, and a description in
    words.

    Returns None for any other vector field.
    """
    moving = [i for i, f in enumerate(field) if f != 0]
    if len(moving) < 2:
        return None
    sphere = _Sphere(ring, [ring.tower.names.index(ring.coordinates[i]) for i in moving])
    rates = [ring.terms(field[i], sphere.variables) for i in moving]
    names = {ring.coordinates[i] for i in moving}
    if any(names & set(ring.tower.names_in(c)) for rate in rates for c in rate.values()):
        return None
    increments, manner = sphere.boosted(rates), BOOSTED
    if increments is None:
        increments, manner = sphere.drawn(rates), DRAWN
    return None if increments is None else (dict(zip(moving, increments, strict=True)), manner)


class _Sphere:
    """The coordinates that move on a sphere; ``variables`` are their indices among the variables of the ring."""

    def __init__(self, ring: Ring, variables: Sequence[int]) -> None:
        self.ring, self.variables, self.size = ring, variables, len(variables)
        self.x = [ring.values[v] for v in variables]
        self.t, self.square = symbol(TIME), dot(self.x, self.x)

    def boosted(self, rates: Sequence[dict[Monomial, Poly]]) -> list[Expression] | None:
        """Return the increments of a field ẋ = (β·x)x − |x|²β with constant β; None for other fields. ``rates`` is the
        field."""
        beta = [rates[k - 1].get(self._monomial(k, k - 1), self.ring.tower.zero) for k in range(self.size)]
        if not self._moves(rates, [[b] for b in beta], [()]):
            return None
        b = [self.ring.expression(e) for e in beta]
        angle = -(self.t**2 / 4) * (self.square * dot(b, b))  # −(θ/2)² of the boost parameter θ = t|x||β|
        scale = self.t / 2 * call("sinroot", angle) / call("cosroot", angle) * self.square
        return self._mirrored([scale * e for e in b])

    def drawn(self, rates: Sequence[dict[Monomial, Poly]]) -> list[Expression] | None:
        """Return the increments of a field ẋ = (β·x)x − |x|²β with β = (v·x)w, w parallel to v; None for other fields.

        The matrix M of β = Mx has rank 1. The rates determine M only up to a multiple of the unit matrix, since β = gx
        with a number g adds nothing to the rates. So a matrix A is read from the rates, and g is chosen such that M = A
        − g has rank 1.
        """
        zero, n = self.ring.tower.zero, range(self.size)
        a = [[zero if i == j else zero - rates[i].get(self._monomial(j, j, j), zero) for j in n] for i in n]
        for i in n[1:]:  # a number added to the diagonal has no effect; it is chosen such that a[0][0] = 0
            a[i][i] = rates[0].get(self._monomial(0, i, i), zero)
        if any(a[i][j] != a[j][i] for i in n for j in n) or not self._moves(rates, a, [(j,) for j in n]):
            return None
        for g in self._shifts(a):
            m = [[e - g if i == j else e for j, e in enumerate(row)] for i, row in enumerate(a)]
            minors = (m[i][j] * m[k][h] - m[i][h] * m[k][j] for i in n for k in n[:i] for j in n for h in n[:j])
            pivot = next((k for k in n if m[k][k] != 0), None)
            if pivot is not None and all(e == 0 for e in minors):
                common = reduce(lambda p, q: p.gcd(q), m[pivot])  # divided out, since a common factor may be 0
                v = [self.ring.expression(e / common) for e in m[pivot]]
                return self._drawn(v, total(self.ring.expression(m[i][i]) for i in n))
        return None

    def _drawn(self, v: Sequence[Expression], strength: Expression) -> list[Expression]:
        projection = dot(v, self.x) / dot(v, v)
        part = [projection * e for e in v]  # the component of x along v
        pull = call("tanh", self.t / 2 * strength * self.square)
        reflected = [c - 2 * e for c, e in zip(self.x, part, strict=True)]
        radius = sqrt(self.square)
        reached = sqrt(total((c + pull * e) ** 2 for c, e in zip(self.x, reflected, strict=True)))
        scale = -radius * pull * call("inv0", reached + radius)
        return self._mirrored([scale * e for e in reflected])

    def _mirrored(self, e: Sequence[Expression]) -> list[Expression]:
        """Return 2(y(y·e)/|y|² − e) with y = x − e: the increment from x to its mirror image in the line through 0 and
        y.

        If y = 0, x moves to −x, and rounding has left no information on the direction. The increment is then −2x.
        """
        y = [c - d for c, d in zip(self.x, e, strict=True)]
        projection = dot(y, e) * call("inv0", dot(y, y))
        return [2 * (c * projection - d) for c, d in zip(y, e, strict=True)]

    def _shifts(self, a: Sequence[Sequence[Poly]]) -> Iterator[Poly]:
        """Yield candidates for g in the formula A = M + g·1, where A is the matrix ``a`` and M has rank 1."""
        yield from (a[i][i] for i in range(self.size))
        for i, j, k in ((0, 1, 2), (1, 0, 2), (2, 0, 1)) if self.size == 3 else ():
            quotient, remainder = divmod(a[i][j] * a[i][k], a[j][k]) if a[j][k] != 0 else (0, 1)
            if remainder == 0:
                yield a[i][i] - quotient

    def _monomial(self, *factors: int) -> Monomial:
        """Return the product of the coordinates with the given places in ``variables``.

        Negative places count from the end, as for Python lists.
        """
        exponents = [0] * len(self.ring.tower.gens)
        for k in factors:
            exponents[self.variables[k]] += 1
        return tuple(exponents)

    def _moves(
        self, rates: Sequence[dict[Monomial, Poly]], beta: Sequence[Sequence[Poly]], factors: Sequence[tuple[int, ...]]
    ) -> bool:
        """Whether the vector field ``rates`` is (β·x)x − |x|²β for a given β.

        β_i is the sum over j of ``beta[i][j]`` times the product of the coordinates ``factors[j]``.
        """
        ring, n = self.ring, range(self.size)
        product = [
            ring.tower.combine(c * ring.monomial(self._monomial(*f)) for c, f in zip(row, factors, strict=True))
            for row in beta
        ]
        x = [ring.monomial(self._monomial(k)) for k in n]
        inner, square = (ring.tower.combine(a * b for a, b in zip(x, vector, strict=True)) for vector in (product, x))
        expected = [inner * x[k] - square * product[k] for k in n]
        actual = [ring.tower.combine(c * ring.monomial(m) for m, c in rate.items()) for rate in rates]
        return all(ring.tower.is_zero(a - b) for a, b in zip(actual, expected, strict=True))


def dot(a: Sequence[Expression], b: Sequence[Expression]) -> Expression:
    """Return the scalar product a·b."""
    return total(x * y for x, y in zip(a, b, strict=True))
