"""Summary of ``phigen tune``: a table, and lines of YAML that users paste into the spec; or data for JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from phigen.cli.console import heading, out, table
from phigen.cli.run_summary import finite

if TYPE_CHECKING:
    from phigen.spec.model import Run, Spec
    from phigen.tuning.monitors import Monitors, Trial
    from phigen.tuning.search import Curve
    from phigen.tuning.study import Finalist, Tuning

#: Further accuracies for which results are shown, as multiples of the requested accuracy.
_FURTHER_ACCURACIES = (1e4, 1e2, 1e-2, 1e-4)
#: A remark says that larger steps fail. It appears if the requested accuracy is more than this number times the error
#: of the cheapest setting, and the step of this setting is nearly the largest one that was possible.
_UNDECIDED_FACTOR = 20
#: Keys of a run that the proposed lines of a run replace.
_REPLACED_KEYS = "`step`, `stride`, `every`, `at`, `steps`, `duration` and `until`"
#: _MOST_MONITORS: largest number of monitors in the table. _LEAST_GAIN: a monitor is proposed only if it reduces the
#: number of steps by this factor, since each step with a monitor costs more. _FORMULA_LENGTH: number of characters to
#: which formulas in the table are cut.
_MOST_MONITORS, _LEAST_GAIN, _FORMULA_LENGTH = 5, 2.0, 60
#: Number of states that the proposed run stores, enough for a figure. Runs of lattices may store fewer states.
_STORED_STATES = 1000


def print_tuning(tuning: Tuning, spec: Spec, run: Run) -> None:
    """Print the table, the conditions of the measurements, and lines to paste into the spec."""
    error_name = "energy error" if tuning.measure == "energy" else "error of the orbit"
    requirement = f"{error_name} at most {tuning.accuracy:g} up to {tuning.clock} = {tuning.horizon:.9g}"
    out(heading(f"{spec.name}, run {run.name}") + f": {requirement}\n")
    rows = [["", "order", "gauge", "scheme", "step", "error", "ns/step", "run, ms", "ratio"]]
    rows += [_row(f, label, tuning) for label, f in listed(tuning)]
    for line in table(rows, right=[1, 4, 5, 6, 7, 8]):
        out(f"  {line}")
    out("")
    for remark in remarks(tuning):
        out(f"  {remark}")
    if other_rows := _other_rows(tuning):
        out("")
        for line in table([["cheapest setting for", "error", "step", "run, ms"], *other_rows], right=[1, 2, 3]):
            out(f"  {line}")
    assert tuning.winner is not None
    out("\nTo paste into the spec, instead of lines with the same keys" + (" and of terms:\n" if spec.terms else ":\n"))
    out("\n".join(lines_of(tuning.winner)))
    out(f"\nand into its run {run.name}, instead of the keys {_REPLACED_KEYS}:\n")
    out("\n".join(f"    {line}" for line in run_lines_of(tuning, run)))
    if tuning.monitors:
        print_monitors(tuning.monitors, tuning, run)


def print_monitors(monitors: Monitors, tuning: Tuning, run: Run) -> None:
    """Print how many steps each monitor saves, and lines for the spec that select the best monitor."""
    from phigen.tuning.search import rounded_down

    gaining = [t for t in monitors.found if monitors.gain(t) > _LEAST_GAIN]
    out(
        f"\nThe motion is much faster at some times than at others. Steps up to t = {monitors.span:.6g} "
        "with the same energy error:\n"
    )
    rows = [["monitor", "scheme", "steps", "fewer", "run, ms"]]
    for trial in [*monitors.found[:_MOST_MONITORS], monitors.plain]:
        gain = monitors.gain(trial)
        cells = [f"{trial.steps:.0f}", f"{gain:.3g} times", f"{1e3 * trial.seconds:.3g}"]
        cells = cells if math.isfinite(trial.steps) else ["too many", "", ""]
        cells[1] = cells[1] * (trial is not monitors.plain and math.isfinite(gain))
        rows.append([_shortened(trial.setting.monitor or "none"), f"{trial.label}, order {trial.order}", *cells])
    for line in table(rows, right=[2, 3, 4]):
        out(f"  {line}")
    out("\n  With a monitor, steps are equal in τ, and they are still Poisson maps.")
    for reason in dict.fromkeys(monitors.refused.values()):
        names = [_shortened(m) for m, refusal in monitors.refused.items() if refusal == reason]
        out(f"  Not measured: {'; '.join(names)}: {reason}.")
    if gaining:
        best = gaining[0]
        out("\nTo paste into the spec" + ", instead of the lines above" * bool(tuning.winner) + ":\n")
        out("\n".join(monitored_lines(best)))
        out(f"\nand into its run {run.name}, instead of the keys {_REPLACED_KEYS}:\n")
        step, end = math.copysign(rounded_down(best.step), run.step), math.copysign(tuning.horizon, run.step)
        out(f"    step: {step!r}\n    until: {end!r}")
    else:
        out("  No monitor reduces the cost: the additional cost of a step is larger than the saving.")


def _shortened(text: str) -> str:
    return text if len(text) <= _FORMULA_LENGTH else text[: _FORMULA_LENGTH - 1] + "…"


def monitored_lines(trial: Trial) -> list[str]:
    """Return top-level lines of a spec that select a measured monitor."""
    return replace(trial.setting, order=trial.order).lines()


def listed(tuning: Tuning) -> Iterator[tuple[str, Finalist]]:
    """Yield label and result of each row of the table: proposals, classical methods, and the spec without changes."""
    for finalist in tuning.finalists:
        yield finalist.curve.label + (", the spec's" if finalist is tuning.own else ""), finalist
    for peer in tuning.peers:
        yield peer.curve.label, peer
    if tuning.present:
        yield "the spec and its run as they are", tuning.present


def _row(finalist: Finalist, label: str, tuning: Tuning) -> list[str]:
    curve, point, best = finalist.curve, finalist.point, tuning.winner
    assert best is not None
    cells = [label, str(curve.order), gauge_of(curve), scheme_of(curve), f"{point.step:.6g}"]
    error = f"{point.error:.1e}" if is_measured(finalist, tuning) else f"~{point.error:.1e}"
    ratio = finalist.cost / best.cost
    times = [f"{1e9 * finalist.cost * point.step:.0f}", f"{1e3 * finalist.cost * tuning.horizon:.3g}"]
    return [*cells, error, *times, f"{ratio:.2f}" if ratio < 100 else f"{ratio:.0f}"]


def is_measured(finalist: Finalist, tuning: Tuning) -> bool:
    """Whether the error was measured up to the end of the requested time, rather than extrapolated."""
    return finalist.point.time > min(0.99 * tuning.horizon, tuning.horizon - finalist.point.step)


def gauge_of(curve: Curve) -> str:
    """Return the gauge of a method as a spec would state it: "none" without a gauge, and "" for classical methods."""
    if curve.setting is None:
        return ""
    return curve.setting.gauge if curve.gauged else "none"


def scheme_of(curve: Curve) -> str:
    """Return how a method reaches its order, as words for the table, such as "direct" or the name of a composition."""
    if curve.setting is None:
        return "explicit"
    composition = curve.composition or curve.setting.composition
    if curve.stages == 0:
        return "exact flow"
    return f"{composition}, {curve.stages} stages" if composition not in ("none", "auto") else "direct"


def remarks(tuning: Tuning) -> Iterator[str]:
    """Yield remarks on the conditions of the measurements and on their limits."""
    from phigen.geometry.conservation import ENERGY, stated

    best = tuning.winner
    assert best is not None
    measured_span, full_span = f"{tuning.clock} = {best.point.time:.4g}", f"{tuning.clock} = {tuning.horizon:.6g}"
    if is_measured(best, tuning):
        yield "Errors were measured up to there" + _extrapolated(tuning)
    elif tuning.measure == "energy" and not best.curve.bounded:
        yield f"Errors were measured up to {measured_span}, and extrapolated (~) by their observed growth."
    elif tuning.measure == "energy":
        yield f"Errors were measured up to {measured_span}. Later, only rounding errors grow in phigen (~: estimated)."
    else:
        yield f"Errors were measured up to {measured_span}, and extrapolated to {full_span} (~) by linear growth."
    if tuning.measure == "energy":
        yield stated({ENERGY: tuning.unit})
    if best.point.error * _UNDECIDED_FACTOR < tuning.accuracy and best.point.step > 0.9 * best.curve.largest:
        yield "The accuracy would allow a larger step, but larger steps fail or do not resolve the motion."
    if tuning.orbit_error is not None:
        yield (
            f"Up to {tuning.clock} = {tuning.piece:.4g} the error of the orbit is at most {tuning.orbit_error:.1e} of "
            "the size of the orbit; --measure orbit chooses settings by this error."
        )
    if tuning.sizes:
        sites = "×".join(map(str, tuning.sizes))
        yield f"Measured on {sites} sites. Classical methods are in NumPy, with the vector field of the solver."
    if tuning.automatic:
        yield _automatic(tuning)
    for label, peer in ((p.curve.label, p) for p in tuning.peers if p.cost < best.cost):
        share = peer.cost / best.cost
        yield f"{label} takes {share:.2g} of the time, but conserves neither Casimirs nor the Poisson structure."
    for reason in dict.fromkeys(tuning.refused.values()):
        settings = [s.described() for s, refusal in tuning.refused.items() if refusal == reason]
        yield f"Not measured: {'; '.join(settings)}: {reason}."
    if not tuning.finished:
        yield "The time budget ended before all promising candidates were tried; a larger --budget tries more."


def _automatic(tuning: Tuning) -> str:
    """Return a sentence that compares ``scheme: auto`` with the best setting.

    The sentence names the scheme that auto chooses, and the time that the best method of this scheme needs.
    """
    assert tuning.winner is not None
    ratio, text = (
        tuning.automatic_ratio,
        f"scheme: auto chooses {tuning.automatic} at order {tuning.winner.curve.order}",
    )
    if not math.isfinite(ratio):
        return f"{text}, but no measured method of that scheme reaches the accuracy."
    return f"{text}; the best of that scheme takes {ratio:.2g} times the time of the best of all."


def _extrapolated(tuning: Tuning) -> str:
    extrapolated = [label for label, f in listed(tuning) if not is_measured(f, tuning)]
    return f"; those with ~ are extrapolated ({', '.join(extrapolated)})." if extrapolated else "."


def _other_rows(tuning: Tuning) -> list[list[str]]:
    """Return a table row for each of `_FURTHER_ACCURACIES` that was reached. The row has the cheapest measured
    setting.
    """
    from phigen.tuning.search import cheapest_step

    rows = []
    for accuracy in (tuning.accuracy * factor for factor in _FURTHER_ACCURACIES):
        curves = [c for c in tuning.curves if c.setting and any(p.error <= accuracy for p in c.points)]
        curve = min(curves, key=lambda c: c.cost(accuracy), default=None)
        step, cost = cheapest_step(curve.points, accuracy, curve.order) if curve else (0.0, math.inf)
        if curve and math.isfinite(cost):
            rows.append([curve.title, f"{accuracy:.0e}", f"{step:.2g}", f"{1e-6 * cost * tuning.horizon:.2g}"])
    return rows


def lines_of(finalist: Finalist) -> list[str]:
    """Return top-level lines of a spec that select the measured setting."""
    setting = finalist.curve.setting
    assert setting is not None
    return replace(setting, order=finalist.curve.order).lines()


def run_lines_of(tuning: Tuning, run: Run) -> list[str]:
    """Return the lines of the proposed run: step, number of steps up to the horizon, and stride.

    If the run has a key ``stop``, one step is added, so that the stop is reached. The stride is large, since a solver
    is faster if it makes many steps between two stored states.
    """
    assert tuning.winner is not None
    step = tuning.winner.point.step
    steps = max(1, round(tuning.horizon / step)) + (run.stop is not None)
    # states of lattices are large, so the proposed run stores at most as many as the run of the spec
    rows = max(1, run.steps // run.stride) if tuning.sizes else _STORED_STATES
    return [f"step: {math.copysign(step, run.step)!r}", f"steps: {steps}", f"stride: {max(1, steps // rows)}"]


def unreached(tuning: Tuning) -> str:
    """Return the message that no setting reaches the accuracy, with the reason and the smallest error."""
    from phigen.tuning.problem import SINGLE_ROUNDING
    from phigen.tuning.search import at_floor

    curve, point = tuning.closest
    title = curve.title
    if point.rounding > tuning.accuracy or any(at_floor(c.points) for c in tuning.curves if c.setting):
        single = point.unit == SINGLE_ROUNDING
        explanation = "smaller steps do not help: the remaining error is rounding" + " in single precision" * single
        options = ["ask for less accuracy", "take a shorter --horizon"][: 1 + (point.error > 2 * point.measured)]
        hint = " or ".join([*options, *["set real: double"] * single])
    else:
        explanation = "smaller steps would take longer than the budget allows"
        hint = "take a larger --budget, or ask for less accuracy"
    return (
        f"no setting reaches {tuning.accuracy:g} up to {tuning.clock} = {tuning.horizon:.6g}: the smallest error is "
        f"{point.error:.1e} ({title}, step {point.step:.3g}); {explanation}\n  hint: {hint}"
    )


def described(tuning: Tuning, spec: Spec, run: Run) -> dict[str, Any]:
    """Return all measurements as data for JSON."""
    data: dict[str, Any] = {
        "name": spec.name,
        "run": run.name,
        "measure": tuning.measure,
        "accuracy": tuning.accuracy,
        "unit": asdict(tuning.unit),
        "horizon": tuning.horizon,
        **({"sizes": tuning.sizes} if tuning.sizes else {}),
        "scanned": tuning.piece,
        "finished": tuning.finished,
        "orbit_error": tuning.orbit_error,
        "winner": _finalist(tuning.winner) if tuning.winner else None,
        "lines": lines_of(tuning.winner) if tuning.winner else [],
        "run_lines": run_lines_of(tuning, run) if tuning.winner else [],
        "finalists": [_finalist(f) for f in tuning.finalists],
        "classical": [_finalist(f) for f in tuning.peers],
        "present": _finalist(tuning.present) if tuning.present else None,
        "curves": [_curve(c) for c in tuning.curves],
        "not_measured": {s.described(): refusal for s, refusal in tuning.refused.items()},
        "automatic": {"scheme": tuning.automatic, "ratio": tuning.automatic_ratio} if tuning.automatic else None,
        "monitors": _monitors(tuning.monitors) if tuning.monitors else None,
    }
    cleaned: dict[str, Any] = finite(data)
    return cleaned


def _monitors(monitors: Monitors) -> dict[str, Any]:
    return {
        "time": monitors.span,
        "without": _trial(monitors.plain),
        "with": [_trial(t) | {"gain": monitors.gain(t), "lines": monitored_lines(t)} for t in monitors.found],
        "not_measured": dict(monitors.refused),
    }


def _trial(t: Trial) -> dict[str, Any]:
    keys = ("order", "step", "steps", "error", "seconds")
    return {"monitor": t.setting.monitor, "method": t.label, **{key: getattr(t, key) for key in keys}}


def _finalist(f: Finalist) -> dict[str, Any]:
    point = f.point
    return {
        **_method(f.curve),
        "step": point.step,
        "error": point.error,
        "measured_error": point.measured,
        "measured_until": point.time,
        "nanoseconds_per_step": 1e9 * f.cost * point.step,
        "seconds_per_unit_time": f.cost,
        "rounds": list(f.seconds),
    }


def _curve(curve: Curve) -> dict[str, Any]:
    keys = ("step", "error", "measured", "time", "nanoseconds")
    return {**_method(curve), "points": [{key: getattr(p, key) for key in keys} for p in curve.points]}


def _method(curve: Curve) -> dict[str, Any]:
    return {"method": curve.label, "order": curve.order, "gauge": gauge_of(curve), "scheme": scheme_of(curve)}
