"""Proofs that the series on a lattice is correct, repeated at each build.

The axioms of the bi-realisation (α, β) are proved at one site if all brackets are between fields of one site. Otherwise
they are proved on a periodic box. If brackets couple sites up to the distance r along an axis, the box has 4r + 1 sites
along this axis. The proof holds for every larger box, for two reasons. First, α at two sites with a distance of at most
2r reads at most 4r + 1 adjacent sites. The box has room for these sites without an overlap. Second, α at two sites with
a larger distance reads no site twice.

Two more proofs concern a stage: the formula for y at a site solves α(y, p) = x for any p; and with p = h∇H the
increment is hπ∇H up to O(h²). Since a stage is also symmetric, its order is 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from phigen.geometry.system import System, build_system
from phigen.lattice.cell import PERIODIC, Cell
from phigen.lattice.cell_realisation import CellRealisation
from phigen.lattice.expansion import Expansion, Site, expand
from phigen.lattice.graphs import field_with_sums
from phigen.lattice.series import SeriesPlan
from phigen.realisations import axioms
from phigen.realisations.protocol import BiRealisation, is_symmetric
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ZERO, Expression, derivatives, substitute, symbol, symbols_of, total
from phigen.symbolic.symbols import MOMENTUM, Symbol, initial, momentum
from phigen.symbolic.verdict import Statement, decide_zero


def check(cell: Cell, plan: SeriesPlan) -> Iterator[Statement]:
    """Yield the statements on the bi-realisation, then the statements on a stage."""
    system, realisation = plan.realisation.site or _on_a_box(cell, plan.realisation)
    domain_text = (
        ""
        if plan.realisation.site
        else f"on {system.dimension // len(cell.fields)} sites; by translation on all larger lattices"
    )
    for statement in axioms.check(system, realisation):
        detail = "; ".join(filter(None, [statement.detail, domain_text]))
        yield replace(statement, name=statement.name.removeprefix("bi-realisation: "), detail=detail)
    yield from _stage(cell, plan)


def _stage(cell: Cell, plan: SeriesPlan) -> Iterator[Statement]:
    """Yield two statements on a stage: the formula for y solves the equation α(y, p) = x, and the stage has order 2."""
    realisation, positive = plan.realisation, tuple(p.name for p in cell.parameters if p.positive)
    alpha: dict[str, Expression] = {initial(f): symbol(f) + e for f, e in realisation.displacement.items()}
    substituted = substitute([realisation.middle[f] for f in cell.fields], alpha)
    residuals = [(f, w - symbol(f)) for f, w in zip(cell.fields, substituted, strict=True)]
    yield decide_zero("the formula for y solves α(y, p) = x", residuals, positive)
    rates = derivatives(list(plan.increment.values()), TIME)
    noise_symbols = [n for n, (base, _) in cell.places(*rates).items() if base in cell.increments]
    slopes = substitute(rates, {TIME: ZERO, **dict.fromkeys(noise_symbols, ZERO)})
    residuals = [(f, a - b) for f, a, b in zip(cell.fields, slopes, field_with_sums(cell), strict=True)]
    order = f"hence the order 2 of {'a step' if plan.order.order == 2 else 'each stage'}, which is symmetric"
    forced_name = "(β − α)(y, h(∇H + ζ)(y)) + hf(y) = h(π(∇H + ζ) + f)(y) + O(h²)"
    name = forced_name if cell.forces else "(β − α)(y, h∇H(y)) = hπ∇H(y) + O(h²)"
    yield decide_zero(name, residuals, positive, order)


def _on_a_box(cell: Cell, realisation: CellRealisation) -> tuple[System, BiRealisation]:
    """Return the system of all sites of a small periodic lattice, and the bi-realisation of this system."""
    periodic = replace(cell, boundary=(PERIODIC,) * len(cell.axes))
    box = expand(periodic, [4 * r + 1 for r in cell.poisson_reach])
    coordinates, places = box.coordinates, [(f, site) for f in cell.fields for site in box.sites]
    displacement = tuple(_at(box, realisation.displacement[f], site) for f, site in places)
    increment = tuple(_at(box, realisation.increment[f], site) for f, site in places)
    energy = total(symbol(c) for c in coordinates)
    system = build_system(cell.name, coordinates, box.spec().parameters, box.matrix(), energy)
    alpha = tuple(symbol(c) + d for c, d in zip(coordinates, displacement, strict=True))
    beta = tuple(a + d for a, d in zip(alpha, increment, strict=True))
    symmetric = is_symmetric(alpha, beta, coordinates)
    return system, BiRealisation(realisation.kind, coordinates, alpha, beta, displacement, increment, symmetric)


def _at(box: Expansion, e: Expression, site: Site) -> Expression:
    """Return an expression of the cell at a site of the ``box``. Symbols in the expression become symbols of fields and
    covectors of the box.
    """
    values: dict[str, Expression] = {}
    for name in symbols_of(e):
        covector = isinstance(name, Symbol) and name.kind == MOMENTUM
        try:
            base, offset = box.cell.place(str(name.key[0]) if isinstance(name, Symbol) and covector else name)
        except KeyError:
            continue
        source = box.neighbour(site, offset)
        assert source is not None  # the box is periodic
        coordinate = box.names[base, source]
        values[name] = symbol(momentum(coordinate) if covector else coordinate)
    return substitute([e], values)[0]
