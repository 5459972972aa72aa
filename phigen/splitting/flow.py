"""The exact flow of one part of H, as increments of the coordinates.

A part is a sum of terms that commute with one another. If the joint equations of motion have a closed form, that is the
flow; otherwise it is the composition of the flows of the terms, in any order, since they commute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

from phigen import progress
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.splitting import exponential, matrices, scalar, spheres
from phigen.splitting.closure import motion_of
from phigen.splitting.exponential import NoClosedFormError
from phigen.splitting.integrals import reduced
from phigen.splitting.kepler import KeplerMotion
from phigen.splitting.matrices import MatrixExponential
from phigen.splitting.ring import TIME, Ring
from phigen.symbolic.expression import ZERO, Expression, gradient, substitute, symbol, symbols_of, topological, total
from phigen.symbolic.symbols import Symbol
from phigen.symbolic.tower import Poly, Tower

#: The manner of a linear motion with a matrix exponential.
BY_MATRIX = "moved by exp(tA), computed before the steps"


@dataclass(frozen=True)
class Term:
    """A term of H, as the user wrote it and in the ring; ``motion`` is what it is, if it is a Kepler motion."""

    expression: Expression
    element: Poly
    motion: KeplerMotion | None = None


@dataclass(frozen=True)
class Flow:
    """The flow of ``hamiltonian`` for the time `TIME`: x + ``increment``; ``manner`` says how the coordinates move.

    Or that of a ``force``, a vector field; then the Hamiltonian is 0. ``pieces`` are the commuting flows that it is
    composed of, if there are several; one that is alone a ``motion`` has no pieces. ``exponentials`` are the matrices
    whose entries are in the increments, as symbols.
    """

    hamiltonian: Expression
    increment: tuple[Expression, ...]
    manner: str
    force: tuple[Expression, ...] = field(default=(), kw_only=True)
    motion: KeplerMotion | None = field(default=None, kw_only=True)
    pieces: tuple[Flow, ...] = field(default=(), kw_only=True)
    exponentials: tuple[MatrixExponential, ...] = field(default=(), kw_only=True)

    @property
    def letter(self) -> str:
        """What it is called in formulas: H, or F."""
        return "F" if self.force else "H"

    @property
    def has_motion(self) -> bool:
        """Whether it is a Kepler motion, or some of its pieces are."""
        return any(flow.motion for flow in (self, *self.pieces))

    def vector_field(self, system: System) -> tuple[Expression, ...]:
        """The vector field that it is the flow of."""
        return self.force or hamiltonian_vector_field(system.poisson, gradient(self.hamiltonian, system.coordinates))

    @property
    def moving(self) -> int:
        """The number of coordinates that move."""
        return sum(not e.is_zero for e in self.increment)


class NoFlowError(Exception):
    """A term has no elementary flow that phigen finds; the text says why."""

    def __init__(self, term: Term, reason: str) -> None:
        super().__init__(reason)
        self.term, self.reason = term, reason


def flow_of(ring: Ring, terms: Sequence[Term], *, numeric: bool = True) -> Flow:
    """The flow of a sum of commuting terms: in closed form, or if there is none and ``numeric`` by matrix exponentials.

    Raises `NoFlowError` for the first term that has neither.
    """
    motions = [_flow_of_motion(ring, term, term.motion) for term in terms if term.motion]
    if motions:
        others = [term for term in terms if not term.motion]
        pieces = [*motions, *([flow_of(ring, others)] if others else [])]
        return pieces[0] if len(pieces) == 1 else replace(composed(ring.coordinates, pieces), pieces=tuple(pieces))
    try:
        return _flow_of(ring, terms, numeric=False)
    except NoFlowError:
        if numeric:
            return _flow_of(ring, terms, numeric=True)
        raise


def _flow_of(ring: Ring, terms: Sequence[Term], *, numeric: bool) -> Flow:
    whole = joint_flow(ring, terms, numeric=numeric)
    if isinstance(whole, Flow):
        return whole
    if len(terms) == 1:
        raise NoFlowError(terms[0], whole)
    steps: list[tuple[list[Term], Flow]] = []
    with progress.stage("flows of terms", len(terms)) as running:
        for running.done, term in enumerate(terms):
            if steps:
                joint = joint_flow(ring, [*steps[-1][0], term], numeric=numeric)
                if isinstance(joint, Flow):
                    steps[-1] = ([*steps[-1][0], term], joint)
                    continue
            alone = joint_flow(ring, [term], numeric=numeric)
            if not isinstance(alone, Flow):
                raise NoFlowError(term, alone)
            steps.append(([term], alone))
    return composed(ring.coordinates, [flow for _, flow in steps])


def _flow_of_motion(ring: Ring, term: Term, motion: KeplerMotion) -> Flow:
    """The flow of a Kepler motion."""
    names = ", ".join(ring.coordinates[i] for i in (*motion.positions, *motion.momenta))
    manner = f"{names} {motion.manner}"
    return Flow(term.expression, tuple(motion.increments(ring.coordinates)), manner, motion=motion)


def composed(coordinates: Sequence[str], flows: Sequence[Flow]) -> Flow:
    """The composition; flows that move least come first, so that the others see coordinates as they were."""
    ordered = sorted(flows, key=lambda f: f.moving)
    so_far: list[Expression] = [ZERO] * len(coordinates)
    for flow in ordered:
        point = {c: symbol(c) + e for c, e in zip(coordinates, so_far, strict=True) if not e.is_zero}
        so_far = [e + m for e, m in zip(so_far, substitute(flow.increment, point), strict=True)]
    manner = "; then ".join(f.manner for f in ordered)
    pieces = tuple(ordered) if len(ordered) > 1 else ()
    exponentials = tuple(e for f in ordered for e in f.exponentials)
    hamiltonian = total(f.hamiltonian for f in ordered)
    return Flow(hamiltonian, tuple(so_far), manner, pieces=pieces, exponentials=exponentials)


def joint_flow(ring: Ring, terms: Sequence[Term], *, linear: bool = False, numeric: bool = False) -> Flow | str:
    """The joint flow of terms, or why there is none; ``linear`` admits only flows of linear equations.

    These keep small coordinates to their own precision, which differences with a constant sum do not. ``numeric``
    admits exponentials of matrices that are computed before the steps.
    """
    g = total(t.expression for t in terms)
    field = ring.field(ring.tower.combine(t.element for t in terms))
    found = solved(ring, field, linear=linear, numeric=numeric)
    if isinstance(found, str):
        return found
    moved = {c for c, e in zip(ring.coordinates, found.increments, strict=True) if not e.is_zero}
    if any(e.op == "sign" and not moved.isdisjoint(symbols_of(e)) for e in topological(found.increments)):
        return "it moves across a kink, as that of abs(q) at q = 0"
    return Flow(g, tuple(_as_written(ring, g, found)), found.manner, exponentials=found.exponentials)


@dataclass(frozen=True)
class Solved:
    """Increments, how the coordinates move, those that move at a constant rate (indices), and matrix exponentials."""

    increments: list[Expression]
    manner: str
    shifted: tuple[int, ...]
    exponentials: tuple[MatrixExponential, ...] = ()


def solved(ring: Ring, field: Sequence[Poly], *, linear: bool = False, numeric: bool = False) -> Solved | str:
    """The increments along a vector field, with linear first integrals put in where they help; or why there are none.

    The field need not be that of a Hamiltonian. ``linear`` and ``numeric`` are those of `joint_flow`.
    """
    found = _solved(ring, field, linear)
    if not isinstance(found, str):
        return found
    other = None if linear else _nonlinear(ring, field)
    if other is None and numeric:
        by_numbers = _solved(ring, field, linear, numeric=True)
        other = None if isinstance(by_numbers, str) else by_numbers
    return other or found


def _nonlinear(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """The increments by methods for equations that are not linear in the coordinates."""
    return _with_integrals(ring, field) or _with_common_factor(ring, field) or _on_sphere(ring, field)


def _on_sphere(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """The same by a closed form on spheres."""
    found = spheres.solve(ring, field)
    if found is None:
        return None
    moved, manner = found
    names = ", ".join(ring.coordinates[i] for i in moved)
    return Solved([moved.get(i, ZERO) for i in range(len(field))], f"{names} {manner}", ())


def _solved(ring: Ring, field: Sequence[Poly], linear: bool = False, *, numeric: bool = False) -> Solved | str:
    """The increments along a vector field, or why there are none."""
    motion = motion_of(ring, field)
    increments: list[Expression] = [ZERO] * len(ring.coordinates)
    manners: dict[str, list[int]] = {}
    exponentials: list[MatrixExponential] = []
    for i, rate in motion.other.items():
        alone = None if linear else scalar.solve(ring, i, rate, motion.moving)
        if alone is None:
            return f"phigen cannot solve the equation of {ring.coordinates[i]} along its flow, which is not linear"
        increments[i] = alone.increments[0]
        manners.setdefault(alone.manner, []).append(i)
    for equations in motion.linear:
        try:
            solution = exponential.solve(ring, equations)
        except NoClosedFormError as error:
            static = matrices.solve(ring, equations) if numeric else None
            if static:
                increments = _placed(increments, equations.coordinates, static.increments)
                manners.setdefault(BY_MATRIX, []).extend(equations.coordinates)
                exponentials.append(static.exponential)
                continue
            names = ", ".join(ring.coordinates[i] for i in equations.coordinates)
            return f"phigen has no closed form for the motion of {names} along its flow: {error}"
        increments = _placed(increments, equations.coordinates, solution.increments)
        manners.setdefault(solution.manner, []).extend(equations.coordinates)
    said = [f"{', '.join(ring.coordinates[i] for i in moved)} {manner}" for manner, moved in manners.items()]
    shifted = tuple(manners.get(exponential.SHIFTED, ()))
    return Solved(increments, "; ".join(said) or "nothing moves", shifted, tuple(exponentials))


def _placed(increments: Sequence[Expression], places: Sequence[int], values: Sequence[Expression]) -> list[Expression]:
    """The increments with those of some coordinates put in."""
    known = dict(zip(places, values, strict=True))
    return [known.get(i, e) for i, e in enumerate(increments)]


def _with_integrals(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """The same with linear first integrals put in as constants."""
    smaller = reduced(ring, field)
    found = None if smaller is None else _solved(smaller.ring, smaller.field)
    if smaller is None or found is None or isinstance(found, str):
        return None
    changes = substitute(found.increments, smaller.integrals)
    along = dict(zip(ring.coordinates, changes, strict=True))
    for i, form in smaller.forms.items():
        changes[i] = -substitute([form], along)[0]
    names = ", ".join(ring.coordinates[i] for i in smaller.forms)
    return Solved(changes, f"{found.manner}; {names} by linear integrals", ())


def _with_common_factor(ring: Ring, field: Sequence[Poly]) -> Solved | None:
    """The same with a common factor of all rates put in as a constant, if it is one along the flow.

    Functions of a first integral move as it does, faster: (q² + p²)² turns q and p by an angle that grows with q² + p².
    """
    moving = [f for f in field if f != 0]
    factor = reduce(lambda a, b: a.gcd(b), moving) if moving else ring.tower.constant(1)
    if factor.is_constant() or not ring.support(factor) or ring.rate(factor, field) != 0:
        return None
    name = Symbol("integral", "factor")
    rates = [symbol(name) * ring.tower.expression(f / factor) for f in field]
    tower = Tower([*(s for s in ring.tower.symbols if s != TIME), name, TIME], rates, ring.tower.variables)
    found = _solved(replace(ring, tower=tower, poisson=()), tower.convert_all(rates))
    if isinstance(found, str):
        return None
    return replace(found, increments=substitute(found.increments, {name: ring.expression(factor)}), shifted=())


def _as_written(ring: Ring, g: Expression, found: Solved) -> list[Expression]:
    """t π∇g of g as it was written, for coordinates that are shifted, where it has fewer operations: (x − y)⁴ has."""
    slope = gradient(symbol(TIME) * g, ring.coordinates)
    written = hamiltonian_vector_field(ring.brackets, slope)
    mixed = [written[i] if i in found.shifted else e for i, e in enumerate(found.increments)]
    return min(found.increments, mixed, key=lambda increments: _operations(ring, increments))


def _operations(ring: Ring, increments: Sequence[Expression]) -> int:
    """Operations on the state."""
    moving: set[int] = set()
    for e in topological(increments):
        if (e.op == "symbol" and e.value in ring.coordinates) or any(id(a) in moving for a in e.args):
            moving.add(id(e))
    return sum(1 for e in topological(increments) if e.args and id(e) in moving)
