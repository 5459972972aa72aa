"""Recognition of lattices among ordinary systems whose specs list the coordinates of all sites.

Numbers in names of coordinates are read as sites: ``x1 … x16``, ``q_0_0 … q_7_7``, ``S3_x``. Each term of H is
translated to the site at the origin. Terms that are equal after translation, one for every site, become one term of the
density of H. Brackets are treated in the same way. Terms are compared only by their values at one point, so the result
may be wrong. Therefore the lattice is expanded, and the expansion is proved to be the original system.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from math import prod
from typing import Any

from phigen.errors import SpecError
from phigen.geometry.forms import algebra_of_form, poisson_matrix
from phigen.geometry.shapes import Matrix
from phigen.lattice.cell_building import cell_from_spec
from phigen.lattice.expansion import Expansion
from phigen.spec import limits
from phigen.spec.model import Lattice, LatticeRunSettings, MatrixForm, Parameter, Run, Spec, Values
from phigen.spec.names import SPEC_FUNCTIONS
from phigen.symbolic.expression import ONE, ZERO, Expression, mul, neg, substitute, symbol, symbols_of, total
from phigen.symbolic.expression import product as product_of
from phigen.symbolic.neighbours import Neighbours
from phigen.symbolic.numeric import DomainError, evaluate
from phigen.symbolic.verdict import decide_zero

#: Least number of sites along an axis. On fewer sites, equal terms may be a coincidence.
MIN_SITES_PER_AXIS = 4

Site = tuple[int, ...]
Terms = list[tuple[Site, Expression]]


class _NoLatticeError(Exception):
    """The system is not a lattice, or the names of its coordinates do not show the sites."""


@dataclass(frozen=True)
class _SiteNames:
    """The fields and sites that names stand for.

    ``sites`` maps names to (field, site): the names of coordinates, and of parameters that differ from site to site.
    ``space`` has the symbols of neighbours on the lattice. Terms are compared by their values at one point; ``point``
    maps symbols to their values at this point.
    """

    fields: tuple[str, ...]
    sizes: tuple[int, ...]
    boundary: tuple[str, ...]
    sites: Mapping[str, tuple[str, Site]]
    space: Neighbours
    point: dict[str, float] = field(default_factory=dict)


def recognised_lattice(spec: Spec, least: int) -> Spec | None:
    """Return a spec with the key ``lattice`` for the system of an ordinary spec, which lacks this key.

    Returns None if the names of coordinates show fewer than ``least`` sites, if phigen recognises no lattice, or if the
    brackets of the spec are not valid.
    """
    if not any(prod(_sizes(names)) >= least for names in _readings(spec.coordinates)):
        return None
    try:
        matrix = poisson_matrix(spec.poisson, spec.coordinates, algebra_of_form(spec.poisson, spec.coordinates))
    except SpecError:
        return None
    return recognised(spec, matrix)


def recognised(spec: Spec, poisson: Matrix) -> Spec | None:
    """Return a spec with the key ``lattice`` for the system of an ordinary spec with the matrix π = ``poisson``.

    Returns None if phigen recognises no lattice, and for systems with forces, noise or a time-dependent H.
    """
    if spec.time or spec.forces or spec.noise:
        return None
    for names in _readings(spec.coordinates):
        for boundary in product(("periodic", "open"), repeat=len(_sizes(names))):
            try:
                return _lattice(spec, poisson, names, boundary)
            except (_NoLatticeError, DomainError):
                continue
    return None


# --- names


def _readings(coordinates: Sequence[str]) -> Iterator[dict[str, tuple[str, Site]]]:
    """Yield maps from coordinates to (field, site), for all ways to read the numbers in the names of
    coordinates.

    The site consists of all numbers in a name, or of one of these numbers.
    """
    groups = {len(re.findall(r"[0-9]+", c)) for c in coordinates}
    if len(groups) != 1 or groups == {0}:
        return
    (count,) = groups
    choices = [tuple(range(count))] * (count <= 3) + [(k,) for k in range(count) if count > 1]
    for digits_read in choices:
        places = {c: _split(c, digits_read) for c in coordinates}
        if _is_full(places):
            yield places


def _split(name: str, digits_read: Sequence[int]) -> tuple[str, Site]:
    parts = re.split(r"([0-9]+)", name)
    site = tuple(int(parts[2 * k + 1]) for k in digits_read)
    for k in digits_read:
        parts[2 * k + 1] = ""
    return re.sub(r"_+", "_", "".join(parts)).strip("_") or "x", site


def _sizes(places: Mapping[str, tuple[str, Site]]) -> tuple[int, ...]:
    columns = zip(*(site for _, site in places.values()), strict=True)
    return tuple(len(set(column)) for column in columns)


def _is_full(places: Mapping[str, tuple[str, Site]]) -> bool:
    """Whether each field has exactly one coordinate at every site of a box."""
    sizes = _sizes(places)
    sites = Counter(site for _, site in places.values())
    fields = {f for f, _ in places.values()}
    columns = [sorted(set(c)) for c in zip(*(s for _, s in places.values()), strict=True)]
    gapless = all(c[-1] - c[0] + 1 == len(c) for c in columns)
    return (
        gapless
        and min(sizes) >= MIN_SITES_PER_AXIS
        and len(set(places.values())) == len(places) == len(fields) * prod(sizes)
        and set(sites.values()) == {len(fields)}
    )


# --- the lattice


def _lattice(
    spec: Spec, poisson: Matrix, coordinates: Mapping[str, tuple[str, Site]], boundary: tuple[str, ...]
) -> Spec:
    names = _names(spec, coordinates, boundary)
    at_sites = {names.sites[p.name][0] for p in spec.parameters if p.name in names.sites}
    parameters = _parameters(spec, names, at_sites)
    local, neighbour_brackets = _brackets(spec, poisson, names)
    casimirs, kinds = _casimirs(spec, names)
    lattice_spec = Spec(
        scheme="auto",
        name=spec.name,
        coordinates=names.fields,
        poisson=MatrixForm(tuple(tuple(local.get((f, g), ZERO) for g in names.fields) for f in names.fields)),
        hamiltonian=total(_density(spec.hamiltonian, names)),
        parameters=parameters,
        casimirs=casimirs,
        invariants=_invariants(spec, names),
        order=spec.order,
        title=spec.title,
        lattice=Lattice(names.space.axes, boundary, brackets=neighbour_brackets, kinds=kinds),
    )
    _prove(spec, poisson, lattice_spec, names)
    return replace(lattice_spec, runs={n: _run(spec, run, names) for n, run in spec.runs.items()})


def _names(spec: Spec, coordinates: Mapping[str, tuple[str, Site]], boundary: tuple[str, ...]) -> _SiteNames:
    """Return the fields and sites of coordinates, and of parameters with a value at every site.

    Sites are counted from 0 along each axis, even if the names start at 1. Raises `_NoLatticeError` if the spec uses
    the names of axes already.
    """
    first = tuple(min(c) for c in zip(*(s for _, s in coordinates.values()), strict=True))
    fields = tuple(dict.fromkeys(f for f, _ in coordinates.values()))
    sizes = _sizes(coordinates)
    all_sites = {s for _, s in coordinates.values()}
    places = dict(coordinates)
    numbered = [p.name for p in spec.parameters if len(re.findall(r"[0-9]+", p.name)) == len(sizes)]
    by_stem: dict[str, dict[str, Site]] = {}
    for name in numbered:
        stem, site = _split(name, range(len(sizes)))
        by_stem.setdefault(stem, {})[name] = site
    for stem, sites_of_stem in by_stem.items():
        if set(sites_of_stem.values()) == all_sites and len(sites_of_stem) == len(all_sites) and stem not in fields:
            places |= {name: (stem, site) for name, site in sites_of_stem.items()}
    sites = {n: (f, tuple(a - b for a, b in zip(s, first, strict=True))) for n, (f, s) in places.items()}
    stems = tuple(dict.fromkeys(f for f, _ in sites.values()))
    other_names = {p.name for p in spec.parameters if p.name not in sites} | {*SPEC_FUNCTIONS}
    used_names = {*stems, *other_names}
    letters = [a for a in ("i", "j", "k", "l", "m", "n") if a not in used_names and f"N_{a}" not in used_names]
    if len(letters) < len(sizes) or {*stems} & other_names:
        raise _NoLatticeError
    axes = tuple(letters[: len(sizes)])
    return _SiteNames(fields, sizes, boundary, sites, Neighbours(stems, axes))


def _parameters(spec: Spec, names: _SiteNames, at_sites: set[str]) -> tuple[Parameter, ...]:
    parameters = [p for p in spec.parameters if p.name not in names.sites]
    for stem in sorted(at_sites):
        values = {names.sites[p.name][1]: p for p in spec.parameters if names.sites.get(p.name, ("",))[0] == stem}
        site_values = [values[s] for s in sorted(values)]
        equal = len({p.value for p in site_values}) == 1
        array = None if equal else Values(listed=tuple(p.value for p in site_values))
        positive = all(p.positive for p in site_values)
        parameters.append(Parameter(stem, site_values[0].value, positive, site_values[0].description, "sites", array))
    return tuple(parameters)


def _translated(e: Expression, names: _SiteNames, base: Site | None = None) -> tuple[Site, Expression]:
    """Return the site at which a term is placed, and the term translated from there to the origin.

    The site is ``base`` if this argument is passed. Otherwise it is the site at which the smallest box begins that
    contains the sites of all symbols in the term.
    """
    places = {n: names.sites[n] for n in symbols_of(e) if n in names.sites}
    if base is None:
        if not places:
            raise _NoLatticeError
        columns = list(zip(*(site for _, site in places.values()), strict=True))
        base = tuple(_start(set(c), n, b) for c, n, b in zip(columns, names.sizes, names.boundary, strict=True))
    values = {n: symbol(names.space.at(f, _offset(site, base, names))) for n, (f, site) in places.items()}
    return base, substitute([e], values)[0]


def _start(sites: set[int], size: int, boundary: str) -> int:
    """Return the first site of the shortest interval that contains all ``sites``, along one axis. A periodic axis wraps
    around.
    """
    if boundary == "open":
        return min(sites)
    ordered = sorted(sites)
    gaps = [((b - a - 1) % size, b) for a, b in zip(ordered, [*ordered[1:], ordered[0]], strict=True)]
    return max(gaps)[1] if len(ordered) > 1 else ordered[0]


def _offset(site: Site, base: Site, names: _SiteNames) -> Site:
    offset = []
    for a, b, n, boundary in zip(site, base, names.sizes, names.boundary, strict=True):
        step = a - b
        if boundary == "periodic":
            step = (step + n // 2) % n - n // 2
        # On a periodic axis, an offset of half the size or more has no unique direction.
        if abs(step) > limits.OFFSET or 2 * abs(step) >= n:
            raise _NoLatticeError
        offset.append(step)
    return tuple(offset)


def _key(e: Expression, names: _SiteNames) -> float:
    """Return the value of a term at a sample point, rounded to 9 digits. Terms with equal values count as
    equal.

    The sample point is the same for all terms.
    """
    for name in symbols_of(e):
        # Fractional parts of multiples of the golden ratio are all different, and spread evenly. 0.5 is added to avoid
        # 0.
        names.point.setdefault(name, 0.5 + (0.6180339887498949 * (len(names.point) + 1)) % 1)
    return float(f"{evaluate([e], names.point)[0]:.9g}")


def _orbits(terms: Iterable[tuple[Site, Expression]], names: _SiteNames) -> list[Expression]:
    """Return the terms of a density whose sum over all sites is the sum of ``terms``.

    Each of the ``terms`` comes with its site. Raises `_NoLatticeError` unless each term occurs equally often at all
    sites at which the term fits between open ends.
    """
    kinds: dict[float, tuple[Expression, Counter[Site]]] = {}
    for base, term in terms:
        kinds.setdefault(_key(term, names), (term, Counter()))[1][base] += 1
    density_terms = []
    for term, occurrences in kinds.values():
        (times,) = {*occurrences.values()} if len({*occurrences.values()}) == 1 else {0}
        if not times or len(occurrences) != _room(term, names):
            raise _NoLatticeError
        density_terms.append(term if times == 1 else times * term)
    return density_terms


def _room(term: Expression, names: _SiteNames) -> int:
    """Return the number of sites at which a term can be placed without reaching beyond an open end."""
    offsets = [o for _, o in names.space.places(term).values()] or [(0,) * len(names.sizes)]
    wide = [max(map(int, c)) - min(0, *map(int, c)) for c in zip(*offsets, strict=True)]
    return prod(n - (w if b == "open" else 0) for n, w, b in zip(names.sizes, wide, names.boundary, strict=True))


def _density(e: Expression, names: _SiteNames) -> list[Expression]:
    return _orbits((_translated(t, names) for t in _terms(e, names, ONE)), names)


def _terms(e: Expression, names: _SiteNames, factor: Expression) -> Iterator[Expression]:
    """Yield the additive terms of an expression, each multiplied by ``factor``.

    If a sum in parentheses has a factor that does not depend on the site, each term of the sum is multiplied by this
    factor.
    """
    args = e.args
    if e.op in ("add", "sub"):
        yield from _terms(args[0], names, factor)
        yield from _terms(args[1] if e.op == "add" else neg(args[1]), names, factor)
    elif e.op == "neg":
        yield from _terms(args[0], names, neg(factor))
    elif e.op == "mul" and any(not _varies(a, names) for a in args):
        constant, varying = args if not _varies(args[0], names) else args[::-1]
        yield from _terms(varying, names, mul(constant, factor))
    elif not e.is_zero:
        yield mul(factor, e)


def _varies(e: Expression, names: _SiteNames) -> bool:
    return any(n in names.sites for n in symbols_of(e))


def _brackets(
    spec: Spec, poisson: Matrix, names: _SiteNames
) -> tuple[dict[tuple[str, str], Expression], dict[tuple[str, str], Expression]]:
    """Return the brackets of the lattice as two maps: between fields of one site, and between fields of different
    sites.

    The second map has each bracket in one order only. Raises `_NoLatticeError` if brackets differ from site to site.
    """
    kinds: dict[tuple[str, str], dict[Site, Expression]] = {}
    for c, row in zip(spec.coordinates, poisson, strict=True):
        f, site = names.sites[c]
        for d, entry in zip(spec.coordinates, row, strict=True):
            if not entry.is_zero:
                g, second_site = names.sites[d]
                pair = f, names.space.at(g, _offset(second_site, site, names))
                kinds.setdefault(pair, {})[site] = _translated(entry, names, site)[1]
    local, neighbour_brackets = {}, dict[tuple[str, str], Expression]()
    for (f, g), entries in kinds.items():
        if len({_key(e, names) for e in entries.values()}) != 1:
            raise _NoLatticeError
        first = next(iter(entries.values()))
        base, offset = names.space.place(g)
        if not any(offset):
            local[f, g] = first
        elif (base, names.space.at(f, tuple(-int(o) for o in offset))) not in neighbour_brackets:
            neighbour_brackets[f, g] = first
    return local, neighbour_brackets


def _casimirs(spec: Spec, names: _SiteNames) -> tuple[dict[str, Expression], dict[str, str]]:
    """Return the densities and the kinds of Casimirs of the lattice, by name.

    A Casimir of the ordinary spec becomes a sum or a product over sites. If each site has a Casimir with the same
    density, these Casimirs become a single one of the kind "sites". All other Casimirs are left out.
    """
    densities, kinds = dict[str, Expression](), dict[str, str]()
    by_value: dict[float, list[tuple[str, Expression]]] = {}
    used_names = {*names.space.names, *(p.name for p in spec.parameters)}
    for name, e in spec.casimirs.items():
        for kind, density in (("product", _product_of), ("sum", _sum_of)):
            try:
                densities[name], kinds[name] = density(e, names), kind
                break
            except _NoLatticeError:
                continue
        else:
            with suppress(_NoLatticeError):
                density_here = _translated(e, names)[1]
                by_value.setdefault(_key(density_here, names), []).append((name, density_here))
    for same_value in by_value.values():
        if len(same_value) == prod(names.sizes):
            name = re.sub(r"[0-9_]+$", "", same_value[0][0]) or "C"
            while name in used_names or name in densities:
                name += "_"
            densities[name], kinds[name] = same_value[0][1], "sites"
    return densities, kinds


def _sum_of(e: Expression, names: _SiteNames) -> Expression:
    return total(_density(e, names))


def _product_of(e: Expression, names: _SiteNames) -> Expression:
    factors, stack = [], [e]
    while stack:
        node = stack.pop()
        if node.op == "mul":
            stack += node.args
        elif not node.is_number:
            factors.append(node)
    return product_of(_orbits([_translated(f, names) for f in factors], names))


def _invariants(spec: Spec, names: _SiteNames) -> dict[str, Expression]:
    invariants = {}
    for name, e in spec.invariants.items():
        try:
            invariants[name] = _sum_of(e, names)
        except _NoLatticeError:
            continue
    return invariants


def _prove(spec: Spec, poisson: Matrix, lattice_spec: Spec, names: _SiteNames) -> None:
    """Raise `_NoLatticeError` unless the expansion of the lattice is proved to be the ordinary spec."""
    by_site = {(f, site): n for n, (f, site) in names.sites.items()}
    expansion = Expansion(cell_from_spec(lattice_spec), names.sizes, (), by_site)
    entries = expansion.poisson()
    residuals = [("H", spec.hamiltonian - total(expansion.hamiltonian_terms()))]
    for c, row in zip(spec.coordinates, poisson, strict=True):
        residuals += [
            (f"{{{c}, {d}}}", e - entries.get((c, d), ZERO)) for d, e in zip(spec.coordinates, row, strict=True)
        ]
    if not decide_zero("the same system", residuals).holds:
        raise _NoLatticeError


def _run(spec: Spec, run: Run, names: _SiteNames) -> Run:
    by_field: dict[str, dict[Site, Fraction]] = {}
    for c, value in zip(spec.coordinates, run.initial, strict=True):
        f, site = names.sites[c]
        by_field.setdefault(f, {})[site] = value
    state = {f: Values(listed=tuple(v[s] for s in sorted(v))) for f, v in by_field.items()}
    arrays: dict[str, dict[Site, Fraction]] = {}
    changed_names = {names.sites[n][0] for n in run.parameters if n in names.sites}
    for p in spec.parameters:
        stem, site = names.sites.get(p.name, ("", ()))
        if stem in changed_names:
            arrays.setdefault(stem, {})[site] = run.parameters.get(p.name, p.value)
    site_arrays = {stem: Values(listed=tuple(v[s] for s in sorted(v))) for stem, v in arrays.items()}
    numbers = {n: v for n, v in run.parameters.items() if n not in names.sites}
    lattice = LatticeRunSettings(names.sizes, state, (), site_arrays)
    # The keys ``exact``, ``section`` and ``stop`` of a run are not copied. In the spec of a lattice, sections and stops
    # must name observables.
    none: dict[str, Any] = {"exact": {}, "section": None, "stop": None}
    return replace(run, initial=(), parameters=numbers, lattice=lattice, **none)
