"""Search for the enclosures of a certificate: boxes of states, of solutions and of unknowns."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from flint import arb, ctx

from phigen._version import __version__
from phigen.certify.checker.contraction import gauss
from phigen.certify.checker.explicit_steps import prepared
from phigen.certify.checker.krawczyk import newton_stage
from phigen.certify.checker.reader import read
from phigen.certify.checker.replay import BITS, KINDS
from phigen.certify.checker.rounding import BALL, RefusedError, Tape, demand, interval, mag, play

#: Passes in which the box of a solution or of the unknowns of stages grows until it is mapped into itself.
PASSES = 8

#: Growth of that box in each pass: less needs more passes, more makes contraction harder to show.
GROWTH = 1.25

#: Bisections after which a box is given up: its parts have 2^-40 of its volume.
MAX_DEPTH = 40

#: Contraction by sweeps that a Gauss solver remembers at least, by which it decides when to stop. Certificates hold
#: while that is so; in runs of the corpus it is between 0.05 and 0.5.
LEAST_RATE = 0.05

Box = Sequence[Sequence[float]]


@dataclass(frozen=True)
class StepProblem:
    """Subject of a certificate: a solver in C with its numbers, and a box of states, with the time last."""

    name: str
    text: str
    step: float
    parameters: Mapping[str, float]
    gauge: Sequence[float]
    domain: Box
    time: Sequence[float]
    coordinates: Sequence[str]
    ulps: float = 1.0
    within: float = math.inf
    timed: bool = False


def described(problem: StepProblem) -> dict[str, Any]:
    """Return the certificate without its boxes and bounds. Raises `RefusedError` for C that is not covered."""
    facts = read(problem.text, problem.name)
    rate = {"rate": LEAST_RATE} if facts["kind"] == "gauss" else {}
    return {
        "phigen": __version__,
        "name": problem.name,
        "c_sha256": hashlib.sha256(problem.text.encode()).hexdigest(),
        "step": problem.step,
        "parameters": dict(problem.parameters),
        "gauge": list(problem.gauge),
        "coordinates": list(problem.coordinates),
        "timed": problem.timed,
        "domain": [list(d) for d in problem.domain],
        "time": list(problem.time),
        "ulps": problem.ulps,
        **rate,
        **facts,
    }


@contextmanager
def precise() -> Iterator[None]:
    """Let balls have `BITS` bits."""
    before, ctx.prec = ctx.prec, BITS
    try:
        yield
    finally:
        ctx.prec = before


def certified(problem: StepProblem, max_boxes: int) -> dict[str, Any]:
    """Return the certificate of a problem. Raises `RefusedError` where none is found within a number of boxes."""
    certificate = described(problem)
    with precise():
        leaves = list[tuple[list[float], list[float]]]()
        search = _Search(certificate, problem.within, max_boxes, leaves, [])
        tree = search.tree([*certificate["domain"], certificate["time"]])
    bound, largest = ([max(column) for column in zip(*parts, strict=True)] for parts in zip(*leaves, strict=True))
    ulps = [b / math.ulp(x) for b, x in zip(bound, largest, strict=True)]
    return {**certificate, "bound": bound, "bound_in_ulps": ulps, "boxes": len(leaves), "tree": tree}


@dataclass(frozen=True)
class _Search:
    """The division of a box into parts in which the bounds hold and are at most ``within`` units in the last place."""

    certificate: dict[str, Any]
    within: float
    max_boxes: int
    leaves: list[tuple[list[float], list[float]]]  # bounds, and largest absolute values of coordinates
    divided: list[int]  # depths of the boxes that were divided

    def tree(self, domain: Box, depth: int = 0) -> dict[str, Any]:
        """Return the tree of the boxes below a box. Raises `RefusedError`."""
        c = self.certificate
        *X, T = [interval(d) for d in domain]
        try:
            leaf = _LEAVES[c["kind"]](c, X, T)
            bounds, image = KINDS[c["kind"]](c, X, T, leaf)
            bound = [math.nextafter(float(mag(b)), math.inf) for b in bounds]
            largest = [max(float(mag(x)), float(mag(y))) for x, y in zip(X, image, strict=True)]
            ulps = max(b / math.ulp(x) for b, x in zip(bound, largest, strict=True))
            demand(ulps <= self.within, f"the bound is {ulps:.3g} ulp where {self.within:g} are asked for")
            self.leaves.append((bound, largest))
            return leaf
        except (RefusedError, ZeroDivisionError, ValueError) as failure:
            axis = _widest(domain)
            if depth >= MAX_DEPTH or len(self.divided) >= self.max_boxes - 1 or axis is None:
                raise _refusal(c, domain, failure, len(self.leaves)) from None
        self.divided.append(depth)
        low, high = [list(d) for d in domain], [list(d) for d in domain]
        at = low[axis][1] = high[axis][0] = (domain[axis][0] + domain[axis][1]) / 2
        return {"axis": axis, "at": at, "parts": [self.tree(part, depth + 1) for part in (low, high)]}


def _refusal(c: dict[str, Any], domain: Box, failure: Exception, done: int) -> RefusedError:
    names = [*c["coordinates"], "the time"]
    box = ", ".join(f"{n} in [{a:.6g}, {b:.6g}]" for n, (a, b) in zip(names, domain, strict=True) if (a, b) != (0, 0))
    reason = "a matrix may be singular" if isinstance(failure, ZeroDivisionError) else str(failure)
    message = f"no certificate after {done} boxes: {reason}, for {box}"
    return RefusedError(message, "a smaller box, a smaller step, or more boxes by --boxes")


def _widest(domain: Box) -> int | None:
    """The axis along which a box is to be divided; None if it is a point, as far as doubles tell."""
    widths = [(b - a) / max(abs(a), abs(b), 1.0) for a, b in domain]
    axis = max(range(len(domain)), key=widths.__getitem__)
    return axis if widths[axis] > 1e-12 else None


def _ends(x: Any) -> list[float]:
    """The ends of a ball as doubles, outwards."""
    low, high = math.nextafter(float(x.lower()), -math.inf), math.nextafter(float(x.upper()), math.inf)
    return [low, high]


def _newton_leaf(c: dict[str, Any], X: list[Any], T: Any) -> dict[str, Any]:
    """The boxes of the solution y at each stage: y = x - d(y) is iterated, and the box grown until Krawczyk holds."""
    boxes, image = [], X
    for stage in range(len(c["fractions"])):
        Y, refusal = image, None
        for _ in range(PASSES):
            tape = Tape(c["series"], c["ulps"])
            coef = prepared(c, tape, T, stage)
            out = play(c["kernels"]["linearise"], tape.number, coef=coef, y=[tape.value(v) for v in Y])
            displacement = [v.x for v in out["displacement"]]
            Y = [
                x - d + BALL * (GROWTH * (mag(d) + 0.1 * arb(x.rad())) + arb(2) ** -25 * mag(x - d))
                for x, d in zip(image, displacement, strict=True)
            ]
            try:
                box = [_ends(v) for v in Y]
                enclosed = [interval(b) for b in box]
                _, _, after = newton_stage(c, image, T, enclosed, stage)
            except (RefusedError, ZeroDivisionError) as failure:
                refusal = failure
                continue
            boxes.append(box)
            image = [x + BALL * arb(2) ** -40 * mag(x) for x in after]
            break
        else:
            raise refusal or RefusedError("no enclosure of the solution was found")
    return {"y": boxes}


def _gauss_leaf(c: dict[str, Any], X: list[Any], T: Any) -> dict[str, Any]:
    """The box of the unknowns: sums over the stages are taken until the box holds them."""
    n = len(c["kernels"]["stage_field"]["outputs"]["move"])
    rows = zip(*c["mixing"], strict=True)
    Z, spread = [arb(0)] * n, max(sum(abs(m) * w for m, w in zip(row, c["weights"], strict=True)) for row in rows)
    for _ in range(PASSES):
        tape = Tape(c["series"], c["ulps"])
        point = [*(tape.value(x) for x in X), *([tape.value(T)] if c["timed"] else [])]
        w = [tape.number(c["step"] * spread)]
        z, coef = [tape.value(v) for v in Z], prepared(c, tape, T, 0)
        out = play(c["kernels"]["stage_field"], tape.number, coef=coef, x=point, z=z, w=w)["move"]
        Z = [BALL * (GROWTH * mag(v.x) + arb(2) ** -40) for v in out]
        leaf = {"z": [_ends(v) for v in Z]}
        try:
            gauss(c, X, T, leaf)
        except RefusedError as failure:
            refusal = failure
            continue
        return leaf
    raise refusal


_LEAVES: Mapping[str, Callable[[dict[str, Any], list[Any], Any], dict[str, Any]]] = {
    "explicit": lambda c, X, T: {},
    "splitting": lambda c, X, T: {},
    "newton": _newton_leaf,
    "gauss": _gauss_leaf,
}
