"""The results of compiling one spec: ``Compilation = CompiledSeries | CompiledSplitting | CompiledGauss |
CompiledLattice``.

All four classes have the members of `_Compiled` and a property ``system``. For lattices, whose size is open, this
property raises `SpecError`. The methods `by_series`, `by_splitting`, `by_gauss` and `by_sweeps` return the compilation
itself, with the type of one class: `by_gauss`, for instance, with the type `CompiledGauss`. A compilation of another
class raises `ValueError` instead.
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
    """Base class of all compilations: a spec, its method, and the program of a step.

    ``seconds`` has the duration of each stage of the compiler, by the name of the stage.
    """

    spec: Spec
    order: Order
    program: Program
    seconds: Mapping[str, float] = field(default_factory=dict)
    choice: str = ""  # the reason for the choice of the scheme, with ``scheme: auto``

    def __repr__(self) -> str:
        return f"<Compilation of {self.spec.name}: order {self.order.order}, {self.label}>"

    @property
    @abstractmethod
    def scheme_name(self) -> str:
        """The name of the scheme, as in specs: ``series``, ``splitting`` or ``gauss``."""

    @property
    @abstractmethod
    def label(self) -> str:
        """The method in a few words for users, for instance the kind of the bi-realisation."""

    @property
    @abstractmethod
    def exact(self) -> bool:
        """Whether a step preserves the Poisson structure to round-off, rather than up to a power of h.

        In a series, this is so if the maps α and β are exact, rather than truncated in p. Forces do not count here:
        with forces a step is never a Poisson map, see `poisson`.
        """

    @property
    @abstractmethod
    def poisson(self) -> bool:
        """Whether a step is a Poisson map to round-off: it preserves the structure exactly, and there are no forces."""

    @property
    def symmetric(self) -> bool:
        """Whether a step of size −h is the inverse of a step of size h."""
        return True

    @property
    def degree(self) -> int | None:
        """The degree d of a truncated method; None if nothing is truncated.

        The steps of a truncated method are Poisson maps up to O(h^(d+1)).
        """
        return None

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation (the maps α, β), or the name of the scheme if steps have no bi-realisation."""
        return self.scheme_name

    @property
    def birealisation(self) -> str | None:
        """The kind of the bi-realisation (the maps α, β); None for schemes without bi-realisation."""
        return None

    @property
    def in_double(self) -> Self:
        """This compilation, but with a program in double precision."""
        program = self.program
        return replace(self, program=replace(program, extras=replace(program.extras, real="double")))

    def including(self, part: str) -> Self:
        """Return the compilation with an optional part of the code, even if the profile or the spec excludes
        this part.
        """
        extras, program = self.program.extras, self.program
        if program.offers(part):
            return self
        extras = replace(extras, without=extras.without - {part}, included=extras.included | {part})
        return replace(self, program=replace(program, extras=extras))

    def with_stack(self, stack: StackBound | None) -> Self:
        """Return the compilation with a measured stack use, which the C states in a comment; for None, without one."""
        return replace(self, program=replace(self.program, stack=stack))

    @property
    def method(self) -> str:
        """The method in words: scheme, bi-realisation if there is one, order, and profile."""
        scheme = self.described["scheme"]
        scheme_text = scheme if self.label.startswith(scheme) else f"{scheme} ({self.label})"
        return f"scheme {scheme_text}, order {self.order.order}, profile {self.program.profile}"

    @property
    def described(self) -> dict[str, Any]:
        """The method as plain data, for the output of commands in JSON."""
        return {"scheme": self.scheme_name}

    @property
    def reasons(self) -> Mapping[str, str]:
        """The reasons for choices of the compiler, by the label of the choice, such as "scheme chosen"."""
        return {"scheme chosen": self.choice} if self.choice else {}

    @property
    def notes(self) -> list[str]:
        """Choices of the compiler that the user may not expect, each as a line of text."""
        choice_note = f"scheme: auto chose {self.choice}" if self.choice else ""
        return [*filter(None, [choice_note, self.order.note])]

    @property
    def unused(self) -> list[tuple[str, ...]]:
        """Paths of the keys of the spec that have no effect, since an option replaced the scheme that they are for."""
        return []

    @property
    def monitor(self) -> Expression | None:
        """The monitor g of dt = g dτ, with which steps have equal size in τ; None if there is none."""
        return None

    @property
    def has_series(self) -> bool:
        """Whether the step is computed from a bi-realisation and the terms S_1, S_2, … of a generating function."""
        return False

    @property
    def is_composed(self) -> bool:
        """Whether a step is composed of several maps, such as flows or steps of lower order."""
        return len(self.program.fractions) > 1

    @property
    def stage(self) -> Order:
        """The order of a single map of a step, and the number of its terms S_1, S_2, ….

        If a step is one map, these are the order and the number of terms of the method. If a step is composed of
        several maps, each map has order 2 and one term.
        """
        return self.order if len(self.program.fractions) == 1 else Order(2, 1)

    @property
    def known_system(self) -> System | None:
        """The system, for use in further compilations of the spec; None for a lattice."""
        return None

    def named(self, method: str) -> str:
        """Return ``method``, a line of text that names the method. Subclasses may add the reason for the method."""
        return method

    def by_series(self) -> CompiledSeries:
        """Return this compilation if its scheme is a series. Raises `ValueError` for other schemes."""
        raise self._not("generating function")

    def by_splitting(self) -> CompiledSplitting:
        """Return this compilation if its scheme is a splitting. Raises `ValueError` for other schemes."""
        raise self._not("parts with flows")

    def by_gauss(self) -> CompiledGauss:
        """Return this compilation if its scheme is Gauss collocation. Raises `ValueError` for other schemes."""
        raise self._not("stages of collocation")

    def by_sweeps(self) -> CompiledLattice:
        """Return this compilation if it is the compilation of a lattice of any size. Raises `ValueError` for other
        systems."""
        raise self._not("sweeps over sites")

    def _not(self, part: str) -> ValueError:
        return ValueError(f"{self.spec.name} is compiled to {self.label}, which has no {part}")

    def _repr_html_(self) -> str:
        """The system and its method as HTML, for notebooks."""
        return cast(str, display("page of a compilation")(self))


@dataclass(frozen=True, kw_only=True, repr=False)
class _CompiledSystem(_Compiled, ABC):
    """Base class of the compilations of systems with a fixed number of coordinates.

    The class for lattices of any size is not derived from this class.
    """

    system: System
    gauge: Gauge = field(default_factory=Gauge)

    @property
    def poisson(self) -> bool:
        """Whether a step is a Poisson map to round-off: it preserves the structure exactly, and there are no forces."""
        return self.exact and self.system.forces is None

    @property
    def discretised(self) -> System:
        """The system whose Hamiltonian is discretised: H minus multiples of Casimirs (the gauge)."""
        return self.gauge.applied(self.system)

    @property
    def notes(self) -> list[str]:
        """Choices of the compiler that the user may not expect, each as a line of text."""
        return [*super().notes, *filter(None, self.gauge.notes)]

    @property
    def monitor(self) -> Expression | None:
        """The monitor g of dt = g dτ, with which steps have equal size in τ; None if there is none."""
        return self.gauge.monitor

    @abstractmethod
    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """Call the function for the scheme of this compilation, with this compilation as its argument, and return the
        result.
        """

    @property
    def known_system(self) -> System | None:
        """The compiled system."""
        return self.system

    def _repr_latex_(self) -> str:
        """The formulas of the system and of the method as LaTeX, for notebooks."""
        return cast(str, display("formulas of a compilation")(self))


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledSeries(_CompiledSystem):
    """Compilation by scheme ``series``: the step is computed from a bi-realisation and a generating function.

    ``gauged`` holds the discretised system and its Hamilton–Jacobi series S_1, S_2, …, ``scheme`` the generating
    function.
    """

    realisation: BiRealisation
    gauged: Gauged
    scheme: Discretisation

    @property
    def scheme_name(self) -> str:
        """The name of the scheme: "series"."""
        return "series"

    @property
    def label(self) -> str:
        """The method in a few words for users: the name of the bi-realisation (the maps α, β)."""
        return self.realisation.label

    @property
    def exact(self) -> bool:
        """Whether the maps α and β are exact, rather than truncated.

        With exact maps, the state before a step is α(y, p) and the state after it is β(y, p), up to round-off, for some
        y and p.
        """
        return self.realisation.exact

    @property
    def symmetric(self) -> bool:
        """Whether a step of size −h is the inverse of a step of size h."""
        return self.realisation.symmetric

    @property
    def degree(self) -> int | None:
        """The degree in p at which the bi-realisation is truncated; None if it is exact."""
        return self.realisation.degree

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation (the maps α, β), such as ``constant``."""
        return self.realisation.kind

    @property
    def birealisation(self) -> str | None:
        """The kind of the bi-realisation (the maps α, β), such as ``constant``."""
        return self.realisation.kind

    @property
    def reasons(self) -> Mapping[str, str]:
        """The reasons for the choices of the scheme and of the bi-realisation (the maps α, β), by the label of the
        choice."""
        reason, automatic = self.realisation.explanation, f"auto picked {self.realisation.kind}, "
        if reason.startswith(automatic):
            reason = "chosen by phigen, " + reason.removeprefix(automatic)
        return {**super().reasons, "bi-realisation": f"{self.label}, {reason}"}

    @property
    def has_series(self) -> bool:
        """True: the step is computed from a bi-realisation and the terms S_1, S_2, … of a generating function."""
        return True

    @property
    def discretised(self) -> System:
        """The system whose Hamiltonian is discretised: H minus multiples of Casimirs (the gauge)."""
        return self.gauged.system

    @property
    def series(self) -> HamiltonJacobi:
        """The Hamilton–Jacobi series of the system `discretised`.

        The symbol ``gauge:C`` stands for the multiple of the Casimir C that the solver subtracts from H.
        """
        return self.gauged.series

    def by_series(self) -> CompiledSeries:
        """Return this compilation, whose scheme is a series. For other schemes, `ValueError` is raised."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """Call ``series`` with this compilation, and return the result."""
        return series(self)


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledSplitting(_CompiledSystem):
    """Compilation by scheme ``splitting``: a step by the exact flows of parts of H."""

    splitting: SplitHamiltonian

    @property
    def symmetric(self) -> bool:
        """Whether a step of size −h is the inverse of a step of size h; false for a method with a corrector.

        A corrector is a map after the last step, whose inverse is applied before the first step. With a corrector, step
        −h is the inverse of step h only up to terms of order ε², where ε is the size of the small part of H.
        """
        schedule = self.program.step.flow_schedule
        return schedule is None or len(schedule.end) < 2

    @property
    def scheme_name(self) -> str:
        """The name of the scheme: "splitting"."""
        return "splitting"

    @property
    def label(self) -> str:
        """The method in a word for users: "splitting"."""
        return "splitting"

    @property
    def exact(self) -> bool:
        """True: flows of parts of H are Poisson maps."""
        return True

    @property
    def is_composed(self) -> bool:
        """True: a step is composed of flows."""
        return True

    @property
    def unused(self) -> list[tuple[str, ...]]:
        """Paths of those keys of the spec that have no effect on a splitting.

        One example is ``tolerance``: the flows are exact, so no equation is solved by iteration.
        """
        paths_of_solver = [("solver", key) for key in self.spec.solve_settings]
        return [*((key,) for key in self.spec.series_settings), *paths_of_solver]

    def by_splitting(self) -> CompiledSplitting:
        """Return this compilation, whose scheme is a splitting. For other schemes, `ValueError` is raised."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """Call ``splitting`` with this compilation, and return the result."""
        return splitting(self)


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledGauss(_CompiledSystem):
    """Compilation by scheme ``gauss``: a step by Gauss collocation. ``gauss`` describes the unknowns of the
    equations.
    """

    gauss: Realisation

    @property
    def scheme_name(self) -> str:
        """The name of the scheme: "gauss"."""
        return "gauss"

    @property
    def label(self) -> str:
        """The method in a few words for users: the unknowns of a step, and whether a step preserves the Poisson
        structure.
        """
        return self.gauss.label

    @property
    def exact(self) -> bool:
        """Whether a step preserves the Poisson structure to round-off, rather than up to a power of h."""
        return self.gauss.exact

    @property
    def degree(self) -> int | None:
        """The order d of the method. Unless steps preserve the Poisson structure exactly, the defect is O(h^(d+1))."""
        return self.order.order

    @property
    def unused(self) -> list[tuple[str, ...]]:
        """Paths of those keys of the spec that have no effect on a Gauss method.

        One example is ``terms``, since Gauss methods have no series.
        """
        return [(key,) for key in self.spec.series_settings]

    @property
    def notes(self) -> list[str]:
        """Choices of the compiler, each as a line of text. A last line warns if steps are not Poisson maps."""
        defect = f"its defect is O(h^{self.order.order + 1}) in a step, and phigen verify measures it"
        warned = [] if self.gauss.exact else [f"with `structure: to truncation`, a step is not a Poisson map; {defect}"]
        return [*super().notes, *warned]

    @property
    def structure(self) -> str:
        """Whether steps preserve the Poisson structure, in the words of specs: ``exact`` or ``to truncation``."""
        return "exact" if self.gauss.exact else "to truncation"

    @property
    def tableau(self) -> Tableau:
        """The coefficients of the Gauss method."""
        return tableau(self.order.terms)

    @property
    def described(self) -> dict[str, Any]:
        """The method as plain data, for the output of commands in JSON: scheme and structure."""
        return {"scheme": self.scheme_name, "structure": self.structure}

    def by_gauss(self) -> CompiledGauss:
        """Return this compilation, whose scheme is Gauss collocation. For other schemes, `ValueError` is raised."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """Call ``gauss`` with this compilation, and return the result."""
        return gauss(self)


@dataclass(frozen=True, kw_only=True, repr=False)
class CompiledLattice(_Compiled):
    """Compilation of a lattice of any size.

    ``cell`` describes one site with its neighbours. ``sweeps`` is the plan of a step: it consists of sweeps, each of
    which updates all sites.
    """

    cell: Cell
    sweeps: LatticePlan

    @property
    def system(self) -> System:
        """Raise `SpecError`: the number of sites, and so of coordinates, is unknown before a run."""
        raise system_of_lattice(self.spec)

    @property
    def discretised(self) -> System:
        """Raise `SpecError`: the number of sites, and so of coordinates, is unknown before a run."""
        return self.system

    @property
    def gauge(self) -> Gauge:
        """The multiples of Casimirs that are subtracted from H: none for lattices."""
        return Gauge()

    @property
    def scheme_name(self) -> str:
        """The name of the scheme: "splitting" or "series"."""
        return self.sweeps.scheme

    @property
    def label(self) -> str:
        """The method in a few words for users: the kind of the bi-realisation, or "splitting"."""
        return self.sweeps.label

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation (the maps α, β), or the name of the scheme if steps have no bi-realisation."""
        return self.sweeps.kind

    @property
    def birealisation(self) -> str | None:
        """The kind of the bi-realisation (the maps α, β) of one site; None for a splitting."""
        return self.sweeps.site_kind

    @property
    def is_composed(self) -> bool:
        """Whether a step is composed of several maps: flows of parts of H, or implicit steps of order 2."""
        return not self.sweeps.is_implicit or len(self.program.fractions) > 1

    @property
    def exact(self) -> bool:
        """True: a step is composed of flows or implicit maps, each of which preserves the Poisson structure."""
        return True

    @property
    def poisson(self) -> bool:
        """Whether a step is a Poisson map to round-off: true unless there are forces."""
        return not self.cell.forces

    @property
    def described(self) -> dict[str, Any]:
        """The method as plain data, for the output of commands in JSON, with the number of colours of sites.

        The sizes of the lattice in runs of the spec may exclude splittings, or require more colours. Then the entry
        ``since`` has the reason; otherwise it is None.
        """
        plan = self.sweeps
        return {"scheme": plan.scheme, "colours": plan.colouring.count, "since": plan.since or None}

    def named(self, method: str) -> str:
        """Return ``method``, a line of text that names the method.

        The lattice sizes in the runs of the spec can be the reason for the colours, for a seam or for the scheme
        ``series``. Then the line also states this reason.
        """
        if not self.sweeps.since:
            return method
        colours = self.sweeps.colouring.count
        seam = " and a seam" * bool(self.sweeps.colouring.seams)
        return f"{method}: {f'{colours} colours{seam}' if colours > 1 else 'the series'}, since {self.sweeps.since}"

    def by_sweeps(self) -> CompiledLattice:
        """Return this compilation. In the classes for other systems, this method raises `ValueError`."""
        return self

    def by_kind(
        self,
        series: Callable[[CompiledSeries], T],
        splitting: Callable[[CompiledSplitting], T],
        gauss: Callable[[CompiledGauss], T],
    ) -> T:
        """Raise `SpecError`: none of the three functions is for lattices."""
        raise system_of_lattice(self.spec)

    def _repr_latex_(self) -> str:
        """The formulas of the lattice at one site, as LaTeX for notebooks."""
        return cast(str, display("formulas of a cell")(self.cell))


Compilation = CompiledSeries | CompiledSplitting | CompiledGauss | CompiledLattice
