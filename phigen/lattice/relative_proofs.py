"""Proofs on bodies in relative coordinates: the change of coordinates, the parts of H, and their flows.

Statements that involve all bodies are proved for two and for three bodies, with symbols as masses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from phigen.lattice.flow_proofs import motion_residuals
from phigen.lattice.relative_bodies import INNER_MASS, LatticeBodies
from phigen.lattice.site_parts import CellFlow
from phigen.splitting.kepler import inverse_length, square
from phigen.symbolic.expression import ZERO, Expression, gradient, power, substitute, symbol, total
from phigen.symbolic.symbols import GATHERED, Symbol
from phigen.symbolic.verdict import Statement, decide_zero

#: Numbers of bodies for which statements are proved. In all sums, further bodies have the same role as the third body.
COUNTS = (2, 3)

Vector = list[Expression]


def check(bodies: LatticeBodies, flows: Sequence[CellFlow]) -> Iterator[Statement]:
    """Yield the statements on relative coordinates: canonical change of coordinates, H as a sum of parts, flows of the
    parts.
    """
    few = [_FewBodies(bodies, count) for count in COUNTS]
    positive = [n for f in few for n in f.mass_names]
    detail = "for two and three bodies, with symbols for masses"
    residuals = [r for f in few for r in f.canonical()]
    yield decide_zero("the change of coordinates is canonical", residuals, positive, detail)
    residuals = [r for f in few for r in f.sums()]
    yield decide_zero("H = H_1 + H_2", residuals, positive, detail)
    for k, flow in enumerate(flows, 1):
        name = f"the flow Φ of H_{k}: Φ_0 = 1, dΦ_t/dt = π∇H_{k}∘Φ_t"
        listed = list(flow.motion.residuals()) if flow.motion else [
            *(r for motion in flow.motions for r in motion_residuals(motion)),
            *(r for f in few for r in f.shifts(flow)),
        ]  # fmt: skip
        yield decide_zero(name, listed, positive, flow.manner + ("" if flow.motion else f"; {detail}"))


@dataclass(frozen=True)
class _FewBodies:
    """The equations of a small number of bodies, with symbols for masses, relative positions and relative velocities.

    In relative coordinates, body 0 stands for the centre of mass.
    """

    bodies: LatticeBodies
    count: int

    @property
    def mass_names(self) -> list[Symbol]:
        """The symbols of the masses m_i, by body."""
        return [Symbol("mass", i) for i in range(self.count)]

    @property
    def masses(self) -> Vector:
        """The masses m_i of all bodies as expressions."""
        return [symbol(n) for n in self.mass_names]

    @property
    def others(self) -> range:
        """The indices of all bodies but the first."""
        return range(1, self.count)

    def names(self, kind: str, body: int) -> list[Symbol]:
        """Return the symbols of the relative position (``kind`` Q) or velocity (``kind`` V) of a body along each
        axis.
        """
        return [Symbol(kind, body, axis) for axis, _ in enumerate(self.bodies.axes)]

    def inner(self, i: int) -> Expression:
        """Return the central mass M_i: m_0 + … + m_i in Jacobi coordinates, m_0 in democratic heliocentric
        coordinates.
        """
        return total(self.masses[: i + 1]) if self.bodies.jacobi else self.masses[0]

    def inertia(self, i: int) -> Expression:
        """Return the reduced mass 1/w_i of body i, which relates relative momentum and velocity: V_i = w_i P_i."""
        if not self.bodies.jacobi:
            return self.masses[i]
        return self.masses[i] * self.inner(i - 1) * power(self.inner(i), -1)

    def cartesian(self, kind: str) -> list[Vector]:
        """Return the Cartesian positions (``kind`` Q) or velocities (``kind`` V) of all bodies, as functions of
        their relative coordinates.
        """
        m, sum_of_masses = self.masses, total(self.masses)
        centre, *relative = ([symbol(n) for n in self.names(kind, i)] for i in range(self.count))
        if self.bodies.jacobi:
            listed, middle = list[Vector](), centre
            for i in reversed(self.others):
                share = m[i] * power(self.inner(i), -1)
                listed.append([c + (1 - share) * e for c, e in zip(middle, relative[i - 1], strict=True)])
                middle = [c - share * e for c, e in zip(middle, relative[i - 1], strict=True)]
            return [middle, *reversed(listed)]
        moments = [total(m[i] * relative[i - 1][k] for i in self.others) for k, _ in enumerate(centre)]
        if kind == "V":
            first = [c - e * power(m[0], -1) for c, e in zip(centre, moments, strict=True)]
            return [first, *([c + e for c, e in zip(centre, of, strict=True)] for of in relative)]
        first = [c - e * power(sum_of_masses, -1) for c, e in zip(centre, moments, strict=True)]
        return [first, *([c + e for c, e in zip(first, of, strict=True)] for of in relative)]

    def product(self, positions: str, velocities: str) -> Expression:
        """Return the difference of two sums, which is 0 if the change of coordinates is canonical.

        The first sum is Σ m_i q_i·v_i, in Cartesian coordinates. The second is M R·V + Σ Q_i·V_i/w_i, with relative
        positions Q_i, relative velocities V_i and reduced masses 1/w_i. R is the centre of mass, V its velocity, and M
        the total mass. ``positions`` and ``velocities`` are the kinds (see `names`) of the symbols for Q_i and V_i.
        """
        pairs = zip(self.masses, self.cartesian(positions), self.cartesian(velocities), strict=True)
        weights = [total(self.masses), *(self.inertia(i) for i in self.others)]
        relative = (
            w * symbol(a) * symbol(b)
            for i, w in enumerate(weights)
            for a, b in zip(self.names(positions, i), self.names(velocities, i), strict=True)
        )
        return total(m * a * b for m, q, v in pairs for a, b in zip(q, v, strict=True)) - total(relative)

    def canonical(self) -> Iterator[tuple[str, Expression]]:
        """Yield a residual that is 0 if the change to relative coordinates is canonical (see `product`)."""
        yield f"{self.count} bodies", self.product("Q", "V")

    def recoil(self) -> Expression:
        """Return |Σ m_j V_j|²/2m_0, the kinetic energy that does not belong to Kepler motions; 0 in Jacobi
        coordinates.

        m_j are masses, and V_j velocities in democratic heliocentric coordinates.
        """
        if self.bodies.jacobi:
            return ZERO
        axes = range(len(self.bodies.axes))
        moments = [total(self.masses[i] * symbol(self.names("V", i)[k]) for i in self.others) for k in axes]
        return square(moments) * power(self.masses[0], -1) / 2

    def sums(self) -> Iterator[tuple[str, Expression]]:
        """Yield residuals that are 0 if H is the sum of its parts in relative coordinates.

        There are residuals for the kinetic energy, and for the positions of bodies relative to the first body.
        """
        yield f"kinetic energy of {self.count} bodies", self.product("V", "V") / 2 - self.recoil()
        q = self.cartesian("Q")
        for i in self.others if not self.bodies.jacobi else (1,):
            for k, n in enumerate(self.names("Q", i)):
                yield f"q_{i} - q_0", q[i][k] - q[0][k] - symbol(n)

    def remainder(self) -> Expression:
        """Return the remainder B = H − A in relative coordinates, where A is the Hamiltonian of the Kepler motions."""
        gravity, m, q = self.bodies.gravity, self.masses, self.cartesian("Q")
        pairs = [(i, j) for i, j in combinations(range(self.count), 2) if self.bodies.jacobi or i > 0]
        energies = (
            -(gravity * m[i] * m[j] * inverse_length([a - b for a, b in zip(q[i], q[j], strict=True)]))
            for i, j in pairs
        )
        kepler = (
            gravity * self.inner(i) * self.inertia(i) * inverse_length([symbol(n) for n in self.names("Q", i)])
            for i in (self.others if self.bodies.jacobi else ())
        )
        return total([*energies, *kepler]) + self.recoil()

    def pull(self, a: int, b: int, k: int) -> Expression:
        """Return minus the acceleration of body ``a`` by body ``b`` along axis ``k``.

        The formula is the one in the kernel for the remainder of H (see `remainder`).
        """
        q, cell = self.cartesian("Q"), self.bodies.cell
        value = [*self.bodies.pulls.values.values()][k]
        places = {cell.at(self.bodies.mass, ("a",)): self.masses[a], cell.at(self.bodies.mass, ("b",)): self.masses[b]}
        for axis, (name, _) in enumerate(self.bodies.axes):
            places |= {cell.at(name, ("a",)): q[a][axis], cell.at(name, ("b",)): q[b][axis]}
        return substitute([value], places)[0]

    def gathered(self, i: int) -> dict[str, Expression]:
        """Return the sums over bodies in the equations of motion of body ``i`` with the Hamiltonian
        `remainder`.

        The result maps the symbol of each sum to its expression.
        """
        axes, first = range(len(self.bodies.axes)), 0 if self.bodies.jacobi else 1

        def pulled(a: int, k: int) -> Expression:
            return total(self.pull(a, b, k) for b in range(first, self.count) if b != a)

        sums: dict[str, Expression] = {}
        for k, (name, _) in enumerate(self.bodies.axes):
            before = (self.masses[j] * pulled(j, k) for j in range(i)) if self.bodies.jacobi else ()
            sums[Symbol(GATHERED, name)] = pulled(i, k) - total(before) * power(self.inner(i - 1), -1)
        for k, name in zip(axes, self.bodies.shifts, strict=False):
            moment = total(self.masses[j] * symbol(self.names("V", j)[k]) for j in self.others)
            sums[name] = moment * power(self.masses[0], -1)
        return sums

    def shifts(self, flow: CellFlow) -> Iterator[tuple[str, Expression]]:
        """Yield residuals that are 0 if ``flow`` solves the correct equations of motion.

        The equations are Q̇_i = w_i ∂B/∂V_i and V̇_i = −w_i ∂B/∂Q_i with B = H − A (see `remainder`) and the reduced
        masses 1/w_i.
        """
        (motion,), b = flow.motions, self.remainder()
        for i in self.others:
            values = {**self.gathered(i), INNER_MASS: self.inner(i)}
            for axis, (q, v) in enumerate(self.bodies.axes):
                values |= {q: symbol(self.names("Q", i)[axis]), v: symbol(self.names("V", i)[axis])}
            for axis, (q, v) in enumerate(self.bodies.axes):
                of_q, of_v = gradient(b, [self.names("Q", i)[axis], self.names("V", i)[axis]])
                rates = substitute([motion.rates.get(q, ZERO), motion.rates.get(v, ZERO)], values)
                weight = power(self.inertia(i), -1)
                yield f"rate of {q} of body {i}", rates[0] - weight * of_v
                yield f"rate of {v} of body {i}", rates[1] + weight * of_q
