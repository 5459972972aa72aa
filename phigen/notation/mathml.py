"""Formulas as MathML Core, which browsers display without additional scripts or fonts.

An expression is first converted to a sum of terms; a term is a coefficient with factors above and below a fraction
line. So signs and quotients look as on paper, whatever the structure of the expression tree. Each function that returns
markup returns exactly one element, unless its docstring says otherwise. All text in markup is escaped.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from html import escape
from itertools import pairwise
from typing import Any

from phigen.symbolic.expression import Expression, familiar, fold, natural_key
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.readable import Formula
from phigen.symbolic.symbols import GAUGE, PART, Symbol

#: A part of a formula is replaced by an ellipsis if its markup has more characters than this.
LONGEST = 60_000

#: A polynomial with at most this number of terms is reordered if it would begin with a minus sign.
FEW = 4

#: A power of e is written as exp(…) if the markup of its exponent has more characters than this.
_LONG_EXPONENT = 250

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η", "theta": "θ",
    "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ",
    "upsilon": "υ", "phi": "φ", "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ",
    "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π", "Sigma": "Σ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω",
}  # fmt: skip
#: Letters for kinds of symbols that phigen adds: multipliers λ of Casimirs, and named subexpressions σ.
_OWN = {GAUGE: "λ", PART: "σ"}

# operators that browsers do not draw: multiplication, and the application of a function to its argument
_TIMES, _APPLY = "<mo>&#x2062;</mo>", "<mo>&#x2061;</mo>"
_DOT, _DOTS = "<mo>·</mo>", "<mo>…</mo>"


@dataclass(frozen=True)
class Factor:
    """Factor of a term, in markup: a ``base`` with an ``index``, and a ``tail`` such as the argument of a function.

    ``terms`` are the terms of a base that is a sum in parentheses. ``word`` marks a name of several letters, which is
    separated from other factors by a dot; ``raised`` marks a power, which needs parentheses before a further exponent.
    Factors are sorted by ``key``.
    """

    base: str
    index: str = ""
    tail: str = ""
    terms: tuple[FractionTerm, ...] = ()
    word: bool = False
    raised: bool = False
    key: tuple[Any, ...] = ()

    @property
    def markup(self) -> str:
        """Markup of the factor inside a product; a factor that is a sum has parentheses."""
        base = f"<msub>{self.base}{self.index}</msub>" if self.index else self.base
        return _row(base + self.tail) if self.tail else base

    @property
    def alone(self) -> str:
        """Markup of the factor as the only factor of a term: a sum has no parentheses."""
        return summed(self.terms) if self.terms else self.markup

    def power(self, exponent: str) -> Factor:
        """Return a power of this factor; ``exponent`` is markup."""
        if self.raised:
            return Factor(_parentheses(self.markup)).power(exponent)
        kind, index = ("msubsup", self.index) if self.index else ("msup", "")
        return Factor(f"<{kind}>{self.base}{index}{exponent}</{kind}>", tail=self.tail, raised=True, key=self.key)


@dataclass(frozen=True)
class FractionTerm:
    """Term of a sum: ``coefficient`` times the product of ``above``, divided by the product of ``below``."""

    coefficient: Fraction
    above: tuple[Factor, ...] = ()
    below: tuple[Factor, ...] = ()

    @property
    def magnitude(self) -> str:
        """Markup of the absolute value of the term."""
        c = abs(self.coefficient)
        top, bottom = (c, Fraction(1)) if _is_decimal(c) else (Fraction(c.numerator), Fraction(c.denominator))
        above = _product(top, self.above)
        if len(self.above) == 1 and self.above[0].terms and "<mfrac" in above and not self.below and bottom != 1:
            return _row(number(top / bottom) + _TIMES + self.above[0].markup)  # ½(…): no fraction in a numerator
        return f"<mfrac>{above}{_product(bottom, self.below)}</mfrac>" if self.below or bottom != 1 else above


Sum = tuple[FractionTerm, ...]


def terms_of(e: Expression) -> Sum:
    """Return the expression as a sum of terms; empty if it is 0."""
    return fold(familiar([e]), _visit)[0]


def terms_of_formula(formula: Formula) -> Sum:
    """Return the terms of a formula, without its divisor. If the formula hides terms, an ellipsis is the last term."""
    terms: list[FractionTerm] = []
    for c, monomial in formula.terms:
        terms += _times((FractionTerm(c),), *(_power(terms_of(base), exponent) for base, exponent in monomial))
    ordered_terms = _positive_first(terms) if len(terms) <= FEW else tuple(terms)
    return (*ordered_terms, *_one(Factor(_DOTS))) if formula.hidden else ordered_terms


def expression(e: Expression) -> str:
    """Return the markup of an expression."""
    return summed(terms_of(e))


def summed(terms: Sequence[FractionTerm]) -> str:
    """Return the markup of the sum of terms; 0 if there are none."""
    if not terms:
        return number(Fraction(0))
    first, *remaining = terms
    if not remaining and first.coefficient > 0:
        return first.magnitude
    signed = "".join(f"<mo>{_sign(t)}</mo>{t.magnitude}" for t in remaining)
    return _row(("<mo>−</mo>" if first.coefficient < 0 else "") + first.magnitude + signed)


def pieces(e: Expression | Formula) -> list[str]:
    """Return the markup of a formula in parts between which a line may break: the terms of its outermost sum.

    Each part becomes an element ``<math>`` of its own, and the sequence of these elements displays the formula.
    """
    if isinstance(e, Expression):
        return _pieces(terms_of(e))
    terms = terms_of_formula(e)
    return _pieces(terms if e.divisor == 1 else _times((FractionTerm(Fraction(1, e.divisor)),), terms))


def math(markup: str) -> str:
    """Return an element ``<math>`` that displays markup as a formula."""
    return f'<math displaystyle="true">{markup}</math>'


def name(identifier: str) -> str:
    """Return the markup of a name: ``omega_1`` is ω with index 1, ``p:x1`` is p with index x_1."""
    return _name(identifier).markup


def dotted(identifier: str) -> str:
    """Return the markup of the time derivative of a name: a dot over a letter, the quotient d…/dt for a word."""
    factor = _name(identifier)
    if factor.word:
        return f"<mfrac>{_row('<mi>d</mi>' + factor.markup)}{_row('<mi>d</mi><mi>t</mi>')}</mfrac>"
    return replace(factor, base=f'<mover accent="true">{factor.base}<mo>˙</mo></mover>').markup


def number(value: Fraction) -> str:
    """Return the markup of a number ≥ 0: an integer, a fraction, or a decimal if the fraction would have many
    digits."""
    if value.denominator == 1:
        return f"<mn>{value.numerator}</mn>"
    if not _is_decimal(value):
        return f"<mfrac><mn>{value.numerator}</mn><mn>{value.denominator}</mn></mfrac>"
    digits = next(k for k in range(1, 1000) if (value * 10**k).denominator == 1)
    digit_string = str(int(value * 10**digits)).rjust(digits + 1, "0")
    return f"<mn>{digit_string[:-digits]}.{digit_string[-digits:]}</mn>"


def grouped(e: Expression) -> str:
    """Return the markup of an expression as a factor: in parentheses if it is a sum or negative."""
    terms = terms_of(e)
    return summed(terms) if len(terms) == 1 and terms[0].coefficient > 0 else _parentheses(summed(terms))


def matrix(rows: Sequence[Sequence[Expression]]) -> str:
    """Return the markup of a matrix, in parentheses."""
    body = "".join("<mtr>" + "".join(f"<mtd>{expression(e)}</mtd>" for e in row) + "</mtr>" for row in rows)
    return _parentheses(f"<mtable>{body}</mtable>")


def indexed(letter: str, index: str) -> str:
    """Return the markup of a letter with a name as its index: α_{x_1}."""
    return f"<msub><mi>{escape(letter)}</mi>{name(index)}</msub>"


def component(letter: str, k: int, c: str) -> str:
    """Return the markup of a letter with the index ``k``, such as H_2.

    If ``c`` is the name of a coordinate, it becomes an exponent, as in F_3^{x}; with "" there is no exponent.
    """
    if not c:
        return f"<msub><mi>{escape(letter)}</mi><mn>{k}</mn></msub>"
    return f"<msubsup><mi>{escape(letter)}</mi><mn>{k}</mn>{name(c)}</msubsup>"


def bracket(a: str, b: str) -> str:
    """Return the markup of the Poisson bracket {a, b} of two coordinates."""
    return _row(f'<mo stretchy="false">{{</mo>{name(a)}<mo>,</mo>{name(b)}<mo stretchy="false">}}</mo>')


def _visit(node: Expression, args: list[Sum]) -> Sum:
    match node.op:
        case "number":
            return (FractionTerm(node.value),) if node.value else ()
        case "symbol":
            return _one(_name(node.value))
        case "pi" | "E":
            return _one(Factor("<mi>π</mi>" if node.op == "pi" else "<mi>e</mi>"))
        case "add":
            return _sorted(args[0] + args[1])
        case "sub":
            return _sorted(args[0] + _negated(args[1]))
        case "neg":
            return _negated(args[0])
        case "mul":
            return _times(*args)
        case "pow":
            return _power(args[0], node.value)
        case "power":
            return _one(_base(args[0]).power(summed(args[1])))
        case "exp" if len(summed(args[0])) <= _LONG_EXPONENT:
            return _one(Factor("<mi>e</mi>").power(summed(args[0])))
        case "abs":
            return _one(Factor(_row(f"<mo>|</mo>{summed(args[0])}<mo>|</mo>")))
    return _called(node.op, args)


def _called(function: str, args: Sequence[Sum]) -> Sum:
    arguments = _parentheses("<mo>,</mo>".join(summed(a) for a in args))
    return _one(Factor(f"<mi>{escape(FUNCTIONS[function].letters or function)}</mi>", tail=_APPLY + arguments))


def _power(base: Sum, exponent: Fraction) -> Sum:
    if exponent < 0:
        below = _single(_power(base, -exponent))
        if below.coefficient == 0:  # a division by zero in the formula is displayed as 1/0
            return _one(Factor("<mfrac><mn>1</mn><mn>0</mn></mfrac>"))
        return (FractionTerm(1 / below.coefficient, below.below, below.above),)
    if exponent == 1 or not base:
        return base
    if exponent == Fraction(1, 2):
        return _one(Factor(f"<msqrt>{summed(base)}</msqrt>"))
    if exponent.numerator == 1:
        return _one(Factor(f"<mroot>{summed(base)}<mn>{exponent.denominator}</mn></mroot>"))
    top = f"<mn>{exponent.numerator}</mn>"
    is_integer = exponent.denominator == 1
    return _one(_base(base).power(top if is_integer else _row(f"{top}<mo>/</mo><mn>{exponent.denominator}</mn>")))


def _times(*factors: Sum) -> Sum:
    result = FractionTerm(Fraction(1))
    for terms in factors:
        t = _single(terms)
        result = FractionTerm(result.coefficient * t.coefficient, result.above + t.above, result.below + t.below)
    above, below = (_collected(sorted(fs, key=lambda f: _key([f]))) for fs in (result.above, result.below))
    return _bounded((FractionTerm(result.coefficient, above, below),)) if result.coefficient else ()


def _collected(factors: Sequence[Factor]) -> tuple[Factor, ...]:
    """Return the factors. Equal factors are combined to a power, unless they are powers already."""
    counts = Counter(factors)
    powers = {f: f.power(f"<mn>{n}</mn>") for f, n in counts.items() if n > 1 and not f.raised}
    return tuple(powers.get(f, f) for f, n in counts.items() for _ in range(1 if f in powers else n))


def _single(terms: Sum) -> FractionTerm:
    """Return a sum as one term: a sum of several terms becomes a factor in parentheses."""
    if len(terms) == 1:
        return terms[0]
    return FractionTerm(Fraction(1), (_enclosed(terms),)) if terms else FractionTerm(Fraction(0))


def _base(terms: Sum) -> Factor:
    """Return a sum as the base of a power, in parentheses unless it is a single factor or a positive integer."""
    if len(terms) == 1 and not terms[0].below:
        c, above = terms[0].coefficient, terms[0].above
        if len(above) == 1 and c == 1:
            return above[0]
        if not above and c.denominator == 1 and c > 0:
            return Factor(number(c))
    return _enclosed(terms)


def _enclosed(terms: Sum) -> Factor:
    return Factor(_parentheses(summed(terms)), terms=terms)


def _sorted(terms: Sum) -> Sum:
    """Return the terms of a sum in the order of display, with like terms added up.

    Monomials come first, sorted by their names; other terms keep their order.
    """
    sums: dict[tuple[tuple[Factor, ...], tuple[Factor, ...]], Fraction] = {}
    for t in terms:
        sums[t.above, t.below] = sums.get((t.above, t.below), Fraction(0)) + t.coefficient
    constant = sums.pop(((), ()), Fraction(0))
    nonzero = [FractionTerm(c, above, below) for (above, below), c in sums.items() if c]
    ordered = sorted(nonzero, key=lambda t: _key((*t.above, *t.below)))
    if constant > 0:
        return _bounded((FractionTerm(constant), *ordered))
    return _bounded(_positive_first([*ordered, FractionTerm(constant)] if constant else ordered))


def _positive_first(terms: list[FractionTerm]) -> Sum:
    """Return the terms with the first positive term moved to the front: b − a instead of −a + b."""
    position = next((i for i, t in enumerate(terms) if t.coefficient > 0), 0)
    return (*terms[position : position + 1], *terms[:position], *terms[position + 1 :])


def _key(factors: Sequence[Factor]) -> tuple[Any, ...]:
    has_keys = all(f.key for f in factors)
    return not has_keys, tuple(f.key for f in factors if has_keys)


def _bounded(terms: Sum) -> Sum:
    size = sum(len(f.markup) for t in terms for f in (*t.above, *t.below))
    return terms if size <= LONGEST else _one(Factor(_DOTS))


def _negated(terms: Sum) -> Sum:
    return tuple(replace(t, coefficient=-t.coefficient) for t in terms)


def _one(factor: Factor) -> Sum:
    return (FractionTerm(Fraction(1), (factor,)),)


def exponential(number: str) -> tuple[str, list[str]]:
    """Return the equation E = exp(hA) − 1 in markup: its left side, and the two parts of its right side.

    The number of the matrix, ``number``, follows the letters E and A; it is "" if there is only one matrix.
    """
    left, rates = (f"<mi>{letter}{number}</mi>" for letter in "EA")
    return left, [f"<msup><mi>e</mi><mrow><mi>h</mi>{_TIMES}{rates}</mrow></msup>", "<mo>−</mo><mn>1</mn>"]


def _name(identifier: str) -> Factor:
    key = natural_key(identifier)
    if isinstance(identifier, Symbol):
        letter = _OWN.get(identifier.kind, identifier.kind)
        index = "".join(name(k) if isinstance(k, str) else name(str(k)) for k in identifier.key)
        return Factor(f"<mi>{escape(letter)}</mi>", index=index, key=key)
    if identifier.isdigit():
        return Factor(f"<mn>{identifier}</mn>")
    if identifier.endswith("]"):
        return _at_neighbour(identifier, key)
    match = re.fullmatch(r"([^\W\d_]+)_?([0-9]+)|([^\W_]+)_(\w+)", identifier)
    stem, index = (match[1] or match[3], match[2] or match[4]) if match else (identifier, "")
    letter = _GREEK.get(stem, stem)
    return Factor(f"<mi>{escape(letter)}</mi>", index=name(index) if index else "", word=len(letter) > 1, key=key)


def _at_neighbour(identifier: str, key: Any) -> Factor:
    """Return the factor for a value at a neighbour: ``x[i+1,j]`` is x with the index i+1, j.

    For a name that has an index, such as ``x1``, the index of the neighbour follows that of the name.
    """
    name_, _, index = identifier[:-1].partition("[")
    base = _name(name_)
    signs = {"+": "<mo>+</mo>", "-": "<mo>−</mo>", ",": "<mo>,</mo>"}
    parts = [signs.get(part) or name(part) for part in re.split(r"([+,-])", index)]
    return replace(base, index=_row((f"{base.index}<mo>,</mo>" if base.index else "") + "".join(parts)), key=key)


def _product(coefficient: Fraction, factors: Sequence[Factor]) -> str:
    if not factors:
        return number(coefficient)
    if len(factors) == 1 and coefficient == 1:
        return factors[0].alone
    product = factors[0].markup if coefficient == 1 else f"{number(coefficient)}{_TIMES}{factors[0].markup}"
    for left_factor, right_factor in pairwise(factors):
        product += (_DOT if left_factor.word or right_factor.word else _TIMES) + right_factor.markup
    return _row(product)


def _pieces(terms: Sum) -> list[str]:
    """Return the terms of a sum as markup, each with its sign.

    If the sum is a single product, and one factor is a sum of more than three terms, the terms of this factor are
    returned. The other factors and the opening parenthesis are put before the first term. The closing parenthesis is
    put after the last term.
    """
    inner = next((f for f in terms[0].above if len(f.terms) > 3), None) if len(terms) == 1 else None
    if inner is None:
        return [summed(terms[:1]), *(f'<mo form="infix">{_sign(t)}</mo>{t.magnitude}' for t in terms[1:])]
    factor = replace(terms[0], above=tuple(f for f in terms[0].above if f is not inner))
    if factor == FractionTerm(Fraction(1)):
        return _pieces(inner.terms)
    scale = "" if factor in (FractionTerm(Fraction(1)), FractionTerm(Fraction(-1))) else factor.magnitude + _TIMES
    minus = "<mo>−</mo>" if factor.coefficient < 0 else ""
    first, *middle, last = _pieces(inner.terms)
    return [f'{minus}{scale}<mo stretchy="false">(</mo>{first}', *middle, f'{last}<mo stretchy="false">)</mo>']


def _sign(term: FractionTerm) -> str:
    return "−" if term.coefficient < 0 else "+"


def _is_decimal(value: Fraction) -> bool:
    """Whether a number is displayed as a decimal: 0.6667 is easier to read than 6667/10000."""
    cofactor = value.denominator
    for prime in (2, 5):
        while cofactor % prime == 0:
            cofactor //= prime
    return cofactor == 1 and value.denominator > 1000 and value.denominator % 5 == 0


def _parentheses(markup: str) -> str:
    flat = "" if any(tall in markup for tall in ("<mfrac", "<msqrt", "<mroot", "<mtable")) else ' stretchy="false"'
    return _row(f"<mo{flat}>(</mo>{markup}<mo{flat}>)</mo>")


def _row(markup: str) -> str:
    return f"<mrow>{markup}</mrow>"
