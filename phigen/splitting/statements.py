"""Proofs that a splitting is correct, made anew for each system: the parts sum to H, and each flow solves its equation.

If the flows are exact and composed as in `phigen.scheme.alternation`, a step is a Poisson map, preserves all Casimirs,
and has the order of the composition, whatever the parts are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.flow import Flow, Motion, composed
from phigen.splitting.parts import SplitHamiltonian
from phigen.splitting.ring import KICK, TIME
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    call,
    derivatives,
    fold,
    gradient,
    rebuild,
    sparse_derivatives,
    substitute,
    symbol,
    total,
)
from phigen.symbolic.verdict import Statement, decide_equivalent, decide_zero


def check(system: System, splitting: SplitHamiltonian, noise: Sequence[tuple[str, Flow]] = ()) -> Iterator[Statement]:
    """Yield the statements about a splitting; those about single flows are in the order of the parts.

    In the statements, H is the Hamiltonian minus the gauge. ``noise`` has pairs of the name of a noise source and its
    flow.
    """
    flows = splitting.flows
    hamiltonians = substitute([f.hamiltonian for f in flows], {KICK: ZERO})
    modified = hamiltonians != [f.hamiltonian for f in flows]
    numbered = [(f"{flow.letter}_{k}", flow) for k, flow in enumerate(flows, 1)]
    name = "H = " + " + ".join(n for n, flow in numbered if not flow.force) + " at κ = 0" * modified
    yield decide_zero(name, [("", system.hamiltonian - total(hamiltonians))], system.positive)
    if any(flow.force for flow in flows):
        yield _force_statement(system, numbered)
    for k, flow in enumerate(flows, 1):
        yield _flow_statement(system, flow, k)
    yield from _exponential_statements(system, splitting)
    for source, flow in noise:
        yield replace(_flow_statement(system, flow, 0), name=f"the flow of g of the noise {source}")
    if splitting.kick is not None:
        yield from _kick_statements(system, splitting, hamiltonians)
        for time in system.times:
            v, name = hamiltonians[splitting.kick], f"H_{1 + splitting.kick}"
            rate = bracket(system, v, gradient(v, [time])[0])
            yield decide_zero(f"{{{name}, ∂{name}/∂{time}}} = 0", [("", rate)], system.positive)


def _exponential_statements(system: System, splitting: SplitHamiltonian) -> Iterator[Statement]:
    """Yield statements that the matrix exponentials of the flows agree with rigorous enclosures, for default
    parameters."""
    values = {p.name: float(p.value) for p in system.parameters}
    for k, flow in enumerate(splitting.flows, 1):
        for exponential in flow.exponentials:
            from phigen.splitting.enclosures import enclosed  # imported here, since it needs NumPy

            name = f"exp(tA) of {flow.letter}_{k} to round-off, A with {exponential.size} rows"
            yield enclosed(name, exponential, values)


def _force_statement(system: System, numbered: Sequence[tuple[str, Flow]]) -> Statement:
    """Return the statement that the vector fields of the parts for forces sum to πζ + f, with the covector force ζ and
    the vector force f.
    """
    slope = gradient(system.hamiltonian, system.coordinates)
    force_field = [
        a - b for a, b in zip(system.vector_field(), hamiltonian_vector_field(system.poisson, slope), strict=True)
    ]
    parts = [(name, flow.force) for name, flow in numbered if flow.force]
    sums = [total(entries) for entries in zip(*(force for _, force in parts), strict=True)]
    residuals = [(c, a - b) for c, a, b in zip(system.coordinates, force_field, sums, strict=True)]
    return decide_zero("πζ + f = " + " + ".join(name for name, _ in parts), residuals, system.positive)


def _kick_statements(system: System, splitting: SplitHamiltonian, plain: Sequence[Expression]) -> Iterator[Statement]:
    """Yield the statement {V, {V, {V, T}}} = 0 for H = T + V. For a modified kick, also yield the statement that its
    Hamiltonian is V + κ{V, {V, T}}.

    ``plain`` are the Hamiltonians of the two parts at κ = 0.
    """
    assert splitting.kick is not None
    v, t = plain[splitting.kick], plain[1 - splitting.kick]
    name_v, name_t = f"H_{1 + splitting.kick}", f"H_{2 - splitting.kick}"
    twice = bracket(system, v, bracket(system, v, t))
    name = f"{{{name_v}, {{{name_v}, {{{name_v}, {name_t}}}}}}} = 0"
    yield decide_zero(name, [("", bracket(system, v, twice))], system.positive)
    (multiplied,) = derivatives([splitting.flows[splitting.kick].hamiltonian], KICK)
    if not multiplied.is_zero:
        name = f"d{name_v}/dκ = {{{name_v}, {{{name_v}, {name_t}}}}}"
        yield decide_zero(name, [("", multiplied - twice)], system.positive)


def bracket(system: System, f: Expression, g: Expression) -> Expression:
    """Return {f, g} = ∇f·π∇g."""
    names = system.coordinates
    field = hamiltonian_vector_field(system.poisson, gradient(g, names))
    return total(a * b for a, b in zip(gradient(f, names), field, strict=True))


def angles_added(e: Expression) -> Expression:
    """Return an expression in which sin, cos, 1 − cos and exp of sums are expanded by the addition theorems.

    Proofs need the expanded form, since the ring does not contain the addition theorems.
    """

    def visit(node: Expression, args: list[Expression]) -> Expression:
        if args and args[0].op in ("add", "sub"):
            if node.op == "exp":
                return _exponential_of_sum(args[0])
            if node.op in ("sin", "cos", "versin"):
                sine, cosine = _sine_and_cosine_of_sum(args[0])
                return {"sin": sine, "cos": cosine, "versin": ONE - cosine}[node.op]
        return rebuild(node, args)

    return fold([e], visit)[0]


def _exponential_of_sum(e: Expression) -> Expression:
    if e.op not in ("add", "sub"):
        return call("exp", e)
    a, b = e.args[0], e.args[1] if e.op == "add" else -e.args[1]
    return _exponential_of_sum(a) * _exponential_of_sum(b)


def _sine_and_cosine_of_sum(e: Expression) -> tuple[Expression, Expression]:
    if e.op not in ("add", "sub"):
        return call("sin", e), call("cos", e)
    (sin_a, cos_a), (sin_b, cos_b) = map(_sine_and_cosine_of_sum, e.args)
    sin_b = sin_b if e.op == "add" else -sin_b
    return sin_a * cos_b + cos_a * sin_b, cos_a * cos_b - sin_a * sin_b


def _flow_statement(system: System, flow: Flow, k: int) -> Statement:
    """Return the statement that the flow Φ of part k satisfies Φ_0 = 1 and dΦ_t/dt = (π∇H_k)∘Φ_t.

    If the part is a force, its vector field takes the place of π∇H_k. The equation for dΦ_t/dt is not decided if Φ_t
    contains exponentials or the sign of a coordinate. Then the equivalent equation of `_transport_residuals` may be
    proved.
    """
    part, rate = f"{flow.letter}_{k}", f"F_{k}" if flow.force else f"π∇H_{k}"
    name = f"the flow Φ of {part}: Φ_0 = 1, dΦ_t/dt = {rate}∘Φ_t" + ", for exp(tA)" * bool(flow.exponentials)
    forms = [_residuals(system, flow)]
    if not (flow.motion or any(part_flow.motion for part_flow in flow.pieces)):
        forms.append(_transport_residuals(system, flow))
    return decide_equivalent(name, forms, system.positive, flow.manner)


def _residuals(system: System, flow: Flow) -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression; all expressions vanish if a flow is the exact flow of its vector
    field."""
    if any(part_flow.motion for part_flow in flow.pieces):
        yield from _composition_residuals(system, flow)
    elif flow.motion:
        yield from _motion_residuals(system, flow, flow.motion)
    else:
        yield from _equation_residuals(system, flow)


def _composition_residuals(system: System, flow: Flow) -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression for a flow that is composed of pieces.

    All expressions vanish under four conditions. Each piece is an exact flow. The Hamiltonians of the pieces sum to the
    Hamiltonian of the flow. The pieces commute. The increments are those of the composition of the pieces.
    """
    part_flows = flow.pieces
    for part_flow in part_flows:
        yield from _residuals(system, part_flow)
    yield "sum of the pieces", flow.hamiltonian - total(part_flow.hamiltonian for part_flow in part_flows)
    for i, part_flow in enumerate(part_flows):
        for earlier_flow in part_flows[:i]:
            yield "bracket of two pieces", bracket(system, part_flow.hamiltonian, earlier_flow.hamiltonian)
    increment = composed(system.coordinates, part_flows).increment
    for c, a, b in zip(system.coordinates, flow.increment, increment, strict=True):
        yield f"composition for {c}", a - b


def _motion_residuals(system: System, flow: Flow, motion: Motion) -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression for the flow of Kepler motions or of a rigid body.

    All expressions vanish under three conditions. The vector field π∇H of the flow is that of the motion. The
    increments are those of the known formula for this motion. The identities from which this formula is derived are
    true.
    """
    names = system.coordinates
    field = flow.vector_field(system)
    rates = [a - b for a, b in zip(field, motion.field(names), strict=True)]
    yield from zip((f"rate of {c}" for c in names), motion.opaque(rates), strict=True)
    for c, a, b in zip(names, flow.increment, motion.increments(names), strict=True):
        yield f"increment of {c}", a - b
    yield from motion.residuals()


def _equation_residuals(system: System, flow: Flow) -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression; all expressions vanish if Φ_t is the exact flow of its vector
    field X.

    The expressions are the components of Φ_0 − 1 and of dΦ_t/dt − X∘Φ_t.
    """
    names = system.coordinates
    slopes = {name: slope for e in flow.exponentials for name, slope in e.slopes().items()}
    start = substitute(flow.increment, {TIME: ZERO, **dict.fromkeys(slopes, ZERO)})
    rates = _rates(flow.increment, slopes)
    field = flow.vector_field(system)
    point = {c: symbol(c) + e for c, e in zip(names, flow.increment, strict=True) if not e.is_zero}
    required = substitute(field, point)
    yield from ((f"{c} at t = 0", e) for c, e in zip(names, start, strict=True))
    for c, a, b in zip(names, rates, required, strict=True):
        yield f"rate of {c}", angles_added(a) - angles_added(b)


def _transport_residuals(system: System, flow: Flow) -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression; all expressions vanish if Φ_t is the exact flow of its vector
    field X.

    The expressions are the components of Φ_0 − 1 and of dΦ_t/dt − DΦ_t X. Let Φ_t be rows of exp(tA)w, where products
    of coordinates are components of w. Then DΦ_t X is linear in the entries of exp(tA), whereas X∘Φ_t contains products
    of entries. These products are entries too, but a proof without this relation fails.
    """
    names = system.coordinates
    slopes = {name: slope for e in flow.exponentials for name, slope in e.slopes(last=True).items()}
    start = substitute(flow.increment, {TIME: ZERO, **dict.fromkeys(slopes, ZERO)})
    rates, field = _rates(flow.increment, slopes), flow.vector_field(system)
    yield from ((f"{c} at t = 0", e) for c, e in zip(names, start, strict=True))
    for c, rate, speed, row in zip(names, rates, field, sparse_derivatives(flow.increment, names), strict=True):
        transported = total([speed, *(row[n] * v for n, v in zip(names, field, strict=True) if n in row)])
        yield f"rate of {c}", angles_added(rate) - angles_added(transported)


def _rates(increments: Sequence[Expression], slopes: Mapping[str, Expression]) -> list[Expression]:
    """Return the time derivatives of the increments.

    ``slopes`` maps the symbols of the entries of matrix exponentials to the time derivatives of these entries.
    """
    rates = derivatives(increments, TIME)
    if not slopes:
        return rates
    listed = sparse_derivatives(increments, slopes)
    return [
        total([rate, *(d * slopes[name] for name, d in row.items())]) for rate, row in zip(rates, listed, strict=True)
    ]
