"""Statements about lattices of every size at once, by translation: brackets, Jacobi identity, Casimirs,
invariants.

On a grid the statements are decided on the infinite lattice. A periodic box is a quotient of the infinite lattice by
translations, so statements on brackets and sums are true on the box too. A lattice with open ends is a part of the
infinite lattice. If the functions on this part are closed under brackets, which is the usual case, the Jacobi identity
holds there too, and Casimirs of single sites are still Casimirs. Casimirs and invariants that are sums are examined on
a box so large that no term reaches both ends.

On a graph, each term of a residual depends on at most two bonds. So a statement is true for every graph if it is true
for all graphs of one or two bonds. If all pairs of sites interact, a statement is true for every number of sites if it
is true for one and for two sites.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import permutations

from phigen.geometry.jacobi import jacobi_identity
from phigen.geometry.system import System, hamiltonian_vector_field, system_from_spec
from phigen.lattice.cell import GRID, OPEN, Cell, vector_field
from phigen.lattice.expansion import expand
from phigen.symbolic.expression import ZERO, Expression, gradient, number, substitute, symbol, symbols_of, total
from phigen.symbolic.neighbours import Offset, minus, plus, steps
from phigen.symbolic.verdict import PROVED, REFUTED, UNDECIDED, Statement, decide_zero

#: Coordinate of the infinite lattice: a field, and the offset of its site from the origin.
Point = tuple[str, tuple[int, ...]]
Labelled = tuple[str, Expression]

#: Graphs that represent all graphs in proofs: a single bond, and two bonds that share a site in each possible way.
GRAPHS: tuple[tuple[tuple[int, int], ...], ...] = (
    ((0, 1),),
    ((0, 1), (1, 2)),
    ((0, 1), (0, 2)),
    ((1, 0), (2, 0)),
    ((0, 1), (0, 1)),
    ((0, 1), (1, 0)),
)
#: Largest number of coordinates of a box with open ends. The Jacobi identity has a term for each triple of coordinates.
_MAX_BOX_COORDINATES = 160
JACOBI = "Jacobi identity"


def tensor(cell: Cell) -> tuple[Statement, ...]:
    """Return the statement that π is skew, and the statement of the Jacobi identity. The second is left out if the
    first is refuted.
    """
    if cell.relation != GRID:
        return _tensor_of_graphs(cell)
    skew = _decided(cell, "π is skew", _skewness(cell), "for all sizes")
    if skew.verdict == REFUTED:
        return (skew,)
    residuals = list(_jacobi(cell))
    triples = f"{len(residuals)} triple{'s' * (len(residuals) != 1)} up to translation, " if residuals else ""
    jacobi = _decided(cell, JACOBI, residuals, f"{triples}for all sizes")
    if jacobi.verdict == REFUTED or OPEN not in cell.boundary or _closed(cell):
        return skew, jacobi
    return skew, jacobi, _at_ends(cell, f"{JACOBI} at open ends", jacobi_identity)


def casimirs(cell: Cell) -> Iterator[Statement]:
    """Yield the statement π∇C = 0 for each Casimir C. C is a function of the values at one site, or a sum or product
    over all sites.
    """
    for name, (density, kind) in cell.casimirs.items():
        title = f"{name} is a Casimir"
        domain_text = {
            "sites": "at every site",
            "sum": "the sum over all sites",
            "product": "the product of all sites",
        }[kind]
        if cell.relation != GRID:
            yield _worst(title, f"{domain_text}, for every {_any(cell)}", _casimir_of_graphs(cell, name))
            continue
        terms = _of_site(cell, name, density) if kind == "sites" else _of_sum(cell, name, density, kind == "product")
        statement = _decided(cell, title, terms, f"{domain_text}, for all sizes")
        if statement.verdict != REFUTED and OPEN in cell.boundary and (kind != "sites" or not _closed(cell)):
            end_statements = _at_ends(cell, title, partial(_casimirs_of_box, name), domain_text)
            statement = end_statements if end_statements.verdict != PROVED else statement
        yield statement


def invariants(cell: Cell) -> Iterator[Statement]:
    """Yield the statement {F, H} = 0 for each further first integral F of the spec.

    F is a sum of densities over sites, and so is {F, H}. The statement is proved by showing that this second sum
    telescopes.
    """
    for name, density in cell.invariants.items():
        title = f"{name} is invariant"
        if cell.relation != GRID:
            yield _worst(title, f"for every {_any(cell)}", _invariant_of_graphs(cell, name))
            continue
        rate = rate_of(cell, density)
        label = f"{{{name}, H}}" + f" + ∂{name}/∂{cell.time}" * (cell.time in symbols_of(density))
        terms = [(f"δ({label})/δ{n}" if "+" in label else f"δ{label}/δ{n}", e) for n, e in euler(cell, rate).items()]
        terms.append((f"{label} where all sites have equal values", _uniform(cell, rate)))
        statement = _decided(cell, title, terms, f"{label} telescopes, for all sizes")
        if statement.verdict != REFUTED and OPEN in cell.boundary:
            end_statements = _at_ends(cell, title, partial(_invariant_of_box, name))
            statement = end_statements if end_statements.verdict != PROVED else statement
        yield statement


# --- the calculus of densities


def euler(cell: Cell, density: Expression) -> dict[str, Expression]:
    """Return the discrete Euler operator of a density: the derivatives of the sum over all sites with respect to the
    symbols of one site.

    All derivatives are 0 if and only if the density is a constant plus a difference of densities of neighbouring sites.
    Then the sum telescopes.
    """
    slopes_by_symbol: dict[str, list[Expression]] = {n: [] for n in cell.neighbours.names}
    places = cell.places(density)
    for (base, offset), slope in zip(places.values(), gradient(density, list(places)), strict=True):
        slopes_by_symbol[base].append(cell.shifted(slope, minus(offset)))
    return {n: total(terms) for n, terms in slopes_by_symbol.items()}


def rate_of(cell: Cell, density: Expression) -> Expression:
    """Return a density whose sum over sites is the time derivative of the sum of ``density`` over sites."""
    slopes, rates = euler(cell, density), vector_field(cell)
    along_motion = total(slopes[f] * rates[f] for f in cell.fields if not (slopes[f].is_zero or rates[f].is_zero))
    return along_motion + total(gradient(density, cell.times))


def _uniform(cell: Cell, density: Expression) -> Expression:
    """Return the value of a density at states that are equal at all sites: symbols of neighbours become those of the
    site.
    """
    same_symbols = {name: symbol(base) for name, (base, _) in cell.places(density).items()}
    return substitute([density], same_symbols)[0]


def _decided(cell: Cell, name: str, residuals: Iterable[Labelled], detail: str = "") -> Statement:
    """Return the verdict of `decide_zero` on the residuals.

    A parameter at sites that is declared positive counts as positive at every site.
    """
    residual_list, positive_parameters = list(residuals), {p.name for p in cell.parameters if p.positive}
    positive = [n for n in symbols_of(*(e for _, e in residual_list)) if n.partition("[")[0] in positive_parameters]
    return decide_zero(name, residual_list, positive, detail)


# --- grids


def _skewness(cell: Cell) -> Iterator[Labelled]:
    for (f, other), entry in cell.bracket.items():
        g, offset = cell.place(other)
        mirrored = cell.bracket.get((g, cell.at(f, minus(offset))), ZERO)
        yield f"({f}, {other})", entry + cell.shifted(mirrored, offset)


def _partners(cell: Cell) -> dict[str, list[tuple[Point, Expression]]]:
    """Return, for each field f, the list of (coordinate, bracket) for all coordinates that have a bracket with f at the
    origin.
    """
    partners: dict[str, list[tuple[Point, Expression]]] = {f: [] for f in cell.fields}
    for (f, other), entry in cell.bracket.items():
        g, offset = cell.place(other)
        partners[f].append(((g, steps(offset)), entry))
    return partners


def _jacobi(cell: Cell) -> Iterator[Labelled]:
    """Yield the residuals of the Jacobi identity for triples of coordinates, one residual for each triple up to
    translation.

    The terms of a residual are collected from all ordered pairs of coordinates. So a residual is twice the cyclic sum.
    """
    partners, sums = _partners(cell), dict[tuple[Point, ...], list[Expression]]()
    for f, bracket_partners in partners.items():
        first = (f, steps(cell.origin))
        for second, entry in bracket_partners:
            field_places = {n: p for n, p in cell.places(entry).items() if p[0] in cell.fields}
            for (base, position), slope in zip(field_places.values(), gradient(entry, list(field_places)), strict=True):
                for (h, offset), other in partners[base]:
                    third = (h, plus(position, offset))
                    if third not in (first, second):
                        term = slope * cell.shifted(other, position)
                        triple, sign, translation = _canonical((first, second, third))
                        sums.setdefault(triple, []).append(number(sign) * cell.shifted(term, translation))
    for triple, terms in sorted(sums.items(), key=lambda item: item[0]):
        label = ", ".join(cell.at(name, offset) for name, offset in triple)
        yield f"({label})", total(terms)


def _canonical(triple: tuple[Point, Point, Point]) -> tuple[tuple[Point, ...], int, Offset]:
    """Return a triple of coordinates in a standard form. Triples that differ only by a translation have the
    same form.

    The result is the sorted triple with its first coordinate at the origin, the sign of the permutation, and the
    translation.
    """
    order = min(permutations(range(3)), key=lambda p: [triple[k] for k in p])
    sign = 1 if order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1
    ordered = [triple[k] for k in order]
    translation = minus(ordered[0][1])
    return tuple((name, plus(offset, translation)) for name, offset in ordered), sign, translation


def _of_site(cell: Cell, name: str, density: Expression) -> Iterator[Labelled]:
    """Yield {C, f} for a Casimir C of one site, and for all coordinates f that have a bracket with an argument of C."""
    field_places = {n: p for n, p in cell.places(density).items() if p[0] in cell.fields}
    partners, sums = _partners(cell), dict[Point, list[Expression]]()
    for (base, position), slope in zip(field_places.values(), gradient(density, list(field_places)), strict=True):
        for (h, offset), entry in partners[base]:
            sums.setdefault((h, plus(position, offset)), []).append(slope * cell.shifted(entry, position))
    for (h, offset), terms in sums.items():
        yield f"{{{name}, {cell.at(h, offset)}}}", total(terms)


def _of_sum(cell: Cell, name: str, density: Expression, product: bool) -> Iterator[Labelled]:
    """Yield the residuals for a Casimir that is a sum or a product over all sites.

    The residuals are {f, Σ C} or {f, Π C}/Π C with the density C, for each field f of a site.
    """
    slopes = _logarithmic(cell, density) if product else euler(cell, density)
    for f, bracket_partners in _partners(cell).items():
        terms = [entry * cell.shifted(slopes[g], offset) for (g, offset), entry in bracket_partners]
        yield f"{{{f}, {name}}}", total(terms)


def _logarithmic(cell: Cell, density: Expression) -> dict[str, Expression]:
    slopes_by_symbol: dict[str, list[Expression]] = {n: [] for n in cell.neighbours.names}
    places = cell.places(density)
    for (base, offset), slope in zip(places.values(), gradient(density, list(places)), strict=True):
        slopes_by_symbol[base].append(cell.shifted(slope / density, minus(offset)))
    return {n: total(terms) for n, terms in slopes_by_symbol.items()}


# --- open ends


def _closed(cell: Cell) -> bool:
    """Whether each bracket depends only on values inside the smallest box that contains the sites of its two
    arguments.
    """
    for (_, other), entry in cell.bracket.items():
        offset = steps(cell.place(other)[1])
        low, high = cell.extent(entry)
        if any(a < min(0, o) or b > max(0, o) for a, b, o in zip(low, high, offset, strict=True)):
            return False
    return True


def _box(cell: Cell) -> tuple[int, ...]:
    """Return sizes of a box that is so large that no term reaches both ends of an axis.

    The terms are those of H, Casimirs and invariants, and of their brackets.
    """
    densities = [*cell.terms, *(d for d, _ in cell.casimirs.values()), *cell.invariants.values()]
    extents = [cell.extent(t) for d in densities for t in cell.additive_terms(d)]
    widths = [max((high[k] - low[k] for low, high in extents), default=0) for k in range(len(cell.axes))]
    return tuple(2 * (w + p) + 1 for w, p in zip(widths, cell.poisson_reach, strict=True))


def _at_ends(cell: Cell, name: str, examine: Callable[[System], Statement], domain_text: str = "") -> Statement:
    """Return a statement that ``examine`` decides on a box with open ends.

    In one dimension, boxes with fewer sites are examined as well. If the box has too many coordinates, the statement
    remains undecided.
    """
    sizes = _box(cell)
    count = len(cell.fields)
    for size in sizes:
        count *= size
    if count > _MAX_BOX_COORDINATES:
        prefix = f"{domain_text}, " if domain_text else ""
        return Statement(
            name,
            UNDECIDED,
            f"{prefix}proved away from open ends; the smallest lattice with open ends is too large to examine",
        )
    least = 1 + max(*cell.hamiltonian_reach, *cell.poisson_reach)
    boxes = [(n,) for n in range(least, sizes[0] + 1)] if len(sizes) == 1 else [sizes]
    for box in boxes:
        system = system_from_spec(expand(cell, box).spec())
        statement = examine(system)
        if statement.verdict != PROVED:
            box_text = "×".join(map(str, box))
            residual = statement.residual
            return Statement(name, statement.verdict, f"at open ends, {box_text} sites: {statement.detail}", residual)
    return Statement(name, PROVED, "at open ends too")


def _casimirs_of_box(name: str, system: System) -> Statement:
    names = [n for n in system.declared if n == name or n.startswith(f"{name}_")]
    named_casimirs = [(n, system.casimirs[n]) for n in names]
    residuals = [
        (f"{{{c}, {n}}}", rate)
        for n, casimir in named_casimirs
        for c, rate in zip(
            system.coordinates,
            hamiltonian_vector_field(system.poisson, gradient(casimir, system.coordinates)),
            strict=True,
        )
    ]
    return decide_zero(f"{name} is a Casimir", residuals, system.positive)


def _invariant_of_box(name: str, system: System) -> Statement:
    slopes = gradient(system.invariants[name], system.coordinates)
    rate = total(s * v for s, v in zip(slopes, system.vector_field(), strict=True) if not s.is_zero)
    rate += total(gradient(system.invariants[name], system.times))
    return decide_zero(f"{name} is invariant", [(f"{{{name}, H}}", rate)], system.positive)


# --- graphs and pairs


def _any(cell: Cell) -> str:
    return "graph" if cell.relation == "graph" else "number of sites"


def _representative_systems(cell: Cell) -> Iterator[tuple[str, System]]:
    """Yield pairs (description, system). A statement that is true for all these systems is true for every graph or, if
    sites interact in pairs, for every number of sites.
    """
    graphs: Sequence[tuple[int, Sequence[tuple[int, int]]]] = [(1, ()), (2, ())]
    if cell.relation == "graph":
        graphs = [(1, ()), *((1 + max(max(b) for b in bonds), bonds) for bonds in GRAPHS)]
    for sites, bonds in graphs:
        bonds_text = ", ".join(f"{a}–{b}" for a, b in bonds)
        description = f"the graph {bonds_text}" if bonds else f"{sites} site{'s' * (sites > 1)}"
        yield description, system_from_spec(expand(cell, (sites,), bonds).spec())


def _tensor_of_graphs(cell: Cell) -> tuple[Statement, ...]:
    from phigen.geometry.checks import skew_symmetry

    scope = f"for every {_any(cell)}"
    skew = _worst(
        "π is skew",
        scope,
        ((graph_name, skew_symmetry(system)) for graph_name, system in _representative_systems(cell)),
    )
    if skew.verdict == REFUTED:
        return (skew,)
    statements = ((graph_name, jacobi_identity(system)) for graph_name, system in _representative_systems(cell))
    detail = f"{scope}, by proofs for graphs of at most two bonds" if cell.relation == "graph" else scope
    return skew, _worst(JACOBI, detail, statements)


def _casimir_of_graphs(cell: Cell, name: str) -> Iterator[tuple[str, Statement]]:
    for graph_name, system in _representative_systems(cell):
        yield graph_name, _casimirs_of_box(name, system)


def _invariant_of_graphs(cell: Cell, name: str) -> Iterator[tuple[str, Statement]]:
    for graph_name, system in _representative_systems(cell):
        yield graph_name, _invariant_of_box(name, system)


def pair_symmetry(cell: Cell) -> Iterator[Statement]:
    """Yield the statement that the energy of a pair does not change if its two sites are exchanged."""
    if not cell.pair_hamiltonian.is_zero:
        places = cell.places(cell.pair_hamiltonian)
        other = {"a": "b", "b": "a"}
        exchanged = {n: symbol(cell.at(base, (other[str(end[0])],))) for n, (base, end) in places.items()}
        difference = cell.pair_hamiltonian - substitute([cell.pair_hamiltonian], exchanged)[0]
        yield _decided(cell, "the density of a pair is symmetric", [("", difference)])


def _worst(name: str, detail: str, statements: Iterator[tuple[str, Statement]]) -> Statement:
    """Return one statement for a list of (description, statement).

    If a statement in the list is refuted, the result is refuted. If all are proved, the result is proved. Otherwise the
    result has the verdict of a statement that is not proved.
    """
    unproved: Statement | None = None
    for graph_name, s in statements:
        if s.verdict == REFUTED:
            return Statement(name, REFUTED, f"{graph_name}: {s.detail}", s.residual)
        if s.verdict != PROVED and (unproved is None or s.verdict == UNDECIDED):
            unproved = Statement(name, s.verdict, f"{graph_name}: {s.detail}", s.residual)
    return unproved or Statement(name, PROVED, detail)
