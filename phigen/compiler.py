"""The pipeline, on one screen.

    spec file ─► Spec ─► System ─► BiRealisation ─► Gauged ─► Discretisation ─► Program ─► source files
                                └─► Splitting ──────────────────────────────────┘

Each stage is a function from one frozen dataclass to the next; `Compilation` keeps what each of them made and the
seconds it took. `Gauged` holds the Hamilton–Jacobi series, which is computed once, as far as any stage or proof asks;
`Discretisation` the generating function.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from phigen import progress, registry
from phigen import spec as specs
from phigen.errors import LimitError
from phigen.geometry.system import System, system_from_spec
from phigen.realisations.catalogue import realise
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.assemble import build_program
from phigen.scheme.choosing import plan as plan_splitting
from phigen.scheme.discretisation import Discretisation, discretise
from phigen.scheme.gauge import Gauge, Gauged, choose, given
from phigen.scheme.order import Order, plan_order
from phigen.scheme.program import Program
from phigen.scheme.splitting import build_splitting
from phigen.series.hamilton_jacobi import HamiltonJacobi
from phigen.spec.model import Extras, Spec
from phigen.splitting.parts import Splitting, split

T = TypeVar("T")


@dataclass(frozen=True)
class Compilation:
    """Everything that compiling one spec made, stage by stage; ``seconds`` maps stages to their time."""

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

    @property
    def chart(self) -> BiRealisation:
        """The bi-realisation; a splitting has none, and must not be asked."""
        if self.realisation is None:
            raise ValueError(f"{self.spec.name} is compiled to a splitting, which has no bi-realisation")
        return self.realisation

    @property
    def label(self) -> str:
        """The kind of the method, for every place that names it to the user."""
        return self.realisation.label if self.realisation else "splitting"

    @property
    def exact(self) -> bool:
        """Whether a step is a Poisson map to round-off."""
        return self.realisation is None or self.realisation.exact

    @property
    def symmetric(self) -> bool:
        """Whether a step of −h undoes one of h."""
        return self.realisation is None or self.realisation.symmetric

    @property
    def discretised(self) -> System:
        """The system with the Hamiltonian that is discretised: H less the Casimirs of the gauge."""
        return self.gauged.system if self.gauged else self.gauge.applied(self.system)

    @property
    def series(self) -> HamiltonJacobi:
        """The series of `discretised`; the symbol ``gauge:C`` is the multiple of C that the solver chooses."""
        if self.gauged is None:
            raise ValueError(f"{self.spec.name} is compiled to a splitting, which has no generating function")
        return self.gauged.series


@contextmanager
def bounded(spec: Spec) -> Iterator[None]:
    """Polynomials that would be larger than memory are a `LimitError` of the spec."""
    try:
        yield
    except OverflowError as error:
        hint = "fewer terms, lower powers or a lower order; scheme: splitting needs no series"
        raise LimitError([spec.diagnostic(("hamiltonian",), f"the spec needs {error}", hint)]) from error


def compile_spec(
    spec: Spec,
    *,
    order: int | None = None,
    scheme: str | None = None,
    system: System | None = None,
    extras: Extras | None = None,
) -> Compilation:
    """Compile a spec; ``order`` overrides the order (and the terms) that it asks for, ``scheme`` and ``extras`` too.

    ``system`` is its system, where the caller has built it already. Raises `SpecError` (no bi-realisation applies, H
    does not split, …) and `LimitError` (the program would be too large).
    """
    with bounded(spec):
        return _compiled(spec, order, scheme, system, extras)


def _compiled(
    spec: Spec, order: int | None, scheme: str | None, system: System | None, extras: Extras | None
) -> Compilation:
    clock = _Clock()
    source = system or clock.timed("system", lambda: system_from_spec(spec))
    extras = extras or spec.extras
    described: dict[str, Any] = {
        "title": spec.title,
        "licence": spec.license,
        "spec_sha256": spec.source_sha256,
        "extras": extras,
        "profile": spec.profile,
    }
    if (scheme or spec.scheme) == "splitting":
        return _split(spec, source, order, described, clock)
    choice = replace(spec.birealisation, order=order) if order else spec.birealisation
    realisation = clock.timed("bi-realisation", lambda: realise(source, choice))
    plan = plan_order(order or spec.order, None if order else spec.terms, symmetric=realisation.symmetric)
    gauged = clock.timed("gauge", lambda: choose(source, realisation, spec.gauge))
    reached = clock.timed(
        "generating function", lambda: discretise(gauged.system, realisation, gauged.series, plan, spec.composition)
    )
    program = clock.timed(
        "program", lambda: build_program(source, realisation, plan, gauged, reached, solver=spec.solver, **described)
    )
    return Compilation(
        spec, source, realisation, plan, program, gauged.gauge, clock.seconds, gauged=gauged, scheme=reached
    )


def _split(spec: Spec, source: System, order: int | None, described: Mapping[str, Any], clock: _Clock) -> Compilation:
    """Compile to a splitting."""
    gauge = Gauge() if isinstance(spec.gauge, str) else given(source, spec.gauge)
    discretised = gauge.applied(source)
    parts = clock.timed("splitting", lambda: split(discretised))
    choice = clock.timed(
        "composition", lambda: plan_splitting(discretised, parts, order or spec.wanted_order, spec.composition)
    )
    described = {**described, "lanes": spec.solver.lanes}
    program = clock.timed("program", lambda: build_splitting(source, choice, gauge, **described))
    return Compilation(spec, source, None, choice.order, program, gauge, clock.seconds, choice.splitting)


class _Clock:
    """The seconds of each stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def timed(self, stage: str, work: Callable[[], T]) -> T:
        """The result of a stage."""
        with progress.stage(stage) as running:
            result = work()
        self.seconds[stage] = running.seconds
        return result


def compile_file(path: str | Path, *, order: int | None = None) -> Compilation:
    """`compile_spec` for a file."""
    return compile_spec(specs.load(path), order=order)


def emit(program: Program, target: str, command: str, *, single_file: bool = False) -> dict[str, str]:
    """The files of one target, by name; ``command`` is what regenerates them. `ValueError` for unknown targets."""
    return registry.find(target).emit(program, command, single_file=single_file)
