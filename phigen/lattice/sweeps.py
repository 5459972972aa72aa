"""From a cell to a program: a step is a schedule of sweeps over the sites, each a kernel evaluated at every site."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phigen.errors import Diagnostic, Location, SpecError
from phigen.lattice.building import least_sizes
from phigen.lattice.cell import GRAPH, GRID, PAIRS, PERIODIC, Cell
from phigen.lattice.graphs import GraphSearch, energies, site_sums
from phigen.lattice.kicks import cell_kicks
from phigen.lattice.parts import (
    BondSum,
    CellFlow,
    CellSplitting,
    PartSearch,
    SiteMotion,
    field_at_site,
    present,
    split_cell,
    summands_of,
)
from phigen.scheme.alternation import Alternation, Schedule
from phigen.scheme.alternation import schedule as alternating
from phigen.scheme.choosing import Choice, planned
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.lowering import operation_counts
from phigen.scheme.nystrom import Nystrom
from phigen.scheme.program import About, Observables, Program
from phigen.scheme.splitting import staged
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Ends, Gather, Partners, Sites, Sweep, Sweeps
from phigen.spec.model import NO_EXTRAS, Extras, Spec
from phigen.splitting.parts import Splitting
from phigen.splitting.ring import KICK, TIME
from phigen.symbolic.expression import ZERO, Expression, symbol, symbols_of, total
from phigen.symbolic.neighbours import steps
from phigen.symbolic.symbols import CHOSEN, GATHERED, PRESENT, Symbol, kind_of


class _Nowhere:
    """What has no spec to point at."""

    locations: Mapping[tuple[Any, ...], Location] = {}


@dataclass(frozen=True)
class LatticePlan:
    """The parts of H of a lattice, and the method with the flows in the order of its steps."""

    parts: CellSplitting
    choice: Choice

    @property
    def flows(self) -> tuple[CellFlow, ...]:
        """The flows in the order of a step."""
        return tuple(flow for flow in self.choice.splitting.flows if isinstance(flow, CellFlow))


def plan_sweeps(
    cell: Cell,
    *,
    order: int = 4,
    scheme: str = "auto",
    composition: str = "auto",
    extras: Extras = NO_EXTRAS,
    spec: Spec | None = None,
) -> LatticePlan:
    """The parts and the method. Raises `SpecError` where H does not split, and for what is not offered."""
    host = spec or _Nowhere()
    _expect_offered(cell, scheme, extras, host.locations)
    search = GraphSearch if cell.relation == GRAPH else PartSearch
    parts = split_cell(cell, host.locations.get(("hamiltonian",)), search)
    plain = Splitting(parts.flows)
    return LatticePlan(parts, planned(host, plain, order, composition, lambda: cell_kicks(cell, parts)))


def build_sweeps(
    cell: Cell,
    plan: LatticePlan,
    *,
    extras: Extras = NO_EXTRAS,
    title: str = "",
    licence: str = "0BSD",
    spec_sha256: str = "",
    profile: str = "fast",
    lanes: bool = True,
) -> Program:
    """The solver of a lattice as a program."""
    parts, choice, flows = plan.parts, plan.choice, plan.flows
    coefficients = Coefficients([*(p.name for p in cell.parameters if p.at == "all"), TIME, KICK])
    by_colour = any(flow.by_colour for flow in flows)
    schedule = _any_number(choice.method) if by_colour else choice.schedule()
    swept = tuple(
        tuple(_sweep(cell, flow, motion, k, coefficients) for motion in flow.motions) for k, flow in enumerate(flows, 1)
    )
    plain_names = tuple(p.name for p in cell.parameters if p.at == "all")
    prepare = Kernel(
        "prepare",
        "everything that depends on parameters and the time of a flow only",
        {"params": plain_names, "h": (TIME,), **({"kick": (KICK,)} if schedule.multiples else {})},
        (Output("coef", tuple(coefficients.values)),),
    )
    observed = _observables(cell)
    kernels = [sweep.kernel for part in swept for sweep in part]
    sites = _sites(cell, parts.colouring.count, parts.colouring.weights, parts.colouring.periods(cell.boundary),
                   [*kernels, observed.energy, observed.casimirs, observed.vector_field])  # fmt: skip
    kinds, partners = tuple(k for _, k in cell.casimirs.values()), _partners(cell)
    if partners:
        gathers = [*(sweep.gather for part in swept for sweep in part if sweep.gather), partners.energy, partners.field]
        at_bonds = tuple(p.name for p in cell.parameters if p.at == "bonds")
        sites = replace(sites, ends=_ends(cell, [k for g in gathers for k in g.kernels]), at_bonds=at_bonds)
    marks = tuple(flow.by_colour for flow in flows) if by_colour else ()
    step = Sweeps(prepare, sites, swept, schedule, choice.method.name, kinds, partners, marks)
    facts = [*_facts(cell, choice, parts.colouring.count), choice.order.note]
    return Program(
        name=cell.name,
        about=About(title, licence, spec_sha256, tuple(f for f in facts if f), _operations(step)),
        coordinates=cell.fields,
        parameters=cell.parameters,
        casimirs=tuple(cell.casimirs),
        order=choice.order.order,
        step=step,
        observables=observed,
        extras=extras,
        lanes=lanes,
        profile=profile,
    )


def _any_number(method: Alternation | Nystrom) -> Schedule:
    """A method for any number of flows; see `Sweeps`."""
    assert isinstance(method, Alternation)
    backwards = {(1, 2): (3, 2)}
    of_three = alternating(method, 3)
    return replace(of_three, pattern=tuple(backwards.get(flow, flow) for flow in of_three.pattern))


def _expect_offered(cell: Cell, scheme: str, extras: Extras, locations: Mapping[tuple[Any, ...], Location]) -> None:
    problems = []
    if scheme == "series":
        message = "scheme series is not offered for lattices: they are split"
        problems.append(Diagnostic(message, locations.get(("scheme",)), "scheme: auto"))
    if cell.bond_bracket and cell.relation == PAIRS:
        message = "brackets between the sites of pairs are not compiled"
        problems.append(Diagnostic(message, locations.get(("poisson",))))
    asked = [name for name in ("modified_hamiltonian", "tangent", "adjoint") if getattr(extras, name)]
    asked += ["reconstruct"] if ("reconstruct",) in locations else []
    problems += [Diagnostic(f"{name} is not offered for lattices", locations.get((name,))) for name in asked]
    if problems:
        raise SpecError(problems)


def _sweep(cell: Cell, flow: CellFlow, motion: SiteMotion, k: int, coefficients: Coefficients) -> Sweep:
    increments = staged(list(motion.increments.values()), coefficients)
    moved = tuple(cell.fields.index(f) for f in motion.increments)
    suffix = f"_{flow.motions.index(motion)}" if len(flow.motions) > 1 else ""
    named = f"the flow of H_{k} = sum of {flow.hamiltonian}: {flow.manner}".replace(KICK, KICK.kind)
    kernel = _kernel(cell, f"sweep{k}{suffix}", named, increments, "change", coefficients)
    purpose = f"what all other sites b add to the forces of H_{k} at a site a"
    gather = _gather(cell, motion.gathered, f"gather{k}{suffix}", purpose, coefficients)
    return Sweep(kernel, moved, motion.colour, gather)


def _gather(
    cell: Cell, sums: Sequence[BondSum], name: str, purpose: str, coefficients: Coefficients | None = None
) -> Gather | None:
    """Sums over bonds or pairs, all of the same symbols, as kernels."""
    if not sums:
        return None
    ends = []
    for s in sums:
        values = list(s.values.values())
        values = coefficients.hoist(values) if coefficients else values
        verb = {"a": "begin", "b": "end"}.get(s.end)
        suffix, seen = (f"_{s.end}", f", by bonds that {verb} there") if verb else ("", "")
        ends.append(Ends(_kernel(cell, name + suffix, purpose + seen, values, "sums", coefficients), s.end, s.chosen))
    return Gather(tuple(ends), tuple(sums[0].values))


def _partners(cell: Cell) -> Partners | None:
    """Energies and forces of bonds or pairs."""
    if cell.relation == GRID:
        return None
    what = "bond" if cell.relation == GRAPH else "pair"
    empty = Gather((), ())
    return Partners(
        _gather(cell, energies(cell), f"{what}_energy", f"the energy of a {what}") or empty,
        _gather(cell, site_sums(cell), f"{what}_forces", "what a site b adds to the forces at a site a") or empty,
        cell.relation == GRAPH,
    )


def _kernel(
    cell: Cell,
    name: str,
    purpose: str,
    values: Sequence[Expression],
    output: str,
    coefficients: Coefficients | None = None,
) -> Kernel:
    """A kernel at a site: inputs are coefficients, or parameters, then what it reads at sites, and the weights."""
    used = symbols_of(*values)
    places = cell.places(*values)
    weights = tuple(n for n in used if kind_of(n) in (PRESENT, CHOSEN))
    plain = tuple(p.name for p in cell.parameters if p.at == "all")
    first = {"coef": coefficients.slots} if coefficients else {"params": plain}
    gathered = tuple(n for n in used if kind_of(n) == GATHERED)
    inputs = {**first, "site": tuple(places), "present": weights, "gathered": gathered}
    bonds = tuple(p.name for p in cell.parameters if p.at == "bonds" and p.name in used)
    inputs |= {"bonds": bonds} if bonds else {}
    return Kernel(name, purpose, inputs, (Output(output, tuple(values)),))


def _observables(cell: Cell) -> Observables:
    """The densities of the Hamiltonian and of the Casimirs, and the vector field at a site."""
    origin = [0] * len(cell.axes)
    density = total(present(cell, s.low, s.high, origin) * s.expression for s in summands_of(cell) if not s.bond)
    casimirs = [density for density, _ in cell.casimirs.values()]
    return Observables(
        _kernel(cell, "energy", "the density of the Hamiltonian", [density], "out"),
        _kernel(cell, "casimirs", "the densities of the Casimirs", casimirs, "out"),
        _kernel(cell, "vector_field", "pi grad H", _field(cell), "out"),
    )


def _field(cell: Cell) -> list[Expression]:
    """The vector field at a site, with symbols for what bonds or pairs add to forces, or to the field itself."""
    names = {n for s in site_sums(cell) for n in s.values} if cell.relation != GRID else set()
    added = {f: symbol(Symbol(GATHERED, f)) for f in cell.fields if Symbol(GATHERED, f) in names}
    if not cell.bond_bracket:
        return list(field_at_site(cell, added))
    return [e + added.get(f, ZERO) for f, e in zip(cell.fields, field_at_site(cell, {}), strict=True)]


def _sites(
    cell: Cell, colours: int, weights: Sequence[int], periods: Sequence[int], kernels: Sequence[Kernel]
) -> Sites:
    places = {
        n: (f, steps(offset) or (0,)) for kernel in kernels for n, (f, offset) in cell.places(*kernel.roots).items()
    }
    axes, boundary = cell.axes or ("i",), cell.boundary or (PERIODIC,)
    reach = [max((abs(o[a]) for _, o in places.values()), default=0) for a in range(len(axes))]
    least = [max(a, b) for a, b in zip(reach, least_sizes(cell) or (1,), strict=True)]
    return Sites(
        axes,
        tuple(b != PERIODIC for b in boundary),
        tuple(p.name for p in cell.parameters if p.at == "sites"),
        places,
        colours,
        tuple(weights) or (0,),
        tuple(periods) or (1,),
        tuple(least),
    )


def _ends(cell: Cell, kernels: Sequence[Kernel]) -> dict[str, tuple[str, str]]:
    """What kernels of pairs read, with the end of the pair."""
    places = [p for kernel in kernels for p in cell.places(*kernel.roots).items()]
    return {name: (f, str(offset[0])) for name, (f, offset) in places}


def _facts(cell: Cell, choice: Choice, colours: int) -> list[str]:
    """What the header says of the method."""
    count, method = len(choice.splitting.flows), choice.method
    boundary = ", ".join(f"{a} {b}" for a, b in zip(cell.axes, cell.boundary, strict=True))
    related = {GRAPH: "sites with bonds between them, given at run time", PAIRS: "all pairs of sites"}
    lattice = f"lattice: {related.get(cell.relation, boundary)}; any size"
    lattice += f", sites of {colours} colours" if colours > 1 else ""
    numbered = enumerate(choice.splitting.flows, 1)
    marked = [f"H_{k}" for k, flow in numbered if isinstance(flow, CellFlow) and flow.by_colour]
    if count == 1 and not marked:
        return [lattice, "scheme: the exact flow of H, which is elementary", "step: explicit"]
    parts = " + ".join(f"H_{k}" for k in range(1, count + 1))
    why = f", since {choice.why}" if choice.why else ""
    flows = f"{len(choice.schedule().flows)} flows" if not marked else f"{', '.join(marked)} for each colour of sites"
    return [
        lattice,
        f"scheme: splitting, H = {parts}, with the exact flow of each",
        f"composition: {method.name}, {method.stages} stage{'s' * (method.stages > 1)}, {flows}{why}",
        "step: explicit",
    ]


def _operations(step: Sweeps) -> dict[str, int]:
    """The operations of a step at one site."""
    times = Counter(part for part, _ in step.schedule.flows)
    if step.by_colour:  # of each colour, but for the first and the last
        times = Counter(dict.fromkeys(range(len(step.parts)), 2 * step.schedule.stages))
    counted: Counter[str] = Counter()
    for part, sweeps in enumerate(step.parts):
        for sweep in sweeps:
            for what, number in operation_counts(sweep.kernel.roots).items():
                counted[what] += number * times[part]
    return dict(counted)
