"""Flows of members that are undone on the way back: the state before a flow, found from that after it.

So no state is kept but now and then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.lowering import expand_powers, with_numbers_shared
from phigen.scheme.program import Program
from phigen.scheme.reversal import EVEN, UNDONE, before, of_coefficients, turned_back
from phigen.scheme.steps import Splitting
from phigen.symbolic.expression import ZERO, symbol, symbols_of


def undoing(program: Program, step: Splitting) -> tuple[Kernel, ...]:
    """The transposes of the flows, which read the state after them and find that before, `UNDONE`.

    None where forces may damp, or where coefficients over −h are not those over h but for their signs.
    """
    back, parities = step.adjoint.steps if step.adjoint else (), of_coefficients(step)
    used = {s for flow in step.flows for s in symbols_of(*flow.roots)}
    if program.forced or not all(parities.get(s, EVEN) for s in used):
        return ()
    return tuple(_undoing(flow, kernel, parities) for flow, kernel in zip(step.flows, back, strict=bool(back)))


def _undoing(flow: Kernel, back: Kernel, parities: Mapping[str, int]) -> Kernel:
    state, changes = flow.inputs["state"], flow.outputs[0].values
    turned = dict(zip(state, turned_back(changes, parities), strict=True))
    moved = {s: change for s, change in turned.items() if not change.is_zero}
    found = before(back.roots, moved) + [symbol(s) + moved[s] if s in moved else ZERO for s in state]
    values = iter(with_numbers_shared(expand_powers(found)))
    outputs = (*back.outputs, Output(UNDONE, tuple(ZERO for _ in state)))
    return replace(back, outputs=tuple(replace(o, values=tuple(next(values) for _ in o.values)) for o in outputs))
