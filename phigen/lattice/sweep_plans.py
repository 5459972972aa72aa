"""The step of a lattice as a program: a schedule of sweeps over the sites, built from the cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from phigen.errors import Diagnostic, SpecError
from phigen.lattice import cell_monitor
from phigen.lattice.cell import GRAPH, GRID, PAIRS, PERIODIC, Cell
from phigen.lattice.cell_building import (
    Misfit,
    MisfitError,
    least_sizes,
    misfit_diagnostics,
    misfit_reason,
    misfits,
    seam_reason,
)
from phigen.lattice.cell_kicks import cell_kicks
from phigen.lattice.damping import TogetherError
from phigen.lattice.forcing import force_flows, noise_flows, pushed_casimirs
from phigen.lattice.graphs import GraphSearch, energies, merged_ends, site_sums
from phigen.lattice.observable_kernels import observables, observed_sums
from phigen.lattice.relative_bodies import LatticeBodies, lattice_bodies, of_bodies, of_massive
from phigen.lattice.series import SeriesPlan, plan_series
from phigen.lattice.site_kernels import site_kernel
from phigen.lattice.site_parts import (
    BondSum,
    CellFlow,
    CellSplitting,
    Colouring,
    NoPartError,
    PartSearch,
    SiteMotion,
    splittings,
)
from phigen.lattice.site_transposes import transposed
from phigen.lattice.variations import along, with_variations
from phigen.scheme.alternation import Alternation, Schedule, with_clock
from phigen.scheme.alternation import schedule as alternating
from phigen.scheme.bond_ends import ONE_END
from phigen.scheme.choosing import ScheduledMethod, is_dated, planned, with_carrier
from phigen.scheme.forces import forced_lines
from phigen.scheme.gathering import staged
from phigen.scheme.kernel import Kernel, Output, Role
from phigen.scheme.logarithmic import composition_of
from phigen.scheme.lowering import operation_counts
from phigen.scheme.near_integrable import Corrected
from phigen.scheme.noise import noise_lines, with_noise
from phigen.scheme.nystrom import Nystrom
from phigen.scheme.order import Order
from phigen.scheme.program import About, Noise, Program
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Ends, Gather, Partners, Seam, Sites, Sweep, Sweeps
from phigen.spec.model import Spec, SpecForces
from phigen.splitting.flow import Flow
from phigen.splitting.kicks import Kick
from phigen.splitting.parts import SplitHamiltonian
from phigen.splitting.ring import KICK, TIME
from phigen.symbolic.neighbours import steps

T = TypeVar("T")


@dataclass(frozen=True)
class SplittingPlan:
    """Plan of a step by splitting: the parts of H, the composition method ``choice``, and the flows of the
    ``noise``.
    """

    parts: CellSplitting
    choice: ScheduledMethod
    noise: tuple[CellFlow, ...] = ()
    since: str = ""  # reason for boundary seams, or for more colours than necessary; "" if there is none
    negative: int | None = None  # with a monitor: index of the part of H that is negative
    bodies: LatticeBodies | None = None  # the bodies, if the spec asks for relative coordinates

    #: ``scheme`` is the name of the scheme in specs, ``kind`` the name of the method for users. A step is a sequence of
    #: explicit flows.
    scheme = kind = "splitting"
    label = "splitting of a lattice"
    is_implicit, site_kind, weak_order = False, None, 2
    fractions = (1.0,)

    @property
    def order(self) -> Order:
        """The order of the method."""
        return self.choice.order

    @property
    def composition(self) -> str:
        """The name of the composition, such as ``Strang``."""
        return self.choice.method.name

    @property
    def colouring(self) -> Colouring:
        """The colouring of the sites. The parts of H depend on this colouring."""
        return self.parts.colouring

    @property
    def flows(self) -> tuple[CellFlow, ...]:
        """The flows of the parts of H and of the forces, in the order of a step."""
        return tuple(flow for flow in self.choice.splitting.flows if isinstance(flow, CellFlow))

    @property
    def by_colour(self) -> tuple[bool, ...]:
        """For each flow, whether it updates only the sites of one colour of a graph; () if all flows update all
        sites.
        """
        return tuple(flow.by_colour for flow in self.flows) if any(flow.by_colour for flow in self.flows) else ()

    @property
    def facts(self) -> list[str]:
        """The lines about the method in the header of generated files."""
        choice = self.choice
        count, method = len(choice.splitting.flows), choice.method
        coloured_parts = [f"H_{k}" for k, flow in enumerate(self.flows, 1) if flow.by_colour]
        if count == 1 and not coloured_parts:
            return ["scheme: the exact flow of H, which is elementary", "step: explicit"]
        parts = " + ".join(f"H_{k}" for k in range(1, count + 1))
        reason = f"; chosen since {choice.why}" if choice.why else ""
        schedule = choice.schedule() if not coloured_parts else None
        further = f", {len(schedule.begin)} more before and after a run" if schedule and schedule.begin else ""
        flows = (
            f"{len(choice.schedule().flows)} flows{further}"
            if not coloured_parts
            else f"a flow of {' and of '.join(coloured_parts)} for each colour of sites"
        )
        monitor = [] if self.negative is None else [cell_monitor.fact(self.flows, self.negative)]
        relative = [f"coordinates of flows: {self.bodies.change.replace('_', ' ')}"] if self.bodies else []
        return [
            *monitor,
            *relative,
            f"scheme: splitting, H = {parts}, with the exact flow of each part",
            f"composition: {method.name}, {method.stages} stage{'s' * (method.stages > 1)}, {flows}{reason}",
            "step: explicit",
        ]

    def acting(self, forces: SpecForces) -> str:
        """Return "": forces have flows of their own in a splitting, so the header of generated files needs no text
        about them.
        """
        return ""

    def flows_named(self, cell: Cell) -> Iterator[tuple[CellFlow, str]]:
        """Yield all flows, each with a text that names the cause of the motion: a source of noise, a force, or a part
        of H. Noise comes first.
        """
        for flow, name in zip(self.noise, cell.noise, strict=True):
            yield flow, f"the noise {name}"
        for k, flow in enumerate(self.flows, 1):
            part = self.bodies.named(flow) if self.bodies else f"sum({flow.hamiltonian})"
            yield flow, f"F_{k}, a force" if flow.force else f"H_{k} = {part}"

    def equation(self, cell: Cell, coefficients: Coefficients, *, tangent: bool) -> None:
        """Return None: all flows are explicit, so a splitting solves no implicit equation."""

    def either(self, splitting: Callable[[SplittingPlan], T], series: Callable[[SeriesPlan], T]) -> T:
        """Return ``splitting(self)``. A caller passes one function for each class of plans, and the plan chooses
        between them.
        """
        return splitting(self)

    def schedule(self) -> Schedule:
        """Return the schedule of a step: the order and the durations of the flows."""
        if self.by_colour:
            return _any_number(self.choice.method, dated=self.choice.carrier is not None)
        schedule = self.choice.schedule()
        return with_noise(schedule, len(self.noise)) if self.noise else schedule


#: Plan of a step of a lattice. The two classes have the same properties and methods.
LatticePlan = SplittingPlan | SeriesPlan


def plan_sweeps(cell: Cell, spec: Spec) -> LatticePlan:
    """Return the plan of a step: a splitting, or the series if the spec asks for it or H does not split.

    Raises `SpecError` if neither scheme is possible, and for options that lattices do not have.
    """
    _expect_supported(cell, spec)
    cell_monitor.expect_applicable(cell, spec)
    if spec.scheme == "series" or (spec.scheme == "auto" and spec.birealisation.kind != "auto"):
        return plan_series(cell, spec)
    if spec.coordinates_from:
        return _plan_bodies(cell, spec)
    try:
        return _plan_splitting(cell, spec)
    except SpecError as unsplit:
        if spec.scheme == "splitting" or spec.monitor is not None:
            raise
        try:
            series_plan = plan_series(cell, spec)
            return replace(series_plan, since=unsplit.reason) if isinstance(unsplit, MisfitError) else series_plan
        except SpecError as error:
            raise SpecError([*unsplit.diagnostics, *error.diagnostics]) from None


def _plan_splitting(cell: Cell, spec: Spec) -> SplittingPlan:
    search = GraphSearch if cell.relation == GRAPH else PartSearch
    parts, forces, since = _coloured(cell, search, spec)
    noise = tuple(noise_flows(cell, parts.colouring, search, spec))
    flows = (*parts.flows, *forces)
    monitored = spec.monitor is not None
    order = spec.wanted_order
    requested = order, composition_of(spec.composition, order) if monitored else spec.composition
    plain = bool(cell.forces) or monitored
    choice = planned(spec, SplitHamiltonian(flows), *requested, lambda: () if plain else _kicks(cell, parts))
    coloured = any(flow.by_colour for flow in flows)
    if coloured and noise:
        message = (
            "scheme splitting: noise is not offered on graphs where neighbouring sites are moved one after another"
        )
        raise SpecError([Diagnostic(message, spec.locations.get(("noise",)), "scheme: series applies to it")])
    if cell.time:  # on a coloured graph, the time advances in the last flow
        choice = replace(choice, carrier=len(flows)) if coloured else with_carrier(choice, cell.time)
    plan = SplittingPlan(parts, _with_seams(choice, parts.colouring), noise, since)
    return replace(plan, negative=cell_monitor.negative_part(cell, plan.flows, spec)) if monitored else plan


def _plan_bodies(cell: Cell, spec: Spec) -> SplittingPlan:
    """Return the plan for attracting bodies in relative coordinates (see `phigen.lattice.relative_bodies`)."""
    bodies = lattice_bodies(cell, spec)
    parts = bodies.flows()
    choice = planned(spec, SplitHamiltonian(parts.flows, small=1), spec.wanted_order, spec.composition, lambda: ())
    if isinstance(choice.method, Corrected) and choice.method.multiple:
        hint = "composition: saba-8-2 at order 2 or aba-10-6-4 at order 4, or wisdom-holman-17"
        message = f"scheme splitting: composition {choice.method.name} is not offered for lattices"
        raise SpecError([spec.diagnostic(("composition",), message, hint)])
    return SplittingPlan(parts, choice, bodies=bodies)


def _with_seams(choice: ScheduledMethod, colouring: Colouring) -> ScheduledMethod:
    """Return the method with additional flows for the terms that begin on boundary seams, where the colours do not
    repeat.

    The flows on seams follow the flow of their part of H on all other sites. In the last part of H, they precede this
    flow.
    """
    flows = choice.splitting.flows
    last, all_flows = len(flows) - 1, list[Flow]()
    for k, flow in enumerate(flows):
        seams = list(_on_seams(flow, colouring)) if isinstance(flow, CellFlow) and flow.beside else []
        all_flows += [*seams, flow] if k == last > 0 else [flow, *seams]
    carrier = choice.carrier + len(all_flows) - len(flows) if choice.carrier else choice.carrier
    return replace(choice, splitting=replace(choice.splitting, flows=tuple(all_flows)), carrier=carrier)


def _on_seams(flow: CellFlow, colouring: Colouring) -> Iterator[CellFlow]:
    """For each set of boundary seams, yield the flow of the terms that begin on exactly these seams.

    ``flow`` is the flow of those terms of a part of H that begin on no seam. If the part has no other terms, nothing is
    yielded.
    """
    colours = {colour for _, summand_colours in flow.summands for colour in summand_colours}
    if colours and colours.isdisjoint(colouring.on_seams()):
        return
    for window in colouring.windows[1:]:
        yield replace(flow, motions=(), summands=(), window=window)


def _coloured(cell: Cell, search: type[PartSearch], spec: Spec) -> tuple[CellSplitting, tuple[CellFlow, ...], str]:
    """Return the parts of H and the flows of forces, with the fewest colours that the sizes of all runs allow.

    The third result is the reason for boundary seams, or for not using fewer colours; "" if there is none. If no number
    of colours fits, the scheme ``splitting`` takes the fewest colours, and a later check refuses the runs. The scheme
    ``auto`` raises `MisfitError`.
    """
    best: tuple[CellSplitting, tuple[CellFlow, ...]] | None = None
    rejected: list[Misfit] = []
    refused: SpecError | None = None
    for parts in splittings(cell, spec.locations.get(("hamiltonian",)), search):
        try:
            parts_and_forces = parts, force_flows(cell, parts.colouring, spec)
        except TogetherError as error:
            refused = refused or error
            continue
        wrong_sizes = misfits(spec, cell, parts.colouring.periods(cell.boundary))
        if not wrong_sizes:
            return *parts_and_forces, misfit_reason(rejected, best[0].colouring.count) if best else ""
        if seamed := _seamed(cell, parts.colouring, search, spec):
            return *seamed, seam_reason(wrong_sizes)
        best, rejected = best or parts_and_forces, rejected or wrong_sizes
    if best is None:
        assert refused is not None
        raise refused
    if spec.scheme == "auto":
        reason = misfit_reason(rejected, best[0].colouring.count)
        raise MisfitError(misfit_diagnostics(spec, rejected), reason)
    return *best, ""


def _seamed(
    cell: Cell, colouring: Colouring, search: type[PartSearch], spec: Spec
) -> tuple[CellSplitting, tuple[CellFlow, ...]] | None:
    """Return the parts of H and the flows of forces for a colouring with boundary seams.

    Seams allow sizes that are no multiples of the period. Returns None if a run is too small for its seams, an axis has
    open ends, or sites near seams have no elementary flow.
    """
    seamed = colouring.with_seams(cell)
    small = any(
        size < seam.min_size
        for run in spec.runs.values()
        for size, seam in zip(run.lattice.sizes if run.lattice else (), seamed.seams, strict=False)
    )
    if small or any(b != PERIODIC for b in cell.boundary):
        return None
    try:
        return search(cell, seamed).splitting(), force_flows(cell, seamed, spec)
    except (NoPartError, SpecError):
        return None


def _kicks(cell: Cell, parts: CellSplitting) -> list[Kick]:
    """Return the parts V of H = T + V that can be the potential of a Nyström method.

    If H depends on the time t, T + e takes the place of T, where e is the momentum conjugate to t. Then a part V is
    left out if T depends on the time.
    """
    return [k for k in cell_kicks(cell, parts) if not (cell.time and is_dated(parts.flows[1 - k.part], cell.time))]


def build_sweeps(cell: Cell, plan: LatticePlan, spec: Spec) -> Program:
    """Return the solver of a lattice as a program."""
    extras = spec.extras
    monitored = spec.monitor is not None
    bodies = plan.bodies if isinstance(plan, SplittingPlan) else None
    cell = bodies.cell if bodies else cell
    late = (cell_monitor.LATE,) if monitored and extras.tangent else ()
    coefficients = Coefficients([*(p.name for p in cell.parameters if p.at == "all"), TIME, KICK, *late], cell.times)
    schedule = plan.schedule()
    solved = plan.equation(cell, coefficients, tangent=extras.tangent)
    swept = tuple(
        tuple(
            _sweep(cell, flow, motion, k, coefficients, what, tangent=extras.tangent, late=bool(late))
            for motion in flow.every_motion
        )
        for k, (flow, what) in enumerate(plan.flows_named(cell), 1)
    )
    swept = of_bodies(swept, bodies) if bodies else swept
    if extras.adjoint and cell.noise:
        raise SpecError([Diagnostic("adjoint is not offered for lattices with noise")])
    plain_names = tuple(p.name for p in cell.parameters if p.at == "all")
    refresh = coefficients.refresh(t=cell.times)
    further = {"kick": (KICK,) if schedule.multiples else (), "late": late}
    prepare = Kernel(
        "prepare",
        f"compute the coefficients that depend on parameters and on the duration of a {'stage' if solved else 'flow'}",
        {"params": plain_names, "h": (TIME,), **{n: s for n, s in further.items() if s}},
        (Output("coef", tuple(coefficients.values)),),
    )
    observed = observables(cell, single=extras.real == "float")
    kernels = [*(sweep.kernel for part in swept for sweep in part), *((solved.relax, solved.advance) if solved else ())]
    noise = Noise(tuple(cell.noise), 1 if solved else 2) if cell.noise else None
    rates, sums_of_parts = None, list[tuple[str, BondSum]]()
    if plan.negative is not None:
        rates, sums_of_parts = cell_monitor.rates_of(cell, plan.flows, plan.negative, tangent=extras.tangent)
        kernels += rates.kernels
    sites = _sites(cell, plan.colouring, [*kernels, *observed.kernels])
    kinds, partners = tuple(k for _, k in cell.casimirs.values()), _partners(cell, varied=solved is not None)
    partners = of_massive(partners) if bodies and partners else partners
    if partners:
        purpose = "contribution of a pair to the energy of a part of H, or to its variation"
        of_parts = ((n, _gather(cell, merged_ends([s]), f"{n}_of_pairs", purpose)) for n, s in sums_of_parts)
        partners = replace(partners, of_parts=tuple((n, g or Gather((), ())) for n, g in of_parts))
    if partners:
        gathers_of_partners = partners.gathers
        all_sweeps = [s for part in swept for sweep in part for s in (sweep, sweep.tangent) if s]
        gathers = [*(sweep.gather for sweep in all_sweeps if sweep.gather), *gathers_of_partners]
        at_bonds = tuple(p.name for p in cell.parameters if p.at == "bonds")
        sites = replace(sites, ends=_ends(cell, [k for g in gathers for k in g.kernels]), at_bonds=at_bonds)
    adjoint = transposed(swept, solved, prepare, refresh, coefficients, partners) if extras.adjoint else None
    sweeps = Sweeps(
        prepare,
        sites,
        swept,
        schedule,
        plan.composition,
        kinds,
        partners,
        plan.by_colour,
        solved,
        rates=rates,
        refresh=refresh,
        adjoint=adjoint,
        relative=bodies.sites(plan.flows) if bodies else None,
    )
    step = coefficients.settled(sweeps)
    facts = [_lattice_fact(cell, plan.colouring), *plan.facts, *_acting_facts(cell, plan), plan.order.note]
    return Program(
        name=cell.name,
        about=About(spec.title, spec.license, spec.source_sha256, tuple(f for f in facts if f), _operations(step)),
        coordinates=cell.fields,
        time=cell.time,
        parameters=cell.parameters,
        casimirs=tuple(cell.casimirs),
        observed=tuple(cell.reductions),
        order=plan.order.order,
        step=step,
        observables=observed,
        forced=bool(cell.forces),
        pushed=pushed_casimirs(cell),
        noise=noise,
        fractions=plan.fractions,
        extras=extras,
        lanes=spec.solver.lanes,
        compensated=spec.solver.compensated,
        profile=spec.profile,
    )


def _any_number(method: Alternation | Nystrom, *, dated: bool) -> Schedule:
    """Return the order of flows in a step on a graph, whose number of colours is known only at run time; see `Sweeps`.

    ``dated`` says that H depends on the time. Then the time advances in the last flow.
    """
    assert isinstance(method, Alternation)
    backwards = {(1, 2): (3, 2)}
    of_three = alternating(method, 3)
    if dated:
        of_three = with_clock(of_three, 2, 2)
    return replace(of_three, pattern=tuple(backwards.get(flow, flow) for flow in of_three.pattern))


def _expect_supported(cell: Cell, spec: Spec) -> None:
    diagnostics, locations = [], spec.locations
    if cell.bond_bracket and cell.relation == PAIRS:
        message = "brackets between the sites of pairs are not offered"
        diagnostics.append(Diagnostic(message, locations.get(("poisson",))))
    unsupported = ["modified_hamiltonian"] if spec.extras.modified_hamiltonian else []
    unsupported += ["reconstruct"] if ("reconstruct",) in locations else []
    diagnostics += [Diagnostic(f"{name} is not offered for lattices", locations.get((name,))) for name in unsupported]
    if diagnostics:
        raise SpecError(diagnostics)


def _sweep(
    cell: Cell,
    flow: CellFlow,
    motion: SiteMotion,
    k: int,
    coefficients: Coefficients,
    hamiltonian: str,
    *,
    tangent: bool,
    late: bool,
) -> Sweep:
    increments = staged(list(motion.increments.values()), coefficients)
    updated = tuple(cell.fields.index(f) for f in motion.increments)
    near_seam = motion is flow.beside
    suffix = "_beside" if near_seam else f"_{flow.motions.index(motion)}" if len(flow.motions) > 1 else ""
    location = f" on the seam {flow.window}" if flow.window else " near seams" if near_seam else ""
    # the name of a single field could be read as a word: "a multiplied by a factor"
    manner = "field " * (motion.manner.split(" ", 1)[0] in cell.fields) + motion.manner
    purpose = f"the flow of {hamiltonian}{location}: {manner}".replace(KICK, KICK.kind)
    kernel = site_kernel(cell, f"sweep{k}{suffix}", purpose, increments, "change", coefficients, Role.SWEEP)
    purpose = f"for each site a, the forces of H_{k} on a, summed over {_others(cell)} b"
    gather = _gather(cell, motion.gathered, f"gather{k}{suffix}", purpose, coefficients)
    tangent_sweep = _tangent(cell, motion, f"{k}{suffix}", coefficients, late=late) if tangent else None
    omits_seams, window = flow.beside is not None and not near_seam, flow.window if near_seam else None
    tangent_sweep = replace(tangent_sweep, omits_seams=omits_seams, window=window) if tangent_sweep else None
    return Sweep(kernel, updated, motion.colour, gather, tangent_sweep, omits_seams, window)


def _tangent(cell: Cell, motion: SiteMotion, suffix: str, coefficients: Coefficients, *, late: bool) -> Sweep:
    """Return the tangent kernel of a sweep: the derivatives of the increments along a tangent vector.

    ``late`` says that the duration of the flow depends on the state, so that it is differentiated too.
    """
    increments = list(motion.increments.values())
    slopes = along(cell, increments)
    slopes = staged(cell_monitor.delayed(increments, slopes) if late else slopes, coefficients)
    updated = tuple(cell.fields.index(f) for f in motion.increments)
    purpose = f"the derivative of sweep {suffix.replace('_', '.')}"
    kernel = site_kernel(cell, f"tangent{suffix}", purpose, slopes, "change", coefficients, Role.SWEEP_TANGENT)
    sums = [replace(s, values=with_variations(cell, s.values)) for s in motion.gathered]
    purpose = f"for each site a, the forces on a and their variations, summed over {_others(cell)} b"
    return Sweep(kernel, updated, motion.colour, _gather(cell, sums, f"gather_tangent{suffix}", purpose, coefficients))


def _gather(
    cell: Cell, sums: Sequence[BondSum], name: str, purpose: str, coefficients: Coefficients | None = None
) -> Gather | None:
    """Return the kernels that compute sums over bonds or pairs, or None if ``sums`` is empty.

    All elements of ``sums`` have the same symbols. There are two elements if a bond contributes differently to its
    first and to its second end.
    """
    if not sums:
        return None
    ends = []
    for s in sums:
        values = list(s.values.values())
        values = coefficients.hoist(values) if coefficients else values
        verb = {"a": "begin", "b": "end"}.get(s.end)
        suffix, condition = (f"_{s.end}", f"{ONE_END} {verb} at a") if verb else ("", "")
        ends.append(
            Ends(
                site_kernel(cell, name + suffix, purpose + condition, values, "sums", coefficients, Role.GATHER),
                s.end,
                s.chosen,
                {k: s.extremes[n] for k, n in enumerate(s.values) if n in s.extremes},
            )
        )
    return Gather(tuple(ends), tuple(sums[0].values))


def _others(cell: Cell) -> str:
    """Return the words that stand for the partners of a site in a comment: "its neighbours" or "all other sites"."""
    return "its neighbours" if cell.relation == GRAPH else "all other sites"


def _partners(cell: Cell, *, varied: bool) -> Partners | None:
    """Return the kernels of bonds or pairs for energies, forces and observables; None on a grid.

    If ``varied``, kernels for the variations of the forces are included.
    """
    if cell.relation == GRID:
        return None
    kind = "bond" if cell.relation == GRAPH else "pair"
    empty, sums = Gather((), ()), site_sums(cell)
    forces = f"for each site a, the forces on a, summed over {_others(cell)} b"
    slopes = f"for each site a, the forces on a and their variations, summed over {_others(cell)} b"
    varied_sums = [replace(s, values=with_variations(cell, s.values)) for s in sums] if varied else []
    return Partners(
        _gather(cell, energies(cell), f"{kind}_energy", f"for each site a, the sum of the energies of its {kind}s")
        or empty,
        _gather(cell, sums, f"{kind}_forces", forces) or empty,
        cell.relation == GRAPH,
        _gather(cell, varied_sums, f"{kind}_slopes", slopes) or empty,
        _gather(cell, observed_sums(cell), f"{kind}_quantities", f"the densities of observables of a {kind}") or empty,
    )


def _sites(cell: Cell, colouring: Colouring, kernels: Sequence[Kernel]) -> Sites:
    places = {
        n: (f, steps(offset) or (0,)) for kernel in kernels for n, (f, offset) in cell.places(*kernel.roots).items()
    }
    places |= {f: (f, (0,) * max(1, len(cell.axes))) for f in cell.fields if f not in places}
    axes, boundary = cell.axes or ("i",), cell.boundary or (PERIODIC,)
    reach = [max((abs(o[a]) for _, o in places.values()), default=0) for a in range(len(axes))]
    least = [max(a, b) for a, b in zip(reach, least_sizes(cell) or (1,), strict=True)]
    least = [max(a, seam.min_size) for a, seam in zip(least, colouring.seams or [Seam()] * len(axes), strict=True)]
    return Sites(
        axes,
        tuple(b != PERIODIC for b in boundary),
        tuple(p.name for p in cell.parameters if p.at == "sites"),
        places,
        colouring.count,
        tuple(colouring.weights) or (0,),
        tuple(colouring.periods(cell.boundary)) or (1,),
        tuple(least),
        increments=cell.increments,
        derived=cell.derived,
        seams=colouring.seams,
    )


def _ends(cell: Cell, kernels: Sequence[Kernel]) -> dict[str, tuple[str, str]]:
    """Return (field, end of the pair) for each symbol that the kernels of bonds or pairs read."""
    places = [p for kernel in kernels for p in cell.places(*kernel.roots).items()]
    return {name: (f, str(offset[0])) for name, (f, offset) in places}


def _lattice_fact(cell: Cell, colouring: Colouring) -> str:
    boundary = ", ".join(f"axis {a} {b}" for a, b in zip(cell.axes, cell.boundary, strict=True))
    related = {GRAPH: "sites with bonds between them, given at run time", PAIRS: "all pairs of sites"}
    return (
        f"lattice: {related.get(cell.relation, boundary)}; any size"
        + (f", sites of {colouring.count} colours" if colouring.count > 1 else "")
        + " and a seam" * bool(colouring.seams)
    )


def _acting_facts(cell: Cell, plan: LatticePlan) -> Iterator[str]:
    """Yield the lines about forces and noise in the header of generated files."""
    yield from forced_lines(bool(cell.forces), pushed_casimirs(cell), plan.acting(cell.forces))
    yield from noise_lines(tuple(cell.noise), weak=plan.weak_order)


def _operations(step: Sweeps) -> dict[str, int]:
    """Return the numbers of operations of a step per site, by the kind of operation."""
    times = Counter(part for part, _ in step.schedule.flows)
    if step.by_colour:  # a stage applies the flow of a colour twice, except for the first and the last flow
        times = Counter(dict.fromkeys(range(len(step.parts)), 2 * step.schedule.stages))
    totals: Counter[str] = Counter()
    for part, sweeps in enumerate(step.parts):
        for sweep in (s for s in sweeps if s.window is None):
            for operation, number in operation_counts(sweep.kernel.roots).items():
                totals[operation] += number * times[part]
    for kernel in (step.equation.relax, step.equation.advance) if step.equation else ():
        totals.update(operation_counts(kernel.roots))
    return dict(totals)
