"""Section on errors against step size and computing time."""

from __future__ import annotations

from markupsafe import Markup

from phigen.report import page
from phigen.report.drawable import drawable
from phigen.study.precision import Study

#: Errors for which the computing time is tabulated.
TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)


def precision_section(study: Study) -> Markup:
    """Return the section on convergence, work and precision, with the conditions of the measurement."""
    conditions = (
        f"All methods solve the same problem up to {study.clock} = {study.time:.9g}. This is the time of {study.steps} "
        "steps of the run; other steps are up to 64 times larger and 128 times smaller. Errors are relative, against "
        f"{study.reference}, whose own error is about {page.scientific(study.floor)}."
    )
    blocks = [page.paragraph(conditions)]
    if drawable():
        from phigen.report import pictures

        blocks.append(pictures.convergence_picture(study))
    blocks += [page.heading("Work and precision"), page.paragraph(_conditions(study)), _to_reach(study)]
    if drawable():
        blocks.append(pictures.work_picture(study))
    return page.joined([*blocks, page.fold("All numbers", _all(study))])


def _conditions(study: Study) -> str:
    note = (
        "All methods and the vector field are compiled in one C file with the same flags, so calls can be inlined"
        if study.language == "C"
        else "There was no C compiler: all methods ran in Python with NumPy, so times are mostly the interpreter's"
    )
    return (
        f"{note}. Each time is the fastest of {study.rounds} repetitions, in which the methods take turns. The times "
        f"do not include the set-up of the solver, which took {page.scientific(study.set_up)} s for a trajectory. Over "
        "a short time, explicit methods of high order often need less time for the same error of the solution, but "
        "their errors of Casimirs and energy are not smaller than this error."
    )


def _to_reach(study: Study) -> Markup:
    columns = [("", "relative error of the solution"), *(("number measured", c.label) for c in study.curves)]
    rows = [
        (page.scientific(t, 1), [("number measured", page.scientific(c.seconds_for(t))) for c in study.curves])
        for t in TOLERANCES
        if t > study.floor
    ]
    return page.table("Seconds of a run with at most this error (measured)", columns, rows)


def _all(study: Study) -> Markup:
    columns = [("", "method and step"), ("number", "steps"), ("number", "error"), ("number", "error of Casimirs")]
    rows = [
        (
            f"{c.label}, {p.step:.4g}",
            [("number", str(p.steps)), ("number", page.scientific(p.error)), ("number", page.scientific(p.casimirs)),
             ("number measured", page.scientific(p.seconds))],
        )
        for c in study.curves
        for p in c.points
    ]  # fmt: skip
    return page.table("Errors and times", [*columns, ("number measured", "seconds (measured)")], rows)
