"""The kernels of attitudes: the element of each stage from the covector p = ∇S_h(y), and what the gauge turns."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.attitude.elements import element
from phigen.attitude.group import Group, refused
from phigen.attitude.parts import factor_elements, joined, turnings
from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.gauge import Gauge
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Attitude
from phigen.scheme.staging import Coefficients
from phigen.splitting.flow import Flow
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
    p = list(generating.slope)
    values = coefficients.hoist(group.generator(p) if group.matrices else _element(group, p, cayley))
    about = "the matrix of p = grad S_h(y)" if group.matrices else "what p = grad S_h(y) turns by, a quaternion less 1"
    about += ", and what it translates by" * bool(group.translation)
    turn = _kernel("turn", about, coefficients, system, values)
    along = _along(group, system) if realisation.path else None
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
    system: System, group: Group, flows: Sequence[Flow], gauge: Gauge, coefficients: Coefficients
) -> Attitude:
    """The attitude of a splitting; the coefficients grow by what it needs. `SpecError` as `turnings`."""
    if system.time:
        message = "reconstruct: splittings of a Hamiltonian that depends on the time have no attitude yet"
        raise refused(system, message, "scheme: series has one")
    turned = turnings(system, group, flows)
    found = []
    for k, turning in enumerate(turned, 1):
        factors = factor_elements(system, group, turning)
        values = coefficients.hoist(joined(group, factors) if factors else [ZERO] * group.size)
        inputs = {"coef": coefficients.slots, "state": system.coordinates}
        found.append(Kernel(f"turn{k}", f"what H_{k} turns by", inputs, (Output("turn", tuple(values)),)))
    put_back = [turning.casimir for turning in turned]
    return Attitude(group, False, turns=tuple(found), rate=rate_kernel(system, group, gauge, put_back))


def rate_kernel(system: System, group: Group, gauge: Gauge, more: Sequence[Expression] = ()) -> Kernel | None:
    """The gradient of the Casimirs that the gauge takes from H, and of ``more``; None without any."""
    taken = [e for e in more if not e.is_zero]
    taken += [symbol(s) * system.casimirs[c] for s, c in zip(gauge.symbols, gauge.free, strict=True)]
    taken += [value * system.casimirs[c] for c, value in gauge.fixed.items()]
    if not taken:
        return None
    slope = gradient(total(taken), system.coordinates)
    turning = (*group.rotation, *group.translation)
    values = group.generator(slope) if group.matrices else [slope[i] for i in turning]
    inputs = {"params": system.parameter_names, **gauge.inputs, "x": system.coordinates}
    purpose = "the gradient of the Casimirs that are taken from H"
    return Kernel("rate", purpose, inputs, (Output("rate", tuple(values)),))
