"""Reader of the sweeps of a spec. A sweep repeats a run for many values of parameters and initial values."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import prod
from typing import Any

from phigen.spec import limits
from phigen.spec.declarations import Declarations
from phigen.spec.kinds import Integer, Kind, Text
from phigen.spec.model import Axis, Run, Statistic, SweepSettings
from phigen.spec.names import KEPT, STATISTICS, SWEEP_NAMES
from phigen.spec.problems import did_you_mean, one_of, shown
from phigen.spec.runs import whole, without_repetition
from phigen.spec.yaml_source import Scalar

#: Keys under ``over`` that are settings of the sweep, not quantities to vary. Each key has the kind of its value.
_WORDS: Mapping[str, Kind] = {
    "random": Integer(1, limits.SWEPT, limit=True),
    "seed": Integer(0, limits.SWEEP_SEED, limit=True),
    "file": Text(),
}


def sweep(
    name: str,
    raw: Mapping[str, Any],
    runs: Mapping[str, Run],
    declared: Declarations,
    observables: Collection[str] = (),
    *,
    monitored: bool,
) -> SweepSettings:
    """Return the sweep with this name. Errors are reported; values with errors are then replaced by harmless ones.

    ``runs`` and ``observables`` are those of the spec; ``monitored`` says that the spec has a monitor.
    """
    place = ("sweeps", name)
    run = raw["run"].text if raw.get("run") else next(iter(runs), "")
    if run not in runs:
        hint = did_you_mean(run, runs) or "add the run under runs:"
        _fail((*place, "run"), f"there is no run {shown(run)}" if run else "the spec has no runs", declared, hint)
    entries: dict[str, Any] = {}
    axes: list[Axis] = []
    for key, (node, value) in (raw.get("over") or {}).items():
        if isinstance(value, Scalar) and key in _WORDS and key not in declared.parameters:
            entries[key] = _WORDS[key].read(value, (key,), declared.reader)
        elif value is not None:
            axes += _axis(node, value, declared)
    result = SweepSettings(
        name=name,
        run=run,
        over=tuple(axes),
        random=entries.get("random") or 0,
        seed=entries.get("seed") or 0,
        file=entries.get("file") or "",
        keep=_kept(raw.get("keep"), place, declared, observables),
        frames=raw.get("frames", 0),
        target=raw.get("target", "auto"),
        description=raw.get("description", ""),
    )
    incomplete = len(axes) + len(entries) < len(raw.get("over") or {}) or None in entries.values()
    _expect_sense(result, runs.get(run), place, declared, incomplete=incomplete)
    if run in runs and (end := end_of_its_own(result, runs[run], monitored=monitored)):
        _fail((*place, "run") if raw.get("run") else place, end, declared, "give the run steps: instead")
    if run in runs and (obstacle := average_obstacle(result, runs[run], monitored=monitored)):
        _fail((*place, "keep"), obstacle[0], declared, obstacle[1])
    return result


def _kept(
    nodes: Sequence[Scalar | None] | None, place: tuple[Any, ...], declared: Declarations, observables: Collection[str]
) -> tuple[str, ...]:
    """Return the words under ``keep`` of a sweep: words of `KEPT` and statistics of observables, such as mean(M)."""
    quantities: list[str | None] = []
    for node in nodes or ():
        word = node.text.replace(" ", "") if node is not None else None
        if node is not None and word not in KEPT and Statistic.read(str(word), observables) is None:
            allowed = [*KEPT, *observables]
            hint = did_you_mean(node.text, allowed) or one_of(
                [*allowed, *(f"{statistic}({name})" for name in observables for statistic in STATISTICS)]
            )
            declared.reader.error(node, f"keep: {shown(node.text)} is not known", hint)
            word = None
        quantities.append(word)
    return without_repetition(quantities, (*place, "keep"), declared) if nodes is not None else ("final",)


def end_of_its_own(sweep: SweepSettings, run: Run, *, monitored: bool) -> str:
    """Return the reason why a sweep cannot repeat this run; "" if it can.

    All members must make the same number of whole steps. So a run is refused if it ends at a condition, or if the
    number of its steps depends on quantities that the sweep varies.
    """
    statement = f"all members of a sweep make the same number of whole steps; the run {run.name} ends"
    if run.stop is not None:
        return f"{statement} where its stop: is met"
    varied = {"step", "start"} & {axis.name for axis in sweep.over}
    if run.duration is not None and "step" in varied:
        return f"{statement} after the duration {float(run.duration):.9g}"
    if run.until is not None and (monitored or varied or whole((run.until - run.start) / run.step) is None):
        return f"{statement} at the time {float(run.until):.9g}"
    return ""


def average_obstacle(sweep: SweepSettings, run: Run, *, monitored: bool) -> tuple[str, str] | None:
    """Return why a sweep cannot average observables over the rows of this run, and a hint; None if it can.

    A sweep averages over states after whole steps, or over its frames. With a monitor, sweeps do not know the physical
    times of states.
    """
    averages = [word for word in sweep.keep if word.partition("(")[0] in STATISTICS and word.endswith(")")]
    if averages and run.is_timed and not sweep.frames:
        reason = f"sweeps average over whole steps, but the rows of the run {run.name} are at given times"
        return (
            f"{averages[0]}: {reason}",
            "in the run, replace `every` or `at` by `stride`; or add `frames` to the sweep",
        )
    if averages and monitored and run.average.after is not None:
        reason = "`after` of the run is a physical time, but sweeps with a monitor do not know physical times"
        return f"{averages[0]}: {reason}", "remove the key `after` from the run"
    return None


def _fail(place: tuple[Any, ...], message: str, declared: Declarations, hint: str = "", *, limit: bool = False) -> None:
    locations = declared.reader.locations
    while place not in locations and len(place) > 1:
        place = place[:-1]
    declared.reader.problems.add(message, locations[place], hint, limit=limit)


def _axis(key: Scalar, value: Any, declared: Declarations) -> list[Axis]:
    """Return a list with the axis for the range of one quantity; [] after reported errors.

    ``value`` is a list of values, or an interval {from: …, to: …}.
    """
    name, numbers = key.text, declared.numbers()
    allowed_names = [*declared.parameters, *(() if declared.lattice else declared.coordinates), *SWEEP_NAMES]
    if name not in allowed_names and not declared.incomplete:
        declared.reader.error(
            key, f"over: {shown(name)} is not a parameter or a coordinate", did_you_mean(name, allowed_names)
        )
        return []
    if name == "start" and name not in (*declared.parameters, *declared.coordinates) and not declared.time:
        declared.reader.error(
            key,
            "over: start: this system does not depend on the time",
            "add `time: t` to the spec, where t is the name of the time in your formulas",
        )
        return []
    if isinstance(value, Scalar):
        declared.reader.error(
            value, f"over: {name} has only one value", "give a range, {from: 1, to: 3, count: 100}, or a list"
        )
        return []
    if name == "seed" and name not in (*declared.parameters, *declared.coordinates):
        return _draws(key, value, declared)
    if isinstance(value, list):
        values = [declared.number(node, numbers) for node in value]
        if None in values:
            return []
        axis = Axis(name, tuple(float(v) for v in values if v is not None))
    else:
        bounds = [declared.number(value.get(end), numbers) for end in ("from", "to")]
        if None in bounds:
            declared.reader.error(key, f"over: {name} needs from and to", "{from: 1, to: 3, count: 100}")
            return []
        first, last = (float(end or 0) for end in bounds)
        axis = Axis(name, (), (first, last), value.get("count", 0), value.get("scale", "linear"))
    lowest = min(axis.values or axis.ends)
    if axis.scale == "log" and lowest <= 0:
        declared.reader.error(key, f"over: {name} on a logarithmic scale must be positive, but reaches {lowest:g}")
    parameter = declared.parameters.get(name)
    if parameter is not None and parameter.refuses(lowest):
        message = f"is {parameter.bound} by declaration, but reaches {lowest:g}"
        declared.reader.error(key, f"over: the parameter {name!r} {message}")
    return [axis]


def _draws(key: Scalar, value: Any, declared: Declarations) -> list[Axis]:
    """Return the range of ``seed`` as a list of one axis, or [] after reported errors.

    A value on this axis is the index of a random draw: each draw has other initial values, parameters and noise.
    """
    if isinstance(value, list):
        draw_counts = [Integer(0, limits.SWEEP_SEED).read(node, ("seed",), declared.reader) for node in value if node]
        numbers = tuple(float(n) for n in draw_counts if n is not None)
        return [Axis("seed", numbers)] if len(numbers) == len(value) else []
    if "count" not in value or len(value) > 1:
        declared.reader.error(key, "over: seed must have the key count, and no other key", "seed: {count: 10}")
        return []
    return [Axis("seed", count=value["count"])]


def _expect_sense(
    sweep: SweepSettings, run: Run | None, place: tuple[Any, ...], declared: Declarations, *, incomplete: bool
) -> None:
    grid = [axis for axis in sweep.over if axis.size]
    random_axes = [axis for axis in sweep.over if not axis.size]
    axes_place = (*place, "over")
    if sweep.file and (sweep.over or sweep.random):
        _fail(axes_place, "over: a file holds all values; remove the other keys", declared)
    if sweep.random and grid:
        _fail(
            axes_place,
            f"over: {grid[0].name} has a count or a list, but with random: all values are drawn at random",
            declared,
            f"write {grid[0].name}: {{from: a, to: b}}, or remove random:",
        )
    if random_axes and not (sweep.random or incomplete or any(axis.name == "seed" for axis in grid)):
        hint = "add a count, or seed: {count: 10} for 10 random members"
        _fail((*axes_place, random_axes[0].name), f"over: {random_axes[0].name} has no count", declared, hint)
    if not (sweep.over or sweep.file or incomplete):
        _fail(axes_place, "over: there is nothing to vary", declared)
    members = sweep.random or prod(axis.size for axis in grid)
    if members > limits.SWEPT:
        hint = "split it into several sweeps, or draw random members"
        _fail(axes_place, f"{members} members, the limit is {limits.SWEPT}", declared, hint, limit=True)
    if run is not None and sweep.frames > run.steps:
        message = f"frames: every {sweep.frames} steps, but the run {run.name} has only {run.steps}"
        _fail((*place, "frames"), message, declared)
    if "crossings" in sweep.keep and declared.lattice:
        hint = "keep observables: M, mean(M), std(M)"
        _fail((*place, "keep"), "crossings: not available in sweeps of lattices", declared, hint)
    elif "crossings" in sweep.keep and run is not None and run.section is None:
        hint = "give the run a section: an expression whose zeros are the crossings"
        _fail((*place, "keep"), f"crossings: the run {run.name} has no section", declared, hint)
    if "energy_error" in sweep.keep and declared.time:
        hint = (
            "store states by `keep: [final]` or by the key `frames`; then solver.hamiltonian(x, t) returns the energy "
            "of a state"
        )
        _fail((*place, "keep"), "energy_error: H depends on the time, so energy is not conserved", declared, hint)
