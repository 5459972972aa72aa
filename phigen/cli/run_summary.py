"""Summary of ``phigen run``: a table for people, or data for JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from phigen.cli.console import counted, heading, out, table

if TYPE_CHECKING:
    from phigen.cli.recording import Recorder
    from phigen.compilation import Compilation
    from phigen.spec.model import Run
    from phigen.study.averages import Average, Averages
    from phigen.study.lyapunov import Spectrum
    from phigen.study.summary import Drift, Summary


def print_summary(compilation: Compilation, recorder: Recorder, summaries: Sequence[Summary]) -> None:
    """Print the table of a run with a column for each method, then crossings and exponents if they were requested."""
    from phigen.geometry.conservation import stated

    run, solver = recorder.experiment.run, recorder.solver
    out(heading(f"{compilation.spec.name}, run {run.name}") + (f": {run.description}" if run.description else ""))
    method_text = f"{compilation.method}, target {solver.target}, 1 thread"
    times = f"{recorder.experiment.t0:.9g} … {recorder.time:.9g}"
    past_note = " after the finished run" if recorder.experiment.past else ""
    out(f"  {steps_text(recorder)}{past_note}, t = {times}; {method_text}")
    state = recorder.session.state().tolist()
    final = ", ".join(f"{c} = {v:.9g}" for c, v in zip(solver.coordinates, state, strict=True))
    out(f"  final state: {final}\n")
    for line in table(_rows(summaries), right=range(1, len(summaries) + 1)):
        out(f"  {line}")
    out(f"  {stated(summaries[0].units)}")
    if summaries[0].is_balance:
        power = "∂H/∂t" if not compilation.system.forces else "(∂H/∂t + the power of the forces)"
        out(f"  The energy balance is H − ∫ {power} dt, integrated along the stored states by a rule of order 8.")
        if any(s.off > 0.01 for s in summaries):
            out("  The stored states are too far apart for an accurate integral: use a shorter --every, or stride.")
    if solver.interface.observables:
        print_averages(solver.interface.observables, recorder.averages, recorder.experiment.run.average.of)
    if recorder.experiment.run.members > 1:
        _print_means(recorder)
    if recorder.finder:
        out(f"\n  {counted_crossings(run, recorder.points.seen, recorder.section_text)}")
    if spectrum := recorder.spectrum:
        change_note = f"the second half changed them by {spectrum.uncertainty:.1g}"
        clock = spectrum.clock
        out(f"\n  Lyapunov exponents after {clock} = {spectrum.t:.9g}, per unit of {clock}; {change_note}")
        out(f"  {', '.join(f'{value:.4g}' for value in spectrum.exponents.tolist())};  sum {spectrum.total:.1g}")


def counted_crossings(run: Run, count: int, section: str) -> str:
    """Return a number of crossings in words, such as "12 rising crossings of the section x1 = 0"."""
    kind = "crossing" if run.direction == "both" else f"{run.direction} crossing"
    return f"{counted(count, kind)} of the section {section} = 0"


def steps_text(recorder: Recorder) -> str:
    """Return the number of steps in words, such as "60 steps of 0.1".

    With a monitor, "in τ" is added. If the last step is shorter, "and a part of one" is added.
    """
    unit = " in τ" if recorder.solver.interface.monitored else ""
    part = " and a part of one" if recorder.number > recorder.steps else ""
    return f"{recorder.steps} steps of {recorder.experiment.h:.9g}{unit}{part}"


def _rows(summaries: Sequence[Summary]) -> list[list[str]]:
    first = summaries[0]
    driven = first.is_balance
    noisy = first.energy.unit.moves and not driven
    heading_of_all = "largest" if driven else "largest change" if noisy else "largest error"
    rows = [[heading_of_all, *(s.method for s in summaries), ""]]
    if first.change:
        changes = [_formatted_value(s.change) for s in summaries if s.change]
        rows.append(["change of the energy", *changes, first.change.unit.kind])
    energy = "error of the energy balance" if driven else "energy"
    rows.append([energy, *(_formatted_value(s.energy) for s in summaries), first.energy.unit.kind])
    if driven:
        rows.append(["  the integral, work done", *(f"{s.work:.4g}" for s in summaries), ""])
        rows.append(["  estimated error of the integral", *(f"{s.off:.1e}" for s in summaries), ""])
    if any(math.isfinite(s.energy.growth) for s in summaries) and not noisy:
        growth = [f"{s.energy.growth:.3g}" if math.isfinite(s.energy.growth) else "–" for s in summaries]
        rows.append(["  last tenth/first", *growth, "1 is no drift"])
    for kind, noun in (("casimirs", "Casimir"), ("invariants", "invariant")):
        for name, drift in getattr(first, kind).items():
            moves, label = drift.unit.moves and not noisy, f"{noun} {name}"
            label = f"{'change' if moves else 'error'} of the {label}" if driven or moves else label
            rows.append([label, *(_formatted_value(getattr(s, kind)[name]) for s in summaries), drift.unit.kind])
    if first.exact:
        rows.append(["against closed form", *(_formatted_value(s.exact) for s in summaries if s.exact), "relative"])
    if any(s.good < s.rows for s in summaries):
        rows.append(["finite rows", *(f"{s.good} of {s.rows}" for s in summaries), ""])
    return rows


def print_averages(names: Sequence[str], averages: Averages, observables: Sequence[str] = ()) -> None:
    """Print the time averages of observables over the rows of a run.

    ``names`` lists the observables in ``averages``. ``observables`` lists those to print; if the list is empty, all are
    printed.
    """
    if not averages.count:
        out("\n  observables have no means: the time span that `average` selects contains no stored row")
        return
    first, last = averages.times
    out(f"\n  observables, means over {counted(averages.count, 'row')} from t = {first:.9g} to {last:.9g}")
    shown_averages = {n: a for n, a in zip(names, averages.results(), strict=True) if n in (observables or names)}
    header = ["", "mean", "standard error", "least", "largest", "correlation time"]
    rows = [
        [name, f"{a.mean:.6g}", f"{a.error:.1g}", f"{a.least:.6g}", f"{a.largest:.6g}", _time_shown(a)]
        for name, a in shown_averages.items()
    ]
    for line in table([header, *rows], right=range(1, 6)):
        out(f"  {line}")
    if unresolved := [name for name, a in shown_averages.items() if not a.resolved and math.isfinite(a.error)]:
        listing = ", ".join(unresolved)
        out(f"  The standard errors of {listing} are too small: blocks of rows are shorter than ten correlation times.")


def _time_shown(average: Average) -> str:
    """Return the correlation time of an average as text.

    If blocks of rows are too short for an estimate, the number is only a lower bound. Then the text begins with ">".
    """
    return "> " * (not average.resolved and math.isfinite(average.error)) + f"{average.correlation_time:.2g}"


def _print_means(recorder: Recorder) -> None:
    """Print the mean and the standard error of each coordinate and of the energy.

    The means are those of all members, at the end of the run.
    """
    run, means = recorder.experiment.run, recorder.means()
    out(f"\n  means over {run.members} members at t = {recorder.time:.9g}")
    for line in table([[name, f"{mean:.6g}", f"± {error:.1g}"] for name, (mean, error) in means.items()], right=[1]):
        out(f"  {line}")


def _formatted_value(drift: Drift) -> str:
    return f"{drift.error:.1e}" if drift.error else "0"


def described_run(compilation: Compilation, recorder: Recorder, summaries: Sequence[Summary]) -> dict[str, Any]:
    """Return the summary as data for JSON."""
    from dataclasses import asdict

    experiment, solver, session = recorder.experiment, recorder.solver, recorder.session
    description = {
        "name": compilation.spec.name,
        "run": experiment.run.name,
        "target": solver.target,
        "order": solver.order,
        "birealisation": compilation.birealisation,
        **compilation.described,
        "profile": compilation.program.profile,
        "threads": 1,
        "exact": compilation.exact,
        "step": experiment.h,
        "steps": recorder.steps,
        "time": recorder.time - experiment.t0,
        **({"start": experiment.t0} if solver.interface.time else {}),
        "parameters": experiment.parameters,
        "initial": dict(zip(solver.coordinates, experiment.initial, strict=True)),
        "final": dict(zip(solver.coordinates, session.state().tolist(), strict=True)),
        "methods": [asdict(s) for s in summaries],
    }
    if solver.interface.observables:
        description["observables"] = described_averages(
            solver.interface.observables, recorder.averages, experiment.run.average.of
        )
    if solver.interface.noise:
        description |= {"seed": experiment.run.seed, "members": experiment.run.members}
        if experiment.run.members > 1:
            description["means"] = {name: {"mean": m, "error": e} for name, (m, e) in recorder.means().items()}
    if recorder.finder:
        description["section"] = {"expression": recorder.section_text, "crossings": recorder.points.seen}
    if spectrum := recorder.spectrum:
        description["lyapunov"] = described_spectrum(spectrum)
    return description


def described_averages(names: Sequence[str], averages: Averages, observables: Sequence[str] = ()) -> dict[str, Any]:
    """Return the time averages by the names of observables, as data for JSON.

    If ``observables`` is not empty, only the averages of these observables are returned.
    """
    from dataclasses import asdict

    named_results = zip(names, averages.results(), strict=True)
    return {name: asdict(average) for name, average in named_results if name in (observables or names)}


def described_spectrum(spectrum: Spectrum) -> dict[str, Any]:
    """Return Lyapunov exponents and their uncertainty as a dictionary for JSON."""
    return {
        "exponents": spectrum.exponents.tolist(),
        "largest": spectrum.largest,
        "sum": spectrum.total,
        "pairing": spectrum.pairing,
        "uncertainty": spectrum.uncertainty,
        "time": spectrum.t,
        "history": {"time": spectrum.times.tolist(), "exponents": spectrum.history.tolist()},
    }


def finite(value: Any) -> Any:
    """Return data in which null replaces NaN and infinity, which JSON does not have."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(v) for key, v in value.items()}
    return [finite(v) for v in value] if isinstance(value, list | tuple) else value
