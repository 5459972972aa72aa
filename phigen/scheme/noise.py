"""Noise in splittings: the flows of the noise sources run for half a step before and half a step after the flows of H.
This module also writes the lines about noise in the comment at the head of generated files.

The increments of the two halves are independent. So the mean of a step is exp(hN/2) exp(hA) exp(hN/2), where A is the
generator of the flow of H, and N = ½ Σ X² the generator of the noise along the fields X. Since the order of the sources
is reversed in the second half, the step is symmetric and has weak order 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.noise import Source
from phigen.geometry.system import System
from phigen.scheme.alternation import Schedule
from phigen.splitting.flow import Flow
from phigen.splitting.parts import split
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import Expression, substitute, symbol
from phigen.symbolic.symbols import increment


def expect_no_adjoint(system: System, adjoint: bool) -> None:
    """Raise `SpecError` if a spec with noise requests gradients by the transpose of a step."""
    if system.noise and adjoint:
        raise SpecError([Diagnostic("adjoint is not offered with noise", system.locations.get(("noise",)))])


def noise_facts(system: System, weak: int) -> Iterator[str]:
    """Yield the lines about noise in the header of generated files; ``weak`` is the weak order of the method."""
    yield from noise_lines([s.name for s in system.noise], weak)


def noise_lines(sources: Sequence[str], weak: int) -> Iterator[str]:
    """Yield the header lines about noise sources with the names ``sources``; ``weak`` is the weak order of the
    method."""
    if not sources:
        return
    names = ", ".join(sources)
    yield f"noise: {names}; in the sense of Stratonovich, along Hamiltonian fields, so it conserves all Casimirs"
    yield f"noise: strong order 1 if its sources commute, else 1/2; weak order {weak}"


def noise_flows(system: System) -> tuple[Flow, ...]:
    """Return for each source of noise the flow of its Hamiltonian g. Raises `SpecError` if a flow is not elementary."""
    return tuple(_flow(system, source) for source in system.noise)


def _flow(system: System, source: Source) -> Flow:
    noise_system = replace(system.frozen, hamiltonian=source.hamiltonian, noise=())
    reason = f"scheme: splitting needs the flow of the noise {source.name} in closed form, which phigen does not find"
    place = system.locations.get(("noise", source.name))
    refused = SpecError([Diagnostic(reason, place, "scheme: series needs no flow of the noise")])
    try:
        flows = split(noise_system).flows
    except SpecError:
        raise refused from None
    # Matrix exponentials are computed before the steps, for fixed durations. The durations of noise are random.
    if len(flows) != 1 or flows[0].exponentials:
        raise refused
    return flows[0]


def driving_times(system: System) -> list[Expression]:
    """Return for each source of noise the duration σ ΔW of its flow, where ΔW is the increment of the source in half a
    step.

    All sources share one symbol ΔW.
    """
    return [source.amplitude * symbol(increment(0)) for source in system.noise]


def driven(system: System) -> list[Flow]:
    """Return for each source of noise the flow of its Hamiltonian over the duration σ ΔW, where ΔW is the increment of
    the source in half a step.

    Raises `SpecError` if a flow is not elementary.
    """
    timed_flows = zip(noise_flows(system), driving_times(system), strict=True)
    return [replace(flow, increment=tuple(substitute(flow.increment, {TIME: time}))) for flow, time in timed_flows]


def with_noise(schedule: Schedule, sources: int) -> Schedule:
    """Return the schedule with the flows of the noise sources at the start of a step, and in reverse order at its end.

    The sources become the first parts. The first rows of ``times`` belong to their flows at the start, and the last
    rows to their flows at the end.
    """
    parts = range(sources)
    rows = sources + len(schedule.times)
    flows = [(part, part) for part in parts]
    flows += [(part + sources, row + sources) for part, row in schedule.flows]
    flows += [(part, rows + part) for part in reversed(parts)]
    zeros = (0.0,) * sources
    moments = schedule.moments or (0.0,) * len(schedule.times)
    return Schedule(
        (*zeros, *schedule.times, *zeros),
        1,
        tuple((part, row - 1) for part, row in flows[1:]),
        (*zeros, *schedule.multiples, *zeros) if schedule.multiples else (),
        (*zeros, *moments, *((1.0,) * sources)),
    )
