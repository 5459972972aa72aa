"""The generating function of a compilation: what the order rests on, and S_1 … S_k as formulas."""

from __future__ import annotations

from phigen.analysis.formulas import Formula, of_polynomial
from phigen.analysis.proof import stage_order
from phigen.compiler import Compilation

#: The leading term of the modified Hamiltonian costs one more coefficient of the series; beyond this it is left out.
_MODIFIED_UP_TO = 6


def method(compilation: Compilation) -> str:
    """``order 6 from S_1 … S_5, symmetric: the even terms vanish``."""
    plan, stage = compilation.order, stage_order(compilation)
    terms = "S_1" if stage.terms == 1 else f"S_1 … S_{stage.terms}"
    if stage is not plan:
        return f"order {plan.order}, composed of {len(compilation.program.fractions)} stages of order 2 from {terms}"
    why = "symmetric, so the terms of even index vanish" if compilation.symmetric else "not symmetric"
    note = f" ({plan.note})" if plan.note else ""
    return f"order {plan.order} from {terms}; {why}{note}"


def series_formulas(compilation: Compilation, most: int | None) -> tuple[list[tuple[int, Formula]], Formula | None]:
    """The S_i that do not vanish, with their index; and −S_{p+1}, the leading term of the modified Hamiltonian.

    The map of step h is the flow of H − h^p S_{p+1} + …, where p is the order and S the untruncated series.
    """
    plan = stage_order(compilation)
    more = plan is compilation.order and plan.order <= _MODIFIED_UP_TO
    series = compilation.series(plan.order + 1 if more else plan.terms)
    listed = [(i, of_polynomial(series.tower, s, most)) for i, s in enumerate(series.terms[: plan.terms], 1) if s != 0]
    return listed, of_polynomial(series.tower, -series.terms[plan.order], most) if more else None
