"""What headers say of noise; and its flows in splittings: half a step before, and half a step after the flows of H.

The increments of both halves are independent, so the mean of a step is exp(hN/2) exp(hA) exp(hN/2), with A the
generator of the motion and N = ½ Σ X² that of the noise: of weak order 2, as the sources are split symmetrically too.
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
    """Raise `SpecError` for what is not offered with noise."""
    if system.noise and adjoint:
        raise SpecError([Diagnostic("adjoint is not offered with noise", system.locations.get(("noise",)))])


def noise_facts(system: System, weak: int) -> Iterator[str]:
    """What is said of noise."""
    yield from noise_said([s.name for s in system.noise], weak)


def noise_said(sources: Sequence[str], weak: int) -> Iterator[str]:
    """The same of sources by their names."""
    if not sources:
        return
    names = ", ".join(sources)
    yield f"noise: {names}; in the sense of Stratonovich, along Hamiltonian fields, so it keeps all Casimirs"
    yield f"each path of the noise has its step; strong order 1 if sources commute, else 1/2; weak order {weak}"


def noise_flows(system: System) -> tuple[Flow, ...]:
    """The flow of g of each source. `SpecError` for one whose flow is not elementary."""
    return tuple(_flow(system, source) for source in system.noise)


def _flow(system: System, source: Source) -> Flow:
    alone = replace(system.frozen, hamiltonian=source.hamiltonian, noise=())
    reason = f"scheme: splitting needs the flow of the noise {source.name} in closed form, which phigen does not find"
    place = system.locations.get(("noise", source.name))
    refused = SpecError([Diagnostic(reason, place, "scheme: series takes it")])
    try:
        found = split(alone).flows
    except SpecError:
        raise refused from None
    if len(found) != 1:
        raise refused
    return found[0]


def driving_times(system: System) -> list[Expression]:
    """The times σ ΔW of the flows of the sources, with the increment of any row of coefficients in place of ΔW."""
    return [source.amplitude * symbol(increment(0)) for source in system.noise]


def driven(system: System) -> list[Flow]:
    """The flows of the sources for these times. `SpecError` for one whose flow is not elementary."""
    found = zip(noise_flows(system), driving_times(system), strict=True)
    return [replace(flow, increment=tuple(substitute(flow.increment, {TIME: time}))) for flow, time in found]


def with_noise(schedule: Schedule, sources: int) -> Schedule:
    """The schedule with the sources as the first parts: forwards at the beginning of a step, backwards at its end.

    The first rows of ``times`` are those of the former, the last those of the latter.
    """
    parts = range(sources)
    rows = sources + len(schedule.times)
    flows = [(part, part) for part in parts]
    flows += [(part + sources, row + sources) for part, row in schedule.flows]
    flows += [(part, rows + part) for part in reversed(parts)]
    still = (0.0,) * sources
    moments = schedule.moments or (0.0,) * len(schedule.times)
    return Schedule(
        (*still, *schedule.times, *still),
        1,
        tuple((part, row - 1) for part, row in flows[1:]),
        (*still, *schedule.multiples, *still) if schedule.multiples else (),
        (*still, *moments, *((1.0,) * sources)),
    )
