"""Everything phigen proves about one spec, in groups; and compiling with those proofs as a condition."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from phigen import progress
from phigen.compiler import Compilation, bounded, compile_spec
from phigen.errors import CheckError, Diagnostic, LimitError, SpecError
from phigen.geometry import checks
from phigen.geometry.definedness import undefined_parts
from phigen.geometry.jacobi import jacobi_identity
from phigen.geometry.system import System, system_from_spec
from phigen.realisations import axioms
from phigen.scheme.order import Order
from phigen.series.hamilton_jacobi import residual
from phigen.spec.model import Extras, Spec
from phigen.splitting import statements
from phigen.symbolic.verdict import REFUTED, UNDECIDED, Statement, decide_elements

#: Statements by the part of the mathematics they belong to, in the order of the pipeline.
Groups = Mapping[str, tuple[Statement, ...]]

#: What rests on π: if that is no Poisson tensor, all of it may fail, and says nothing more.
UNEXAMINED = "Casimirs, invariants, the method"

PREFIX = "bi-realisation: "
DEFINEDNESS, CASIMIRS, INVARIANTS = "Definedness", "Casimirs", "Invariants"
METHOD, SPLITTING = "Bi-realisation", "Splitting"

#: Where a spec says what a group of statements is about.
_PLACES = {METHOD: ("birealisation",), SPLITTING: ("scheme",)}


@dataclass(frozen=True)
class Examination:
    """What was proved about a spec.

    ``compilation`` is None if there is none: ``obstacle`` then says why. An obstacle is no refutation: no
    bi-realisation of the catalogue may apply to a perfectly good Poisson tensor. ``unexamined`` names what rests on
    something refuted, and would only repeat that; it is empty if everything was examined.
    """

    spec: Spec
    groups: Groups
    compilation: Compilation | None = None
    obstacle: SpecError | None = None
    unexamined: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def statements(self) -> list[Statement]:
        """All statements, in order."""
        return [s for group in self.groups.values() for s in group]

    @property
    def refuted(self) -> list[Statement]:
        """The statements that are false."""
        return [s for s in self.statements if s.verdict == REFUTED]

    @property
    def mistakes(self) -> list[tuple[str, Statement]]:
        """The statements that are false with their groups, without those that may follow from one before.

        Casimirs and invariants stand for themselves. The axioms of a bi-realisation, and the flows of a splitting, are
        about the same few formulas: the first that fails says what is wrong.
        """
        found = []
        for group, listed in self.groups.items():
            refuted = [(group, s) for s in listed if s.verdict == REFUTED]
            found += refuted if group in (DEFINEDNESS, CASIMIRS, INVARIANTS) else refuted[:1]
        return found


def examine(
    spec: Spec,
    *,
    order: int | None = None,
    scheme: str | None = None,
    system: System | None = None,
    extras: Extras | None = None,
) -> Examination:
    """Prove what can be proved about a spec, as far along the pipeline as it gets.

    Raises `SpecError` if the spec does not even define a system.
    """
    with bounded(spec), progress.stage(spec.name) as whole:
        try:
            with progress.stage("system") as building:
                system = system or system_from_spec(spec)
        except SpecError as error:
            raise located(error, spec) from None
        with progress.stage("proofs"):
            defined = _definedness(system, spec)
            if any(s.verdict == REFUTED for group in defined.values() for s in group):
                return Examination(spec, defined, unexamined=f"the bracket, {UNEXAMINED}")
            groups = {**defined, **_tensor(system)}
            if any(s.verdict == REFUTED for group in groups.values() for s in group):
                return Examination(spec, groups, unexamined=UNEXAMINED)
            groups |= _integrals(system)
        try:
            compilation = compile_spec(spec, order=order, scheme=scheme, system=system, extras=extras)
        except SpecError as error:
            return Examination(spec, groups, obstacle=located(error, spec))
        with progress.stage("proofs"):
            groups |= _method(compilation)
    seconds = {**compilation.seconds, "system": building.seconds}
    seconds["proofs"] = whole.seconds - sum(seconds.values())
    return Examination(spec, groups, compilation, seconds=seconds)


def compile_proved(
    spec: Spec,
    *,
    order: int | None = None,
    scheme: str | None = None,
    system: System | None = None,
    extras: Extras | None = None,
) -> Compilation:
    """`compile_spec`, refusing what is refuted.

    Raises `CheckError` that names what is refuted, with the residual: no π that is not Poisson, no claimed Casimir
    that is none, no wrong bi-realisation reaches the output. Raises `SpecError` and `LimitError` as `compile_spec`.
    """
    found = examine(spec, order=order, scheme=scheme, system=system, extras=extras)
    if found.refuted:
        raise CheckError(refutation(found))
    for s in found.groups.get(DEFINEDNESS, ()):
        warnings.warn(f"{spec.name}: {s}", RuntimeWarning, stacklevel=3)
    if found.compilation is None:
        raise found.obstacle or AssertionError("an examination without compilation has an obstacle")
    return replace(found.compilation, seconds=found.seconds)


def refutation(found: Examination) -> str:
    """What is refuted, for a message, each with its place in the spec."""
    spec = found.spec
    places: dict[str, tuple[str, ...]] = {f"{name} is a Casimir": ("casimirs", name) for name in spec.casimirs}
    places |= {f"{name} is invariant": ("invariants", name) for name in spec.invariants}
    hint = f"not examined, since they rest on it: {found.unexamined}" if found.unexamined else ""
    places |= {"H is defined": ("hamiltonian",)}
    places |= {f"{name} is defined": ("casimirs", name) for name in spec.casimirs}
    places |= {f"{name} is defined": ("invariants", name) for name in spec.invariants}
    lines = []
    for group, s in found.mistakes:
        place = places.get(s.name, _PLACES.get(group.partition(" (")[0], ("poisson",)))
        lines.append(str(spec.diagnostic(place, str(s), hint)))
    return "\n".join(lines)


def _definedness(system: System, spec: Spec) -> dict[str, tuple[Statement, ...]]:
    """What has no value anywhere; nothing is said of what has."""
    starts = []
    for run in spec.runs.values():
        initial = dict(zip(spec.coordinates, map(float, run.initial), strict=True))
        starts.append(spec.parameters_of(run) | initial)
    found = tuple(undefined_parts(system, starts))
    return {DEFINEDNESS: found} if found else {}


def _tensor(system: System) -> dict[str, tuple[Statement, ...]]:
    skew = checks.skew_symmetry(system)
    return {"Poisson tensor": (skew,) if skew.verdict == REFUTED else (skew, jacobi_identity(system))}


def _integrals(system: System) -> dict[str, tuple[Statement, ...]]:
    casimirs = (*checks.casimir_statements(system), checks.rank_statement(system))
    invariants = tuple(checks.invariant_statements(system))
    return {CASIMIRS: casimirs} | ({INVARIANTS: invariants} if invariants else {})


def _method(compilation: Compilation) -> dict[str, tuple[Statement, ...]]:
    if compilation.splitting:
        return {SPLITTING: tuple(statements.check(compilation.discretised, compilation.splitting))}
    found = axioms.check(compilation.system, compilation.chart)
    stripped = [replace(s, name=s.name.removeprefix(PREFIX)) for s in found]
    label = f"{METHOD} ({compilation.chart.kind})"
    return {label: tuple(stripped), "Hamilton–Jacobi series": tuple(series_statements(compilation))}


def series_statements(compilation: Compilation) -> Iterator[Statement]:
    """S_1 … S_k solve the Hamilton–Jacobi equation; the S_i of even index vanish where the order rests on it."""
    system, realisation, plan = compilation.discretised, compilation.chart, stage_order(compilation)
    terms = plan.terms + (1 if realisation.symmetric else 0)  # S_{k+1} = 0 is what makes the order k + 1
    name = f"∂_t S_t = H(α(x, ∇S_t)) for S_t = {sum_of_terms(plan.terms)}"
    try:
        series = compilation.series.polynomial(terms)
        rest = residual(series, system.hamiltonian, compilation.series.alpha, system.coordinates)
    except OverflowError:
        yield Statement(name, UNDECIDED, "too many terms to expand; the recursion itself is used, unexpanded")
        return
    listed = [(f"coefficient of t^{i}", r) for i, r in enumerate(rest)]
    yield decide_elements(name, series.tower, listed[: plan.terms], system.positive, f"up to t^{plan.terms - 1}")
    if realisation.symmetric:
        even = ", ".join(f"S_{i}" for i in range(2, terms + 1, 2))
        found = [entry for i, entry in enumerate(listed) if i % 2]
        whose = "" if plan is compilation.order else " of each stage"
        yield decide_elements(
            f"{even} = 0", series.tower, found, system.positive, f"hence the order {plan.order}{whose}"
        )


def stage_order(compilation: Compilation) -> Order:
    """The order and the terms of one stage: those of the method, unless it is composed of stages of order 2."""
    return compilation.order if len(compilation.program.fractions) == 1 else Order(2, 1)


def sum_of_terms(terms: int) -> str:
    """``t S_1 + … + t^5 S_5``."""
    shown = ["t S_1", *(f"t^{i} S_{i}" for i in range(2, terms + 1))]
    return " + ".join(shown if terms < 4 else [shown[0], "…", shown[-1]])


def merged(errors: Iterable[SpecError]) -> SpecError:
    """One error with all diagnostics; a `LimitError` if one of them is."""
    listed = list(errors)
    kind = LimitError if any(isinstance(e, LimitError) for e in listed) else SpecError
    return kind([d for e in listed for d in e.diagnostics])


def located(error: SpecError, spec: Spec) -> SpecError:
    """The error with the line of the spec that each diagnostic is about."""
    lines = spec.source.split("\n")

    def shown(d: Diagnostic) -> Diagnostic:
        if d.source_line or not d.location or d.location.line > len(lines):
            return d
        return replace(d, source_line=lines[d.location.line - 1])

    return type(error)([shown(d) for d in error.diagnostics])
