"""The exact flow of a part of H, as increments of the coordinates.

A part is a sum of terms that commute with one another. If the equations of motion of the part can be solved as a whole,
the solution is the flow. Otherwise the flow is the composition of the flows of the terms. The order of the terms does
not matter, since they commute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

from phigen import progress
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting import exponential, matrices, scalar, small_matrices, spheres
from phigen.splitting.closure import motion_of
from phigen.splitting.euler import EulerMotion
from phigen.splitting.exponential import NoClosedFormError
from phigen.splitting.integrals import reduced
from phigen.splitting.kepler import KeplerMotion
from phigen.splitting.matrices import MatrixExponential
from phigen.splitting.relative import RelativeMotions
from phigen.splitting.ring import TIME, Ring
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute, symbol, symbols_of, topological, total
from phigen.symbolic.remainders import REMAINDERS
from phigen.symbolic.symbols import Symbol
from phigen.symbolic.tower import Poly, Tower

#: Motions with special formulas for their flows. The formulas are proved by identities in independent symbols.
Motion = KeplerMotion | RelativeMotions | EulerMotion

#: Methods for linear equations ẇ = Aw, where A is constant along the flow. CLOSED_FORMS: formulas for exp(tA) for
#: special A. EXPONENTIALS: matrices exp(tA) that are computed as numbers before the steps. SMALL_MATRICES: formulas for
#: exp(tA) for every A with at most four rows, even if A depends on the state. Functions try the methods in this order.
#: The argument ``methods`` is the last method that a function may try.
CLOSED_FORMS, EXPONENTIALS, SMALL_MATRICES = range(3)

#: Text in reports for linear equations that are solved by a matrix exponential, computed before the steps.
BY_MATRIX = "moved by exp(tA), computed before the steps"


@dataclass(frozen=True)
class Term:
    """A term of H, as written by the user and as an element of the ring.

    ``motion`` is set if the term is a Kepler motion or a free rigid body.
    """

    expression: Expression
    element: Poly
    motion: KeplerMotion | EulerMotion | None = None


@dataclass(frozen=True)
class Flow:
    """The flow of ``hamiltonian`` over the time `TIME`, which maps x to x + ``increment``; ``manner`` describes the
    flow in words.

    For the flow of a ``force``, which is a vector field, the Hamiltonian is 0. If the flow is composed of several
    commuting flows, these are listed in ``pieces``. ``motion`` is set for Kepler motions and rigid bodies.
    ``exponentials`` are the matrix exponentials whose entries occur as symbols in the increments.
    """

    hamiltonian: Expression
    increment: tuple[Expression, ...]
    manner: str
    force: tuple[Expression, ...] = field(default=(), kw_only=True)
    motion: Motion | None = field(default=None, kw_only=True)
    pieces: tuple[Flow, ...] = field(default=(), kw_only=True)
    exponentials: tuple[MatrixExponential, ...] = field(default=(), kw_only=True)

    @property
    def letter(self) -> str:
        """The letter that stands for the part in formulas: H, or F for a force."""
        return "F" if self.force else "H"

    @property
    def has_motion(self) -> bool:
        """Whether the flow, or one of its pieces, is a Kepler motion or the motion of a free rigid body."""
        return any(flow.motion for flow in (self, *self.pieces))

    def vector_field(self, system: System) -> tuple[Expression, ...]:
        """Return the vector field whose flow this is: the force, or π∇H for the Hamiltonian H of the part."""
        return self.force or hamiltonian_vector_field(system.poisson, gradient(self.hamiltonian, system.coordinates))

    @property
    def calls_remainders(self) -> bool:
        """Whether the increments contain exponentials of small matrices that depend on the state."""
        return any(e.op in REMAINDERS for e in topological(self.increment))

    @property
    def moving(self) -> int:
        """The number of coordinates that the flow changes."""
        return sum(not e.is_zero for e in self.increment)


class NoFlowError(Exception):
    """Raised if no elementary flow of a term is known; the text is the reason."""

    def __init__(self, term: Term, reason: str) -> None:
        super().__init__(reason)
        self.term, self.reason = term, reason


def flow_of(ring: Ring, terms: Sequence[Term], *, numeric: bool = True) -> Flow:
    """Return the flow of a sum of commuting terms. If phigen does not know the flow of the whole sum, the result is
    composed of flows of single terms or of smaller sums.

    Closed forms are tried first. If ``numeric``, two other methods are tried next: matrix exponentials that are
    computed before the steps, then exponentials of small matrices that depend on the state. Raises `NoFlowError` for
    the first term without a flow.
    """
    motions = [_flow_of_motion(ring, term, term.motion) for term in terms if term.motion]
    if motions:
        remaining = [term for term in terms if not term.motion]
        flows = [*motions, *([flow_of(ring, remaining)] if remaining else [])]
        return flows[0] if len(flows) == 1 else replace(composed(ring.coordinates, flows), pieces=tuple(flows))
    admitted = (CLOSED_FORMS, EXPONENTIALS, SMALL_MATRICES) if numeric else (CLOSED_FORMS,)
    for methods in admitted[:-1]:
        try:
            return _flow_of(ring, terms, methods)
        except NoFlowError:
            continue
    return _flow_of(ring, terms, admitted[-1])


def _flow_of(ring: Ring, terms: Sequence[Term], methods: int) -> Flow:
    whole = joint_flow(ring, terms, methods=methods)
    if isinstance(whole, Flow):
        return whole
    if len(terms) == 1:
        raise NoFlowError(terms[0], whole)
    steps: list[tuple[list[Term], Flow]] = []
    with progress.stage("flows of terms", len(terms)) as running:
        for running.done, term in enumerate(terms):
            if steps:
                joint = joint_flow(ring, [*steps[-1][0], term], methods=methods)
                if isinstance(joint, Flow):
                    steps[-1] = ([*steps[-1][0], term], joint)
                    continue
            alone = joint_flow(ring, [term], methods=methods)
            if not isinstance(alone, Flow):
                raise NoFlowError(term, alone)
            steps.append(([term], alone))
    return composed(ring.coordinates, [flow for _, flow in steps])


def _flow_of_motion(ring: Ring, term: Term, motion: KeplerMotion | EulerMotion) -> Flow:
    """Return the flow of ``term``, which is the Hamiltonian of a Kepler motion or of a free rigid body."""
    return Flow(term.expression, tuple(motion.increments(ring.coordinates)), motion.manner, motion=motion)


def composed(coordinates: Sequence[str], flows: Sequence[Flow]) -> Flow:
    """Return the composition of commuting flows.

    Flows that change few coordinates come first, so that later flows read few changed coordinates.
    """
    ordered = sorted(flows, key=lambda f: f.moving)
    so_far: list[Expression] = [ZERO] * len(coordinates)
    for flow in ordered:
        point = {c: symbol(c) + e for c, e in zip(coordinates, so_far, strict=True) if not e.is_zero}
        so_far = [e + m for e, m in zip(so_far, substitute(flow.increment, point), strict=True)]
    manner = "; then ".join(f.manner for f in ordered)
    factors = tuple(ordered) if len(ordered) > 1 else ()
    exponentials = tuple(e for f in ordered for e in f.exponentials)
    hamiltonian = total(f.hamiltonian for f in ordered)
    return Flow(hamiltonian, tuple(so_far), manner, pieces=factors, exponentials=exponentials)


def joint_flow(ring: Ring, terms: Sequence[Term], *, linear: bool = False, methods: int = CLOSED_FORMS) -> Flow | str:
    """Return the flow of a sum of terms, or the reason why phigen finds none. The equations of motion of the sum are
    solved as a whole.

    If ``linear``, only linear equations are solved. Their solutions have full relative precision even for small
    coordinates. Other solutions may compute a coordinate as the difference of a constant sum and other coordinates,
    with a lower relative precision. ``methods`` is `CLOSED_FORMS`, `EXPONENTIALS` or `SMALL_MATRICES`.
    """
    g = total(t.expression for t in terms)
    field = ring.field(ring.tower.combine(t.element for t in terms))
    solution = solved(ring, field, linear=linear, methods=methods)
    if isinstance(solution, str):
        return solution
    moving = {c for c, e in zip(ring.coordinates, solution.increments, strict=True) if not e.is_zero}
    if any(e.op == "sign" and not moving.isdisjoint(symbols_of(e)) for e in topological(solution.increments)):
        return "the flow crosses a kink, such as that of abs(q) at q = 0"
    return Flow(g, tuple(_as_written(ring, g, solution)), solution.manner, exponentials=solution.exponentials)


@dataclass(frozen=True)
class Solved:
    """The solution of the equations of a vector field: increments, a description in words, and the matrix exponentials.

    ``shifted`` has the indices of the coordinates that move at a constant rate.
    """

    increments: list[Expression]
    manner: str
    shifted: tuple[int, ...]
    exponentials: tuple[MatrixExponential, ...] = ()


def solved(ring: Ring, field: Sequence[Poly], *, linear: bool = False, methods: int = CLOSED_FORMS) -> Solved | str:
    """Return the increments along a vector field, or the reason why phigen finds no formulas for them.

    The vector field need not be Hamiltonian. Linear first integrals are substituted as constants if that leads to a
    solution. The arguments ``linear`` and ``methods`` are explained at `joint_flow`.
    """
    direct = _increments(ring, field, linear)
    if not isinstance(direct, str):
        return direct
    alternative = None if linear else _nonlinear(ring, field)
    if alternative is None and methods > CLOSED_FORMS:
        numerical = _increments(ring, field, linear, methods)
        alternative = None if isinstance(numerical, str) else numerical
    return alternative or direct


def _nonlinear(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """Return the increments along a vector field by methods for nonlinear equations, or None if no method applies.

    The methods use first integrals, a common factor of all rates, or a closed form on spheres.
    """
    return _with_integrals(ring, field) or _with_common_factor(ring, field) or _on_sphere(ring, field)


def _on_sphere(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """Return the increments along a vector field whose flow on spheres has a closed form, else None."""
    solution = spheres.solve(ring, field)
    if solution is None:
        return None
    increments, manner = solution
    names = ", ".join(ring.coordinates[i] for i in increments)
    return Solved([increments.get(i, ZERO) for i in range(len(field))], f"{names} {manner}", ())


def _increments(ring: Ring, field: Sequence[Poly], linear: bool = False, methods: int = CLOSED_FORMS) -> Solved | str:
    """Return the increments along a vector field, or the reason why there is no solution. First integrals are not used.

    Linear equations are solved by the given ``methods``; unless ``linear``, equations of a single coordinate are solved
    too.
    """
    motion = motion_of(ring, field)
    increments: list[Expression] = [ZERO] * len(ring.coordinates)
    manners: dict[str, list[int]] = {}
    exponentials: list[MatrixExponential] = []
    for i, rate in motion.other.items():
        solution_of_one = None if linear else scalar.solve(ring, i, rate, motion.moving)
        if solution_of_one is None:
            return f"phigen cannot solve the equation of {ring.coordinates[i]} along its flow, which is not linear"
        increments[i] = solution_of_one.increments[0]
        manners.setdefault(solution_of_one.manner, []).append(i)
    for equations in motion.linear:
        try:
            solution = exponential.solve(ring, equations)
        except NoClosedFormError as error:
            static = matrices.solve(ring, equations) if methods >= EXPONENTIALS else None
            if static:
                increments = _with_replacements(increments, equations.coordinates, static.increments)
                manners.setdefault(BY_MATRIX, []).extend(equations.coordinates)
                exponentials.append(static.exponential)
                continue
            closed_form = small_matrices.solve(ring, equations) if methods >= SMALL_MATRICES else None
            if closed_form:
                increments = _with_replacements(increments, equations.coordinates, closed_form.increments)
                manners.setdefault(closed_form.manner, []).extend(equations.coordinates)
                continue
            names = ", ".join(ring.coordinates[i] for i in equations.coordinates)
            return f"phigen has no closed form for the motion of {names} along its flow: {error}"
        increments = _with_replacements(increments, equations.coordinates, solution.increments)
        manners.setdefault(solution.manner, []).extend(equations.coordinates)
    descriptions = [
        f"{', '.join(ring.coordinates[i] for i in changed_indices)} {manner}"
        for manner, changed_indices in manners.items()
    ]
    shifted = tuple(manners.get(exponential.SHIFTED, ()))
    return Solved(increments, "; ".join(descriptions) or "nothing moves", shifted, tuple(exponentials))


def _with_replacements(
    increments: Sequence[Expression], places: Sequence[int], values: Sequence[Expression]
) -> list[Expression]:
    """Return a list of increments in which the increments with the indices ``places`` are replaced by ``values``."""
    replacements = dict(zip(places, values, strict=True))
    return [replacements.get(i, e) for i, e in enumerate(increments)]


def _with_integrals(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """Return the increments along a vector field after linear first integrals are substituted as constants; None if
    that fails."""
    smaller = reduced(ring, field)
    solution = None if smaller is None else _increments(smaller.ring, smaller.field)
    if smaller is None or solution is None or isinstance(solution, str):
        return None
    changes = substitute(solution.increments, smaller.integrals)
    change_of = dict(zip(ring.coordinates, changes, strict=True))
    for i, form in smaller.forms.items():
        changes[i] = -substitute([form], change_of)[0]
    names = ", ".join(ring.coordinates[i] for i in smaller.forms)
    return Solved(changes, f"{solution.manner}; {names} by linear integrals", ())


def _with_common_factor(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """Return the increments if all rates have a common factor that is constant along the flow, else None.

    The equations without this factor must have a solution in closed form. There is a factor of this kind if the
    Hamiltonian is a function of a first integral. For instance, the flow of (q² + p²)² rotates (q, p), like the flow of
    q² + p², but with a speed proportional to q² + p².
    """
    moving = [f for f in field if f != 0]
    factor = reduce(lambda a, b: a.gcd(b), moving) if moving else ring.tower.constant(1)
    if factor.is_constant() or not ring.support(factor) or ring.rate(factor, field) != 0:
        return None
    name = Symbol("integral", "factor")
    rates = [symbol(name) * ring.tower.expression(f / factor) for f in field]
    tower = Tower([*(s for s in ring.tower.symbols if s != TIME), name, TIME], rates, ring.tower.variables)
    solution = _increments(replace(ring, tower=tower, poisson=()), tower.convert_all(rates))
    if isinstance(solution, str):
        return None
    return replace(solution, increments=substitute(solution.increments, {name: ring.expression(factor)}), shifted=())


def _as_written(ring: Ring, g: Expression, solution: Solved) -> list[Expression]:
    """Return the increments of a flow of g, in the cheaper of two forms for coordinates that move at a constant rate.

    One form is that of ``solution``, in which polynomials are expanded. The other is t π∇g with g as the user has
    written it, for instance as (x − y)⁴.
    """
    slope = gradient(symbol(TIME) * g, ring.coordinates)
    field = hamiltonian_vector_field(ring.brackets, slope)
    mixed = [field[i] if i in solution.shifted else e for i, e in enumerate(solution.increments)]
    return min(solution.increments, mixed, key=lambda increments: _operations(ring, increments))


def _operations(ring: Ring, increments: Sequence[Expression]) -> int:
    """Return the number of operations whose results depend on the state, in the expressions ``increments``."""
    moving: set[int] = set()
    for e in topological(increments):
        if (e.op == "symbol" and e.value in ring.coordinates) or any(id(a) in moving for a in e.args):
            moving.add(id(e))
    return sum(1 for e in topological(increments) if e.args and id(e) in moving)
