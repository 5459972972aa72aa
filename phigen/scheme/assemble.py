"""From a system, its bi-realisation and an order to a program: discretisation, staging and kernels put together."""

from __future__ import annotations

from phigen.geometry.shapes import LogCanonical
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.discretisation import MOST_OPERATIONS, Discretisation, too_large
from phigen.scheme.gauge import Gauged
from phigen.scheme.gauge import kernels as gauge_kernels
from phigen.scheme.generating import STEP
from phigen.scheme.kernels import inverse, observables, path_kernels, step_kernels
from phigen.scheme.lowering import cost, operation_counts
from phigen.scheme.mean import along_mean
from phigen.scheme.modified import modified_kernel
from phigen.scheme.order import Order
from phigen.scheme.path import build_path, build_slopes
from phigen.scheme.program import Kernel, Output, Program
from phigen.scheme.tangent import curvature, tangent_kernels, tangent_path
from phigen.spec.model import NO_EXTRAS, Extras, SolverOptions

DRIVERS = {
    "explicit": "explicit",
    "newton": "implicit, Newton iteration with the analytic matrix",
    "path": "implicit in p, each path followed by its Taylor series to round-off",
}

#: Largest dimension in which paths are followed in lanes. In five and six their derivatives cost what lanes save:
#: measured, blocks take 0.6 to 1.9 times as long as single steps.
MOST_IN_LANES = 4


def build_program(
    system: System,
    realisation: BiRealisation,
    order: Order,
    gauged: Gauged,
    scheme: Discretisation,
    *,
    solver: SolverOptions | None = None,
    extras: Extras = NO_EXTRAS,
    title: str = "",
    licence: str = "0BSD",
    spec_sha256: str = "",
) -> Program:
    """The solver of a system as a program. LimitError if a kernel exceeds `MOST_OPERATIONS`."""
    solver = solver or SolverOptions()
    gauge, generating = gauged.gauge, scheme.generating
    coefficients = generating.coefficients
    path = build_path(system, coefficients) if realisation.path else None
    slopes = None
    if path:
        kernels = path_kernels(system, generating, coefficients)
        if solver.lanes and system.dimension <= MOST_IN_LANES:
            slopes = build_slopes(system, coefficients)
            kernels["curvature"] = curvature(system, generating, coefficients)
            kernels |= {"along_mean": along_mean(system.dimension), "invert": inverse(system.dimension)}
    else:
        kernels = step_kernels(system, realisation, generating, coefficients)
    if extras.tangent:
        kernels |= tangent_kernels(system, kernels, generating, coefficients)
    if extras.modified_hamiltonian:
        count, stages = extras.modified_hamiltonian, len(scheme.fractions)
        kernels["modified"] = modified_kernel(system, realisation, order, gauge, count, stages)
    varied = tangent_path(system, coefficients) if path and extras.tangent else None
    driver = "path" if path else "explicit" if "explicit" in kernels else "newton"
    kernels |= observables(system) | gauge_kernels(system, gauged)
    prepare = Kernel(
        "prepare",
        "everything that depends on parameters and step size only",
        {"params": system.parameter_names, **gauge.inputs, "h": (STEP,)},
        (Output("coef", tuple(coefficients.values)),),
    )
    main = kernels[{"path": "generate", "newton": "linearise"}.get(driver, driver)]
    for kernel in (prepare, main, *(kernels[k] for k in ("modified",) if k in kernels)):
        _within_budget(kernel, system)
    facts = [
        f"bi-realisation: {realisation.kind}, {'symmetric' if realisation.symmetric else 'not symmetric'}",
        *approximation(realisation),
        f"generating function: {'S_1' if scheme.terms == 1 else f'S_1 ... S_{scheme.terms}'} ({generating.form}"
        + (f", {generating.terms} terms)" if generating.terms else ")"),
        *gauge.facts,
        f"step: {DRIVERS[driver]}",
    ]
    return Program(
        name=system.name,
        title=title,
        coordinates=system.coordinates,
        parameters=system.parameters,
        casimirs=tuple(system.casimirs),
        order=order.order,
        driver=driver,
        coefficients=len(coefficients.values),
        kernels={"prepare": prepare, **kernels},
        path=path,
        path_slopes=slopes,
        gauge=gauge.free,
        extras=extras,
        tangent_path=varied,
        fractions=scheme.fractions,
        relative=isinstance(system.shape, LogCanonical),
        symmetric=realisation.symmetric,
        max_iterations=solver.max_iterations,
        lanes=solver.lanes,
        tolerance=1e-20 if solver.tolerance is None else float(solver.tolerance),
        license=licence,
        spec_sha256=spec_sha256,
        facts=tuple(fact for fact in (*facts, scheme.note, order.note) if fact),
        operations=operation_counts(main.roots),
    )


def approximation(realisation: BiRealisation) -> list[str]:
    """The line that labels a solver built on a truncation; none for an exact bi-realisation."""
    if realisation.exact:
        return []
    degree = realisation.degree
    how = "" if degree is None else f": alpha and beta are cut off at degree {degree} in p"
    rate = "approximately" if degree is None else f"up to O(h^{degree + 1})"
    return [f"approximate{how}; a step is guaranteed to be a Poisson map and to keep Casimirs {rate} only"]


def _within_budget(kernel: Kernel, system: System) -> None:
    operations = cost(kernel.roots)
    if operations > MOST_OPERATIONS:
        raise too_large(system, f"{kernel.name} would take {operations} operations, more than {MOST_OPERATIONS}")
