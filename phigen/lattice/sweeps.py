"""From a cell to a program: a step is a schedule of sweeps over the sites, each a kernel evaluated at every site."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from phigen.errors import Diagnostic, Location, SpecError
from phigen.lattice.building import least_sizes
from phigen.lattice.cell import GRID, PERIODIC, Cell
from phigen.lattice.kicks import cell_kicks
from phigen.lattice.parts import (
    PRESENT,
    CellFlow,
    CellSplitting,
    SiteMotion,
    field_at_site,
    present,
    split_cell,
    summands_of,
)
from phigen.scheme.choosing import Choice, planned
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.lowering import operation_counts
from phigen.scheme.program import About, Observables, Program
from phigen.scheme.splitting import staged
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Sites, Sweep, Sweeps
from phigen.spec.model import NO_EXTRAS, Extras, Spec
from phigen.splitting.parts import Splitting
from phigen.splitting.ring import KICK, TIME
from phigen.symbolic.expression import Expression, symbols_of, total
from phigen.symbolic.symbols import Symbol


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
    parts = split_cell(cell, host.locations.get(("hamiltonian",)))
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
    schedule = choice.schedule()
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
    step = Sweeps(prepare, sites, swept, schedule, choice.method.name, tuple(k for _, k in cell.casimirs.values()))
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


def _expect_offered(cell: Cell, scheme: str, extras: Extras, locations: Mapping[tuple[Any, ...], Location]) -> None:
    problems = []
    if scheme == "series":
        message = "scheme series is not offered for lattices: they are split"
        problems.append(Diagnostic(message, locations.get(("scheme",)), "scheme: auto"))
    if cell.relation != GRID:
        message = f"lattices given as {cell.relation} are not compiled yet; phigen show --expand has an ordinary spec"
        problems.append(Diagnostic(message, locations.get(("lattice",))))
    asked = [name for name in ("modified_hamiltonian", "tangent") if getattr(extras, name)]
    problems += [Diagnostic(f"{name} is not offered for lattices", locations.get((name,))) for name in asked]
    if problems:
        raise SpecError(problems)


def _sweep(cell: Cell, flow: CellFlow, motion: SiteMotion, k: int, coefficients: Coefficients) -> Sweep:
    increments = staged(list(motion.increments.values()), coefficients)
    moved = tuple(cell.fields.index(f) for f in motion.increments)
    suffix = f"_{motion.colour}" if len(flow.motions) > 1 else ""
    named = f"the flow of H_{k} = sum of {flow.hamiltonian}: {flow.manner}".replace(KICK, KICK.kind)
    return Sweep(_kernel(cell, f"sweep{k}{suffix}", named, increments, "change", coefficients), moved, motion.colour)


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
    weights = tuple(n for n in used if isinstance(n, Symbol) and n.kind == PRESENT)
    plain = tuple(p.name for p in cell.parameters if p.at == "all")
    first = {"coef": coefficients.slots} if coefficients else {"params": plain}
    return Kernel(name, purpose, {**first, "site": tuple(places), "present": weights}, (Output(output, tuple(values)),))


def _observables(cell: Cell) -> Observables:
    """The densities of the Hamiltonian and of the Casimirs, and the vector field at a site."""
    origin = [0] * len(cell.axes)
    density = total(present(cell, s.low, s.high, origin) * s.expression for s in summands_of(cell))
    casimirs = [density for density, _ in cell.casimirs.values()]
    return Observables(
        _kernel(cell, "energy", "the density of the Hamiltonian", [density], "out"),
        _kernel(cell, "casimirs", "the densities of the Casimirs", casimirs, "out"),
        _kernel(cell, "vector_field", "pi grad H", field_at_site(cell), "out"),
    )


def _sites(
    cell: Cell, colours: int, weights: Sequence[int], periods: Sequence[int], kernels: Sequence[Kernel]
) -> Sites:
    places = {
        n: (f, tuple(int(o) for o in offset))
        for kernel in kernels
        for n, (f, offset) in cell.places(*kernel.roots).items()
    }
    reach = [max((abs(o[a]) for _, o in places.values()), default=0) for a in range(len(cell.axes))]
    least = [max(a, b) for a, b in zip(reach, least_sizes(cell), strict=True)]
    return Sites(
        cell.axes,
        tuple(b != PERIODIC for b in cell.boundary),
        tuple(p.name for p in cell.parameters if p.at == "sites"),
        places,
        colours,
        tuple(weights),
        tuple(periods),
        tuple(least),
    )


def _facts(cell: Cell, choice: Choice, colours: int) -> list[str]:
    """What the header says of the method."""
    count, flows, method = len(choice.splitting.flows), len(choice.schedule().flows), choice.method
    boundary = ", ".join(f"{a} {b}" for a, b in zip(cell.axes, cell.boundary, strict=True))
    lattice = f"lattice: {boundary}; any size" + (f", sites of {colours} colours" if colours > 1 else "")
    if count == 1:
        return [lattice, "scheme: the exact flow of H, which is elementary", "step: explicit"]
    parts = " + ".join(f"H_{k}" for k in range(1, count + 1))
    why = f", since {choice.why}" if choice.why else ""
    return [
        lattice,
        f"scheme: splitting, H = {parts}, with the exact flow of each",
        f"composition: {method.name}, {method.stages} stage{'s' * (method.stages > 1)}, {flows} flows{why}",
        "step: explicit",
    ]


def _operations(step: Sweeps) -> dict[str, int]:
    """The operations of a step at one site."""
    times = Counter(part for part, _ in step.schedule.flows)
    counted: Counter[str] = Counter()
    for part, sweeps in enumerate(step.parts):
        for sweep in sweeps:
            for what, number in operation_counts(sweep.kernel.roots).items():
                counted[what] += number * times[part]
    return dict(counted)
