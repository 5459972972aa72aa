"""Forces in addition to the Hamiltonian: ẋ = π(∇H + ζ) + f, with a covector field ζ and a vector field f.

The field πζ is tangent to the symplectic leaves, so ζ changes no Casimir. Conversely, every field that is tangent to
the leaves is πζ for some ζ. Damping by the double bracket is ζ = λ π∇H, for which dH/dt = −λ |π∇H|². The vector field f
is arbitrary, and changes Casimirs in general.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phigen.spec.model import SpecForces
from phigen.symbolic.expression import ZERO, Expression


@dataclass(frozen=True)
class Forces:
    """The forces of a system: the ``covector`` field ζ and the ``vector`` field f, each with one expression per
    coordinate.

    ζ includes the damping λπ∇H; ``undamped`` is ζ without it. ``damping`` is λ, or 0 without damping.
    """

    covector: tuple[Expression, ...]
    vector: tuple[Expression, ...]
    damping: Expression = ZERO
    undamped: tuple[Expression, ...] = ()


def forces_of(spec_forces: SpecForces, coordinates: Sequence[str], field: Sequence[Expression]) -> Forces | None:
    """Return the forces of a spec, or None without forces; ``field`` is π∇H, which the damping needs."""
    if not spec_forces:
        return None
    damping = spec_forces.damping or ZERO
    undamped = tuple(spec_forces.covector.get(c, ZERO) for c in coordinates)
    covector = tuple(z + damping * f for z, f in zip(undamped, field, strict=True))
    return Forces(covector, tuple(spec_forces.vector.get(c, ZERO) for c in coordinates), damping, undamped)
