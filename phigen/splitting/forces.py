"""The flows of forces, as parts of a splitting beside those of H: of ẋ = πζ + f, or of pieces of it.

The pieces are, the first that have one: all of it; πζ and f; πζ in the single covectors ζ_i dx_i, f in its components.
πζ_i dx_i is the field of the coordinate x_i with a factor, tangent to the leaves, so each piece of πζ keeps Casimirs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.flow import Flow, solved
from phigen.splitting.ring import ring_of
from phigen.symbolic.expression import ZERO, Expression
from phigen.symbolic.readable import shortened

Field = tuple[Expression, ...]


def force_flows(system: System) -> tuple[Flow, ...]:
    """The flows of the forces; none without any. `SpecError` that names the piece that has none in closed form."""
    if system.forces is None:
        return ()
    forces = system.forces
    tangent = hamiltonian_vector_field(system.poisson, forces.covector)
    whole = _flow(system, tuple(a + b for a, b in zip(tangent, forces.vector, strict=True)))
    if isinstance(whole, Flow):
        return (whole,)
    return (
        *_pieces(system, tangent, list(_covectors(system, forces.covector)), ("forces", "covector"), ("damping",)),
        *_pieces(system, forces.vector, list(_components(forces.vector)), ("forces", "vector")),
    )


def _covectors(system: System, covector: Sequence[Expression]) -> Iterator[tuple[str, Field]]:
    """The fields of ζ_i dx_i."""
    for i, (c, zeta) in enumerate(zip(system.coordinates, covector, strict=True)):
        if not zeta.is_zero:
            alone = [zeta if k == i else ZERO for k in range(system.dimension)]
            yield f"ζ_{c} = {shortened(zeta)}", hamiltonian_vector_field(system.poisson, alone)


def _components(vector: Sequence[Expression]) -> Iterator[tuple[str, Field]]:
    for i, f in enumerate(vector):
        if not f.is_zero:
            yield f"f = {shortened(f)}", tuple(f if k == i else ZERO for k in range(len(vector)))


def _pieces(
    system: System, field: Field, pieces: Sequence[tuple[str, Field]], *keys: tuple[str, ...]
) -> Iterator[Flow]:
    """The flow of a field, or those of its pieces; ``keys`` are what the spec may have given it by."""
    whole = _flow(system, field) if pieces else ""
    if isinstance(whole, Flow):
        yield whole
        return
    for name, piece in pieces:
        found = _flow(system, piece)
        if not isinstance(found, Flow):
            message = f"scheme splitting: the force {name} has no elementary flow: {found}"
            place = next((system.locations[key] for key in keys if key in system.locations), None)
            raise SpecError([Diagnostic(message, place, "scheme: series takes every force")])
        yield found


def _flow(system: System, field: Field) -> Flow | str:
    """The flow of a vector field, or why there is none."""
    ring = ring_of(system, field)
    found = solved(ring, ring.tower.convert_all(field))
    return found if isinstance(found, str) else Flow(ZERO, tuple(found.increments), found.manner, force=field)
