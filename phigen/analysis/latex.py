"""The formulas of a compilation as LaTeX, for a paper: a fragment that needs amsmath."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.analysis.flows import images
from phigen.analysis.formulas import SHOWN, latex, of_polynomial, readable_latex
from phigen.analysis.proof import stage_order
from phigen.compiler import Compilation
from phigen.splitting.flow import Flow
from phigen.symbolic.expression import symbol


def document(compilation: Compilation, *, full: bool = False) -> str:
    """Equations for π, H, the Casimirs, α, β and S_1 … S_k; long S_i abbreviated unless ``full``."""
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
        realisation = compilation.chart
        for greek, maps in (("\\alpha", realisation.alpha), ("\\beta", realisation.beta)):
            blocks.append(_aligned(zip_names([f"{greek}_{{{n}}}" for n in names], readable_latex(maps))))
        blocks.append(_aligned(_series(compilation, None if full else SHOWN)))
    return "\n".join([f"% {compilation.spec.name}, order {compilation.order.order}; needs amsmath", *blocks])


def _flow(flow: Flow, k: int, coordinates: Sequence[str]) -> str:
    """A part of H, and where its flow for the time h takes the coordinates that move."""
    moved = images(flow, coordinates)
    hamiltonian, *texts = readable_latex([flow.hamiltonian, *moved.values()])
    names = [latex(symbol(c)) for c in moved]
    return _aligned([(f"H_{{{k}}}", hamiltonian), *zip_names([f"\\Phi_{{{k}}}^* {n}" for n in names], texts)])


def _series(compilation: Compilation, most: int | None) -> list[tuple[str, str]]:
    series = compilation.series(stage_order(compilation).terms)
    return [
        (f"S_{{{i}}}", of_polynomial(series.tower, s, most).latex()) for i, s in enumerate(series.terms, 1) if s != 0
    ]


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
