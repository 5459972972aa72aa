"""Parts of H on a graph: forces and motions are sums over the bonds that meet at a site.

Where a bond couples what a term needs unchanged at both of its ends, or a term mixes what does not commute, sites are
coloured when the bonds are known, so that no bond connects two of one colour. Such a part is that of one colour: the
sum of its terms over the bonds that begin at sites of the colour or, for some terms, end there. The flows of all
colours follow one another. What a term is at the other end may be another one seen from here, as x[a]*y[b] and
y[a]*x[b] are of a cross product: they are one part, where each is taken at the end that makes them commute.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from phigen.lattice.cell import GRID, PAIRS, Cell
from phigen.lattice.parts import (
    FORCE,
    BondSum,
    CellFlow,
    Coordinate,
    NoPartError,
    PartSearch,
    SiteMotion,
    Summand,
    field_at_site,
    own_ring,
    summands_of,
)
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute, symbol, symbols_of, total
from phigen.symbolic.neighbours import ENDS, Offset
from phigen.symbolic.symbols import CHOSEN, GATHERED, Symbol, kind_of
from phigen.symbolic.verdict import PROVED, decide_zero

#: Where coordinates of a part are: at any site; at those of its colour; at those of other colours.
ANYWHERE, INSIDE, OUTSIDE = 0, 1, 2
#: Terms of all sites, and of those of one colour, where bonds begin or where they end.
WHOLE, BEGINS, ENDS_THERE = 0, 1, 2
#: The end of a bond that has the colour.
_CHOSEN_END = {BEGINS: "a", ENDS_THERE: "b"}

_OTHER = {"a": "b", "b": "a"}


@dataclass
class GraphSearch(PartSearch):
    """The search for parts on a graph: terms have in place of a colour `WHOLE`, `BEGINS` or `ENDS_THERE`."""

    _along_bonds: set[tuple[str, str]] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._along_bonds = {(f.partition("[")[0], g.partition("[")[0]) for f, g in self.cell.bond_bracket}
        bonds = [s for s in summands_of(self.cell) if s.bond]
        if bonds and self._along_bonds:
            raise NoPartError(bonds[0].expression, "brackets run along bonds, so no energies may")

    # --- what commutes

    def _classes(self, term: Summand) -> list[tuple[Summand, int]]:
        for kind in (WHOLE, self._end_of(term)):
            if self._commute((term, kind), (term, kind)):
                return [(term, kind)]
            if self._is_own(term):
                break
        return []

    def _end_of(self, term: Summand) -> int:
        """The end of a bond that is to have the colour: another one for a term with its ends swapped."""
        listed = self.cell.places(term.expression).values()
        at = {end: sorted(f for f, o in listed if o == (end,) and f in self.cell.fields) for end in ENDS}
        return ENDS_THERE if at["b"] > at["a"] else BEGINS

    def _commute(self, a: tuple[Summand, int], b: tuple[Summand, int]) -> bool:
        return (a[1] == WHOLE) == (b[1] == WHOLE) and super()._commute(a, b)

    def _support(self, term: tuple[Summand, int]) -> list[Coordinate]:
        summand, kind = term
        where: dict[Offset, int] = {}
        if kind != WHOLE:
            end = _CHOSEN_END[kind]
            where = {(): INSIDE, (end,): INSIDE, (_OTHER[end],): OUTSIDE}
        places = self.cell.places(summand.expression).values()
        return sorted({(f, where.get(o, ANYWHERE)) for f, o in places if f in self.cell.fields})

    def _coupled(self, a: Coordinate, b: Coordinate) -> bool:
        """Whether there is a bracket at one site where both may be, or along a bond between two such sites."""
        meet = a[1] == b[1] or ANYWHERE in (a[1], b[1])
        apart = not (a[1] == b[1] == INSIDE)
        local = meet and any(g == b[0] for g, _ in self._couples.get(a[0], ()))
        return local or (apart and (a[0], b[0]) in self._along_bonds)

    # --- flows

    def flow(self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]] = ()) -> CellFlow:
        """The flow of a sum of terms that commute."""
        return replace(super().flow(part, more), by_colour=part[0][1] != WHOLE)

    def _motions(
        self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]]
    ) -> Iterator[SiteMotion]:
        terms = [s for s, _ in part]
        places = (ANYWHERE,) if part[0][1] == WHOLE else (INSIDE, OUTSIDE)
        found = {place: _Motion(self.cell, part, place) for place in places}
        for place, motion in found.items():
            across = {INSIDE: OUTSIDE, OUTSIDE: INSIDE}.get(place, place)
            moving = {"a": motion.rates.keys(), "b": found[across].rates.keys()}
            for base, offset in self.cell.places(*(e for s in motion.gathered for e in s.values.values())).values():
                if base in moving[str(offset[0])]:
                    raise NoPartError(terms[0].expression, f"what a bond adds depends on {base}, which moves")
            yield self._moved(motion.rates, motion.forces, motion.gathered, 0, part)


@dataclass
class _Motion:
    """How a site moves in a part: ``rates`` with symbols for the ``forces``, which read sums that are ``gathered``."""

    cell: Cell
    part: Sequence[tuple[Summand, int]]
    place: int
    rates: dict[str, Expression] = field(default_factory=dict)
    forces: dict[str, Expression] = field(default_factory=dict)
    gathered: tuple[BondSum, ...] = ()

    def __post_init__(self) -> None:
        rates: dict[str, list[Expression]] = {}
        sums, sites = self._bond_forces(), [s for s, _ in self.part if not s.bond]
        for (f, g), entry in self.cell.bracket.items():
            own = ZERO if self.place == OUTSIDE else gradient(total(s.expression for s in sites), [g])[0]
            if self.place == INSIDE and not own.is_zero:
                own = symbol(Symbol(CHOSEN)) * own
            if any(not s.values.get(_gathered(g), ZERO).is_zero for s in sums):
                own = own + symbol(_gathered(g))
            if not own.is_zero:
                name = Symbol(FORCE, g)
                self.forces[name] = own
                rates.setdefault(f, []).append(entry * symbol(name))
        if self.place != INSIDE:
            sums += self._bond_motions(rates)
        self.rates = {f: total(listed) for f, listed in rates.items()}
        used = {n for e in (*self.rates.values(), *self.forces.values()) for n in _gathered_in(e)}
        self.gathered = alike([replace(s, values={n: e for n, e in s.values.items() if n in used}) for s in sums])

    def _bond_forces(self) -> list[BondSum]:
        """The forces of bonds: here the end that their energy has in this part."""
        found, chosen = [], {ANYWHERE: "", INSIDE: "here", OUTSIDE: "there"}[self.place]
        for end in ENDS:
            wanted = {ANYWHERE: None, INSIDE: end, OUTSIDE: _OTHER[end]}[self.place]
            density = total(s.expression for s, kind in self.part if s.bond and _CHOSEN_END.get(kind) == wanted)
            found += [] if density.is_zero else [BondSum(_forces_at(self.cell, density, end), end, chosen)]
        return found

    def _bond_motions(self, rates: dict[str, list[Expression]]) -> list[BondSum]:
        """What brackets along bonds add to the rates: monomials of what is here, times sums of what is there."""
        chosen = "there" if self.place == OUTSIDE else ""
        values: dict[str, dict[str, Expression]] = {"a": {}, "b": {}}
        numbers: dict[tuple[str, str], Symbol] = {}
        for f, end, rate in bond_rates(self.cell, total(s.expression for s, _ in self.part if not s.bond)):
            for monomial, factor in _monomials(self.cell, rate):
                key = (f, str(monomial))
                if key not in numbers:
                    numbers[key] = Symbol(GATHERED, f, len(numbers))
                    rates.setdefault(f, []).append(monomial * symbol(numbers[key]))
                known = values[end].get(numbers[key], ZERO)
                values[end][numbers[key]] = known + factor
        return [BondSum(v, end, chosen) for end, v in values.items() if v]


def bond_rates(cell: Cell, density: Expression) -> Iterator[tuple[str, str, Expression]]:
    """What brackets along a bond add to the motion of a field at one of its ends, for H the sum of a density of sites.

    Triples of the field, its end, and the rate, in ``x[a]``, here, and ``x[b]``, over there.
    """
    slopes = dict(zip(cell.fields, gradient(density, cell.fields), strict=True))
    for (f, g), entry in cell.bond_bracket.items():
        (base, end), (other, _) = cell.place(f), cell.place(g)
        force = slopes[other]
        if not force.is_zero:
            yield base, str(end[0]), seen_from(cell, entry, str(end[0])) * cell.on(force, "b")


def energies(cell: Cell) -> tuple[BondSum, ...]:
    """The energy of a bond, for each of its ends, or of a pair."""
    name = Symbol(GATHERED, "energy")
    if cell.relation == PAIRS:
        return alike([BondSum({name: cell.pair_hamiltonian})])
    return alike([BondSum({name: seen_from(cell, cell.bond_hamiltonian, end)}, end) for end in ENDS])


def site_sums(cell: Cell) -> tuple[BondSum, ...]:
    """What bonds or pairs add to the forces at a site or, where brackets run along bonds, to its motion.

    Forces on fields without brackets are left out: they move nothing."""
    if cell.relation == PAIRS:
        return alike([BondSum(_moving_forces(cell, cell.pair_hamiltonian, "a"))])
    if not cell.bond_bracket:
        return alike([BondSum(_moving_forces(cell, cell.bond_hamiltonian, end), end) for end in ENDS])
    values: dict[str, dict[str, Expression]] = {"a": {}, "b": {}}
    for f, end, rate in bond_rates(cell, cell.hamiltonian):
        values[end][_gathered(f)] = values[end].get(_gathered(f), ZERO) + rate
    return alike([BondSum(v, end) for end, v in values.items()])


def sums_by_field(cell: Cell) -> dict[str, Expression]:
    """The symbols of what bonds or pairs add to the force on a field or, where brackets run along them, to its rate."""
    names = {n for s in site_sums(cell) for n in s.values} if cell.relation != GRID else set()
    return {f: symbol(_gathered(f)) for f in cell.fields if _gathered(f) in names}


def field_with_sums(cell: Cell) -> list[Expression]:
    """The vector field at a site, with symbols for what bonds or pairs add to forces, or to the field itself."""
    added = sums_by_field(cell)
    if not cell.bond_bracket:
        return list(field_at_site(cell, added))
    return [e + added.get(f, ZERO) for f, e in zip(cell.fields, field_at_site(cell, {}), strict=True)]


def seen_from(cell: Cell, e: Expression, end: str) -> Expression:
    """An expression of a bond with that end as a, here, and the other as b."""
    if end == "a":
        return e
    places = cell.places(e)
    turned = {n: symbol(cell.at(base, (_OTHER[str(there[0])],))) for n, (base, there) in places.items()}
    return substitute([e], turned)[0]


def alike(sums: Sequence[BondSum]) -> tuple[BondSum, ...]:
    """One sum for both ends where they are proved to add the same; all have the same symbols then."""
    names = dict.fromkeys(n for s in sums for n in s.values)
    full = [replace(s, values={n: s.values.get(n, ZERO) for n in names}) for s in sums]
    full = [s for s in full if any(not e.is_zero for e in s.values.values())]
    if len(full) == 2 and full[0].chosen == full[1].chosen != "here":
        apart = [(n, full[0].values[n] - full[1].values[n]) for n in names]
        if decide_zero("", apart).verdict == PROVED:
            return (replace(full[0], end=""),)
    return tuple(full)


def _forces_at(cell: Cell, density: Expression, end: str) -> dict[str, Expression]:
    """The derivatives of the density of a bond by the fields of an end."""
    slopes = gradient(density, [cell.at(f, (end,)) for f in cell.fields])
    return {_gathered(f): seen_from(cell, e, end) for f, e in zip(cell.fields, slopes, strict=True) if not e.is_zero}


def _moving_forces(cell: Cell, density: Expression, end: str) -> dict[str, Expression]:
    """Those of `_forces_at` that the vector field reads."""
    read = symbols_of(*field_at_site(cell, {f: symbol(_gathered(f)) for f in cell.fields}))
    return {name: e for name, e in _forces_at(cell, density, end).items() if name in read}


def _monomials(cell: Cell, rate: Expression) -> Iterator[tuple[Expression, Expression]]:
    """A rate as products of an expression of what is here, as at a site, and one of the rest."""
    ring = own_ring([cell.at(f, ("a",)) for f in cell.fields], [rate])
    back = {cell.at(f, ("a",)): symbol(f) for f in cell.fields}
    for m, c in ring.terms(ring.tower.convert(rate), ring.state).items():
        yield substitute([ring.expression(ring.monomial(m))], back)[0], ring.expression(c)


def _gathered(name: str) -> Symbol:
    return Symbol(GATHERED, name)


def _gathered_in(e: Expression) -> Iterator[str]:
    return (n for n in symbols_of(e) if kind_of(n) == GATHERED)
