"""What compiling one spec made, stage by stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

from phigen.display import display
from phigen.gauss.realisation import Realisation
from phigen.geometry.system import System, system_of_lattice
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.discretisation import Discretisation
from phigen.scheme.gauge import Gauge, Gauged
from phigen.scheme.order import Order
from phigen.scheme.program import Program
from phigen.series.hamilton_jacobi import HamiltonJacobi
from phigen.spec.model import Spec
from phigen.splitting.parts import Splitting
from phigen.symbolic.expression import Expression

if TYPE_CHECKING:
    from phigen.lattice.cell import Cell
    from phigen.lattice.sweep_plans import LatticePlan


class NoSystem:
    """What a lattice has in place of a system of a fixed number of coordinates: whoever asks for one is told so."""

    def __init__(self, spec: Spec) -> None:
        self._spec = spec

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        raise system_of_lattice(self._spec)


@dataclass(frozen=True, repr=False)
class Compilation:
    """Everything that compiling one spec made, stage by stage; ``seconds`` maps stages to their time.

    A lattice has a ``cell``, and its system is a `NoSystem`.
    """

    spec: Spec
    system: System
    realisation: BiRealisation | None
    order: Order
    program: Program
    gauge: Gauge = field(default_factory=Gauge)
    seconds: Mapping[str, float] = field(default_factory=dict)
    splitting: Splitting | None = None
    gauged: Gauged | None = None
    scheme: Discretisation | None = None
    cell: Cell | None = None
    sweeps: LatticePlan | None = None
    gauss: Realisation | None = None

    def __repr__(self) -> str:
        return f"<Compilation of {self.spec.name}: order {self.order.order}, {self.label}>"

    @property
    def in_double(self) -> Compilation:
        """The same in double precision."""
        program = self.program
        return replace(self, program=replace(program, extras=replace(program.extras, real="double")))

    @property
    def chart(self) -> BiRealisation:
        """The bi-realisation; a splitting has none, and must not be asked."""
        if self.realisation is None:
            raise ValueError(f"{self.spec.name} is compiled to {self.label}, which has no bi-realisation")
        return self.realisation

    @property
    def label(self) -> str:
        """The kind of the method, for every place that names it to the user."""
        if self.realisation:
            return self.realisation.label
        if self.gauss:
            return self.gauss.label
        if self.sweeps is None:
            return "splitting"
        from phigen.lattice.series import SeriesPlan

        if isinstance(self.sweeps, SeriesPlan):
            return f"{self.sweeps.realisation.kind}, on a lattice"
        return "splitting of a lattice"

    @property
    def method(self) -> str:
        """The scheme, the bi-realisation if there is one, the order and the profile, as the first lines of runs say."""
        scheme = self.described["scheme"]
        named = scheme if self.label.startswith(scheme) else f"{scheme} ({self.label})"
        return f"scheme {named}, order {self.order.order}, profile {self.program.profile}"

    @property
    def described(self) -> dict[str, Any]:
        """The method for machines; of a lattice its colours too, and why it is the series, or has more of them, where
        sizes of runs ask it."""
        if self.sweeps is None:
            return {"scheme": self.scheme_name} | ({"structure": self.structure} if self.gauss else {})
        from phigen.lattice.series import SeriesPlan

        scheme = "series" if isinstance(self.sweeps, SeriesPlan) else "splitting"
        return {"scheme": scheme, "colours": self.sweeps.colouring.count, "since": self.sweeps.since or None}

    @property
    def scheme_name(self) -> str:
        """The scheme of a system of a few coordinates, as in specs."""
        return "gauss" if self.gauss else "splitting" if self.splitting else "series"

    @property
    def structure(self) -> str:
        """The structure of a Gauss method, as in specs."""
        return "to truncation" if self.gauss and not self.gauss.exact else "exact"

    def told(self, method: str) -> str:
        """A line that names the method, and why it is the series, or has more colours, where sizes of runs ask it."""
        if self.sweeps is None or not self.sweeps.since:
            return method
        colours = self.sweeps.colouring.count
        seam = " and a seam" * bool(self.sweeps.colouring.seams)
        return f"{method}: {f'{colours} colours{seam}' if colours > 1 else 'the series'}, since {self.sweeps.since}"

    @property
    def notes(self) -> list[str]:
        """Decisions of the compiler that the user may not expect, a line each."""
        return [note for note in (self.order.note, *self.gauge.notes) if note]

    @property
    def exact(self) -> bool:
        """Whether a step starts and ends at the ends of one p to round-off, or has exact structure; see `poisson`."""
        method = self.gauss or self.realisation
        return method is None or method.exact

    @property
    def degree(self) -> int | None:
        """The degree d of a truncation, with a Poisson defect of O(h^(d+1)); None where none is known."""
        return self.order.order if self.gauss else self.chart.degree

    @property
    def poisson(self) -> bool:
        """Whether a step is a Poisson map to round-off: that of an exact bi-realisation, without forces."""
        return self.exact and self.system.forces is None

    @property
    def symmetric(self) -> bool:
        """Whether a step of −h undoes one of h."""
        return self.realisation is None or self.realisation.symmetric

    @property
    def discretised(self) -> System:
        """The system with the Hamiltonian that is discretised: H less the Casimirs of the gauge."""
        return self.gauged.system if self.gauged else self.gauge.applied(self.system)

    @property
    def stage(self) -> Order:
        """The order and the terms of one stage: those of the method, unless it is composed of stages of order 2."""
        return self.order if len(self.program.fractions) == 1 else Order(2, 1)

    @property
    def monitor(self) -> Expression | None:
        """dt/dτ, where steps are equal in τ."""
        return self.gauge.monitor

    @property
    def series(self) -> HamiltonJacobi:
        """The series of `discretised`; the symbol ``gauge:C`` is the multiple of C that the solver chooses."""
        if self.gauged is None:
            raise ValueError(f"{self.spec.name} is compiled to {self.label}, which has no generating function")
        return self.gauged.series

    def _repr_latex_(self) -> str:
        """The formulas of the system and of the method, of a lattice those of the cell, for notebooks."""
        if self.cell:
            return cast(str, display("formulas of a cell")(self.cell))
        return cast(str, display("formulas of a compilation")(self))

    def _repr_html_(self) -> str:
        """The system and what it was compiled to, for notebooks."""
        return cast(str, display("page of a compilation")(self))
