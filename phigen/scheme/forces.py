"""Lines about forces in the header of generated files: with forces a step is not a Poisson map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.geometry.system import System
from phigen.symbolic.expression import Expression


def force_facts(system: System, manner: str) -> Iterator[str]:
    """Yield the header lines on the forces of a system; ``manner`` is the formula by which forces enter the step, or
    ""."""
    forces = system.forces
    pairs = (("covector force zeta", forces.covector), ("vector force f", forces.vector)) if forces else ()
    named = " and ".join(f"the {name}" for name, force in pairs if _acts(force))
    yield from forced_lines(forces is not None, system.pushed, f"{manner}, with {named}" if manner else "")


def forced_lines(forced: bool, pushed: Sequence[str], manner: str) -> Iterator[str]:
    """Yield the header lines on forces, if the system is ``forced``; ``pushed`` names the Casimirs that the forces
    change."""
    if not forced:
        return
    if manner:
        yield f"forces: {manner}"
    effect = f"the forces change {', '.join(pushed)}" if pushed else "the forces conserve all Casimirs"
    yield f"with forces a step is not a Poisson map; {effect}"


def forced_gradient(system: System) -> str:
    """Return the text "grad H" of headers, with the covector force zeta added if the system has one."""
    return "(grad H + zeta)" if system.forces and _acts(system.forces.covector) else "grad H"


def has_vector_force(system: System) -> bool:
    """Whether the system has a vector force f."""
    return system.forces is not None and _acts(system.forces.vector)


def _acts(force: Sequence[Expression]) -> bool:
    """Whether at least one component of a force is not literally 0."""
    return any(not f.is_zero for f in force)
