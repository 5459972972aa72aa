"""Tests whether the formulas of a system are defined: they must not divide by 0, and must have values at some
points.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction

from phigen.geometry.system import System
from phigen.symbolic.expression import Expression, symbols_of, topological
from phigen.symbolic.numeric import DomainError, evaluate
from phigen.symbolic.readable import shortened
from phigen.symbolic.verdict import REFUTED, UNDECIDED, Statement, decide_zero, sample_point

#: POINTS is the number of sample points. Their coordinates are multiplied by each of the SCALES in turn, which gives
#: points of size 1, points near 0 and points far away.
POINTS = 64
SCALES = (Fraction(1), Fraction(1, 32), Fraction(30))
#: An expression with a larger absolute value is certainly not 0: the rounding errors of an expression that is 0 are
#: much smaller.
_NONZERO = 1e-6

Point = Mapping[str, float]


def undefined_parts(system: System, starts: Sequence[Point]) -> Iterator[Statement]:
    """Yield a statement for each part of a system that seems to be undefined everywhere.

    The parts are H, π, the forces, the noise, and each Casimir and invariant. ``starts`` has the values of coordinates
    and parameters at the starts of runs. The statement that a part is defined is refuted if the part divides by 0. If
    the part has no value at any of the sample points and starts, the statement is refuted too, or undecided if there
    are no starts.
    """
    for name, roots in _parts(system).items():
        divisor = _divided_by_zero(roots, system.positive)
        if divisor:
            yield Statement(f"{name} is defined", REFUTED, divisor)
        elif not _has_value(roots, system.positive, starts):
            evidence = f"no value at any of {len(SCALES) * POINTS} points"
            reason = f"{evidence}, nor where a run starts" if starts else evidence
            yield Statement(f"{name} is defined", REFUTED if starts else UNDECIDED, reason)


def undefined_starts(system: System, starts: Mapping[str, Point]) -> Iterator[Statement]:
    """Yield a statement for each run that starts where some part of the system has no value.

    ``starts`` maps the name of a run to its start.
    """
    parts = _parts(system)
    for run, point in starts.items():
        undefined = [name for name, roots in parts.items() if not _is_defined(roots, point)]
        if undefined:
            yield Statement(start_is_defined(run), UNDECIDED, f"no value of {', '.join(undefined)} there")


def start_is_defined(run: str) -> str:
    """Return the name of the statement that all formulas have values at the start of a run."""
    return f"everything is defined where {run} starts"


def _parts(system: System) -> dict[str, Sequence[Expression]]:
    """Return the parts of a system (H, forces, noise, π, each Casimir, each invariant) as lists of expressions, by
    name.
    """
    parts: dict[str, Sequence[Expression]] = {"H": [system.hamiltonian]}
    if system.forces:
        parts["the force"] = [*system.forces.covector, *system.forces.vector]
    parts |= {f"the noise {s.name}": [s.hamiltonian, s.amplitude] for s in system.noise}
    parts["π"] = [e for row in system.poisson for e in row]
    return parts | {name: [e] for name, e in (*system.casimirs.items(), *system.invariants.items())}


def _divided_by_zero(roots: Sequence[Expression], positive: Collection[str]) -> str:
    """Return a text that names a divisor, or the argument of a logarithm, that is 0 everywhere; "" if there is none."""
    for e in topological(list(roots)):
        if e.op == "log" or (e.op == "pow" and e.value < 0):
            (argument,) = e.args
            if _may_be_zero(argument, positive):
                statement = decide_zero("", [("", argument)], positive)
                if statement.holds:
                    operation = "the logarithm of" if e.op == "log" else "a division by"
                    return f"{operation} {shortened(argument)}, which is 0: {statement.verdict}"
    return ""


def _may_be_zero(e: Expression, positive: Collection[str]) -> bool:
    """Whether an expression may be 0 everywhere: at a sample point, the value of the expression is 0 up to rounding."""
    names = symbols_of(e)
    for k in range(POINTS):
        try:
            (value,) = evaluate([e], {n: float(v) for n, v in sample_point(names, positive, k).items()})
        except DomainError:
            continue
        return abs(value) < _NONZERO
    return False


def _has_value(roots: Sequence[Expression], positive: Collection[str], starts: Sequence[Point]) -> bool:
    names = symbols_of(*roots)
    sampled = (
        {name: float(scale * value) for name, value in sample_point(names, positive, k).items()}
        for scale in SCALES
        for k in range(POINTS)
    )
    return any(_is_defined(roots, point) for point in (*starts, *sampled))


def _is_defined(roots: Sequence[Expression], point: Point) -> bool:
    try:
        evaluate(roots, point)
    except DomainError:
        return False
    return True
