"""Choice of the composition of a splitting: by the order, the brackets of the parts of H, and the cost of their
flows.

If H has two parts T and V with {V, {V, {V, T}}} = 0, the methods of `phigen.scheme.nystrom` apply. Some of these
methods need flows of V + κ{V, {V, T}} for numbers κ (*modified kicks*), and apply only if phigen can compute them. The
time that a method needs for a given accuracy is proportional to the cost of a step times error^{1/order}. Of the
applicable methods, the one with the smallest product is chosen. All other splittings get the recommended method of
`phigen.scheme.alternation`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from phigen.errors import Diagnostic, Location, SpecError
from phigen.geometry.system import System
from phigen.scheme import alternation, near_integrable, nystrom
from phigen.scheme.alternation import Alternation, Schedule
from phigen.scheme.lowering import cost
from phigen.scheme.near_integrable import Corrected, NearIntegrable
from phigen.scheme.nystrom import Nystrom
from phigen.scheme.order import Order
from phigen.splitting.flow import Flow
from phigen.splitting.kicks import Kick, kicks, modified_kick
from phigen.splitting.parts import SplitHamiltonian
from phigen.splitting.statements import bracket
from phigen.symbolic.expression import gradient, symbols_of
from phigen.symbolic.verdict import PROVED, decide_zero

#: Cost of a flow, in operations, for each coordinate that it updates, in addition to the cost of its formulas. Most of
#: this additional cost is the time for which a flow waits for the results of the preceding flow. The value was fitted
#: to timings of fourteen pairs of methods on seven systems: in twelve pairs the faster method is chosen, and in the
#: other two pairs the chosen method takes at most 1.34 times as long.
FLOW_LATENCY = 12


@dataclass(frozen=True)
class ScheduledMethod:
    """A splitting method, and the parts of H in the order in which a step applies their flows.

    If the method has modified kicks, their Hamiltonian V + κ{V, {V, T}} is the part in place of V. ``why`` is the
    reason for the choice, as text for the user. If H depends on the time, ``carrier`` is the number of the part during
    whose flow the time advances. If no part has this number, the time advances separately, after all flows.
    """

    order: Order
    method: Alternation | Nystrom
    splitting: SplitHamiltonian
    why: str = ""
    carrier: int | None = None

    def schedule(self) -> Schedule:
        """Return the order and the durations of the flows in a step of the method."""
        count, method = len(self.splitting.flows), self.method
        if self.carrier is None:
            if isinstance(method, Nystrom | Corrected):
                return method.schedule()
            return alternation.schedule(method, count)
        parts = max(count, self.carrier + 1)
        flows = method.schedule() if isinstance(method, Nystrom) else alternation.schedule(method, parts)
        return alternation.with_clock(flows, self.carrier, count)


class Host(Protocol):
    """Protocol for specs and systems whose Hamiltonian is split; error messages need the ``locations``."""

    @property
    def locations(self) -> Mapping[tuple[Any, ...], Location]:
        """Map from the path of each key in the spec to the position of the key in the file."""
        ...


def plan(system: System, splitting: SplitHamiltonian, requested: int, composition: str) -> ScheduledMethod:
    """Return the splitting method for the ``requested`` order; an odd order is rounded up.

    Raises `SpecError` if the composition does not offer this order, or does not apply to the parts of H.
    """
    if splitting.small is not None and _unsuited(system, splitting, splitting.small):
        splitting = replace(splitting, small=None)
    if system.forces:  # with forces, Nyström methods do not apply
        choice = planned(system, splitting, requested, composition, lambda: ())
        return with_carrier(choice, system.time) if system.time else choice
    if not system.time:
        choice = planned(system, splitting, requested, composition, lambda: kicks(system, splitting))
        return _with_modified_kick(system, choice)
    choice = planned(system, splitting, requested, composition, lambda: _kicks_in_time(system, splitting))
    return with_carrier(choice, system.time)


def _unsuited(system: System, splitting: SplitHamiltonian, small: int) -> bool:
    """Whether methods for near-integrable systems H = A + εB do not apply; ``small`` is the index of εB.

    Forces exclude these methods, since forces add further flows. An A that depends on the time also excludes these
    methods, since the conjugate of the time belongs to A.
    """
    return len(splitting.flows) != 2 or (bool(system.time) and is_dated(splitting.flows[1 - small], system.time))


def _kicks_in_time(system: System, splitting: SplitHamiltonian) -> list[Kick]:
    """Return the parts that can be V in H = T + V for a Nyström method, if H depends on the time t.

    The conjugate e of the time is added to T, so that t advances in the flow of T + e. This requires that T does not
    depend on t, and that V commutes with ∂V/∂t.
    """
    kicks_found = []
    for kick in kicks(system.frozen, splitting):
        drift, v = splitting.flows[1 - kick.part], splitting.flows[kick.part].hamiltonian
        rate = bracket(system, v, gradient(v, system.times)[0])
        if not is_dated(drift, system.time) and decide_zero("", [("", rate)]).verdict == PROVED:
            kicks_found.append(kick)
    return kicks_found


def with_carrier(choice: ScheduledMethod, time: str) -> ScheduledMethod:
    """Return the method with its ``carrier``, the number of the part during whose flow the time advances.

    The carrier is the first or the last part, and must not depend on the time. If every part depends on the time, the
    time advances in a separate flow after the last part.
    """
    flows = choice.splitting.flows
    if isinstance(choice.method, Nystrom):
        return replace(choice, carrier=1 - (choice.splitting.kick or 0))
    if isinstance(choice.method, NearIntegrable):
        return replace(choice, carrier=0)  # the time advances with the large part, number 0
    if not is_dated(flows[-1], time):
        return replace(choice, carrier=len(flows) - 1)
    undated = [flow for flow in flows if not is_dated(flow, time)]
    if not undated:
        return replace(choice, carrier=len(flows))
    ordered = (undated[0], *(flow for flow in flows if flow is not undated[0]))
    return replace(choice, splitting=SplitHamiltonian(ordered), carrier=0)


def is_dated(flow: Flow, time: str) -> bool:
    """Whether a flow depends on the time."""
    return time in symbols_of(flow.hamiltonian, *flow.force)


def planned(
    system: Host, splitting: SplitHamiltonian, requested: int, composition: str, kicks_of: Callable[[], Sequence[Kick]]
) -> ScheduledMethod:
    """Return the splitting method for the ``requested`` order, for a spec or a system; see `plan`.

    ``kicks_of`` returns the parts that can be V in H = T + V for a Nyström method. It is called only if a Nyström
    method is considered.
    """
    even_order = requested + requested % 2
    note = "" if even_order == requested else f"order {requested} was asked for; a symmetric method has even order"
    order = Order(even_order, 0, note)
    near_method = near_integrable.find(composition, even_order)
    if near_method and splitting.small is not None:
        return _near_integrable(splitting, order, near_method)
    if composition in near_integrable.NAMES and near_method:
        raise _nothing_small(system, splitting, composition)
    is_nystrom = composition in nystrom.NAMES
    if is_nystrom or composition == "auto":
        applicable = list(_applicable(kicks_of, even_order, composition))
        if applicable:
            method, kick = min(applicable, key=lambda pair: _price(splitting, *pair))
            return chosen(splitting, order, method, kick)
    offered_orders = orders(composition)
    if even_order not in offered_orders:
        raise _no_order(system, composition, offered_orders, even_order)
    if is_nystrom:
        raise _not_applicable(system, splitting, composition, kicks_of)
    recommended = alternation.find(composition, even_order)
    assert recommended is not None
    return ScheduledMethod(order, recommended, arranged(splitting))


def _near_integrable(splitting: SplitHamiltonian, order: Order, method: NearIntegrable) -> ScheduledMethod:
    """Return the method for H = A + εB with its parts in order: A first or, with a corrector, B first.

    A method with a corrector begins and ends a run with flows of A; in between, each step is a flow of B and a flow of
    A.
    """
    assert splitting.small is not None
    large_flow, small_flow = splitting.flows[1 - splitting.small], splitting.flows[splitting.small]
    if isinstance(method, Corrected):
        reason = f"H_1 is small, of size ε: errors {method.errors}"
        return ScheduledMethod(order, method, SplitHamiltonian((small_flow, large_flow), small=0), reason)
    reason = f"H_2 is small, of size ε: errors {method.errors}"
    return ScheduledMethod(order, method, SplitHamiltonian((large_flow, small_flow), small=1), reason)


def _with_modified_kick(system: System, choice: ScheduledMethod) -> ScheduledMethod:
    """Return the method for H = A + εB with the flow of B modified, if the method requires this.

    The modified flow is that of B + κ{B, {B, A}} with a number κ. Raises `SpecError` if phigen cannot compute it.
    """
    method = choice.method
    if not isinstance(method, Corrected) or not method.multiple:
        return choice
    small_flow, large_flow = choice.splitting.flows
    modified = modified_kick(system, small_flow, large_flow)
    if modified is None:
        message = (
            f"scheme splitting: composition {method.name} needs B and {{B, {{B, A}}}} to depend only on coordinates "
            "that commute"
        )
        hint = (
            "use `coordinates_from: jacobi`, with which B depends only on positions, or "
            "`composition: wisdom-holman-17`, which allows every B"
        )
        raise SpecError([Diagnostic(message, system.locations.get(("composition",)), hint)])
    return replace(choice, splitting=SplitHamiltonian((modified, large_flow), kick=0, small=0))


def _nothing_small(system: Host, splitting: SplitHamiltonian, composition: str) -> SpecError:
    """Return the error which says that a near-integrable ``composition`` needs two parts of H, one of them small."""
    count = len(splitting.flows)
    situation = "none is known to be small" if count == 2 else f"this H has {count} part{'s' * (count > 1)}"
    message = f"scheme splitting: composition {composition} needs H = A + εB in two parts, B small; {situation}"
    hint = "add small: true to a parameter, to declare that the terms of H with this factor are small"
    return SpecError([Diagnostic(message, system.locations.get(("composition",)), hint)])


def chosen(splitting: SplitHamiltonian, order: Order, method: Nystrom, kick: Kick) -> ScheduledMethod:
    """Return a Nyström method for H = T + V together with the reason for its choice, as text.

    The parts T and V come in the order in which a step applies their flows.
    """
    return ScheduledMethod(order, method, _arranged(splitting, method, kick), _why(method))


def orders(composition: str) -> list[int]:
    """Return the orders of the splitting methods called ``composition``."""
    if composition in near_integrable.NAMES:
        return near_integrable.orders(composition)
    return nystrom.orders(composition) if composition in nystrom.NAMES else alternation.orders(composition)


def arranged(splitting: SplitHamiltonian) -> SplitHamiltonian:
    """Return the parts in the order in which a step of an `Alternation` is cheapest: the most expensive part last.

    The last flow occurs s times in a step with 2s coefficients α_i, the first flow s + 1 times, and each other flow 2s
    times.
    """
    by_cost = sorted(splitting.flows, key=lambda flow: cost(flow.increment))
    return SplitHamiltonian((*by_cost[-2:-1], *by_cost[:-2], *by_cost[-1:]))


def _applicable(kicks_of: Callable[[], Sequence[Kick]], order: int, name: str) -> Iterator[tuple[Nystrom, Kick]]:
    methods = [m for m in nystrom.METHODS if m.order == order and name in ("auto", m.name)]
    for kick in kicks_of() if methods else ():
        for method in methods:
            if kick.modified or not method.multiples:
                yield method, kick


def _price(splitting: SplitHamiltonian, method: Nystrom, kick: Kick) -> float:
    """Return the cost of a step times error^{1/order}, which is proportional to the time for a given accuracy."""
    first, last = (_cost(flow) for flow in _arranged(splitting, method, kick).flows)
    step = (method.stages + 1) * first + method.stages * last
    return step * math.pow(method.error, 1 / method.order)


def _cost(flow: Flow) -> int:
    return cost(flow.increment) + FLOW_LATENCY * flow.moving


def _arranged(splitting: SplitHamiltonian, method: Nystrom, kick: Kick) -> SplitHamiltonian:
    """Return the parts T and V of H in the order in which a step of the Nyström method applies their flows."""
    drift, kick_flow = splitting.flows[1 - kick.part], splitting.flows[kick.part]
    kicking = kick.modified if method.multiples and kick.modified else kick_flow
    return SplitHamiltonian((kicking, drift), 0) if method.kicks_first else SplitHamiltonian((drift, kicking), 1)


def _why(method: Nystrom) -> str:
    """Return the condition on the parts H_1 and H_2 under which a Nyström method applies, as text for the user."""
    v, t = ("H_1", "H_2") if method.kicks_first else ("H_2", "H_1")
    modified = f" and {v} + κ{{{v}, {{{v}, {t}}}}} has a flow" if method.multiples else ""
    return f"{{{v}, {{{v}, {{{v}, {t}}}}}}} = 0{modified}"


def _no_order(system: Host, composition: str, offered_orders: Sequence[int], order: int) -> SpecError:
    place = system.locations.get(("composition",)) or system.locations.get(("order",))
    offered = ", ".join(map(str, offered_orders)) or "none"
    subject = "splittings offer" if composition == "auto" else f"composition {composition} offers"
    default = "" if ("order",) in system.locations else ", the default"
    message = f"scheme splitting: {subject} the order{'s' * (len(offered_orders) != 1)} {offered}, not {order}{default}"
    if composition == "auto" or not offered_orders:
        return SpecError([Diagnostic(message, place, "scheme: series reaches order 16")])
    closest = min(offered_orders, key=lambda offered_order: abs(offered_order - order))
    return SpecError([Diagnostic(message, place, f"write order: {closest}, or composition: auto")])


def _not_applicable(
    system: Host, splitting: SplitHamiltonian, composition: str, kicks_of: Callable[[], Sequence[Kick]]
) -> SpecError:
    """Return the error for a Nyström method that does not apply to the parts of H; its message says what the parts
    lack.
    """
    count = len(splitting.flows)
    if count != 2:
        reason = f"H = T + V, of two parts; this H has {count} part{'s' * (count > 1)}"
    elif kicks_of():
        reason = "a flow of V + κ{V, {V, T}} in closed form, which phigen does not find"
    else:
        reason = "{V, {V, {V, T}}} = 0 with one of the two parts as V, which does not hold here"
    hint = "composition: auto chooses the best one that applies; phigen show --scheme splitting shows the parts"
    place = system.locations.get(("composition",))
    return SpecError([Diagnostic(f"scheme splitting: composition {composition} needs {reason}", place, hint)])
