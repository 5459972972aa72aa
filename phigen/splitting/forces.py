"""The flows of forces, as parts of a splitting beside those of H: of ẋ = πζ + f, or of pieces of it.

The pieces are, the first that have one: all of it; πζ and f; πζ in the single covectors ζ_i dx_i, f in its components.
πζ_i dx_i is the field of the coordinate x_i with a factor, tangent to the leaves, so each piece of πζ keeps Casimirs.
Of damping, ζ = λπb with b = ∇H, the pieces are those of b: in a block of π what of b does not depend on its
coordinates, and each component of the rest. Those that do not move what others read are one part.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.blocks import blocks
from phigen.geometry.forces import Forces
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.conflicts import coloured
from phigen.splitting.flow import Flow, solved
from phigen.splitting.ring import ring_of
from phigen.symbolic.expression import ZERO, Expression, gradient, symbols_of, total
from phigen.symbolic.readable import shortened

Field = tuple[Expression, ...]

_DAMPING_HINT = (
    "that of a spin has one where H is linear or quadratic along an axis in it; scheme: series takes every H"
)


def force_flows(system: System) -> tuple[Flow, ...]:
    """The flows of the forces; none without any. `SpecError` that names the piece that has none."""
    if system.forces is None:
        return ()
    forces = system.forces
    tangent = hamiltonian_vector_field(system.poisson, forces.covector)
    pushed = tuple(a + b for a, b in zip(tangent, forces.vector, strict=True))
    try:
        closed = _closed_flows(system, forces)
    except SpecError:
        whole = _flow(system, pushed, numeric=True)
        if isinstance(whole, Flow):
            return (whole,)
        raise
    whole = closed[0] if len(closed) == 1 else _flow(system, pushed, numeric=True)
    return (whole,) if isinstance(whole, Flow) else closed


def _closed_flows(system: System, forces: Forces) -> tuple[Flow, ...]:
    """The flows of the forces in closed form, in as few pieces as there are."""
    tangent = hamiltonian_vector_field(system.poisson, forces.covector)
    whole = _flow(system, tuple(a + b for a, b in zip(tangent, forces.vector, strict=True)))
    if isinstance(whole, Flow):
        return (whole,)
    return (
        *_tangent_flows(system, forces, tangent),
        *_pieces(system, forces.vector, list(_components(forces.vector)), ("forces", "vector")),
    )


def _tangent_flows(system: System, forces: Forces, tangent: Field) -> tuple[Flow, ...]:
    """The flows of πζ: the whole of it, or of its covectors, or of damping and of the other covectors."""
    try:
        covectors = list(_covectors(system, forces.covector))
        return tuple(_pieces(system, tangent, covectors, ("forces", "covector"), ("damping",)))
    except SpecError:
        if forces.damping.is_zero:
            raise
    undamped = hamiltonian_vector_field(system.poisson, forces.undamped)
    covectors = list(_covectors(system, forces.undamped))
    return (*_damping_flows(system, forces.damping), *_pieces(system, undamped, covectors, ("forces", "covector")))


def _damping_flows(system: System, damping: Expression) -> list[Flow]:
    """The flows of λππb, b = ∇H: those of the blocks of π in as few parts as possible."""
    found = [
        flow for block in blocks(system.coordinates, system.poisson) for flow in _damped_block(system, damping, block)
    ]
    moved = [{k for k, e in enumerate(flow.increment) if not e.is_zero} for flow in found]
    read = [{k for k, c in enumerate(system.coordinates) if c in symbols_of(*flow.increment)} for flow in found]
    neighbours = [
        {j for j in range(len(found)) if j != i and (moved[i] & read[j] or moved[j] & read[i])}
        for i in range(len(found))
    ]
    colours = coloured(neighbours, moved)
    return [_joined([f for f, k in zip(found, colours, strict=True) if k == colour]) for colour in sorted(set(colours))]


def _joined(flows: Sequence[Flow]) -> Flow:
    """Flows that neither move nor read what others move, as one."""
    increment, force = (
        tuple(total(entries) for entries in zip(*listed, strict=True))
        for listed in ([f.increment for f in flows], [f.force for f in flows])
    )
    return Flow(ZERO, increment, "; ".join(f.manner for f in flows), force=force)


def _damped_block(system: System, damping: Expression, block: Sequence[int]) -> Iterator[Flow]:
    """The flows of λππb for the components of b in a block of π."""
    slopes = gradient(system.hamiltonian, system.coordinates)
    ring = ring_of(system, slopes)
    own = [v for v in ring.state if ring.tower.depends_on(ring.tower.gens[v], [system.coordinates[i] for i in block])]
    still, rest = [ZERO] * system.dimension, [ZERO] * system.dimension
    for i in block:
        parts = ring.terms(ring.tower.convert(slopes[i]), own)
        still[i] = ring.expression(parts.pop((0,) * len(ring.tower.gens), ring.tower.zero))
        rest[i] = total(ring.expression(c * ring.monomial(m)) for m, c in parts.items())
    single = [[e if k == i else ZERO for k in range(system.dimension)] for i, e in enumerate(rest)]
    for pieces in ([[a + b for a, b in zip(still, rest, strict=True)]], [still, rest], [still, *single]):
        flows = [_damped(system, damping, b) for b in pieces if any(not e.is_zero for e in b)]
        if all(isinstance(flow, Flow) for flow in flows):
            yield from (flow for flow in flows if isinstance(flow, Flow) and flow.moving)
            return
    reason = next(flow for flow in flows if isinstance(flow, str))
    names = ", ".join(system.coordinates[i] for i in block)
    message = f"scheme splitting: the damping of {names} has no elementary flow: {reason}"
    raise SpecError([Diagnostic(message, system.locations.get(("damping",)), _DAMPING_HINT)])


def _damped(system: System, damping: Expression, b: Sequence[Expression]) -> Flow | str:
    twice = hamiltonian_vector_field(system.poisson, hamiltonian_vector_field(system.poisson, b))
    return _flow(system, tuple(damping * e for e in twice))


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


def _flow(system: System, field: Field, *, numeric: bool = False) -> Flow | str:
    """The flow of a vector field, or why there is none; ``numeric`` admits matrix exponentials."""
    ring = ring_of(system, field)
    found = solved(ring, ring.tower.convert_all(field), numeric=numeric)
    if isinstance(found, str):
        return found
    return Flow(ZERO, tuple(found.increments), found.manner, force=field, exponentials=found.exponentials)
