"""The Casimir gauge: H and H − Σ λ_c C_c have the same flow, but different discretisations.

Casimirs subtracted from H before discretising change S_h and hence the error constant. The leading local error of a
symmetric method is h³ π∇S_3 at order 2, and |π∇S_3| is a good guide for higher orders. With ``auto``, the solver
chooses λ at the start of each trajectory: it minimises |π∇S_3| along a short piece of the trajectory. For each fixed λ
the step is an exact Poisson map; trajectories with different λ use different maps.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from phigen.errors import Diagnostic, LimitError, SpecError
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.discretisation import hamilton_jacobi
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import FreeGauge
from phigen.series.hamilton_jacobi import HamiltonJacobi, PolynomialSeries
from phigen.symbolic.expression import ONE, Expression, gradient, symbol, symbols_of, total
from phigen.symbolic.symbols import GAUGE, LEVEL, Symbol
from phigen.symbolic.tower import Tower

#: Largest accepted ratio of the numbers of terms with a gauge and without; above it the gauge costs more than it gains.
MAX_TERM_RATIO = 1.3

#: Index of the S_i that determines the error term which the gauge minimises.
GUIDE = 3

#: Largest number of operations of π∇S_3, by `guide_operations`, with which a gauge is searched for. The search
#: evaluates π∇S_3 at 32 states for 7 values of λ, up to four times for each λ: some ten million operations, a hundredth
#: of a second, at the start of each trajectory. The systems of the corpus need at most 2,600.
MOST_GUIDE_OPERATIONS = 10_000


@dataclass(frozen=True)
class Gauge:
    """The Casimirs ``free``, whose multiples λ the solver chooses, and those ``fixed``, which have multiples in the
    spec.

    A ``monitor`` g replaces H by K = g(H + e) before the subtraction (`phigen.scheme.monitor`); then no λ is free.
    ``omitted`` maps Casimirs that are not free to the reason: choosing their λ would cost more than it gains.
    """

    free: tuple[str, ...] = ()
    fixed: Mapping[str, Expression] = field(default_factory=dict)
    monitor: Expression | None = None
    omitted: Mapping[str, str] = field(default_factory=dict)

    @property
    def symbols(self) -> tuple[str, ...]:
        """The symbols with a constant value for each trajectory: the free λ, or e."""
        return (LEVEL,) if self.monitor else self.multiples

    @property
    def multiples(self) -> tuple[str, ...]:
        """The symbols of the free λ."""
        return tuple(Symbol(GAUGE, name) for name in self.free)

    @property
    def inputs(self) -> dict[str, tuple[str, ...]]:
        """The argument of kernels that holds the symbols, by name; empty if there are none."""
        return {"gauge": self.symbols} if self.symbols else {}

    @property
    def facts(self) -> list[str]:
        """The lines about the gauge in the header of generated files."""
        lines = [f"gauge: the multiple of {', '.join(self.free)} is chosen at the start of each trajectory"]
        terms = ", ".join(f"({value}) {name}" for name, value in self.fixed.items())
        return (lines if self.free else []) + ([f"gauge: {self.letter} - {terms}"] if terms else []) + self.notes

    @property
    def notes(self) -> list[str]:
        """A line for each reason why the automatic gauge omits Casimirs."""
        names: dict[str, list[str]] = {}
        for name, reason in self.omitted.items():
            names.setdefault(reason, []).append(name)
        return [f"gauge: auto leaves out {', '.join(group)}: {reason}" for reason, group in names.items()]

    @property
    def letter(self) -> str:
        """The letter, H or K, of the function from which the Casimirs are subtracted."""
        return "K" if self.monitor else "H"

    def timed(self, hamiltonian: Expression) -> Expression:
        """Return H or, with a monitor, K = g(H + e)."""
        return self.monitor * (hamiltonian + symbol(LEVEL)) if self.monitor else hamiltonian

    def pace(self, system: System) -> Expression:
        """Return the factor of ∇H + ζ in the discretised system: g if there are both a monitor and forces, else 1."""
        return self.monitor if self.monitor and system.forces else ONE

    def applied(self, system: System) -> System:
        """Return the system that is discretised, with H − Σ λ_c C_c or K − Σ λ_c C_c in place of H.

        With a monitor and forces, H remains: p = τg(∇H + ζ) is derived from H, and the impulse of a vector force f is
        τgf.
        """
        if self.monitor and system.forces:
            vector = tuple(self.monitor * f for f in system.forces.vector)
            return replace(system, forces=replace(system.forces, vector=vector))
        parts = [symbol(s) * system.casimirs[c] for s, c in zip(self.multiples, self.free, strict=True)]
        parts += [value * system.casimirs[c] for c, value in self.fixed.items()]
        if not parts and not self.monitor:
            return system
        return replace(system, hamiltonian=self.timed(system.hamiltonian) - total(parts))


@dataclass(frozen=True)
class Gauged:
    """The system that is discretised, with Casimirs subtracted from H, and its Hamilton–Jacobi series."""

    gauge: Gauge
    system: System
    series: HamiltonJacobi


def choose(
    system: System,
    realisation: BiRealisation,
    setting: str | Mapping[str, Expression],
    monitor: Expression | None = None,
) -> Gauged:
    """Return the system in the gauge of a setting: ``none``, ``auto``, or a value for some Casimirs.

    ``auto`` frees the λ of a Casimir under three conditions: S_3 depends on λ, which is never so for log-canonical
    structures; S_3 has hardly more terms with λ, which is not so for tops; π∇S_3 is cheap enough for a search. No λ is
    free if H depends on the time, or with forces, noise or a monitor.
    """
    if not isinstance(setting, str):
        return _gauged(system, realisation, replace(fixed_gauge(system, setting), monitor=monitor))
    best = ungauged = _gauged(system, realisation, Gauge(monitor=monitor))
    may_gauge = setting != "none" and realisation.exact and realisation.symmetric
    if not may_gauge or system.driven or monitor:
        return ungauged
    omitted: dict[str, str] = {}
    for name in system.casimirs:
        candidate = _gauged(system, realisation, Gauge((*best.gauge.free, name)))
        reason = unaffordable(candidate.system)
        if reason:
            omitted[name] = reason
        elif _worthwhile(ungauged, candidate, Symbol(GAUGE, name)):
            best = candidate
    return replace(best, gauge=replace(best.gauge, omitted=omitted)) if omitted else best


def unaffordable(system: System) -> str:
    """Return the reason why λ in this H is not searched for; "" if the search is cheap enough."""
    try:
        operations = guide_operations(system)
    except OverflowError as error:
        return f"the search for its multiple needs {error}"
    if operations <= MOST_GUIDE_OPERATIONS:
        return ""
    return (
        "the search for its multiple evaluates the leading error of a step, which would take about "
        f"{operations} operations; the limit is {MOST_GUIDE_OPERATIONS}"
    )


def guide_operations(system: System) -> int:
    """Return an estimate of the operations of π∇S_3, from H and π, before S_3 is computed.

    Up to factors, S_3 is the sum of ∂_i∂_jH v_i v_j with v = π∇H. The estimate is the number of products of monomials
    in this sum. For sums of thousands of products, 0.6 to 1 times the estimate was measured. Raises `OverflowError` if
    H or its derivatives are too large to be counted.
    """
    h, tensor = system.hamiltonian, system.poisson
    entries = [e for row in tensor for e in row if not e.is_zero]
    names = dict.fromkeys([*system.coordinates, *symbols_of(h, *entries)])
    tower = Tower(list(names), [h, *entries], system.coordinates)
    slopes = tower.gradient(tower.convert(h), system.coordinates)
    field_terms = [
        sum(len(tower.convert(e)) * len(slope) for e, slope in zip(row, slopes, strict=True) if not e.is_zero)
        for row in tensor
    ]
    operations = 0
    for slope, left in zip(slopes, field_terms, strict=True):
        if left and len(slope):
            rows = tower.gradient(slope, system.coordinates)
            operations += sum(len(e) * left * right for e, right in zip(rows, field_terms, strict=True))
    return operations


@contextmanager
def fixed_gauge_named(gauge: Gauge, system: System) -> Iterator[None]:
    """Return a context in which errors about the size of the program name the gauge of the spec."""
    try:
        yield
    except (LimitError, OverflowError) as error:
        if not gauge.fixed:
            raise
        diagnostics = error.diagnostics if isinstance(error, LimitError) else [Diagnostic(f"the spec needs {error}")]
        place = system.locations.get(("gauge",))
        explained = [Diagnostic(f"with this gauge {d.message}", place, _gauge_hint(d.hint)) for d in diagnostics]
        raise LimitError(explained) from error


def _gauge_hint(hint: str) -> str:
    return f"gauge: none, or {hint}" if hint else "gauge: none"


def _gauged(system: System, realisation: BiRealisation, gauge: Gauge) -> Gauged:
    discretised = gauge.applied(system)
    return Gauged(gauge, discretised, hamilton_jacobi(discretised, realisation, GUIDE, gauge.symbols))


def fixed_gauge(system: System, values: Mapping[str, Expression]) -> Gauge:
    """Return the gauge with these multiples of Casimirs. Raises `SpecError` for names that are not Casimirs."""
    for name in values:
        if name not in system.casimirs:
            casimir_names = ", ".join(system.casimirs) or "none"
            place = system.locations.get(("gauge", name)) or system.locations.get(("gauge",))
            raise SpecError(
                [Diagnostic(f"gauge: {name} is not a Casimir of this system", place, f"known: {casimir_names}")]
            )
    return Gauge(fixed=values)


def _worthwhile(ungauged: Gauged, gauged: Gauged, name: str) -> bool:
    try:
        limit = MAX_TERM_RATIO * _state_terms(ungauged.series.polynomial(GUIDE), ungauged.system)
        if _state_terms(_first_term(gauged), ungauged.system) > limit:
            return False  # decided without the series, which is slow for a long Casimir
        polynomial = gauged.series.polynomial(GUIDE)
    except OverflowError:
        return False
    if not polynomial.tower.depends_on(polynomial.terms[GUIDE - 1], [name]):
        return False
    return _state_terms(polynomial, ungauged.system) <= limit


def _first_term(gauged: Gauged) -> PolynomialSeries:
    """Return S_1 = H in a separate ring."""
    h = gauged.system.hamiltonian
    tower = Tower(symbols_of(h), [h])
    return PolynomialSeries(tower, (tower.convert(h),))


def _state_terms(series: PolynomialSeries, system: System) -> int:
    """Return the number of monomials in the coordinates in all terms together."""
    tower = series.tower
    state = [i for i in range(len(tower.names)) if tower.depends_on(tower.gens[i], system.coordinates)]
    return len({tuple(int(m[i]) for i in state) for s in series.terms for m in s.to_dict()})


def free_gauge(system: System, gauged: Gauged) -> FreeGauge | None:
    """Return the kernels for the choice of λ: the error π∇S_3, and the products of ∇H and ∇C, which set the scale of
    λ."""
    gauge = gauged.gauge
    if not gauge.free:
        return None
    series = gauged.series.polynomial(GUIDE)
    tower = series.tower
    slope = [tower.expression(tower.derivative(series.terms[GUIDE - 1], c)) for c in system.coordinates]
    h = gradient(system.hamiltonian, system.coordinates)
    products: list[Expression] = [total(a * a for a in h)]
    for name in gauge.free:
        c = gradient(system.casimirs[name], system.coordinates)
        products += [total(a * b for a, b in zip(h, c, strict=True)), total(b * b for b in c)]
    guide = Kernel(
        "guide",
        "the leading error vector pi grad S_3, as a function of the gauge",
        {"params": system.parameter_names, **gauge.inputs, "x": system.coordinates},
        (Output("error", hamiltonian_vector_field(system.poisson, slope)),),
    )
    scale = Kernel(
        "products",
        "the products grad H . grad H, then grad H . grad C and grad C . grad C for each Casimir of the gauge",
        {"params": system.parameter_names, "x": system.coordinates},
        (Output("out", tuple(products)),),
    )
    return FreeGauge(gauge.free, guide, scale)
