"""The formulas of a compilation as LaTeX, for a paper: a fragment that needs amsmath."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.analysis.flows import images
from phigen.analysis.formulas import formula_latex, latex, readable_latex
from phigen.analysis.generating import modified_formulas, series_formulas
from phigen.compiler import Compilation
from phigen.splitting.flow import Flow
from phigen.symbolic.expression import symbol
from phigen.symbolic.readable import SHOWN

#: The function φ of the exponential bi-realisation.
PHI = ("\\varphi(s)", r"\frac{1}{s} \left( 1 - \frac{\sqrt{s}}{2} \cot \frac{\sqrt{s}}{2} \right)")


def document(compilation: Compilation, modified: int = 0, most: int | None = SHOWN) -> str:
    """Equations for π, H, the Casimirs, α, β, S_1 … S_k, or the parts and flows of a splitting, and H̃.

    ``most`` bounds the terms shown of S_i and H̃, None shows all. ``modified`` is the number of corrections; with 0,
    the leading one is shown where it costs little. Raises `SpecError` where they are asked for and not computed.
    """
    system = compilation.system
    names = [latex(symbol(c)) for c in system.coordinates]
    blocks = [
        _equation("\\pi", _matrix([readable_latex(row) for row in system.poisson])),
        _aligned([("H", readable_latex([system.hamiltonian])[0])]),
    ]
    first_integrals = {**system.casimirs, **system.invariants}
    if first_integrals:
        texts = readable_latex(list(first_integrals.values()))
        blocks.append(_aligned(zip_names([latex(symbol(n)) for n in first_integrals], texts)))
    if compilation.splitting:
        blocks += [_flow(flow, k, system.coordinates) for k, flow in enumerate(compilation.splitting.flows, 1)]
    else:
        blocks += [*_maps(compilation, names), _aligned(_series(compilation, most))]
    if listed := modified_formulas(compilation, modified, most):
        sums = " + ".join(["H", *(f"{_power(j)} H_{{{j}}}" for j, _ in listed), "\\cdots"])
        blocks.append(_aligned([("\\tilde{H}", sums), *((f"H_{{{j}}}", formula_latex(f)) for j, f in listed)]))
    return "\n".join([f"% {compilation.spec.name}, order {compilation.order.order}; needs amsmath", *blocks])


def _flow(flow: Flow, k: int, coordinates: Sequence[str]) -> str:
    """A part of H, and where its flow for the time h takes the coordinates that move."""
    moved = images(flow, coordinates)
    hamiltonian, *texts = readable_latex([flow.hamiltonian, *moved.values()])
    names = [latex(symbol(c)) for c in moved]
    return _aligned([(f"H_{{{k}}}", hamiltonian), *zip_names([f"\\Phi_{{{k}}}^* {n}" for n in names], texts)])


def _maps(compilation: Compilation, names: Sequence[str]) -> list[str]:
    """α and β, and φ if they contain it; of a path they are series, of which this is the beginning."""
    realisation = compilation.chart
    more = " + \\cdots" if realisation.path else ""
    blocks = []
    for greek, maps in (("\\alpha", realisation.alpha), ("\\beta", realisation.beta)):
        texts = [t + more for t in readable_latex(maps)]
        blocks.append(_aligned(zip_names([f"{greek}_{{{n}}}" for n in names], texts)))
    return [*blocks, _aligned([PHI])] if any("\\varphi" in block for block in blocks) else blocks


def _gauged(compilation: Compilation) -> str:
    """The Hamiltonian that the series is of, if Casimirs are subtracted, to stand before what S_1 is."""
    gauge = compilation.gauge
    factors = readable_latex([symbol(s) for s in gauge.symbols])
    factors += [f"\\left( {value} \\right)" for value in readable_latex([*gauge.fixed.values()])]
    casimirs = [latex(symbol(name)) for name in (*gauge.free, *gauge.fixed)]
    parts = [f" - {factor} {casimir}" for factor, casimir in zip(factors, casimirs, strict=True)]
    return "".join(["H", *parts, " = "]) if parts else ""


def _series(compilation: Compilation, most: int | None) -> list[tuple[str, str]]:
    listed, _ = series_formulas(compilation, most)
    total = " + ".join(f"{_power(i)} S_{{{i}}}" for i, _ in listed)
    texts = [_gauged(compilation) * (i == 1) + formula_latex(f) for i, f in listed]
    return [("S_h", total), *zip_names([f"S_{{{i}}}" for i, _ in listed], texts)]


def _power(exponent: int) -> str:
    return f"h^{{{exponent}}}" if exponent > 1 else "h"


def zip_names(names: Sequence[str], texts: Sequence[str]) -> list[tuple[str, str]]:
    """Left and right sides of equations."""
    return list(zip(names, texts, strict=True))


def _equation(left: str, right: str) -> str:
    return f"\\begin{{equation*}}\n  {left} = {right}\n\\end{{equation*}}"


def _aligned(sides: Sequence[tuple[str, str]]) -> str:
    lines = " \\\\\n".join(f"  {left} &= {right}" for left, right in sides)
    return f"\\begin{{align*}}\n{lines}\n\\end{{align*}}"


def _matrix(rows: Sequence[Sequence[str]]) -> str:
    body = " \\\\ ".join(" & ".join(row) for row in rows)
    return f"\\begin{{pmatrix}} {body} \\end{{pmatrix}}"
