"""Assembly of a program whose step has a generating function, from a system, its bi-realisation and an order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from phigen.geometry.shapes import LogCanonical
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.adjoint import adjoint_path, completed, explicit_adjoint, level_adjoint, newton_adjoint
from phigen.scheme.discretisation import Discretisation, expect_few
from phigen.scheme.forces import force_facts, forced_gradient, has_vector_force
from phigen.scheme.gauge import Gauge, Gauged, free_gauge
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.kernels import (
    explicit_kernel,
    full,
    generate_kernel,
    inverse,
    is_centred,
    linearise_kernel,
    newton_solvers,
    noise_fields,
    observables,
    path_elimination,
    step_inputs,
    transposed_elimination_kernel,
)
from phigen.scheme.lowering import operation_counts
from phigen.scheme.mean import along_mean
from phigen.scheme.modified import modified_of
from phigen.scheme.monitor import elapsed_kernel, monitor_facts, rate_kernel
from phigen.scheme.noise import expect_no_adjoint, noise_facts
from phigen.scheme.order import Order
from phigen.scheme.path import build_path, build_slopes, used_by_path
from phigen.scheme.program import About, Monitor, Noise, Program
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Explicit, InnerSolve, Newton, Path, PathLanes, PathTangent, Step
from phigen.scheme.tangent import curvature, explicit_jacobian, tangent_path
from phigen.spec.model import Extras, SolverOptions, Spec
from phigen.symbolic.symbols import STEP

if TYPE_CHECKING:
    from phigen.attitude.group import Group

#: Largest dimension in which several steps along paths are solved together in SIMD lanes. In dimensions five and six
#: these steps took 0.6 to 1.9 times as long as single steps, because of the cost of the derivatives.
MAX_PATH_LANE_DIMENSION = 4


def build_program(
    system: System,
    realisation: BiRealisation,
    order: Order,
    gauged: Gauged,
    scheme: Discretisation,
    spec: Spec,
    *,
    group: Group | None = None,
) -> Program:
    """Return the program of a solver whose step has a generating function. Raises `LimitError` if a kernel is too
    large."""
    extras, solver = spec.extras, spec.solver
    expect_no_adjoint(system, extras.adjoint)
    gauge, attitude = gauged.gauge, None
    if group:
        from phigen.scheme.attitude import expect_element, stage_attitude

        expect_element(system, realisation)
        attitude = stage_attitude(system, group, realisation, scheme.generating, gauge)
    lanes = solver.lanes and extras.offers("lanes", spec.profile)
    elapsed = elapsed_kernel(system, scheme.generating)
    gauged_system = replace(system, forces=gauged.system.forces)  # a monitor g multiplies the forces
    step = _step(gauged_system, realisation, scheme.generating, gauge, solver, extras, lanes=lanes)
    attitude = scheme.generating.coefficients.settled(attitude)
    level = level_adjoint(system) if gauge.monitor and extras.adjoint else None
    modified, count = None, extras.modified_hamiltonian
    if count:
        modified = modified_of(system, realisation, order, gauge, count, len(scheme.fractions))
    for kernel in (step.prepare, step.main, *([modified.kernel] if modified else [])):
        expect_few(system, kernel)
    return Program(
        name=system.name,
        about=About(
            spec.title,
            spec.license,
            spec.source_sha256,
            tuple(fact for fact in _facts(system, realisation, scheme, gauge, step, order) if fact),
            operation_counts(step.main.roots),
        ),
        coordinates=system.coordinates,
        time=system.time,
        forced=system.forces is not None,
        pushed=system.pushed,
        noise=Noise(tuple(s.name for s in system.noise), 1, noise_fields(system)) if system.noise else None,
        parameters=system.parameters,
        casimirs=tuple(system.casimirs),
        order=order.order,
        step=step,
        observables=observables(system),
        observed=tuple(system.observables),
        fractions=scheme.fractions,
        gauge=free_gauge(system, gauged),
        monitor=Monitor(rate_kernel(system, gauge.monitor), elapsed, level) if gauge.monitor else None,
        modified=modified,
        attitude=attitude,
        extras=extras,
        lanes=solver.lanes,
        profile=spec.profile,
    )


def _step(
    system: System,
    realisation: BiRealisation,
    generating: GeneratingFunction,
    gauge: Gauge,
    solver: SolverOptions,
    extras: Extras,
    *,
    lanes: bool,
) -> Newton | Explicit | Path:
    inner = InnerSolve(
        solver.max_iterations,
        1e-20 if solver.tolerance is None else float(solver.tolerance),
        isinstance(system.shape, LogCanonical),
    )
    if realisation.path:
        return _path(system, generating, gauge, inner, extras, lanes=lanes)
    coefficients = generating.coefficients
    # A monitored step is never explicit: its physical time is a function of y, the solution of the implicit equation.
    increment = None if gauge.monitor else explicit_kernel(system, realisation, generating, coefficients)
    if increment is None:
        linearise = linearise_kernel(system, realisation, generating, coefficients)
        centred = is_centred(system, realisation)
        solvers = newton_solvers(linearise, centred=centred)
        refresh, prepare = coefficients.refresh(**step_inputs(system)), _prepare(system, gauge, coefficients)
        newton = Newton(
            prepare, linearise, inner, solvers.eliminate, solvers.invert, solvers.factors, centred, refresh=refresh
        )
        if extras.adjoint:
            adjoint = completed(coefficients, [newton_adjoint(linearise, coefficients)], prepare, refresh)
            eliminate = transposed_elimination_kernel(linearise) if solvers.eliminate else None
            newton = replace(newton, adjoint=adjoint, eliminate_transposed=eliminate)
        return coefficients.settled(newton)
    tangent = explicit_jacobian(increment, system.coordinates, coefficients) if extras.tangent else None
    refresh, prepare = coefficients.refresh(**step_inputs(system)), _prepare(system, gauge, coefficients)
    explicit = Explicit(prepare, increment, tangent, refresh=refresh)
    if extras.adjoint:
        transposed = explicit_adjoint(increment, coefficients)
        explicit = replace(explicit, adjoint=completed(coefficients, [transposed], prepare, refresh))
    return coefficients.settled(explicit)


def _path(
    system: System, generating: GeneratingFunction, gauge: Gauge, inner: InnerSolve, extras: Extras, *, lanes: bool
) -> Path:
    n, coefficients = system.dimension, generating.coefficients
    recurrences = build_path(system, coefficients)
    generate = generate_kernel(system, generating, coefficients)
    path_lanes, tangent, adjoint = None, None, None
    if extras.adjoint:
        slopes = build_slopes(system, coefficients, used_by_path(system, coefficients))
    elif lanes and n <= MAX_PATH_LANE_DIMENSION:
        slopes = build_slopes(system, coefficients)
    if lanes and n <= MAX_PATH_LANE_DIMENSION:
        path_lanes = PathLanes(slopes, curvature(system, generating, coefficients), along_mean(n), inverse(full(n)))
    if extras.tangent or extras.adjoint:
        kernel = path_lanes.curvature if path_lanes else curvature(system, generating, coefficients)
    if extras.tangent:
        tangent = PathTangent(tangent_path(system, coefficients), kernel)
    refresh, prepare = coefficients.refresh(**step_inputs(system)), _prepare(system, gauge, coefficients)
    if extras.adjoint:
        adjoint = completed(coefficients, [], prepare, refresh, adjoint_path(system, coefficients, kernel, slopes))
    solver = path_elimination(n)
    path = Path(prepare, recurrences, generate, inner, solver, path_lanes, tangent, refresh=refresh, adjoint=adjoint)
    return coefficients.settled(path)


def _prepare(system: System, gauge: Gauge, coefficients: Coefficients) -> Kernel:
    """Return the kernel ``prepare``, which computes the coefficients.

    Coefficients are values that depend only on parameters, gauge and step size. The kernel must be built last, when the
    table of coefficients is complete.
    """
    held = ", the energy level" if gauge.monitor else ", gauge" if gauge.inputs else ""
    return Kernel(
        "prepare",
        f"compute the coefficients that depend only on parameters{held} and step size",
        {"params": system.parameter_names, **gauge.inputs, "h": (STEP,)},
        (Output("coef", tuple(coefficients.values)),),
    )


def _facts(
    system: System, realisation: BiRealisation, scheme: Discretisation, gauge: Gauge, step: Step, order: Order
) -> Iterator[str]:
    """Yield the lines on the method for the header of generated files; some may be empty."""
    generating = scheme.generating
    series = "h S_1" if scheme.terms == 1 else f"h S_1 + ... + h^{scheme.terms} S_{scheme.terms}"
    terms = f", {generating.terms} term{'s' * (generating.terms > 1)}" if generating.terms else ""
    symmetry = "symmetric" if realisation.symmetric else "not symmetric"
    yield f"bi-realisation (alpha, beta): {realisation.kind}, {symmetry}; steps from alpha(y, p) to beta(y, p)"
    yield from approximation(realisation)
    momenta = "" if system.forces else "p = grad S_h(y), "
    yield f"generating function: {momenta}S_h = {series} ({generating.form}{terms})"
    yield from monitor_facts(gauge.monitor, forced=system.forces is not None)
    yield from gauge.facts
    g = "g " * bool(gauge.monitor)
    halves = f", impulses h {g}f/2 before and after" if has_vector_force(system) else ""
    yield from force_facts(system, f"p = h {g}{forced_gradient(system)}{halves}")
    yield from noise_facts(system, weak=1)
    yield f"step: {step.kind.manner}"
    yield scheme.note
    yield order.note


def approximation(realisation: BiRealisation) -> list[str]:
    """Return the header line that says how a bi-realisation is truncated; [] if it is exact."""
    if realisation.exact:
        return []
    degree = realisation.degree
    degree_note = "" if degree is None else f": alpha and beta are cut off at degree {degree} in p"
    rate = "approximately" if degree is None else f"up to O(h^{degree + 1})"
    return [f"approximate{degree_note}; a step is guaranteed to be a Poisson map and to keep Casimirs {rate} only"]
