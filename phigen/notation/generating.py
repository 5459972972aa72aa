"""Generating function of a compilation: the reason for its order, and S_1 … S_k as formulas."""

from __future__ import annotations

from dataclasses import dataclass

from phigen.compilation import Compilation, CompiledSeries
from phigen.errors import Diagnostic, SpecError
from phigen.scheme.modified import corrections, expect_modified, powers
from phigen.symbolic.readable import Formula, of_polynomial

#: Limit for showing the leading term of the modified Hamiltonian, which needs one more coefficient of the series.
_MODIFIED_UP_TO = 6


def method(compilation: CompiledSeries) -> str:
    """Return the method in words, as in ``order 6 from S_1 … S_5, symmetric: the even terms vanish``."""
    plan, stage = compilation.order, compilation.stage
    terms = "S_1" if stage.terms == 1 else f"S_1 … S_{stage.terms}"
    system = compilation.system
    pushes = [" + hζ"] * (system.forces is not None) + [" + Σ ΔW σ∇g"] * bool(system.noise)
    p = "g (∇S_h + hζ)" if compilation.monitor and system.forces else f"∇S_h{''.join(pushes)}"
    terms += f" with p = {p}" if pushes else ""
    if stage is not plan:
        return f"order {plan.order}, composed of {len(compilation.program.fractions)} stages of order 2 from {terms}"
    why = "symmetric, so the terms of even index vanish" if compilation.symmetric else "not symmetric"
    note = f" ({plan.note})" if plan.note else ""
    return f"order {plan.order} from {terms}; {why}{note}"


@dataclass(frozen=True)
class Generating:
    """Non-zero S_i with their indices, and −S_{p+1}, the leading term of the modified Hamiltonian.

    The map of step h is the flow of H − h^p S_{p+1} + …, where p is the order and S the untruncated series. S_i from
    ``beyond`` on have too many terms to be written out; the code has them with common subexpressions.
    """

    listed: list[tuple[int, Formula]]
    leading: Formula | None
    beyond: int | None

    @property
    def missing(self) -> str:
        """The remark on terms that are not listed."""
        return f"from S_{self.beyond} on there are too many terms to be written out; the code shares their parts"


def series_formulas(compilation: CompiledSeries, most: int | None) -> Generating:
    """Return the generating function of a series as far as it can be written out; ``most`` limits the terms of each
    S_i.
    """
    plan = compilation.stage
    pushed = compilation.system.forces or compilation.system.noise
    more = not pushed and plan is compilation.order and plan.order <= _MODIFIED_UP_TO
    series = compilation.series.written(plan.order + 1 if more else plan.terms)
    listed = [(i, of_polynomial(series.tower, s, most)) for i, s in enumerate(series.terms[: plan.terms], 1) if s != 0]
    known = len(series.terms)
    leading = of_polynomial(series.tower, -series.terms[plan.order], most) if more and known > plan.order else None
    following = known + 1 + (compilation.symmetric and known % 2 == 1)  # index of the next non-zero term
    return Generating(listed, leading, following if known < plan.terms else None)


def modified_formulas(compilation: Compilation, count: int, most: int | None) -> list[tuple[int, Formula]]:
    """Return pairs (j, H_j) of the first ``count`` terms h^j H_j of the modified Hamiltonian H̃ = H + h^p H_p + …

    A count of 0 selects the leading term if it is cheap. A larger count raises `SpecError` for a splitting, a
    composition and an approximate bi-realisation.
    """
    if not count:
        leading = series_formulas(compilation.by_series(), most).leading if compilation.has_series else None
        return [] if leading is None else [(compilation.order.order, leading)]
    if not compilation.has_series:
        message = f"the modified Hamiltonian is not computed for a step by {compilation.label}"
        raise SpecError([Diagnostic(message, hint="scheme: series has it")])
    system, chart = compilation.system, compilation.by_series().realisation
    expect_modified(system, chart, len(compilation.program.fractions))
    series = corrections(system, chart, compilation.order, count, compilation.gauge)
    listed = powers(compilation.order, count, symmetric=chart.symmetric)
    return [(j, of_polynomial(series.tower, series.terms[j], most)) for j in listed]
