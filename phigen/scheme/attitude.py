"""The kernels of attitudes: the element of each stage from the covector p = ∇S_h(y), and what the gauge turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from phigen.attitude.elements import element
from phigen.attitude.group import Group, refused
from phigen.attitude.matrices import cayley as cayley_transform
from phigen.attitude.matrices import exponential, size_of
from phigen.attitude.parts import Turning, factor_elements, joined, turning_of, turnings
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

#: What is said of the last number of a covector of a matrix.
SIZE_OF_COVECTOR = "a bound for the square of its size"

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
    values = coefficients.hoist(_turned(group, p, cayley))
    about = f"what {slope} turns by, a {'matrix' if group.matrices else 'quaternion'} less 1"
    about += ", and what it translates by" * bool(group.translation)
    if group.matrices and not cayley:
        about = f"{slope.rstrip(',')}, and {SIZE_OF_COVECTOR}"
    inputs = {"coef": coefficients.slots, "y": system.coordinates}
    turn = Kernel("turn", about, inputs, (Output("turn", tuple(values)),))
    along = _along(group, system) if realisation.path and not generating.free else None
    rate = rate_kernel(system, group, gauge)
    needed = group.matrices and (rate or not cayley)
    return Attitude(group, cayley, turn, along, rate=rate, exponential=_exponential(group) if needed else None)


def _along(group: Group, system: System) -> Kernel:
    """The element of a path, whose p is known where y is not."""
    p = [symbol(c) for c in system.coordinates]  # under these names, as nothing here depends on x
    inputs = {"p": system.coordinates}
    return Kernel("along", "what p turns by", inputs, (Output("turn", tuple(_turned(group, p, False))),))


def _turned(group: Group, p: list[Expression], cayley: bool) -> list[Expression]:
    """The element of p less 1; for exponentials of matrices p itself, and a bound for the square of its size."""
    if not group.matrices:
        return [*element([p[i] for i in group.rotation], [p[i] for i in group.translation], cayley=cayley)]
    return cayley_transform(group, p) if cayley else [*p, size_of(group, p)]


def _exponential(group: Group) -> Kernel:
    names = tuple(f"p{i}" for i in range(1, len(group.matrices) + 1))
    values = exponential(group, [symbol(n) for n in names])
    return Kernel(
        "exponential", "the exponential of a small P, less 1", {"p": names}, (Output("element", tuple(values)),)
    )


def flow_attitude(
    system: System,
    group: Group,
    flows: Sequence[Flow],
    moved: Sequence[Sequence[Expression]],
    gauge: Gauge,
    coefficients: Coefficients,
    time_of: Callable[[Flow], Expression] | None = None,
) -> Attitude:
    """The attitude of a splitting; the coefficients grow by what it needs. `SpecError` as `turnings`.

    ``moved`` are increments: those of the sources of noise come before those of the ``flows``. With a monitor,
    ``time_of`` tells the time that a flow takes.
    """
    turned = turnings(system, group, flows, put_back=uniform(system))
    shaken = [turning_of(system, group, s.hamiltonian, s.name, put_back=False) for s in system.noise]
    times = [time_of(flow) if time_of else symbol(TIME) for flow in flows]
    named = [f"the noise {s.name}" for s in system.noise] + [f"{flow.letter}_{k}" for k, flow in enumerate(flows, 1)]
    found = []
    listed = zip(moved, [*shaken, *turned], [*driving_times(system), *times], strict=True)
    for k, (increment, turning, time) in enumerate(listed, 1):
        values = staged([*increment, *_carried(system, group, turning, time)], coefficients)
        parts = tuple(values[: len(increment)]), tuple(values[len(increment) :])
        inputs = {"coef": coefficients.slots, "state": system.coordinates, "element": _carrier(group)}
        about = f"the flow of {named[k - 1]}, and the element of a step with what it turns by"
        found.append(Kernel(f"turn{k}", about, inputs, (Output("increment", parts[0]), Output("turned", parts[1]))))
    rate = rate_kernel(system, group, gauge, [turning.left for turning in turned])
    needed = _exponential(group) if rate and group.matrices else None
    return Attitude(group, False, turns=tuple(found), rate=rate, exponential=needed)


def _carrier(group: Group) -> tuple[Symbol, ...]:
    """The element, less 1, of the flows of a step so far."""
    return tuple(Symbol("element", i) for i in range(group.size))


def _carried(system: System, group: Group, turning: Turning, time: Expression) -> list[Expression]:
    """That of one flow more."""
    before, factors = [symbol(s) for s in _carrier(group)], factor_elements(system, group, turning, time)
    return joined(group, [before, joined(group, factors)]) if factors else before


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
    values = [*slope, size_of(group, slope)] if group.matrices else [slope[i] for i in turning]
    inputs = {"params": system.parameter_names, **gauge.inputs, "x": system.coordinates}
    purpose = "the gradient of the Casimirs that are taken from H" + f", and {SIZE_OF_COVECTOR}" * bool(group.matrices)
    return Kernel("rate", purpose, inputs, (Output("rate", tuple(values)),))
