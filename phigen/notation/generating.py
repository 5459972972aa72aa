"""Formulas of a method by series, for display: the terms S_1 … S_k, the order with its reason, the modified
Hamiltonian.
"""

from __future__ import annotations

from dataclasses import dataclass

from phigen.compilation import Compilation, CompiledSeries
from phigen.errors import Diagnostic, SpecError
from phigen.scheme.modified import corrections, expect_modified, powers
from phigen.symbolic.readable import Formula, of_polynomial

#: Largest order p for which the leading correction of the modified Hamiltonian is displayed without request. The
#: correction is −h^p S_{p+1}; for large p, S_{p+1} takes long to compute.
_MODIFIED_UP_TO = 6


def method(compilation: CompiledSeries) -> str:
    """Return the method in words: ``order 6 from S_1 … S_5; symmetric, so the terms of even index vanish``."""
    plan, stage = compilation.order, compilation.stage
    terms = "S_1" if stage.terms == 1 else f"S_1 … S_{stage.terms}"
    system = compilation.system
    pushes = [" + hζ"] * (system.forces is not None) + [" + Σ ΔW σ∇g"] * bool(system.noise)
    p = "g (∇S_h + hζ)" if compilation.monitor and system.forces else f"∇S_h{''.join(pushes)}"
    terms += f" with p = {p}" if pushes else ""
    if stage is not plan:
        return f"order {plan.order}, composed of {len(compilation.program.fractions)} stages of order 2 from {terms}"
    reason = "symmetric, so the terms of even index vanish" if compilation.symmetric else "not symmetric"
    note = f" ({plan.note})" if plan.note else ""
    return f"order {plan.order} from {terms}; {reason}{note}"


@dataclass(frozen=True)
class Generating:
    """The nonzero terms S_i of the generating function as formulas, and the leading correction of the Hamiltonian.

    ``listed`` has pairs (i, S_i). The step is the flow, over the time h, of H − h^p S_{p+1} + …, where p is the order;
    ``leading`` is −S_{p+1}. The S_i with i ≥ ``beyond`` have too many terms to be displayed.
    """

    listed: list[tuple[int, Formula]]
    leading: Formula | None
    beyond: int | None

    @property
    def missing(self) -> str:
        """Text that says from which S_i on the terms are not displayed, and why."""
        return f"from S_{self.beyond} on there are too many terms to be written out; the code shares their parts"


def series_formulas(compilation: CompiledSeries, max_terms: int | None) -> Generating:
    """Return the generating function as formulas.

    At most ``max_terms`` terms of each S_i are displayed; None displays all.
    """
    plan = compilation.stage
    pushed = compilation.system.forces or compilation.system.noise
    has_modified = not pushed and plan is compilation.order and plan.order <= _MODIFIED_UP_TO
    series = compilation.series.written(plan.order + 1 if has_modified else plan.terms)
    polynomials = [
        (i, of_polynomial(series.tower, s, max_terms)) for i, s in enumerate(series.terms[: plan.terms], 1) if s != 0
    ]
    term_count = len(series.terms)
    leading = (
        of_polynomial(series.tower, -series.terms[plan.order], max_terms)
        if has_modified and term_count > plan.order
        else None
    )
    following = term_count + 1 + (compilation.symmetric and term_count % 2 == 1)  # index i of the next S_i ≠ 0
    return Generating(polynomials, leading, following if term_count < plan.terms else None)


def modified_formulas(compilation: Compilation, count: int, max_terms: int | None) -> list[tuple[int, Formula]]:
    """Return the first ``count`` corrections of the modified Hamiltonian H̃ = H + h^p H_p + …, as pairs (j,
    H_j).

    For the count 0, return the first correction if it is cheap to compute, else []. For other counts, raises
    `SpecError` if the method is not a series, is a composition, or has an approximate bi-realisation, or if the system
    has forces.
    """
    if not count:
        leading = series_formulas(compilation.by_series(), max_terms).leading if compilation.has_series else None
        return [] if leading is None else [(compilation.order.order, leading)]
    if not compilation.has_series:
        message = f"the modified Hamiltonian is not computed for a step by {compilation.label}"
        raise SpecError([Diagnostic(message, hint="scheme: series has it")])
    system, chart = compilation.system, compilation.by_series().realisation
    expect_modified(system, chart, len(compilation.program.fractions))
    series = corrections(system, chart, compilation.order, count, compilation.gauge)
    exponents = powers(compilation.order, count, symmetric=chart.symmetric)
    return [(j, of_polynomial(series.tower, series.terms[j], max_terms)) for j in exponents]
