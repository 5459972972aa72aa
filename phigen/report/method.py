"""Section on the method: for a series, the maps α and β and the terms S_1 … S_k; for a splitting, the flows."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from phigen.compilation import Compilation, CompiledGauss, CompiledSeries, CompiledSplitting
from phigen.notation import collocation, flows, generating, mathml
from phigen.report import page
from phigen.report.equations import equation, group, polynomial
from phigen.report.known import ALPHA_BETA_OF_A_PATH, BETA_OF_ALPHA, GAUGED, MODIFIED, PATH_STEP, PHI, STEP
from phigen.scheme.steps import Step
from phigen.splitting.flow import Flow

#: If a step has more flows than this, the table of its flows is folded.
FLOWS = 12


def method_section(compilation: Compilation) -> Markup:
    """Return the section with the formulas of a step."""
    description = compilation.by_kind(generating.method, flows.method, collocation.method)
    blocks = compilation.by_kind(_series, _splitting, _collocation)
    lead = page.paragraph(page.typeset(f"{description[0].upper()}{description[1:]}."))
    return page.joined([lead, *_gauge(compilation), *blocks])


def _collocation(compilation: CompiledGauss) -> list[Markup]:
    """Return the equations of a Gauss step and a description of its unknowns."""
    equations = [page.paragraph(page.typeset(f"{left} = {right}")) for left, right in collocation.equations()]
    description = [page.paragraph(page.typeset(f"{line}.")) for line in collocation.lines(compilation)]
    return [page.heading("One step"), *equations, page.heading("Unknowns"), *description]


def _gauge(compilation: Compilation) -> list[Markup]:
    gauge = compilation.gauge
    subtracted = [
        f"{mathml.name(s)}<mo>&#x2062;</mo>{mathml.name(c)}" for s, c in zip(gauge.multiples, gauge.free, strict=True)
    ]
    subtracted += [f"{mathml.grouped(value)}<mo>&#x2062;</mo>{mathml.name(c)}" for c, value in gauge.fixed.items()]
    if not subtracted:
        return []
    explanation = "Below, H denotes this function. Multiples of Casimirs change the error of a step, but not the flow."
    gauged = mathml.math(GAUGED + "".join(f"<mo>−</mo>{part}" for part in subtracted))
    return [page.heading("Gauge"), page.equations([[gauged]]), page.paragraph(explanation, "note")]


def _series(compilation: CompiledSeries) -> list[Markup]:
    realisation, names = compilation.realisation, compilation.system.coordinates
    blocks = [page.heading("One step"), page.equations(PATH_STEP if realisation.path else STEP)]
    blocks.append(page.heading(f"Bi-realisation: {realisation.label}"))
    if realisation.path:
        blocks.append(page.equations(ALPHA_BETA_OF_A_PATH))
    elif realisation.symmetric:
        left = [mathml.indexed("α", c) for c in names]
        blocks += [group(left, realisation.alpha, "The components of α"), page.equations([BETA_OF_ALPHA])]
    else:
        left = [mathml.indexed(letter, c) for letter in "αβ" for c in names]
        blocks.append(group(left, [*realisation.alpha, *realisation.beta], "The components of α and β"))
    if not realisation.path and any("φ" in mathml.expression(e) for e in realisation.alpha):
        blocks.append(page.equations([PHI]))
    blocks.append(page.paragraph(f"Source: {realisation.reference}.", "note"))
    return [*blocks, *_generating_function(compilation)]


def _generating_function(compilation: CompiledSeries) -> list[Markup]:
    series = generating.series_formulas(compilation, None)
    scaled = [f"{_power('h', i)}<mo>&#x2062;</mo>{_indexed('S', i)}" for i, _ in series.listed]
    terms = "<mo>+</mo>".join([*scaled, *(["<mo>…</mo>"] if series.beyond else [])])
    blocks = [page.heading("Generating function")]
    blocks.append(page.equations([[mathml.math(f"{_indexed('S', 'h')}<mo>=</mo>{terms}")]]))
    blocks += [polynomial(_indexed("S", i), formula) for i, formula in series.listed]
    if series.beyond:
        blocks.append(page.paragraph(f"{series.missing[0].upper()}{series.missing[1:]}.", "note"))
    correction = series.leading
    if correction is None or not correction.size:
        return blocks
    blocks.append(page.heading("Modified Hamiltonian"))
    blocks.append(
        page.paragraph(
            "A step agrees to all orders in h with the exact flow, over the time h, of a Hamiltonian near H:"
        )
    )
    power, first = compilation.order.order, _indexed("H", compilation.order.order)
    leading = f"{_power('h', power)}<mo>&#x2062;</mo>{first}<mo>+</mo><mo>…</mo>"
    return [*blocks, page.equations([[mathml.math(MODIFIED + leading)]]), polynomial(first, correction)]


def _splitting(compilation: CompiledSplitting) -> list[Markup]:
    parts = compilation.splitting.flows
    sum_of_parts = "<mo>+</mo>".join(_indexed("H", k) for k, flow in enumerate(parts, 1) if not flow.force)
    blocks = [page.heading("Parts of H and their flows over a time h")]
    blocks.append(page.equations([[mathml.math(f"<mi>H</mi><mo>=</mo>{sum_of_parts}")]]))
    for k, flow in enumerate(parts, 1):
        blocks += _flow(compilation, k, flow)
    for number, matrix in flows.matrices(compilation):
        entries = flows.rates(number, matrix)
        left, (first, *continuation) = mathml.exponential(number)
        blocks.append(page.equations([[mathml.math(f"{left}<mo>=</mo>{first}"), *map(mathml.math, continuation)]]))
        blocks.append(group([mathml.name(s) for s in entries], list(entries.values()), "The matrix of an exponential"))
    return [*blocks, _schedule(compilation.program.step, [flow.letter for flow in parts])]


def _flow(compilation: CompiledSplitting, k: int, flow: Flow) -> list[Markup]:
    new_values = flows.images(compilation, flow)
    left = [mathml.name(c) for c in new_values]
    local = flows.definitions(flow, compilation.system.coordinates)
    part = page.equations([equation(mathml.component(flow.letter, k, c), e) for c, e in local])
    images = group(left, list(new_values.values()), f"The flow of {flow.letter}_{k}", "↦")
    return [part, images, page.paragraph(f"This flow: {flow.manner}.", "note")] if new_values else [part]


def _schedule(step: Step, letters: Sequence[str]) -> Markup:
    """Return the flows of one step in order."""
    rows = [
        (str(i), [("", page.typeset(f"{letters[part]}_{part + 1}")), ("number", f"{time:.16g}".replace("-", "−"))])
        for i, (part, time) in enumerate(flows.schedule(step), 1)
    ]
    table = page.table("One step", [("", ""), ("", "flow of"), ("number", "over this part of h")], rows)
    return table if len(rows) <= FLOWS else page.fold(f"The {len(rows)} flows of one step", table)


def _indexed(letter: str, index: int | str) -> str:
    tag = "mn" if isinstance(index, int) else "mi"
    return f"<msub><mi>{letter}</mi><{tag}>{index}</{tag}></msub>"


def _power(letter: str, exponent: int) -> str:
    return f"<mi>{letter}</mi>" if exponent == 1 else f"<msup><mi>{letter}</mi><mn>{exponent}</mn></msup>"
