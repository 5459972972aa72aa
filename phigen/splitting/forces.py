"""The flows of forces, which are parts of a splitting in addition to the parts of H.

Forces have the vector field πζ + f, with the covector force ζ and the vector force f. The whole field is one part if
phigen knows its flow, in closed form or by a matrix exponential. Otherwise πζ and f are separate parts. If phigen does
not know the flow of πζ, its summands πζ_i dx_i are parts, one for each component of ζ; if it does not know the flow of
f, the components of f are parts. The field πζ_i dx_i is the Hamiltonian field of x_i times a factor. It is tangent to
the symplectic leaves, so each summand of πζ preserves the Casimirs.

Damping is ζ = λπb with b = ∇H. If phigen does not know the flow of damping, each block of π has flows of its own, for
the field λππb with the components of b in this block. If phigen does not know the flow of this field, b is divided into
two sums: the terms that do not depend on the coordinates of the block, and all other terms. If phigen does not know the
flow for the second sum, each component of the second sum has a flow of its own. Finally, flows of damping are combined
into one part if none of them changes a coordinate that another flow reads.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.blocks import blocks
from phigen.geometry.forces import Forces
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.conflicts import coloured
from phigen.splitting.flow import CLOSED_FORMS, EXPONENTIALS, SMALL_MATRICES, Flow, solved
from phigen.splitting.ring import ring_of
from phigen.symbolic.expression import ZERO, Expression, gradient, symbols_of, total
from phigen.symbolic.readable import shortened

Field = tuple[Expression, ...]

_DAMPING_HINT = (
    "damping of a spin has a flow if H is linear in the spin, or quadratic in one component of the spin; "
    "scheme: series works for every H"
)


def force_flows(system: System) -> tuple[Flow, ...]:
    """Return the flows of the forces of a system, as parts of a splitting; () if there are no forces.

    Raises `SpecError` if a summand of the forces has no flow; the error names the summand.
    """
    if system.forces is None:
        return ()
    forces = system.forces
    tangent = hamiltonian_vector_field(system.poisson, forces.covector)
    field = tuple(a + b for a, b in zip(tangent, forces.vector, strict=True))
    try:
        closed = _closed_flows(system, forces)
    except SpecError:
        common_flow = _flow(system, field, SMALL_MATRICES)
        if isinstance(common_flow, Flow):
            return (common_flow,)
        raise
    common_flow = closed[0] if len(closed) == 1 else _flow(system, field, EXPONENTIALS)
    return (common_flow,) if isinstance(common_flow, Flow) else closed


def _closed_flows(system: System, forces: Forces) -> tuple[Flow, ...]:
    """Return flows of the forces in closed form.

    ζ is the covector force, and f is the vector force. If phigen knows the flow of the whole field πζ + f, this flow is
    the only one. Otherwise the result has flows for πζ and f, or for their summands.
    """
    tangent = hamiltonian_vector_field(system.poisson, forces.covector)
    common_flow = _flow(system, tuple(a + b for a, b in zip(tangent, forces.vector, strict=True)))
    if isinstance(common_flow, Flow):
        return (common_flow,)
    return (
        *_tangent_flows(system, forces, tangent),
        *_summand_flows(system, forces.vector, list(_components(forces.vector)), ("forces", "vector")),
    )


def _tangent_flows(system: System, forces: Forces, tangent: Field) -> tuple[Flow, ...]:
    """Return the flows of πζ, where ζ is the covector force including damping.

    The first of these choices that phigen can solve is used: one flow for the whole field; one flow for each component
    of ζ; flows of the damping, and flows of all other covector forces.
    """
    try:
        covectors = list(_covectors(system, forces.covector))
        return tuple(_summand_flows(system, tangent, covectors, ("forces", "covector"), ("damping",)))
    except SpecError:
        if forces.damping.is_zero:
            raise
    undamped = hamiltonian_vector_field(system.poisson, forces.undamped)
    covectors = list(_covectors(system, forces.undamped))
    return (
        *_damping_flows(system, forces.damping),
        *_summand_flows(system, undamped, covectors, ("forces", "covector")),
    )


def _damping_flows(system: System, damping: Expression) -> list[Flow]:
    """Return the flows of the damping field λππb with b = ∇H, for all blocks of π, combined into few parts."""
    flows = [
        flow for block in blocks(system.coordinates, system.poisson) for flow in _damped_block(system, damping, block)
    ]
    updated = [{k for k, e in enumerate(flow.increment) if not e.is_zero} for flow in flows]
    read_coordinates = [
        {k for k, c in enumerate(system.coordinates) if c in symbols_of(*flow.increment)} for flow in flows
    ]
    neighbours = [
        {
            j
            for j in range(len(flows))
            if j != i and (updated[i] & read_coordinates[j] or updated[j] & read_coordinates[i])
        }
        for i in range(len(flows))
    ]
    colours = coloured(neighbours, updated)
    return [
        _merged_flows([f for f, k in zip(flows, colours, strict=True) if k == colour])
        for colour in sorted(set(colours))
    ]


def _merged_flows(flows: Sequence[Flow]) -> Flow:
    """Return several flows as one flow; none of them may change a coordinate that another flow reads."""
    increment, force = (
        tuple(total(entries) for entries in zip(*vectors, strict=True))
        for vectors in ([f.increment for f in flows], [f.force for f in flows])
    )
    return Flow(ZERO, increment, "; ".join(f.manner for f in flows), force=force)


def _damped_block(system: System, damping: Expression, block: Sequence[int]) -> Iterator[Flow]:
    """Yield the flows of the damping field λππb. λ is the ``damping``, and b is ∇H with zeros outside the ``block``.

    b is divided into summands. The damping field of each summand must have a flow that phigen finds. Divisions into few
    summands are tried first.
    """
    slopes = gradient(system.hamiltonian, system.coordinates)
    ring = ring_of(system, slopes)
    variables = [
        v for v in ring.state if ring.tower.depends_on(ring.tower.gens[v], [system.coordinates[i] for i in block])
    ]
    constant, remainder = [ZERO] * system.dimension, [ZERO] * system.dimension
    for i in block:
        parts = ring.terms(ring.tower.convert(slopes[i]), variables)
        constant[i] = ring.expression(parts.pop((0,) * len(ring.tower.gens), ring.tower.zero))
        remainder[i] = total(ring.expression(c * ring.monomial(m)) for m, c in parts.items())
    single = [[e if k == i else ZERO for k in range(system.dimension)] for i, e in enumerate(remainder)]
    for summands in (
        [[a + b for a, b in zip(constant, remainder, strict=True)]],
        [constant, remainder],
        [constant, *single],
    ):
        flows = [_damped(system, damping, b) for b in summands if any(not e.is_zero for e in b)]
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
    """Yield (name, field πζ_i dx_i) for each component ζ_i of a covector."""
    for i, (c, zeta) in enumerate(zip(system.coordinates, covector, strict=True)):
        if not zeta.is_zero:
            alone = [zeta if k == i else ZERO for k in range(system.dimension)]
            yield f"ζ_{c} = {shortened(zeta)}", hamiltonian_vector_field(system.poisson, alone)


def _components(vector: Sequence[Expression]) -> Iterator[tuple[str, Field]]:
    for i, f in enumerate(vector):
        if not f.is_zero:
            yield f"f = {shortened(f)}", tuple(f if k == i else ZERO for k in range(len(vector)))


def _summand_flows(
    system: System, field: Field, summands: Sequence[tuple[str, Field]], *keys: tuple[str, ...]
) -> Iterator[Flow]:
    """Yield the flow of a field or, if phigen knows no closed form of this flow, the flows of the ``summands`` of the
    field.

    Raises `SpecError` if a summand has no flow; ``keys`` are the keys of the spec at which the error is located.
    """
    common_flow = _flow(system, field) if summands else ""
    if isinstance(common_flow, Flow):
        yield common_flow
        return
    for name, summand in summands:
        flow = _flow(system, summand)
        if not isinstance(flow, Flow):
            message = f"scheme splitting: the force {name} has no elementary flow: {flow}"
            place = next((system.locations[key] for key in keys if key in system.locations), None)
            raise SpecError([Diagnostic(message, place, "scheme: series applies to every force")])
        yield flow


def _flow(system: System, field: Field, methods: int = CLOSED_FORMS) -> Flow | str:
    """Return the flow of a vector field, or the reason why there is none; ``methods`` is explained at `joint_flow`."""
    ring = ring_of(system, field)
    solution = solved(ring, ring.tower.convert_all(field), methods=methods)
    if isinstance(solution, str):
        return solution
    return Flow(ZERO, tuple(solution.increments), solution.manner, force=field, exponentials=solution.exponentials)
