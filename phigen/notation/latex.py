"""Formulas of a compilation as LaTeX for a paper: a fragment that needs amsmath.

Formulas are first written in MathML, which `phigen.notation.typesetting` converts to LaTeX.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from phigen.compilation import Compilation, CompiledSeries, CompiledSplitting
from phigen.geometry.system import System
from phigen.notation import flows, mathml, named_parts
from phigen.notation.generating import modified_formulas, series_formulas
from phigen.notation.typesetting import INDENT, LINE, latex, lines, width
from phigen.splitting.matrices import MatrixExponential
from phigen.symbolic.expression import Expression
from phigen.symbolic.readable import SHOWN, Formula

#: An equation in MathML: its left side, and the parts of its right side between which a line may break.
Equation = tuple[str, Sequence[str]]

_PLUS, _EQUALS, _TIMES = "<mo>+</mo>", "<mo>=</mo>", "<mo>&#x2062;</mo>"
_DOTS = f"{_PLUS}<mo>…</mo>"
#: Equations in LaTeX: φ(s), which occurs in the exponential bi-realisation, and β(x, p) = α(x, −p).
_PHI = "  \\varphi(s) &= \\frac{1}{s} \\left( 1 - \\frac{\\sqrt{s}}{2} \\cot \\frac{\\sqrt{s}}{2} \\right)"
_BETA = "  \\beta(x, p) &= \\alpha(x, -p)"
#: Width of an equals sign, and width of the space between two columns of a matrix, in em.
_RELATION, _COLUMN = 1.4, 1.2
#: Largest number of columns of a matrix in amsmath. If π has more, it is displayed as a list of brackets.
_COLUMNS = 10


#: LaTeX of the equations of a step of Gauss collocation.
_COLLOCATION = r"""\begin{align*}
  Z_i &= z + \sum_j \mu_{ij} L_j, \quad L_j = h b_j f(Z_j), \quad \mu_{ij} + \mu_{ji} = 1 \\
  z' &= z + \sum_j L_j
\end{align*}"""


def document(compilation: Compilation, modified: int = 0, most: int | None = SHOWN) -> str:
    """Return LaTeX equations for π, H and Casimirs, for the method, and for the modified Hamiltonian H̃.

    The method is α, β and S_1 … S_k, or the parts and flows of a splitting, or Gauss collocation. Lines are broken to
    fit the text of an article. ``most`` is the largest number of terms displayed of each S_i and of H̃; None displays
    all. ``modified`` is the number of corrections in H̃; for 0, the first correction is displayed if it is cheap to
    compute. Raises `SpecError` if corrections are requested for a method without a modified Hamiltonian.
    """
    blocks = system_blocks(compilation.system)
    blocks += compilation.by_kind(
        lambda series: [*_maps(series), aligned(_series(series, most))],
        _flows,
        lambda gauss: [_COLLOCATION],
    )
    if modified_terms := modified_formulas(compilation, modified, most):
        sums = ["<mi>H</mi>", *(_PLUS + _scaled("H", j) for j, _ in modified_terms), _DOTS]
        tilde = '<mover accent="true"><mi>H</mi><mo>~</mo></mover>'
        blocks.append(aligned([(tilde, sums), *((_indexed("H", j), _pieces(f)) for j, f in modified_terms)]))
    head = f"% {compilation.spec.name}, order {compilation.order.order}; needs amsmath"
    return "\n".join([head, "\\begingroup\\allowdisplaybreaks", *blocks, "\\endgroup"])


def system_blocks(system: System) -> list[str]:
    """Return blocks of LaTeX: displayed equations for π, for H, and for Casimirs and invariants if there are any."""
    blocks = [_tensor(system), aligned(_assigned(["H"], [system.hamiltonian]))]
    if first_integrals := {**system.casimirs, **system.invariants}:
        blocks.append(aligned(_assigned(list(first_integrals), list(first_integrals.values()))))
    return blocks


def _tensor(system: System) -> str:
    """Return π in LaTeX: as a matrix or, if the matrix is too wide, as a list of brackets of coordinates."""
    names, n = system.coordinates, system.dimension
    cells = [[mathml.expression(e) for e in row] for row in system.poisson]
    total_width = sum(max(width(row[j]) for row in cells) + _COLUMN for j in range(n))
    if n <= _COLUMNS and total_width + _COLUMN + width("<mi>π</mi>", _EQUALS) <= LINE:
        body = " \\\\ ".join(" & ".join(latex(cell) for cell in row) for row in cells)
        return f"\\begin{{equation*}}\n  \\pi = \\begin{{pmatrix}} {body} \\end{{pmatrix}}\n\\end{{equation*}}"
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if not system.poisson[i][j].is_zero]
    left = [mathml.bracket(names[i], names[j]) for i, j in pairs]
    return aligned(_equations(left, [system.poisson[i][j] for i, j in pairs]))


def _flows(compilation: CompiledSplitting) -> list[str]:
    """Return blocks of LaTeX: the parts of H with their flows, then the matrix exponentials that the flows contain."""
    parts = [_flow(compilation, k) for k in range(1, len(compilation.splitting.flows) + 1)]
    return [*parts, *(_exponential(number, matrix) for number, matrix in flows.matrices(compilation))]


def _flow(compilation: CompiledSplitting, k: int) -> str:
    """Return the LaTeX equations that define part ``k`` of H and its flow.

    The equations of the flow give the values of the coordinates after the time h.
    """
    flow = compilation.splitting.flows[k - 1]
    new_values = flows.images(compilation, flow)
    pulled = f"<msubsup><mi>Φ</mi><mn>{k}</mn><mi>∗</mi></msubsup>{_TIMES}"
    local = flows.definitions(flow, compilation.system.coordinates)
    left = [*(mathml.component(flow.letter, k, c) for c, _ in local), *(pulled + mathml.name(c) for c in new_values)]
    return aligned(_equations(left, [*(e for _, e in local), *new_values.values()]))


def _exponential(number: str, matrix: MatrixExponential) -> str:
    """Return the LaTeX equations for E = exp(hA) − 1, and for the nonzero entries of its matrix A."""
    entries = flows.rates(number, matrix)
    return aligned([mathml.exponential(number), *_equations([mathml.name(s) for s in entries], list(entries.values()))])


def _maps(compilation: CompiledSeries) -> Iterator[str]:
    """Yield the LaTeX equations for α and β, and for the function φ if α contains it.

    If a bi-realisation integrates paths numerically, the first terms of the series of α and β are displayed.
    """
    realisation, names = compilation.realisation, compilation.system.coordinates
    continuation = [_DOTS] if realisation.path else []
    letters = {"α": realisation.alpha} if realisation.symmetric else {"α": realisation.alpha, "β": realisation.beta}
    for letter, maps in letters.items():
        block = aligned(_equations([mathml.indexed(letter, c) for c in names], maps, continuation))
        yield block
        if "\\varphi" in block and letter == "α":
            yield _align([_PHI])
    if realisation.symmetric:
        yield _align([_BETA])


def _gauged(compilation: CompiledSeries) -> str:
    """Return ``H − λ C =`` in MathML, with which the formula of S_1 begins; "" if no Casimirs are subtracted from H."""
    gauge = compilation.gauge
    factors = [mathml.name(s) for s in gauge.multiples] + [mathml.grouped(value) for value in gauge.fixed.values()]
    parts = zip(factors, (*gauge.free, *gauge.fixed), strict=True)
    subtracted = "".join(f"<mo>−</mo>{factor}{_TIMES}{mathml.name(casimir)}" for factor, casimir in parts)
    return f"<mi>H</mi>{subtracted}{_EQUALS}" if subtracted else ""


def _series(compilation: CompiledSeries, max_terms: int | None) -> Iterator[Equation]:
    series = series_formulas(compilation, max_terms)
    summands = [_PLUS * (n > 0) + _scaled("S", i) for n, (i, _) in enumerate(series.listed)]
    yield _indexed("S", "h"), [*summands, *([f"{_PLUS}<mo>…</mo>"] if series.beyond else [])]
    for i, formula in series.listed:
        first, *remaining = _pieces(formula)
        yield _indexed("S", i), [_gauged(compilation) * (i == 1) + first, *remaining]


def _assigned(names: Sequence[str], expressions: Sequence[Expression]) -> list[Equation]:
    return _equations([mathml.name(n) for n in names], expressions)


def _equations(
    left: Sequence[str], expressions: Sequence[Expression], continuation: Sequence[str] = ()
) -> list[Equation]:
    """Return an equation for each expression, with ``left`` as left sides, then the definitions of named
    subexpressions.

    ``continuation``, such as an ellipsis, is added to each expression.
    """
    formulas = named_parts.readable(expressions)
    equations = [(name, [*mathml.pieces(form), *continuation]) for name, form in zip(left, formulas.forms, strict=True)]
    return [*equations, *((mathml.name(name), mathml.pieces(e)) for name, e in formulas.parts)]


def _pieces(formula: Formula) -> list[str]:
    """Return a polynomial in MathML, in parts between which a line may break. A divisor d becomes a factor 1/d.

    If not all terms are displayed, the last part says how many there are.
    """
    first, *remaining = mathml.pieces(replace(formula, divisor=1))
    all_terms = [first, *remaining]
    if formula.divisor != 1:
        scale = f"<mfrac><mn>1</mn><mn>{formula.divisor}</mn></mfrac>{_TIMES}"
        all_terms = [f"{scale}<mo>(</mo>{first}", *remaining]
        all_terms[-1] += "<mo>)</mo>"
    return [*all_terms, f"<mtext>({formula.size} terms)</mtext>"] if formula.hidden else all_terms


def aligned(equations: Sequence[Equation] | Iterator[Equation]) -> str:
    """Return equations in LaTeX, aligned below one another; long equations are broken into several lines."""
    equation_list = list(equations)
    room = LINE - max(width(left) for left, _ in equation_list) - _RELATION
    broken_lines = []
    for left, right in equation_list:
        first, *remaining = lines(right, room)
        broken_lines += [f"  {latex(left)} &= {first}", *(f"    &{INDENT}{line}" for line in remaining)]
    return _align(broken_lines)


def _align(broken_lines: Sequence[str]) -> str:
    return "\n".join(["\\begin{align*}", " \\\\\n".join(broken_lines), "\\end{align*}"])


def _indexed(letter: str, index: int | str) -> str:
    tag = "mn" if isinstance(index, int) else "mi"
    return f"<msub><mi>{letter}</mi><{tag}>{index}</{tag}></msub>"


def _scaled(letter: str, i: int) -> str:
    """Return the product of h^i and a letter with index i, such as h² S_2, in MathML."""
    power = "<mi>h</mi>" if i == 1 else f"<msup><mi>h</mi><mn>{i}</mn></msup>"
    return f"{power}{_TIMES}{_indexed(letter, i)}"
