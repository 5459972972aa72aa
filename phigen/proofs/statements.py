"""Statements on a system and on its method, in groups, each with the verdict proved, refuted or checked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from phigen.compilation import Compilation, CompiledGauss, CompiledSeries, CompiledSplitting
from phigen.gauss.statements import check as check_gauss
from phigen.geometry import checks
from phigen.geometry.definedness import undefined_parts, undefined_starts
from phigen.geometry.jacobi import jacobi_identity
from phigen.geometry.positivity import not_negative, positivity
from phigen.geometry.system import System
from phigen.realisations import axioms
from phigen.scheme.noise import noise_flows
from phigen.series.hamilton_jacobi import residual
from phigen.spec.model import Run, Spec
from phigen.splitting.statements import check as check_splitting
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.verdict import REFUTED, UNDECIDED, Statement, decide_elements

#: Name of a group, such as "Casimirs" → its statements; groups are in the order in which they are proved.
Groups = Mapping[str, tuple[Statement, ...]]

PREFIX = "bi-realisation: "
DEFINEDNESS, CASIMIRS, FORCES, INVARIANTS = "Definedness", "Casimirs", "Forces", "Invariants"
NOISE = "Noise"
MONITOR, DAMPING = "Monitor", "Damping"
METHOD, SPLITTING, ATTITUDE = "Bi-realisation", "Splitting", "Attitude"
GAUSS = "Gauss collocation"


def definedness(system: System, spec: Spec) -> dict[str, tuple[Statement, ...]]:
    """Return statements on expressions that are undefined everywhere or at the start of a run; {} if all are
    defined."""
    starts = _starts(system, spec)
    undefined = tuple(undefined_parts(system, starts)) or tuple(
        undefined_starts(system, dict(zip(spec.runs, starts, strict=True)))
    )
    return {DEFINEDNESS: undefined} if undefined else {}


def _starts(system: System, spec: Spec) -> list[dict[str, float]]:
    """Return, for each run, the coordinates, parameters and times at its start, by name."""
    starts = []
    for run in spec.runs.values():
        initial = dict(zip(spec.coordinates, map(float, run.initial), strict=True))
        starts.append(spec.parameters_of(run) | initial | dict.fromkeys(system.times, float(run.start)))
    return starts


def monitor(system: System, spec: Spec) -> dict[str, tuple[Statement, ...]]:
    """Return the statement that the monitor g, which rescales time by dt = g dτ, is positive; {} without a monitor."""
    if spec.monitor is None or isinstance(spec.monitor, str):
        return {}
    positive = [p.name for p in spec.parameters if p.positive]  # parameters that may be 0 do not prove g > 0
    return {MONITOR: (positivity("g > 0", spec.monitor, positive, _starts(system, spec)),)}


def damping(spec: Spec, starts: Sequence[Mapping[str, float]]) -> dict[str, tuple[Statement, ...]]:
    """Return the statement that the damping coefficient λ is not negative, decided by its values at ``starts``.

    Each of the ``starts`` has values of coordinates, parameters and times. The result is {} without damping, or if the
    sign of λ is unknown.
    """
    rate = spec.forces.damping
    if rate is None:
        return {}
    positive = [p.name for p in spec.parameters if p.bound]
    stated = not_negative("λ ≥ 0, so that damping removes energy: dH/dt ≤ 0", rate, positive, starts)
    return {DAMPING: (stated,)} if stated else {}


def damping_of(system: System, spec: Spec) -> dict[str, tuple[Statement, ...]]:
    """Return the statement λ ≥ 0 of `damping`, evaluated at the starts of runs.

    Without runs, a λ that depends on parameters only is evaluated with their defaults.
    """
    return damping(spec, _starts(system, spec) or _defaults(spec))


def damping_of_lattice(spec: Spec) -> dict[str, tuple[Statement, ...]]:
    """Return the statement λ ≥ 0 of `damping` for a lattice, if λ depends only on parameters that are equal at all
    sites.
    """
    return damping(spec, _defaults(spec, *spec.runs.values()))


def _defaults(spec: Spec, *runs: Run) -> list[dict[str, float]]:
    """Return the parameters of the ``runs`` or, without runs, the defaults.

    Returns [] if the damping coefficient λ depends on more than these parameters.
    """
    numbers = {p.name for p in spec.parameters if p.at == "all"}
    rate = spec.forces.damping
    if rate is None or not set(symbols_of(rate)) <= numbers:
        return []
    default_run = Run("", (), Fraction(1), 1)
    return [spec.parameters_of(run) for run in runs or (default_run,)]


def tensor(system: System) -> dict[str, tuple[Statement, ...]]:
    """Return two statements: that π is skew, and that π satisfies the Jacobi identity. If the first is refuted, the
    second is left out.
    """
    skew = checks.skew_symmetry(system)
    return {"Poisson tensor": (skew,) if skew.verdict == REFUTED else (skew, jacobi_identity(system))}


def integrals(system: System) -> dict[str, tuple[Statement, ...]]:
    """Return the statements on Casimirs, the rank of π, forces, noise, and declared invariants, by group."""
    casimirs = (*checks.casimir_statements(system), checks.rank_statement(system))
    invariants = tuple(checks.invariant_statements(system))
    forces = tuple(checks.force_statements(system))
    noise = tuple(checks.noise_statements(system))
    groups = {CASIMIRS: casimirs} | ({FORCES: forces} if forces else {}) | ({NOISE: noise} if noise else {})
    return groups | ({INVARIANTS: invariants} if invariants else {})


def _attitude(compilation: Compilation) -> dict[str, tuple[Statement, ...]]:
    if compilation.program.attitude is None:
        return {}
    from phigen.proofs import attitude

    return {ATTITUDE: tuple(attitude.check(compilation))}


def method(compilation: Compilation) -> dict[str, tuple[Statement, ...]]:
    """Return the statements on the method and on the attitude of a compilation, in groups: title → statements.

    The statements for a splitting concern its flows, and those for Gauss collocation its stages. Those for a series
    concern the axioms of the bi-realisation and the Hamilton–Jacobi equation.
    """
    return compilation.by_kind(_method_by_series, _method_by_splitting, _method_by_gauss) | _attitude(compilation)


def _method_by_splitting(compilation: CompiledSplitting) -> dict[str, tuple[Statement, ...]]:
    flows = zip((s.name for s in compilation.system.noise), noise_flows(compilation.system), strict=True)
    return {SPLITTING: tuple(check_splitting(compilation.discretised, compilation.splitting, list(flows)))}


def _method_by_gauss(compilation: CompiledGauss) -> dict[str, tuple[Statement, ...]]:
    system, pace = compilation.system, compilation.gauge.pace(compilation.system)
    gauss_statements = check_gauss(system, compilation.discretised, compilation.gauss, compilation.tableau, pace)
    return {compilation.label: tuple(gauss_statements)}


def _method_by_series(compilation: CompiledSeries) -> dict[str, tuple[Statement, ...]]:
    axiom_statements = axioms.check(compilation.system, compilation.realisation)
    stripped = [replace(s, name=s.name.removeprefix(PREFIX)) for s in axiom_statements]
    label = f"{METHOD} ({compilation.realisation.kind})"
    return {label: tuple(stripped), "Hamilton–Jacobi series": tuple(series_statements(compilation))}


def series_statements(compilation: CompiledSeries) -> Iterator[Statement]:
    """Yield the statements on S_1 … S_k: the sum S_t solves the Hamilton–Jacobi equation up to a power of t.

    If the order relies on symmetry, a second statement says that the S_i of even index are 0.
    """
    system, realisation, plan = compilation.discretised, compilation.realisation, compilation.stage
    terms = plan.terms + (1 if realisation.symmetric else 0)  # if S_{k+1} = 0, the order is k + 1
    equation = "∂_t S_t = H(α(x, ∇S_t))" if not system.time else "∂_t S_t = H(τ − t/2, α(x, ∇S_t)) + ½ ∂_τ S_t"
    name = f"{equation} for S_t = {sum_of_terms(plan.terms)}"
    try:
        series = compilation.series.polynomial(terms)
        coefficients = residual(series, system.hamiltonian, compilation.series.alpha, system.coordinates, system.times)
    except OverflowError:
        yield Statement(name, UNDECIDED, "too many terms to expand; the recursion itself is used, unexpanded")
        return
    residuals = [(f"coefficient of t^{i}", r) for i, r in enumerate(coefficients)]
    yield decide_elements(name, series.tower, residuals[: plan.terms], system.positive, f"up to t^{plan.terms - 1}")
    if realisation.symmetric:
        even_names = ", ".join(f"S_{i}" for i in range(2, terms + 1, 2))
        even_terms = [entry for i, entry in enumerate(residuals) if i % 2]
        whose = "" if plan is compilation.order else " of each stage"
        yield decide_elements(
            f"{even_names} = 0", series.tower, even_terms, system.positive, f"hence the order {plan.order}{whose}"
        )


def sum_of_terms(terms: int) -> str:
    """Return the text ``t S_1 + … + t^5 S_5`` for 5 terms."""
    summands = ["t S_1", *(f"t^{i} S_{i}" for i in range(2, terms + 1))]
    return " + ".join(summands if terms < 4 else [summands[0], "…", summands[-1]])
