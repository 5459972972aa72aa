"""What a solver in C may have: the switches of the runtime, and what each asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from phigen.scheme.path import Recurrences
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Implicit, Newton, Path, Splitting
from phigen.targets.c import lanes, packs
from phigen.targets.path import kinds


@dataclass(frozen=True)
class Feature:
    """A switch ``PHI_NAME`` of the runtime: ``when`` a program has it, if it has also what it ``requires``."""

    name: str
    when: Callable[[Program], object]
    requires: tuple[str, ...] = ()


def _calls(function: str) -> Callable[[Program], bool]:
    return lambda program: function in lanes.called_in_lanes(program) | packs.called_in_lanes(program)


def _sums(kind: str) -> Callable[[Program], bool]:
    return lambda p: any(kind in kinds(path) for path in recurrences(p))


def recurrences(program: Program) -> list[Recurrences]:
    """Those of the path, and of the path with its variation."""
    step = program.step
    if not isinstance(step, Path):
        return []
    return [step.recurrences, *([step.tangent.recurrences] if step.tangent else [])]


def _fast(program: Program) -> bool:
    return program.profile == "fast"


#: Each after what it requires.
FEATURES = (
    Feature("NEWTON", lambda p: isinstance(p.step, Newton)),
    Feature("PATH", lambda p: isinstance(p.step, Path)),
    Feature("EXPLICIT", lambda p: isinstance(p.step, Explicit)),
    Feature("SPLITTING", lambda p: isinstance(p.step, Splitting)),
    Feature("IMPLICIT", lambda p: isinstance(p.step, Implicit)),
    Feature("PARAMETERS", lambda p: p.parameters),
    Feature("COMPOSED", lambda p: len(p.fractions) > 1),
    Feature("KICKS", lambda p: isinstance(p.step, Splitting) and p.step.schedule.multiples),
    Feature("GAUGE", lambda p: p.gauge),
    Feature("RELATIVE", lambda p: isinstance(p.step, Implicit) and p.step.inner.relative),
    Feature("TANGENT", lambda p: p.extras.tangent),
    Feature("MODIFIED", lambda p: p.modified),
    Feature("ADVANCE", lambda p: not isinstance(p.step, Splitting) or p.extras.tangent),
    Feature("UNROLLED", lambda p: isinstance(p.step, Implicit) and p.step.eliminate),
    Feature("PIVOTING", lambda p: isinstance(p.step, Implicit) and (_fast(p) or not p.step.eliminate)),
    Feature("QUICK_GAUGE", _fast, ("GAUGE",)),
    Feature("RECURRENCES", _fast, ("IMPLICIT",)),
    Feature("BLOCKS", lambda p: _fast(p) and lanes.blocks(p), ("RECURRENCES",)),
    Feature("GROUPS", lanes.groups, ("BLOCKS",)),
    Feature("PACKS", lambda p: _fast(p) and packs.packed(p)),
    Feature("FAR", packs.two_ways, ("PACKS",)),
    Feature("SPARSE", lanes.factors_of, ("BLOCKS",)),
    Feature("INVERSE_UNROLLED", lambda p: isinstance(p.step, Newton) and p.step.invert, ("BLOCKS",)),
    *(Feature(f"CALLS_{f.upper()}", _calls(f)) for f in ("exp", "expm1", "log", "sin", "cos")),
    *(Feature(f"TAYLOR_{kind.upper()}", _sums(kind)) for kind in ("product", "chain", "power")),
)


def switches(program: Program) -> dict[str, bool]:
    """Whether the program has each of the features."""
    found: dict[str, bool] = {}
    for feature in FEATURES:
        found[feature.name] = all(found[name] for name in feature.requires) and bool(feature.when(program))
    return found
