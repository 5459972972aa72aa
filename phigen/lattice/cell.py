"""The description of one site of a lattice, its cell: fields, brackets with neighbours, and energy density.

Values at neighbours are ordinary symbols of expressions. On a grid, ``x[i-1,j+2]`` is x at the site with the offset −1
along the axis i and 2 along the axis j. Axes are written in the order of ``axes`` of `Cell`; axes with the offset 0 are
left out: ``x[i+1]`` is x at the next site along i, and ``x`` is x at the site itself. On graphs, and if all pairs of
sites interact, ``x[a]`` and ``x[b]`` are x at the two ends of a bond or pair. Parameters that have a value at every
site are written in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from phigen.spec.model import NO_FORCES, Parameter, Reduction, SpecForces, SpecNoise
from phigen.symbolic.expression import ZERO, Expression, gradient, mul, neg, symbol, total
from phigen.symbolic.neighbours import ENDS, Neighbours, Offset, Place, minus, plus, steps
from phigen.symbolic.symbols import Symbol, increment

GRID, GRAPH, PAIRS = "grid", "graph", "pairs"
PERIODIC, OPEN = "periodic", "open"


@dataclass(frozen=True)
class Cell:
    """A lattice of identical sites, defined by its fields, brackets and energy densities at one site.

    ``axes`` has the names of the axes of a grid. In arrays, the index along the first axis varies slowest. ``boundary``
    is `PERIODIC` or `OPEN` for each axis. Graphs and pairs have no axes. ``bracket`` maps (f, g) to {f, g}, where f is
    a field at the site and g the symbol of a field at the site or at a neighbour. It contains all nonzero brackets, in
    both orders. ``bond_bracket`` maps ("f[a]", "g[b]") to the bracket {f[a], g[b]} along a bond; it has all nonzero
    brackets along bonds, in both orders. ``hamiltonian`` is the energy density of a site, ``bond_hamiltonian`` the
    energy of a bond from a to b, and ``pair_hamiltonian`` the energy of a pair. H is the sum of all three over all
    sites, bonds and pairs. Terms that reach beyond an open end are left out (see `terms`).

    ``casimirs`` maps names to a density and its kind: ``sites`` (one Casimir for each site), ``sum`` or ``product``.
    ``invariants`` are sums over sites. ``time`` is the symbol of t in H and in the invariants; it is "" if nothing
    depends on t. ``forces`` and the sources of ``noise`` act at a site, with independent noise at each site.
    ``observables`` are fields or densities; ``reductions`` says how a density becomes one number, such as a sum over
    the sites. ``derived`` are values at sites that a solver computes from the parameters.
    """

    name: str
    fields: tuple[str, ...]
    hamiltonian: Expression
    bracket: Mapping[tuple[str, str], Expression]
    relation: str = GRID
    axes: tuple[str, ...] = ()
    boundary: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    bond_hamiltonian: Expression = ZERO
    pair_hamiltonian: Expression = ZERO
    bond_bracket: Mapping[tuple[str, str], Expression] = field(default_factory=dict)
    casimirs: Mapping[str, tuple[Expression, str]] = field(default_factory=dict)
    invariants: Mapping[str, Expression] = field(default_factory=dict)
    time: str = ""
    forces: SpecForces = NO_FORCES
    noise: Mapping[str, SpecNoise] = field(default_factory=dict)
    observables: Mapping[str, Expression] = field(default_factory=dict)
    reductions: Mapping[str, Reduction] = field(default_factory=dict)
    derived: tuple[Symbol, ...] = ()

    @property
    def driven(self) -> bool:
        """Whether H is not conserved: H depends on the time, or forces or noise do work."""
        return bool(self.time or self.forces or self.noise)

    @property
    def increments(self) -> tuple[str, ...]:
        """The symbols of the noise increments of a site in a step, one for each source."""
        return tuple(increment(k) for k in range(len(self.noise)))

    # --- symbols

    @property
    def times(self) -> tuple[str, ...]:
        """The symbol of the time t as a tuple; () if H does not depend on the time."""
        return (self.time,) if self.time else ()

    @cached_property
    def neighbours(self) -> Neighbours:
        """The symbols of all quantities with a value at every site: fields, then parameters at sites, then noise
        increments, then derived values.
        """
        at_sites = (p.name for p in self.parameters if p.at == "sites")
        return Neighbours((*self.fields, *at_sites, *self.increments, *self.derived), self.axes)

    @property
    def vanishing(self) -> frozenset[str]:
        """The names of those parameters at sites whose values may be 0, because they are not declared positive."""
        return frozenset(p.name for p in self.parameters if p.at == "sites" and not p.positive)

    @property
    def origin(self) -> Offset:
        """The offset of a site from itself, which is zero along all axes."""
        return self.neighbours.origin

    def at(self, name: str, offset: Offset) -> str:
        """Return the symbol of a field, or of a parameter at sites, at the site that is ``offset`` away."""
        return self.neighbours.at(name, offset)

    def place(self, name: str) -> Place:
        """Return the name of the field or parameter that a symbol stands for, and the offset of its site.

        Raises `KeyError` for symbols of any other kind.
        """
        return self.neighbours.place(name)

    def places(self, *expressions: Expression) -> dict[str, Place]:
        """Return a map from symbols in the expressions to pairs (name, offset). The map contains the symbols of all
        quantities that have a value at each site, such as fields and parameters at sites.
        """
        return self.neighbours.places(*expressions)

    def shifted(self, expression: Expression, offset: Offset) -> Expression:
        """Return the expression moved by ``offset`` on a grid: each symbol is replaced by that of the site ``offset``
        away.
        """
        return self.neighbours.shifted([expression], offset)[0]

    def on(self, expression: Expression, end: str) -> Expression:
        """Return an expression of one site, written for the site at an ``end`` of a bond or a pair: x becomes ``x[a]``
        or ``x[b]``."""
        return self.neighbours.on(expression, end)

    # --- the density of H

    @cached_property
    def terms(self) -> tuple[Expression, ...]:
        """The additive terms of the energy density of a site.

        H omits a term at the sites where the term reaches beyond an open end.
        """
        return tuple(self.additive_terms(self.hamiltonian))

    def additive_terms(self, density: Expression) -> Iterator[Expression]:
        """Yield the additive terms of a density. A product such as c·(a + b) has two terms if c does not depend on the
        site.
        """
        yield from self._terms(density, ())

    def _terms(self, density: Expression, factors: tuple[Expression, ...]) -> Iterator[Expression]:
        args = density.args
        if density.op in ("add", "sub"):
            yield from self._terms(args[0], factors)
            yield from self._terms(args[1] if density.op == "add" else neg(args[1]), factors)
        elif density.op == "neg" and args[0].op in ("add", "sub", "mul"):
            for term in self._terms(args[0], factors):
                yield neg(term)
        elif density.op == "mul" and any(not self.places(a) and self.places(b) for a, b in (args, args[::-1])):
            constant, varying = args if not self.places(args[0]) else args[::-1]
            yield from self._terms(varying, (constant, *factors))
        elif not density.is_zero:
            for factor in factors:
                density = mul(factor, density)
            yield density

    def extent(self, expression: Expression) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the smallest offset along each axis and the largest offset along each axis, as two tuples. The offsets
        are those of the sites that the expression reads, and 0 for the site itself.
        """
        offsets = [steps(self.origin), *(steps(o) for _, o in self.places(expression).values())]
        return tuple(map(min, zip(*offsets, strict=True))), tuple(map(max, zip(*offsets, strict=True)))

    @cached_property
    def poisson_reach(self) -> tuple[int, ...]:
        """For each axis, the largest distance from the site of f to another site of a bracket {f, g}.

        The sites of a bracket are those of f and g, and all sites on which the value of the bracket depends.
        """
        second_fields = [symbol(other) for _, other in self.bracket]
        return self._reach([*second_fields, *self.bracket.values()])

    @cached_property
    def hamiltonian_reach(self) -> tuple[int, ...]:
        """Largest distance along each axis between two sites of one term of H."""
        return self._widest(self.terms)

    @cached_property
    def observed_reach(self) -> tuple[int, ...]:
        """Largest distance along each axis between two sites of one observable."""
        return self._widest(self.observables.values())

    def _widest(self, expressions: Iterable[Expression]) -> tuple[int, ...]:
        """Return the largest distance along each axis between two sites in one expression."""
        grid = expressions if self.axes else ()
        widths = [[high - low for low, high in zip(*self.extent(e), strict=True)] for e in grid]
        return tuple(max((w[k] for w in widths), default=0) for k in range(len(self.axes)))

    def _reach(self, expressions: Iterable[Expression]) -> tuple[int, ...]:
        offsets = [steps(o) for _, o in self.places(*expressions).values()]
        return tuple(max((abs(o[k]) for o in offsets), default=0) for k in range(len(self.axes)))

    @property
    def is_local(self) -> bool:
        """Whether all brackets are between fields of one and the same site."""
        return not self.bond_bracket and not any(self.poisson_reach)


@dataclass(frozen=True)
class Contribution:
    """A term of ∂H/∂f at a site: the derivative of a term of H.

    The term of H reads the sites between the offsets ``low`` and ``high``. Near an open end, the contribution is
    omitted unless all these sites are on the lattice.
    """

    expression: Expression
    low: tuple[int, ...]
    high: tuple[int, ...]


def contributions(cell: Cell) -> dict[str, tuple[Contribution, ...]]:
    """Return the terms of ∂H/∂f at a site of a grid, by field f. Each term of H that reads f at this site gives one
    term.
    """
    terms_by_field: dict[str, list[Contribution]] = {f: [] for f in cell.fields}
    for term in cell.terms:
        field_places = {name: p for name, p in cell.places(term).items() if p[0] in cell.fields}
        low, high = cell.extent(term)
        slopes = gradient(term, list(field_places))
        for (base, offset), slope in zip(field_places.values(), slopes, strict=True):
            if not slope.is_zero:
                slope_here, origin = cell.shifted(slope, minus(offset)), steps(minus(offset))
                terms_by_field[base].append(Contribution(slope_here, plus(low, origin), plus(high, origin)))
    return {f: tuple(terms) for f, terms in terms_by_field.items()}


def forces(cell: Cell) -> dict[str, Expression]:
    """Return ∂H/∂f at a site away from open ends, for each field f.

    On graphs and for pairs, only the energy densities of sites contribute; `bond_forces` has the forces of bonds and
    pairs.
    """
    if cell.relation != GRID:
        return dict(zip(cell.fields, gradient(cell.hamiltonian, cell.fields), strict=True))
    return {f: total(c.expression for c in terms) for f, terms in contributions(cell).items()}


def bond_forces(cell: Cell) -> dict[str, Expression]:
    """Return the derivatives of the energy of a bond or pair with respect to the fields ``f[a]`` and ``f[b]`` of its
    ends.

    The result maps these symbols to derivatives; zeros are left out.
    """
    density = cell.bond_hamiltonian + cell.pair_hamiltonian
    names = [cell.at(f, (end,)) for end in ENDS for f in cell.fields]
    return {n: slope for n, slope in zip(names, gradient(density, names), strict=True) if not slope.is_zero}


def vector_field(cell: Cell) -> dict[str, Expression]:
    """Return ḟ at a site of a grid, for each field f, without noise and away from open ends."""
    slopes, acting = forces(cell), cell.forces
    hamiltonian_field = _tangent(cell, slopes)
    if not acting:
        return hamiltonian_field
    damping = acting.damping or ZERO
    slopes_with_forces = {
        f: slopes[f] + acting.covector.get(f, ZERO) + damping * hamiltonian_field[f] for f in cell.fields
    }
    return {f: e + acting.vector.get(f, ZERO) for f, e in _tangent(cell, slopes_with_forces).items()}


def _tangent(cell: Cell, covector: Mapping[str, Expression]) -> dict[str, Expression]:
    """Return πp at a site of a grid, by field; ``covector`` has the components of p at the site, by field."""
    rates: dict[str, list[Expression]] = {f: [] for f in cell.fields}
    for (f, other), entry in cell.bracket.items():
        base, offset = cell.place(other)
        rates[f].append(entry * cell.shifted(covector[base], offset))
    return {f: total(terms) for f, terms in rates.items()}
