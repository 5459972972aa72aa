"""Formulas as text: polynomials term by term, other expressions with no more parentheses than necessary."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from phigen.symbolic.expression import (
    Expression,
    fold,
    power,
    substitute,
    symbol,
    symbols_of,
    text,
    topological,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.remainders import REMAINDERS
from phigen.symbolic.special import SPECIAL
from phigen.symbolic.symbols import MOMENTUM, Symbol, kind_of, plain
from phigen.symbolic.tower import Poly, Tower, rational

#: Largest number of terms of a displayed formula, by default. An ellipsis stands for further terms.
SHOWN = 8

#: Names of φ, φ' and φ'' in displayed formulas; `phigen.symbolic.special` defines φ.
_GREEK = {name: FUNCTIONS[name].letters.replace("′", "'").replace("″", "''") for name in SPECIAL}

#: Definitions of internal functions that occur in formulas of flows. A definition is displayed below the formulas that
#: contain the function.
UNFAMILIAR = {
    "cosroot": "cosroot(s) = cos √s",
    "sinroot": "sinroot(s) = sin(√s)/√s",
    "arcroot": "arcroot(s) = (√s − sin √s)/√s³",
    "anomaly": "anomaly(t, r, η, β, μ, …) = s with r G1 + η G2 + μ G3 = t, Stumpff functions of β and s",
    "amplitude": "amplitude(t, P, R) = tan(φ/4)/√P, φ = am(√P t) with the modulus √(1 − R/P)",
    "amplitude3": "amplitude3(t, P, R, n) = the integral of S²/(1 − nS²), S = sin(φ)/√P, φ as for amplitude(t, P, R)",
    "exprel": "exprel(s) = (e^s − 1)/s",
    **{
        name: f"{name}(t, a0, …, a3): the coefficient of x^{k} in e^(tx) - 1 modulo x⁴ - a3 x³ - a2 x² - a1 x - a0"
        for k, name in enumerate(REMAINDERS)
    },
    "inv": "inv(s) = 1/s for s > 0",
    "inv0": "inv0(s) = 1/s for s > 0, else 0",
}

#: Largest number of characters of a formula in a message.
LONGEST = 160

#: Formulas with more nodes than this are displayed as they are, without a test whether multiplying out shortens them.
_LARGE = 400


#: A product of powers, as pairs (base, exponent) with rational exponents of either sign.
Monomial = tuple[tuple[Expression, Fraction], ...]


@dataclass(frozen=True)
class Formula:
    """A formula for display: the sum of ``terms``, divided by ``divisor``.

    Each term is a pair (coefficient, monomial). ``hidden`` is the number of further terms, which are replaced by an
    ellipsis.
    """

    divisor: int
    terms: tuple[tuple[Fraction, Monomial], ...]
    hidden: int = 0

    @property
    def size(self) -> int:
        """Number of all terms, including those that are not displayed."""
        return len(self.terms) + self.hidden

    def __str__(self) -> str:
        signed = [(c < 0, _term(abs(c), _monomial(m))) for c, m in self.terms]
        ellipsis = f" + … ({self.size} terms)" if self.hidden else ""
        printed_sum = (signed_sum(signed) if signed else "0") + ellipsis
        if self.divisor == 1:
            return printed_sum
        return (
            f"{printed_sum}/{self.divisor}" if len(signed) == 1 and not ellipsis else f"({printed_sum})/{self.divisor}"
        )


def signed_sum(terms: Iterable[tuple[bool, str]]) -> str:
    """Return the text of a sum of ``terms``: pairs of a sign (true if negative) and the text of the absolute value."""
    printed_sum = "".join(f" {'-' if negative else '+'} {body}" for negative, body in terms)
    return printed_sum[3:] if printed_sum.startswith(" + ") else f"-{printed_sum[3:]}"


def _term(coefficient: Fraction, monomial: str) -> str:
    if monomial == "1":
        return str(coefficient)
    return monomial if coefficient == 1 else f"{coefficient}*{monomial}"


def of_polynomial(
    tower: Tower, element: Poly, max_terms: int | None = SHOWN, small_symbols: Collection[str] = ()
) -> Formula:
    """Return the formula of a polynomial, an element of ``tower``; at most ``max_terms`` terms are displayed.

    If there are more terms, those of the lowest total degree in the ``small_symbols`` are displayed.
    """
    terms = [(rational(c), tuple(int(e) for e in m)) for m, c in element.to_dict().items()]
    divisor = lcm(*(c.denominator for c, _ in terms)) if terms else 1
    if len(terms) == 1 and terms[0][0].denominator == 1:
        divisor = 1
    shown_terms = terms
    if max_terms is not None and len(terms) > max_terms + 1:
        positions = [i for i, name in enumerate(tower.symbols) if name in small_symbols]
        shown_terms = sorted(terms, key=lambda term: sum(term[1][i] for i in positions))[:max_terms]
    variables = with_plain_names([*(symbol(n) for n in tower.symbols), *(g.expression for g in tower.generators)])
    printed_terms = tuple((c * divisor, _factors(variables, exponents)) for c, exponents in shown_terms)
    return Formula(divisor, printed_terms, len(terms) - len(shown_terms))


def readable(
    expressions: Sequence[Expression], max_terms: int | None = SHOWN, small_symbols: Collection[str] = ()
) -> list[str]:
    """Return the expressions as text, multiplied out if that is shorter; covectors are written ``p_NAME``.

    If an expression has more than ``max_terms`` terms, only some of its terms are displayed: those of the lowest degree
    in covectors and ``small_symbols``.
    """
    covectors = (name for name in symbols_of(*expressions) if kind_of(name) == MOMENTUM)
    renamed = with_plain_names(expressions)
    forms = expanded(renamed, max_terms, {plain(name) for name in (*covectors, *small_symbols)})
    texts = [_written(e) for e in renamed]
    return [min((str(f), t), key=len) if f else t for f, t in zip(forms, texts, strict=True)]


def _written(e: Expression) -> str:
    return infix(e) if len(topological([e])) <= _LARGE else text(e)


def infix(e: Expression) -> str:
    """Return the expression as text of any length, with as few parentheses as possible.

    Parsing the result gives an equal expression, but possibly as another tree.
    """

    def wrap(part: tuple[str, int], level: int) -> str:
        return part[0] if part[1] >= level else f"({part[0]})"

    def raised(base: tuple[str, int], exponent: Fraction) -> str:
        if exponent == Fraction(1, 2):
            return f"sqrt({base[0]})"
        if exponent == 1:
            return wrap(base, 3)
        return f"{wrap(base, 4)}**{exponent}" if exponent.denominator == 1 else f"{wrap(base, 4)}**({exponent})"

    def visit(node: Expression, args: list[tuple[str, int]]) -> tuple[str, int]:
        match node.op:
            case "add":
                right = args[1][0]
                joint = f" - {right[1:]}" if right.startswith("-") else f" + {right}"
                return args[0][0] + joint, 1
            case "sub":
                return f"{args[0][0]} - {wrap(args[1], 2)}", 1
            case "neg":
                return f"-{wrap(args[0], 2)}", 1
            case "mul" if node.args[0].is_number and node.args[0].value < 0:
                return f"-{text(-node.args[0])}*{wrap(args[1], 2)}", 1
            case "mul" if args[1][0].startswith("1/") and args[1][1] > 1:
                return f"{wrap(args[0], 2)}/{args[1][0].removeprefix('1/')}", 2
            case "mul":
                return f"{wrap(args[0], 2)}*{wrap(args[1], 2)}", 2
            case "pow" if node.value < 0:
                return f"1/{raised(args[0], -node.value)}", 2
            case "pow":
                return raised(args[0], node.value), 4 if node.value == Fraction(1, 2) else 3
            case "power":
                return f"{wrap(args[0], 4)}**{wrap(args[1], 4)}", 3
            case _ if node.args:
                return f"{_GREEK.get(node.op, node.op)}({', '.join(a for a, _ in args)})", 4
        printed = text(node)
        return printed, 4 if node.op == "symbol" or printed.isidentifier() else 3 if printed.isdigit() else 2

    return fold([e], visit)[0][0]


def with_plain_names(expressions: Sequence[Expression]) -> list[Expression]:
    """Return the expressions, in which each symbol that phigen added is replaced by its name for display (`plain`)."""
    internal = [n for n in symbols_of(*expressions) if isinstance(n, Symbol)]
    return substitute(expressions, {n: symbol(plain(n)) for n in internal})


def shortened(expression: Expression) -> str:
    """Return the expression as text of at most `LONGEST` characters, for messages."""
    return cut(readable([expression])[0])


def cut(text: str) -> str:
    """Return a text, cut with an ellipsis to at most `LONGEST` characters, for messages."""
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def expanded(
    expressions: Sequence[Expression], max_terms: int | None, small_symbols: Collection[str] = ()
) -> Iterator[Formula | None]:
    """Yield the formula of each expression, multiplied out, with common factors of fractions cancelled.

    For an expression that is too large, None is yielded. ``max_terms`` and ``small_symbols`` are those of `readable`.
    """
    for e in expressions:
        if len(topological([e])) > _LARGE:
            yield None
            continue
        tower = Tower(symbols_of(e), [e])
        yield of_polynomial(tower, tower.reduced(tower.convert(e)), max_terms, small_symbols)


def _factors(variables: Sequence[Expression], exponents: Sequence[int]) -> Monomial:
    """Return a monomial as pairs (base, exponent), in the order of the variables.

    A variable that is itself a power, such as 1/r, is replaced by its base, and the exponent is adapted.
    """
    factors = []
    for variable, k in zip(variables, exponents, strict=False):
        if k and variable.op == "pow":
            factors.append((variable.args[0], variable.value * k))
        elif k:
            factors.append((variable, Fraction(k)))
    return tuple(factors)


def _monomial(factors: Monomial) -> str:
    """Return a product of powers as text; all powers with negative exponents are in one denominator."""
    numerator = [_atom(power(b, e)) for b, e in factors if e > 0]
    denominator = [_atom(power(b, -e)) for b, e in factors if e < 0]
    top = "*".join(numerator) or "1"
    if not denominator:
        return top
    return f"{top}/{denominator[0]}" if len(denominator) == 1 else f"{top}/({'*'.join(denominator)})"


def _atom(e: Expression) -> str:
    return f"({_written(e)})" if e.op in ("add", "sub", "neg", "mul") else _written(e)
