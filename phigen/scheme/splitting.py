"""Programs of splittings. Each part of H has a kernel for its flow; a schedule has the order of the flows in a step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System
from phigen.scheme.adjoint import completed, explicit_adjoint, level_adjoint
from phigen.scheme.alternation import Schedule
from phigen.scheme.choosing import ScheduledMethod
from phigen.scheme.discretisation import expect_few
from phigen.scheme.forces import force_facts
from phigen.scheme.gathering import staged
from phigen.scheme.gauge import Gauge
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.kernels import noise_fields, observables
from phigen.scheme.logarithmic import Logarithmic, trimmed
from phigen.scheme.lowering import operation_counts
from phigen.scheme.near_integrable import Corrected
from phigen.scheme.noise import driven, expect_no_adjoint, noise_facts, with_noise
from phigen.scheme.program import About, Noise, Program
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Splitting
from phigen.scheme.tangent import explicit_jacobian
from phigen.spec.model import Extras, Spec
from phigen.splitting.flow import Flow
from phigen.splitting.ring import KICK, TIME
from phigen.symbolic.readable import shortened
from phigen.symbolic.symbols import LEVEL

if TYPE_CHECKING:
    from phigen.attitude.group import Group


def build_splitting(
    system: System,
    choice: ScheduledMethod,
    gauge: Gauge,
    spec: Spec,
    *,
    group: Group | None = None,
    monitor: Logarithmic | None = None,
) -> Program:
    """Return the program of a splitting, an explicit solver. Raises `LimitError` if a kernel is too large."""
    extras = spec.extras
    _expect_no_modified(system, extras)
    if isinstance(choice.method, Corrected):
        _expect_correctable(system, spec, choice.method)
    sources = driven(system)
    if sources:
        expect_no_adjoint(system, extras.adjoint)
    flows = [*sources, *choice.splitting.flows]
    constant_symbols = (LEVEL,) if monitor else ()
    coefficients = Coefficients(
        [*system.parameter_names, *constant_symbols, TIME, KICK], [*system.times, *system.increments[:1]]
    )
    _expect_steady(system, flows, monitor)
    coefficients.include(e for flow in flows for e in flow.exponentials)
    kernels = tuple(_flow_kernel(system, flow, k, coefficients, monitor) for k, flow in enumerate(flows, 1))
    tangents = tuple(_tangents(system, kernels, coefficients)) if extras.tangent else ()
    attitude = None
    if group:
        from phigen.scheme.attitude import flow_attitude

        increments = [monitor.outputs(flow) if monitor else flow.increment for flow in flows]
        time_of = monitor.time if monitor else None
        attitude = flow_attitude(system, group, choice.splitting.flows, increments, gauge, coefficients, time_of)
    schedule = with_noise(choice.schedule(), len(sources)) if sources else choice.schedule()
    step = _step(
        system, kernels, schedule, coefficients, constant_symbols, choice.method.name, tangents, adjoint=extras.adjoint
    )
    for kernel in step.kernels:
        expect_few(system, kernel, other="")
    level = level_adjoint(system) if monitor and extras.adjoint else None
    lines = [*([monitor.fact] if monitor else []), *gauge.facts, *facts(choice, step, len(sources))]
    lines += [*force_facts(system, ""), *noise_facts(system, weak=2), _clock(choice), choice.order.note]
    return Program(
        name=system.name,
        about=About(
            spec.title, spec.license, spec.source_sha256, tuple(fact for fact in lines if fact), _operations(step)
        ),
        coordinates=system.coordinates,
        time=system.time,
        forced=system.forces is not None,
        pushed=system.pushed,
        parameters=system.parameters,
        casimirs=tuple(system.casimirs),
        order=choice.order.order,
        step=step,
        observables=observables(system),
        observed=tuple(system.observables),
        noise=Noise(tuple(s.name for s in system.noise), 2, noise_fields(system)) if sources else None,
        attitude=coefficients.settled(attitude),
        extras=extras,
        lanes=spec.solver.lanes,
        profile=spec.profile,
        monitor=replace(monitor.monitor(system), level=level) if monitor else None,
    )


def _flow_kernel(system: System, flow: Flow, k: int, coefficients: Coefficients, monitor: Logarithmic | None) -> Kernel:
    increment = staged(monitor.outputs(flow) if monitor else flow.increment, coefficients)
    part = f"{monitor.part(flow)} = " if monitor else ""
    return Kernel(
        f"flow{k}",
        f"the flow of {part}{_named(system, flow, k)}: {flow.manner}".replace(KICK, KICK.kind),
        {"coef": coefficients.slots, "state": system.coordinates},
        (Output("increment", tuple(increment)),),
    )


def _tangents(system: System, flows: Iterable[Kernel], coefficients: Coefficients) -> Iterator[Kernel]:
    for k, flow in enumerate(flows, 1):
        yield explicit_jacobian(trimmed(flow, system.dimension), system.coordinates, coefficients, f"tangent{k}")


def _step(
    system: System,
    flows: tuple[Kernel, ...],
    schedule: Schedule,
    coefficients: Coefficients,
    constant_symbols: tuple[str, ...],
    method: str,
    tangents: tuple[Kernel, ...],
    *,
    adjoint: bool,
) -> Splitting:
    """Return the step of a splitting from the kernels of its flows.

    The table of ``coefficients`` must be complete, except for coefficients that depend on the time or on noise
    increments.
    """
    renewed_inputs = {"t": system.times, "dw": system.increments[:1]}
    refresh = coefficients.refresh(**{name: symbols for name, symbols in renewed_inputs.items() if symbols})
    inputs = {"gauge": constant_symbols, "h": (TIME,), "kick": (KICK,) if schedule.multiples else ()}
    held = ", the energy level" if constant_symbols else ""
    prepare = Kernel(
        "prepare",
        f"compute the coefficients that depend only on parameters{held} and the duration of a flow",
        {"params": system.parameter_names, **{name: symbols for name, symbols in inputs.items() if symbols}},
        (Output("coef", tuple(coefficients.prepared)),),
        exponentials=coefficients.blocks,
    )
    step = Splitting(prepare, flows, schedule, method, tangents, refresh=refresh)
    if adjoint:
        untimed = [trimmed(flow, system.dimension) for flow in flows]
        transposes = [explicit_adjoint(flow, coefficients, f"flow{k}_adjoint") for k, flow in enumerate(untimed, 1)]
        step = replace(step, adjoint=completed(coefficients, transposes, prepare, refresh))
    return coefficients.settled(step)


def facts(choice: ScheduledMethod, step: Splitting, sources: int = 0) -> list[str]:
    """Return the lines on the method for the header of generated files.

    ``sources`` is the number of sources of noise; their flows are the first parts of the step.
    """
    count, flows, method = len(step.flows) - sources, len(step.schedule.flows) - 2 * sources, choice.method
    further = f", {len(step.schedule.begin)} more before and after a run" * bool(step.schedule.begin)
    if count == 1 and choice.carrier is None:
        return ["scheme: the exact flow of H, which is elementary", f"step: {step.kind.manner}"]
    names = [(f"{flow.letter}_{k}", flow.force) for k, flow in enumerate(choice.splitting.flows, 1)]
    parts, forces = (" + ".join(n for n, force in names if bool(force) == acting) for acting in (False, True))
    reason = f"; chosen since {choice.why}" if choice.why else ""
    return [
        f"scheme: splitting, H = {parts}" + f", forces {forces}" * bool(forces) + ", with the exact flow of each part",
        f"composition: {method.name}, {method.stages} stage{'s' * (method.stages > 1)}, {flows} flows{further}{reason}",
        f"step: {step.kind.manner}",
    ]


def _clock(choice: ScheduledMethod) -> str:
    """Return the header line that says in which flow the time advances; "" if H does not depend on the time."""
    if choice.carrier is None:
        return ""
    flows = choice.splitting.flows
    with_part = choice.carrier < len(flows)
    manner = f"with {flows[choice.carrier].letter}_{choice.carrier + 1}" if with_part else "between the flows"
    return f"time: advances {manner}, and stands still in {'all other' if with_part else 'all'} flows"


def _named(system: System, flow: Flow, k: int) -> str:
    """Return a description of flow ``k``, counted from 1: its Hamiltonian or, for the flow of a force, a name such as
    F_2.

    The flows of noise sources have the first numbers.
    """
    sources = system.noise
    if k <= len(sources):
        return f"{flow.hamiltonian}, for the noise {sources[k - 1].name}"
    if flow.force:
        return f"F_{k - len(sources)}, a force"
    return f"H_{k - len(sources)} = {flow.hamiltonian}"


def _operations(step: Splitting) -> dict[str, int]:
    """Return the numbers of operations of a step by kind, without those of compensated summation."""
    times = Counter(part for part, _ in step.schedule.flows)
    totals: Counter[str] = Counter()
    for part, kernel in enumerate(step.flows):
        for operation, number in operation_counts(kernel.roots).items():
            totals[operation] += number * times[part]
    return dict(totals)


def _expect_steady(system: System, flows: Sequence[Flow], monitor: Logarithmic | None) -> None:
    """Raise `SpecError` if a monitor makes the duration of a flow depend on the state although the flow uses a matrix
    exponential.

    The matrix exponentials of flows are computed before the steps, for fixed durations.
    """
    for flow in flows if monitor else ():
        if flow.exponentials:
            message = (
                "monitor: log makes the time of a flow depend on the state, but the flow of {} uses a matrix "
                "exponential, which needs a fixed time"
            )
            diagnostic = Diagnostic(
                message.format(shortened(flow.hamiltonian)),
                system.locations.get(("monitor",)) or system.locations.get(("hamiltonian",)),
                "use scheme: series, which takes an expression as monitor for every H",
            )
            raise SpecError([diagnostic])


def _expect_correctable(system: System, spec: Spec, method: Corrected) -> None:
    """Raise `SpecError` for features that a method with a corrector does not offer, such as noise, forces or a monitor.

    The message has the reason.
    """
    refused = {
        "time": (bool(system.time), "the flows of the corrector would need other times than the steps"),
        "noise": (bool(system.noise), "the inverse of a corrector cannot reverse noise"),
        "forces": (system.forces is not None, "the inverse of a corrector would reverse dissipation"),
        "monitor": (spec.monitor is not None, "a corrector requires steps that are equal in the physical time"),
        "reconstruct": (bool(spec.reconstruct), "attitudes are defined only between single steps"),
    }
    for key, (is_present, reason) in refused.items():
        if is_present:
            message = f"scheme splitting: composition {method.name} is not offered together with {key}: {reason}"
            place = system.locations.get(("composition",)) or system.locations.get((key,))
            hint = "composition: saba-8-2 at order 2 or aba-10-6-4 at order 4, which need no corrector"
            raise SpecError([Diagnostic(message, place, hint)])


def _expect_no_modified(system: System, extras: Extras) -> None:
    if extras.modified_hamiltonian:
        place = system.locations.get(("modified_hamiltonian",))
        raise SpecError([Diagnostic("modified_hamiltonian is not offered for a splitting", place)])
