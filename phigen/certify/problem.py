"""Construction of the `StepProblem` of a compilation and its C; refusals of what certificates do not cover."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from phigen.certify.prove import StepProblem
from phigen.errors import SpecError
from phigen.symbolic.numeric import evaluate

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.scheme.program import Program
    from phigen.spec.model import Spec


def problem_of(
    compilation: Compilation,
    text: str,
    step: float,
    parameters: Mapping[str, float],
    start: Sequence[float],
    domain: Sequence[Sequence[float]],
    time: Sequence[float],
    ulps: float,
    within: float,
) -> StepProblem:
    """Return the problem of a solver, with the gauge of the trajectory from ``start``.

    Raises `SpecError` for what certificates do not cover.
    """
    program, spec = compilation.program, compilation.spec
    _expect_covered(program, spec)
    return StepProblem(
        name=program.name,
        text=text,
        step=step,
        parameters={p.name: float(parameters[p.name]) for p in program.parameters},
        gauge=_gauge(compilation, parameters, start),
        domain=domain,
        time=time,
        coordinates=spec.coordinates,
        ulps=ulps,
        within=within,
        timed=bool(program.time),
    )


def _expect_covered(program: Program, spec: Spec) -> None:
    """Refuse noise and single precision."""
    refusals = list[tuple[tuple[str, ...], str, str]]()
    if program.noise:
        refusals.append((("noise",), "certificates do not cover noise", "a spec without it"))
    if program.single:
        refusals.append((("solver",), "certificates are of C in double precision", "leave out real: float"))
    if refusals:
        raise SpecError([spec.diagnostic(path, message, hint) for path, message, hint in refusals])


def _gauge(compilation: Compilation, parameters: Mapping[str, float], start: Sequence[float]) -> list[float]:
    """Return an approximation of the gauge for the trajectory from a state: multiples of Casimirs, or e."""
    program = compilation.program
    values = {**parameters, **dict(zip(compilation.spec.coordinates, start, strict=True))}
    if program.monitor and program.held:
        (energy,) = evaluate([compilation.system.hamiltonian], values)
        return [-energy]
    if not program.gauge:
        return []
    products = evaluate(list(program.gauge.products.roots), values)
    pairs = zip(products[1::2], products[2::2], strict=True)
    return [along / square if square else 0.0 for along, square in pairs]
