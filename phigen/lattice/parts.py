"""H of a lattice as a sum of parts whose flows move each site by itself.

A part is a sum over sites of terms whose coordinates commute over all the lattice: its gradient is constant along its
flow, and each site moves by ẋ = Σ {x, a} ∂V/∂a with the values of its neighbours as constants, an equation of one site.
Where π couples neighbours, or a term mixes what does not commute, sites get colours: the terms that begin at sites of
one colour are then taken apart from the others. Terms of one site alone may be parts by their own flow too.

Where colours do not fit a size, as two of them a ring of odd length, they are counted from site 0 on, and do not match
where the last site meets it. The terms that begin at the last sites, the *seam*, are then parts of their own: so wide
that all others see but one end of it. Beside it a site moves by what its neighbours are, which `BEGINS` tells.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from phigen.errors import Diagnostic, Location, SpecError
from phigen.lattice.cell import GRID, PERIODIC, Cell
from phigen.scheme.steps import Seam
from phigen.splitting.conflicts import Conflicts, coloured
from phigen.splitting.flow import Flow, NoFlowError, Solved, Term, flow_of, joint_flow, solved
from phigen.splitting.ring import KICK, TIME, Ring
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    gradient,
    substitute,
    symbol,
    symbols_of,
    total,
)
from phigen.symbolic.neighbours import Offset, minus, plus, steps
from phigen.symbolic.symbols import BEGINS, GATHERED, PRESENT, Symbol
from phigen.symbolic.tower import Tower

#: Most colours of sites.
MOST_COLOURS = 4

#: The kind of symbols of the components of the gradient of a part.
FORCE = "force"

Steps = tuple[int, ...]
#: A field, and the colour of the sites where it is meant.
Coordinate = tuple[str, int]


@dataclass(frozen=True)
class Summand:
    """A term of H: at sites, or of a ``bond`` or a pair. ``low`` and ``high`` are the offsets that it reaches."""

    expression: Expression
    low: Steps = ()
    high: Steps = ()
    bond: bool = False


@dataclass(frozen=True)
class Colouring:
    """The colour of a site: Σ weights·position modulo ``count``.

    With ``seams``, one along each axis, it takes every size.
    """

    count: int = 1
    weights: Steps = ()
    seams: tuple[Seam, ...] = ()

    def at(self, colour: int, offset: Offset) -> int:
        """The colour of the site at an offset from one of a given colour."""
        if self.count == 1:
            return 0
        return (colour + sum(w * o for w, o in zip(self.weights, steps(offset), strict=True))) % self.count

    def periods(self, boundary: Sequence[str]) -> Steps:
        """What sizes must be multiples of, along each axis."""
        if self.seams:
            return (1,) * len(boundary)
        return tuple(
            self.count // math.gcd(self.count, w) if b == PERIODIC and w else 1
            for w, b in zip(self.weights or (0,) * len(boundary), boundary, strict=True)
        )

    @property
    def windows(self) -> tuple[int, ...]:
        """The seams that a site may lie on, as bits of the axes: 0 is none of them."""
        axes = sum(1 << a for a, seam in enumerate(self.seams) if seam.period > 1)
        return tuple(w for w in range(axes + 1) if w & axes == w)

    def on_seams(self) -> set[int]:
        """The colours that sites on a seam may have: of a single narrow one not that at the end of a period."""
        along = [(s, w) for s, w in zip(self.seams, self.weights, strict=True) if w]
        if len(along) > 1 or along[0][0].wide > 1:
            return set(range(self.count))
        ((seam, weight),) = along
        return {weight * k % self.count for k in range(seam.period - 1)}

    def with_seams(self, cell: Cell) -> Colouring:
        """The colouring with seams so wide that terms at their two ends commute, and that what reads of what those at
        one end move is not moved by those at the other."""
        return replace(self, seams=tuple(_seam(cell, a, p) for a, p in enumerate(self.periods(cell.boundary))))


@dataclass(frozen=True)
class BondSum:
    """What bonds or pairs add up at a site: for each symbol an expression in ``x[a]``, here, and ``x[b]``, over there.

    ``end`` tells at which end of the bond, as it is written, the site is: a, b, or either. Of a part that belongs to
    one colour, ``chosen`` tells which of the two has it: ``here``, ``there``, or none.
    """

    values: Mapping[str, Expression]
    end: str = ""
    chosen: str = ""


@dataclass(frozen=True)
class SiteMotion:
    """How sites of one colour move: increments of the fields, which read the site and neighbours that stand still.

    Without a colour they are those of all sites.
    ``gathered`` are the sums over bonds or pairs that the increments read as symbols `GATHERED`.
    ``solution`` are the increments with a symbol for each component of the gradient, which solve ẋ = ``rates``;
    ``components`` is what these symbols of a force stand for. ``manner`` says how the fields move.
    """

    colour: int | None
    increments: Mapping[str, Expression]
    gathered: tuple[BondSum, ...] = ()
    rates: Mapping[str, Expression] = field(default_factory=dict)
    solution: Mapping[str, Expression] = field(default_factory=dict)
    manner: str = ""
    components: Mapping[str, Expression] = field(default_factory=dict)


def _seam(cell: Cell, axis: int, period: int) -> Seam:
    """The seam along an axis.

    A term reads sites up to h apart, and moves those up to n from where it begins. What it moves reads at these two
    alone, unless brackets depend on sites that they do not couple.
    """
    if period == 1:
        return Seam()
    h, p = cell.hamiltonian_reach[axis], cell.poisson_reach[axis]
    n = h + p
    between = all(
        offset in (cell.origin, cell.place(other)[1])
        for (_, other), entry in cell.bracket.items()
        for _, offset in cell.places(entry).values()
    )
    wide = h if cell.is_local else h + n if between else 2 * n + p
    damping = [] if cell.forces.damping is None else cell.places(cell.forces.damping).values()
    return Seam(period, max([wide, *(h + abs(steps(offset)[axis]) for _, offset in damping)]), n)


def at_every_site(motions: Sequence[SiteMotion], count: int) -> tuple[SiteMotion, ...]:
    """One motion for those of all colours where they are the same."""
    same = (
        count > 1 and len(motions) == count and all(replace(m, colour=motions[0].colour) == motions[0] for m in motions)
    )
    return (replace(motions[0], colour=None),) if same else tuple(motions)


@dataclass(frozen=True)
class CellFlow(Flow):
    """The flow of a part of H over the lattice: all ``motions`` may be made in any order, at all sites in any order.

    ``summands`` are the terms of the part with the colours of the sites where they begin. On graphs the part of one
    colour stands for those of all, if it is ``by_colour``. Where there are seams, ``beside`` is how sites near them
    move, by the terms that begin on those of the ``window``; on the seams no others do.
    """

    motions: tuple[SiteMotion, ...] = ()
    summands: tuple[tuple[Summand, tuple[int, ...]], ...] = ()
    by_colour: bool = False
    beside: SiteMotion | None = None
    window: int = 0

    @property
    def every_motion(self) -> tuple[SiteMotion, ...]:
        """The motions, with that beside seams."""
        return (*self.motions, *([self.beside] if self.beside else []))


@dataclass(frozen=True)
class CellSplitting:
    """The flows of the parts of H, with the colours that they need."""

    flows: tuple[CellFlow, ...]
    colouring: Colouring


class NoPartError(Exception):
    """A term belongs to no part with a flow; the text says why."""

    def __init__(self, expression: Expression, reason: str) -> None:
        super().__init__(reason)
        self.expression, self.reason = expression, reason


def splittings(
    cell: Cell, place: Location | None = None, search: Callable[[Cell, Colouring], PartSearch] | None = None
) -> Iterator[CellSplitting]:
    """H as sums of parts with elementary flows, by a search for each colouring: few colours first, then few parts.

    Raises `SpecError`, at ``place``, naming the term in the way, if there are none.
    """
    search = search or PartSearch
    refused: NoPartError | None = None
    some = False
    for _, alike in itertools.groupby(colourings(cell), lambda colouring: colouring.count):
        found: list[CellSplitting] = []
        for colouring in alike:
            try:
                found.append(search(cell, colouring).splitting())
            except NoPartError as error:
                refused = refused or error
        some = some or bool(found)
        yield from sorted(found, key=lambda parts: len(parts.flows))
    if not some:
        assert refused is not None
        message = f"scheme splitting: the term {refused.expression} has no elementary flow on the lattice"
        hint = "terms in coordinates that commute over the whole lattice split, and terms of one site with a flow"
        raise SpecError([Diagnostic(f"{message}: {refused.reason}", place, hint)])


def colourings(cell: Cell) -> Iterator[Colouring]:
    """All that are tried, those with the fewest colours first."""
    yield Colouring(1, (0,) * len(cell.axes))
    if cell.relation != GRID:
        return
    for count in range(2, MOST_COLOURS + 1):
        for weights in itertools.product(range(count), repeat=len(cell.axes)):
            if any(weights):
                yield Colouring(count, weights)


def summands_of(cell: Cell) -> list[Summand]:
    """The terms of H as they are written; 0 is a term of H = 0, so that there is a flow, in which nothing moves."""
    if cell.relation == GRID:
        return [Summand(term, *cell.extent(term)) for term in cell.terms or (ZERO,)]
    bonds = cell.bond_hamiltonian + cell.pair_hamiltonian
    summands = [
        *(Summand(term) for term in cell.terms),
        *(Summand(term, bond=True) for term in cell.additive_terms(bonds)),
    ]
    return summands or [Summand(ZERO)]


@dataclass
class PartSearch:
    """The search for parts with one colouring."""

    cell: Cell
    colouring: Colouring
    _couples: dict[str, list[tuple[str, Offset]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for f, other in self.cell.bracket:
            self._couples.setdefault(f, []).append(self.cell.place(other))

    def splitting(self) -> CellSplitting:
        """All parts."""
        own: list[Summand] = []
        classes: list[tuple[Summand, int]] = []
        for term in summands_of(self.cell):
            for piece in self._pieces(term):
                if found := self._classes(piece):
                    classes += found
                elif self._is_own(piece):
                    own.append(piece)
                else:
                    reason = "it mixes coordinates that do not commute"
                    raise NoPartError(piece.expression, reason)
        neighbours = [
            {j for j, b in enumerate(classes) if j != i and not self._commute(a, b)} for i, a in enumerate(classes)
        ]
        numbers: dict[Coordinate, int] = {}
        supports = [[numbers.setdefault(f, len(numbers)) for f in self._support(c)] for c in classes]
        colours = coloured(neighbours, supports)
        flows = [
            self.flow([c for c, k in zip(classes, colours, strict=True) if k == colour])
            for colour in sorted(set(colours))
        ]
        return CellSplitting((*flows, *self._own_flows(own)), self.colouring)

    # --- what commutes

    def _support(self, term: tuple[Summand, int]) -> list[Coordinate]:
        summand, colour = term
        places = self.cell.places(summand.expression).values()
        fields = {(f, self.colouring.at(colour, o)) for f, o in places if f in self.cell.fields}
        return sorted(fields)

    def _commute(self, a: tuple[Summand, int], b: tuple[Summand, int]) -> bool:
        return not any(self._coupled(f, g) for f in self._support(a) for g in self._support(b))

    def _coupled(self, a: Coordinate, b: Coordinate) -> bool:
        """Whether some site of the one colour has a bracket with one of the other."""
        return any(g == b[0] and self.colouring.at(a[1], d) == b[1] for g, d in self._couples.get(a[0], ()))

    def _classes(self, term: Summand) -> list[tuple[Summand, int]]:
        """The term at sites of each colour; none if it does not commute with itself."""
        found = [(term, c) for c in range(self.colouring.count)]
        return found if all(self._commute(c, c) for c in found) else []

    def _is_own(self, term: Summand) -> bool:
        """Whether it is a function of one site, and π local."""
        places = self.cell.places(term.expression).values()
        return self.cell.is_local and not term.bond and all(o == self.cell.origin for _, o in places)

    def _pieces(self, term: Summand) -> list[Summand]:
        """The term, or its monomials where it mixes what does not commute at different sites."""
        if self._classes(term) or self._is_own(term):
            return [term]
        names = [n for n, (f, _) in self.cell.places(term.expression).items() if f in self.cell.fields]
        ring = own_ring(names, [term.expression])
        element = ring.tower.convert(term.expression)
        monomials = ring.terms(element, ring.state)
        return [replace(term, expression=ring.expression(c * ring.monomial(m))) for m, c in monomials.items()]

    # --- flows

    def flow(self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]] = ()) -> CellFlow:
        """The flow of a sum of terms that commute; ``more`` are multiplied by `KICK`."""
        motions = [m for m in self._motions(part, more) if m.increments]
        by_term: dict[int, tuple[Summand, list[int]]] = {}
        for summand, colour in (*part, *((replace(s, expression=symbol(KICK) * s.expression), c) for s, c in more)):
            by_term.setdefault(id(summand.expression), (summand, []))[1].append(colour)
        listed = tuple((s, tuple(c)) for s, c in by_term.values())
        # what one bond or pair adds decides what the flow costs
        added = {n: e for m in motions for gathered in m.gathered for n, e in gathered.values.items()}
        increments = tuple(substitute([e for m in motions for e in m.increments.values()], added))
        hamiltonian = total(s.expression for s, _ in listed)
        manner = "; ".join(dict.fromkeys(m.manner for m in motions))
        settled = at_every_site(motions, self.colouring.count)
        return CellFlow(hamiltonian, increments, manner, settled, listed, beside=self._beside(part, more))

    def _beside(self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]]) -> SiteMotion | None:
        """How sites near seams move; None where no terms are left out, so that there is nothing special about them."""
        every = {(id(s.expression), c) for s, _ in (*part, *more) for c in range(self.colouring.count)}
        if not self.colouring.seams or every == {(id(s.expression), c) for s, c in (*part, *more)}:
            return None
        return self._motion(part, more, None)

    def _motions(
        self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]]
    ) -> Iterator[SiteMotion]:
        for colour in range(self.colouring.count):
            yield self._motion(part, more, colour)

    def force(
        self,
        part: Iterable[tuple[Summand, int]],
        field: str,
        colour: int | None,
        shift: Offset = (),
        factor: Expression = ONE,
    ) -> Expression:
        """∂V/∂field at the site ``shift`` away, which has some colour: from terms at sites, weighted at open ends.

        Near a seam, without a colour, they are weighted by where they begin.
        """
        found = []
        for summand, begins in part:
            places = {} if summand.bond else self.cell.places(summand.expression)
            for name, (base, offset) in places.items():
                if base != field or (colour is not None and self.colouring.at(colour, _back(offset)) != begins):
                    continue
                (slope,) = gradient(summand.expression, [name])
                if slope.is_zero:
                    continue
                if self.cell.relation == GRID:
                    way = plus(shift or self.cell.origin, minus(offset))
                    weight = present(self.cell, summand.low, summand.high, [int(o) for o in way])
                    slope = weight * self.cell.shifted(slope, way)
                    slope = slope if colour is not None else symbol(Symbol(BEGINS, begins, *way)) * slope
                found.append(factor * slope)
        return total(found)

    def _motion(
        self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]], colour: int | None
    ) -> SiteMotion:
        """How sites of a colour move; without one, those near seams."""
        cell = self.cell
        moves: set[tuple[str, int | None]] = {c for s in (*part, *more) for c in self._support(s)}
        if colour is None:
            moves = {(f, None) for f, _ in moves}
        rates: dict[str, list[Expression]] = {f: [] for f in cell.fields}
        forces: dict[str, Expression] = {}
        gathered: dict[str, Expression] = {}
        for (f, other), entry in cell.bracket.items():
            g, d = cell.place(other)
            there = None if colour is None else self.colouring.at(colour, d)
            if (g, there) not in moves:
                continue
            force = self.force(part, g, there, d) + self.force(more, g, there, d, symbol(KICK))
            slope = total(gradient(s.expression, [cell.at(g, ("a",))])[0] for s, _ in part if s.bond)
            if not slope.is_zero:
                gathered[Symbol(GATHERED, g)] = slope
                force = force + symbol(Symbol(GATHERED, g))
            if force.is_zero:
                continue
            name = Symbol(FORCE, g, *d)
            forces[name] = force
            rates[f].append(entry * symbol(name))
        field = {f: total(r) for f, r in rates.items() if r}
        if colour is not None:  # what stands still beside a seam does so elsewhere, since no site sees both its ends
            self._expect_still(field, colour, part)
        return self._moved(field, forces, [BondSum(gathered)] if gathered else [], colour, part)

    def _moved(
        self,
        rates: Mapping[str, Expression],
        forces: Mapping[str, Expression],
        gathered: Sequence[BondSum],
        colour: int | None,
        part: Sequence[tuple[Summand, int]],
    ) -> SiteMotion:
        """The motion with these ``rates``, in which symbols stand for the ``forces``."""
        if not rates:
            return SiteMotion(colour, {})
        found = self._solved(rates, part)
        increments = dict(zip(self.cell.fields, substitute(found.increments, forces), strict=True))
        moved = {f: e for f, e in increments.items() if not e.is_zero}
        solution = {f: e for f, e in zip(self.cell.fields, found.increments, strict=True) if f in moved}
        return SiteMotion(colour, moved, tuple(gathered), rates, solution, found.manner)

    def _solved(self, rates: Mapping[str, Expression], part: Sequence[tuple[Summand, int]]) -> Solved:
        ring = own_ring(self.cell.fields, rates.values())
        field = ring.tower.convert_all([rates.get(f, ZERO) for f in self.cell.fields])
        found = solved(ring, field)
        if isinstance(found, str):
            raise NoPartError(part[0][0].expression, found)
        return found

    def _expect_still(self, rates: Mapping[str, Expression], colour: int, part: Sequence[tuple[Summand, int]]) -> None:
        """Neighbours that an equation of a site reads must not move themselves."""
        moving = {f for f, e in rates.items() if not e.is_zero}
        for f, o in self.cell.places(*rates.values()).values():
            if f in moving and any(o) and self._moves(f, self.colouring.at(colour, o), part):
                raise NoPartError(
                    part[0][0].expression, f"the equation of a site has {f} of its neighbours, which moves"
                )

    def _moves(self, field: str, colour: int, part: Sequence[tuple[Summand, int]]) -> bool:
        moves = {c for s in part for c in self._support(s)}
        return any((g, self.colouring.at(colour, d)) in moves for g, d in self._couples.get(field, ()))

    def _own_flows(self, terms: Sequence[Summand]) -> list[CellFlow]:
        """Flows of functions of one site."""
        if not terms:
            return []
        cell = self.cell
        ring = site_ring(cell, [t.expression for t in terms])
        listed = [Term(t.expression, ring.tower.convert(t.expression)) for t in terms]
        joint = joint_flow(ring, listed)
        try:
            flows = (
                [joint]
                if isinstance(joint, Flow)
                else [flow_of(ring, group, numeric=False) for group in Conflicts(ring).grouped(listed)]
            )
        except NoFlowError as error:
            raise NoPartError(error.term.expression, error.reason) from None
        colours = tuple(range(self.colouring.count))
        origin = cell.origin if cell.relation == GRID else ()
        steps = tuple(int(o) for o in origin)
        found = []
        for flow in flows:
            moved = {f: e for f, e in zip(cell.fields, flow.increment, strict=True) if not e.is_zero}
            slopes = dict(zip(cell.fields, gradient(flow.hamiltonian, cell.fields), strict=True))
            rates: dict[str, list[Expression]] = {f: [] for f in moved}
            for (f, g), entry in cell.bracket.items():
                if f in moved:
                    rates[f].append(entry * slopes[g])
            field = {f: total(listed) for f, listed in rates.items()}
            motions = [SiteMotion(c, moved, (), field, moved, flow.manner) for c in colours if moved]
            own = ((Summand(flow.hamiltonian, steps, steps), colours),)
            settled = at_every_site(motions, self.colouring.count)
            found.append(CellFlow(flow.hamiltonian, flow.increment, flow.manner, settled, own))
        return found


class SiteFields:
    """Covector and vector fields at sites, weighted at open ends; ``gathered`` is what bonds or pairs add to slopes."""

    def __init__(self, cell: Cell, gathered: Mapping[str, Expression] | None = None) -> None:
        self.cell, self.gathered = cell, gathered or {}
        self._search = PartSearch(cell, Colouring(1, (0,) * len(cell.axes)))
        self._every = [(s, 0) for s in summands_of(cell)]

    def slope(self, field: str, shift: Offset = ()) -> Expression:
        """∂H/∂field at the site ``shift`` away."""
        return self._search.force(self._every, field, 0, shift) + self.gathered.get(field, ZERO)

    def push(self, field: str, shift: Offset = ()) -> Expression:
        """ζ of the forces, the damping with it, for a field at the site ``shift`` away."""
        acting = self.cell.forces
        found = self._shifted(acting.covector.get(field, ZERO), shift)
        if acting.damping is None:
            return found
        return found + self.damping(shift) * self.tangent(field, self.slope, shift)

    def damping(self, shift: Offset = ()) -> Expression:
        """λ at the site ``shift`` away, 0 without damping."""
        return self._shifted(self.cell.forces.damping or ZERO, shift)

    def impulse(self, field: str) -> Expression:
        """The vector force on a field."""
        return self._shifted(self.cell.forces.vector.get(field, ZERO))

    def noise(self, field: str, shift: Offset = ()) -> Expression:
        """Σ ΔW σ ∂g/∂field at the site ``shift`` away, of the increments there."""
        slopes = [
            symbol(dw) * s.amplitude * gradient(s.hamiltonian, [field])[0]
            for dw, s in zip(self.cell.increments, self.cell.noise.values(), strict=True)
        ]
        return self._shifted(total(slopes), shift)

    def tangent(self, field: str, covector: Callable[[str, Offset], Expression], shift: Offset = ()) -> Expression:
        """π of a covector field, for a field at the site ``shift`` away."""
        found = []
        for (f, other), entry in self.cell.bracket.items():
            if f == field:
                g, d = self.cell.place(other)
                there = plus(shift or self.cell.origin, d) if self.cell.relation == GRID else shift
                found.append((self.cell.shifted(entry, shift) if shift else entry) * covector(g, there))
        return total(found)

    def _shifted(self, e: Expression, shift: Offset = ()) -> Expression:
        """What is at a site, at another; terms that reach beyond open ends are left out."""
        cell = self.cell
        if cell.relation != GRID or e.is_zero:
            return e
        at = [int(o) for o in shift or cell.origin]
        terms = [(t, cell.extent(t)) for t in cell.additive_terms(e)]
        return total(present(cell, low, high, at) * cell.shifted(t, tuple(at)) for t, (low, high) in terms)


def field_at_site(cell: Cell, gathered: Mapping[str, Expression]) -> tuple[Expression, ...]:
    """ẋ of all fields at a site, but for noise, weighted at open ends; ``gathered`` as `SiteFields` has it."""
    at = SiteFields(cell, gathered)
    if not cell.forces:
        return tuple(at.tangent(f, at.slope) for f in cell.fields)
    return tuple(at.tangent(f, lambda g, d: at.slope(g, d) + at.push(g, d)) + at.impulse(f) for f in cell.fields)


def present(cell: Cell, low: Sequence[int], high: Sequence[int], offset: Sequence[int]) -> Expression:
    """1 where a term that reaches from ``low`` to ``high``, both moved by an offset, is on the lattice, else 0."""
    reach = [
        (a + o, b + o) if boundary != PERIODIC else (0, 0)
        for a, b, o, boundary in zip(low, high, offset, cell.boundary, strict=True)
    ]
    if not any(a < 0 or b > 0 for a, b in reach):
        return ONE
    return symbol(Symbol(PRESENT, *(v for pair in reach for v in pair)))


def _back(offset: Offset) -> tuple[int, ...]:
    """The way back from an offset of a grid; at one site otherwise."""
    return tuple(-o for o in offset if isinstance(o, int))


def own_ring(coordinates: Sequence[str], expressions: Iterable[Expression]) -> Ring:
    """A ring with these coordinates, in which all else is constant, and no bracket."""
    roots = list(expressions)
    others = [n for n in symbols_of(*roots) if n not in coordinates and n != TIME]
    tower = Tower([*coordinates, *others, TIME], roots, coordinates)
    return Ring(tower, tuple(coordinates), (), ())


def site_ring(cell: Cell, expressions: Sequence[Expression], symbols: Sequence[str] = ()) -> Ring:
    """The ring of one site with its own bracket."""
    n = cell.fields
    brackets = tuple(tuple(cell.bracket.get((f, g), ZERO) for g in n) for f in n)
    roots = [*expressions, *(e for row in brackets for e in row)]
    others = [s for s in symbols_of(*roots) if s not in n and s != TIME]
    tower = Tower([*n, *dict.fromkeys([*others, *symbols]), TIME], roots, n)
    images = tower.convert_all([e for row in brackets for e in row])
    size = len(n)
    poisson = tuple(tuple(images[i * size : (i + 1) * size]) for i in range(size))
    return Ring(tower, n, poisson, brackets)
