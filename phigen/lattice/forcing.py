"""Flows of forces and of noise at sites, as parts of the splitting of a lattice.

Forces have the flow of πζ + f, with the covector force ζ and the vector force f. If this flow is not elementary,
summands of πζ + f have separate flows. Each source of noise has the flow of the Hamiltonian Σ ΔW_s σ g(s), a sum over
all sites s. Here g is the Hamiltonian of the source, σ its amplitude, and ΔW_s its noise increment at s.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from phigen.errors import Diagnostic, SpecError
from phigen.geometry import checks
from phigen.geometry.system import build_system, system_from_spec
from phigen.lattice.cell import GRAPH, PERIODIC, Cell
from phigen.lattice.damping import damping_flows
from phigen.lattice.expansion import expand
from phigen.lattice.graphs import sums_by_field
from phigen.lattice.site_parts import (
    CellFlow,
    Colouring,
    NoPartError,
    PartSearch,
    SiteFields,
    SiteMotion,
    bracketless_ring,
    merged_colours,
)
from phigen.scheme.choosing import Host
from phigen.spec.grammar import names_in
from phigen.spec.model import NO_FORCES, MatrixForm, Parameter
from phigen.splitting.flow import solved
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ONE, ZERO, Expression, gradient, substitute, symbol, symbols_of, total
from phigen.symbolic.readable import shortened
from phigen.symbolic.symbols import GATHERED, Symbol, kind_of
from phigen.symbolic.verdict import PROVED, Statement, decide_zero

Rates = Mapping[str, Expression]


def force_flows(cell: Cell, colouring: Colouring, host: Host) -> tuple[CellFlow, ...]:
    """Return the flows of the forces πζ + f, with the covector force ζ and the vector force f; () if there are no
    forces.

    Raises `SpecError` if a summand of πζ + f has no flow in closed form; the error names the summand.
    """
    if not cell.forces:
        return ()
    site_fields = SiteFields(cell, sums_by_field(cell))
    tangent = {f: site_fields.tangent(f, site_fields.push) for f in cell.fields}
    impulse = {f: site_fields.impulse(f) for f in cell.fields}
    common_flow = _flow(cell, colouring, {f: tangent[f] + impulse[f] for f in cell.fields})
    if isinstance(common_flow, CellFlow):
        return (common_flow,) if common_flow.motions else ()
    components = [(f"f = {shortened(e)}", {f: e}) for f, e in impulse.items()]
    flows = (*_tangent_flows(cell, colouring, host), *_summand_flows(cell, colouring, impulse, components, host))
    return tuple(flow for flow in flows if flow.motions)


def _tangent_flows(cell: Cell, colouring: Colouring, host: Host) -> tuple[CellFlow, ...]:
    """Return the flows of πζ, where the covector force ζ includes damping.

    If the flow of πζ is elementary, it is the only flow. Otherwise there is one flow for each component of ζ. If the
    flow of a component is not elementary, damping gets flows of its own (`phigen.lattice.damping`). The sum of all
    other forces in ζ then has one flow or, if this flow is not elementary, one flow for each component.
    """
    site_fields = SiteFields(cell, sums_by_field(cell))
    tangent = {f: site_fields.tangent(f, site_fields.push) for f in cell.fields}
    try:
        covectors = [(f"ζ_{f}", _tangent_of_covector(cell, site_fields, f)) for f in cell.fields]
        return tuple(_summand_flows(cell, colouring, tangent, covectors, host))
    except SpecError:
        if cell.forces.damping is None:
            raise
    undamped = replace(cell, forces=replace(cell.forces, damping=None))
    return (
        *damping_flows(cell, colouring, host),
        *(_tangent_flows(undamped, colouring, host) if undamped.forces else ()),
    )


def _summand_flows(
    cell: Cell, colouring: Colouring, field: Rates, summands: Sequence[tuple[str, Rates]], host: Host
) -> Iterator[CellFlow]:
    """Yield the flow of the vector field ``field`` or, if this flow is not elementary, the flow of each of its
    ``summands``.

    ``summands`` are names and vector fields. Raises `SpecError` if a summand has no elementary flow.
    """
    common_flow = _flow(cell, colouring, field)
    for name, summand in [("", field)] if isinstance(common_flow, CellFlow) else summands:
        flow = _flow(cell, colouring, summand)
        if isinstance(flow, str):
            message = f"scheme splitting: the force {name} has no elementary flow on the lattice: {flow}"
            place = next((host.locations[(key,)] for key in ("damping", "forces") if (key,) in host.locations), None)
            raise SpecError([Diagnostic(message, place, "scheme: series applies to every force")])
        yield flow


def _tangent_of_covector(cell: Cell, site_fields: SiteFields, field: str) -> dict[str, Expression]:
    """Return πζ by field, where ζ is the covector force with all components but ``field`` set to 0."""
    return {f: site_fields.tangent(f, lambda g, d: site_fields.push(g, d) if g == field else ZERO) for f in cell.fields}


def _flow(cell: Cell, colouring: Colouring, rates: Rates) -> CellFlow | str:
    """Return the flow of a vector field that moves each site independently, or the reason why this flow is not
    elementary.
    """
    nonzero_rates = {f: e for f, e in rates.items() if not e.is_zero}
    names = symbols_of(*nonzero_rates.values())
    if any(kind_of(n) == GATHERED for n in names):
        return "it depends on sums over bonds or pairs"
    neighbour_fields = {base for base, offset in cell.places(*nonzero_rates.values()).values() if any(offset)}
    if neighbour_fields & set(nonzero_rates):
        return f"it depends on {min(neighbour_fields & set(nonzero_rates))} of neighbours, which changes along the flow"
    ring = bracketless_ring(cell.fields, nonzero_rates.values())
    solution = solved(ring, ring.tower.convert_all([nonzero_rates.get(f, ZERO) for f in cell.fields]))
    if isinstance(solution, str):
        return solution
    increments = {f: e for f, e in zip(cell.fields, solution.increments, strict=True) if not e.is_zero}
    motions = [
        SiteMotion(c, increments, (), nonzero_rates, increments, solution.manner)
        for c in range(colouring.count)
        if nonzero_rates
    ]
    shared_motions = merged_colours(motions, colouring.count)
    return CellFlow(
        ZERO, tuple(solution.increments), solution.manner, shared_motions, force=tuple(nonzero_rates.values())
    )


def noise_flows(
    cell: Cell, colouring: Colouring, search: Callable[[Cell, Colouring], PartSearch], host: Host
) -> Iterator[CellFlow]:
    """Yield the flow of each source of noise. Raises `SpecError` for a source whose flow is not elementary."""
    for dw, (name, source) in zip(cell.increments, cell.noise.items(), strict=True):
        energy = symbol(dw) * source.amplitude * source.hamiltonian
        noise_cell = replace(cell, hamiltonian=energy, bond_hamiltonian=ZERO, pair_hamiltonian=ZERO, forces=NO_FORCES)
        try:
            flows = search(noise_cell, colouring).splitting().flows
        except NoPartError:
            flows = ()
        if len(flows) != 1 or flows[0].by_colour:
            reason = f"scheme: splitting needs the flow of the noise {name} in closed form, which phigen does not find"
            raise SpecError([Diagnostic(reason, host.locations.get(("noise", name)), "scheme: series applies to it")])
        yield _of_unit_time(flows[0])


def _of_unit_time(flow: CellFlow) -> CellFlow:
    def at_unit_time(rates: Rates) -> dict[str, Expression]:
        return dict(zip(rates, substitute(list(rates.values()), {TIME: ONE}), strict=True))

    motions = tuple(replace(m, increments=at_unit_time(m.increments)) for m in flow.motions)
    return replace(flow, increment=tuple(substitute(flow.increment, {TIME: ONE})), motions=motions)


def casimir_rate(cell: Cell, name: str) -> Expression:
    """Return a density whose sum is dC/dt for a Casimir C. Only the vector force f changes C. All other terms of ẋ have
    the form πζ with a covector ζ, and preserve C.
    """
    density, kind = cell.casimirs[name]
    vector, terms = cell.forces.vector, []
    field_places = {n: p for n, p in cell.places(density).items() if p[0] in vector}
    for (base, offset), slope in zip(field_places.values(), gradient(density, list(field_places)), strict=True):
        force = cell.shifted(vector[base], offset) if cell.axes else vector[base]
        terms.append(slope / density * force if kind == "product" else slope * force)
    return total(terms)


def pushed_casimirs(cell: Cell) -> tuple[str, ...]:
    """Return the names of the Casimirs that the vector force f does not preserve."""
    return tuple(name for name in cell.casimirs if not casimir_rate(cell, name).is_zero)


def force_statements(cell: Cell) -> Iterator[Statement]:
    """Yield the statements on forces: which Casimirs they preserve, and at which rate damping dissipates energy.

    The rate is a consequence of π being skew, which `phigen.lattice.proofs.tensor` proves.
    """
    if not cell.forces:
        return
    positive = tuple(p.name for p in cell.parameters if p.positive)
    for name in cell.casimirs:
        rate = casimir_rate(cell, name)
        conserved = decide_zero(f"the forces keep {name}", [(f"d{name}/dt", rate)], positive, "for all sizes")
        detail = f"the vector force changes {name}: each site adds {shortened(rate)} to d{name}/dt"
        yield conserved if conserved.holds else Statement(detail, PROVED)
    if cell.forces.damping is not None:
        yield Statement("the damping changes H at the rate −Σ λ |π∇H|²", PROVED, "since π is skew, for all sizes")


def noise_statements(cell: Cell) -> Iterator[Statement]:
    """Yield statements on noise: whether the sources commute, and which probability density is stationary.

    The statements are decided at one site, with symbols for the gradient of H, if two conditions hold: noise, damping
    and brackets at a site read no neighbours, and there are no forces except damping. Otherwise they are decided on a
    small periodic box or a small graph.
    """
    if not cell.noise:
        return
    local = cell.is_local and not any(any(offset) for _, offset in cell.places(*_acting(cell)).values())
    if not local or cell.forces.covector or cell.forces.vector:
        periodic = replace(cell, boundary=(PERIODIC,) * len(cell.axes))
        sizes = [1 + 2 * r for r in cell.poisson_reach] if cell.axes else [2]
        box = expand(periodic, [max(n, 2) for n in sizes], [(0, 1)] * (cell.relation == GRAPH))
        box_text = f"on {len(box.sites)} sites"
        system = system_from_spec(box.spec())
    else:
        slopes = {f: Symbol("slope", f) for f in cell.fields}
        rows = tuple(tuple(cell.bracket.get((f, g), ZERO) for g in cell.fields) for f in cell.fields)
        energy = total(symbol(slopes[f]) * symbol(f) for f in cell.fields)
        gradient_parameters = tuple(Parameter(s, Fraction(1)) for s in slopes.values())
        system = build_system(
            cell.name, cell.fields, (*cell.parameters, *gradient_parameters), MatrixForm(rows), energy,
            time=cell.time, forces=cell.forces, noise=cell.noise,
        )  # fmt: skip
        box_text = "at every site, for any H"
    varying = [p.name for p in cell.parameters if p.at == "sites"]
    for statement in checks.noise_statements(system):
        theta = statement.name.partition("θ = ")[2]
        condition = "where θ is the same at all sites" if any(n in names_in(theta) for n in varying) else ""
        yield replace(statement, detail="; ".join(filter(None, [statement.detail, box_text, condition])))


def _acting(cell: Cell) -> list[Expression]:
    damping = [cell.forces.damping] if cell.forces.damping is not None else []
    return [*damping, *(e for s in cell.noise.values() for e in (s.hamiltonian, s.amplitude))]
