"""The kernels of attitudes: the element of each stage from the covector p = ∇S_h(y), and what the gauge turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from phigen.attitude.elements import element
from phigen.attitude.group import Group, refused
from phigen.attitude.parts import factor_elements, joined, turning_of, turnings
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.gauge import Gauge
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.noise import driving_times
from phigen.scheme.program import Attitude
from phigen.scheme.staging import Coefficients
from phigen.splitting.flow import Flow
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import ZERO, Expression, gradient, symbol, total

#: Bi-realisations whose group element is known: the exponential, and the Cayley transform.
KINDS = ("exponential", "karasev", "cayley")


def expect_element(system: System, realisation: BiRealisation) -> None:
    """`SpecError` for a bi-realisation whose group element phigen does not know."""
    if realisation.kind not in KINDS or not realisation.exact:
        message = f"reconstruct: the bi-realisation {realisation.kind} has no group element that phigen knows"
        raise refused(system, message, "exponential and cayley have one")


def stage_attitude(
    system: System, group: Group, realisation: BiRealisation, generating: GeneratingFunction, gauge: Gauge
) -> Attitude:
    """The attitude of an implicit step; the coefficients of ``generating`` grow by what it needs."""
    coefficients, cayley = generating.coefficients, realisation.kind == "cayley"
    p, slope = list(generating.turning), "grad S_h(y), without the forces," if generating.free else "p = grad S_h(y)"
    values = coefficients.hoist(group.generator(p) if group.matrices else _element(group, p, cayley))
    about = f"the matrix of {slope}" if group.matrices else f"what {slope} turns by, a quaternion less 1"
    about += ", and what it translates by" * bool(group.translation)
    turn = _kernel("turn", about, coefficients, system, values)
    along = _along(group, system) if realisation.path and not generating.free else None
    return Attitude(group, cayley, turn, along, rate=rate_kernel(system, group, gauge))


def _along(group: Group, system: System) -> Kernel:
    """The element of a path, whose p is known where y is not."""
    p = [symbol(c) for c in system.coordinates]  # under these names, as nothing here depends on x
    values = group.generator(p) if group.matrices else list(_element(group, p, False))
    return Kernel("along", "what p turns by", {"p": system.coordinates}, (Output("turn", tuple(values)),))


def _kernel(name: str, purpose: str, coefficients: Coefficients, system: System, values: list[Expression]) -> Kernel:
    inputs = {"coef": coefficients.slots, "y": system.coordinates}
    return Kernel(name, purpose, inputs, (Output("turn", tuple(values)),))


def _element(group: Group, p: list[Expression], cayley: bool) -> tuple[Expression, ...]:
    return element([p[i] for i in group.rotation], [p[i] for i in group.translation], cayley=cayley)


def flow_attitude(
    system: System,
    group: Group,
    flows: Sequence[Flow],
    gauge: Gauge,
    coefficients: Coefficients,
    time_of: Callable[[Flow], Expression] | None = None,
) -> Attitude:
    """The attitude of a splitting; the coefficients grow by what it needs. `SpecError` as `turnings`.

    The sources of noise come before the ``flows``. With a monitor, ``time_of`` tells the time that a flow takes.
    """
    turned = turnings(system, group, flows, put_back=uniform(system))
    shaken = [turning_of(system, group, s.hamiltonian, s.name, put_back=False) for s in system.noise]
    times = [time_of(flow) if time_of else symbol(TIME) for flow in flows]
    named = [f"the noise {s.name}" for s in system.noise] + [f"{flow.letter}_{k}" for k, flow in enumerate(flows, 1)]
    found = []
    for k, (turning, time) in enumerate(zip([*shaken, *turned], [*driving_times(system), *times], strict=True), 1):
        factors = factor_elements(system, group, turning, time)
        values = coefficients.hoist(joined(group, factors) if factors else [ZERO] * group.size)
        inputs = {"coef": coefficients.slots, "state": system.coordinates}
        found.append(Kernel(f"turn{k}", f"what {named[k - 1]} turns by", inputs, (Output("turn", tuple(values)),)))
    left = [turning.left for turning in turned]
    return Attitude(group, False, turns=tuple(found), rate=rate_kernel(system, group, gauge, left))


def uniform(system: System) -> bool:
    """Whether Casimirs turn a body uniformly, in the frame where momenta are constant."""
    monitored = system.spec is not None and system.spec.monitor is not None
    return not (system.forces or system.time or monitored)


def rate_kernel(system: System, group: Group, gauge: Gauge, more: Sequence[Expression] = ()) -> Kernel | None:
    """The gradient of the Casimirs that the gauge takes from H, and of ``more``; None without any.

    With a monitor or forces there must be none: what they turn would not be a uniform motion.
    """
    taken = [e for e in more if not e.is_zero]
    taken += [symbol(s) * system.casimirs[c] for s, c in zip(gauge.multiples, gauge.free, strict=True)]
    taken += [value * system.casimirs[c] for c, value in gauge.fixed.items()]
    if not taken:
        return None
    others = {"a monitor": gauge.monitor, "forces": system.forces}
    for what, there in others.items():
        if there:
            message = f"reconstruct: with {what} no multiple of a Casimir is taken from H, since it turns the body"
            raise refused(system, message, "gauge: none")
    slope = gradient(total(taken), system.coordinates)
    turning = (*group.rotation, *group.translation)
    values = group.generator(slope) if group.matrices else [slope[i] for i in turning]
    inputs = {"params": system.parameter_names, **gauge.inputs, "x": system.coordinates}
    purpose = "the gradient of the Casimirs that are taken from H"
    return Kernel("rate", purpose, inputs, (Output("rate", tuple(values)),))
