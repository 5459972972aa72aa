"""Kepler motions of attracting bodies in relative coordinates Q_i, P_i, which are linear forms of Cartesian
coordinates.

Bodies 0, …, N have masses m_i, positions q_i and momenta p_i, and k_ij is the strength of the attraction −k_ij/|q_i −
q_j|. Let M_i = m_0 + … + m_i, and M be the total mass. The part A of H is the sum of w_i|P_i|²/2 − K_i/|Q_i| over i ≥
1, plus the energy |p_0 + … + p_N|²/2M of the centre of mass. The part B is H − A.

- *Jacobi*: Q_i = q_i − (m_0 q_0 + … + m_{i−1} q_{i−1})/M_{i−1} and P_i = p_i − (m_i/M_i)(p_0 + … + p_i), with w_i =
  M_i/(m_i M_{i−1}) and K_i = Σ_{j<i} k_ij. A contains the whole kinetic energy.
- *Democratic heliocentric*: Q_i = q_i − q_0 and P_i = p_i − (m_i/M)(p_0 + … + p_N), with w_i = 1/m_i and K_i = k_i0. A
  lacks one term of the kinetic energy, |p_0 − (m_0/M)(p_0 + … + p_N)|²/2m_0.

J. Wisdom, M. Holman, Symplectic maps for the n-body problem, Astronomical Journal 102 (1991); M. J. Duncan, H. F.
Levison, M. H. Lee, A multiple time step symplectic algorithm for integrating close encounters, Astronomical Journal 116
(1998).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from operator import add

from phigen.splitting.kepler import KeplerMotion, Vector, identities, inverse_length, square
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ZERO, Expression, fold, power, rebuild, substitute, symbol, total
from phigen.symbolic.symbols import Symbol


@dataclass(frozen=True)
class AttractingBodies:
    """Attracting bodies: for each body the names of its positions and of its momenta, and its mass.

    ``strengths`` maps (i, j) with i > j to the strength k_ij of the attraction −k_ij/|q_i − q_j|.
    """

    positions: tuple[tuple[str, ...], ...]
    momenta: tuple[tuple[str, ...], ...]
    masses: tuple[Expression, ...]
    strengths: Mapping[tuple[int, int], Expression]

    @property
    def axes(self) -> int:
        """The dimension of the space in which the bodies move."""
        return len(self.positions[0])

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all coordinates: the positions of all bodies, then the momenta of all bodies."""
        return tuple(name for names in (self.positions, self.momenta) for body in names for name in body)

    @property
    def kinetic(self) -> Expression:
        """The kinetic energy of all bodies, Σ |p_i|²/(2 m_i)."""
        return total(square(p) * power(m, -1) / 2 for p, m in zip(map(_vector, self.momenta), self.masses, strict=True))

    def attraction(self, i: int, j: int) -> Expression:
        """Return the energy −k_ij/|q_i − q_j| of the bodies i and j; 0 if they do not attract each other."""
        strength = self.strengths.get((i, j), ZERO)
        return ZERO if strength.is_zero else -strength * inverse_length(self.between(i, j))

    def between(self, i: int, j: int) -> list[Expression]:
        """Return the vector q_i − q_j from body j to body i."""
        return _difference(_vector(self.positions[i]), _vector(self.positions[j]))


@dataclass(frozen=True)
class RelativeMotions:
    """The flow of attracting bodies with the Hamiltonian A, which the head of the file defines. Bodies move on Kepler
    orbits in relative coordinates, and the centre of mass moves in a straight line.

    ``hamiltonian`` is A in Cartesian coordinates. ``kepler`` has the Kepler motions; their positions Q_i and momenta
    P_i are linear forms. ``total_momentum`` and ``inverse_mass`` are those of the centre of mass. ``spread`` maps each
    Cartesian coordinate to its change in the flow. This change is a linear form in symbols for the changes of the Q_i,
    the P_i and the centre of mass. ``masses`` has pairs for proofs: a mass m_i or a sum M_i, and the expression that
    replaces it.
    """

    hamiltonian: Expression
    kepler: tuple[KeplerMotion, ...]
    total_momentum: Vector
    inverse_mass: Expression
    spread: Mapping[str, Expression]
    masses: tuple[tuple[Expression, Expression], ...] = ()

    @property
    def manner(self) -> str:
        """The motion in words, for reports."""
        return f"{len(self.kepler)} relative positions moved along conic sections, the centre of mass shifted"

    def field(self, names: Sequence[str]) -> list[Expression]:
        """Return the time derivatives of the coordinates ``names`` along the flow of this object."""
        return self._spread(names, [motion.rates() for motion in self.kepler], self.drift)

    def increments(self, names: Sequence[str]) -> list[Expression]:
        """Return the increments of the coordinates ``names`` in the flow of this object over the time `TIME`."""
        shift = [symbol(TIME) * e for e in self.drift]
        return self._spread(names, [motion.changes() for motion in self.kepler], shift)

    def opaque(self, roots: Sequence[Expression]) -> list[Expression]:
        """Return the expressions in a form for proofs: symbols stand for each |Q_i|⁻³ and M_i, and m_i is written as
        M_i − M_{i−1}.

        If an expression vanishes in this form, it vanishes for all masses and positions.
        """
        cubes = [(motion.cube, symbol(Symbol("cube", i))) for i, motion in enumerate(self.kepler, 1)]
        by_node = {id(node): value for node, value in (*cubes, *self.masses)}
        return fold(roots, lambda e, args: by_node.get(id(e)) or rebuild(e, args))

    def residuals(self) -> Iterator[tuple[str, Expression]]:
        """Yield pairs of a label and an expression. If all expressions vanish, the increments solve the equations of
        motion.

        ``spread`` converts changes of the relative coordinates Q_i, P_i to changes of Cartesian coordinates. The
        expressions with labels ``change of …`` vanish if ``spread`` is the inverse of the definitions of Q_i and P_i.
        The other expressions vanish if the changes of Q_i and P_i are those of Kepler motions.
        """
        for i, motion in enumerate(self.kepler, 1):
            forms = substitute([*motion.position, *motion.momentum], self.spread)
            axes = len(motion.position)
            for form, change in zip(forms, [*changes_of("Q", i, axes), *changes_of("P", i, axes)], strict=True):
                yield f"change of body {i}", form - change
        for form in substitute(self.total_momentum, self.spread):
            yield "change of the total momentum", form
        yield from identities()

    @property
    def drift(self) -> list[Expression]:
        """The velocity of the centre of mass."""
        return [self.inverse_mass * e for e in self.total_momentum]

    def _spread(
        self, names: Sequence[str], values: Sequence[tuple[list[Expression], list[Expression]]], of_centre: Vector
    ) -> list[Expression]:
        """Return the changes of the Cartesian coordinates ``names``, computed from changes of relative
        coordinates.

        ``values`` has a pair for each i: the changes of Q_i and of P_i. ``of_centre`` is the change of the centre of
        mass.
        """
        axes = len(of_centre)
        changes: dict[str, Expression] = dict(zip(_names("R", 0, axes), of_centre, strict=True))
        for i, pair in enumerate(values, 1):
            for kind, values_of_kind in zip("QP", pair, strict=True):
                changes |= dict(zip(_names(kind, i, axes), values_of_kind, strict=True))
        all_changes = [self.spread.get(name, ZERO) for name in names]
        return substitute(all_changes, changes)


def jacobi(bodies: AttractingBodies) -> tuple[RelativeMotions, Expression]:
    """Return the division H = A + B in Jacobi coordinates: the motion of A, and B as an expression in Cartesian
    coordinates."""
    masses = bodies.masses
    q, p = (list(map(_vector, names)) for names in (bodies.positions, bodies.momenta))
    mass = list(accumulate(masses, add))
    inverse = [power(m, -1) for m in mass]
    share = [m * r for m, r in zip(masses, inverse, strict=True)]
    momenta = list(accumulate(p, _sum))
    count, centre = len(q), q[0]
    forms = list[list[Expression]]()
    for i in range(1, count):
        forms.append(_difference(q[i], centre))
        centre = [c + share[i] * e for c, e in zip(centre, forms[-1], strict=True)]
    conjugate = [_difference(p[i], [share[i] * e for e in momenta[i]]) for i in range(1, count)]
    weights = [mass[i] * inverse[i - 1] * power(masses[i], -1) for i in range(1, count)]
    strengths = [total(bodies.strengths.get((i, j), ZERO) for j in range(i)) for i in range(1, count)]

    motions = [
        KeplerMotion(tuple(a), tuple(b), w, k) for a, b, w, k in zip(forms, conjugate, weights, strengths, strict=True)
    ]
    attractions = [-k * inverse_length(form) for k, form in zip(strengths, forms, strict=True)]
    a = bodies.kinetic + total(attractions)
    pairs = [bodies.attraction(i, j) for i in range(2, count) for j in range(i)]
    b = total([*pairs, *(-e for e in attractions[1:])])
    spread = _spread_from_jacobi(bodies, mass)
    return RelativeMotions(a, tuple(motions), momenta[-1], inverse[-1], spread, tuple(_independent(masses, mass))), b


def _independent(masses: Sequence[Expression], sums: Sequence[Expression]) -> Iterator[tuple[Expression, Expression]]:
    """Yield pairs: an expression that contains masses, and the expression that replaces it in proofs.

    The sum M_i = m_0 + … + m_i is replaced by a symbol, and the mass m_i by M_i − M_{i−1}, a difference of two symbols.
    ``sums`` are the M_i. Masses that are numbers are left as they are.
    """
    previous = ZERO
    for i, (m, sum_of_masses) in enumerate(zip(masses, sums, strict=True)):
        if m.is_number:
            previous = previous + m
            continue
        value = symbol(Symbol("mass", i))
        yield from ((sum_of_masses, value), (m, value - previous))
        previous = value


def democratic_heliocentric(bodies: AttractingBodies) -> tuple[RelativeMotions, Expression]:
    """Return the division H = A + B in democratic heliocentric coordinates: the motion of A, and B as an expression.

    B is an expression in Cartesian coordinates.
    """
    axes, masses = range(bodies.axes), bodies.masses
    q, p = (list(map(_vector, names)) for names in (bodies.positions, bodies.momenta))
    inverse = power(total(masses), -1)
    shares = [m * inverse for m in masses]
    momentum = [total(momentum_of_body[axis] for momentum_of_body in p) for axis in axes]
    count = len(q)
    forms = [_difference(q[i], q[0]) for i in range(1, count)]
    conjugate = [_difference(p[i], [shares[i] * e for e in momentum]) for i in range(1, count)]
    strengths = [bodies.strengths.get((i, 0), ZERO) for i in range(1, count)]

    motions = [
        KeplerMotion(tuple(a), tuple(b), power(m, -1), k)
        for a, b, m, k in zip(forms, conjugate, masses[1:], strengths, strict=True)
    ]
    of_star = [a - shares[0] * b for a, b in zip(p[0], momentum, strict=True)]
    b = square(of_star) * power(masses[0], -1) / 2 + total(
        bodies.attraction(i, j) for i in range(2, count) for j in range(1, i)
    )
    kinetic = total(m.inverse_mass / 2 * square(m.momentum) for m in motions) + inverse / 2 * square(momentum)
    a = kinetic + total(bodies.attraction(i, 0) for i in range(1, count))
    return RelativeMotions(a, tuple(motions), momentum, inverse, _spread_from_star(bodies, shares)), b


def _spread_from_jacobi(bodies: AttractingBodies, mass: Sequence[Expression]) -> dict[str, Expression]:
    """Return the changes of Cartesian coordinates as linear forms of the changes of Jacobi coordinates.

    The Cartesian coordinates q_i, p_i follow from the Jacobi coordinates Q_i, P_i, from the last body to the first:
    R_{i−1} = R_i − s_i Q_i, q_i = R_{i−1} + Q_i, p_i = P_i + s_i T_i and T_{i−1} = T_i − p_i. Here M_i is the mass, R_i
    the centre of mass and T_i the total momentum of the bodies 0, …, i, and s_i = m_i/M_i. The total momentum T_N does
    not change.

    The masses occur as s_i only, here and in the definitions of Q_i and P_i. So this map is exactly inverse to the
    definitions, and canonical, even if the s_i are rounded. With several different quotients of masses, rounding errors
    would cause a drift of the energy.
    """
    spread = dict[str, Expression]()
    centre: list[Expression] = changes_of("R", 0, bodies.axes)
    momentum: list[Expression] = [ZERO] * bodies.axes
    for i in range(len(mass) - 1, 0, -1):
        share = bodies.masses[i] * power(mass[i], -1)
        of_q, of_p = changes_of("Q", i, bodies.axes), changes_of("P", i, bodies.axes)
        centre = [c - share * d for c, d in zip(centre, of_q, strict=True)]
        moved = [d + share * t for d, t in zip(of_p, momentum, strict=True)]
        spread |= zip(bodies.positions[i], _sum(centre, of_q), strict=True)
        spread |= zip(bodies.momenta[i], moved, strict=True)
        momentum = _difference(momentum, moved)
    return spread | dict(zip((*bodies.positions[0], *bodies.momenta[0]), (*centre, *momentum), strict=True))


def _spread_from_star(bodies: AttractingBodies, shares: Sequence[Expression]) -> dict[str, Expression]:
    """Return the changes of Cartesian coordinates as linear forms of the changes of democratic heliocentric
    coordinates.

    ``shares`` are the masses divided by the total mass; body 0 is the star.
    """
    axes, spread, planets = bodies.axes, dict[str, Expression](), range(1, len(shares))
    of_q, of_p = ([changes_of(kind, i, axes) for i in planets] for kind in "QP")
    weighted = [total(m * d[axis] for m, d in zip(shares[1:], of_q, strict=True)) for axis in range(axes)]
    star = _difference(changes_of("R", 0, axes), weighted)
    spread |= zip(bodies.positions[0], star, strict=True)
    spread |= zip(bodies.momenta[0], [-total(d[axis] for d in of_p) for axis in range(axes)], strict=True)
    for i in planets:
        spread |= zip(bodies.positions[i], _sum(star, of_q[i - 1]), strict=True)
        spread |= zip(bodies.momenta[i], of_p[i - 1], strict=True)
    return spread


def changes_of(kind: str, body: int, axes: int) -> list[Expression]:
    """Return the symbols of the change of a vector, one for each axis.

    The vector is named by ``kind``: the relative position Q or momentum P of the ``body``, or the centre of mass R.
    """
    return [symbol(name) for name in _names(kind, body, axes)]


def _names(kind: str, body: int, axes: int) -> list[Symbol]:
    return [Symbol("change", kind, body, axis) for axis in range(axes)]


#: Name of relative coordinates in specs → function that divides H into A + B (see the head of the file). The function
#: returns the flow of A, and the Hamiltonian B.
CHANGES: Mapping[str, Callable[[AttractingBodies], tuple[RelativeMotions, Expression]]] = {
    "jacobi": jacobi,
    "democratic_heliocentric": democratic_heliocentric,
}


def _vector(names: Sequence[str]) -> list[Expression]:
    return [symbol(name) for name in names]


def _sum(a: Vector, b: Vector) -> list[Expression]:
    return [x + y for x, y in zip(a, b, strict=True)]


def _difference(a: Vector, b: Vector) -> list[Expression]:
    return [x - y for x, y in zip(a, b, strict=True)]
