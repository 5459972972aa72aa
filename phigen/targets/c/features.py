"""What a solver in C may have: the switches of the runtime, and what each asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from phigen.lanes.lowering import Blocks, Lanes, Packs, Traces
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Implicit, Newton, Path, Splitting, Sweeps
from phigen.targets.c.lanes import grouped
from phigen.targets.path import kinds, recurrences


@dataclass(frozen=True)
class Feature:
    """A switch ``PHI_NAME`` of the runtime: ``when`` a program has it, if it has also what it ``requires``, and if what
    it has ``in_lanes`` says so too; ``part`` is the name by which users leave it out."""

    name: str
    when: Callable[[Program], object] = lambda program: True
    requires: tuple[str, ...] = ()
    in_lanes: Callable[[Lanes | None], object] = lambda lanes: True
    part: str = ""


def _calls(function: str) -> Callable[[Lanes | None], bool]:
    return lambda lanes: lanes is not None and function in lanes.calls


def _sums(kind: str) -> Callable[[Program], bool]:
    return lambda p: any(kind in kinds(path) for path in recurrences(p))


def _full(lanes: Lanes | None) -> bool:
    """Whether Newton matrices are inverted, not kept as factors."""
    return isinstance(lanes, Blocks) and lanes.factors is None


def _fast(program: Program) -> bool:
    return program.profile == "fast"


#: Each after what it requires.
FEATURES = (
    Feature("NEWTON", lambda p: isinstance(p.step, Newton)),
    Feature("PATH", lambda p: isinstance(p.step, Path)),
    Feature("EXPLICIT", lambda p: isinstance(p.step, Explicit)),
    Feature("SPLITTING", lambda p: isinstance(p.step, Splitting)),
    Feature("IMPLICIT", lambda p: isinstance(p.step, Implicit)),
    Feature("GUESSED", lambda p: isinstance(p.step, Implicit) and not p.noise),
    Feature("SINGLE", lambda p: p.single),
    Feature("PARAMETERS", lambda p: p.parameters),
    Feature("COMPOSED", lambda p: len(p.fractions) > 1),
    Feature("KICKS", lambda p: isinstance(p.step, Splitting | Sweeps) and p.step.schedule.multiples),
    Feature("TIMED", lambda p: p.time),
    Feature("NOISE", lambda p: p.noise),
    Feature("RENEWED", lambda p: p.step.refresh),
    Feature("GAUGE", lambda p: p.held),
    Feature("MONITOR", lambda p: p.monitor),
    Feature("RELATIVE", lambda p: isinstance(p.step, Implicit) and p.step.inner.relative),
    Feature("ATTITUDE", lambda p: p.attitude),
    Feature("MATRICES", lambda p: p.attitude and p.attitude.group.matrices),
    Feature("NORMALISE", lambda p: p.attitude and p.attitude.group.orthogonal),
    Feature("EXPONENTIAL", lambda p: p.attitude and p.attitude.exponential),
    Feature("TURNED_BY_COVECTOR", lambda p: p.attitude and p.attitude.turn and not p.attitude.cayley, ("MATRICES",)),
    Feature("POSITION", lambda p: p.attitude and p.attitude.group.translation),
    Feature("SPATIAL", lambda p: p.attitude and p.attitude.group.spatial),
    Feature("RATE_OF_GAUGE", lambda p: p.attitude and p.attitude.rate),
    Feature("TANGENT", lambda p: p.extras.tangent),
    Feature("ADJOINT", lambda p: p.step.adjoint),
    Feature("MODIFIED", lambda p: p.modified),
    Feature("ADVANCE", lambda p: not isinstance(p.step, Splitting) or p.extras.tangent or p.offers("kicks")),
    Feature("UNROLLED", lambda p: isinstance(p.step, Implicit) and _fast(p) and p.step.eliminate),
    Feature("KICKED", part="kicks"),
    Feature("ENSEMBLE", part="ensemble"),
    Feature("EACH", lambda p: not p.noise, requires=("ENSEMBLE",), part="members"),
    Feature("ATTITUDES", requires=("ATTITUDE", "ENSEMBLE")),
    Feature("GAUGE_SEARCH", requires=("GAUGE",), part="gauge-search"),
    Feature("RECURRENCES", requires=("GUESSED",), part="recurrences"),
    Feature("BLOCKS", requires=("RECURRENCES",), in_lanes=lambda lanes: isinstance(lanes, Blocks), part="lanes"),
    Feature("TRACED", requires=("PATH", "ADJOINT"), in_lanes=lambda lanes: isinstance(lanes, Blocks | Traces)),
    Feature("NARROW", requires=("TRACED",), in_lanes=lambda lanes: isinstance(lanes, Traces) and lanes.narrow),
    Feature("ALONG", lambda p: isinstance(p.step, Path) and p.step.back and p.step.back.used, ("TRACED",)),
    Feature("PACKS", requires=("ENSEMBLE",), in_lanes=lambda lanes: isinstance(lanes, Packs), part="lanes"),
    Feature("FAR", requires=("PACKS",), in_lanes=lambda lanes: isinstance(lanes, Packs) and lanes.near),
    Feature("SPARSE", requires=("BLOCKS",), in_lanes=lambda lanes: isinstance(lanes, Blocks) and lanes.factors),
    Feature("SWEPT", lambda p: len(p.fractions) > 1, ("BLOCKS",), _full),
    Feature("INVERSE_UNROLLED", lambda p: isinstance(p.step, Newton) and p.step.invert, ("BLOCKS",)),
    *(Feature(f"CALLS_{f.upper()}", in_lanes=_calls(f)) for f in ("exp", "expm1", "log", "sin", "cos")),
    *(Feature(f"TAYLOR_{kind.upper()}", _sums(kind)) for kind in ("product", "chain", "power")),
)


def switches(program: Program, lanes: Lanes | None) -> dict[str, bool]:
    """Whether the program has each of the features."""
    found: dict[str, bool] = {}
    for feature in FEATURES:
        asked = feature.when(program) and feature.in_lanes(lanes) and program.offers(feature.part)
        found[feature.name] = all(found[name] for name in feature.requires) and bool(asked)
    return found | {"GROUPS": found["BLOCKS"] and found["ENSEMBLE"] and not program.time and grouped(program, lanes)}
