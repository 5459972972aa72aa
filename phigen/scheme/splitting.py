"""From the flows of the parts of H to a program: kernels, and the schedule of a step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System
from phigen.scheme.alternation import Alternation, Schedule, find, orders, schedule
from phigen.scheme.discretisation import MOST_OPERATIONS, too_large
from phigen.scheme.gauge import Gauge
from phigen.scheme.kernels import observables
from phigen.scheme.lowering import cost, operation_counts
from phigen.scheme.order import Order
from phigen.scheme.program import Kernel, Output, Program
from phigen.scheme.staging import Coefficients
from phigen.scheme.tangent import explicit_jacobian
from phigen.spec.model import NO_EXTRAS, Extras
from phigen.splitting.flow import Flow
from phigen.splitting.parts import Splitting
from phigen.splitting.ring import TIME


def plan(system: System, order: int | None, composition: str) -> tuple[Order, Alternation]:
    """The method that gives an order; odd orders round up. Raises `SpecError` for orders that the composition lacks."""
    wanted = order or 2
    even = wanted + wanted % 2
    note = "" if even == wanted else f"order {wanted} was asked for; a symmetric method has even order"
    found = find(composition, even)
    if found is None:
        place = system.locations.get(("composition",)) or system.locations.get(("order",))
        offered = ", ".join(map(str, orders(composition))) or "none"
        name = "splittings" if composition == "auto" else f"composition {composition}"
        message = (
            f"scheme splitting: {name} offer{'' if composition == 'auto' else 's'} the orders {offered}, not {even}"
        )
        raise SpecError([Diagnostic(message, place, "scheme: series reaches order 16")])
    return Order(even, 0, note), found


def arranged(splitting: Splitting) -> Splitting:
    """The parts in the order in which a step is cheapest: the costliest last, since it occurs once in a stage.

    The first occurs once too, and once more in all; those in the middle occur twice.
    """
    by_cost = sorted(splitting.flows, key=lambda flow: cost(flow.increment))
    return Splitting((*by_cost[-2:-1], *by_cost[:-2], *by_cost[-1:]))


def build_splitting(
    system: System,
    splitting: Splitting,
    order: Order,
    method: Alternation,
    gauge: Gauge,
    *,
    extras: Extras = NO_EXTRAS,
    title: str = "",
    licence: str = "0BSD",
    spec_sha256: str = "",
    lanes: bool = True,
) -> Program:
    """The explicit solver as a program. LimitError if a kernel exceeds `MOST_OPERATIONS`."""
    _expect_no_modified(system, extras)
    coefficients = Coefficients([*system.parameter_names, TIME])
    kernels = {}
    for k, flow in enumerate(splitting.flows, 1):
        kernels[f"flow{k}"] = _flow_kernel(system, flow, k, coefficients)
    if extras.tangent:
        for k in range(1, len(splitting.flows) + 1):
            explicit = kernels[f"flow{k}"]
            kernels[f"tangent{k}"] = explicit_jacobian(explicit, system.coordinates, coefficients, f"tangent{k}")
    prepare = Kernel(
        "prepare",
        "everything that depends on parameters and the time of a flow only",
        {"params": system.parameter_names, "h": (TIME,)},
        (Output("coef", tuple(coefficients.values)),),
    )
    for kernel in (prepare, *kernels.values()):
        operations = cost(kernel.roots)
        if operations > MOST_OPERATIONS:
            raise too_large(system, f"{kernel.name} would take {operations} operations, more than {MOST_OPERATIONS}")
    steps = schedule(method, len(splitting.flows))
    return Program(
        name=system.name,
        title=title,
        coordinates=system.coordinates,
        parameters=system.parameters,
        casimirs=tuple(system.casimirs),
        order=order.order,
        driver="splitting",
        coefficients=len(coefficients.values) * len(steps.times),
        kernels={"prepare": prepare, **kernels, **observables(system)},
        schedule=steps,
        extras=extras,
        license=licence,
        spec_sha256=spec_sha256,
        lanes=lanes,
        facts=tuple(fact for fact in (*gauge.facts, *facts(splitting, method, steps), order.note) if fact),
        operations=_operations([kernels[f"flow{k}"] for k in range(1, len(splitting.flows) + 1)], steps),
    )


def facts(splitting: Splitting, method: Alternation, steps: Schedule) -> list[str]:
    """What the header says of the method."""
    count = len(splitting.flows)
    if count == 1:
        return ["scheme: the exact flow of H, which is elementary", "step: explicit"]
    parts = " + ".join(f"H_{k}" for k in range(1, count + 1))
    return [
        f"scheme: splitting, H = {parts}, with the exact flow of each",
        f"composition: {method.name}, {method.stages} stage{'s' * (method.stages > 1)}, {len(steps.flows)} flows",
        "step: explicit",
    ]


def _flow_kernel(system: System, flow: Flow, k: int, coefficients: Coefficients) -> Kernel:
    increment = coefficients.hoist(flow.increment)
    return Kernel(
        f"flow{k}",
        f"the flow of H_{k} = {flow.hamiltonian}: {flow.manner}",
        {"coef": coefficients.slots, "state": system.coordinates},
        (Output("increment", tuple(increment)),),
    )


def _operations(flows: Sequence[Kernel], steps: Schedule) -> dict[str, int]:
    """The operations of a step, without those of compensated summation."""
    times = Counter(part for part, _ in steps.flows)
    counted: Counter[str] = Counter()
    for part, kernel in enumerate(flows):
        for what, number in operation_counts(kernel.roots).items():
            counted[what] += number * times[part]
    return dict(counted)


def _expect_no_modified(system: System, extras: Extras) -> None:
    if extras.modified_hamiltonian:
        place = system.locations.get(("modified_hamiltonian",))
        raise SpecError([Diagnostic("modified_hamiltonian is not offered for a splitting", place)])
