"""Flows of a single coordinate in closed form: ż = r(z) with a nonlinear function r, whose coefficients are constant.

For each of the following forms of r, with constants a, b, c, k and n, the coordinate after the time t is:

- r = az² + bz + c: z + r T/(1 − (az + b/2)T) with T = tanh(wt)/w, where w² = b²/4 − ac may also be 0 or negative
- r' = kr: z − log(1 − krt)/k
- zr' = nr: z(1 + (1 − n) t r/z)^{1/(1 − n)}

If the solution becomes infinite within the time t, the increment is NaN, and the step fails.
"""

from __future__ import annotations

from collections.abc import Collection
from fractions import Fraction

from phigen.splitting.exponential import Solution
from phigen.splitting.ring import TIME, Ring
from phigen.symbolic.expression import call, number, symbol
from phigen.symbolic.tower import Poly, rational


def solve(ring: Ring, i: int, rate: Poly, moving: Collection[int]) -> Solution | None:
    """Return the increment of coordinate number ``i`` along ż = ``rate``, or None if no closed form is known.

    The rate may contain the coordinate and functions of it; all other variables in the rate must be constant along the
    flow.
    """
    name = ring.coordinates[i]
    other_names = [ring.coordinates[j] for j in range(len(ring.coordinates)) if j != i]
    if any(ring.tower.depends_on(ring.tower.gens[v], other_names) for v in _variables(ring, rate) if v in moving):
        return None
    return _quadratic(ring, name, rate, moving) or _exponential(ring, name, rate, moving) or _power(ring, name, rate)


def _variables(ring: Ring, element: Poly) -> list[int]:
    return [v for v, degree in enumerate(element.degrees()) if degree > 0]


def _quadratic(ring: Ring, name: str, rate: Poly, moving: Collection[int]) -> Solution | None:
    tower, variable = ring.tower, ring.tower.names.index(name)
    terms: dict[int, Poly] = {m[variable]: c for m, c in ring.terms(rate, [variable]).items()}
    if max(terms) > 2 or any(v in moving for c in terms.values() for v in _variables(ring, c)):
        return None
    padded: dict[int, Poly] = dict.fromkeys((2, 1, 0), tower.zero) | terms
    a, b, c = (padded[k] for k in (2, 1, 0))
    half = tower.constant(Fraction(1, 2))
    turning = tower.combine([a * c, tower.constant(Fraction(-1, 4)) * b * b])  # −w² with the w of tanh(wt)/w
    t, z = symbol(TIME), tower.variable(name)
    s = ring.expression(tower.combine([turning * tower.variable(TIME) ** 2]))
    speed, cosine = t * call("sinroot", s), call("cosroot", s)
    slope = ring.expression(tower.combine([a * z, half * b]))
    increment = ring.expression(rate) * speed * call("inv", cosine - speed * slope)
    return Solution((increment,), "moved by a Riccati equation")


def _exponential(ring: Ring, name: str, rate: Poly, moving: Collection[int]) -> Solution | None:
    k, remainder = divmod(ring.tower.derivative(rate, name), rate)
    if remainder != 0 or any(v in moving for v in _variables(ring, k)):
        return None
    factor = ring.expression(k)
    grown = ring.expression(ring.tower.combine([k * rate * ring.tower.variable(TIME)]))
    return Solution((-call("log1p", -grown) / factor,), "moved by a logarithm")


def _power(ring: Ring, name: str, rate: Poly) -> Solution | None:
    n, remainder = divmod(ring.tower.derivative(rate, name) * ring.tower.variable(name), rate)
    if remainder != 0 or not n.is_constant() or n == 1:
        return None
    degree = rational(n.leading_coefficient()) if n != 0 else Fraction(0)
    exponent, z = number(1 - degree), symbol(name)
    grown = exponent * (symbol(TIME) * (ring.expression(rate) / z))
    return Solution((z * call("expm1", call("log1p", grown) / exponent),), "moved by a power")
