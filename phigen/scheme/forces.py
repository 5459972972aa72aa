"""What headers say of forces: with them a step is no Poisson map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.geometry.system import System
from phigen.symbolic.expression import Expression


def force_facts(system: System, how: str) -> Iterator[str]:
    """The lines of a header; ``how`` they enter the step, where that is to be said."""
    yield from forces_said(system.forces is not None, system.pushed, how)


def forces_said(there: bool, pushed: Sequence[str], how: str) -> Iterator[str]:
    """The same where they are ``there`` and change the Casimirs that are ``pushed``."""
    if not there:
        return
    if how:
        yield f"forces: {how}"
    kept = f"they change {', '.join(pushed)}" if pushed else "they keep all Casimirs"
    yield f"with forces a step is no Poisson map; {kept}"


def acts(force: Sequence[Expression]) -> bool:
    """Whether a force is there."""
    return any(not f.is_zero for f in force)
