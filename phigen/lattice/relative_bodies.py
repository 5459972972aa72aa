"""Attracting bodies of a lattice in relative coordinates: H = A + B, Kepler motions and a small remainder.

H = Σ m_i|v_i|²/2 − Σ γ m_i m_j/|q_i − q_j|, in terms of momenta m_i v_i or velocities v_i. In the coordinates of
`phigen.splitting.relative`, the centre of mass takes the place of the first body. Each other body has a position Q_i
and a velocity V_i, which is its relative momentum divided by its reduced mass. All equations of motion are divided by
m_i, and then have a limit at m_i = 0: a body without mass is attracted by others, but attracts none. The parts have
these flows:

- A moves Q_i along a conic section, as the attraction of a mass M_i at 0 does, and the centre of mass along a line;
- B changes V_i by the attraction of the other bodies.

In Jacobi coordinates, M_i = m_0 + … + m_i. Let a_i be the acceleration of body i by all other bodies. The acceleration
of Q_i is a_i − (m_0 a_0 + … + m_{i−1} a_{i−1})/M_{i−1}. The Kepler motion has the acceleration −γ M_i Q_i/|Q_i|³, and B
causes the rest of the acceleration of Q_i. In democratic heliocentric coordinates, M_i = m_0, and B contains the
attraction by all bodies but the first. In these coordinates, B also moves all Q_i with the velocity Σ m_j V_j/m_0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from phigen.errors import SpecError
from phigen.lattice.cancelling import divided
from phigen.lattice.cell import PAIRS, Cell
from phigen.lattice.site_parts import BondSum, CellFlow, CellSplitting, Colouring, SiteMotion, Summand
from phigen.lattice.variations import varied_sum
from phigen.scheme.steps import Gather, Partners, RelativeSites, Sweep
from phigen.spec.model import Spec
from phigen.splitting.exponential import SHIFTED
from phigen.splitting.kepler import KeplerMotion, inverse_length, square
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ONE, ZERO, Expression, gradient, number, power, sqrt, substitute, symbol
from phigen.symbolic.neighbours import ENDS
from phigen.symbolic.symbols import GATHERED, Symbol
from phigen.symbolic.verdict import PROVED, decide_zero

#: Symbol of the central mass M_i in a Kepler motion. The solver computes the M_i from the masses of the bodies.
INNER_MASS = Symbol("inner", "mass")

#: Key of specs that selects relative coordinates, and the value of this key for Jacobi coordinates.
KEY, JACOBI = "coordinates_from", "jacobi"
_COORDINATES = {JACOBI: "Jacobi", "democratic_heliocentric": "democratic heliocentric"}

_FORM = (
    "hamiltonian: {sites: (px**2 + py**2)/(2*m), pairs: -G*m[a]*m[b]/sqrt((x[a] - x[b])**2 + (y[a] - y[b])**2)}, "
    "or velocities with the brackets {x: {vx: 1/m}, y: {vy: 1/m}} and sites: m*(vx**2 + vy**2)/2"
)


class _OtherFormError(Exception):
    """H is not the energy of attracting bodies; the text says why."""


@dataclass(frozen=True)
class LatticeBodies:
    """Attracting bodies, one at each site of a lattice, in relative coordinates. ``change`` is the name of the
    coordinates: "jacobi" or "democratic_heliocentric".

    ``axes`` pairs each position with its momentum if ``momenta`` is true, else with its velocity. ``mass`` is the name
    of the parameter at sites, and ``gravity`` is the constant γ in the energies −γ m_i m_j/|q_i − q_j|.
    """

    cell: Cell
    change: str
    axes: tuple[tuple[str, str], ...]
    mass: str
    gravity: Expression
    momenta: bool

    @property
    def jacobi(self) -> bool:
        """Whether the coordinates are Jacobi coordinates; otherwise they are democratic heliocentric."""
        return self.change == JACOBI

    @cached_property
    def kepler(self) -> KeplerMotion:
        """The Kepler motion of one body: the flow of the part A of H = A + B, at a site."""
        q, v = (tuple(symbol(n) for n in of) for of in zip(*self.axes, strict=True))
        return KeplerMotion(q, v, ONE, self.gravity * symbol(INNER_MASS))

    @property
    def shifts(self) -> tuple[Symbol, ...]:
        """The symbols of the components of the velocity Σ m_j V_j/m_0; () in Jacobi coordinates.

        One part of H moves all positions with this velocity. m_j are masses, and V_j relative velocities.
        """
        return () if self.jacobi else tuple(Symbol(GATHERED, "shift", q) for q, _ in self.axes)

    @property
    def pulls(self) -> BondSum:
        """Minus the acceleration of a body by all others, along each axis, as a sum over the pairs of this body."""
        slopes = gradient(self.cell.pair_hamiltonian, [self.cell.at(q, ("a",)) for q, _ in self.axes])
        inertia = {self.cell.at(self.mass, ("a",)): 1}
        names = [Symbol(GATHERED, q) for q, _ in self.axes]
        return BondSum({n: divided(e, inertia) for n, e in zip(names, slopes, strict=True)})

    def flows(self) -> CellSplitting:
        """Return the flows of the parts of H in relative coordinates: Kepler motions, then the remainder."""
        return CellSplitting((self._motions(), self._remainder()), Colouring(1, (0,) * len(self.cell.axes)))

    def named(self, flow: CellFlow) -> str:
        """Return the name of the part of H that has this flow, for comments of generated code."""
        part = "H - A, where A is the Hamiltonian" if flow.motion is None else "A, the Hamiltonian"
        return f"{part} of the Kepler motions in {_COORDINATES[self.change]} coordinates"

    def sites(self, flows: Sequence[CellFlow]) -> RelativeSites:
        """Return the data that runtimes need about the bodies; ``flows`` are the flows of the parts of H in the order
        of a step.
        """
        fields = self.cell.fields
        axes = tuple((fields.index(q), fields.index(v)) for q, v in self.axes)
        remainder = next(k for k, flow in enumerate(flows) if flow.motion is None)
        return RelativeSites(self.jacobi, self.momenta, axes, self.mass, remainder, len(self.shifts))

    def _motions(self) -> CellFlow:
        motion = self.kepler
        names = [name for axis in self.axes for name in axis]
        increments = dict(zip(names, motion.increments(names), strict=True))
        rates = dict(zip(names, motion.field(names), strict=True))
        moved = SiteMotion(0, increments, (), rates, increments, motion.manner)
        # the Hamiltonian of the motion is the energy of a body, divided by the reduced mass of the body
        return CellFlow(motion.hamiltonian, tuple(increments.values()), motion.manner, (moved,), (), motion=motion)

    def _remainder(self) -> CellFlow:
        """Return the flow of the remainder B = H − A, where A is the Hamiltonian of the Kepler motions.

        The attribute ``hamiltonian`` of the flow is the energy of attraction between two bodies. In Jacobi coordinates,
        the energy −γ (M_i − m_i) m_i/|Q_i| belongs to A, and is subtracted. The head of the file explains M_i and Q_i.
        """
        pulls, time = self.pulls, symbol(TIME)
        q = [symbol(name) for name, _ in self.axes]
        rates = {v: -symbol(n) for (_, v), n in zip(self.axes, pulls.values, strict=True)}
        if self.jacobi:
            towards = self.gravity * symbol(INNER_MASS) * power(sqrt(square(q)), -3)
            rates = {name: e + towards * a for (name, e), a in zip(rates.items(), q, strict=True)}
        rates |= {name: symbol(n) for (name, _), n in zip(self.axes, self.shifts, strict=False)}
        increments = {name: time * e for name, e in rates.items()}
        manner = f"{', '.join(rates)} {SHIFTED}"
        motion = SiteMotion(0, increments, (pulls,), rates, increments, manner)
        density = self.cell.pair_hamiltonian
        if self.jacobi:
            others = symbol(INNER_MASS) - symbol(self.mass)
            density = density + self.gravity * others * symbol(self.mass) * inverse_length(q)
        listed = (*increments.values(), *pulls.values.values())
        return CellFlow(density, listed, manner, (motion,), ((Summand(density, bond=True), (0,)),))


def lattice_bodies(cell: Cell, spec: Spec) -> LatticeBodies:
    """Return the attracting bodies of a spec with relative coordinates.

    Raises `SpecError` at the key ``coordinates_from`` if H is not the energy of attracting bodies.
    """
    _expect_supported(cell, spec)
    try:
        positions = _positions(cell)
        mass, gravity = _attraction(cell, positions)
        axes, momenta = _axes(cell, positions, mass)
    except _OtherFormError as error:
        message = f"{KEY}: {spec.coordinates_from} needs {_FORM}: {error}"
        hint = "list the heaviest body first; with jacobi, list the others by increasing distance from it"
        raise SpecError([spec.diagnostic((KEY,), message, hint)]) from None
    derived = replace(cell, derived=(INNER_MASS,))
    return LatticeBodies(derived, spec.coordinates_from, axes, mass, gravity, momenta)


def of_bodies(parts: tuple[tuple[Sweep, ...], ...], bodies: LatticeBodies) -> tuple[tuple[Sweep, ...], ...]:
    """Return the sweeps of the parts of H, restricted to all bodies but the first.

    In democratic heliocentric coordinates, one part of H moves all positions with the velocity Σ m_j V_j/m_0. Here m_j
    is the mass of body j, and V_j its relative velocity. The sweeps that compute sums over pairs also compute this
    velocity.
    """
    return tuple(tuple(_of_bodies(sweep, bodies) for sweep in part) for part in parts)


def of_massive(partners: Partners) -> Partners:
    """Return the energies and forces of pairs as sums over the bodies with mass. Bodies without mass contribute 0."""

    def massive(gather: Gather) -> Gather:
        return replace(gather, ends=tuple(replace(e, massive=True) for e in gather.ends))

    return replace(partners, energy=massive(partners.energy), field=massive(partners.field))


def _of_bodies(sweep: Sweep, bodies: LatticeBodies) -> Sweep:
    gather = sweep.gather
    if gather:
        shifts = bodies.shifts if not sweep.is_tangent else tuple(map(varied_sum, bodies.shifts))
        ends = tuple(replace(e, first=0 if bodies.jacobi else 1, massive=True) for e in gather.ends)
        gather = Gather(ends, (*gather.names, *shifts))
    tangent = _of_bodies(sweep.tangent, bodies) if sweep.tangent else None
    return replace(sweep, gather=gather, tangent=tangent, first=1)


def _expect_supported(cell: Cell, spec: Spec) -> None:
    """Raise `SpecError` for options of the spec that cannot be combined with relative coordinates."""
    refused = {
        "lattice": (cell.relation != PAIRS, "all bodies must attract one another, as with lattice: {pairs: all}"),
        "monitor": (spec.monitor is not None, "all steps of Kepler motions have the same size in time"),
        "time": (bool(cell.time), "Kepler motions have constant parameters"),
        "forces": (bool(cell.forces.covector or cell.forces.vector), "only the attraction of bodies is integrated"),
        "damping": (cell.forces.damping is not None, "only the attraction of bodies is integrated"),
        "noise": (bool(cell.noise), "only the attraction of bodies is integrated"),
        "adjoint": (spec.extras.adjoint, "gradients with these coordinates are offered only for ordinary specs"),
    }
    for key, (present, reason) in refused.items():
        if present:
            hint = f"remove {KEY}" if key == "lattice" else f"remove {KEY}, or {key}"
            key_text = "a grid or a graph" if key == "lattice" else key
            if key == "adjoint":
                hint = f"phigen show --expand RUN prints an ordinary spec, which takes {KEY} if it has momenta"
            raise SpecError([spec.diagnostic((KEY,), f"{KEY} cannot be combined with {key_text}: {reason}", hint)])


def _positions(cell: Cell) -> list[str]:
    """Return the positions: the fields on which the energy of a pair depends.

    Raises `_OtherFormError` unless there are 2 or 3 positions, and as many further fields.
    """
    places = cell.places(cell.pair_hamiltonian).values()
    positions = [f for f in cell.fields if (f, ("a",)) in places]
    if len(positions) not in (2, 3) or len(cell.fields) != 2 * len(positions):
        shown = f"{len(positions)} fields in the attraction, and {len(cell.fields)} in all"
        raise _OtherFormError(f"there are {shown}; bodies have 2 or 3 positions and as many momenta or velocities")
    return positions


def _attraction(cell: Cell, positions: Sequence[str]) -> tuple[str, Expression]:
    """Return the name of the mass m, and the factor γ of the energy −γ m[a] m[b]/|q_a − q_b| of a pair.

    Raises `_OtherFormError` if the energy of a pair has another form.
    """
    at = [[cell.at(f, (end,)) for f in positions] for end in ENDS]
    apart: dict[str, Expression] = dict.fromkeys([*at[0], *at[1]], ZERO) | {at[0][0]: ONE}
    strength = -substitute([cell.pair_hamiltonian], apart)[0]
    distance = inverse_length([symbol(a) - symbol(b) for a, b in zip(*at, strict=True)])
    if not _vanishes(cell.pair_hamiltonian + strength * distance):
        raise _OtherFormError("the energy of a pair is no multiple of one over the distance")
    names = {base for base, _ in cell.places(strength).values()}
    if len(names) != 1:
        raise _OtherFormError(f"the attraction depends on {len(names)} parameters at sites, not on the masses alone")
    (mass,) = names
    ends = [cell.at(mass, (end,)) for end in ENDS]
    gravity = substitute([strength], dict.fromkeys(ends, ONE))[0]
    if not _vanishes(strength - gravity * symbol(ends[0]) * symbol(ends[1])):
        raise _OtherFormError(f"the attraction is not proportional to {mass}[a]*{mass}[b]")
    return mass, gravity


def _axes(cell: Cell, positions: Sequence[str], mass: str) -> tuple[tuple[tuple[str, str], ...], bool]:
    """Return the pairs (position, momentum or velocity) of all axes. The second result is true for momenta, false for
    velocities.

    Raises `_OtherFormError` unless each position has a constant bracket with exactly one momentum or velocity, and the
    energy of a site is its kinetic energy.
    """
    partners: dict[str, list[tuple[str, Expression]]] = {f: [] for f in cell.fields}
    for (f, g), entry in cell.bracket.items():
        partners[f].append((g, entry))
    if any(len(listed) != 1 for listed in partners.values()) or any(partners[f][0][0] in positions for f in positions):
        raise _OtherFormError("each position needs a bracket with one momentum or velocity, and no other")
    axes = tuple((f, partners[f][0][0]) for f in positions)
    entries, m = [partners[f][0][1] for f in positions], symbol(mass)
    momenta = all(_vanishes(e - ONE) for e in entries)
    if not momenta and not all(_vanishes(e - power(m, -1)) for e in entries):
        raise _OtherFormError(f"the brackets of positions are neither 1 nor 1/{mass}")
    squares = square([symbol(p) for _, p in axes])
    kinetic = squares * power(m, -1) / number(2) if momenta else m * squares / number(2)
    if not _vanishes(cell.hamiltonian - kinetic):
        named = "the momenta" if momenta else "the velocities"
        raise _OtherFormError(f"the energy of a site is not the kinetic energy in {named}, with the mass {mass}")
    return axes, momenta


def _vanishes(e: Expression) -> bool:
    return decide_zero("", [("", e)]).verdict == PROVED
