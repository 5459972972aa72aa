"""Transposes of flows. A transpose receives the state after a flow, and recomputes the state before the flow by the
inverse flow.

With these transposes, the reverse pass of members of an ensemble stores few states.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.lowering import expand_powers, with_numbers_shared
from phigen.scheme.program import Program
from phigen.scheme.reversal import EVEN, STATE_BEFORE, before, of_coefficients, over_negative_time
from phigen.scheme.steps import Splitting
from phigen.symbolic.expression import ZERO, symbol, symbols_of


def recomputing_transposes(program: Program, step: Splitting) -> tuple[Kernel, ...]:
    """Return transposes of flows that read the state after the flow.

    Their additional output `STATE_BEFORE` is the state before the flow. Returns () if there are forces, or if
    coefficients for the step −h differ from those for h by more than their signs.
    """
    transposes, parities = step.adjoint.steps if step.adjoint else (), of_coefficients(step)
    coefficients = {s for flow in step.flows for s in symbols_of(*flow.roots)}
    if program.forced or not all(parities.get(s, EVEN) for s in coefficients):
        return ()
    return tuple(
        _recomputing(flow, kernel, parities) for flow, kernel in zip(step.flows, transposes, strict=bool(transposes))
    )


def _recomputing(flow: Kernel, transpose: Kernel, parities: Mapping[str, int]) -> Kernel:
    state, changes = flow.inputs["state"], flow.outputs[0].values
    inverse_changes = dict(zip(state, over_negative_time(changes, parities), strict=True))
    nonzero = {s: change for s, change in inverse_changes.items() if not change.is_zero}
    expressions = before(transpose.roots, nonzero) + [symbol(s) + nonzero[s] if s in nonzero else ZERO for s in state]
    values = iter(with_numbers_shared(expand_powers(expressions)))
    outputs = (*transpose.outputs, Output(STATE_BEFORE, tuple(ZERO for _ in state)))
    return replace(transpose, outputs=tuple(replace(o, values=tuple(next(values) for _ in o.values)) for o in outputs))
