"""Parts of H on a graph: forces and motions are sums over the bonds that meet at a site.

If two bonds share a site, the copies of a term on these bonds need not commute. In this case the sites are coloured at
run time, when the bonds are known, so that no bond connects two sites of one colour. A part contains the terms of one
colour: each term is summed over the bonds that begin at sites of the colour or, for some terms, over the bonds that end
there. A step applies the flows of all colours one after the other.

Two terms may be mirror images under the exchange of the ends a and b, such as x[a]*y[b] and y[a]*x[b] in a cross
product. A part contains a term and its mirror image: the term is summed over the bonds that begin at sites of the
colour, and the mirror image over the bonds that end there. Then the two sums commute.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from phigen.lattice.cancelling import divided, sum_factors
from phigen.lattice.cell import GRID, PAIRS, Cell
from phigen.lattice.site_parts import (
    FORCE,
    BondSum,
    CellFlow,
    Coordinate,
    NoPartError,
    PartSearch,
    SiteMotion,
    Summand,
    bracketless_ring,
    field_at_site,
    summands_of,
)
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute, symbol, symbols_of, total
from phigen.symbolic.neighbours import ENDS, Offset
from phigen.symbolic.symbols import CHOSEN, GATHERED, Symbol, kind_of
from phigen.symbolic.verdict import PROVED, decide_zero

#: Sites, in relation to the colour of a part: any site, a site of the colour, a site of another colour.
ANYWHERE, INSIDE, OUTSIDE = 0, 1, 2
#: Classes of terms in a part: terms at all sites and bonds; terms at bonds that begin at sites of one colour; terms at
#: bonds that end at sites of one colour.
WHOLE, BEGINS, ENDS_THERE = 0, 1, 2
#: For each class of terms, one end of a bond, a or b. A part contains the terms of a bond if the site at this end has
#: the colour of the part.
_CHOSEN_END = {BEGINS: "a", ENDS_THERE: "b"}

_OTHER = {"a": "b", "b": "a"}


@dataclass
class GraphSearch(PartSearch):
    """Search for the parts of H on a graph, whose colours are known only at run time.

    A term in a part is a pair: a summand of H, and a class. The class says where the part contains the summand:
    `WHOLE`, at all sites or bonds; `BEGINS`, at the bonds that begin at sites of one colour; `ENDS_THERE`, at the bonds
    that end at sites of one colour.
    """

    _along_bonds: set[tuple[str, str]] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._along_bonds = {(f.partition("[")[0], g.partition("[")[0]) for f, g in self.cell.bond_bracket}
        bonds = [s for s in summands_of(self.cell) if s.bond]
        if bonds and self._along_bonds:
            raise NoPartError(bonds[0].expression, "hamiltonian: bonds is not offered together with poisson: bonds")

    # --- commuting terms

    def _classes(self, term: Summand) -> list[tuple[Summand, int]]:
        for kind in (WHOLE, self._end_of(term)):
            if self._commute((term, kind), (term, kind)):
                return [(term, kind)]
            if self._is_single_site(term):
                break
        return []

    def _end_of(self, term: Summand) -> int:
        """Return the class of a term of a bond: `BEGINS` or `ENDS_THERE`.

        Two terms that are mirror images under the exchange of the ends get different classes.
        """
        places = self.cell.places(term.expression).values()
        fields_at = {end: sorted(f for f, o in places if o == (end,) and f in self.cell.fields) for end in ENDS}
        return ENDS_THERE if fields_at["b"] > fields_at["a"] else BEGINS

    def _commute(self, a: tuple[Summand, int], b: tuple[Summand, int]) -> bool:
        return (a[1] == WHOLE) == (b[1] == WHOLE) and super()._commute(a, b)

    def _support(self, term: tuple[Summand, int]) -> list[Coordinate]:
        summand, kind = term
        site_numbers: dict[Offset, int] = {}
        if kind != WHOLE:
            end = _CHOSEN_END[kind]
            site_numbers = {(): INSIDE, (end,): INSIDE, (_OTHER[end],): OUTSIDE}
        places = self.cell.places(summand.expression).values()
        return sorted({(f, site_numbers.get(o, ANYWHERE)) for f, o in places if f in self.cell.fields})

    def _coupled(self, a: Coordinate, b: Coordinate) -> bool:
        """Whether two coordinates may have a nonzero bracket, at one site or along a bond.

        A coordinate is a pair: a field, and `ANYWHERE`, `INSIDE` or `OUTSIDE` for its site.
        """
        same_site_possible = a[1] == b[1] or ANYWHERE in (a[1], b[1])
        different_sites_possible = not (a[1] == b[1] == INSIDE)
        local = same_site_possible and any(g == b[0] for g, _ in self._couples.get(a[0], ()))
        return local or (different_sites_possible and (a[0], b[0]) in self._along_bonds)

    # --- flows

    def flow(self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]] = ()) -> CellFlow:
        """Return the flow of a sum of commuting terms of H.

        ``more`` has the terms that a modified potential adds to the part; they are multiplied by the symbol `KICK`.
        """
        return replace(super().flow(part, more), by_colour=part[0][1] != WHOLE)

    def _motions(
        self, part: Sequence[tuple[Summand, int]], more: Sequence[tuple[Summand, int]]
    ) -> Iterator[SiteMotion]:
        terms = [s for s, _ in part]
        site_classes = (ANYWHERE,) if part[0][1] == WHOLE else (INSIDE, OUTSIDE)
        equations = {place: _SiteEquation(self.cell, part, place) for place in site_classes}
        for place, equation in equations.items():
            neighbour_place = {INSIDE: OUTSIDE, OUTSIDE: INSIDE}.get(place, place)
            moving = {"a": equation.rates.keys(), "b": equations[neighbour_place].rates.keys()}
            for base, offset in self.cell.places(*(e for s in equation.gathered for e in s.values.values())).values():
                if base in moving[str(offset[0])]:
                    raise NoPartError(
                        terms[0].expression, f"the force along a bond depends on {base}, which changes along the flow"
                    )
            yield self._solved_motion(equation.rates, equation.forces, equation.gathered, 0, part)


@dataclass
class _SiteEquation:
    """The equation of motion ẋ = ``rates`` of a site under the flow of a part of H.

    ``rates`` has symbols that stand for the expressions in ``forces``. The forces depend on the sums over bonds in
    ``gathered``.
    """

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
            force = ZERO if self.place == OUTSIDE else gradient(total(s.expression for s in sites), [g])[0]
            if self.place == INSIDE and not force.is_zero:
                force = symbol(Symbol(CHOSEN)) * force
            if any(not s.values.get(_gathered(g), ZERO).is_zero for s in sums):
                force = force + sum_factors(self.cell, g).at_site * symbol(_gathered(g))
            if not force.is_zero:
                name = Symbol(FORCE, g)
                self.forces[name] = force
                rates.setdefault(f, []).append(entry * symbol(name))
        if self.place != INSIDE:
            sums += self._bond_motions(rates)
        self.rates = {f: total(terms) for f, terms in rates.items()}
        gathered_symbols = {n for e in (*self.rates.values(), *self.forces.values()) for n in _gathered_in(e)}
        self.gathered = merged_ends(
            [replace(s, values={n: e for n, e in s.values.items() if n in gathered_symbols}) for s in sums]
        )

    def _bond_forces(self) -> list[BondSum]:
        """Return the sums of the forces that bonds exert on this site.

        The energy of a bond is assigned to one of the ends. In a part of one colour, a bond contributes only if this
        end has the colour.
        """
        sums, selection = [], {ANYWHERE: "", INSIDE: "here", OUTSIDE: "there"}[self.place]
        for end in ENDS:
            coloured_end = {ANYWHERE: None, INSIDE: end, OUTSIDE: _OTHER[end]}[self.place]
            density = total(s.expression for s, kind in self.part if s.bond and _CHOSEN_END.get(kind) == coloured_end)
            sums += [] if density.is_zero else [BondSum(_forces_at(self.cell, density, end), end, selection)]
        return sums

    def _bond_motions(self, rates: dict[str, list[Expression]]) -> list[BondSum]:
        """Return the sums over bonds by which brackets along bonds enter the equation of motion.

        The function also adds terms with these sums to ``rates``. Each term is the product of a monomial in the fields
        of the site and a sum over the neighbours of the site.
        """
        selection = "there" if self.place == OUTSIDE else ""
        values: dict[str, dict[str, Expression]] = {"a": {}, "b": {}}
        sum_symbols: dict[tuple[str, str], Symbol] = {}
        for f, end, rate in bond_rates(self.cell, total(s.expression for s, _ in self.part if not s.bond)):
            for monomial, factor in _monomials(self.cell, rate):
                key = (f, str(monomial))
                if key not in sum_symbols:
                    sum_symbols[key] = Symbol(GATHERED, f, len(sum_symbols))
                    rates.setdefault(f, []).append(monomial * symbol(sum_symbols[key]))
                earlier_sum = values[end].get(sum_symbols[key], ZERO)
                values[end][sum_symbols[key]] = earlier_sum + factor
        return [BondSum(v, end, selection) for end, v in values.items() if v]


def bond_rates(cell: Cell, density: Expression) -> Iterator[tuple[str, str, Expression]]:
    """Yield the rates of change that brackets along a bond cause at the ends of the bond, if H is the sum of a
    ``density`` over sites.

    Each item is a field, the end of the bond at which the field lies, and the rate of the field. The rate is written
    with ``x[a]`` for this end and ``x[b]`` for the opposite end.
    """
    slopes = dict(zip(cell.fields, gradient(density, cell.fields), strict=True))
    for (f, g), entry in cell.bond_bracket.items():
        (base, end), (other, _) = cell.place(f), cell.place(g)
        force = slopes[other]
        if not force.is_zero:
            yield base, str(end[0]), with_first_end(cell, entry, str(end[0])) * cell.on(force, "b")


def energies(cell: Cell) -> tuple[BondSum, ...]:
    """Return sums over the bonds or pairs of a site. The summand is the energy of the bond or pair.

    For bonds there may be two sums: over the bonds that begin at the site, and over those that end there.
    """
    name = Symbol(GATHERED, "energy")
    if cell.relation == PAIRS:
        return merged_ends([BondSum({name: cell.pair_hamiltonian})])
    return merged_ends([BondSum({name: with_first_end(cell, cell.bond_hamiltonian, end)}, end) for end in ENDS])


def site_sums(cell: Cell) -> tuple[BondSum, ...]:
    """Return the sums of the forces that bonds or pairs exert on a site.

    If there are brackets along bonds, rates of change are summed in place of forces. Forces on fields without brackets
    are left out, since they have no effect.
    """
    if cell.relation == PAIRS:
        return merged_ends([BondSum(_moving_forces(cell, cell.pair_hamiltonian, "a"))])
    if not cell.bond_bracket:
        return merged_ends([BondSum(_moving_forces(cell, cell.bond_hamiltonian, end), end) for end in ENDS])
    values: dict[str, dict[str, Expression]] = {"a": {}, "b": {}}
    for f, end, rate in bond_rates(cell, cell.hamiltonian):
        values[end][_gathered(f)] = values[end].get(_gathered(f), ZERO) + rate
    return merged_ends([BondSum(v, end) for end, v in values.items()])


def sums_by_field(cell: Cell) -> dict[str, Expression]:
    """Return the force that all bonds or pairs exert on each field of a site; fields without such a force are
    left out.

    The force is the symbol of a sum, times the common factor of the summands (see `SumFactors`). If there are brackets
    along bonds, the result has rates of change in place of forces.
    """
    names = {n for s in site_sums(cell) for n in s.values} if cell.relation != GRID else set()
    at_site = {f: sum_factors(cell, f).at_site for f in cell.fields if _gathered(f) in names}
    return {f: factor * symbol(_gathered(f)) for f, factor in at_site.items()}


def field_with_sums(cell: Cell) -> list[Expression]:
    """Return the components of the vector field at a site. Symbols stand for the sums over bonds or pairs."""
    sums = sums_by_field(cell)
    if not cell.bond_bracket:
        return list(field_at_site(cell, sums))
    return [e + sums.get(f, ZERO) for f, e in zip(cell.fields, field_at_site(cell, {}), strict=True)]


def with_first_end(cell: Cell, e: Expression, end: str) -> Expression:
    """Return an expression of a bond with the ends renamed such that ``end`` is called a, and the opposite end b."""
    if end == "a":
        return e
    places = cell.places(e)
    renamed = {n: symbol(cell.at(base, (_OTHER[str(there[0])],))) for n, (base, there) in places.items()}
    return substitute([e], renamed)[0]


def merged_ends(sums: Sequence[BondSum]) -> tuple[BondSum, ...]:
    """Merge the sums over the bonds that begin at a site with the sums over the bonds that end there.

    The result has one element if the summands are proved to be equal, otherwise one for each end. Sums that are 0 are
    left out. Sums with ``chosen`` = "here" (see `BondSum`) are never merged.
    """
    names = dict.fromkeys(n for s in sums for n in s.values)
    completed = [replace(s, values={n: s.values.get(n, ZERO) for n in names}) for s in sums]
    completed = [s for s in completed if any(not e.is_zero for e in s.values.values())]
    if len(completed) == 2 and completed[0].chosen == completed[1].chosen != "here":
        differences = [(n, completed[0].values[n] - completed[1].values[n]) for n in names]
        if decide_zero("", differences).verdict == PROVED:
            return (replace(completed[0], end=""),)
    return tuple(completed)


def _forces_at(cell: Cell, density: Expression, end: str) -> dict[str, Expression]:
    """Return the derivatives of the energy of a bond with respect to the fields at one end of the bond, "a" or "b".
    Each derivative is divided by the factor from `sum_factors`.
    """
    slopes = gradient(density, [cell.at(f, (end,)) for f in cell.fields])
    forces = {f: with_first_end(cell, e, end) for f, e in zip(cell.fields, slopes, strict=True) if not e.is_zero}
    return {_gathered(f): divided(e, sum_factors(cell, f).at_end) for f, e in forces.items()}


def _moving_forces(cell: Cell, density: Expression, end: str) -> dict[str, Expression]:
    """Return those results of `_forces_at` that occur in the vector field."""
    read_symbols = symbols_of(*field_at_site(cell, {f: symbol(_gathered(f)) for f in cell.fields}))
    return {name: e for name, e in _forces_at(cell, density, end).items() if name in read_symbols}


def _monomials(cell: Cell, rate: Expression) -> Iterator[tuple[Expression, Expression]]:
    """Yield the terms of ``rate``, the rate of change that a bond causes at one of its ends.

    Each term is a pair: a monomial in the fields at this end, and its coefficient. In ``rate``, a field x at this end
    is written ``x[a]``; in the monomial, it is written ``x``. The coefficient may depend on fields at the opposite end.
    """
    ring = bracketless_ring([cell.at(f, ("a",)) for f in cell.fields], [rate])
    site_symbols = {cell.at(f, ("a",)): symbol(f) for f in cell.fields}
    for m, c in ring.terms(ring.tower.convert(rate), ring.state).items():
        yield substitute([ring.expression(ring.monomial(m))], site_symbols)[0], ring.expression(c)


def _gathered(name: str) -> Symbol:
    return Symbol(GATHERED, name)


def _gathered_in(e: Expression) -> Iterator[str]:
    return (n for n in symbols_of(e) if kind_of(n) == GATHERED)
