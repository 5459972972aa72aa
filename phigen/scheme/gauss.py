"""Programs of solvers that step by Gauss collocation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from phigen.errors import SpecError
from phigen.gauss.realisation import Plain, Realisation, collective, direct
from phigen.gauss.stage_map import StageMap, at_unknowns, stage_map, vector_field
from phigen.gauss.tableau import MOST_STAGES, tableau
from phigen.geometry.shapes import Affine, LiePoisson, coordinate_terms
from phigen.geometry.system import System
from phigen.scheme.adjoint import completed, gauss_adjoint, level_adjoint
from phigen.scheme.discretisation import expect_few
from phigen.scheme.forces import force_facts, forced_gradient, has_vector_force
from phigen.scheme.gauge import Gauge
from phigen.scheme.gauss_kernels import change_kernel, elapsed_kernel, field_kernel, frame_kernel, lift_kernel
from phigen.scheme.gauss_reduction import reduced_sweeps
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.kernels import observables
from phigen.scheme.lowering import operation_counts
from phigen.scheme.monitor import monitor_facts, rate_kernel
from phigen.scheme.order import Order
from phigen.scheme.program import About, Monitor, Program
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Gauss, GaussTangent, Lift, ReducedSweeps
from phigen.spec.model import Spec
from phigen.symbolic.expression import derivatives
from phigen.symbolic.symbols import STEP

if TYPE_CHECKING:
    from phigen.attitude.group import Group

#: Default for the largest number of fixed-point sweeps over the stages in a step; if more are needed, the step fails.
MAX_SWEEPS = 100

#: Hint in the error for a bracket for which phigen knows no Gauss method that is exactly a Poisson map.
TRUNCATION_HINT = (
    "use `structure: to truncation`, whose steps are not Poisson maps, or `scheme: series`, whose steps are Poisson "
    "maps"
)


def expect_offered(spec: Spec) -> None:
    """Raise `SpecError` for the options of a spec that Gauss methods do not offer."""
    diagnostics = [spec.diagnostic(path, f"scheme gauss: {message}", hint) for path, message, hint in _refused(spec)]
    if diagnostics:
        raise SpecError(diagnostics)


def _refused(spec: Spec) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """Yield each option of a spec that Gauss methods do not offer, as the path of its key, a message and a hint."""
    extras, series = spec.extras, "scheme: series computes it"
    if spec.lattice:
        yield ("lattice",), "not for lattices", "scheme: auto, splitting or series"
    if spec.noise:
        yield ("noise",), "not with noise", "scheme: series or splitting"
    if extras.modified_hamiltonian:
        yield ("modified_hamiltonian",), "the modified Hamiltonian is not computed", series
    if spec.composition not in ("auto", "none"):
        yield ("composition",), "compositions are not offered", f"order: up to {2 * MOST_STAGES}, in one step"
    if spec.solver.tolerance is not None:
        yield ("solver", "tolerance"), "the stages are solved to round-off", "remove tolerance"


def plan_gauss(spec: Spec) -> Order:
    """Return the order of the Gauss method and its number of stages. Raises `SpecError` for an order that is too
    high."""
    order = spec.wanted_order
    if order > 2 * MOST_STAGES:
        hint = f"order: {2 * MOST_STAGES}"
        raise SpecError([spec.diagnostic(("order",), f"scheme gauss: the order is at most {2 * MOST_STAGES}", hint)])
    note = f"order {order} was asked for; Gauss methods have even order" if order % 2 else ""
    return Order(order + order % 2, (order + 1) // 2, note)


def realise_gauss(spec: Spec, system: System) -> Realisation:
    """Return the variables in which Gauss steps are made: the coordinates, logarithms of coordinates, or group
    elements.

    With ``structure: exact``, a step in these variables is exactly a Poisson map. Raises `SpecError` if phigen knows no
    variables of this kind, or if a vector force acts on coordinates with group elements or logarithms.
    """
    if spec.structure == "to truncation":
        return direct(system)
    realisation = collective(system)
    if realisation is None:
        message = f"scheme gauss: no exact Poisson map is known for this bracket ({system.shape})"
        place = ("structure",) if ("structure",) in spec.locations else ("scheme",)
        raise SpecError([spec.diagnostic(place, message, _other_coordinates(system) + TRUNCATION_HINT)])
    structured_indices = [i for part in realisation.parts if not isinstance(part, Plain) for i in part.indices]
    pushed = [system.coordinates[i] for i in structured_indices if _is_pushed(system, i)]
    if pushed:
        message = f"scheme gauss: a vector force on {', '.join(pushed)} leaves the symplectic leaves"
        raise SpecError([spec.diagnostic(("forces",), message, "structure: to truncation, or scheme: series")])
    return realisation


def _other_coordinates(system: System) -> str:
    """Return the beginning of a hint that suggests other coordinates, for which an exact Poisson map may be
    known.

    For a linear or affine π, the hint suggests a basis with fewer structure constants. For a quadratic π, it suggests
    linear combinations of the coordinates. For any other π, the result is "".
    """
    if isinstance(system.shape, LiePoisson | Affine):
        return "try a basis with fewer structure constants, such as the basis of `lie_algebra: NAME`; otherwise "
    entries = [entry for row in system.poisson for entry in row]
    terms = coordinate_terms(system.coordinates, entries)
    if terms is not None and all(sum(powers) == 2 for monomials in terms for powers in monomials):
        return "use linear combinations of the coordinates with {x_i, x_j} = c x_i x_j, if there are any; otherwise "
    return ""


def _is_pushed(system: System, i: int) -> bool:
    return system.forces is not None and not system.forces.vector[i].is_zero


def build_gauss(
    system: System, gauge: Gauge, realisation: Realisation, order: Order, spec: Spec, group: Group | None = None
) -> Program:
    """Return the program of a Gauss method; the Casimirs of the ``gauge`` are subtracted from H. Raises `LimitError` if
    the program is too large.
    """
    discretised = gauge.applied(system)
    points = stage_map(discretised, realisation, gauge.pace(system))
    coefficients = Coefficients((*system.parameter_names, *gauge.symbols))
    slope, change = field_kernel(points, coefficients), change_kernel(points, coefficients)
    reduced = reduced_sweeps(points, coefficients)
    frame = frame_kernel(points, coefficients)
    tangent = _tangent(points, coefficients) if spec.extras.tangent else None
    elapsed = elapsed_kernel(points, gauge.monitor, coefficients) if gauge.monitor else None
    attitude = None
    if group is not None:
        from phigen.scheme.attitude import gauss_attitude

        attitude = gauss_attitude(system, group, points, coefficients, gauge)
    prepare = Kernel(
        "prepare",
        "compute the coefficients that depend only on parameters",
        {"params": system.parameter_names, **gauge.inputs, "h": (STEP,)},
        (Output("coef", tuple(coefficients.values)),),
    )
    plain_run = not (spec.extras.tangent or spec.extras.adjoint or gauge.monitor or group)
    lifted = _lifted(points, coefficients) if plain_run else None
    slope, change = _full(slope, coefficients), _full(change, coefficients)
    adjoint = None
    if spec.extras.adjoint:
        transposed = gauss_adjoint(slope, change, system.coordinates, coefficients)
        adjoint = completed(coefficients, transposed, prepare, None)
    step = Gauss(
        prepare,
        slope,
        change,
        tableau(order.terms),
        points.plain,
        _full(frame, coefficients) if frame else None,
        spec.solver.max_iterations if ("solver", "max_iterations") in spec.locations else MAX_SWEEPS,
        tangent,
        adjoint=adjoint,
        reduced=reduced and _with_all_coefficients(reduced, coefficients),
    )
    if lifted:
        step = replace(step, lifted=_lifted_step(step, lifted, coefficients))
    for kernel in step.kernels:
        expect_few(system, kernel, other="")
    facts = [fact for fact in _facts(system, realisation, order, gauge, step) if fact]
    return Program(
        name=system.name,
        about=About(spec.title, spec.license, spec.source_sha256, tuple(facts), operation_counts(slope.roots)),
        coordinates=system.coordinates,
        time=system.time,
        forced=system.forces is not None,
        pushed=system.pushed,
        parameters=system.parameters,
        casimirs=tuple(system.casimirs),
        order=order.order,
        step=step,
        monitor=_monitor(system, gauge, elapsed and _full(elapsed, coefficients), spec),
        observables=observables(system),
        extras=spec.extras,
        lanes=spec.solver.lanes,
        profile=spec.profile,
        observed=tuple(system.observables),
        attitude=coefficients.settled(attitude),
        truncated=not realisation.exact,
    )


def _lifted(points: StageMap, coefficients: Coefficients) -> tuple[Kernel, Kernel, Lift] | None:
    """Return the kernels of steps in moving frames: the vector field, the change of the coordinates, and the frames.

    The group element of a step then starts at a quaternion F, the frame, instead of 1; `phigen.gauss.lift` defines
    frames. Returns None if the group elements have no frames.
    """
    realisation = points.realisation.lifted
    if realisation is None:
        return None
    lifted = stage_map(points.system, realisation, points.pace)
    first, copies = min(k for places in lifted.places for k in places), []
    for group, places in zip(realisation.groups, lifted.places, strict=True):
        for u, i, j, k in group.copies:
            copies.append((places[u] - first, places[i] - first, places[j] - first, places[k] - first))
    lift = Lift(lift_kernel(lifted, coefficients), tuple(copies), len(lifted.frames))
    return field_kernel(lifted, coefficients), change_kernel(lifted, coefficients), lift


def _lifted_step(step: Gauss, lifted: tuple[Kernel, Kernel, Lift], coefficients: Coefficients) -> Gauss:
    slope, change, lift = lifted
    lift = replace(lift, functionals=_full(lift.functionals, coefficients))
    slope, change = _full(slope, coefficients), _full(change, coefficients)
    return replace(step, slope=slope, change=change, frame=None, lift=lift)


def _monitor(system: System, gauge: Gauge, elapsed: Kernel | None, spec: Spec) -> Monitor | None:
    """Return the record of a monitored solver; None if there is no monitor.

    The record has the kernel of dt/dτ, and that of the physical time t of a step.
    """
    if gauge.monitor is None:
        return None
    level = level_adjoint(system) if spec.extras.adjoint else None
    return Monitor(rate_kernel(system, gauge.monitor), elapsed, level)


def _full(kernel: Kernel, coefficients: Coefficients) -> Kernel:
    """Return the kernel with the whole table of coefficients as its input.

    The input of the given kernel is the part of the table that existed when that kernel was built.
    """
    return Kernel(
        kernel.name, kernel.purpose, {**kernel.inputs, "coef": coefficients.slots}, kernel.outputs, kernel.named
    )


def _with_all_coefficients(reduced: ReducedSweeps, coefficients: Coefficients) -> ReducedSweeps:
    return replace(reduced, slope=_full(reduced.slope, coefficients), follow=_full(reduced.follow, coefficients))


def _tangent(points: StageMap, coefficients: Coefficients) -> GaussTangent:
    """Return two Jacobians: that of the vector field at a stage, and that of the change of the coordinates.

    The derivatives are with respect to the coordinates at the start of the step, without the time, and to the unknowns
    of the stage.
    """
    names = (*points.system.coordinates, *points.unknowns)
    kernels = []
    for values, name, subject in (
        (vector_field(points, at_unknowns(points)), "slope", "the derivatives of the unknowns"),
        (points.change, "change", "the change"),
    ):
        columns = [derivatives(values, s) for s in names]
        flat = coefficients.hoist([c[i] for i in range(len(values)) for c in columns])
        inputs = {"coef": coefficients.slots, "x": points.start, "z": points.unknowns}
        purpose = f"the Jacobian of {subject} with respect to x and to the unknowns"
        kernels.append(Kernel(f"stage_{name}_jacobian", purpose, inputs, (Output("slopes", tuple(flat)),)))
    return GaussTangent(*(_full(k, coefficients) for k in kernels))


def _facts(system: System, realisation: Realisation, order: Order, gauge: Gauge, step: Gauss) -> Iterator[str]:
    """Yield the lines on a Gauss method for the header of generated files; some may be empty."""
    stages = order.terms
    yield f"scheme: Gauss collocation, {stages} stage{'s' * (stages > 1)}"
    if not realisation.exact:
        yield "structure: to truncation; a step is not a Poisson map, and conserves Casimirs of degree 1 and 2 only"
    elif realisation.groups:
        group_names = "; ".join(", ".join(system.coordinates[i] for i in g.indices) for g in realisation.groups)
        form = "form quadratic momentum maps" if len(realisation.groups) > 1 else "form a quadratic momentum map"
        yield f"structure: exact; a step is a Poisson map, since {group_names} {form}"
    elif realisation.logarithms:
        group_names = ", ".join(system.coordinates[i] for part in realisation.logarithms for i in part.indices)
        reason = f"the brackets become constant if logarithms replace {group_names}"
        yield f"structure: exact; a step is a Poisson map, since {reason}"
    else:
        yield "structure: exact; a step is a Poisson map, since the brackets are constant"
    yield from gauge.facts
    yield from monitor_facts(gauge.monitor, forced=system.forces is not None)
    vector = " + f" * has_vector_force(system)
    yield from force_facts(system, f"pi {forced_gradient(system)}{vector} at the stages")
    yield f"step: {step.kind.manner}"
    yield order.note
