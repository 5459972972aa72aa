"""Motions on spheres: ẋ = (β·x)x − |x|²β for some of the coordinates, as damping by the double bracket moves spins.

The end is x mirrored at the line of y = x − e, which keeps |x| whatever the rounding of e, and loses nothing where that
is small: x + 2(y(y·e)/|y|² − e).

- β constant: a boost. Then e = |x|β tanh(θ/2)/|β| with θ = t|x||β|.
- β = (v·x)w with w along v: the cotangent of the angle between x and v decays exponentially, which takes x to the
  direction of u = x + T(x − 2x_v), x_v the part along v, T = tanh(t|x|²(v·w)/2); e = −|x|T(x − 2x_v)/(|x| + |u|).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce

from phigen.splitting.ring import TIME, Monomial, Ring
from phigen.symbolic.expression import Expression, call, sqrt, symbol, total
from phigen.symbolic.tower import Poly

#: How coordinates move.
BOOSTED, DRAWN = "moved on a sphere, as by a boost", "moved on a sphere along meridians"


def solve(ring: Ring, field: Sequence[Poly]) -> tuple[dict[int, Expression], str] | None:
    """The increments by the number of the coordinate, and the manner; None for other motions."""
    moving = [i for i, f in enumerate(field) if f != 0]
    if len(moving) < 2:
        return None
    sphere = _Sphere(ring, [ring.tower.names.index(ring.coordinates[i]) for i in moving])
    rates = [ring.terms(field[i], sphere.own) for i in moving]
    names = {ring.coordinates[i] for i in moving}
    if any(names & set(ring.tower.names_in(c)) for rate in rates for c in rate.values()):
        return None
    found, manner = sphere.boosted(rates), BOOSTED
    if found is None:
        found, manner = sphere.drawn(rates), DRAWN
    return None if found is None else (dict(zip(moving, found, strict=True)), manner)


class _Sphere:
    """Coordinates, ``own`` as variables of the ring, on a sphere; rates are given as polynomials in them."""

    def __init__(self, ring: Ring, own: Sequence[int]) -> None:
        self.ring, self.own, self.size = ring, own, len(own)
        self.x = [ring.values[v] for v in own]
        self.t, self.square = symbol(TIME), dot(self.x, self.x)

    def boosted(self, rates: Sequence[dict[Monomial, Poly]]) -> list[Expression] | None:
        """β constant."""
        beta = [rates[k - 1].get(self._monomial(k, k - 1), self.ring.tower.zero) for k in range(self.size)]
        if not self._moves(rates, [[b] for b in beta], [()]):
            return None
        b = [self.ring.expression(e) for e in beta]
        angle = -(self.t**2 / 4) * (self.square * dot(b, b))  # −(θ/2)²
        scale = self.t / 2 * call("sinroot", angle) / call("cosroot", angle) * self.square
        return self._mirrored([scale * e for e in b])

    def drawn(self, rates: Sequence[dict[Monomial, Poly]]) -> list[Expression] | None:
        """β = (v·x)w: β = Ax with A = M + g, where M = v wᵀ has rank 1, and g does not move anything."""
        zero, n = self.ring.tower.zero, range(self.size)
        a = [[zero if i == j else zero - rates[i].get(self._monomial(j, j, j), zero) for j in n] for i in n]
        for i in n[1:]:  # from the first on, whose entry is taken to be 0
            a[i][i] = rates[0].get(self._monomial(0, i, i), zero)
        if any(a[i][j] != a[j][i] for i in n for j in n) or not self._moves(rates, a, [(j,) for j in n]):
            return None
        for g in self._shifts(a):
            m = [[e - g if i == j else e for j, e in enumerate(row)] for i, row in enumerate(a)]
            minors = (m[i][j] * m[k][h] - m[i][h] * m[k][j] for i in n for k in n[:i] for j in n for h in n[:j])
            pivot = next((k for k in n if m[k][k] != 0), None)
            if pivot is not None and all(e == 0 for e in minors):
                common = reduce(lambda p, q: p.gcd(q), m[pivot])  # such as a strength, which may be 0
                v = [self.ring.expression(e / common) for e in m[pivot]]
                return self._drawn(v, total(self.ring.expression(m[i][i]) for i in n))
        return None

    def _drawn(self, v: Sequence[Expression], strength: Expression) -> list[Expression]:
        along = dot(v, self.x) / dot(v, v)
        part = [along * e for e in v]  # x_v
        pull = call("tanh", self.t / 2 * strength * self.square)
        across = [c - 2 * e for c, e in zip(self.x, part, strict=True)]
        radius = sqrt(self.square)
        reached = sqrt(total((c + pull * e) ** 2 for c, e in zip(self.x, across, strict=True)))
        scale = -radius * pull * call("inv0", reached + radius)
        return self._mirrored([scale * e for e in across])

    def _mirrored(self, e: Sequence[Expression]) -> list[Expression]:
        """2(y(y·e)/|y|² − e), which is −2x where y = 0: against β, so far that rounding leaves no direction."""
        y = [c - d for c, d in zip(self.x, e, strict=True)]
        along = dot(y, e) * call("inv0", dot(y, y))
        return [2 * (c * along - d) for c, d in zip(y, e, strict=True)]

    def _shifts(self, a: Sequence[Sequence[Poly]]) -> Iterator[Poly]:
        """What may stand beside a matrix of rank 1 on the diagonal."""
        yield from (a[i][i] for i in range(self.size))
        for i, j, k in ((0, 1, 2), (1, 0, 2), (2, 0, 1)) if self.size == 3 else ():
            quotient, rest = divmod(a[i][j] * a[i][k], a[j][k]) if a[j][k] != 0 else (0, 1)
            if rest == 0:
                yield a[i][i] - quotient

    def _monomial(self, *factors: int) -> Monomial:
        """The product of coordinates, by their places in ``own``; negative ones count from the end."""
        found = [0] * len(self.ring.tower.gens)
        for k in factors:
            found[self.own[k]] += 1
        return tuple(found)

    def _moves(
        self, rates: Sequence[dict[Monomial, Poly]], beta: Sequence[Sequence[Poly]], factors: Sequence[tuple[int, ...]]
    ) -> bool:
        """Whether the rates are those of β_i = Σ_j beta[i][j] times the product of ``factors[j]``."""
        ring, n = self.ring, range(self.size)
        product = [
            ring.tower.combine(c * ring.monomial(self._monomial(*f)) for c, f in zip(row, factors, strict=True))
            for row in beta
        ]
        x = [ring.monomial(self._monomial(k)) for k in n]
        inner, square = (ring.tower.combine(a * b for a, b in zip(x, other, strict=True)) for other in (product, x))
        wanted = [inner * x[k] - square * product[k] for k in n]
        given = [ring.tower.combine(c * ring.monomial(m) for m, c in rate.items()) for rate in rates]
        return all(ring.tower.is_zero(a - b) for a, b in zip(given, wanted, strict=True))


def dot(a: Sequence[Expression], b: Sequence[Expression]) -> Expression:
    """a·b."""
    return total(x * y for x, y in zip(a, b, strict=True))
