"""Search for a certificate: division of the domain into boxes, and boxes that contain the unknowns of the step.

The argument c of functions is the result of `described`, a certificate without boxes and bounds.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from flint import arb, ctx

from phigen import progress
from phigen._version import __version__
from phigen.certify.checker import (
    BALL,
    BITS,
    Evaluation,
    RefusedError,
    centred,
    demand,
    digest,
    interval,
    mag,
    run_of,
    step,
)
from phigen.certify.reader import read
from phigen.certify.stages import CARRY, stages_of

#: Largest number of attempts to find a box that provably contains the unknowns of an implicit step.
PASSES = 8

#: Factor by which the box of unknowns is wider than its estimate. A smaller factor needs more attempts; with a larger
#: factor it is harder to prove that the iteration contracts.
GROWTH = 1.25

#: Largest compensation term after a Gauss step, in units of 2^-53 times the largest absolute value of the coordinate.
#: The term is the sum of two rounding errors: that of the state, at most 1 unit, and that of the change of the state,
#: at most 2 units. The rest is a margin.
GAUSS_CARRY = 3.03

#: In a Gauss step, each unknown has a bound for the distance of its iterates from the solution. All bounds are at least
#: this fraction of the largest bound, since each iteration couples all unknowns.
LEAST_REACH = 0.05

#: The C may compute derivatives by difference quotients, at points near an iterate. Then the bound for the distance of
#: each unknown from the solution is enlarged by this fraction of the unknown, so that it covers these points too.
DIFFERENCES = arb(2) ** -20

#: Largest number of bisections of a box; its volume is then 2^-40 of the volume of the domain.
MAX_DEPTH = 40

Box = Sequence[Sequence[float]]


class NoCertificateError(RefusedError):
    """Error if no certificate was found; ``hint`` tells the user what to change."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True)
class StepProblem:
    """Problem to be certified: a solver in C, its parameters, and a domain of states and times.

    ``text`` is the C; ``members`` maps names of parameters in C to those of the spec. With a monitor, ``gauge``
    contains one number, the energy level e. Otherwise ``gauge`` contains the multiples of Casimirs that are subtracted
    from H. ``ulps`` is a bound for the errors of functions of libm. A certificate with an error bound above ``within``
    is not accepted. ``ulps`` and ``within`` are in units in the last place. ``timed`` says that steps depend on the
    time.
    """

    name: str
    text: str
    step: float
    parameters: Mapping[str, float]
    members: Mapping[str, str]
    gauge: Sequence[float]
    domain: Box
    time: Sequence[float]
    coordinates: Sequence[str]
    ulps: float = 1.0
    within: float = math.inf
    timed: bool = False


def described(problem: StepProblem, exact: bool = False) -> dict[str, Any]:
    """Return the entries of a certificate other than boxes and bounds: the problem, and the operations of a
    step.

    With ``exact``, the operations are those of the map that the step approximates. Steps along paths use Taylor series;
    with ``exact``, the series have the largest number of terms that the C ever computes. Raises `RefusedError` for C
    that certificates do not cover.
    """
    facts = read(problem.text, problem.name)
    numbers = {
        "step": problem.step,
        "parameters": dict(problem.parameters),
        "gauge": list(problem.gauge),
    }
    box = [interval(d) for d in problem.domain]
    facts = {**facts, **numbers, "members": problem.members, "start": sum(problem.time) / 2}
    return {
        "phigen": __version__,
        "name": problem.name,
        "c_sha256": hashlib.sha256(problem.text.encode()).hexdigest(),
        **numbers,
        "coordinates": list(problem.coordinates),
        "timed": problem.timed,
        "domain": [list(d) for d in problem.domain],
        "time": list(problem.time),
        "ulps": problem.ulps,
        "carry": GAUSS_CARRY if facts["kind"] == "gauss" else CARRY,
        "kind": facts["kind"],
        "series": facts["series"],
        "stages": stages_of(facts, problem.text, problem.name, box, exact),
    }


@contextmanager
def precise() -> Iterator[None]:
    """Context in which interval arithmetic has a precision of `BITS` bits."""
    previous_precision, ctx.prec = ctx.prec, BITS
    try:
        yield
    finally:
        ctx.prec = previous_precision


def certified(problem: StepProblem, max_boxes: int) -> dict[str, Any]:
    """Return the certificate of a problem. Raises `RefusedError` if no certificate with at most ``max_boxes`` boxes is
    found."""
    certificate = described(problem)
    with precise(), progress.stage(f"{problem.name}: boxes of the certificate") as running:
        leaves = list[tuple[list[float], list[float]]]()
        search = _Search(certificate, problem.within, max_boxes, leaves, [], running)
        tree = search.tree([*certificate["domain"], certificate["time"]])
    largest_bounds, largest = (
        [max(column) for column in zip(*parts, strict=True)] for parts in zip(*leaves, strict=True)
    )
    ulps = [b / math.ulp(x) for b, x in zip(largest_bounds, largest, strict=True)]
    certificate |= {"bound": largest_bounds, "bound_in_ulps": ulps, "boxes": len(leaves), "tree": tree}
    return {**certificate, "sha256": digest(json.loads(json.dumps(certificate)))}


@dataclass(frozen=True)
class _Search:
    """Search for a certificate: bisection of the domain, until the error bounds on each box are at most ``within``."""

    certificate: dict[str, Any]
    within: float
    max_boxes: int
    # for each box with a proof: error bounds, and largest absolute values of the coordinates
    leaves: list[tuple[list[float], list[float]]]
    divided: list[int]  # depth of each box that was divided
    running: progress.Stage

    def tree(self, domain: Box, depth: int = 0) -> dict[str, Any]:
        """Return the proof for a box as a tree. If no proof for the whole box is found, the tree has proofs for its two
        halves.

        Raises `RefusedError` if no proof is found.
        """
        c = self.certificate
        *X, T = [interval(d) for d in domain]
        self.running.done += 1
        try:
            leaf = _leaf(c, X, T)
            bounds, image = step(c, X, T, leaf)
            bounds_above = [math.nextafter(float(mag(b)), math.inf) for b in bounds]
            largest = [max(float(mag(x)), float(mag(y))) for x, y in zip(X, image, strict=True)]
            ulps = max(b / math.ulp(x) for b, x in zip(bounds_above, largest, strict=True))
            demand(ulps <= self.within, f"the bound is {ulps:.3g} ulp, more than the accepted {self.within:g} ulp")
            self.leaves.append((bounds_above, largest))
            return leaf
        except (RefusedError, ZeroDivisionError, ValueError) as failure:
            axis = _widest(domain)
            if depth >= MAX_DEPTH or len(self.divided) >= self.max_boxes - 1 or axis is None:
                raise _refusal(c, domain, failure, len(self.leaves)) from None
        self.divided.append(depth)
        low, high = [list(d) for d in domain], [list(d) for d in domain]
        middle = low[axis][1] = high[axis][0] = (domain[axis][0] + domain[axis][1]) / 2
        return {"axis": axis, "at": middle, "parts": [self.tree(part, depth + 1) for part in (low, high)]}


def _refusal(c: dict[str, Any], domain: Box, failure: Exception, box_count: int) -> NoCertificateError:
    names = [*c["coordinates"], "the time"]
    box = ", ".join(f"{n} in [{a:.6g}, {b:.6g}]" for n, (a, b) in zip(names, domain, strict=True) if (a, b) != (0, 0))
    reason = "a matrix may be singular" if isinstance(failure, ZeroDivisionError) else str(failure)
    message = f"no certificate after {box_count} boxes: {reason}, for {box}"
    return NoCertificateError(message, "take a smaller box, a smaller step, or more boxes by --boxes")


def _widest(domain: Box) -> int | None:
    """Return the index of the axis to be bisected; None if doubles cannot divide the box further."""
    widths = [(b - a) / max(abs(a), abs(b), 1.0) for a, b in domain]
    axis = max(range(len(domain)), key=widths.__getitem__)
    return axis if widths[axis] > 1e-12 else None


def _ends(x: Any) -> list[float]:
    """Return the lower and the upper end of an interval as doubles, rounded outwards."""
    low, high = math.nextafter(float(x.lower()), -math.inf), math.nextafter(float(x.upper()), math.inf)
    return [low, high]


def _leaf(c: dict[str, Any], X: list[Any], T: Any) -> dict[str, Any]:
    """Return the proof data for the states in X and times in T, for each stage of the step.

    The data of an implicit stage are a box for the unknowns and bounds for the distance of iterates from the solution.
    If the stage follows paths, a box for the paths is added.
    """
    parts, image = list[dict[str, Any]](), X
    for stage in c["stages"]:
        parts.append(_implicit_part(c, stage, image, T) if "equation" in stage else {})
        _, image = step({**c, "stages": [stage]}, image, T, {"stages": parts[-1:]})
        image = [x + BALL * arb(2) ** -40 * mag(x) for x in image]
    return {"stages": parts}


def _implicit_part(c: dict[str, Any], stage: dict[str, Any], X: list[Any], T: Any) -> dict[str, Any]:
    """Return the proof data of an implicit stage.

    The unknowns u of the stage solve u = b − d(u). The operations of the stage compute d, and b is the state or 0. The
    proof data are a box that contains u, and bounds for the distance of iterates from u. A new box is computed from the
    last one until the proof succeeds. Raises `RefusedError` if `PASSES` attempts fail.
    """
    base = X if stage["based"] else [arb(0)] * len(stage["equation"])
    start = run_of(c, stage, X, T, {}, base, exact=True)
    box = base if stage["based"] else [start.x[k] for k in stage["start"]]
    refusal: Exception = RefusedError("no enclosure of the solution was found")
    for _ in range(PASSES):
        run = run_of(c, stage, X, T, {}, box, exact=True)
        d = [run.x[k] for k in stage["equation"]]
        residuals = [mag(v) for v in centred(c, stage, X, T, {}, box, run, "away").entries()]
        if not stage["matrix"]:
            residuals = [a.max(LEAST_REACH * max(residuals)) for a in residuals]
        residuals = (
            [a + DIFFERENCES * mag(v) for a, v in zip(residuals, d, strict=True)]
            if "difference" in stage
            else residuals
        )
        radii = [GROWTH * (a + 0.1 * arb(b.rad())) for a, b in zip(residuals, base, strict=True)]
        box = [b - v + BALL * (r + arb(2) ** -25 * mag(b - v)) for b, v, r in zip(base, d, radii, strict=True)]
        reach = [float(1.01 * a + arb(2) ** -27 * mag(u)) for a, u in zip(residuals, box, strict=True)]
        part: dict[str, Any] = {"u": [_ends(v) for v in box], "reach": reach}
        box = [interval(v) for v in part["u"]]
        try:
            if "path" in stage:
                part["path"] = _path_box(c, stage, X, T, box)
            step({**c, "stages": [stage]}, X, T, {"stages": [part]})
        except (RefusedError, ZeroDivisionError) as failure:
            refusal = failure
            continue
        return part
    raise refusal


def _path_box(c: dict[str, Any], stage: dict[str, Any], X: list[Any], T: Any, u: list[Any]) -> list[list[float]]:
    """Return a box, found by Picard's iteration, that should contain all paths from states in X with unknowns in u."""
    P = X
    for _ in range(PASSES):
        run = Evaluation(c, stage["path"]["operations"], {"m": P, "u": u, "t": [T]})
        moves = [arb(0).union(run.x[k]) for k in stage["path"]["field"]]
        P = [x + v + BALL * (0.05 * mag(v) + arb(2) ** -25 * mag(x)) for x, v in zip(X, moves, strict=True)]
    return [_ends(v) for v in P]
