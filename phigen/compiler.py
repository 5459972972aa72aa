"""The pipeline of the compiler, from a spec to the source files of a solver.

    spec file ─► Spec ─► System ─► BiRealisation ─► Gauged ─► Discretisation ─► Program ─► source files
                            │   └─► SplitHamiltonian ───────────────────────────┘  │
                            └───────────────────────► Examination ◄────────────────┘

Each arrow is a function from one frozen dataclass to the next. `Compilation` holds the results and durations of all
these functions. `Gauged` holds the Hamilton–Jacobi series, whose terms are computed once, on request. `Discretisation`
holds the generating function. `Examination` holds the proofs. Statements about the system are proved before the method
is built, and statements about the method afterwards.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar, Unpack

from phigen import progress, registry
from phigen.compilation import Compilation, CompiledGauss, CompiledLattice, CompiledSeries, CompiledSplitting
from phigen.errors import CheckError, Diagnostic, LimitError, PhigenWarning, SpecError
from phigen.geometry.system import System, system_from_spec
from phigen.proofs import statements
from phigen.proofs.examination import UNEXAMINED, Examination, doubts, located, refutation, refuted
from phigen.realisations.catalogue import realise
from phigen.realisations.protocol import BiRealisation
from phigen.scheme import efficiency
from phigen.scheme.assemble import build_program
from phigen.scheme.choosing import plan as plan_splitting
from phigen.scheme.choosing import planned as plan_without_kicks
from phigen.scheme.discretisation import discretise, expect_affordable, is_large
from phigen.scheme.gauge import Gauge, choose, fixed_gauge, fixed_gauge_named
from phigen.scheme.gauss import build_gauss, expect_offered, plan_gauss, realise_gauss
from phigen.scheme.gauss_gauge import slowest
from phigen.scheme.logarithmic import composition_of, logarithmic_of
from phigen.scheme.monitor import monitor_of
from phigen.scheme.order import plan_order
from phigen.scheme.program import Program
from phigen.scheme.splitting import build_splitting
from phigen.spec.model import Overrides, Spec
from phigen.splitting.bodies import split_bodies
from phigen.splitting.forces import force_flows
from phigen.splitting.parts import SplitHamiltonian, split

if TYPE_CHECKING:
    from phigen.attitude.group import Group
    from phigen.lattice.cell import Cell

T = TypeVar("T")

#: Series of high order take long to build. A lower bound for the cost of a series is computed from the series of this
#: order.
PREVIEW_ORDER = 4

#: A spec may write out the equations of a lattice site by site. phigen recognises lattices with at least this number of
#: sites.
LEAST_LATTICE_SITES = 8


def compile_spec(
    spec: Spec,
    *,
    system: System | None = None,
    **options: Unpack[Overrides],
) -> Compilation:
    """Compile a spec without proofs. The options override settings of the spec, see `Spec.overridden`.

    ``system`` is the system of the spec, if the caller has already built it. To compile with proofs, call
    `compile_proved`. Raises `SpecError` if the method does not apply, for instance because H does not split. Raises
    `LimitError` if the program would be too large.
    """
    spec, clock = spec.overridden(**options), _Clock()
    if spec.lattice:
        from phigen.lattice.cell_building import cell_from_spec

        with bounded(spec):
            cell = clock.timed("cell", lambda: cell_from_spec(spec))
            return _swept(spec, cell, clock)
    with bounded(spec):
        _warn_of_written_out_lattice(spec)
        source = system or clock.timed("system", lambda: system_from_spec(spec))
        return _compiled(spec, source, clock)


def examine(
    spec: Spec,
    *,
    system: System | None = None,
    **options: Unpack[Overrides],
) -> Examination:
    """Compile a spec, and prove the statements about the system and the method.

    A refuted statement raises no error. After some refuted statements, such as the Jacobi identity, the method is not
    compiled. Raises `SpecError` if the spec does not even define a system.
    """
    spec, clock = spec.overridden(**options), _Clock()
    if spec.lattice:
        return _examine_lattice(spec, clock)
    with bounded(spec), progress.stage(spec.name):
        _warn_of_written_out_lattice(spec)
        try:
            source = system or clock.timed("system", lambda: system_from_spec(spec))
        except SpecError as error:
            raise located(error, spec) from None
        groups = clock.timed("proofs", lambda: statements.definedness(source, spec))
        if refuted(groups):
            return Examination(spec, groups, unexamined=f"the bracket, {UNEXAMINED}")
        try:
            realisation = _realised_early(spec, source, clock)
        except LimitError as error:
            return Examination(spec, groups, obstacle=located(error, spec))
        groups = groups | clock.timed("proofs", lambda: statements.tensor(source))
        if refuted(groups):
            return Examination(spec, groups, unexamined=UNEXAMINED)
        groups = groups | clock.timed("proofs", lambda: statements.integrals(source))
        signs = statements.monitor(source, spec) | statements.damping_of(source, spec)
        groups = groups | signs
        if refuted(signs):
            return Examination(spec, groups, unexamined="the method")
        try:
            compilation = _compiled(spec, source, clock, realisation)
        except SpecError as error:
            return Examination(spec, groups, obstacle=located(error, spec))
        groups = groups | clock.timed("proofs", lambda: statements.method(compilation))
    return Examination(spec, groups, compilation)


def compile_proved(
    spec: Spec,
    *,
    system: System | None = None,
    **options: Unpack[Overrides],
) -> Compilation:
    """Compile a spec, as `compile_spec` does, and prove the statements about the system and the method.

    Raises `CheckError` if a statement is refuted, for instance if π is not Poisson, or if a declared Casimir is not a
    Casimir. Also raises the `SpecError` and `LimitError` of `compile_spec`.
    """
    examination = examine(spec, system=system, **options)
    if examination.refuted:
        raise CheckError(refutation(examination))
    for warning in doubts(examination):
        warnings.warn(str(warning), PhigenWarning, stacklevel=3)
    if examination.compilation is None:
        raise examination.obstacle or AssertionError("the examination has neither a compilation nor an obstacle")
    return examination.compilation


def emit(program: Program, target: str, command: str, *, single_file: bool = False) -> dict[str, str]:
    """Print a program in the language of a target, and return the files (name → text).

    ``command`` is the command line that regenerates the files; it is written into their headers. With ``single_file``,
    a target that writes several files writes one instead, if it can. Raises `ValueError` for an unknown target.
    """
    with progress.stage(f"{program.name}: emission of {target}"):
        return registry.find(target).emit(program, command, single_file=single_file)


def _warn_of_written_out_lattice(spec: Spec) -> None:
    """Warn if the equations of the spec are those of a lattice, written out site by site.

    Such a spec is slow to compile. The warning says how to get a spec of one site, which compiles fast for any number
    of sites.
    """
    if spec.dimension < LEAST_LATTICE_SITES:
        return
    from phigen.lattice.recognition import recognised_lattice

    lattice_spec = recognised_lattice(spec, least=LEAST_LATTICE_SITES)
    if lattice_spec is not None and lattice_spec.lattice is not None:
        sites = spec.dimension // len(lattice_spec.coordinates)
        message = f"{spec.name} is a lattice of {sites} identical sites, written out"
        hint = f"phigen show --lattice {spec.file} prints a spec of one site that is valid for any number of sites"
        place = replace(spec.diagnostic(("coordinates",), message, hint), severity="warning")
        warnings.warn(str(place), PhigenWarning, stacklevel=4)


def _examine_lattice(spec: Spec, clock: _Clock) -> Examination:
    """Compile a lattice, and prove the statements about it, for any number of sites.

    After a refuted statement, the method is not compiled.
    """
    from phigen.lattice.cell_building import cell_from_spec
    from phigen.proofs import lattice_statements

    with bounded(spec), progress.stage(spec.name):
        try:
            cell = clock.timed("cell", lambda: cell_from_spec(spec))
        except SpecError as error:
            raise located(error, spec) from None
        groups = clock.timed("proofs", lambda: lattice_statements.lattice(cell))
        rests = UNEXAMINED if len(groups) == 1 else ""
        groups = groups | statements.damping_of_lattice(spec)
        if refuted(groups):
            return Examination(spec, groups, unexamined=rests)
        try:
            compilation = _swept(spec, cell, clock)
        except SpecError as error:
            return Examination(spec, groups, obstacle=located(error, spec))
        groups = groups | clock.timed("proofs", lambda: lattice_statements.sweeps(compilation))
    return Examination(spec, groups, compilation)


def _realised_early(spec: Spec, source: System, clock: _Clock) -> BiRealisation | None:
    """Return the bi-realisation of a large system, before anything is proved about the system.

    So a system whose program would exceed a limit is refused early: `LimitError` is raised if the generating function
    would be too large. Returns None if the system is small, or if the Casimirs to be subtracted from H (the gauge)
    decide on the bi-realisation. Also returns None if there is no bi-realisation; the reason is reported later.
    """
    as_it_is = isinstance(spec.gauge, str) and not (spec.monitor or source.forces or source.noise)
    if spec.scheme != "series" or not as_it_is or not is_large(source):
        return None
    try:
        realisation = clock.timed("bi-realisation", lambda: realise(source, spec.birealisation))
    except SpecError:
        return None
    clock.timed("generating function", lambda: expect_affordable(source, realisation))
    return realisation


def _compiled(spec: Spec, source: System, clock: _Clock, early_realisation: BiRealisation | None = None) -> Compilation:
    """Compile a system by the scheme of its spec.

    ``early_realisation`` is the result of `_realised_early`.
    """
    if early_realisation:
        return _compile_series(spec, source, clock, early_realisation)
    return SCHEME_COMPILERS[spec.scheme](spec, source, clock)


def _compile_series(
    spec: Spec, source: System, clock: _Clock, early_realisation: BiRealisation | None = None
) -> CompiledSeries:
    """Compile a system by the scheme series: choose bi-realisation and gauge, then build the program of a step.

    ``early_realisation`` is the bi-realisation, if `_realised_early` has found it already.
    """
    realisation = early_realisation or clock.timed("bi-realisation", lambda: realise(source, spec.birealisation))
    plan = plan_order(spec.order, spec.terms, symmetric=realisation.symmetric)
    gauged = clock.timed("gauge", lambda: choose(source, realisation, spec.gauge, monitor_of(spec)))
    monitor, affordable = gauged.gauge.monitor, early_realisation is not None and gauged.system is source
    with fixed_gauge_named(gauged.gauge, source):
        reached = clock.timed(
            "generating function",
            lambda: discretise(
                gauged.system, realisation, gauged.series, plan, spec.composition, monitor, affordable=affordable
            ),
        )
        group = _group(spec, source, realisation.kind)
        program = clock.timed(
            "program", lambda: build_program(source, realisation, plan, gauged, reached, spec, group=group)
        )
    return CompiledSeries(
        spec=spec, system=source, order=plan, program=program, gauge=gauged.gauge, seconds=clock.seconds,
        realisation=realisation, gauged=gauged, scheme=reached,
    )  # fmt: skip


def _cheapest(spec: Spec, source: System, clock: _Clock) -> Compilation:
    """Compile by the scheme that is expected to reach the accuracy of the requested order in the least time.

    The series of the requested order is not built if a series of lower order shows that another scheme is faster. If no
    scheme applies, the error of the series is raised.
    """
    compilations: dict[str, Compilation] = {}
    failures: dict[str, SpecError] = {}
    for scheme in _candidates(spec):
        alone = replace(spec, scheme=scheme)
        least = min(map(_expected, compilations.values()), default=math.inf)
        try:
            if scheme != "series" or not _is_dearer(alone, source, least):
                compilations[scheme] = _compiled(alone, source, clock)
        except SpecError as error:
            failures[scheme] = error
    if not compilations:
        raise failures["series"]
    best = min(compilations, key=lambda scheme: _expected(compilations[scheme]))
    return replace(compilations[best], spec=spec, choice=_choice(best, compilations, failures))


def _candidates(spec: Spec) -> tuple[str, ...]:
    """Return the names of the schemes that offer all options of the spec, as candidates for ``scheme: auto``."""
    if spec.series_settings:
        return ("series",)
    return ("gauss", "series") if spec.solve_settings else ("splitting", "gauss", "series")


def _choice(best: str, compilations: Mapping[str, Compilation], failures: Mapping[str, SpecError]) -> str:
    """Return the reason for choosing the scheme ``best``: the expected times with other schemes, as multiples of the
    time with ``best``.
    """
    least = _expected(compilations[best])
    if least == 0:
        return f"{best}: one exact flow"
    alternatives = [f"{_expected(c) / least:.1f} times the time for {s}" for s, c in compilations.items() if s != best]
    alternatives += [f"{s} does not apply" for s in failures]
    alternatives += ["more for series"] * ("series" not in {*compilations, *failures} and bool(compilations))
    return (
        f"{best}; expected: {', '.join(alternatives)}"
        if alternatives
        else f"{best}, the only scheme with the options of the spec"
    )


def _expected(compilation: Compilation) -> float:
    return efficiency.cost(compilation.program)


def _is_dearer(spec: Spec, source: System, least: float) -> bool:
    """Whether a series is expected to cost more than ``least``. The cost is estimated from a series of low order."""
    order = spec.order or 0
    if math.isinf(least) or order <= PREVIEW_ORDER:
        return False
    low = replace(spec, order=PREVIEW_ORDER, birealisation=replace(spec.birealisation, order=PREVIEW_ORDER))
    return efficiency.series_bound(_compiled(low, source, _Clock()).program, order) > least


def _compile_splitting(spec: Spec, source: System, clock: _Clock) -> CompiledSplitting:
    """Compile a system by the scheme splitting: H is split into parts whose flows are known in closed form."""
    gauge = Gauge() if isinstance(spec.gauge, str) else fixed_gauge(source, spec.gauge)
    discretised = gauge.applied(source)
    parts = clock.timed("splitting", lambda: _parts(spec, discretised.frozen))
    pushing = clock.timed("splitting", lambda: force_flows(source.frozen))
    parts = replace(parts, flows=(*parts.flows, *pushing))
    monitor, order = logarithmic_of(spec, source, parts.flows), spec.wanted_order
    choice = clock.timed(
        "composition",
        lambda: (
            plan_without_kicks(discretised, parts, order, composition_of(spec.composition, order), lambda: ())
            if monitor
            else plan_splitting(discretised, parts, order, spec.composition)
        ),
    )
    group = _group(spec, source, "exponential")
    if group:
        from phigen.attitude.flow_elements import by_angles
        from phigen.scheme.attitude import uniform

        flows = by_angles(discretised, group, choice.splitting.flows, put_back=uniform(source))
        choice = replace(choice, splitting=replace(choice.splitting, flows=flows))
    program = clock.timed("program", lambda: build_splitting(source, choice, gauge, spec, monitor=monitor, group=group))
    return CompiledSplitting(
        spec=spec, system=source, order=choice.order, program=program, gauge=gauge, seconds=clock.seconds,
        splitting=choice.splitting,
    )  # fmt: skip


def _parts(spec: Spec, system: System) -> SplitHamiltonian:
    """Return H as a sum of parts, each with its flow.

    With the key ``coordinates_from``, there is one part for each body. Otherwise the flow of a part may be a motion,
    such as a Kepler motion. `_turns_bodies` decides whether motions of free rigid bodies are allowed. If the spec has a
    monitor, H is split without motions. A composition needs several flows: if the spec names a composition, and one
    motion is the flow of the whole H, then H is also split without motions.
    """
    if spec.coordinates_from:
        return split_bodies(system, spec.coordinates_from)
    if spec.monitor:
        return replace(split(system, motions=False), small=None)
    parts = split(system, rigid=_turns_bodies(spec, system))
    alone = len(parts.flows) == 1 and parts.flows[0].has_motion
    return split(system, motions=False) if alone and spec.composition != "auto" else parts


def _turns_bodies(spec: Spec, system: System) -> bool:
    """Whether free rigid bodies may be parts of H.

    This is excluded if the spec reconstructs an attitude as a matrix that is not a rotation in space.
    """
    group = _group(spec, system, "exponential")
    if group is None:
        return True
    from phigen.attitude.free_bodies import rotates

    return rotates(group)


def _compile_gauss(spec: Spec, source: System, clock: _Clock) -> CompiledGauss:
    """Compile a system by the scheme gauss: choose the unknowns and the gauge, then build the program."""
    expect_offered(spec)
    plan = plan_gauss(spec)
    realisation = clock.timed("momentum maps", lambda: realise_gauss(spec, source))
    group = _group(spec, source, "")
    if group is not None and group.translation:
        realisation = realisation.with_elements
    monitor = monitor_of(spec)
    if isinstance(spec.gauge, str):
        gauge_of_spec = slowest(source, realisation) if spec.gauge == "auto" and not monitor else Gauge()
    else:
        gauge_of_spec = fixed_gauge(source, spec.gauge)
    gauge = replace(gauge_of_spec, monitor=monitor)
    program = clock.timed("program", lambda: build_gauss(source, gauge, realisation, plan, spec, group))
    return CompiledGauss(
        spec=spec, system=source, order=plan, program=program, gauge=gauge, seconds=clock.seconds, gauss=realisation
    )


#: Scheme → the function that compiles a system by it. Lattices are compiled by `_swept`.
SCHEME_COMPILERS: Mapping[str, Callable[[Spec, System, _Clock], Compilation]] = {
    "auto": _cheapest,
    "series": _compile_series,
    "splitting": _compile_splitting,
    "gauss": _compile_gauss,
}


def _swept(spec: Spec, cell: Cell, clock: _Clock) -> CompiledLattice:
    """Compile a lattice for any number of sites. A step is planned as sweeps (updates of all sites)."""
    if spec.scheme == "gauss":
        expect_offered(spec)
    from phigen.lattice.cell_building import expect_coloured
    from phigen.lattice.sweep_plans import build_sweeps, plan_sweeps

    plan = clock.timed("plan", lambda: plan_sweeps(cell, spec))
    if spec.solver.compensated and (plan.is_implicit or spec.extras.adjoint):
        message = "solver: compensated is only offered for lattices with scheme splitting and without adjoint"
        raise SpecError([Diagnostic(message, spec.locations.get(("solver",)))])
    _expect_no_settings_of_the_solve(spec)
    program = clock.timed("program", lambda: build_sweeps(cell, plan, spec))
    expect_coloured(spec, cell, plan.colouring.periods(cell.boundary))
    return CompiledLattice(spec=spec, order=plan.order, program=program, seconds=clock.seconds, cell=cell, sweeps=plan)


def _expect_no_settings_of_the_solve(spec: Spec) -> None:
    """Raise `SpecError` if the spec sets a tolerance or a number of iterations, which lattices do not offer."""
    message = "not for lattices, whose steps are exact flows, or are solved to round-off"
    diagnostics = [
        spec.diagnostic(("solver", key), f"solver: {key} is {message}", f"remove {key}") for key in spec.solve_settings
    ]
    if diagnostics:
        raise SpecError(diagnostics)


def _group(spec: Spec, source: System, kind: str) -> Group | None:
    """Return the group of the attitude increment of a step; None unless the spec has the key ``reconstruct``."""
    if not spec.reconstruct:
        return None
    from phigen.attitude.group import group_of

    return group_of(source, spec.reconstruct, kind)


@contextmanager
def bounded(spec: Spec) -> Iterator[None]:
    """Context that raises `LimitError`, with a place in the spec, if a polynomial does not fit into memory."""
    try:
        yield
    except OverflowError as error:
        hint = "use fewer terms, lower powers or a lower order; or use scheme: splitting, which needs no series"
        raise LimitError([spec.diagnostic(("hamiltonian",), f"the spec needs {error}", hint)]) from error


class _Clock:
    """Stopwatch for the tasks of a compilation.

    ``seconds`` has the duration of each task, or the sum of the durations if a task is entered several times.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def timed(self, stage: str, work: Callable[[], T]) -> T:
        """Return the result of ``work()``, and add its duration to the task named ``stage``."""
        with progress.stage(stage) as running:
            result = work()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + running.seconds
        return result
