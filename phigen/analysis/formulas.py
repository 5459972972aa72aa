"""Formulas in LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from phigen.symbolic.expression import Expression, number, power, product
from phigen.symbolic.readable import Formula, expanded, signed_sum, with_plain_names


def readable_latex(expressions: Sequence[Expression]) -> list[str]:
    """The expressions in LaTeX, expanded where that is shorter."""
    shown = with_plain_names(expressions)
    forms = [[latex(e), *([formula_latex(f)] if f else [])] for f, e in zip(expanded(shown, None), shown, strict=True)]
    return [min(form, key=len) for form in forms]


def formula_latex(formula: Formula) -> str:
    """A formula in LaTeX."""
    monomials = [latex(product(power(b, e) for b, e in m)) for _, m in formula.terms]
    signed = [(c < 0, _term(abs(c), m)) for (c, _), m in zip(formula.terms, monomials, strict=True)]
    more = f" + \\cdots \\text{{ ({formula.size} terms)}}" if formula.hidden else ""
    joined = (signed_sum(signed) if signed else "0") + more
    return joined if formula.divisor == 1 else f"\\frac{{1}}{{{formula.divisor}}} \\left( {joined} \\right)"


def _term(coefficient: Fraction, monomial: str) -> str:
    if monomial == "1":
        return latex(number(coefficient))
    return monomial if coefficient == 1 else f"{latex(number(coefficient))} {monomial}"


def latex(e: Expression) -> str:
    """One expression in LaTeX, by sympy."""
    import sympy

    from phigen.geometry.sympy_bridge import to_sympy

    written = str(sympy.latex(to_sympy(e)))
    return written.replace("κ", r"\kappa").replace("λ", r"\lambda")
