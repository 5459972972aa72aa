"""Content of the page of ``phigen report``: one run, integrated and verified, and a study of its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

from phigen.cli.console import Console
from phigen.cli.experiment import Experiment, loaded
from phigen.cli.interruption import InterruptedRunError
from phigen.cli.report_study import environment, studied
from phigen.errors import PhigenError, StepError
from phigen.report.material import Material

if TYPE_CHECKING:
    from phigen.cli.recording import Recorder
    from phigen.compilation import Compilation
    from phigen.proofs.examination import Examination
    from phigen.report.live import Live
    from phigen.runtime.solver import Solver
    from phigen.runtime.trajectory import Trajectory
    from phigen.study.verification import Verification

#: The page has the state after each of the first steps of a run, up to this number of steps. So the viewer of the page
#: can show the beginning of the run without gaps.
_OPENING = 4_000


def gathered(
    examination: Examination,
    compilation: Compilation,
    experiment: Experiment | None,
    command_line: str,
    scheme: str | None,
    lyapunov: bool,
    quick: bool,
    console: Console,
) -> tuple[Material, list[PhigenError]]:
    """Return the content of the page, and the errors that occurred when its parts were made."""
    from phigen.cli.endings import ended, timed

    material = Material(examination, compilation, command_line)
    if experiment is None:
        note = "The spec has no runs: nothing was measured. Add one under runs: with initial, step and steps."
        return replace(material, notes=(note,)), []
    material = replace(material, live=_live(compilation, experiment, scheme, console))
    solver = loaded(compilation, "auto", console)
    experiment = timed(ended(experiment, solver, console), solver)
    material, failures = _integrated(material, solver, experiment, lyapunov, console)
    if failures:
        return material, failures
    verification = _verified(compilation, experiment, quick, console)
    if verification.failures:
        from phigen.cli.verify import missed_bounds

        failures.append(missed_bounds(verification))
    material = _with_constancy(material, experiment)
    study, note = studied(compilation, experiment, quick, console)
    notes = (*material.notes, note) if note else material.notes
    machine = environment() if study else {}
    return replace(material, verification=verification, study=study, notes=notes, environment=machine), failures


def _live(compilation: Compilation, experiment: Experiment, scheme: str | None, console: Console) -> Live:
    """Return the live panel of the page. It runs the solver in the browser, from the start of the experiment."""
    from phigen.report import live

    console.note(f"{compilation.spec.name}: compiling for the page")
    run = replace(experiment.run, initial=tuple(map(Fraction, experiment.initial)))
    return live.gathered(compilation, scheme, run, experiment.parameters)


def _integrated(
    material: Material, solver: Solver, experiment: Experiment, lyapunov: bool, console: Console
) -> tuple[Material, list[PhigenError]]:
    """Integrate the run by the solver, and by the methods for comparison.

    Return ``material`` with the trajectories. The second result is a list with the error of the solver if the run
    failed, else [].
    """
    from phigen.cli.recording import Files, Recorder, compared
    from phigen.cli.run_summary import steps_text
    from phigen.study.classical import COMPARED

    compilation, run = material.compilation, experiment.run
    console.note(f"{compilation.spec.name}: run {run.name}, {run.steps} steps")
    recorder = Recorder(compilation, solver, experiment, Files(), lyapunov)
    failure = _recorded(recorder, console)
    methods, summaries = {recorder.label: recorder.trajectory(failure is not None)}, [recorder.watch.summary()]
    beside = () if compilation.system.noise else run.compare or COMPARED
    for method in beside if failure is None else ():
        watch, methods[method] = compared(compilation, solver, experiment, method, console, recorder.time)
        summaries.append(watch.summary())
    opening = _opening(compilation, solver, experiment, list(methods)[1:2], console) if failure is None else {}
    integrated = replace(
        material,
        run=run,
        steps=steps_text(recorder),
        opening=opening,
        methods=methods,
        summaries=tuple(summaries),
        section=(recorder.section_text, recorder.points.rows[:, 1:], recorder.points.seen) if recorder.finder else None,
        spectrum=recorder.spectrum,
        notes=(f"The run could not be completed: {failure}.",) if failure else (),
    )
    return integrated, [failure] if failure else []


def _recorded(recorder: Recorder, console: Console) -> StepError | None:
    """Integrate the run; return the failure, or None."""
    from phigen.cli.recording import record

    recorder.start()
    failure, interrupted = record(recorder, console)
    if interrupted:
        raise InterruptedRunError("interrupted: no page was written")
    return failure


def _opening(
    compilation: Compilation, solver: Solver, experiment: Experiment, other_methods: Sequence[str], console: Console
) -> dict[str, Trajectory]:
    """Return trajectories over the first steps, with a row for every step: those of the solver and of other methods.

    The result is empty if the trajectory of the whole run already has a row for every step.
    """
    from phigen.cli.recording import Files, Recorder, compared

    run, is_short = experiment.run, experiment.run.steps <= _OPENING
    if run.stride == 1 and is_short and experiment.times is None:
        return {}
    opening = replace(run, steps=min(run.steps, _OPENING), stride=1, section=None)
    first = replace(experiment, run=opening, end=experiment.end if is_short else None, times=None)
    recorder = Recorder(compilation, solver, first, Files(), lyapunov=False)
    failure = _recorded(recorder, console)
    other_trajectories = {
        method: compared(compilation, solver, first, method, console, recorder.time)[1] for method in other_methods
    }
    return {recorder.label: recorder.trajectory(failure is not None), **other_trajectories}


def _with_constancy(material: Material, experiment: Experiment) -> Material:
    """Add to the material of a report how much the modified Hamiltonian changes along the run. If this cannot be
    measured, the reason is added instead.
    """
    from phigen.cli.verify import constancy_of
    from phigen.study.backward import NotOfferedError

    try:
        return replace(material, constancy=constancy_of(material.compilation, experiment))
    except NotOfferedError as error:
        return replace(material, no_constancy=str(error))
    except StepError as error:
        return replace(material, no_constancy=f"a step failed: {error}")


def _verified(compilation: Compilation, experiment: Experiment, quick: bool, console: Console) -> Verification:
    from phigen import registry
    from phigen.cli.verify import verified
    from phigen.runtime import toolchain

    console.note(f"{compilation.spec.name}: verifying")
    targets = compilation.spec.targets if toolchain.available() else (registry.automatic(compiler=False),)
    return verified(compilation, experiment.run.name, quick, console, targets)
