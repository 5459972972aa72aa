"""Gauss methods in C: coefficients, sizes of arrays, and the kernels that are evaluated at one stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.gauss.tableau import DOUBLE, EARLIER, SINGLE, Tableau, continuation, predictors, tableau
from phigen.lanes.in_lanes import Lanes, Stages, in_lanes
from phigen.scheme.kernel import Kernel
from phigen.scheme.lowering import operation_counts
from phigen.scheme.policies import POLICIES, GaussPolicy
from phigen.scheme.program import Program
from phigen.scheme.steps import Gauss
from phigen.targets.c.real import rendered

#: Threshold for the end of sweeps in single precision; `phigen.targets.c.real.threshold` converts this number to 1e-9.
#: The converted threshold is about 1/60 of the rounding error of single precision. In double precision the threshold is
#: 2e-18, about 1/60 of the rounding error of double precision. If 2e-18 were converted, the result would be 1e-8, and
#: the energy error of 1e5 steps of Hénon–Heiles would be 2e-5 instead of 5e-7.
SINGLE_SOLVED = 1.3e-20

#: Threshold for the end of sweeps if the stages of a method are in a loop, not in lanes. It was chosen for the
#: Hénon–Heiles system at order 12, by 3e5 steps of size 0.7. With the usual threshold 2e-18, the relative energy drifts
#: by 1.7e-18 per step. With 5e-19, it drifts by less than 2e-19 per step, and steps take 5 % longer.
LOOP_SOLVED = 5e-19


def policy(*, single: bool, staged: bool) -> GaussPolicy:
    """Return the thresholds of the iteration that solves the stages of a Gauss method. ``staged`` says that the stages
    are in SIMD lanes, ``single`` that the solver has single precision.
    """
    usual = POLICIES["gauss_policy"]
    assert isinstance(usual, GaussPolicy)
    if single:
        return replace(usual, solved=SINGLE_SOLVED)
    return usual if staged else replace(usual, solved=LOOP_SOLVED)


def _width(step: Gauss, lanes: Lanes | None) -> int:
    """Return the length of an array over the stages: the number of lanes if stages are in lanes, else the number of
    stages.
    """
    return lanes.lanes if isinstance(lanes, Stages) else step.tableau.stages


def declared(step: Gauss, lanes: Lanes | None) -> list[tuple[str, int, str]]:
    """Return sizes of a Gauss method: name, value and comment. They are declared together with the struct of the
    solver.
    """
    width = _width(step, lanes)
    return [
        ("NODES", step.tableau.stages, "number of stages of a step"),
        (
            "WIDTH",
            width,
            "number of entries of an array over the stages" + ", to fill a vector" * (width > step.tableau.stages),
        ),
        ("UNKNOWNS", step.unknowns, "number of unknowns of a stage"),
        *([("EARLIER", EARLIER, "number of steps that predictors read")] if isinstance(lanes, Stages) else []),
        *([("LIFT", step.lift.size, "components of frames of group elements")] if step.lift else []),
    ]


def constants(program: Program, step: Gauss) -> list[tuple[str, int, str]]:
    """Return the sizes of a Gauss step other than the number of stages: name, value and comment."""
    return [
        (
            "PLAIN",
            step.plain,
            "changes of the first PLAIN unknowns are relative to |x|",
        ),
        (
            "POINT",
            program.dimension + bool(program.time) + (step.lift.size if step.lift else 0),
            "numbers that define the start of a step: coordinates, and the time if H depends on it"
            + ", and frames" * bool(step.lift),
        ),
        ("MAX_SWEEPS", step.most_sweeps, "largest number of sweeps over the stages of a step"),
    ]


def scalar_kernels(step: Gauss, *, staged: bool) -> list[Kernel | None]:
    """Return the kernels that are evaluated at a single stage.

    If stages are in lanes (``staged``), most kernels are evaluated at all stages together, and are left out here.
    """
    at_stages = [] if staged else [step.slope, step.frame]
    at_stages += [step.reduced.follow] if staged and step.reduced else []
    at_stages += [step.lift.functionals] if step.lift else []
    varied = [step.tangent.slope, step.tangent.change] if step.tangent else []
    transposed = step.adjoint.steps if step.adjoint else ()
    back = [k for k in transposed if not (staged and k in step.stage_transposes)]
    return [step.prepare, *at_stages, step.change, *varied, *back]


def trail(program: Program, step: Gauss, lanes: Lanes | None) -> int:
    """Return the number of values that one step stores on the tape: the state at its start, and its stage
    increments.
    """
    return program.dimension + step.unknowns * _width(step, lanes)


def tables(program: Program, step: Gauss, lanes: Lanes | None, *, batched: bool) -> str:
    """Return the tables of coefficients, and the functions that compute the unknowns of stages from stage increments.

    ``batched`` adds the function for batches with one member of an ensemble in each lane.
    """
    table, width = step.tableau, _width(step, lanes)
    precision = SINGLE if program.single else DOUBLE
    if program.single:
        table = tableau(table.stages, SINGLE)  # coefficients rounded to float would not have the sum 1
    staged = isinstance(lanes, Stages)
    predictions = predictors(table.stages, precision, integrated=staged and bool(step.reduced))
    if not staged:  # in single precision, extrapolating stages would amplify rounding errors to the size of increments
        predictions = [[list(row) for row in table.prediction] if program.single else continuation(table.stages)]
    terms = [f"matrix[{j}][lane] * increment[{j}]" for j in range(table.stages)]
    older = [f"matrix[{table.stages + j}][lane] * before[{j}]" for j in range(table.stages)]
    of_members = [f"matrix[{j}][i] * increments[{j}][k][lane]" for j in range(table.stages)]
    values = {
        "NAME": program.name,
        "nodes": _row(table.nodes, table.stages),
        "weights": _row(table.weights, width),
        "mixing": _columns(table.mixing, width),
        "predicted": "integrals up to the stages" if staged and step.reduced else "the stages",
        "predictors": len(predictions),
        "prediction": _columns(predictions[0], width),
        "predictions": [_columns(rows, width) for rows in predictions],
        "terms": _in_chains(terms) if staged else "",
        "terms_of_two": _in_chains([*terms, *older]) if staged else "",
        "member_terms": _in_chains(of_members) if batched else "",
        "total": _halved([f"values[{j}]" for j in range(table.stages)]),
        "reduced": False,
        "copy_count": len(step.lift.copies) if step.lift else 0,
        "copies": [_listed(copy) for copy in step.lift.copies] if step.lift else [],
        **(_reduced(step, table, width) if staged and step.reduced else {}),
    }
    return rendered(program, "gauss.c", values)


def with_frames(program: Program) -> Program:
    """Return the program with the step of `Gauss.lifted`, if the solver can use it; else return the program
    unchanged.

    In the step of `Gauss.lifted`, group elements have frames, and the frames change from step to step. This step is
    used in double precision, if single trajectories have their stages in SIMD lanes and ensembles are not integrated in
    batches. A batch has no frames, and its steps must equal those of single trajectories.
    """
    step = program.step.lifted
    lanes = in_lanes(program) if step else None
    if step is None or not isinstance(lanes, Stages) or lanes.batched or program.single:
        return program
    about = replace(program.about, operations=operation_counts(step.slope.roots))
    return replace(program, step=step, about=about)


def _reduced(step: Gauss, table: Tableau, width: int) -> dict[str, object]:
    """Return the values for the template of sweeps over some of the unknowns; see `ReducedSweeps` in
    `phigen.scheme.steps`.
    """
    reduced = step.reduced
    assert reduced is not None
    return {
        "reduced": True,
        "iterated": _listed(reduced.iterated),
        "iterated_count": len(reduced.iterated),
        "followers": _listed(reduced.followers),
        "follower_count": len(reduced.followers),
        "read_count": len(reduced.integrated),
        "doubled": _columns(table.doubled, width),
        "times": _row(table.times, width),
        "places": _listed([reduced.iterated.index(k) for k in reduced.integrated]),
    }


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))


def _in_chains(terms: Sequence[str]) -> str:
    """Return a sum as text. It consists of two partial sums, which a processor computes in parallel."""
    return " + ".join(f"({' + '.join(terms[k::2])})" for k in range(min(2, len(terms))))


def _halved(terms: Sequence[str]) -> str:
    """Return a sum as text. Its terms are added in pairs, then the sums of pairs in pairs, and so on, so that no
    addition waits for a long chain of other additions.
    """
    if len(terms) == 1:
        return terms[0]
    half = (len(terms) + 1) // 2
    pairs = [f"({a} + {b})" for a, b in zip(terms, terms[half:], strict=False)]
    return _halved([*pairs, *terms[len(pairs) : half]])


def _columns(rows: Sequence[Sequence[float]], width: int) -> list[str]:
    return [_row([row[j] for row in rows], width) for j in range(len(rows[0]))]


def _row(values: Sequence[float], width: int) -> str:
    return ", ".join(map(repr, [*values, *[0.0] * (width - len(values))]))
