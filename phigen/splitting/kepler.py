"""The flow of a Kepler motion, H = w|p|²/2 − k/|q| with w = 1/m, by universal variables.

Let μ = wk, v = wp, r0 = |q|, η = q·v, β = 2μ/r0 − |v|², and let s be the universal anomaly of
`phigen.symbolic.universal`. The state (q', p') after the flow is

    q' − q = g v − (μG2/r0) q,    p' − p = −(kG1/(r r0)) q − (μG2/r) p,
    g = r0 G1 + ηG2,    r = r0 + ηG1 + (μ − βr0)G2 = |q'|,

where G1 = 2SC, G2 = 2S², C = cosroot(βs²/4) and S = s sinroot(βs²/4)/2, with cosroot(u) = cos √u and sinroot(u) =
sin(√u)/√u. The formulas are those of Lagrange, in which g usually contains the time. Without the time in g, an error of
s changes only the time over which the body moves, and not the energy. No formula divides by β or w: ellipses,
parabolas, hyperbolas and both signs of k are covered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ONE, ZERO, Expression, call, derivatives, power, sqrt, substitute, symbol, total
from phigen.symbolic.symbols import Symbol
from phigen.symbolic.universal import ANOMALY

Vector = Sequence[Expression]


@dataclass(frozen=True)
class KeplerMotion:
    """The Kepler motion of w|p|²/2 − k/|q| with ``position`` q and ``momentum`` p.

    The components of q and p are coordinates or linear forms of coordinates. ``inverse_mass`` is w and ``strength`` is
    k; both depend on parameters only.
    """

    position: tuple[Expression, ...]
    momentum: tuple[Expression, ...]
    inverse_mass: Expression
    strength: Expression

    @property
    def hamiltonian(self) -> Expression:
        """The Hamiltonian w|p|²/2 − k/|q| of the motion."""
        return self.inverse_mass / 2 * square(self.momentum) - self.strength * inverse_length(self.position)

    @property
    def manner(self) -> str:
        """The motion in words, for reports."""
        return f"{', '.join(map(str, (*self.position, *self.momentum)))} moved along a conic section"

    def rates(self) -> tuple[list[Expression], list[Expression]]:
        """Return the time derivatives of q and p, which are wp and −kq/|q|³."""
        pull = self.strength * self.cube
        return [self.inverse_mass * e for e in self.momentum], [-(pull * e) for e in self.position]

    @property
    def cube(self) -> Expression:
        """The inverse cube of the distance, 1/|q|³."""
        return power(sqrt(square(self.position)), -3)

    def opaque(self, roots: Sequence[Expression]) -> list[Expression]:
        """Return the expressions unchanged. `RelativeMotions` has a method of this name that inserts symbols for
        proofs; here none are needed.
        """
        return [*roots]

    def changes(self) -> tuple[list[Expression], list[Expression]]:
        """Return the changes of q and p in the flow over the time `TIME`."""
        orbit = _Orbit.through(self.position, self.momentum, self.inverse_mass, self.strength)
        s = call(ANOMALY, symbol(TIME), orbit.distance, orbit.moment, orbit.beta, orbit.mu, orbit.spin)
        z = orbit.beta * s**2 / 4
        return orbit.changes(call("cosroot", z), s * call("sinroot", z) / 2)

    def field(self, coordinates: Sequence[str]) -> list[Expression]:
        """Return the rates of all ``coordinates``; those that are not part of the motion have the rate 0.

        The components of ``position`` and ``momentum`` must be symbols of coordinates, not linear forms.
        """
        return self._placed(coordinates, self.rates())

    def increments(self, coordinates: Sequence[str]) -> list[Expression]:
        """Return the increments of all ``coordinates`` in the flow over the time `TIME`."""
        return self._placed(coordinates, self.changes())

    def residuals(self) -> Iterator[tuple[str, Expression]]:
        """Yield pairs of a label and an expression; all expressions vanish if the increments solve the equations of
        motion."""
        yield from identities()

    def _placed(
        self, coordinates: Sequence[str], values: tuple[list[Expression], list[Expression]]
    ) -> list[Expression]:
        names = [e.value for e in (*self.position, *self.momentum)]
        values_by_name = dict(zip(names, [*values[0], *values[1]], strict=True))
        return [values_by_name.get(name, ZERO) for name in coordinates]


@dataclass(frozen=True)
class _Orbit:
    """The orbit of a Kepler motion through a state.

    The constants r0, η, β and μ of the formulas are ``distance``, ``moment``, ``beta`` and ``mu``.
    """

    position: Vector
    momentum: Vector
    distance: Expression
    moment: Expression
    beta: Expression
    mu: Expression
    inverse_mass: Expression
    strength: Expression

    @classmethod
    def through(cls, q: Vector, p: Vector, w: Expression, k: Expression) -> _Orbit:
        """Return the orbit through the state (q, p), for the inverse mass w and the strength k."""
        distance, mu = sqrt(square(q)), w * k
        moment = w * total(a * b for a, b in zip(q, p, strict=True))
        beta = 2 * mu * power(distance, -1) - w**2 * square(p)
        return cls(q, p, distance, moment, beta, mu, w, k)

    @property
    def spin(self) -> Expression:
        """The square |q × v|² of the specific angular momentum, for the inverse mass w and the velocity v = wp."""
        pairs = list(combinations(zip(self.position, self.momentum, strict=True), 2))
        return self.inverse_mass**2 * total((a * d - b * c) ** 2 for (a, b), (c, d) in pairs)

    def end(self, c: Expression, s: Expression) -> tuple[Expression, Expression, Expression]:
        """Return G1, G2 and the distance r = |q'| after the flow, from C and S. All five are defined by the formulas of
        this module.
        """
        g1, g2 = 2 * s * c, 2 * s**2
        return g1, g2, self.distance + (self.moment * g1 + (self.mu - self.beta * self.distance) * g2)

    def changes(self, c: Expression, s: Expression) -> tuple[list[Expression], list[Expression]]:
        """Return the changes q' − q and p' − p in the flow, from C and S, which the formulas of this module define."""
        g1, g2, r = self.end(c, s)
        inverse, inverse_end = power(self.distance, -1), power(r, -1)
        along = self.inverse_mass * (self.distance * g1 + self.moment * g2)
        # With this order of the factors, q' and p' contain the same rounded products, so the flow stays canonical.
        towards = self.inverse_mass * (self.strength * g2)
        pull = inverse * inverse_end * (self.strength * g1)
        q_change = [along * b - towards * inverse * a for a, b in zip(self.position, self.momentum, strict=True)]
        p_change = [-(pull * a + towards * inverse_end * b) for a, b in zip(self.position, self.momentum, strict=True)]
        return q_change, p_change


def identities() -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression in the independent symbols C, S, r0, η, β, w, k and one component of q
    and p.

    All expressions vanish if the increments of q and p solve the equations of motion. The expressions are residuals of
    three equations: the equations of motion of q and p, in which r stands for |q'|, and r² = |q'|². Time derivatives
    follow from ds = dt/r: dS/dt = C/(2r) and dC/dt = −βS/(2r). The square |v|² is written as 2wk/r0 − β. The relation
    C² + βS² = 1 is substituted as β = (1 − C²)/S².
    """
    names = [Symbol("orbit", name) for name in ("C", "S", "r0", "η", "β", "w", "k", "q", "p")]
    c, s, distance, moment, beta, w, k, q, p = map(symbol, names)
    orbit = _Orbit([q], [p], distance, moment, beta, w * k, w, k)
    _, _, r = orbit.end(c, s)
    ((position_change,), (momentum_change,)) = orbit.changes(c, s)
    along_c, along_s = (derivatives([position_change, momentum_change], name) for name in names[:2])
    rates = [(c * b - beta * s * a) / 2 * power(r, -1) for a, b in zip(along_c, along_s, strict=True)]
    (of_q,), (of_p,) = (derivatives([position_change], name) for name in names[-2:])
    f, g = ONE + of_q, of_p * power(w, -1)
    squared = (f * distance) ** 2 + 2 * f * g * moment + g**2 * (2 * w * k * power(distance, -1) - beta)
    residuals = {
        "dq'/dt = wp'": rates[0] - w * (p + momentum_change),
        "dp'/dt = -kq'/r³": rates[1] + k * (q + position_change) * power(r, -3),
        "|q'| = r": squared - r**2,
    }
    start: dict[str, Expression] = {names[0]: ONE, names[1]: ZERO}
    for name, value in zip(
        ("q' - q", "p' - p", "r - r0"), substitute([position_change, momentum_change, r - distance], start), strict=True
    ):
        yield f"{name} at s = 0", value
    circle: dict[str, Expression] = {names[4]: (ONE - c**2) * power(s, -2)}
    yield from zip(residuals, substitute(list(residuals.values()), circle), strict=True)


def square(vector: Vector) -> Expression:
    """Return the square |v|² of the length of a vector."""
    return total(e**2 for e in vector)


def inverse_length(vector: Vector) -> Expression:
    """Return 1/|v| for a vector v."""
    return power(sqrt(square(vector)), -1)
