"""The features of a solver: switches that turn parts of its runtime on or off, as the program requires."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from phigen.scheme.program import Program
from phigen.scheme.step_kinds import STEP_KINDS, StepKind


@dataclass(frozen=True)
class Feature:
    """Switch that turns parts of the runtime on or off.

    The switch is on if three conditions hold: ``when`` is true for the program, all switches in ``requires`` are on,
    and the user has not excluded ``part`` from the generated code.
    """

    name: str
    when: Callable[[Program], object] = lambda program: True
    requires: tuple[str, ...] = ()
    part: str = ""


def _sums(kind: str) -> Callable[[Program], bool]:
    """Return the condition of a switch: whether a path, tangent path or reverse pass has convolutions of the given
    kind.
    """

    def needed(program: Program) -> bool:
        step = program.step
        paths = [step.path, step.varied_path, step.back.recurrences if step.back else None]
        return any(t.kind == kind for path in paths if path for q in path.series for t in q.terms)

    return needed


def _is_of(kind: StepKind) -> Callable[[Program], bool]:
    return lambda p: p.step.kind is kind


#: The switches that all languages have. A switch comes after the switches that it requires.
FEATURES = (
    *(Feature(kind.name.upper(), _is_of(kind)) for kind in STEP_KINDS.values() if not kind.sites),
    Feature("FRAMED", lambda p: p.step.frame),
    Feature("IMPLICIT", lambda p: p.step.kind.implicit),
    Feature("HISTORY", lambda p: p.step.kind.predicted),
    Feature("COMPOSED", lambda p: len(p.fractions) > 1),
    Feature("CORRECTED", lambda p: p.step.corrected),
    Feature("KICKS", lambda p: p.step.multiples),
    Feature("TIMED", lambda p: p.time),
    Feature("NOISE", lambda p: p.noise),
    Feature("NONNEGATIVE", lambda p: any(q.nonnegative for q in p.parameters)),
    Feature("ARRAYS", lambda p: any(q.values is not None for q in p.parameters)),
    Feature("OBSERVED", lambda p: p.observed),
    Feature("OBSERVED_FIELDS", lambda p: p.observables.fields),
    Feature("RENEWED", lambda p: p.step.refresh),
    Feature("GAUGE", lambda p: p.held),
    Feature("MONITOR", lambda p: p.monitor),
    Feature("ATTITUDE", lambda p: p.attitude),
    Feature("MATRICES", lambda p: p.attitude and p.attitude.group.matrices),
    Feature("NORMALISE", lambda p: p.attitude and p.attitude.group.orthogonal),
    Feature("EXPONENTIAL", lambda p: p.attitude and p.attitude.exponential),
    Feature("TURNED_IN_STAGES", lambda p: p.attitude and p.attitude.turn),
    Feature("TURNED_BY_COVECTOR", lambda p: p.attitude and not p.attitude.cayley, ("TURNED_IN_STAGES", "MATRICES")),
    Feature("POSITION", lambda p: p.attitude and p.attitude.group.translation),
    Feature("LENGTHENED", lambda p: p.attitude and p.attitude.lengthened),
    Feature("SPATIAL", lambda p: p.attitude and p.attitude.group.spatial),
    Feature("RATE_OF_GAUGE", lambda p: p.attitude and p.attitude.rate),
    Feature("TANGENT", lambda p: p.extras.tangent),
    Feature("MODIFIED", lambda p: p.modified),
    Feature("KICKED", part="kicks"),
    Feature("ENSEMBLE", part="ensemble"),
    *(Feature(f"TAYLOR_{kind.upper()}", _sums(kind)) for kind in ("product", "chain", "power")),
)


def holds(condition: str, switches: Mapping[str, bool]) -> bool:
    """Whether a condition on switches holds. A condition consists of NAME or !NAME, joined by ``||`` and ``&&``, where
    ``&&`` binds more strongly.
    """
    return any(
        all(switches[s.removeprefix("!")] != s.startswith("!") for s in part.split(" && "))
        for part in condition.split(" || ")
    )


def switches(program: Program, further: Iterable[Feature] = ()) -> dict[str, bool]:
    """Return the values of all switches for a program, by name; ``further`` are switches of a single language."""
    values: dict[str, bool] = {}
    for feature in (*FEATURES, *further):
        asked = bool(feature.when(program)) and program.offers(feature.part)
        values[feature.name] = asked and all(values[name] for name in feature.requires)
    return values
