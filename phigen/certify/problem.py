"""Conversion of a compilation to the input of the search for a certificate. Kinds of solvers for which phigen has no
certificates are refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from phigen.certify.prove import StepProblem
from phigen.errors import SpecError
from phigen.symbolic.elliptic import ELLIPTIC
from phigen.symbolic.expression import topological
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.remainders import QUOTIENTS, REMAINDERS
from phigen.symbolic.universal import ANOMALY
from phigen.targets.c.gauss import with_frames
from phigen.targets.c.language import members

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.scheme.program import Program
    from phigen.spec.model import Spec

#: Functions that certificates do not cover. The key is the name of the function. The value is for error messages: the
#: motion whose exact flow calls the function.
_FLOWS = {
    **dict.fromkeys(ELLIPTIC, "a free rigid body"),
    **dict.fromkeys((*REMAINDERS, *QUOTIENTS), "linear equations with conserved coefficients"),
    ANOMALY: "a Kepler motion",
}

#: Motions that phigen divides into simpler parts if a spec names a ``composition``. Certificates cover the flows of
#: these parts.
_SPLIT = ("a free rigid body", "a Kepler motion")


def problem_of(
    compilation: Compilation,
    text: str,
    step: float,
    parameters: Mapping[str, float],
    start: Sequence[float],
    domain: Sequence[Sequence[float]],
    time: Sequence[float],
    ulps: float,
    tolerance: float,
) -> StepProblem:
    """Return the problem to be certified for the C ``text`` of a solver.

    The solver subtracts multiples of Casimirs (the gauge) from H. The problem contains the multiples that the solver
    chooses for the state ``start``. Raises `SpecError` for solvers that certificates do not cover.
    """
    program, spec = compilation.program, compilation.spec
    _expect_covered(program, spec)
    return StepProblem(
        name=program.name,
        text=text,
        step=step,
        parameters={p.name: float(parameters[p.name]) for p in program.parameters},
        members={member: parameter for parameter, member in members(program).items()},
        gauge=_gauge(compilation, parameters, start),
        domain=domain,
        time=time,
        coordinates=spec.coordinates,
        ulps=ulps,
        within=tolerance,
        timed=bool(program.time),
    )


def _expect_covered(program: Program, spec: Spec) -> None:
    """Raise `SpecError` for solvers that certificates do not cover. These are solvers with noise or in single
    precision, some Gauss steps, and splittings whose flows call one of the functions in `_FLOWS`.
    """
    refusals = list[tuple[tuple[str, ...], str, str]]()
    if program.noise:
        refusals.append((("noise",), "certificates do not cover noise", "certify a spec without noise"))
    if program.single:
        refusals.append((("solver",), "certificates cover only C in double precision", "leave out real: float"))
    if with_frames(program) is not program:
        message = f"certificates do not cover Gauss steps of order {program.order} with `profile: fast`"
        refusals.append((("order",), message, "set `order: 12` or `profile: small`"))
    flows = {_FLOWS[e.op] for kernel in program.kernels for e in topological(kernel.roots) if e.op in _FLOWS}
    for flow in sorted(flows):
        hint = "scheme: series, or composition: suzuki, which splits the motion" if flow in _SPLIT else "scheme: series"
        refusals.append((("scheme",), f"certificates do not cover the exact flow of {flow}", hint))
    if refusals:
        raise SpecError([spec.diagnostic(path, message, hint) for path, message, hint in refusals])


def _gauge(compilation: Compilation, parameters: Mapping[str, float], start: Sequence[float]) -> list[float]:
    """Return the gauge that the solver chooses at the state ``start``, up to rounding.

    The gauge consists of the multiples of Casimirs that are subtracted from H. With a monitor, the result is the energy
    level instead: −H at the state ``start``.
    """
    program = compilation.program
    values = {**parameters, **dict(zip(compilation.spec.coordinates, start, strict=True))}
    if program.monitor and program.held:
        (energy,) = evaluate([compilation.system.hamiltonian], values)
        return [-energy]
    if not program.gauge:
        return []
    products = evaluate(list(program.gauge.products.roots), values)
    pairs = zip(products[1::2], products[2::2], strict=True)
    return [product / square if square else 0.0 for product, square in pairs]
