"""The modified Hamiltonian H̃ of a step, as a kernel and as a formula: up to a power of h, the step is the exact flow
of H̃.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.discretisation import formal_alpha, too_large
from phigen.scheme.gauge import Gauge
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.order import Order
from phigen.scheme.program import Modified
from phigen.series.modified import ModifiedSeries, modified_series
from phigen.symbolic.expression import Expression, number, substitute
from phigen.symbolic.symbols import STEP


def powers(order: Order, count: int, *, symmetric: bool) -> list[int]:
    """Return the powers of h with which the first ``count`` corrections occur in the modified Hamiltonian.

    The first power is the order of the method. For a symmetric method only every second power occurs.
    """
    return [order.order + (2 if symmetric else 1) * k for k in range(count)]


def corrections(
    system: System,
    realisation: BiRealisation,
    order: Order,
    count: int,
    gauge: Gauge | None = None,
    values: Mapping[str, Fraction] | None = None,
) -> ModifiedSeries:
    """Return the terms H_k of the modified Hamiltonian Σ h^k H_k, including the first ``count`` corrections.

    First the Casimirs of the ``gauge`` are subtracted from H. The ring of the terms also contains the step size.
    Numbers in ``values`` replace parameters, which shortens formulas. Raises `LimitError` if a correction is too large.
    """
    gauge = gauge or Gauge()
    gauged = gauge.applied(system)
    power = powers(order, count, symmetric=realisation.symmetric)[-1] if count else 0
    values = values or {}
    try:
        hamiltonian, *alpha = substitute(
            [gauged.hamiltonian, *formal_alpha(gauged, realisation, power + 1)],
            {name: number(value) for name, value in values.items()},
        )
        return modified_series(
            hamiltonian,
            alpha,
            system.coordinates,
            [*(p for p in system.parameter_names if p not in values), *gauge.symbols, STEP],
            order.terms,
            power,
            symmetric=realisation.symmetric,
            times=system.times,
        )
    except (OverflowError, ValueError) as error:
        raise too_large(system, f"the modified Hamiltonian with {count} corrections is too large: {error}") from None


def modified_hamiltonian(
    system: System, realisation: BiRealisation, order: Order, count: int, gauge: Gauge | None = None
) -> Expression:
    """Return the modified Hamiltonian H̃_h with ``count`` corrections as one expression.

    Its symbols are the coordinates, the parameters, the step size, and the multiples of the gauge.
    """
    series = corrections(system, realisation, order, count, gauge)
    h = series.tower.variable(STEP)
    summed = series.tower.expression(series.tower.combine([t * h**j for j, t in enumerate(series.terms)]))
    gauge = gauge or Gauge()
    subtracted = gauge.timed(system.hamiltonian) - gauge.applied(system).hamiltonian
    return summed + subtracted


def expect_modified(system: System, realisation: BiRealisation, stages: int) -> None:
    """Raise `SpecError` for compositions, forces and approximate bi-realisations, for which no modified Hamiltonian is
    computed."""
    if stages > 1 or not realisation.exact or system.forces:
        obstacle = "a composition" if stages > 1 else "a system with forces"
        obstacle = obstacle if realisation.exact else "an approximate bi-realisation"
        place = system.locations.get(("modified_hamiltonian",))
        raise SpecError([Diagnostic(f"modified_hamiltonian is not offered for {obstacle}", place)])


def modified_of(
    system: System, realisation: BiRealisation, order: Order, gauge: Gauge, count: int, stages: int
) -> Modified:
    """Return the modified Hamiltonian as a kernel, with the lowest power of h that it omits. Raises the errors of
    `expect_modified`.
    """
    expect_modified(system, realisation, stages)
    value = modified_hamiltonian(system, realisation, order, count, gauge)
    time = {"t": system.times} if system.time else {}
    kernel = Kernel(
        "modified",
        f"the modified Hamiltonian with {count} correction{'s' * (count != 1)}: up to a power of h, a step is its flow",
        {"params": system.parameter_names, **gauge.inputs, "h": (STEP,), **time, "x": system.coordinates},
        (Output("energy", (value,)),),
    )
    return Modified(kernel, order.order + (2 if realisation.symmetric else 1) * count)
