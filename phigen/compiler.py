"""The pipeline, on one screen.

    spec file ─► Spec ─► System ─► BiRealisation ─► Program ─► source files

Each stage is a function from one frozen dataclass to the next; `Compilation` keeps what each of them made and the
seconds it took. The Hamilton–Jacobi series and the staging happen inside `build_program`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from phigen import spec as specs
from phigen.geometry.system import System, system_from_spec
from phigen.realisations.catalogue import realise
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.assemble import build_program
from phigen.scheme.discretisation import series_of
from phigen.scheme.gauge import Gauge, choose
from phigen.scheme.order import Order, plan_order
from phigen.scheme.program import Program
from phigen.series.hamilton_jacobi import PolynomialSeries
from phigen.spec.model import Extras, Spec

T = TypeVar("T")


@dataclass(frozen=True)
class Compilation:
    """Everything that compiling one spec made, stage by stage; ``seconds`` maps stages to their time."""

    spec: Spec
    system: System
    realisation: BiRealisation
    order: Order
    program: Program
    gauge: Gauge = field(default_factory=Gauge)
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def discretised(self) -> System:
        """The system with the Hamiltonian that is discretised: H less the Casimirs of the gauge."""
        return self.gauge.applied(self.system)

    def series(self, terms: int) -> PolynomialSeries:
        """S_1 … S_terms of `discretised`; the symbol ``gauge:C`` is the multiple of C that the solver chooses."""
        return series_of(self.discretised, self.realisation, terms, self.gauge.symbols)


def compile_spec(
    spec: Spec, *, order: int | None = None, system: System | None = None, extras: Extras | None = None
) -> Compilation:
    """Compile a spec; ``order`` overrides the order (and the terms) that it asks for, ``extras`` its extras.

    ``system`` is its system, where the caller has built it already.
    Raises `SpecError` (no bi-realisation applies, …) and `LimitError` (the program would be too large).
    """
    seconds: dict[str, float] = {}

    def timed(stage: str, work: Callable[[], T]) -> T:
        start = time.perf_counter()
        result = work()
        seconds[stage] = time.perf_counter() - start
        return result

    source = timed("system", lambda: system or system_from_spec(spec))
    choice = replace(spec.birealisation, order=order) if order else spec.birealisation
    realisation = timed("bi-realisation", lambda: realise(source, choice))
    plan = plan_order(order or spec.order, None if order else spec.terms, symmetric=realisation.symmetric)
    gauge = timed("gauge", lambda: choose(source, realisation, spec.gauge))
    program = timed(
        "program",
        lambda: build_program(
            source,
            realisation,
            plan,
            composition=spec.composition,
            gauge=gauge,
            solver=spec.solver,
            extras=extras or spec.extras,
            title=spec.title,
            licence=spec.license,
            spec_sha256=spec.source_sha256,
        ),
    )
    return Compilation(spec, source, realisation, plan, program, gauge, seconds)


def compile_file(path: str | Path, *, order: int | None = None) -> Compilation:
    """`compile_spec` for a file."""
    return compile_spec(specs.load(path), order=order)


def emit(program: Program, target: str, command: str, *, single_file: bool = False) -> dict[str, str]:
    """The files of one target (``c`` or ``numpy``), by name; ``command`` is what regenerates them."""
    if target == "c":
        from phigen.targets.c import emitter as c

        return c.emit(program, command, single_file=single_file)
    from phigen.targets.numpy import emitter as numpy

    return numpy.emit(program, command)
