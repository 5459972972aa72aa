"""One cell of a lattice: the fields of a site, their brackets with neighbours, and the density of H.

Neighbours are ordinary symbols of the expression engine. On a grid ``x[i+1]`` and ``x[i-1,j+2]`` are x at the site
that is so far away along the axes i and j; axes come in their order, those of offset 0 are left out, and ``x`` alone is
x at the site itself. On graphs, and for all pairs, ``x[a]`` and ``x[b]`` are x at the two ends. Parameters that have a
value at every site are written in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from phigen.spec.model import NO_FORCES, Parameter, Reduction, SpecForces, SpecNoise
from phigen.symbolic.expression import ZERO, Expression, gradient, mul, neg, symbol, total
from phigen.symbolic.neighbours import ENDS, Neighbours, Offset, Place, minus, plus, steps
from phigen.symbolic.symbols import increment

GRID, GRAPH, PAIRS = "grid", "graph", "pairs"
PERIODIC, OPEN = "periodic", "open"


@dataclass(frozen=True)
class Cell:
    """A lattice by its cell.

    ``axes`` name the directions of a grid, the slowest first; ``boundary`` is `PERIODIC` or `OPEN` along each. Graphs
    and pairs have neither. ``bracket`` maps (f, g at some offset), as symbols, to {f, g}: all that are not 0, in
    both orders. ``hamiltonian`` is the density of a site, ``bond_hamiltonian`` and ``pair_hamiltonian`` those of a
    bond from a to b and of a pair; ``bond_bracket`` maps ("f[a]", "g[b]") and ("g[b]", "f[a]") to their bracket along
    a bond. H is the sum of the densities; at open ends without those of their `terms` that reach beyond.
    ``casimirs`` maps names to a density and ``sites`` (one for each site), ``sum`` or ``product``; ``invariants`` are
    sums over sites. ``time`` is the symbol of t, which H and the invariants may contain; empty if there is none.
    ``forces`` and the sources of ``noise`` are those at a site; each site has noise of its own. ``observables`` are
    densities, of which ``reductions`` make numbers, and fields.
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

    @property
    def driven(self) -> bool:
        """Whether H is no invariant: it depends on the time, or forces or noise do work."""
        return bool(self.time or self.forces or self.noise)

    @property
    def increments(self) -> tuple[str, ...]:
        """The symbols of the increments that the noise of a site has in a step, one for each source."""
        return tuple(increment(k) for k in range(len(self.noise)))

    # --- symbols

    @property
    def times(self) -> tuple[str, ...]:
        """The symbol of the time, if there is one."""
        return (self.time,) if self.time else ()

    @cached_property
    def neighbours(self) -> Neighbours:
        """The symbols of what has a value at every site: of fields, then of parameters at sites, then of noise."""
        at_sites = (p.name for p in self.parameters if p.at == "sites")
        return Neighbours((*self.fields, *at_sites, *self.increments), self.axes)

    @property
    def origin(self) -> Offset:
        """The offset of the site itself."""
        return self.neighbours.origin

    def at(self, name: str, offset: Offset) -> str:
        """The symbol of a field, or of a parameter at sites, at an offset."""
        return self.neighbours.at(name, offset)

    def place(self, name: str) -> Place:
        """The field, or parameter at sites, of a symbol, and its offset. `KeyError` for any other symbol."""
        return self.neighbours.place(name)

    def places(self, *expressions: Expression) -> dict[str, Place]:
        """All symbols of expressions that have a value at sites, with their places."""
        return self.neighbours.places(*expressions)

    def shifted(self, expression: Expression, offset: Offset) -> Expression:
        """The expression as it is at the site that lies so far away on the grid."""
        return self.neighbours.shifted([expression], offset)[0]

    def on(self, expression: Expression, end: str) -> Expression:
        """A density of a site as it is at one end of a bond or a pair."""
        return self.neighbours.on(expression, end)

    # --- the density of H

    @cached_property
    def terms(self) -> tuple[Expression, ...]:
        """The additive terms of the density of a site, as they are written; open ends leave out single ones."""
        return tuple(self.additive_terms(self.hamiltonian))

    def additive_terms(self, density: Expression) -> Iterator[Expression]:
        """The terms of a sum; a factor that is the same at all sites is multiplied into a sum."""
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
        """The least and the largest offsets along each axis of what a term of a grid mentions, and of its own site."""
        offsets = [steps(self.origin), *(steps(o) for _, o in self.places(expression).values())]
        return tuple(map(min, zip(*offsets, strict=True))), tuple(map(max, zip(*offsets, strict=True)))

    @cached_property
    def poisson_reach(self) -> tuple[int, ...]:
        """How far the brackets reach along each axis: to the other field, and by what they depend on."""
        others = [symbol(other) for _, other in self.bracket]
        return self._reach([*others, *self.bracket.values()])

    @cached_property
    def hamiltonian_reach(self) -> tuple[int, ...]:
        """How far apart two sites of one term of H are at most, along each axis."""
        return self._widest(self.terms)

    @cached_property
    def observed_reach(self) -> tuple[int, ...]:
        """How far apart two sites of one observable are at most, along each axis."""
        return self._widest(self.observables.values())

    def _widest(self, expressions: Iterable[Expression]) -> tuple[int, ...]:
        """Return how far apart two sites of one of the expressions are at most, along each axis."""
        grid = expressions if self.axes else ()
        widths = [[h - low for low, h in zip(*self.extent(e), strict=True)] for e in grid]
        return tuple(max((w[k] for w in widths), default=0) for k in range(len(self.axes)))

    def _reach(self, expressions: Iterable[Expression]) -> tuple[int, ...]:
        offsets = [steps(o) for _, o in self.places(*expressions).values()]
        return tuple(max((abs(o[k]) for o in offsets), default=0) for k in range(len(self.axes)))

    @property
    def is_local(self) -> bool:
        """Whether brackets couple the fields of one site only."""
        return not self.bond_bracket and not any(self.poisson_reach)


@dataclass(frozen=True)
class Contribution:
    """A term of ∂H/∂f at a site: ``low`` and ``high`` are the offsets that the term of H it comes from reaches.

    Beside an open end it is there only if all offsets from ``low`` to ``high`` are on the lattice.
    """

    expression: Expression
    low: tuple[int, ...]
    high: tuple[int, ...]


def contributions(cell: Cell) -> dict[str, tuple[Contribution, ...]]:
    """∂H/∂f at a site of a grid, for each field f, term by term of H: of all densities that mention this site."""
    found: dict[str, list[Contribution]] = {f: [] for f in cell.fields}
    for term in cell.terms:
        named = {name: p for name, p in cell.places(term).items() if p[0] in cell.fields}
        low, high = cell.extent(term)
        slopes = gradient(term, list(named))
        for (base, offset), slope in zip(named.values(), slopes, strict=True):
            if not slope.is_zero:
                moved, back = cell.shifted(slope, minus(offset)), steps(minus(offset))
                found[base].append(Contribution(moved, plus(low, back), plus(high, back)))
    return {f: tuple(listed) for f, listed in found.items()}


def forces(cell: Cell) -> dict[str, Expression]:
    """∂H/∂f at a site, for each field f, from the densities of sites; away from open ends.

    On graphs and for pairs what bonds and pairs add is in `bond_forces`.
    """
    if cell.relation != GRID:
        return dict(zip(cell.fields, gradient(cell.hamiltonian, cell.fields), strict=True))
    return {f: total(c.expression for c in listed) for f, listed in contributions(cell).items()}


def bond_forces(cell: Cell) -> dict[str, Expression]:
    """The derivatives of the density of a bond, or a pair, by ``f[a]`` and ``f[b]`` for all fields f, without zeros."""
    density = cell.bond_hamiltonian + cell.pair_hamiltonian
    names = [cell.at(f, (end,)) for end in ENDS for f in cell.fields]
    return {n: slope for n, slope in zip(names, gradient(density, names), strict=True) if not slope.is_zero}


def vector_field(cell: Cell) -> dict[str, Expression]:
    """ḟ at a site of a grid, for each field f, away from open ends, but for noise."""
    slopes, acting = forces(cell), cell.forces
    moved = _tangent(cell, slopes)
    if not acting:
        return moved
    damping = acting.damping or ZERO
    pushed = {f: slopes[f] + acting.covector.get(f, ZERO) + damping * moved[f] for f in cell.fields}
    return {f: e + acting.vector.get(f, ZERO) for f, e in _tangent(cell, pushed).items()}


def _tangent(cell: Cell, covector: Mapping[str, Expression]) -> dict[str, Expression]:
    """π of a covector field that is given at a site."""
    rates: dict[str, list[Expression]] = {f: [] for f in cell.fields}
    for (f, other), entry in cell.bracket.items():
        base, offset = cell.place(other)
        rates[f].append(entry * cell.shifted(covector[base], offset))
    return {f: total(listed) for f, listed in rates.items()}
