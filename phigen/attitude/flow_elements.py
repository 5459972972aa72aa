"""Group elements of the exact flows of parts of H, which rotate a body in a splitting.

A part is written as C + Q + R: a multiple C of a Casimir, Q = ½c|m|² with the angular momentum m, and the remainder R.
The gradients of Q and R must be constant along the flows of Q and R. Then the group element of the flow is exp(t∇Q)
exp(t∇R), times the rotation by C. The rotation by C does not change x, and the durations of the flows in a step add up
to h. So the rotation by C is applied once in a step.

With forces, a monitor, or a time in H, the rotation by C is not uniform. Then the element of each flow has a factor for
C. If the Hamiltonian of a noise source contains a Casimir, the group element for this source has a factor for the
Casimir. If a flow is composed of commuting flows, its element is the product of their elements. Elements of free rigid
bodies are in `phigen.attitude.free_bodies`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, permutations

from phigen.attitude import free_bodies
from phigen.attitude.elements import dot, product, rotated, rotation_by
from phigen.attitude.group import Group, refused
from phigen.attitude.matrices import flow_exponential, product_less_1
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting.euler import EulerMotion
from phigen.splitting.flow import Flow
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    call,
    derivative,
    fold,
    gradient,
    rebuild,
    symbol,
    symbols_of,
    topological,
    total,
)
from phigen.symbolic.readable import shortened
from phigen.symbolic.verdict import PROVED, Statement, decide_zero

#: Largest number of commuting summands of a part for which all orders are tried; 4 summands have 24 orders.
MOST_PIECES = 4


@dataclass(frozen=True)
class Turning:
    """A part of H as a sum of functions whose flows have known group elements.

    The summands are a multiple of a Casimir (``casimir``), other functions (``terms``), and the energies of free rigid
    bodies (``bodies``). The group element of the part is the product of the group elements of all summands. If the flag
    ``put_back`` is set, the factor for ``casimir`` is applied once in a step, else in each flow.
    """

    casimir: Expression
    terms: tuple[Expression, ...]
    put_back: bool = True
    bodies: tuple[EulerMotion, ...] = field(default=(), kw_only=True)

    @property
    def factors(self) -> list[Expression]:
        """The nonzero summands of the part, without free rigid bodies: ``terms``, preceded by ``casimir`` unless
        ``put_back`` is set.
        """
        turning = self.terms if self.put_back else (self.casimir, *self.terms)
        return [e for e in turning if not e.is_zero]

    @property
    def left(self) -> Expression:
        """The summand whose group element is applied once in a step: ``casimir``, or 0 without ``put_back``."""
        return self.casimir if self.put_back else ZERO


def by_angles(system: System, group: Group, flows: Sequence[Flow], *, put_back: bool) -> tuple[Flow, ...]:
    """Return the flows, with increments that are expressed in functions of half the rotation angles.

    The group elements of the flows need the same functions, so that each function is computed only once.
    """
    turning_parts = turnings(system, group, flows, put_back=put_back)
    return tuple(_by_angles(system, group, flow, turning) for flow, turning in zip(flows, turning_parts, strict=True))


def _by_angles(system: System, group: Group, flow: Flow, turning: Turning) -> Flow:
    entries = [e for factor in factor_elements(system, group, turning) for e in factor]
    angles = {e.args[0] for e in topological(entries) if e.op == "sin"}
    squares = {e.args[0] for e in topological(entries) if e.op == "cosroot"}

    def visit(e: Expression, args: list[Expression]) -> Expression:
        for square in squares if e.op in ("sinroot", "cosroot") else ():
            if decide_zero("", [("", args[0] - 4 * square)], system.positive).verdict == PROVED:
                return _of_square(e.op, square)
        for angle in angles if e.op in ("sin", "cos", "versin") else ():
            for sign in (ONE, -ONE):
                same = [("", args[0] - sign * (2 * angle if group.translation else angle))]
                if decide_zero("", same, system.positive).verdict == PROVED:
                    return _of_angle(e.op, sign, angle, double=bool(group.translation))
        return rebuild(e, args)

    return replace(flow, increment=tuple(fold(flow.increment, visit)))


def _of_angle(function: str, sign: Expression, angle: Expression, *, double: bool) -> Expression:
    """Return ``sin``, ``cos`` or ``versin`` of ``sign`` · ``angle`` or, if ``double``, of 2 · ``sign`` · ``angle``.

    The result is written with sin and 1 − cos of the angle. ``versin`` is 1 − cos.
    """
    sine, versine = call("sin", angle), call("versin", angle)
    if double:
        sine, versine = 2 * (sine * (ONE - versine)), 2 * sine**2
    return sign * sine if function == "sin" else versine if function == "versin" else ONE - versine


def _of_square(function: str, square: Expression) -> Expression:
    """Return sinroot(4s) or cosroot(4s), computed from sinroot(s) and cosroot(s). The argument ``square`` is s.

    The functions are sinroot(s) = sin(√s)/√s and cosroot(s) = cos √s; ``function`` is the name of one of them.
    """
    sine = call("sinroot", square)
    return sine * call("cosroot", square) if function == "sinroot" else ONE - 2 * (square * sine**2)


def turnings(system: System, group: Group, flows: Sequence[Flow], *, put_back: bool) -> list[Turning]:
    """Return, for each flow, its part of H as a sum of functions whose flows have known group elements.

    Raises `SpecError` if phigen knows no sum of this kind for a part; the message names the part.
    """
    return [_turning(system, group, flow, f"H_{k}", put_back=put_back) for k, flow in enumerate(flows, 1)]


def _turning(system: System, group: Group, flow: Flow, name: str, *, put_back: bool) -> Turning:
    """Return the part of H that generates ``flow``, as a sum of functions whose flows have known group
    elements.

    In messages, ``name`` stands for the part.
    """
    summands = flow.pieces or (flow,)
    bodies = tuple(summand.motion for summand in summands if isinstance(summand.motion, EulerMotion))
    remaining = [summand.hamiltonian for summand in summands if not isinstance(summand.motion, EulerMotion)]
    h = total(remaining) if bodies else flow.hamiltonian
    pieces_of_h = remaining if bodies or flow.pieces else []
    return replace(turning_of(system, group, h, name, pieces_of_h, put_back=put_back), bodies=bodies)


def turning_of(
    system: System, group: Group, h: Expression, name: str, pieces: Sequence[Expression] = (), *, put_back: bool
) -> Turning:
    """Return the function h as a sum of functions whose flows have known group elements.

    ``pieces`` has commuting functions with the sum h, or is empty. Raises `SpecError` if phigen finds no sum of this
    kind; in the message, ``name`` stands for h.
    """
    orders = permutations(pieces) if len(pieces) <= MOST_PIECES else iter([tuple(pieces)])
    for candidate in chain(_candidates(system, group, h), (Turning(ZERO, order) for order in orders if order)):
        if constancy(system, candidate, "").verdict == PROVED:
            return replace(candidate, put_back=put_back)
    raise refused(
        system,
        f"reconstruct: the part {name} = {shortened(h)} of the splitting rotates about an axis that changes "
        "along its own flow, and phigen knows no group element for that",
        "scheme: series applies to every H",
    )


def _candidates(system: System, group: Group, h: Expression) -> Iterator[Turning]:
    """Yield ways to write h as a sum.

    The first way is h alone. Each other way has two terms: a multiple of a Casimir or of |m|²/2 with the angular
    momentum m, and the rest of h.
    """
    yield Turning(ZERO, (h,))
    if not group.matrices and group.vectors:
        m = [symbol(system.coordinates[i]) for i in group.rotation]
        for c in _curvatures(system, h, dot(m, m) / 2):
            yield Turning(ZERO, (c * (dot(m, m) / 2), h - c * (dot(m, m) / 2)))
    for casimir in system.casimirs.values():
        for c in _curvatures(system, h, casimir):
            yield Turning(c * casimir, (h - c * casimir,))


def _curvatures(system: System, h: Expression, q: Expression) -> Iterator[Expression]:
    """Yield each constant c ≠ 0 for which the second derivative of h − c q with respect to one of the coordinates is 0.

    c may depend on parameters.
    """
    curvatures: list[Expression] = []
    for name in system.coordinates:
        numerator, denominator = (derivative(derivative(e, name), name) for e in (h, q))
        if (
            denominator.is_zero
            or numerator.is_zero
            or any(s in system.coordinates for s in symbols_of(numerator, denominator))
        ):
            continue
        if all(numerator / denominator is not s for s in curvatures):
            curvatures.append(numerator / denominator)
            yield numerator / denominator


def constancy(system: System, turning: Turning, name: str) -> Statement:
    """Return the statement that the gradient of each summand is constant along its flow and the flows of the summands
    before it.

    The summands are those in ``turning.factors``, in this order.
    """
    names, residuals = system.coordinates, list[tuple[str, Expression]]()
    fields = [hamiltonian_vector_field(system.poisson, gradient(f, names)) for f in turning.factors]
    for k, factor in enumerate(turning.factors):
        for c, slope in zip(names, gradient(factor, names), strict=True):
            gradients = gradient(slope, names)
            residuals += [
                (f"along {c}", total(a * b for a, b in zip(gradients, f, strict=True))) for f in fields[: k + 1]
            ]
    return decide_zero(name, residuals, system.positive)


def factor_elements(
    system: System, group: Group, turning: Turning, t: Expression | None = None
) -> list[list[Expression]]:
    """Return the group elements, minus 1, of all summands in ``turning.factors``, and then of the free rigid bodies.

    The group elements are functions of the state before the flow. ``t`` is the duration of the flow, by default the
    symbol of the step size. Raises `SpecError` for matrices whose exponential has no closed form.
    """
    t, elements = t or symbol(TIME), []
    for factor in turning.factors:
        p = [t * slope for slope in gradient(factor, system.coordinates)]
        if group.matrices:
            exponential = flow_exponential(group, p, system.positive)
            if exponential is None:
                message = f"reconstruct: exp(t∇H) has no closed form that phigen knows for the part {shortened(factor)}"
                raise refused(system, message, "scheme: series applies to every H")
            elements.append(exponential)
        else:
            r, shift = [p[i] for i in group.rotation], [p[i] for i in group.translation]
            trivial = all(e.is_zero for e in r)
            elements.append([ZERO] * 4 + shift if trivial else list(rotation_by(r, shift)))
    return [*elements, *(e for body in turning.bodies for e in free_bodies.elements(body, group, t))]


def joined(group: Group, elements: Sequence[Sequence[Expression]]) -> list[Expression]:
    """Return the product of the group elements of successive flows; the arguments and the result are elements minus
    1."""
    leading, *following = elements
    result = list(leading)
    for later in following:
        first, second = (later, result) if group.spatial else (result, later)
        if group.matrices:
            result = product_less_1(first, second)
            continue
        q = [ONE + first[0], *first[1:4]]
        rotation = [a + b + c for a, b, c in zip(first[:4], second[:4], product(first[:4], second[:4]), strict=True)]
        result = [
            *rotation,
            *(a + b for a, b in zip(first[4:], rotated(q, second[4:]) if second[4:] else [], strict=True)),
        ]
    return result
