"""The flow of a free rigid body by elliptic functions: ẋ_i = α_i x_j x_k for cyclic indices i, j, k, where some α_i are
positive and some negative.

Let E_i = α_j α_k x_i²; the differences of the E_i are constant. Let E_max be the largest E_i and E_min the smallest,
P = E_max − E_min, and R the third E_i minus E_min. `phigen.symbolic.elliptic` defines κ as a function of t, P and R,
and S and C as functions of κ and P. Then the addition theorem of Jacobi's functions gives the state x' after the time
t:

    x_i' = (x_i σ_j σ_k + α_i x_j x_k S σ_i)/D,    σ_i² = D + E_i S²,    D = 1 − E_max S² = C² − E_min S²,

where σ_i > 0, except that σ_i = C for the smallest E_i. The time enters only through κ. So an error of κ changes only
the time over which the body moves; energy and Casimirs stay constant. No phase is stored between steps, and no formula
divides by the difference of two moments of inertia. So the separatrix, rotations about an axis and symmetric bodies are
not special cases. Near the separatrix, R is a small difference of two E_i, and has the rounding errors of both.

C. G. J. Jacobi, Sur la rotation d'un corps, Crelle's Journal 39 (1850); R. van Zon, J. Schofield, Numerical
implementation of the exact dynamics of free rigid bodies, Journal of Computational Physics 225 (2007).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.splitting.ring import TIME
from phigen.symbolic.elliptic import AMPLITUDE, functions_of
from phigen.symbolic.expression import ONE, ZERO, Expression, call, derivatives, number, power, sqrt, symbol
from phigen.symbolic.symbols import Symbol

Vector = Sequence[Expression]

#: For each index i, the other two indices (j, k) such that i, j, k is a cyclic permutation.
CYCLIC = ((1, 2), (2, 0), (0, 1))

_HALF = number(Fraction(1, 2))


@dataclass(frozen=True)
class EulerMotion:
    """The motion of a free rigid body: ẋ_i = α_i x_j x_k for cyclic i, j, k.

    ``coordinates`` are the names of the x_i; the ``factors`` α_i depend on parameters only.
    """

    coordinates: tuple[str, ...]
    factors: tuple[Expression, ...]
    hamiltonian: Expression

    @property
    def manner(self) -> str:
        """The motion in words, for reports."""
        return f"{', '.join(self.coordinates)} moved as a free rigid body, by elliptic functions"

    def opaque(self, roots: Sequence[Expression]) -> list[Expression]:
        """Return the expressions unchanged. `RelativeMotions` has a method of this name that inserts symbols for
        proofs; here none are needed.
        """
        return [*roots]

    def field(self, names: Sequence[str]) -> list[Expression]:
        """Return the rates of all coordinates ``names``; coordinates that do not belong to the body have the rate 0."""
        x = [symbol(name) for name in self.coordinates]
        rates = [a * x[j] * x[k] for a, (j, k) in zip(self.factors, CYCLIC, strict=True)]
        return self._placed(names, rates)

    def increments(self, names: Sequence[str]) -> list[Expression]:
        """Return the increments of all coordinates ``names`` in the flow over the time `TIME`.

        Coordinates that do not belong to the body have the increment 0.
        """
        return self._placed(names, self.addition(symbol(TIME)).changes())

    def addition(self, time: Expression) -> Addition:
        """Return the `Addition` for a flow over the duration ``time``, from a state of symbols."""
        return Addition.at([symbol(name) for name in self.coordinates], self.factors, time)

    def residuals(self) -> Iterator[tuple[str, Expression]]:
        """Yield pairs of a label and an expression; all expressions vanish if the increments solve the equations of
        motion."""
        yield from identities()

    def _placed(self, names: Sequence[str], values: Vector) -> list[Expression]:
        values_by_name = dict(zip(self.coordinates, values, strict=True))
        return [values_by_name.get(name, ZERO) for name in names]


@dataclass(frozen=True)
class Addition:
    """The quantities of the addition theorem for the flow of a free rigid body from the state ``x``.

    These are P, R, κ, the E_i (``levels``), and three expressions whose signs give the order of the E_i
    (``conditions``); see the formulas of this module.
    """

    x: Vector
    factors: Vector
    levels: Vector
    conditions: tuple[Expression, Expression, Expression]
    p: Expression
    r: Expression
    kappa: Expression

    @classmethod
    def at(cls, x: Vector, factors: Vector, time: Expression) -> Addition:
        """Return the `Addition` for the flow from ``x`` over the duration ``time``. ``factors`` are the constants α_i
        of the equations ẋ_i = α_i x_j x_k.
        """
        levels = levels_of(x, factors)
        conditions = _order(levels)
        low, middle, high = sorted_by(conditions, levels)
        p, r = high - low, middle - low
        return cls(x, factors, levels, conditions, p, r, call(AMPLITUDE, time, p, r))

    def sorted(self, values: Vector) -> tuple[Expression, Expression, Expression]:
        """Return the ``values`` of the three axes i in the order of increasing E_i."""
        return sorted_by(self.conditions, values)

    def changes(self) -> list[Expression]:
        """Return the increments of the x_i in the flow."""
        s, c, _ = functions_of(self.kappa, self.p, self.r)
        low, _, high = self.sorted(self.levels)
        gaps_below, gaps_above = [e - low for e in self.levels], [high - e for e in self.levels]
        square, z = s**2, self.p * self.kappa**2
        roots = [sqrt(c**2 + e * square) for e in gaps_below]
        # ``roots`` has √σ_i² for each axis i. For the axis with the lowest E_i this is |C|, but σ_i = C may be
        # negative. On the separatrix (R = 0) C is never negative, except by rounding, so there the root is used.
        sigma = self._at_lowest([call("choose", self.r, c, root) for root in roots], roots)
        versine = 8 * z * power(1 + z, -2)  # 1 − C without cancellation
        losses = self._at_lowest([versine] * 3, [d * square / (1 + r) for d, r in zip(gaps_above, roots, strict=True)])
        divisor = c**2 - low * square
        # The differences σ_j σ_k − D, without cancellation. For large D they are computed from 1 − σ_j and 1 − σ_k,
        # which are then small.
        gaps = [
            call("choose", divisor - _HALF, high * square - (u + v - u * v), sigma[j] * sigma[k] - divisor)
            for j, k, u, v in ((j, k, losses[j], losses[k]) for j, k in CYCLIC)
        ]
        return _ends(self.x, self.factors, sigma, s, divisor, gaps)

    def _at_lowest(self, chosen: Vector, others: Vector) -> list[Expression]:
        """Return one value for each axis: from ``chosen`` for the axis with the lowest E_i, from ``others`` for the
        other two axes.

        All formulas select this axis by ``conditions``. On the separatrix two E_i are equal but have different
        derivatives; there, different conditions might select different axes.
        """
        second, third, _ = self.conditions
        first_two = ((chosen[0], others[0]), (others[1], chosen[1]))
        pairs = zip(first_two, others[:2], strict=True)
        selected = [
            call("choose", third, call("choose", second, *values), alternative) for values, alternative in pairs
        ]
        return [*selected, call("choose", third, others[2], chosen[2])]


def levels_of(x: Vector, factors: Vector) -> list[Expression]:
    """Return E_i = α_j α_k x_i² for the free rigid body ẋ_i = α_i x_j x_k; ``factors`` are the α_i.

    The differences of the E_i are first integrals.
    """
    return [factors[j] * factors[k] * e**2 for e, (j, k) in zip(x, CYCLIC, strict=True)]


def _order(levels: Vector) -> tuple[Expression, Expression, Expression]:
    """Return three expressions whose signs give the order of the E_i; ``levels`` has E_1, E_2, E_3.

    The first is positive if E_2 > E_1. The second is positive if E_3 is greater than the smaller of E_1 and E_2. The
    third is positive if E_1 or E_2 is greater than both other values.
    """
    second = levels[1] - levels[0]
    lower, upper = call("choose", second, *levels[:2]), call("choose", second, levels[1], levels[0])
    third = levels[2] - lower
    return second, third, upper - call("choose", third, levels[2], lower)


def sorted_by(conditions: Sequence[Expression], values: Vector) -> tuple[Expression, Expression, Expression]:
    """Return three ``values``, one for each E_i, in the order of increasing E_i.

    ``conditions`` are the three results of `_order`. Their signs determine this order.
    """
    second, third, last = conditions
    lower, upper = call("choose", second, *values[:2]), call("choose", second, values[1], values[0])
    low, upper_pair = call("choose", third, lower, values[2]), call("choose", third, values[2], lower)
    return low, call("choose", last, upper_pair, upper), call("choose", last, upper, upper_pair)


def _ends(
    x: Vector, factors: Vector, sigma: Vector, s: Expression, divisor: Expression, gaps: Vector
) -> list[Expression]:
    """Return the increments of the x_i by the formula for x_i' at the head of the file.

    In this formula, ``factors`` are the α_i, ``sigma`` the σ_i, ``s`` is S and ``divisor`` is D. ``gaps`` are the
    differences σ_j σ_k − D.
    """
    inverse = power(divisor, -1)
    return [
        (x[i] * gap + factors[i] * x[j] * x[k] * (s * sigma[i])) * inverse
        for i, ((j, k), gap) in enumerate(zip(CYCLIC, gaps, strict=True))
    ]


def moved(x: Vector, factors: Vector, sigma: Vector, s: Expression, divisor: Expression) -> list[Expression]:
    """Return the values of the x_i after the flow, by the addition theorem.

    ``factors`` are the α_i; ``sigma``, ``s`` and ``divisor`` are σ_i, S and D in the formula at the head of the file.
    """
    gaps = [sigma[j] * sigma[k] - divisor for j, k in CYCLIC]
    return [a + b for a, b in zip(x, _ends(x, factors, sigma, s, divisor, gaps), strict=True)]


def identities() -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression in the independent symbols x_i, α_i and S.

    All expressions vanish if the increments solve the equations of motion. The E_i, σ_i and D are those at the head of
    the file, but σ_i and D are computed from S alone. Let E_m be the largest E_i. Then σ_m = 1,
    and σ_i = √(1 − (E_m − E_i)S²) for the other two indices i. The product of the two square roots is the time
    derivative of S. Further expressions compare the two formulas for the differences σ_j σ_k − D in `Addition.changes`.
    """
    names = [Symbol("body", kind, i) for kind in ("x", "a") for i in range(3)]
    x, factors = ([symbol(name) for name in symbol_names] for symbol_names in (names[:3], names[3:]))
    name = Symbol("body", "S")
    s, levels = symbol(name), levels_of(x, factors)
    for m, (j, k) in enumerate(CYCLIC):
        sigma = [ONE if i == m else sqrt(1 - (levels[m] - levels[i]) * s**2) for i in range(3)]
        divisor = 1 - levels[m] * s**2
        gaps = [sigma[a] * sigma[b] - divisor for a, b in CYCLIC]
        for (a, b), gap in zip(CYCLIC, gaps, strict=True):
            u, v = 1 - sigma[a], 1 - sigma[b]
            yield f"σ_{a + 1} σ_{b + 1} - D", levels[m] * s**2 - (u + v - u * v) - gap
        changes = _ends(x, factors, sigma, s, divisor, gaps)
        end_values = [e + change for e, change in zip(x, changes, strict=True)]
        for i, (slope, (a, b)) in enumerate(zip(derivatives(changes, name), CYCLIC, strict=True)):
            yield f"dx_{i + 1}'/dt", slope * (sigma[j] * sigma[k]) - factors[i] * end_values[a] * end_values[b]
    yield from _function_identities()


def _function_identities() -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression. If all expressions are 0, the functions S and C of κ satisfy three
    formulas: C² + PS² = 1; dS/dt = C dn; and 1 − C = 8z/(1 + z)² with z = Pκ².

    `phigen.symbolic.elliptic` defines S, C and κ. Here dn is Jacobi's function. The second formula is derived from
    dκ/dt = (1 + z) dn/4.
    """
    name, p, r = Symbol("body", "κ"), symbol(Symbol("body", "P")), symbol(Symbol("body", "R"))
    kappa = symbol(name)
    s, c, _ = functions_of(kappa, p, r)
    yield "C² + PS²", c**2 + p * s**2 - 1
    yield "dS/dt = C dn", derivatives([s], name)[0] * (1 + p * kappa**2) / 4 - c
    yield "1 - C", 8 * (p * kappa**2) * power(1 + p * kappa**2, -2) - (1 - c)
