"""The results of compiling one spec: ``Compilation = CompiledSeries | CompiledSplitting | CompiledGauss |
CompiledLattice``.

All four share what `_Compiled` declares, and a ``system``: that of a lattice of any size raises `SpecError`. Where one
kind is expected, `by_series`, `by_splitting`, `by_gauss` and `by_sweeps` return the compilation as that kind.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

from phigen.display import display
from phigen.gauss.realisation import Realisation
from phigen.gauss.tableau import Tableau, tableau
from phigen.geometry.system import System, system_of_lattice
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.discretisation import Discretisation
from phigen.scheme.gauge import Gauge, Gauged
from phigen.scheme.order import Order
from phigen.scheme.program import Program, StackBound
from phigen.series.hamilton_jacobi import HamiltonJacobi
from phigen.spec.model import Spec
from phigen.splitting.parts import SplitHamiltonian
from phigen.symbolic.expression import Expression

if TYPE_CHECKING:
    from phigen.lattice.cell import Cell
    from phigen.lattice.sweep_plans import LatticePlan

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, repr=False)
class _Compiled(ABC):
    """The part that all compilations share; ``seconds`` maps stages of the compiler to their time."""

    spec: Spec
    order: Order
    program: Program
    seconds: Mapping[str, float] = field(default_factory=dict)
    choice: str = ""  # the reason for the scheme, where ``scheme: auto`` chose it

    def __repr__(self) -> str:
        return f"<Compilation of {self.spec.name}: order {self.order.order}, {self.label}>"

    @property
    @abstractmethod
    def scheme_name(self) -> str:
        """The scheme, as in specs."""

    @property
    @abstractmethod
    def label(self) -> str:
        """The kind of the method, for every place that names it to the user."""

    @property
    @abstractmethod
    def exact(self) -> bool:
        """Whether a step starts and ends at the ends of one path to round-off, or has exact structure; see
        `poisson`."""

    @property
    @abstractmethod
    def poisson(self) -> bool:
        """Whether a step is a Poisson map to round-off: one of exact structure, without forces."""

    @property
    def symmetric(self) -> bool:
        """Whether a step of −h is the inverse of a step of h."""
        return True

    @property
    def degree(self) -> int | None:
        """The degree d of a truncation, with a Poisson defect of O(h^(d+1)); None where none is known."""
        return None

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation, or the scheme where steps have none."""
        return self.scheme_name

    @property
    def birealisation(self) -> str | None:
        """The kind of the bi-realisation that the compiler chose or was asked for; None where steps have none."""
        return None

    @property
    def in_double(self) -> Self:
        """This compilation in double precision."""
        program = self.program
        return replace(self, program=replace(program, extras=replace(program.extras, real="double")))

    def including(self, part: str) -> Self:
        """Return the compilation for code that has a part, although its profile or its spec leaves the part out."""
        extras, program = self.program.extras, self.program
        if program.offers(part):
            return self
        extras = replace(extras, without=extras.without - {part}, included=extras.included | {part})
        return replace(self, program=replace(program, extras=extras))

    def with_stack(self, stack: StackBound | None) -> Self:
        """Return the compilation whose C states a measured bound of its stack, or none."""
        return replace(self, program=replace(self.program, stack=stack))

    @property
    def method(self) -> str:
        """The scheme, the bi-realisation if there is one, the order and the profile, as the first lines of runs say."""
        scheme = self.described["scheme"]
        scheme_text = scheme if self.label.startswith(scheme) else f"{scheme} ({self.label})"
        return f"scheme {scheme_text}, order {self.order.order}, profile {self.program.profile}"

    @property
    def described(self) -> dict[str, Any]:
        """Description of the method as plain data."""
        return {"scheme": self.scheme_name}

    @property
    def reasons(self) -> Mapping[str, str]:
        """The choices of the compiler that have a reason of their own, with it."""
        return {"scheme chosen": self.choice} if self.choice else {}

    @property
    def notes(self) -> list[str]:
        """Decisions of the compiler that the user may not expect, a line each."""
        choice_note = f"scheme: auto chose {self.choice}" if self.choice else ""
        return [*filter(None, [choice_note, self.order.note])]

    @property
    def monitor(self) -> Expression | None:
        """dt/dτ, where steps are equal in τ."""
        return None

    @property
    def has_series(self) -> bool:
        """Whether the step comes from S_1, S_2, … and a bi-realisation."""
        return False

    @property
    def is_composed(self) -> bool:
        """Whether a step is composed of several maps."""
        return len(self.program.fractions) > 1

    @property
    def stage(self) -> Order:
        """The order and the terms of one stage: those of the method, unless it is composed of stages of order 2."""
        return self.order if len(self.program.fractions) == 1 else Order(2, 1)

    @property
    def known_system(self) -> System | None:
        """The system, for another compilation of it; None for a lattice, whose cell is built anew."""
        return None

    def named(self, method: str) -> str:
        """A line that names the method, with the reason for a choice that depends on the runs of the spec."""
        return method

    def by_series(self) -> CompiledSeries:
        """The compilation to a series. Raises `ValueError` for others."""
        raise self._not("generating function")

    def by_splitting(self) -> CompiledSplitting:
        """The compilation to a splitting. Raises `ValueError` for others."""
        raise self._not("parts with flows")

    def by_gauss(self) -> CompiledGauss:
        """The compilation to Gauss collocation. Raises `ValueError` for others."""
        raise self._not("stages of collocation")

    def by_sweeps(self) -> CompiledLattice:
        """The compilation of a lattice of any size. Raises `ValueError` for others."""
        raise self._not("sweeps over sites")

    def _not(self, part: str) -> ValueError:
        return ValueError(f"{self.spec.name} is compiled to {self.label}, which has no {part}")

    def _repr_html_(self) -> str:
        """The system and its method, for notebooks."""
        return cast(str, display("page of a compilation")(self))


@dataclass(frozen=True, kw_only=True, repr=False)
class _CompiledSystem(_Compiled, ABC):
    """A system of a fixed number of coordinates."""

    system: System
    gauge: Gauge = field(default_factory=Gauge)

    @property
    def poisson(self) -> bool:
        """Whether a step is a Poisson map to round-off: one of exact structure, without forces."""
        return self.exact and self.system.forces is None

    @property
    def discretised(self) -> System:
        """The system with the Hamiltonian that is discretised: H less the Casimirs of the gauge."""
        return self.gauge.applied(self.system)

    @property
    def notes(self) -> list[str]:
        """Decisions of the compiler that the user may not expect, a line each."""
        return [*super().notes, *filter(None, self.gauge.notes)]

    @property
    def monitor(self) -> Expression | None:
        """dt/dτ, where steps are equal in τ."""
        return self.gauge.monitor

    @abstractmethod
    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """The result of the function for this kind of compilation."""

    @property
    def known_system(self) -> System | None:
        """The system of coordinates."""
        return self.system

    def _repr_latex_(self) -> str:
        """The formulas of the system and of the method, for notebooks."""
        return cast(str, display("formulas of a compilation")(self))


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledSeries(_CompiledSystem):
    """A step from S_1, S_2, … and the bi-realisation, with the discretised system and its generating function."""

    realisation: BiRealisation
    gauged: Gauged
    scheme: Discretisation

    @property
    def scheme_name(self) -> str:
        """The scheme, as in specs."""
        return "series"

    @property
    def label(self) -> str:
        """The name of the bi-realisation."""
        return self.realisation.label

    @property
    def exact(self) -> bool:
        """Whether a step starts and ends at the ends of one p to round-off."""
        return self.realisation.exact

    @property
    def symmetric(self) -> bool:
        """Whether a step of −h is the inverse of a step of h."""
        return self.realisation.symmetric

    @property
    def degree(self) -> int | None:
        """The degree of a truncated bi-realisation."""
        return self.realisation.degree

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation."""
        return self.realisation.kind

    @property
    def birealisation(self) -> str | None:
        """The kind of the bi-realisation."""
        return self.realisation.kind

    @property
    def reasons(self) -> Mapping[str, str]:
        """The reason for the bi-realisation."""
        reason, automatic = self.realisation.explanation, f"auto picked {self.realisation.kind}, "
        if reason.startswith(automatic):
            reason = "chosen by phigen, " + reason.removeprefix(automatic)
        return {**super().reasons, "bi-realisation": f"{self.label}, {reason}"}

    @property
    def has_series(self) -> bool:
        """Whether the step comes from S_1, S_2, … and a bi-realisation."""
        return True

    @property
    def discretised(self) -> System:
        """The system with the Hamiltonian that is discretised: H less the Casimirs of the gauge."""
        return self.gauged.system

    @property
    def series(self) -> HamiltonJacobi:
        """The series of `discretised`; the symbol ``gauge:C`` is the multiple of C that the solver chooses."""
        return self.gauged.series

    def by_series(self) -> CompiledSeries:
        """Return this compilation, which is one by a series."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """The result of the function for a series."""
        return series(self)


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledSplitting(_CompiledSystem):
    """A step by the exact flows of the parts of H."""

    splitting: SplitHamiltonian

    @property
    def symmetric(self) -> bool:
        """Whether a step of −h is the inverse of a step of h; with a corrector only up to terms of order ε²."""
        schedule = self.program.step.flow_schedule
        return schedule is None or len(schedule.end) < 2

    @property
    def scheme_name(self) -> str:
        """The scheme, as in specs."""
        return "splitting"

    @property
    def label(self) -> str:
        """The name of the scheme."""
        return "splitting"

    @property
    def exact(self) -> bool:
        """Whether a step is a Poisson map: always, since flows are."""
        return True

    @property
    def is_composed(self) -> bool:
        """A step is composed of flows."""
        return True

    def by_splitting(self) -> CompiledSplitting:
        """Return this compilation, which is one by a splitting."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """The result of the function for a splitting."""
        return splitting(self)


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledGauss(_CompiledSystem):
    """A step by Gauss collocation, of the unknowns of ``gauss``."""

    gauss: Realisation

    @property
    def scheme_name(self) -> str:
        """The scheme, as in specs."""
        return "gauss"

    @property
    def label(self) -> str:
        """The unknowns, and whether the structure is exact."""
        return self.gauss.label

    @property
    def exact(self) -> bool:
        """Whether the step has exact structure."""
        return self.gauss.exact

    @property
    def degree(self) -> int | None:
        """The order, which is that of the Poisson defect too."""
        return self.order.order

    @property
    def notes(self) -> list[str]:
        """Decisions of the compiler, and that steps to truncation are no Poisson maps."""
        defect = f"its defect is O(h^{self.order.order + 1}) in a step, and phigen verify measures it"
        warned = [] if self.gauss.exact else [f"structure: to truncation: a step is not a Poisson map; {defect}"]
        return [*super().notes, *warned]

    @property
    def structure(self) -> str:
        """The structure of the method, as in specs."""
        return "exact" if self.gauss.exact else "to truncation"

    @property
    def tableau(self) -> Tableau:
        """The coefficients of the stages."""
        return tableau(self.order.terms)

    @property
    def described(self) -> dict[str, Any]:
        """Description of the method as plain data."""
        return {"scheme": self.scheme_name, "structure": self.structure}

    def by_gauss(self) -> CompiledGauss:
        """Return this compilation, which is one by Gauss collocation."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """The result of the function for collocation."""
        return gauss(self)


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledLattice(_Compiled):
    """A lattice of any size: its ``cell``, and the plan of the ``sweeps`` of a step."""

    cell: Cell
    sweeps: LatticePlan

    @property
    def system(self) -> System:
        """Raise `SpecError`: the number of coordinates is not known before a run."""
        raise system_of_lattice(self.spec)

    @property
    def discretised(self) -> System:
        """Raise `SpecError`: the number of coordinates is not known before a run."""
        return self.system

    @property
    def gauge(self) -> Gauge:
        """Nothing is subtracted from H."""
        return Gauge()

    @property
    def scheme_name(self) -> str:
        """The scheme, as in specs."""
        return self.sweeps.scheme

    @property
    def label(self) -> str:
        """The bi-realisation, or that H is split."""
        return self.sweeps.label

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation, or the scheme where steps have none."""
        return self.sweeps.kind

    @property
    def birealisation(self) -> str | None:
        """The kind of the bi-realisation, where it is one of a site."""
        return self.sweeps.site_kind

    @property
    def is_composed(self) -> bool:
        """Whether a step is composed of several maps: of flows, or of stages."""
        return not self.sweeps.is_implicit or len(self.program.fractions) > 1

    @property
    def exact(self) -> bool:
        """Flows and implicit stages are Poisson maps."""
        return True

    @property
    def poisson(self) -> bool:
        """Whether a step is a Poisson map to round-off: one without forces."""
        return not self.cell.forces

    @property
    def described(self) -> dict[str, Any]:
        """Description of the method as plain data, with the number of colours.

        ``since`` is the reason if the sizes of runs require the series, or more colours.
        """
        plan = self.sweeps
        return {"scheme": plan.scheme, "colours": plan.colouring.count, "since": plan.since or None}

    def named(self, method: str) -> str:
        """Return a line that names the method; if the sizes of the runs decide it, with the reason."""
        if not self.sweeps.since:
            return method
        colours = self.sweeps.colouring.count
        seam = " and a seam" * bool(self.sweeps.colouring.seams)
        return f"{method}: {f'{colours} colours{seam}' if colours > 1 else 'the series'}, since {self.sweeps.since}"

    def by_sweeps(self) -> CompiledLattice:
        """Return this compilation, which is one of a lattice."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """Raise `SpecError`: a lattice is of none of these kinds."""
        raise system_of_lattice(self.spec)

    def _repr_latex_(self) -> str:
        """The formulas of the cell, for notebooks."""
        return cast(str, display("formulas of a cell")(self.cell))


Compilation = CompiledSeries | CompiledSplitting | CompiledGauss | CompiledLattice
