"""Forces in addition to the Hamiltonian: ẋ = π(∇H + ζ) + f, with a covector field ζ and a vector field f.

πζ is tangent to the symplectic leaves, so ζ conserves all Casimirs; every field tangent to the leaves has this form.
Damping by the double bracket is ζ = λ π∇H, for which dH/dt = −λ |π∇H|². f may be any field, and usually changes
Casimirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phigen.spec.model import SpecForces
from phigen.symbolic.expression import ZERO, Expression


@dataclass(frozen=True)
class Forces:
    """Forces of a system: ``covector`` is ζ, including the damping, and ``vector`` is f, both by coordinate.

    ``damping`` is λ, or 0 without damping. ``undamped`` is ζ without the damping.
    """

    covector: tuple[Expression, ...]
    vector: tuple[Expression, ...]
    damping: Expression = ZERO
    undamped: tuple[Expression, ...] = ()


def forces_of(spec_forces: SpecForces, coordinates: Sequence[str], field: Sequence[Expression]) -> Forces | None:
    """Return the forces of a spec, None without forces; ``field`` is π∇H."""
    if not spec_forces:
        return None
    damping = spec_forces.damping or ZERO
    undamped = tuple(spec_forces.covector.get(c, ZERO) for c in coordinates)
    covector = tuple(z + damping * f for z, f in zip(undamped, field, strict=True))
    return Forces(covector, tuple(spec_forces.vector.get(c, ZERO) for c in coordinates), damping, undamped)
