"""What makes a splitting right, proved for each build: the parts sum to H, and each flow solves its equation.

With exact flows, composed as in `phigen.scheme.alternation`, a step is a Poisson map, keeps all Casimirs and has the
order of the composition, whatever the parts are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.flow import Flow
from phigen.splitting.parts import Splitting
from phigen.splitting.ring import KICK, TIME
from phigen.symbolic.expression import (
    ZERO,
    Expression,
    call,
    derivatives,
    fold,
    gradient,
    rebuild,
    substitute,
    symbol,
    total,
)
from phigen.symbolic.verdict import Statement, decide_zero


def check(system: System, splitting: Splitting, noise: Sequence[tuple[str, Flow]] = ()) -> Iterator[Statement]:
    """The statements, those on flows in the order of the parts; H is that of the system, any gauge applied.

    ``noise`` are flows of sources by their names.
    """
    flows = splitting.flows
    plain = substitute([f.hamiltonian for f in flows], {KICK: ZERO})
    modified = plain != [f.hamiltonian for f in flows]
    numbered = [(f"{flow.letter}_{k}", flow) for k, flow in enumerate(flows, 1)]
    name = "H = " + " + ".join(n for n, flow in numbered if not flow.force) + " at κ = 0" * modified
    yield decide_zero(name, [("", system.hamiltonian - total(plain))], system.positive)
    if any(flow.force for flow in flows):
        yield _force_statement(system, numbered)
    for k, flow in enumerate(flows, 1):
        yield _flow_statement(system, flow, k)
    for source, flow in noise:
        yield replace(_flow_statement(system, flow, 0), name=f"the flow of g of the noise {source}")
    if splitting.kick is not None:
        yield from _kick_statements(system, splitting, plain)
        for time in system.times:
            v, name = plain[splitting.kick], f"H_{1 + splitting.kick}"
            rate = bracket(system, v, gradient(v, [time])[0])
            yield decide_zero(f"{{{name}, ∂{name}/∂{time}}} = 0", [("", rate)], system.positive)


def _force_statement(system: System, numbered: Sequence[tuple[str, Flow]]) -> Statement:
    """The force parts are πζ + f together."""
    slope = gradient(system.hamiltonian, system.coordinates)
    pushed = [
        a - b for a, b in zip(system.vector_field(), hamiltonian_vector_field(system.poisson, slope), strict=True)
    ]
    parts = [(name, flow.force) for name, flow in numbered if flow.force]
    sums = [total(entries) for entries in zip(*(force for _, force in parts), strict=True)]
    residuals = [(c, a - b) for c, a, b in zip(system.coordinates, pushed, sums, strict=True)]
    return decide_zero("πζ + f = " + " + ".join(name for name, _ in parts), residuals, system.positive)


def _kick_statements(system: System, splitting: Splitting, plain: Sequence[Expression]) -> Iterator[Statement]:
    """{V, {V, {V, T}}} = 0, and that {V, {V, T}} is what κ multiplies."""
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
    """{f, g} = ∇f·π∇g."""
    names = system.coordinates
    field = hamiltonian_vector_field(system.poisson, gradient(g, names))
    return total(a * b for a, b in zip(gradient(f, names), field, strict=True))


def angles_added(e: Expression) -> Expression:
    """sin, cos and exp of sums and differences by the addition theorems, which the ring does not know."""

    def visit(node: Expression, args: list[Expression]) -> Expression:
        if node.op not in ("sin", "cos", "exp") or args[0].op not in ("add", "sub"):
            return rebuild(node, args)
        a, b = args[0].args[0], args[0].args[1] if args[0].op == "add" else -args[0].args[1]
        if node.op == "exp":
            return call("exp", a) * call("exp", b)
        (sin_a, cos_a), (sin_b, cos_b) = ((call("sin", v), call("cos", v)) for v in (a, b))
        return sin_a * cos_b + cos_a * sin_b if node.op == "sin" else cos_a * cos_b - sin_a * sin_b

    return fold([e], visit)[0]


def _flow_statement(system: System, flow: Flow, k: int) -> Statement:
    """Φ_0 = 1 and dΦ_t/dt = (π∇H_k)∘Φ_t; or with a force for π∇H_k."""
    names = system.coordinates
    start = substitute(flow.increment, {TIME: ZERO})
    rates = derivatives(flow.increment, TIME)
    field = flow.vector_field(system)
    point = {c: symbol(c) + e for c, e in zip(names, flow.increment, strict=True) if not e.is_zero}
    required = substitute(field, point)
    residuals = [(f"{c} at t = 0", e) for c, e in zip(names, start, strict=True)]
    residuals += [(f"rate of {c}", a - angles_added(b)) for c, a, b in zip(names, rates, required, strict=True)]
    part, rate = f"{flow.letter}_{k}", f"F_{k}" if flow.force else f"π∇H_{k}"
    name = f"the flow Φ of {part}: Φ_0 = 1, dΦ_t/dt = {rate}∘Φ_t"
    return decide_zero(name, residuals, system.positive, flow.manner)
