"""Features that only solvers in C have, for speed, gradients and single precision."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from phigen.lanes.in_lanes import Blocks, Lanes, Packs, Stages, Traces
from phigen.scheme.program import Program
from phigen.targets import features
from phigen.targets.c.lanes import grouped
from phigen.targets.features import Feature

FEATURES = (
    Feature("PREDICTED", lambda p: p.step.kind.predicted and not p.noise),
    Feature("DEVICE", lambda p: False),  # switched on by `phigen.targets.device`
    Feature("COMMON", lambda p: False),  # switched on by `phigen.targets.device`
    Feature("SINGLE", lambda p: p.single),
    Feature("PARAMETERS", lambda p: p.parameters),
    Feature("CHANGED_PARAMETERS", requires=("PARAMETERS",), part="parameters"),
    Feature("RELATIVE", lambda p: p.step.inner_solve and p.step.inner_solve.relative),
    Feature("ADJOINT", lambda p: p.step.adjoint),
    Feature("ASKED", lambda p: p.step.kind.sites, ("ADJOINT",)),
    Feature("ADVANCE", lambda p: not p.step.kind.flows or p.extras.tangent or p.offers("kicks")),
    Feature("UNROLLED", lambda p: p.step.kind.implicit and p.profile == "fast" and p.step.eliminate),
    Feature("EACH", lambda p: not p.noise, ("ENSEMBLE",), "members"),
    Feature("ATTITUDES", requires=("ATTITUDE", "ENSEMBLE")),
    Feature("GAUGE_SEARCH", requires=("GAUGE",), part="gauge-search"),
    Feature("RECURRENCES", lambda p: p.step.kind.implicit, ("PREDICTED",), "recurrences"),
)


def _calls(lanes: Lanes | None, function: str) -> Callable[[Program], bool]:
    return lambda program: lanes is not None and function in lanes.calls


def _in_lanes(lanes: Lanes | None) -> Iterator[Feature]:
    """Yield the features that depend on the use of SIMD lanes."""
    blocks = lanes if isinstance(lanes, Blocks) else None
    traces = lanes if isinstance(lanes, Traces) else None
    packs = lanes if isinstance(lanes, Packs) else None
    stages = lanes if isinstance(lanes, Stages) else None
    yield Feature("BLOCKS", lambda p: blocks, ("RECURRENCES",), "lanes")
    yield Feature("TRACED", lambda p: (blocks or traces) and p.step.kind.implicit, ("ADJOINT",))
    blocked = blocks or traces  # blocks and traces run the reverse pass in lanes, and rarely use scalar code
    yield Feature("UNROLLED_TRANSPOSE", lambda p: p.step.eliminate_transposed and not blocked, ("UNROLLED", "ADJOINT"))
    yield Feature("STAGED", lambda p: stages, part="lanes")
    yield Feature("REDUCED", lambda p: p.step.reduced, ("STAGED",))
    yield Feature("LIFTED", lambda p: p.step.lift, ("STAGED",))
    yield Feature("STAGE_GROUPS", lambda p: stages and stages.batched, ("STAGED", "ENSEMBLE", "EACH"))
    yield Feature("NARROW", lambda p: isinstance(lanes, Stages | Traces) and lanes.narrow)
    yield Feature("ALONG", lambda p: p.step.back and p.step.back.used, ("TRACED",))
    yield Feature("PACKS", lambda p: packs, ("ENSEMBLE",), "lanes")
    yield Feature("FULL_RANGE", lambda p: packs and packs.small_argument, ("PACKS",))
    yield Feature("GROUPS", lambda p: not p.time and grouped(p, lanes), ("BLOCKS", "ENSEMBLE"))
    together = "PACKS" if packs else "GROUPS"
    yield Feature("BATCHED", lambda p: packs.transposes if packs else True, (together, "ADJOINT", "EACH"))
    yield Feature("RECOMPUTED", lambda p: packs and packs.recomputed, ("BATCHED",))
    yield Feature("SPARSE", lambda p: blocks and blocks.factors, ("BLOCKS",))
    full = blocks and blocks.factors is None  # whether Newton matrices are inverted, not factorised
    yield Feature("SWEPT", lambda p: full, ("BLOCKS", "COMPOSED"))
    yield Feature("CENTRED", lambda p: p.step.centred, ("SWEPT",))
    yield Feature("INVERSE_UNROLLED", lambda p: p.step.invert, ("BLOCKS",))
    yield from (Feature(f"CALLS_{f.upper()}", _calls(lanes, f)) for f in ("exp", "expm1", "log", "sin", "cos"))


def switches(program: Program, lanes: Lanes | None) -> dict[str, bool]:
    """Return the values of all switches of the C runtime for a program, by name."""
    return features.switches(program, (*FEATURES, *_in_lanes(lanes)))
