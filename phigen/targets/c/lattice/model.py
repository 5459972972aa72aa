"""Lattices in C: public declarations, and tables that the runtime reads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from phigen.ir.lattice_loops import bounds
from phigen.ir.lattice_parameters import are_allowed
from phigen.scheme.policies import LatticeNewtonPolicy, LatticeSweepPolicy
from phigen.scheme.program import MAX_NORMAL_VARIATE, Program
from phigen.scheme.steps import Sweeps
from phigen.scheme.sweep_facts import band, reach
from phigen.spec.model import Parameter, Reduction
from phigen.spec.names import OVER, REDUCTIONS
from phigen.targets.c import functions
from phigen.targets.c.kernels import function
from phigen.targets.c.language import members
from phigen.targets.c.lattice.layout import (
    MOST_REMEMBERED,
    Layout,
    layout_of,
    switches,
)
from phigen.targets.c.lattice.loops import share
from phigen.targets.c.loops import commented
from phigen.targets.c.real import rendered
from phigen.targets.header import plain


def declarations(program: Program, step: Sweeps) -> str:
    """Return the text of the public declarations: sizes and the parameter struct."""
    member, layout = members(program), layout_of(program, step)
    listed = [_declared(p, member[p.name]) for p in program.parameters]
    arrays = len(layout.lattice.arrays)
    sizes = [
        (
            "ARRAYS",
            arrays,
            f"number of arrays over sites: fields, parameters{', noise' * bool(program.noise)}",
        ),
        ("COEFFICIENTS", max(1, step.row * rows_of(step)), "number of coefficients: functions of params and h"),
    ]
    if step.equation:
        stages, has = len(program.fractions), switches(layout)
        sizes += [("STAGES", stages, "number of stages of a step")] if stages > 1 else []
        sizes += (
            [("DIRECTIONS", LatticeNewtonPolicy().directions, "largest dimension of a Krylov space of Newton's method")]
            if has["KRYLOV"]
            else []
        )
        sizes += (
            [("DIFFERENCES", _differences(program), "number of differences in the predictor of a stage")]
            if has["SWEEP_PREDICTORS"]
            else []
        )
    if step.partners:
        sizes.append(("GATHERED", _gathered(layout), "for each site, number of stored sums over its bonds or pairs"))
    if step.sites.at_bonds:
        sizes.append(("BOND_ARRAYS", len(step.sites.at_bonds), "number of parameters at bonds"))
    values = {
        "NAME": program.name,
        "axes": len(step.sites.axes),
        "several": len(step.sites.axes) > 1,
        "axis_names": ", ".join(step.sites.axes),
        "n": program.dimension,
        "order": program.order,
        "casimir_count": len(program.casimirs),
        "version": program.version,
        "sha256": program.about.spec_sha256,
        "coordinates": ", ".join(program.coordinates),
        "casimirs": f" /* {', '.join(program.casimirs)} */" if program.casimirs else "",
        "observed_count": len(program.observed),
        "observed": ", ".join(program.observed),
        "field_count": len(program.observables.fields),
        "fields": ", ".join(program.observables.fields),
        "noise": program.noise is not None,
        "members": listed or [("char unused;", "this system has no parameters")],
        "sizes": sizes,
        "bars": _bars(program, member) if step.adjoint else [],
    }
    return rendered(program, "lattice.h", values)


def _differences(program: Program) -> int:
    """Return the number of past differences from which the predictor of a stage extrapolates.

    The differences are those of y − x, where y is the solution of the stage and x is the state at the start of the
    stage.
    """
    return max(1, min(LatticeSweepPolicy().differences, MOST_REMEMBERED // len(program.fractions)))


def _gathered(layout: Layout) -> int:
    """Return the number of sums over bonds or pairs that a solver stores for all sites."""
    partners, swept = layout.partners, [sweep.gather for sweep in layout.step.sweeps if sweep.gather]
    seen = () if layout.sums_up else partners.gathers
    return max([1, *(len(g.names) for g in (*swept, *seen))])


def _reserved(layout: Layout, has: Mapping[str, bool]) -> int:
    """Return the number of arrays over the sites in the memory of a solver, including the fields and parameters."""
    program, dimension, stage = layout.program, layout.program.dimension, 0
    if layout.step.equation:
        # y before and after a sweep; without kernels of derivatives along variations, also a perturbed y for difference
        # quotients
        stage = 2 if layout.slopes else 3
        stage += len(program.fractions) * _differences(program) * has["SWEEP_PREDICTORS"]
        stage += (
            has["BANDED"]
            + (LatticeNewtonPolicy().directions + 1 + (dimension + 1) * has["SITE_BLOCKS"]) * has["KRYLOV"]
        )
        stage = stage * dimension + has["KRYLOV"]  # plus an array for sums over row segments
    fields = dimension + 2 * dimension * has["COMPENSATED"]  # the state before a step, and compensation terms
    fields += bool(layout.step.sites.seams)  # plus an array for the kinds of sites
    fields += 2 * has["MONITOR"]  # plus arrays for densities and for the clock
    if layout.step.relative and has["JACOBI"]:  # positions relative to the first body, and their variations
        fields += len(layout.step.relative.axes) * (1 + layout.program.extras.tangent)
    return len(layout.lattice.arrays) + fields + (_gathered(layout) if has["GATHER"] else 0) + stage


def _bars(program: Program, member: Mapping[str, str]) -> list[str]:
    """Return the declarations of a C struct with the cotangents of the parameters."""
    declared = [f"double {'*' * (p.at != 'all')}{member[p.name]};" for p in program.parameters]
    return declared or ["char unused;"]


def rows_of(step: Sweeps) -> int:
    """Return the number of rows of coefficients: one for each stage or, in a splitting, one for each item of
    `_flows`.
    """
    return len(step.schedule.times) if step.equation else len(_flows(step))


def _flows(step: Sweeps) -> list[tuple[int, int]]:
    """Return the flows for which there are coefficients, as pairs: a part, and an index in the ``times`` of the
    schedule.

    The list begins with the flows of one step. If the method has a corrector, the flows at the start of a run follow,
    then the flows at its end. If there is neither a corrector nor noise, the first flow of a step occurs once more: it
    stands for the last flow of a step, merged with the first flow of the next step. With noise, flows are not merged,
    since each flow has its own increments.
    """
    flows = step.schedule.flows
    if step.corrected:
        return [*flows, *step.schedule.begin, *step.schedule.end]
    return [*flows, *([] if step.sites.increments else flows[:1])]


def _by_flow(step: Sweeps, values: Sequence[float], joined: float) -> list[float]:
    """Return one value for each flow of `_flows`. ``values`` has a value for each row of the schedule. If the last flow
    of a step is merged with the first flow of the next step, the merged flow has the value ``joined``.
    """
    by_flow = [values[row] for _, row in _flows(step)]
    return by_flow if step.sites.increments or step.corrected else [*by_flow[:-1], joined]


def _declared(parameter: Parameter, member: str) -> tuple[str, str]:
    said = plain(parameter.description) or f"default {float(parameter.value)!r}"
    said = said if member == parameter.name else f"{parameter.name}: {said}"
    if parameter.at != "all":
        if parameter.values is not None:
            said = plain(parameter.description) or ("" if member == parameter.name else parameter.name)
            said = "; ".join(filter(None, [said, "required (no default)"]))
            return f"const double *{member};", f"at {parameter.at}: {said}"
        return f"const double *{member};", f"at {parameter.at}: {said}; NULL for the default everywhere"
    return f"double {member};", said


def model(program: Program, step: Sweeps) -> str:
    """Return the text of tables and of functions. The functions check parameters or compute coefficients, or they are
    elementary functions that loops call.
    """
    layout = layout_of(program, step)
    has = switches(layout)
    values = {
        "NAME": program.name,
        "defaults": ", ".join("NULL" if p.at != "all" else repr(float(p.value)) for p in program.parameters) or "0",
        "constants": [*_constants(layout, has)],
        **_tables_of_sites(layout, has),
        **_tables_of_flows(step),
        "middles": ", ".join(map(repr, program.midpoints)),
        "fractions": len(program.fractions) > 1,
        "bound": repr(MAX_NORMAL_VARIATE) if program.noise else "",
        "reductions": ", ".join(_braced(_reduction(r)) for r in program.observables.reductions),
        "joined": not program.noise and not step.corrected,
        "late": has["LATE"],
    }
    timed = step.refresh or (program.time and step.equation)
    prepare = rendered(program, "middles.c", values) if timed else ""
    prepare += function(program, step.prepare)
    prepare += "\n" + function(program, step.refresh) if step.refresh else ""
    allowed = are_allowed(program.parameters, members(program), graph=layout.graph)
    texts = [*(rendered(program, f"{part}.c", values) for part in ("lattice", "lattice_flows"))]
    unprinted = [step.equation.slope] if step.equation and not layout.slopes else ()
    called = [f"{text}\n" for text in functions.called(program, unprinted)]
    return "".join([*texts, commented(allowed, program), "\n", *called, prepare])


def _constants(layout: Layout, has: Mapping[str, bool]) -> Iterator[tuple[str, int, str]]:
    """Yield the constants of the C file: name, value and comment."""
    program, step, sites, several = layout.program, layout.step, layout.step.sites, not layout.single_row
    if densities := program.observables.named:
        yield "SHARE", share(densities), "sites whose densities of observables are computed in one pass"
    if has["HALO"]:
        yield "HALO", layout.halo, "number of sites that are copied beyond each end of a row"
        yield "LEAD", (layout.halo + 7) // 8 * 8, "number of doubles before the first site of a row"
    yield "RESERVED", _reserved(layout, has), "number of arrays over the sites in the memory of a solver"
    if several:
        yield "LINES", len(layout.lines), "number of rows that a loop over one row reads: this row and its neighbours"
    yield "ROW", max(1, step.row), f"number of coefficients of one {'stage' if step.equation else 'flow'}"
    yield "ROWS_OF_FLOWS", rows_of(step), "number of rows of coefficients"
    if step.refresh:
        yield (
            "PREPARED",
            step.prepared,
            "number of coefficients in a row that do not depend on the time; they come first",
        )
    if program.noise:
        sources = program.noise.sources
        yield "SOURCES", len(sources), f"sources of noise at a site: {', '.join(sources)}"
        yield "DRAWN", program.dimension + len(sites.parameters), "index of the first array of increments of noise"
        yield (
            "PARTS",
            program.noise.parts,
            "number of increments of one source in a step",
        )
    if step.equation:
        yield (
            "SIDES",
            2 if layout.slopes else 3,
            "number of arrays for y: before and after a sweep" + ", and varied" * (not layout.slopes),
        )
        yield "MOST_SWEEPS", step.equation.most_sweeps, "largest number of sweeps of a stage"
        if has["BANDED"]:
            yield "REACH", reach(step), "number of sites on each side on which y at a site depends"
            yield "BAND", band(step), "number of off-diagonals on each side in the matrix of Newton's method"
    else:
        yield "FLOWS", len(step.schedule.flows), "number of flows in a step"
    if step.corrected:
        yield (
            "FLOWS_BEFORE",
            len(step.schedule.begin),
            "number of flows before a run; flows after a run come last in the tables",
        )
    if step.rates:
        yield "NEGATIVE", 1 + step.rates.negative, "number of the part B of H, which is negative, counted from 1"
    if step.relative:
        bodies = step.relative
        yield "BODY_AXES", len(bodies.axes), "axes along which bodies have a position and a velocity or momentum"
        yield "MASS", layout.lattice.arrays.index(bodies.mass), "index of the array of masses"
        yield (
            "INNER",
            layout.lattice.arrays.index(sites.derived[0]),
            "index of the array of central masses of the orbits",
        )
        yield (
            "REMAINDER",
            1 + bodies.remainder,
            "number, from 1, of the part of H besides the Kepler motions",
        )
    if has["WAVES"]:
        distances = [max(step.stage(k, program.coordinates)[:2]) for k in range(len(step.parts))]
        span = max(1, *distances) if several else 1
        yield "SPAN", span, f"number of slices that a flow reads on each side of a slice: see {program.name}_slices"
    if layout.lattice.weights and several:
        yield "WEIGHTS", len(layout.lattice.weights), "kinds of terms that reach beyond open ends"
    if sites.colours > 1:
        yield "COLOUR_COUNT", sites.colours, "colours of sites"
        yield "COLOUR_STRIDE", sites.weights[-1], "change of the colour number from site to site along a row"


def _tables_of_sites(layout: Layout, has: Mapping[str, bool]) -> dict[str, object]:
    """Return the tables that are the same in all steps: the shape of the lattice, neighbours of sites, and sweeps."""
    step, sites, several, fields = layout.step, layout.step.sites, not layout.single_row, layout.program.coordinates
    stages = [_braced(step.stage(k, fields)) for k in range(len(step.parts))] if has["BY_HAND"] else []
    return {
        "least": ", ".join(map(str, sites.min_sizes)),
        "periods": ", ".join(map(str, sites.periods)) if has["PERIODIC_COLOURS"] else "",
        "several": several,
        "ends": several or has["BANDED"],
        "open": ", ".join(str(int(o)) for o in sites.open_axes),
        "lines": ", ".join(_braced([*line, 0]) for line in layout.lines),
        "weights": ", ".join(
            _braced([_braced(pair) for pair in bounds(w.key)]) for w in layout.lattice.weights if several
        ),
        "colours": ", ".join(map(str, sites.weights)) if sites.colours > 1 and (several or sites.seams) else "",
        "seams": ", ".join(_braced([s.period, s.min_length, s.margin]) for s in sites.seams),
        "graph": layout.graph,
        "body_axes": ", ".join(_braced(axis) for axis in step.relative.axes) if step.relative else "",
        "stages": ", ".join(stages),
    }


def _tables_of_flows(step: Sweeps) -> dict[str, object]:
    """Return the tables that have an entry for each flow, as template values."""
    schedule = step.schedule
    joined = schedule.times[schedule.flows[0][1]] + schedule.times[schedule.flows[-1][1]]
    multiples = _by_flow(step, schedule.multiples, schedule.multiples[0]) if schedule.multiples else ()
    return {
        "times": ", ".join(map(repr, schedule.times if step.equation else _by_flow(step, schedule.times, joined))),
        "split": step.equation is None,
        "multiples": ", ".join(map(repr, multiples)),
        "moments": ", ".join(map(repr, _moments(step))) if step.refresh and not step.equation else "",
        "parts": ", ".join(str(part + (not step.by_colour)) for part, _ in _flows(step)),
        "by_colour": ", ".join(str(int(c)) for c in step.by_colour),
    }


def _moments(step: Sweeps) -> list[float]:
    """Return the times at which coefficients that depend on the time are evaluated, one for each row of coefficients.

    The times are in units of the step, from the start of the step.
    """
    return _by_flow(step, step.schedule.moments, 0.0)


def _reduction(reduction: Reduction) -> tuple[int, int]:
    """Return the codes that the runtime has for a reduction, such as a sum, and for the set over which a mean is
    taken.
    """
    return REDUCTIONS.index(reduction.kind), OVER.index(reduction.over)


def _braced(items: Sequence[object]) -> str:
    return "{ " + ", ".join(map(str, items)) + " }"
