"""The Casimir gauge: multiples of Casimirs that are subtracted from H before a step is derived.

H and H − Σ λ_c C_c have the same flow, but different generating functions S_h, and hence steps with different errors.
The leading local error of a symmetric method of order 2 is h³ π∇S_3, and |π∇S_3| is a good guide for higher orders.
With the setting ``auto``, the solver chooses the λ_c at the start of each trajectory such that |π∇S_3| is smallest
along a short piece of the trajectory. For fixed λ the step is an exact Poisson map; trajectories with different λ use
different maps.
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

#: The solver chooses the multiple λ of a Casimir C only if the subtraction of λC adds few terms to the series: the
#: number of terms of S_1, S_2 and S_3 for H − λC, divided by that for H, must not exceed this ratio. Above this ratio,
#: the additional terms cost more than the smaller error gains.
MAX_TERM_RATIO = 1.3

#: The gauge makes the error h^i π∇S_i small, where S_i is a term of the generating function. GUIDE is the index i.
GUIDE = 3

#: Largest number of operations of π∇S_3, as estimated by `guide_operations`, for which the solver searches for a gauge.
#: The search has up to four rounds. In each round it evaluates π∇S_3 at 32 states for 7 values of the multiple λ of a
#: Casimir. At this limit it takes some ten million operations, a hundredth of a second, at the start of each
#: trajectory. The example systems in ``specs`` need at most 2,600 operations.
MOST_GUIDE_OPERATIONS = 10_000


@dataclass(frozen=True)
class Gauge:
    """The Casimirs that are subtracted from H: ``free`` ones, whose multiples λ the solver chooses for each trajectory,
    and ``fixed`` ones with their multiples from the spec.

    With a ``monitor`` g, the Casimirs are subtracted from K = g(H + e) in place of H, and no λ is free; see
    `phigen.scheme.monitor`. ``omitted`` maps each Casimir that ``auto`` leaves out to the reason: the search for its λ
    would be too long.
    """

    free: tuple[str, ...] = ()
    fixed: Mapping[str, Expression] = field(default_factory=dict)
    monitor: Expression | None = None
    omitted: Mapping[str, str] = field(default_factory=dict)

    @property
    def symbols(self) -> tuple[str, ...]:
        """The symbols of the values that are constant on a trajectory.

        These are the multiples λ of Casimirs that the solver chooses or, with a monitor, the energy level e.
        """
        return (LEVEL,) if self.monitor else self.multiples

    @property
    def multiples(self) -> tuple[str, ...]:
        """The symbols λ, one for each Casimir whose multiple the solver chooses."""
        return tuple(Symbol(GAUGE, name) for name in self.free)

    @property
    def inputs(self) -> dict[str, tuple[str, ...]]:
        """Map from the name "gauge" of a kernel argument to the `symbols` of the gauge; {} if there are no symbols."""
        return {"gauge": self.symbols} if self.symbols else {}

    @property
    def facts(self) -> list[str]:
        """The lines about the gauge in the header of generated files."""
        several, quoted = len(self.free) > 1, ", ".join(f"`{name}`" for name in self.free)
        names = f"{'multiples of the Casimirs' if several else 'a multiple of the Casimir'} {quoted}"
        factors = "the factors are" if several else "the factor is"
        lines = [f"gauge: {self.letter} minus {names}; {factors} chosen at the start of each trajectory"]
        terms = " - ".join(f"({value}) {name}" for name, value in self.fixed.items())
        fixed = [f"gauge: {self.letter} - {terms} in place of {self.letter}"] if terms else []
        return (lines if self.free else []) + fixed + self.notes

    @property
    def notes(self) -> list[str]:
        """The lines about Casimirs that the automatic gauge leaves out, one line for each reason."""
        names: dict[str, list[str]] = {}
        for name, reason in self.omitted.items():
            names.setdefault(reason, []).append(name)
        return [f"gauge: auto leaves out {', '.join(group)}: {reason}" for reason, group in names.items()]

    @property
    def letter(self) -> str:
        """The letter, H or K, of the function from which the Casimirs are subtracted."""
        return "K" if self.monitor else "H"

    def timed(self, hamiltonian: Expression) -> Expression:
        """Return H or, with a monitor g, K = g(H + e), where e is the energy level −H(x₀) of a trajectory."""
        return self.monitor * (hamiltonian + symbol(LEVEL)) if self.monitor else hamiltonian

    def pace(self, system: System) -> Expression:
        """Return the factor that multiplies ∇H + ζ in the system that is discretised, where ζ is the covector force.

        The factor is g if there are a monitor g and forces, else 1.
        """
        return self.monitor if self.monitor and system.forces else ONE

    def applied(self, system: System) -> System:
        """Return the system that is discretised.

        Its Hamiltonian is H − Σ λ_c C_c or, with a monitor g, g(H + e) − Σ λ_c C_c. If there are a monitor g and
        forces, its Hamiltonian is H, and its vector force is gf in place of f. In this case `pace` returns the factor
        by which ∇H is multiplied.
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
    """The system that is discretised, with Casimirs subtracted from H, together with its Hamilton–Jacobi series."""

    gauge: Gauge
    system: System
    series: HamiltonJacobi


def choose(
    system: System,
    realisation: BiRealisation,
    setting: str | Mapping[str, Expression],
    monitor: Expression | None = None,
) -> Gauged:
    """Return the system in the gauge that the spec asks for: ``none``, ``auto``, or expressions for the multiples of
    some Casimirs.

    With ``auto``, the solver chooses the multiple λ of a Casimir C if three conditions hold. First, S_3 depends on λ,
    where S_3 is the third term of the series of H − λC. Second, S_3 has hardly more terms with λ than without. Third,
    π∇S_3 is cheap enough for a search. The first condition never holds for log-canonical π, and the second does not
    hold for tops. The solver chooses no λ if H depends on the time, or if there are forces, noise or a monitor. The
    bi-realisation must be exact and symmetric.
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
    """Return the reason why the solver does not search for the multiple λ in H − λC; "" if the search is cheap
    enough."""
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
    """Return an estimate of how many operations π∇S_3 needs, computed from H and π without S_3.

    Up to factors, S_3 is the sum of ∂_i∂_jH v_i v_j with v = π∇H. The estimate is the number of products of monomials
    in this sum. For sums of thousands of products, the true number was measured to be 0.6 to 1 times the estimate.
    Raises `OverflowError` if H or its derivatives are too large to be counted.
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
    """Context in which an error about the size of the program also names the gauge of the spec as a possible cause."""
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
    """Return the gauge with the multiples ``values``, by name of the Casimir. Raises `SpecError` for a name that is no
    Casimir."""
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
            return False  # S_1 alone has too many terms; computing S_3 would take long
        polynomial = gauged.series.polynomial(GUIDE)
    except OverflowError:
        return False
    if not polynomial.tower.depends_on(polynomial.terms[GUIDE - 1], [name]):
        return False
    return _state_terms(polynomial, ungauged.system) <= limit


def _first_term(gauged: Gauged) -> PolynomialSeries:
    """Return S_1 = H − Σ λ_c C_c as a polynomial in a ring of its own, without computing further terms of the
    series."""
    h = gauged.system.hamiltonian
    tower = Tower(symbols_of(h), [h])
    return PolynomialSeries(tower, (tower.convert(h),))


def _state_terms(series: PolynomialSeries, system: System) -> int:
    """Return the number of monomials in state-dependent variables, over all terms S_1, S_2, … of a series."""
    tower = series.tower
    state = [i for i in range(len(tower.names)) if tower.depends_on(tower.gens[i], system.coordinates)]
    return len({tuple(int(m[i]) for i in state) for s in series.terms for m in s.to_dict()})


def free_gauge(system: System, gauged: Gauged) -> FreeGauge | None:
    """Return the kernels with which the solver chooses the multiples λ of Casimirs C; None if it chooses none.

    One kernel computes the error vector π∇S_3. The other kernel computes scalar products of the gradients ∇H and ∇C.
    These products set the scale of λ in the search.
    """
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
        "the leading error pi grad S_3 of a step of order 2, as a function of the factors of Casimirs (gauge)",
        {"params": system.parameter_names, **gauge.inputs, "x": system.coordinates},
        (Output("error", hamiltonian_vector_field(system.poisson, slope)),),
    )
    scale = Kernel(
        "products",
        "the products grad H . grad H, then grad H . grad C and grad C . grad C for each Casimir C",
        {"params": system.parameter_names, "x": system.coordinates},
        (Output("out", tuple(products)),),
    )
    return FreeGauge(gauge.free, guide, scale)
