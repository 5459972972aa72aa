"""Expansion of a small lattice: a spec without the key ``lattice``, with a coordinate for each field of each site.

This spec is called the ordinary spec. It defines the meaning of the lattice: the equations of motion of the lattice
must be those of the ordinary spec.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import combinations, product
from typing import Any

from phigen.lattice.cell import OPEN, Cell
from phigen.spec.model import MatrixForm, Parameter, Run, Spec, SpecForces, SpecNoise
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute, symbol, total
from phigen.symbolic.expression import product as product_of
from phigen.symbolic.neighbours import ENDS, Offset, plus

Site = tuple[int, ...]


@dataclass(frozen=True)
class Expansion:
    """A lattice of given sizes as an ordinary system, with all sites written out.

    ``bonds`` has the pairs of sites that the bonds of a graph connect. Graphs and pairs have one size, the number of
    sites. ``names`` maps (field or parameter, site) to the name of a coordinate or parameter of the ordinary spec.
    ``bond_names`` maps (parameter, index of the bond) to the name of a parameter. Coordinates are ordered by field,
    then by site with the last axis fastest. So an array of the shape (fields, *sizes), flattened, is a state of the
    ordinary system.
    """

    cell: Cell
    sizes: tuple[int, ...]
    bonds: tuple[tuple[int, int], ...] = ()
    names: Mapping[tuple[str, Site], str] = field(default_factory=dict)
    bond_names: Mapping[tuple[str, int], str] = field(default_factory=dict)

    @property
    def sites(self) -> list[Site]:
        """All sites, the last axis fastest."""
        return list(product(*map(range, self.sizes)))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The coordinates of the expansion, by field, then by site."""
        return tuple(self.names[f, s] for f in self.cell.fields for s in self.sites)

    # --- expressions at sites

    def neighbour(self, site: Site, offset: Offset) -> Site | None:
        """Return the site at an ``offset`` from ``site``, or None if this site would lie beyond an open end."""
        position = plus(site, offset)
        is_inside = [0 <= n < size for n, size in zip(position, self.sizes, strict=True)]
        if any(b == OPEN and not i for b, i in zip(self.cell.boundary, is_inside, strict=True)):
            return None
        return tuple(n % size for n, size in zip(position, self.sizes, strict=True))

    def at(self, expression: Expression, site: Site) -> Expression | None:
        """Return an expression of the cell, placed at a site, or None if the expression reaches beyond an open end
        there.
        """
        values = {}
        for name, (base, offset) in self.cell.places(expression).items():
            source = self.neighbour(site, offset) if self.cell.axes else site
            if source is None:
                return None
            values[name] = symbol(self.names[base, source])
        return substitute([expression], values)[0]

    def between(self, expression: Expression, a: Site, b: Site, bond: int | None = None) -> Expression:
        """Return the density of a bond, or of a pair, whose ends are the sites ``a`` and ``b``.

        ``bond`` is the index of the bond, for parameters at bonds.
        """
        site_of_end = dict(zip(ENDS, (a, b), strict=True))
        places = self.cell.places(expression)
        values = {n: symbol(self.names[base, site_of_end[str(end[0])]]) for n, (base, end) in places.items()}
        if bond is not None:
            bond_parameters = (p.name for p in self.cell.parameters if p.at == "bonds")
            values |= {n: symbol(self.bond_names[n, bond]) for n in bond_parameters}
        return substitute([expression], values)[0]

    def summed(self, density: Expression) -> list[Expression]:
        """Return the terms of the sum of a density over all sites. Terms that reach beyond open ends are left out."""
        terms = [term for site in self.sites for t in self.cell.additive_terms(density) for term in [self.at(t, site)]]
        return [t for t in terms if t is not None]

    # --- the system

    def hamiltonian_terms(self) -> list[Expression]:
        """Return the terms whose sum is H."""
        cell = self.cell
        terms = self.summed(cell.hamiltonian)
        if not cell.bond_hamiltonian.is_zero:
            terms += [self.between(cell.bond_hamiltonian, (a,), (b,), k) for k, (a, b) in enumerate(self.bonds)]
        if not cell.pair_hamiltonian.is_zero:
            terms += [self.between(cell.pair_hamiltonian, a, b) for a, b in combinations(self.sites, 2)]
        return terms

    def poisson(self) -> dict[tuple[str, str], Expression]:
        """Return the brackets {a, b} of coordinates by (a, b), in both orders, without those that are 0."""
        entries: dict[tuple[str, str], list[Expression]] = {}
        for (f, other), value in self.cell.bracket.items():
            g, offset = self.cell.place(other)
            for site in self.sites:
                partner_site = self.neighbour(site, offset) if self.cell.axes else site
                if partner_site is not None:
                    terms = [self.at(t, site) for t in self.cell.additive_terms(value)]
                    entries.setdefault((self.names[f, site], self.names[g, partner_site]), []).extend(
                        t for t in terms if t is not None
                    )
        for (f_end, g_end), value in self.cell.bond_bracket.items():
            (f, at_f), (g, at_g) = self.cell.place(f_end), self.cell.place(g_end)
            for k, (a, b) in enumerate(self.bonds):
                positions = {"a": (a,), "b": (b,)}
                pair = self.names[f, positions[str(at_f[0])]], self.names[g, positions[str(at_g[0])]]
                entries.setdefault(pair, []).append(self.between(value, (a,), (b,), k))
        sums = {pair: total(terms) for pair, terms in entries.items()}
        return {pair: e for pair, e in sums.items() if not e.is_zero}

    def casimirs(self) -> dict[str, Expression]:
        """Return the Casimirs by name. The cell states a Casimir by a density. The Casimir is the sum or the product of
        the density over all sites, or the density at each site is a Casimir.
        """
        casimirs: dict[str, Expression] = {}
        plain_names = (*(p.name for p in self.cell.parameters), *self.cell.times)
        used_names = {*self.names.values(), *self.bond_names.values(), *plain_names}
        for name, (density, kind) in self.cell.casimirs.items():
            if kind == "sum":
                casimirs[name] = total(self.summed(density))
            else:
                values = {site: e for site in self.sites for e in [self.at(density, site)] if e is not None}
                if kind == "product":
                    casimirs[name] = product_of(values.values())
                else:
                    casimirs |= {_unused_name(name, site, used_names): e for site, e in values.items()}
        return casimirs

    def forces(self) -> SpecForces:
        """Return the forces on all sites. Damping whose coefficient depends on the site becomes a covector force."""
        cell_forces = self.cell.forces
        if not cell_forces:
            return cell_forces
        covector, vector = (
            {self.names[f, site]: total(self._terms(e, site)) for f, e in force_terms.items() for site in self.sites}
            for force_terms in (cell_forces.covector, cell_forces.vector)
        )
        damping = cell_forces.damping
        if damping is not None and self.cell.places(damping):
            field = self._field()
            for (f, site), rate in field.items():
                name = self.names[f, site]
                covector[name] = covector.get(name, ZERO) + total(self._terms(damping, site)) * rate
            damping = None
        return SpecForces(covector, vector, damping)

    def _field(self) -> dict[tuple[str, Site], Expression]:
        """Return the components of the vector field π∇H, by field and site."""
        slopes = dict(zip(self.coordinates, gradient(total(self.hamiltonian_terms()), self.coordinates), strict=True))
        rates: dict[str, list[Expression]] = {c: [] for c in self.coordinates}
        for (a, b), entry in self.poisson().items():
            rates[a].append(entry * slopes[b])
        return {(f, site): total(rates[self.names[f, site]]) for f in self.cell.fields for site in self.sites}

    def _terms(self, e: Expression, site: Site) -> list[Expression]:
        """Return the additive terms of an expression placed at a site. Terms that reach beyond open ends are left
        out.
        """
        values = (self.at(term, site) for term in self.cell.additive_terms(e))
        return [value for value in values if value is not None]

    def noise(self) -> dict[str, SpecNoise]:
        """Return the sources of noise by name: all sources of the first site, then those of the next site, and so
        on.
        """
        sources: dict[str, SpecNoise] = {}
        used_names = {*self.names.values(), *self.bond_names.values(), *(p.name for p in self.cell.parameters)}
        for site in self.sites:
            for name, source in self.cell.noise.items():
                parts = [self.at(e, site) or ZERO for e in (source.hamiltonian, source.amplitude)]
                sources[_unused_name(name, site, used_names)] = SpecNoise(*parts)
        return sources

    def matrix(self) -> MatrixForm:
        """Return π as a matrix in the order of the coordinates."""
        entries = self.poisson()
        return MatrixForm(tuple(tuple(entries.get((a, b), ZERO) for b in self.coordinates) for a in self.coordinates))

    def spec(self) -> Spec:
        """Return the expansion as a spec, which has no key ``lattice``.

        Each parameter with a value at every site or bond becomes one parameter for each site or bond.
        """
        cell = self.cell
        parameters: list[Parameter] = []
        for p in cell.parameters:
            names = {
                "all": [p.name],
                "sites": [self.names[p.name, s] for s in self.sites if p.at == "sites"],
                "bonds": [self.bond_names[p.name, k] for k in range(len(self.bonds)) if p.at == "bonds"],
            }[p.at]
            parameters += [replace(p, name=n, at="all", values=None) for n in names]
        return Spec(
            name=_name(cell.name, self.sizes),
            coordinates=self.coordinates,
            poisson=self.matrix(),
            hamiltonian=total(self.hamiltonian_terms()),
            parameters=tuple(parameters),
            casimirs=self.casimirs(),
            invariants={name: total(self.summed(d)) for name, d in cell.invariants.items()},
            time=cell.time,
            forces=self.forces(),
            noise=self.noise(),
        )

    def numbers(self, parameters: Mapping[str, Any]) -> dict[str, float]:
        """Return the numbers that the parameters of the ordinary spec have, by name.

        ``parameters`` are those of a lattice solver: numbers, and arrays over sites or bonds.
        """
        numbers = {}
        for p in self.cell.parameters:
            value = parameters[p.name]
            if p.at == "all":
                numbers[p.name] = float(value)
            elif p.at == "sites":
                numbers |= {self.names[p.name, s]: float(value[s]) for s in self.sites}
            else:
                numbers |= {self.bond_names[p.name, k]: float(value[k]) for k in range(len(self.bonds))}
        return numbers


def expand(cell: Cell, sizes: Sequence[int], bonds: Sequence[Sequence[int]] = ()) -> Expansion:
    """Return the expansion of a lattice with the given sizes.

    Graphs and pairs have one size, the number of sites; graphs need their bonds. Raises `ValueError` for wrong sizes,
    or for bonds that do not connect two different sites.
    """
    if len(sizes) != (len(cell.axes) or 1) or any(n < 1 for n in sizes):
        axes = f"{len(cell.axes)} positive integers, for the axes {', '.join(cell.axes)}"
        required = axes if len(cell.axes) > 1 else "one positive integer, the number of sites"
        raise ValueError(f"sizes must be {required}; got {'x'.join(map(str, sizes))}")
    bond_ends = tuple((int(a), int(b)) for a, b in bonds)
    if any(not (0 <= n < sizes[0]) for pair in bond_ends for n in pair) or any(a == b for a, b in bond_ends):
        raise ValueError(f"bonds are pairs of different sites between 0 and {sizes[0] - 1}")
    used_names = {p.name for p in cell.parameters if p.at == "all"} | {*cell.casimirs, *cell.invariants, *cell.times}
    sites = list(product(*map(range, sizes)))
    local = (n for n in cell.neighbours.names if n not in cell.increments)
    names = {(n, s): _unused_name(n, s, used_names) for n in local for s in sites}
    bond_parameters = [p.name for p in cell.parameters if p.at == "bonds"]
    bond_names = {(n, k): _unused_name(n, (k,), used_names) for n in bond_parameters for k in range(len(bond_ends))}
    return Expansion(cell, tuple(sizes), bond_ends, names, bond_names)


def ring(sites: int) -> list[tuple[int, int]]:
    """Return bonds that form a ring with a chord. This graph is used as an example if the user gives no graph."""
    chord = [(0, sites // 2)] if sites > 3 else []
    return [(k, (k + 1) % sites) for k in range(sites if sites > 2 else sites - 1)] + chord


def run_of(expansion: Expansion, run: Run, state: Any, numbers: Mapping[str, float]) -> Run:
    """Return a run of the ordinary spec with the same data as a run of the lattice.

    ``state`` is the initial state of the lattice, and ``numbers`` are the parameters of the ordinary spec. Sections and
    stops are left out: they refer to observables, which the ordinary spec does not have.
    """
    return replace(
        run,
        initial=tuple(_decimal(v) for v in state.reshape(-1)),
        parameters={n: _decimal(v) for n, v in numbers.items()},
        lattice=None,
        section=None,
        stop=None,
        record=(),
    )


def _decimal(value: float) -> Fraction:
    """Return the shortest decimal that rounds to the given double, as a fraction."""
    return Fraction(repr(float(value)))


def _unused_name(name: str, site: Site, used_names: set[str]) -> str:
    """Return a name such as ``x_1_2`` for ``x`` at site (1, 2), and add the name to ``used_names``.

    If the name is used already, underscores are appended until the name is new.
    """
    candidate = "_".join([name, *map(str, site)])
    while candidate in used_names:
        candidate += "_"
    used_names.add(candidate)
    return candidate


def _name(name: str, sizes: Sequence[int]) -> str:
    ending = "_" + "x".join(map(str, sizes))
    return name[: 31 - len(ending)] + ending
