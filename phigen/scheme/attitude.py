"""Kernels of the attitude of a body.

The kernels compute the group element by which a step rotates the body: from the covector p = ∇S_h(y) of the step, or
from the flows of a splitting. If the gauge subtracts Casimirs from H, a further kernel computes the rotation that these
Casimirs contribute.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from phigen.attitude.elements import element
from phigen.attitude.flow_elements import Turning, factor_elements, joined, turning_of, turnings
from phigen.attitude.group import Group, refused
from phigen.attitude.matrices import cayley as cayley_transform
from phigen.attitude.matrices import exponential, size_of
from phigen.gauss.rotation import group_element
from phigen.gauss.stage_map import StageMap
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.gathering import staged
from phigen.scheme.gauge import Gauge
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.noise import driving_times
from phigen.scheme.program import Attitude
from phigen.scheme.staging import Coefficients
from phigen.splitting.flow import Flow
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import Expression, gradient, symbol, total
from phigen.symbolic.symbols import Symbol

#: Comment in generated code on the last entry of some outputs. The other entries are the components p_i of a matrix P =
#: Σ p_i E_i with basis matrices E_i. The last entry is a bound for the square of the norm of P.
SIZE_OF_COVECTOR = "a bound for the square of its size"

#: Kinds of bi-realisations whose steps are the action of a known group element: exp(p) or the Cayley transform of p.
KINDS = ("exponential", "karasev", "cayley")


def expect_element(system: System, realisation: BiRealisation) -> None:
    """Raise `SpecError` if phigen does not know the group element of the steps of this bi-realisation."""
    if realisation.kind not in KINDS or not realisation.exact:
        message = f"reconstruct: the bi-realisation {realisation.kind} has no group element that phigen knows"
        raise refused(system, message, "birealisation: exponential, or cayley")


def stage_attitude(
    system: System, group: Group, realisation: BiRealisation, generating: GeneratingFunction, gauge: Gauge
) -> Attitude:
    """Return the kernels for the attitude in an implicit step.

    The coefficients of these kernels are added to ``generating.coefficients``.
    """
    coefficients, cayley = generating.coefficients, realisation.kind == "cayley"
    p, slope = (
        list(generating.turning),
        "grad S_h(y), without the forces," if generating.free else "the momenta p = grad S_h(y)",
    )
    values = coefficients.hoist(_element_less_one(group, p, cayley))
    purpose = (
        f"the attitude increment of a stage with {slope}: a {'matrix' if group.matrices else 'quaternion'} minus 1"
    )
    purpose += ", and its translation" * bool(group.translation)
    if group.matrices and not cayley:
        purpose = f"{slope.rstrip(',')}, and {SIZE_OF_COVECTOR}"
    inputs = {"coef": coefficients.slots, "y": system.coordinates}
    turn_kernel = Kernel("turn", purpose, inputs, (Output("turn", tuple(values)),))
    path_attitude = _path_element_kernel(group, system) if realisation.path and not generating.free else None
    rate = rate_kernel(system, group, gauge)
    needs_algebra = group.matrices and (rate or not cayley)
    return Attitude(
        group, cayley, turn_kernel, path_attitude, rate=rate, exponential=_exponential(group) if needs_algebra else None
    )


def gauss_attitude(
    system: System, group: Group, points: StageMap, coefficients: Coefficients, gauge: Gauge
) -> Attitude:
    """Return the kernels for the attitude in a Gauss step.

    The coefficients of these kernels are added to ``coefficients``. Raises `SpecError` if phigen knows no group element
    of the step.
    """
    series = "scheme: series or splitting"
    if not points.realisation.exact:
        raise refused(
            system,
            "`reconstruct` needs the rotation that a step makes, but steps with `structure: to truncation` have none",
            f"structure: exact, or {series}",
        )
    if group.matrices:
        hint = f"{series}; on so(3) and se(3) also quaternion"
        raise refused(system, "reconstruct: Gauss steps offer a quaternion, not a matrix", hint)
    if system.forces and any(not z.is_zero for z in system.forces.covector):
        message = "reconstruct: with covector forces, the group element of a Gauss step does not rotate the body"
        raise refused(system, message, series)
    element_less_one = group_element(points, group)
    if element_less_one is None:
        raise refused(system, "reconstruct: the group element of this algebra is not a quaternion", series)
    purpose = "the increment of a step, a quaternion minus 1" + ", and its translation" * bool(group.translation)
    inputs = {"coef": coefficients.slots, "z": points.unknowns}
    turn_kernel = Kernel("turn", purpose, inputs, (Output("turn", tuple(coefficients.hoist(element_less_one))),))
    return Attitude(group, False, turn_kernel, rate=rate_kernel(system, group, gauge))


def _path_element_kernel(group: Group, system: System) -> Kernel:
    """Return the kernel of the group element of a step along a path, as a function of the covector p."""
    p = [symbol(c) for c in system.coordinates]  # the inputs p_i get the names of the coordinates x_i
    inputs = {"p": system.coordinates}
    return Kernel(
        "along",
        "the group element of the covector p, minus 1",
        inputs,
        (Output("turn", tuple(_element_less_one(group, p, False))),),
    )


def _element_less_one(group: Group, p: list[Expression], cayley: bool) -> list[Expression]:
    """Return the outputs of a kernel for the group element of the covector p.

    The group element is the exponential of p, or the Cayley transform of p if ``cayley``. The outputs are its entries,
    minus those of the identity. In a group of matrices, another kernel computes the exponential. The outputs are then
    the arguments of the other kernel: the components of p, and a bound for the squared norm of the matrix of p.
    """
    if not group.matrices:
        return [*element([p[i] for i in group.rotation], [p[i] for i in group.translation], cayley=cayley)]
    return cayley_transform(group, p) if cayley else [*p, size_of(group, p)]


def _exponential(group: Group) -> Kernel:
    names = tuple(f"p{i}" for i in range(1, len(group.matrices) + 1))
    values = exponential(group, [symbol(n) for n in names])
    return Kernel(
        "exponential",
        "the matrix exp(P) - 1 for a small matrix P with components p",
        {"p": names},
        (Output("element", tuple(values)),),
    )


def flow_attitude(
    system: System,
    group: Group,
    flows: Sequence[Flow],
    increments: Sequence[Sequence[Expression]],
    gauge: Gauge,
    coefficients: Coefficients,
    time_of: Callable[[Flow], Expression] | None = None,
) -> Attitude:
    """Return the kernels for the attitude in a splitting.

    The result has one kernel for each flow, which computes the increments of the flow and the group element of the step
    up to the end of this flow. ``increments`` has the increments of all flows: first those of noise sources, then those
    of ``flows``. With a monitor, ``time_of`` returns the physical time of a flow. The coefficients of the kernels are
    added to ``coefficients``. Raises the errors of `turnings`.
    """
    flow_rotations = turnings(system, group, flows, put_back=uniform(system))
    noise_rotations = [turning_of(system, group, s.hamiltonian, s.name, put_back=False) for s in system.noise]
    times = [time_of(flow) if time_of else symbol(TIME) for flow in flows]
    names = [f"the noise {s.name}" for s in system.noise] + [f"{flow.letter}_{k}" for k, flow in enumerate(flows, 1)]
    kernels = []
    timed_increments = zip(
        increments, [*noise_rotations, *flow_rotations], [*driving_times(system), *times], strict=True
    )
    for k, (increment, turning, time) in enumerate(timed_increments, 1):
        values = staged([*increment, *_element_after_flow(system, group, turning, time)], coefficients)
        parts = tuple(values[: len(increment)]), tuple(values[len(increment) :])
        inputs = {"coef": coefficients.slots, "state": system.coordinates, "element": _carrier(group)}
        purpose = (
            f"the flow of {names[k - 1]}, and the group element from the start of the step to the end of this flow"
        )
        kernels.append(Kernel(f"turn{k}", purpose, inputs, (Output("increment", parts[0]), Output("turned", parts[1]))))
    rate = rate_kernel(system, group, gauge, [turning.left for turning in flow_rotations])
    exponential_kernel = _exponential(group) if rate and group.matrices else None
    return Attitude(group, False, turns=tuple(kernels), rate=rate, exponential=exponential_kernel)


def _carrier(group: Group) -> tuple[Symbol, ...]:
    """Return the symbols for the entries of g − 1, where g is the group element of all earlier flows of the step."""
    return tuple(Symbol("element", i) for i in range(group.size))


def _element_after_flow(system: System, group: Group, turning: Turning, time: Expression) -> list[Expression]:
    """Return g − 1, where g is the group element of a step after one more flow.

    g is the product of two elements: the element before this flow, whose entries are symbols, and the element of the
    flow over ``time``.
    """
    element_before, factors = [symbol(s) for s in _carrier(group)], factor_elements(system, group, turning, time)
    return joined(group, [element_before, joined(group, factors)]) if factors else element_before


def uniform(system: System) -> bool:
    """Whether Casimirs in H rotate the body at a constant angular velocity, in the frame with constant momentum.

    The velocity varies if there are forces or a monitor, or if H depends on the time.
    """
    monitored = system.spec is not None and system.spec.monitor is not None
    return not (system.forces or system.time or monitored)


def rate_kernel(
    system: System, group: Group, gauge: Gauge, further_gradients: Sequence[Expression] = ()
) -> Kernel | None:
    """Return the kernel of the gradient of the function that is subtracted from H; None if nothing is
    subtracted.

    This function is the sum of the Casimirs of the gauge, multiplied by their λ, and of the functions with the
    gradients ``further_gradients``. Raises `SpecError` if a function is subtracted although there is a monitor, or
    although there are forces: then the rotation by the Casimirs is not uniform.
    """
    subtracted = [e for e in further_gradients if not e.is_zero]
    subtracted += [symbol(s) * system.casimirs[c] for s, c in zip(gauge.multiples, gauge.free, strict=True)]
    subtracted += [value * system.casimirs[c] for c, value in gauge.fixed.items()]
    if not subtracted:
        return None
    obstacles = {"a monitor": gauge.monitor, "forces": system.forces}
    for condition, applies in obstacles.items():
        if applies:
            message = f"reconstruct: with {condition} no Casimir is subtracted from H, since it would rotate the body"
            raise refused(system, message, "gauge: none")
    slope = gradient(total(subtracted), system.coordinates)
    turning = (*group.rotation, *group.translation)
    values = [*slope, size_of(group, slope)] if group.matrices else [slope[i] for i in turning]
    inputs = {"params": system.parameter_names, **gauge.inputs, "x": system.coordinates}
    purpose = "the gradient of the Casimirs subtracted from H" + f", and {SIZE_OF_COVECTOR}" * bool(group.matrices)
    return Kernel("rate", purpose, inputs, (Output("rate", tuple(values)),))
