"""The Hamiltonian of a lattice as a sum of parts whose flows move each site independently.

A part V of H is a sum of terms at sites. All coordinates in these terms commute with each other. So the gradient of V
is constant along the flow of V, and each site has its own equation of motion ẋ = Σ_a {x, a} ∂V/∂a, where the sum is
over all coordinates a, and values at neighbours are constants. If π couples neighbours, or if a term mixes coordinates
that do not commute, the sites are coloured. Then the terms that begin at sites of one colour form a part. Terms that
are functions of a single site also form parts if they have an elementary flow.

Some sizes are not multiples of the period of the colours, as for a ring with two colours and an odd number of sites.
Then the colours are counted from site 0 on, and the last sites along an axis are the boundary *seam*. Terms that begin
on a seam form additional parts. A seam is so wide that no term that begins elsewhere reaches across the seam. The
position of a site near a seam decides which terms act on the site. So each term has a weight of the kind `BEGINS` in
the equation of motion: 1 if the term belongs to the part, else 0.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from phigen.errors import Diagnostic, Location, SpecError
from phigen.lattice.cancelling import divided, sum_factors
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

#: Largest number of colours. The search tries MAX_COLOURS^axes colourings, and each colour adds flows to a step.
MAX_COLOURS = 4

#: Kind of the symbols that stand for the gradient of a part. The gradient is constant along the flow of the part.
FORCE = "force"

Steps = tuple[int, ...]
#: Coordinate of the lattice: a field, and the colour of its site.
Coordinate = tuple[str, int]


@dataclass(frozen=True)
class Summand:
    """A term of H. It belongs to a site or, if ``bond`` is true, to a bond or a pair.

    The term reads sites at offsets from ``low`` to ``high`` along each axis.
    """

    expression: Expression
    low: Steps = ()
    high: Steps = ()
    bond: bool = False


@dataclass(frozen=True)
class Colouring:
    """Colouring of the sites of a lattice: a site has the colour Σ weights·position modulo ``count``.

    Without ``seams``, sizes must be multiples of the periods of the colours. With a boundary seam along each axis, all
    sizes are possible.
    """

    count: int = 1
    weights: Steps = ()
    seams: tuple[Seam, ...] = ()

    def at(self, colour: int, offset: Offset) -> int:
        """Return the colour of the site at an ``offset`` from a site that has the given colour."""
        if self.count == 1:
            return 0
        return (colour + sum(w * o for w, o in zip(self.weights, steps(offset), strict=True))) % self.count

    def periods(self, boundary: Sequence[str]) -> Steps:
        """Return the period of the colours along each axis. Sizes must be multiples of the periods. With seams all
        periods are 1, so that all sizes are allowed.
        """
        if self.seams:
            return (1,) * len(boundary)
        return tuple(
            self.count // math.gcd(self.count, w) if b == PERIODIC and w else 1
            for w, b in zip(self.weights or (0,) * len(boundary), boundary, strict=True)
        )

    @property
    def windows(self) -> tuple[int, ...]:
        """All sets of seams that a site may lie on, as bit masks over the axes; 0 stands for no seam."""
        axes = sum(1 << a for a, seam in enumerate(self.seams) if seam.period > 1)
        return tuple(w for w in range(axes + 1) if w & axes == w)

    def on_seams(self) -> set[int]:
        """The colours that sites on a seam may have. These are all colours, with one exception: if there is a single
        seam, of width 1, the last colour of a period does not occur.
        """
        seam_weights = [(s, w) for s, w in zip(self.seams, self.weights, strict=True) if w]
        if len(seam_weights) > 1 or seam_weights[0][0].min_length > 1:
            return set(range(self.count))
        ((seam, weight),) = seam_weights
        return {weight * k % self.count for k in range(seam.period - 1)}

    def with_seams(self, cell: Cell) -> Colouring:
        """Return the colouring with seams so wide that terms at the two ends of a seam commute.

        The equations of motion at one end of a seam may read a value at the other end, if this value is constant along
        the flow.
        """
        return replace(self, seams=tuple(_seam(cell, a, p) for a, p in enumerate(self.periods(cell.boundary))))


@dataclass(frozen=True)
class BondSum:
    """Sums over the bonds or pairs of a site.

    ``values`` maps the symbol of each sum to its summand. In the summand, x[a] is x at the site itself, and x[b] is x
    at the opposite end of the bond or pair. ``end`` says over which bonds the sums run: "a", bonds that list the site
    first; "b", bonds that list the site second; "", all bonds of the site. In a part of one colour, ``chosen`` says
    which end of a bond has the colour: the site itself ("here") or the opposite end ("there"). The symbols in
    ``extremes`` stand for a maximum (``max``) or minimum (``min``) in place of a sum.
    """

    values: Mapping[str, Expression]
    end: str = ""
    chosen: str = ""
    extremes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class SiteMotion:
    """The motion of the sites of one colour, or of all sites if ``colour`` is None.

    The ``increments`` of the fields depend on the site, on neighbours that stand still, and on sums over bonds or
    pairs. ``gathered`` lists the sums; symbols of the kind `GATHERED` stand for them. ``solution`` has the same
    increments in another form, in which symbols of the kind `FORCE` stand for the components of the force. The force is
    the gradient of the part or, for damping, a covector. The increments in ``solution`` solve ẋ = ``rates``. For
    damping only, ``components`` maps the symbols of the force to its components. ``manner`` describes the motion in
    words.
    """

    colour: int | None
    increments: Mapping[str, Expression]
    gathered: tuple[BondSum, ...] = ()
    rates: Mapping[str, Expression] = field(default_factory=dict)
    solution: Mapping[str, Expression] = field(default_factory=dict)
    manner: str = ""
    components: Mapping[str, Expression] = field(default_factory=dict)


def _seam(cell: Cell, axis: int, period: int) -> Seam:
    """Return the boundary seam along an axis.

    The flow of a term of H updates sites up to the distance ``Seam.margin`` from the site where the term begins. If the
    value of each bracket {f, g} depends only on the sites of f and g, the equations of motion read no sites beyond this
    distance. Otherwise a seam must be wider.
    """
    if period == 1:
        return Seam()
    reach, poisson_reach = cell.hamiltonian_reach[axis], cell.poisson_reach[axis]
    separation = reach + poisson_reach
    is_between = all(
        offset in (cell.origin, cell.place(other)[1])
        for (_, other), entry in cell.bracket.items()
        for _, offset in cell.places(entry).values()
    )
    min_length = reach if cell.is_local else reach + separation if is_between else 2 * separation + poisson_reach
    damping = [] if cell.forces.damping is None else cell.places(cell.forces.damping).values()
    return Seam(period, max([min_length, *(reach + abs(steps(offset)[axis]) for _, offset in damping)]), separation)


def merged_colours(motions: Sequence[SiteMotion], count: int) -> tuple[SiteMotion, ...]:
    """Return a single motion for all sites, if the motions of all ``count`` colours are equal; else return
    ``motions``.
    """
    equal = (
        count > 1 and len(motions) == count and all(replace(m, colour=motions[0].colour) == motions[0] for m in motions)
    )
    return (replace(motions[0], colour=None),) if equal else tuple(motions)


@dataclass(frozen=True)
class CellFlow(Flow):
    """The flow of a part of H over the lattice.

    ``motions`` has the solved equations of motion of sites. The order of these equations has no effect, nor has the
    order of the sites. ``summands`` are the terms of the part, each with the colours of the sites where it begins. On a
    graph, ``by_colour`` is true if the part has only the terms of one colour; a step then applies the flow once for
    each colour. If the colouring has boundary seams, ``beside`` has the solved equations of motion of a site near the
    seams. The equations in ``beside`` contain the terms that begin on exactly the seams in ``window``, a bit mask over
    the axes (see `Colouring.windows`).
    """

    motions: tuple[SiteMotion, ...] = ()
    summands: tuple[tuple[Summand, tuple[int, ...]], ...] = ()
    by_colour: bool = False
    beside: SiteMotion | None = None
    window: int = 0

    @property
    def every_motion(self) -> tuple[SiteMotion, ...]:
        """The entries of ``motions``, followed by ``beside`` if it is not None."""
        return (*self.motions, *([self.beside] if self.beside else []))


@dataclass(frozen=True)
class CellSplitting:
    """The flows of the parts of H, and the ``colouring`` of the sites. The parts depend on the colouring."""

    flows: tuple[CellFlow, ...]
    colouring: Colouring


class NoPartError(Exception):
    """A term of H cannot be in any part that has an elementary flow; the text is the reason."""

    def __init__(self, expression: Expression, reason: str) -> None:
        super().__init__(reason)
        self.expression, self.reason = expression, reason


def splittings(
    cell: Cell, place: Location | None = None, search: Callable[[Cell, Colouring], PartSearch] | None = None
) -> Iterator[CellSplitting]:
    """Yield ways to write H as a sum of parts with elementary flows, one for each colouring.

    The ways are ordered by the number of colours, then by the number of parts. Raises `SpecError` at ``place`` if a
    term of H has no elementary flow; the error names this term.
    """
    search = search or PartSearch
    refused: NoPartError | None = None
    any_found = False
    for _, same_count in itertools.groupby(colourings(cell), lambda colouring: colouring.count):
        splittings_found: list[CellSplitting] = []
        for colouring in same_count:
            try:
                splittings_found.append(search(cell, colouring).splitting())
            except NoPartError as error:
                refused = refused or error
        any_found = any_found or bool(splittings_found)
        yield from sorted(splittings_found, key=lambda parts: len(parts.flows))
    if not any_found:
        assert refused is not None
        message = f"scheme splitting: the term {refused.expression} has no elementary flow on the lattice"
        hint = "a term needs coordinates that commute over the whole lattice, or a single site and an elementary flow"
        raise SpecError([Diagnostic(f"{message}: {refused.reason}", place, hint)])


def colourings(cell: Cell) -> Iterator[Colouring]:
    """Yield all colourings to try, in the order of the number of colours."""
    yield Colouring(1, (0,) * len(cell.axes))
    if cell.relation != GRID:
        return
    for count in range(2, MAX_COLOURS + 1):
        for weights in itertools.product(range(count), repeat=len(cell.axes)):
            if any(weights):
                yield Colouring(count, weights)


def summands_of(cell: Cell) -> list[Summand]:
    """Return the additive terms of H. If H = 0, return the term 0, so that the splitting has a flow."""
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
    """Search for the parts of H with one colouring. A term in a part is a pair: a summand of H, and the colour of the
    sites at which the summand begins.
    """

    cell: Cell
    colouring: Colouring
    _couples: dict[str, list[tuple[str, Offset]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for f, other in self.cell.bracket:
            self._couples.setdefault(f, []).append(self.cell.place(other))

    def splitting(self) -> CellSplitting:
        """Return the splitting of H that belongs to ``self.colouring``. Raises `NoPartError` if a term of H cannot be
        in any part.
        """
        site_terms: list[Summand] = []
        classes: list[tuple[Summand, int]] = []
        for term in summands_of(self.cell):
            for piece in self._summands(term):
                if classes_of_piece := self._classes(piece):
                    classes += classes_of_piece
                elif self._is_single_site(piece):
                    site_terms.append(piece)
                else:
                    reason = "it mixes coordinates that do not commute"
                    raise NoPartError(piece.expression, reason)
        neighbours = [
            {j for j, b in enumerate(classes) if j != i and not self._commute(a, b)} for i, a in enumerate(classes)
        ]
        numbering: dict[Coordinate, int] = {}
        supports = [[numbering.setdefault(f, len(numbering)) for f in self._support(c)] for c in classes]
        colours = coloured(neighbours, supports)
        flows = [
            self.flow([c for c, k in zip(classes, colours, strict=True) if k == colour])
            for colour in sorted(set(colours))
        ]
        return CellSplitting((*flows, *self._site_flows(site_terms)), self.colouring)

    # --- commuting terms

    def _support(self, term: tuple[Summand, int]) -> list[Coordinate]:
        summand, colour = term
        places = self.cell.places(summand.expression).values()
        fields = {(f, self.colouring.at(colour, o)) for f, o in places if f in self.cell.fields}
        return sorted(fields)

    def _commute(self, a: tuple[Summand, int], b: tuple[Summand, int]) -> bool:
        return not any(self._coupled(f, g) for f in self._support(a) for g in self._support(b))

    def _coupled(self, a: Coordinate, b: Coordinate) -> bool:
        """Whether a field at a site can have a nonzero bracket with a field at another site. The arguments ``a`` and
        ``b`` have the two fields and the colours of their sites.
        """
        return any(g == b[0] and self.colouring.at(a[1], d) == b[1] for g, d in self._couples.get(a[0], ()))

    def _classes(self, term: Summand) -> list[tuple[Summand, int]]:
        """Return the term with each colour in turn; [] if copies of the term at the sites of one colour do not
        commute.
        """
        classes = [(term, c) for c in range(self.colouring.count)]
        return classes if all(self._commute(c, c) for c in classes) else []

    def _is_single_site(self, term: Summand) -> bool:
        """Whether the term is a function of the fields of one site, and all brackets are between fields of one and the
        same site.
        """
        places = self.cell.places(term.expression).values()
        return self.cell.is_local and not term.bond and all(o == self.cell.origin for _, o in places)

    def _summands(self, term: Summand) -> list[Summand]:
        """Return the term as a list of summands.

        The list has one entry if the term depends on a single site, or if copies of the term at sites of one colour
        commute. Otherwise the list has the monomials of the term.
        """
        if self._classes(term) or self._is_single_site(term):
            return [term]
        names = [n for n, (f, _) in self.cell.places(term.expression).items() if f in self.cell.fields]
        ring = bracketless_ring(names, [term.expression])
        element = ring.tower.convert(term.expression)
        monomials = ring.terms(element, ring.state)
        return [replace(term, expression=ring.expression(c * ring.monomial(m))) for m, c in monomials.items()]

    # --- flows

    def flow(self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]] = ()) -> CellFlow:
        """Return the flow of a sum of commuting terms of H.

        ``more`` has the terms of {V, {V, T}} in a modified potential V + κ{V, {V, T}}. These terms are multiplied by
        the symbol `KICK`, which stands for κ.
        """
        motions = [m for m in self._motions(part, more) if m.increments]
        by_term: dict[int, tuple[Summand, list[int]]] = {}
        for summand, colour in (*part, *((replace(s, expression=symbol(KICK) * s.expression), c) for s, c in more)):
            by_term.setdefault(id(summand.expression), (summand, []))[1].append(colour)
        coloured_summands = tuple((s, tuple(c)) for s, c in by_term.values())
        # The cost of a flow is estimated from the expression of a single bond or pair.
        bond_terms = {n: e for m in motions for gathered in m.gathered for n, e in gathered.values.items()}
        increments = tuple(substitute([e for m in motions for e in m.increments.values()], bond_terms))
        hamiltonian = total(s.expression for s, _ in coloured_summands)
        manner = "; ".join(dict.fromkeys(m.manner for m in motions))
        merged = merged_colours(motions, self.colouring.count)
        return CellFlow(
            hamiltonian, increments, manner, merged, coloured_summands, beside=self._seam_motion(part, more)
        )

    def _seam_motion(
        self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]]
    ) -> SiteMotion | None:
        """Return the solved equations of motion of a site near boundary seams. A seam is at the last sites along an
        axis, where the colours do not repeat.

        Returns None if there are no seams, or if the part has the terms of all colours, so that seams make no
        difference.
        """
        all_classes = {(id(s.expression), c) for s, _ in (*part, *more) for c in range(self.colouring.count)}
        if not self.colouring.seams or all_classes == {(id(s.expression), c) for s, c in (*part, *more)}:
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
        """Return ∂V/∂field at the site that is ``shift`` away. V is the sum of the terms ``part``, except terms of
        bonds.

        ``colour`` is the colour of that site. Each term has a weight that is 0 if the term reaches beyond an open end.
        If ``colour`` is None, the site is near a boundary seam, and the weight also depends on the site where the term
        begins.
        """
        slopes = []
        for summand, begin in part:
            places = {} if summand.bond else self.cell.places(summand.expression)
            for name, (base, offset) in places.items():
                if base != field or (colour is not None and self.colouring.at(colour, _opposite(offset)) != begin):
                    continue
                (slope,) = gradient(summand.expression, [name])
                if slope.is_zero:
                    continue
                if self.cell.relation == GRID:
                    displacement = plus(shift or self.cell.origin, minus(offset))
                    weight = present(self.cell, summand.low, summand.high, [int(o) for o in displacement])
                    slope = weight * self.cell.shifted(slope, displacement)
                    slope = slope if colour is not None else symbol(Symbol(BEGINS, begin, *displacement)) * slope
                slopes.append(factor * slope)
        return total(slopes)

    def _motion(
        self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]], colour: int | None
    ) -> SiteMotion:
        """Return the solved equations of motion of a site under the terms of a part of H.

        The site has the colour ``colour``. If ``colour`` is None, the site is near boundary seams. ``more`` has the
        terms that a modified potential adds to the part; they are multiplied by the symbol `KICK`.
        """
        cell = self.cell
        coordinates: set[tuple[str, int | None]] = {c for s in (*part, *more) for c in self._support(s)}
        if colour is None:
            coordinates = {(f, None) for f, _ in coordinates}
        rates: dict[str, list[Expression]] = {f: [] for f in cell.fields}
        forces: dict[str, Expression] = {}
        gathered: dict[str, Expression] = {}
        for (f, other), entry in cell.bracket.items():
            g, d = cell.place(other)
            other_colour = None if colour is None else self.colouring.at(colour, d)
            if (g, other_colour) not in coordinates:
                continue
            force = self.force(part, g, other_colour, d) + self.force(more, g, other_colour, d, symbol(KICK))
            slope = total(gradient(s.expression, [cell.at(g, ("a",))])[0] for s, _ in part if s.bond)
            if not slope.is_zero:
                factors = sum_factors(cell, g)
                gathered[Symbol(GATHERED, g)] = divided(slope, factors.at_end)
                force = force + factors.at_site * symbol(Symbol(GATHERED, g))
            if force.is_zero:
                continue
            name = Symbol(FORCE, g, *d)
            forces[name] = force
            rates[f].append(entry * symbol(name))
        field = {f: total(r) for f, r in rates.items() if r}
        if colour is not None:  # sites near seams need no check: no term reaches both ends of a seam
            self._expect_still(field, colour, part)
        return self._solved_motion(field, forces, [BondSum(gathered)] if gathered else [], colour, part)

    def _solved_motion(
        self,
        rates: Mapping[str, Expression],
        forces: Mapping[str, Expression],
        gathered: Sequence[BondSum],
        colour: int | None,
        part: Sequence[tuple[Summand, int]],
    ) -> SiteMotion:
        """Return the equations of motion ẋ = ``rates`` of a site, with their solution.

        Symbols in ``rates`` stand for the expressions in ``forces``.
        """
        if not rates:
            return SiteMotion(colour, {})
        solved_rates = self._solved(rates, part)
        increments = dict(zip(self.cell.fields, substitute(solved_rates.increments, forces), strict=True))
        nonzero = {f: e for f, e in increments.items() if not e.is_zero}
        solution = {f: e for f, e in zip(self.cell.fields, solved_rates.increments, strict=True) if f in nonzero}
        return SiteMotion(colour, nonzero, tuple(gathered), rates, solution, solved_rates.manner)

    def _solved(self, rates: Mapping[str, Expression], part: Sequence[tuple[Summand, int]]) -> Solved:
        ring = bracketless_ring(self.cell.fields, rates.values())
        field = ring.tower.convert_all([rates.get(f, ZERO) for f in self.cell.fields])
        solution = solved(ring, field)
        if isinstance(solution, str):
            raise NoPartError(part[0][0].expression, solution)
        return solution

    def _expect_still(self, rates: Mapping[str, Expression], colour: int, part: Sequence[tuple[Summand, int]]) -> None:
        """Raise `NoPartError` if the equation of motion of a site reads fields of neighbours that change along the
        flow.
        """
        moving = {f for f, e in rates.items() if not e.is_zero}
        for f, o in self.cell.places(*rates.values()).values():
            if f in moving and any(o) and self._moves(f, self.colouring.at(colour, o), part):
                raise NoPartError(
                    part[0][0].expression,
                    f"the equation of a site reads {f} of its neighbours, which changes along the flow",
                )

    def _moves(self, field: str, colour: int, part: Sequence[tuple[Summand, int]]) -> bool:
        coordinates = {c for s in part for c in self._support(s)}
        return any((g, self.colouring.at(colour, d)) in coordinates for g, d in self._couples.get(field, ()))

    def _site_flows(self, terms: Sequence[Summand]) -> list[CellFlow]:
        """Return the flow of the sum of ``terms``, which are functions of one site.

        If the flow of the sum is not elementary, the result has flows of several smaller sums.
        """
        if not terms:
            return []
        cell = self.cell
        ring = site_ring(cell, [t.expression for t in terms])
        ring_terms = [Term(t.expression, ring.tower.convert(t.expression)) for t in terms]
        joint = joint_flow(ring, ring_terms)
        try:
            flows = (
                [joint]
                if isinstance(joint, Flow)
                else [flow_of(ring, group, numeric=False) for group in Conflicts(ring).grouped(ring_terms)]
            )
        except NoFlowError as error:
            raise NoPartError(error.term.expression, error.reason) from None
        colours = tuple(range(self.colouring.count))
        origin = cell.origin if cell.relation == GRID else ()
        steps = tuple(int(o) for o in origin)
        site_flows = []
        for flow in flows:
            increments = {f: e for f, e in zip(cell.fields, flow.increment, strict=True) if not e.is_zero}
            slopes = dict(zip(cell.fields, gradient(flow.hamiltonian, cell.fields), strict=True))
            rates: dict[str, list[Expression]] = {f: [] for f in increments}
            for (f, g), entry in cell.bracket.items():
                if f in increments:
                    rates[f].append(entry * slopes[g])
            field = {f: total(ring_terms) for f, ring_terms in rates.items()}
            motions = [SiteMotion(c, increments, (), field, increments, flow.manner) for c in colours if increments]
            summands = ((Summand(flow.hamiltonian, steps, steps), colours),)
            merged = merged_colours(motions, self.colouring.count)
            site_flows.append(CellFlow(flow.hamiltonian, flow.increment, flow.manner, merged, summands))
        return site_flows


class SiteFields:
    """Covector and vector fields at a site, with weights that are 0 where a term reaches beyond an open end.

    ``gathered`` maps a field f to the expression for the sums over bonds or pairs in ∂H/∂f.
    """

    def __init__(self, cell: Cell, gathered: Mapping[str, Expression] | None = None) -> None:
        self.cell, self.gathered = cell, gathered or {}
        self._search = PartSearch(cell, Colouring(1, (0,) * len(cell.axes)))
        self._every = [(s, 0) for s in summands_of(cell)]

    def slope(self, field: str, shift: Offset = ()) -> Expression:
        """Return ∂H/∂field at the site that is ``shift`` away."""
        return self._search.force(self._every, field, 0, shift) + self.gathered.get(field, ZERO)

    def push(self, field: str, shift: Offset = ()) -> Expression:
        """Return the component ``field`` of the covector force ζ at the site that is ``shift`` away.

        Damping is included.
        """
        cell_forces = self.cell.forces
        covector = self._shifted(cell_forces.covector.get(field, ZERO), shift)
        if cell_forces.damping is None:
            return covector
        return covector + self.damping(shift) * self.tangent(field, self.slope, shift)

    def damping(self, shift: Offset = ()) -> Expression:
        """Return the damping coefficient λ at the site that is ``shift`` away; 0 without damping."""
        return self._shifted(self.cell.forces.damping or ZERO, shift)

    def impulse(self, field: str) -> Expression:
        """Return the component ``field`` of the vector force at the site."""
        return self._shifted(self.cell.forces.vector.get(field, ZERO))

    def noise(self, field: str, shift: Offset = ()) -> Expression:
        """Return the derivative of the noise Hamiltonian Σ ΔW σ g with respect to ``field``, at the site that is
        ``shift`` away.

        The sum is over the sources of noise, with their increments ΔW, amplitudes σ and Hamiltonians g.
        """
        slopes = [
            symbol(dw) * s.amplitude * gradient(s.hamiltonian, [field])[0]
            for dw, s in zip(self.cell.increments, self.cell.noise.values(), strict=True)
        ]
        return self._shifted(total(slopes), shift)

    def tangent(self, field: str, covector: Callable[[str, Offset], Expression], shift: Offset = ()) -> Expression:
        """Return (πp)_field for a covector field p at the site that is ``shift`` away."""
        terms = []
        for (f, other), entry in self.cell.bracket.items():
            if f == field:
                g, d = self.cell.place(other)
                other_site = plus(shift or self.cell.origin, d) if self.cell.relation == GRID else shift
                terms.append((self.cell.shifted(entry, shift) if shift else entry) * covector(g, other_site))
        return total(terms)

    def _shifted(self, e: Expression, shift: Offset = ()) -> Expression:
        """Return an expression moved to the site that is ``shift`` away.

        Each term has a weight that is 0 beyond open ends.
        """
        cell = self.cell
        if cell.relation != GRID or e.is_zero:
            return e
        position = [int(o) for o in shift or cell.origin]
        terms = [(t, cell.extent(t)) for t in cell.additive_terms(e)]
        return total(present(cell, low, high, position) * cell.shifted(t, tuple(position)) for t, (low, high) in terms)


def field_at_site(cell: Cell, gathered: Mapping[str, Expression]) -> tuple[Expression, ...]:
    """Return ẋ of all fields at a site, without noise. Terms have weights that are 0 beyond open ends.

    ``gathered`` maps a field f to the expression for the sums over bonds or pairs in ∂H/∂f.
    """
    site_fields = SiteFields(cell, gathered)
    if not cell.forces:
        return tuple(site_fields.tangent(f, site_fields.slope) for f in cell.fields)
    return tuple(
        site_fields.tangent(f, lambda g, d: site_fields.slope(g, d) + site_fields.push(g, d)) + site_fields.impulse(f)
        for f in cell.fields
    )


def present(cell: Cell, low: Sequence[int], high: Sequence[int], offset: Sequence[int]) -> Expression:
    """Return the weight of a term at a site: 1 if all its sites are on the lattice, else 0.

    The sites of the term lie between the offsets ``low`` and ``high``, both shifted by ``offset``.
    """
    reach = [
        (a + o, b + o) if boundary != PERIODIC else (0, 0)
        for a, b, o, boundary in zip(low, high, offset, cell.boundary, strict=True)
    ]
    if not any(a < 0 or b > 0 for a, b in reach):
        return ONE
    return symbol(Symbol(PRESENT, *(v for pair in reach for v in pair)))


def _opposite(offset: Offset) -> tuple[int, ...]:
    """Return the offset −``offset`` on a grid; () if the lattice has no axes."""
    return tuple(-o for o in offset if isinstance(o, int))


def bracketless_ring(coordinates: Sequence[str], expressions: Iterable[Expression]) -> Ring:
    """Return the polynomial ring in ``coordinates`` without brackets; all other symbols in the expressions are
    constants.
    """
    roots = list(expressions)
    constants = [n for n in symbols_of(*roots) if n not in coordinates and n != TIME]
    tower = Tower([*coordinates, *constants, TIME], roots, coordinates)
    return Ring(tower, tuple(coordinates), (), ())


def site_ring(cell: Cell, expressions: Sequence[Expression], symbols: Sequence[str] = ()) -> Ring:
    """Return the polynomial ring in the fields of one site, with their brackets; all other symbols are constants."""
    n = cell.fields
    brackets = tuple(tuple(cell.bracket.get((f, g), ZERO) for g in n) for f in n)
    roots = [*expressions, *(e for row in brackets for e in row)]
    constants = [s for s in symbols_of(*roots) if s not in n and s != TIME]
    tower = Tower([*n, *dict.fromkeys([*constants, *symbols]), TIME], roots, n)
    images = tower.convert_all([e for row in brackets for e in row])
    size = len(n)
    poisson = tuple(tuple(images[i * size : (i + 1) * size]) for i in range(size))
    return Ring(tower, n, poisson, brackets)
