"""The Casimir gauge: H and H − Σ λ_c C_c have the same flow, but not the same discretisation.

Casimirs subtracted from H before discretising change S_h, hence the error constant: the leading local error of a
symmetric method is h³ π∇S_3 at order 2, and |π∇S_3| is a good guide for higher orders. ``auto`` leaves λ open and
lets the solver fix it at the start of each trajectory by minimising |π∇S_3| along a short piece of it. For each
fixed λ the step is an exact Poisson map; trajectories with different λ are steps of different maps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.discretisation import hamilton_jacobi
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import FreeGauge
from phigen.series.hamilton_jacobi import HamiltonJacobi, PolynomialSeries
from phigen.symbolic.expression import Expression, gradient, symbol, symbols_of, total
from phigen.symbolic.symbols import GAUGE, LEVEL, Symbol
from phigen.symbolic.tower import Tower

#: Gauged series may have this many times the terms of the plain one; beyond, the gauge costs more than it gains.
MOST_GROWTH = 1.3

#: The error term whose size the gauge minimises.
GUIDE = 3


@dataclass(frozen=True)
class Gauge:
    """``free``: Casimirs whose λ the solver chooses; ``fixed``: the part subtracted once for all.

    A ``monitor`` g makes K = g(H + e) of H before that (`phigen.scheme.monitor`); then no λ is free.
    """

    free: tuple[str, ...] = ()
    fixed: Mapping[str, Expression] = field(default_factory=dict)
    monitor: Expression | None = None

    @property
    def symbols(self) -> tuple[str, ...]:
        """What each trajectory holds fixed at a value of its own: the free λ, or e."""
        return (LEVEL,) if self.monitor else self.multiples

    @property
    def multiples(self) -> tuple[str, ...]:
        """The symbols of the free λ."""
        return tuple(Symbol(GAUGE, name) for name in self.free)

    @property
    def inputs(self) -> dict[str, tuple[str, ...]]:
        """The argument that passes the symbols to a kernel, if there are any."""
        return {"gauge": self.symbols} if self.symbols else {}

    @property
    def facts(self) -> list[str]:
        """What the header says of the gauge."""
        free = [f"gauge: the multiple of {', '.join(self.free)} is chosen at the start of each trajectory"]
        fixed = ", ".join(f"({value}) {name}" for name, value in self.fixed.items())
        return (free if self.free else []) + ([f"gauge: {self.letter} - {fixed}"] if fixed else [])

    @property
    def letter(self) -> str:
        """What the Casimirs are taken from."""
        return "K" if self.monitor else "H"

    def timed(self, hamiltonian: Expression) -> Expression:
        """H, or K = g(H + e)."""
        return self.monitor * (hamiltonian + symbol(LEVEL)) if self.monitor else hamiltonian

    def applied(self, system: System) -> System:
        """The system with H − Σ λ_c C_c, or K − Σ λ_c C_c, for H, to be discretised.

        With forces there is no K: H stays, and p = τg(∇H + ζ) is made of it; the impulse of a vector f is τgf.
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
    """What is discretised: the system with H less the Casimirs of the gauge, and its Hamilton–Jacobi series."""

    gauge: Gauge
    system: System
    series: HamiltonJacobi


def choose(
    system: System,
    realisation: BiRealisation,
    setting: str | Mapping[str, Expression],
    monitor: Expression | None = None,
) -> Gauged:
    """The system in the gauge of a setting: ``none``, ``auto``, or a value for some Casimirs.

    ``auto`` frees a Casimir if S_3 depends on its λ (in log-canonical structures it never does) and has hardly
    more terms with it (on tops it has many more, for little); none where H depends on the time, forces act or there
    is noise, or with a monitor.
    """
    if not isinstance(setting, str):
        return _gauged(system, realisation, replace(given(system, setting), monitor=monitor))
    chosen = plain = _gauged(system, realisation, Gauge(monitor=monitor))
    open_ = setting != "none" and realisation.exact and realisation.symmetric
    if not open_ or system.driven or monitor:
        return plain
    for name in system.casimirs:
        candidate = _gauged(system, realisation, Gauge((*chosen.gauge.free, name)))
        if _worthwhile(plain, candidate, Symbol(GAUGE, name)):
            chosen = candidate
    return chosen


def _gauged(system: System, realisation: BiRealisation, gauge: Gauge) -> Gauged:
    discretised = gauge.applied(system)
    return Gauged(gauge, discretised, hamilton_jacobi(discretised, realisation, GUIDE, gauge.symbols))


def given(system: System, values: Mapping[str, Expression]) -> Gauge:
    """The gauge with these multiples of Casimirs. Raises `SpecError` for names of other functions."""
    for name in values:
        if name not in system.casimirs:
            known = ", ".join(system.casimirs) or "none"
            place = system.locations.get(("gauge", name)) or system.locations.get(("gauge",))
            raise SpecError([Diagnostic(f"gauge: {name} is not a Casimir of this system", place, f"known: {known}")])
    return Gauge(fixed=values)


def _worthwhile(plain: Gauged, gauged: Gauged, name: str) -> bool:
    try:
        most = MOST_GROWTH * _state_terms(plain.series.polynomial(GUIDE), plain.system)
        if _state_terms(_first_term(gauged), plain.system) > most:
            return False  # before the series of a long Casimir is begun
        after = gauged.series.polynomial(GUIDE)
    except OverflowError:
        return False
    if not after.tower.depends_on(after.terms[GUIDE - 1], [name]):
        return False
    return _state_terms(after, plain.system) <= most


def _first_term(gauged: Gauged) -> PolynomialSeries:
    """S_1, which is H, in a ring of its own."""
    h = gauged.system.hamiltonian
    tower = Tower(symbols_of(h), [h])
    return PolynomialSeries(tower, (tower.convert(h),))


def _state_terms(series: PolynomialSeries, system: System) -> int:
    """Number of monomials in the coordinates in all terms together."""
    tower = series.tower
    state = [i for i in range(len(tower.names)) if tower.depends_on(tower.gens[i], system.coordinates)]
    return len({tuple(int(m[i]) for i in state) for s in series.terms for m in s.to_dict()})


def free_gauge(system: System, gauged: Gauged) -> FreeGauge | None:
    """What the solver needs to choose λ: the error π∇S_3, and products of ∇H and the ∇C, which set the scale."""
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
