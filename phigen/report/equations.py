"""Equations of a page. Depending on their size, they are shown, folded or left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from markupsafe import Markup

from phigen.notation import mathml, named_parts
from phigen.report import page
from phigen.scheme.lowering import operation_counts
from phigen.symbolic.expression import Expression
from phigen.symbolic.readable import SHOWN, Formula

#: The size of a group of formulas is the number of names and numbers in it. The page folds groups larger than FOLDED,
#: and leaves out groups larger than LEFT_OUT.
FOLDED, LEFT_OUT = 160, 4_000
#: Largest number of terms of a polynomial that the page contains completely.
MOST_TERMS = 150


def equation(left: str, form: Formula | Expression, sign: str = "=") -> list[str]:
    """Return an equation as pieces of MathML, between which lines may break."""
    first, *remaining = mathml.pieces(form)
    return [mathml.math(f"{left}<mo>{sign}</mo>{first}"), *map(mathml.math, remaining)]


def group(left: Sequence[str], expressions: Sequence[Expression], subject: str, sign: str = "=") -> Markup:
    """Return equations as HTML. ``left`` contains the left-hand sides as MathML.

    Common subexpressions get names. A large group of equations is folded under the title ``subject``. A very large one
    is replaced by a note, which begins with ``subject``.
    """
    formulas = named_parts.readable(expressions)
    if formulas.size > LEFT_OUT:
        counts = ", ".join(f"{n} {kind}" for kind, n in operation_counts(list(expressions)).items() if n)
        return page.paragraph(f"{subject}: {len(left)} formulas of {counts}; phigen show prints them.", "note")
    equations = page.equations([equation(name, form, sign) for name, form in zip(left, formulas.forms, strict=True)])
    if formulas.parts:
        definitions = page.equations([equation(mathml.name(name), e) for name, e in formulas.parts])
        equations = page.joined([equations, page.paragraph("where"), definitions])
    return equations if formulas.size <= FOLDED else page.fold(subject, equations)


def polynomial(left: str, formula: Formula) -> Markup:
    """Return one equation. A long polynomial is abbreviated; up to `MOST_TERMS` terms can be unfolded."""
    if formula.size <= SHOWN + 1:
        return page.equations([equation(left, formula)])
    cut = replace(formula, terms=formula.terms[:SHOWN], hidden=formula.size - SHOWN)
    abbreviated = page.equations([equation(left, cut)])
    if formula.size > MOST_TERMS:
        return page.joined(
            [abbreviated, page.paragraph(f"{formula.size} terms; phigen show --full prints them.", "note")]
        )
    return page.joined([abbreviated, page.fold(f"All {formula.size} terms", page.equations([equation(left, formula)]))])
