"""LaTeX: how formulas look, and line breaks that fit the page."""

import re
import shutil
import subprocess
from fractions import Fraction

import pytest
from support import compiled

from phigen.notation import mathml
from phigen.notation.latex import document
from phigen.notation.typesetting import INDENTED, latex, lines, width
from phigen.symbolic.expression import call, power, symbol, total
from phigen.symbolic.symbols import GAUGE, Symbol, momentum

x, y, p = symbol("x"), symbol("px"), symbol(momentum("x1"))
NAMES = [symbol(f"x{i}") for i in range(1, 31)]
LONG = total(NAMES)
#: Systems whose formulas are hard to set: wide tensors, nested parentheses, long fractions, exponents and roots, paths,
#: splittings.
WIDE = ("kepler", "poisson_not_hamiltonian", "sklyanin_gyrostat", "toda3_quadratic", "gaussian_moments", "spin_chain5")


@pytest.mark.parametrize(
    ("e", "written"),
    [
        (x**2 / 2 - x, "\\frac{x^{2}}{2} - x"),
        (y * x, "\\mathit{px} \\cdot x"),
        (y**2, "\\mathit{px}^{2}"),
        (p * symbol("omega_1"), "\\omega_{1} p_{x_{1}}"),
        (call("sin", x / 2), "\\sin \\left( \\frac{x}{2}\\right)"),
        (call("sin", x) ** 2, "\\sin^{2}(x)"),
        (call("atanh", x), "\\operatorname{artanh}(x)"),
        (call("phi0", x), "\\varphi (x)"),
        (power(x + 1, Fraction(5, 2)), "(1 + x)^{5/2}"),
        (power(x, Fraction(1, 3)), "\\sqrt[3]{x}"),
        (call("abs", -x), "|-x|"),
        (symbol(Symbol(GAUGE, "C")) * symbol("κ"), "\\lambda_{C} \\kappa"),
    ],
)
def test_formulas_look_as_on_paper(e, written):
    assert latex(mathml.expression(e)) == written


def plain(text):
    """Remove what line breaks may change: sizes of parentheses, signs of products, spaces."""
    return re.sub(r"\\(left|right|biggl|biggr|cdot)(?![a-z])|\s", "", text)


@pytest.mark.parametrize(
    "e",
    [
        LONG,
        x * LONG,
        call("sin", LONG),
        call("sin", x / 2 + LONG) * (x - LONG),
        x + power(LONG, 7) + y,
        (x + y) * (x - y + call("cos", LONG * (1 - LONG))),
    ],
    ids=["sum", "product", "argument", "tall", "power", "nested"],
)
def test_long_formulas_are_broken_and_keep_every_part(e):
    markup, room = mathml.pieces(e), 20.0
    broken = lines(markup, room)
    assert len(broken) > 2
    assert plain("".join(broken)) == plain(latex(*markup))
    for line in broken:
        # A letter with an index is about one em wide, and a sign with its spaces is another em wide.
        assert len(re.findall(r"x_|\\mathit|[-+]", line)) <= room


@pytest.mark.parametrize(
    ("e", "begins"),
    [
        (LONG / 7, "\\frac{1}{7} (x_{1}"),
        (power(LONG, Fraction(1, 2)), "(x_{1}"),
        (call("exp", LONG), "\\exp (x_{1}"),
        (x / LONG, "x \\Big/ (x_{1}"),
    ],
    ids=["fraction", "root", "exponential", "denominator"],
)
def test_what_cannot_be_broken_is_opened(e, begins):
    broken = lines([mathml.expression(e)], 20.0)
    assert broken[0].startswith(begins)
    assert max(line.count("x_") for line in broken) < 14
    assert sum(line.count("x_") for line in broken) == len(NAMES)


def test_estimated_widths_are_those_of_lines():
    short = mathml.pieces(total(NAMES[:5]))
    assert lines(short, width(*short)) == [latex(*short)]
    assert len(lines(short, width(*short) - 0.1)) == 2
    assert INDENTED > 0


def test_all_terms_of_long_polynomials_are_there():
    text = document(compiled("rigid_body"), most=None)
    assert "\\cdots" not in text.partition("\\tilde{H}")[0]


@pytest.mark.skipif(not shutil.which("pdflatex"), reason="needs pdflatex")
@pytest.mark.parametrize("size", [10, 12])
def test_fragments_compile_and_fit_the_text_of_an_article(tmp_path, size):
    fragments = [document(compiled(name)) for name in WIDE]
    body = "\n\nText.\n\n".join(fragments)
    head = f"\\documentclass[{size}pt]{{article}}\\usepackage{{amsmath}}\\begin{{document}}"
    (tmp_path / "a.tex").write_text(f"{head}\n{body}\n\\end{{document}}\n", encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "a.tex"]
    process = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    log = (tmp_path / "a.log").read_text(encoding="utf-8", errors="replace")
    assert process.returncode == 0, log[-2000:]
    assert re.findall(r"Overfull.*", log) == []
