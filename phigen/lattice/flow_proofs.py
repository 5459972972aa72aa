"""Proofs that the splitting of a lattice is correct, for all sizes at once.

Two kinds of statements are proved. First, the parts of H sum to H, and the parts of the forces sum to πζ + f, with the
covector force ζ and the vector force f. Second, the flow of each part solves its equation of motion at a site. In this
equation, the gradient of the part and the values at neighbours count as constants. The gradient and these values are
constant along the flow, since all coordinates of a part commute over the whole lattice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from phigen.lattice.cell import Cell
from phigen.lattice.graphs import sums_by_field
from phigen.lattice.site_parts import CellFlow, SiteFields, SiteMotion, summands_of
from phigen.lattice.sweep_plans import SplittingPlan
from phigen.splitting.ring import KICK, TIME
from phigen.splitting.statements import angles_added
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    derivatives,
    number,
    sparse_derivatives,
    substitute,
    symbol,
    symbols_of,
    total,
)
from phigen.symbolic.symbols import CHOSEN, Symbol
from phigen.symbolic.verdict import Statement, decide_equivalent, decide_zero


def check(cell: Cell, plan: SplittingPlan) -> Iterator[Statement]:
    """Yield the statements on a splitting: on the sum of the parts, on forces, then on each flow in the order of the
    parts.
    """
    count, flows = plan.parts.colouring.count, plan.flows
    positive = tuple(p.name for p in cell.parameters if p.positive)
    parts = [number(len(colours)) * s.expression for flow in flows for s, colours in flow.summands]
    difference = number(count) * total(s.expression for s in summands_of(cell)) - total(substitute(parts, {KICK: ZERO}))
    modified = any(KICK in symbols_of(flow.hamiltonian) for flow in flows)
    name = "H = " + " + ".join(f"H_{k}" for k, f in enumerate(flows, 1) if not f.force) + " at κ = 0" * modified
    yield decide_zero(name, [("", difference)], positive, f"sites of {count} colours" if count > 1 else "")
    if cell.forces:
        yield _forces(cell, flows, count, positive)
    for k, flow in enumerate(flows, 1):
        part_name, field_name = f"{flow.letter}_{k}", f"F_{k}" if flow.force else f"π∇H_{k}"
        name = f"the flow Φ of {part_name} at each site: Φ_0 = 1, dΦ_t/dt = {field_name}∘Φ_t"
        yield _flow_statement(name, flow, positive)
    for source, flow in zip(cell.noise, plan.noise, strict=True):
        name = f"the flow Φ of the noise {source} at each site: Φ_0 = 1, dΦ_t/dt = ΔW σπ∇g∘Φ_t"
        yield _flow_statement(name, flow, positive)


def _flow_statement(name: str, flow: CellFlow, positive: Sequence[str]) -> Statement:
    """Return the statement that the motions of a flow solve their equations.

    If the equation of `motion_residuals` is not proved, for instance for a drag proportional to p|p|, the equivalent
    equation of `_transport_residuals` may be.
    """
    forms = (map(form, flow.every_motion) for form in (motion_residuals, _transport_residuals))
    return decide_equivalent(name, map(chain.from_iterable, forms), positive, flow.manner)


def _forces(cell: Cell, flows: Sequence[CellFlow], count: int, positive: Sequence[str]) -> Statement:
    """Decide whether the parts of the forces sum to πζ + f, with the covector force ζ and the vector force f."""
    site_fields = SiteFields(cell, sums_by_field(cell))
    force_flows = [flow for flow in flows if flow.force]
    residuals = []
    for colour in range(count):
        rates: dict[str, list[Expression]] = {f: [] for f in cell.fields}
        for motion in (m for flow in force_flows for m in flow.motions if m.colour in (None, colour)):
            values = {**motion.components, Symbol(CHOSEN): ONE}
            for f, e in zip(motion.rates, substitute(list(motion.rates.values()), values), strict=True):
                rates[f].append(e)
        residuals += [
            (f, site_fields.tangent(f, site_fields.push) + site_fields.impulse(f) - total(terms))
            for f, terms in rates.items()
        ]
    name = "πζ + f = " + " + ".join(f"F_{k}" for k, flow in enumerate(flows, 1) if flow.force)
    return decide_zero(name, residuals, positive)


def motion_residuals(motion: SiteMotion) -> Iterator[tuple[str, Expression]]:
    """Yield (field, residual). All residuals vanish if and only if the increments of a motion solve ẋ = ``rates``."""
    names, increments = list(motion.solution), list(motion.solution.values())
    start = substitute(increments, {TIME: ZERO})
    speeds = derivatives(increments, TIME)
    point = {f: symbol(f) + e for f, e in motion.solution.items()}
    required = substitute([motion.rates.get(f, ZERO) for f in names], point)
    yield from zip((f"{f} at t = 0" for f in names), start, strict=True)
    for f, a, b in zip(names, speeds, required, strict=True):
        yield f"rate of {f}", angles_added(a) - angles_added(b)
    for f, rate in motion.rates.items():
        if f not in motion.solution:
            yield f"rate of {f}", rate


def _transport_residuals(motion: SiteMotion) -> Iterator[tuple[str, Expression]]:
    """Yield (field, residual). All residuals vanish if and only if the increments of a motion Φ_t solve ẋ = X(x), where
    X has the components ``rates``.

    The residuals are the components of Φ_0 − 1 and of dΦ_t/dt − DΦ_t X.
    """
    names, increments = list(motion.solution), list(motion.solution.values())
    start = substitute(increments, {TIME: ZERO})
    yield from zip((f"{f} at t = 0" for f in names), start, strict=True)
    rows = sparse_derivatives(increments, motion.rates)
    for f, speed, row in zip(names, derivatives(increments, TIME), rows, strict=True):
        terms = [motion.rates.get(f, ZERO), *(row[n] * rate for n, rate in motion.rates.items() if n in row)]
        yield f"rate of {f}", angles_added(speed) - angles_added(total(terms))
    for f, rate in motion.rates.items():
        if f not in motion.solution:
            yield f"rate of {f}", rate
