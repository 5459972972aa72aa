"""Flows of noise in splittings: half a step before, and half a step after the flows of H. Header lines on noise.

The increments of both halves are independent, so the mean of a step is exp(hN/2) exp(hA) exp(hN/2), with A the
generator of the motion and N = ½ Σ X² that of the noise. Since the sources are also split symmetrically, the weak order
is 2.
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
    """Raise `SpecError` if the transpose of a step with noise is requested."""
    if system.noise and adjoint:
        raise SpecError([Diagnostic("adjoint is not offered with noise", system.locations.get(("noise",)))])


def noise_facts(system: System, weak: int) -> Iterator[str]:
    """Yield the lines about noise in the header of generated files."""
    yield from noise_lines([s.name for s in system.noise], weak)


def noise_lines(sources: Sequence[str], weak: int) -> Iterator[str]:
    """Yield the header lines on sources of noise with these names."""
    if not sources:
        return
    names = ", ".join(sources)
    yield f"noise: {names}; in the sense of Stratonovich, along Hamiltonian fields, so it conserves all Casimirs"
    yield f"each path of the noise has its step; strong order 1 if sources commute, else 1/2; weak order {weak}"


def noise_flows(system: System) -> tuple[Flow, ...]:
    """Return the flow of g for each source. Raises `SpecError` for a source whose flow is not elementary."""
    return tuple(_flow(system, source) for source in system.noise)


def _flow(system: System, source: Source) -> Flow:
    noise_system = replace(system.frozen, hamiltonian=source.hamiltonian, noise=())
    reason = f"scheme: splitting needs the flow of the noise {source.name} in closed form, which phigen does not find"
    place = system.locations.get(("noise", source.name))
    refused = SpecError([Diagnostic(reason, place, "scheme: series applies to it")])
    try:
        flows = split(noise_system).flows
    except SpecError:
        raise refused from None
    if len(flows) != 1:
        raise refused
    return flows[0]


def driving_times(system: System) -> list[Expression]:
    """Return the durations σ ΔW of the flows of the sources; the increment ΔW is one symbol."""
    return [source.amplitude * symbol(increment(0)) for source in system.noise]


def driven(system: System) -> list[Flow]:
    """Return the flow of each source of noise over its duration σ ΔW, see `driving_times`.

    Raises `SpecError` for a flow that is not elementary.
    """
    timed_flows = zip(noise_flows(system), driving_times(system), strict=True)
    return [replace(flow, increment=tuple(substitute(flow.increment, {TIME: time}))) for flow, time in timed_flows]


def with_noise(schedule: Schedule, sources: int) -> Schedule:
    """Return the schedule with the sources as the first parts, in order at the start of a step and reversed at its end.

    The first rows of ``times`` belong to the sources at the start, the last rows to those at the end.
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
