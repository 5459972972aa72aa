"""Arithmetic of polynomials in functions, by sympy, for the second derivation of the series, which checks the compiler.

A *function* is a variable of these polynomials: x, a parameter, exp(x), sin(x), π, or a power 1/b, b^{1/q} or b^{cx}. A
power whose exponent is a sum becomes a product of powers. Likewise tan u becomes sin u/cos u, tanh u becomes sinh
u/cosh u, and |u| becomes u sign u.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from math import prod
from typing import Any

import mpmath
import sympy
from sympy.polys.rings import ring

#: Largest number of terms of a polynomial. If it is exceeded, the derivation ends with an error, since the next product
#: would take minutes.
MOST_TERMS = 200_000

_DIGITS = 50

_QUOTIENTS = {
    sympy.tan: (sympy.sin, sympy.cos),
    sympy.cot: (sympy.cos, sympy.sin),
    sympy.tanh: (sympy.sinh, sympy.cosh),
}


class Sign(sympy.Function):  # type: ignore[misc]
    """The function sign(u), with derivative 0. The derivative of the function sign of sympy has a Dirac delta."""

    @classmethod
    def eval(cls, u: Any) -> Any:
        """Return sign(u) if u is a number, −sign(−u) if u has a minus sign; None leaves sign(u) as it is."""
        if u.is_number:
            return sympy.sign(u)
        return -cls(-u) if u.could_extract_minus_sign() else None

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative, which is 0."""
        return sympy.Integer(0)


def derivative(f: Any, variable: Any) -> Any:
    """Return the partial derivative of a sympy expression.

    Before the differentiation, sign u is replaced by Sign(u), and |u| by u Sign(u); see `Sign`.
    """
    if f.has(sympy.Abs, sympy.sign):
        f = f.replace(sympy.Abs, lambda u: u * Sign(u)).replace(sympy.sign, Sign)
    return sympy.diff(f, variable)


class Functions:
    """The ring of polynomials over Q in the functions that occur in ``expressions``."""

    def __init__(self, expressions: Iterable[Any]) -> None:
        functions: dict[Any, None] = {}
        _list_functions(expressions, functions)
        symbols = [sympy.Dummy() for _ in functions] or [sympy.Dummy()]
        self.ring, *generators = ring(symbols, sympy.QQ)
        self._generators = dict(zip(functions, generators, strict=False))
        self._written = dict(zip(symbols, functions, strict=False))
        self._known: dict[Any, Any] = {}

    def __iter__(self) -> Any:
        return iter(self._generators)

    def element(self, e: Any) -> Any:
        """Return the element of the ring that is equal to a sympy expression."""
        if e not in self._known:
            self._known[e] = self._element(e)
        return self._known[e]

    def _element(self, e: Any) -> Any:
        if e in self._generators:
            return self._generators[e]
        if e.is_Rational:
            return self.ring.ground_new(self.ring.domain.from_sympy(e))
        if e.is_Add:
            return self.total(map(self.element, e.args))
        return prod((self.element(f) ** n for f, n in _factors(e)), start=self.ring.one)

    def expression(self, element: Any) -> Any:
        """Return an element of the ring as a sympy expression; sympy cancels products such as x · (1/x)."""
        return element.as_expr().xreplace(self._written)

    def total(self, elements: Iterable[Any]) -> Any:
        """Return the sum of elements. Raises `OverflowError` if it has more than `MOST_TERMS` terms."""
        result: dict[Any, Any] = {}
        for element in elements:
            for monomial, c in element.items():
                result[monomial] = result[monomial] + c if monomial in result else c
            if len(result) > MOST_TERMS:
                raise OverflowError(f"more than {MOST_TERMS} terms")
        return self.ring.from_dict({monomial: c for monomial, c in result.items() if c})

    def split(self, element: Any, variables: Sequence[Any]) -> dict[tuple[int, ...], Any]:
        """Return an element as a polynomial in the functions ``variables``: a map from exponents to
        coefficients.

        The coefficients are elements too.
        """
        positions = [self.ring.gens.index(self._generators[f]) for f in variables]
        parts: dict[tuple[int, ...], dict[Any, Any]] = {}
        for m, c in element.items():
            remainder = tuple(0 if k in positions else e for k, e in enumerate(m))
            parts.setdefault(tuple(m[k] for k in positions), {})[remainder] = c
        return {mu: self.ring.from_dict(part) for mu, part in parts.items()}

    def vanishes(self, element: Any) -> bool:
        """Return whether the element is proved to be 0 wherever it is defined.

        False is no proof of the contrary: the relations between the functions did not reduce the element to 0.
        """
        # The functions are treated in reverse order, since the relation of a function contains earlier functions only.
        for f in reversed(self._generators):
            relation = _relation(f)
            if relation is None:
                continue
            power, value = relation
            parts = {e: c for (e,), c in self.split(element, [f]).items()}
            if set(parts) <= {0}:
                continue
            generator, g = self._generators[f], self.element(value)
            if power < 0:  # f = 1/g: multiplication of the element by a power of g removes f
                top = max(parts)
                element = self.total(c * g ** (top - e) for e, c in parts.items())
            else:  # f^power = g: higher powers of f are replaced by powers of g
                element = self.total(c * generator ** (e % power) * g ** (e // power) for e, c in parts.items())
        return bool(element == 0)

    def seems_zero(self, element: Any) -> bool:
        """Whether the value of the element at one point is 0 up to rounding: a fast test, which proves nothing."""
        symbols = sorted(set().union(*(f.free_symbols for f in self._generators)), key=str)
        point = [sympy.Rational(7 + 3 * k, 5 + 2 * k) for k in range(len(symbols))]
        with mpmath.workdps(_DIGITS):
            functions = sympy.lambdify(symbols, list(self._generators), modules=[{"Sign": mpmath.sign}, "mpmath"])
            try:
                values = functions(*(mpmath.mpf(v.p) / v.q for v in point))
            except (ArithmeticError, ValueError):
                return False
            terms = [
                mpmath.mpf(int(c.numerator)) / int(c.denominator) * _monomial(values, m) for m, c in element.items()
            ]
            return bool(abs(sum(terms)) <= mpmath.mpf(10) ** (-_DIGITS // 2) * sum(map(abs, terms)))


def _monomial(values: Sequence[Any], exponents: Sequence[int]) -> Any:
    return prod(v**e for v, e in zip(values, exponents, strict=False) if e)


@lru_cache(maxsize=4096)
def expanded(e: Any) -> Any:
    """Return a sympy expression, multiplied out as a sum of products of functions."""
    if e.is_Atom:
        return e
    functions = Functions([e])
    return functions.expression(functions.element(e))


def _list_functions(expressions: Iterable[Any], functions: dict[Any, None]) -> None:
    """Add the functions that occur in the expressions to ``functions``.

    A function comes after the functions that occur in its `_relation`.
    """
    for e in expressions:
        if e in functions or e.is_Rational:
            continue
        parts = [(a, 1) for a in e.args] if e.is_Add else _factors(e)
        if parts != [(e, 1)]:
            _list_functions([a for a, _ in parts], functions)
            continue
        relation = _relation(e)
        _list_functions([relation[1]] if relation else [], functions)
        functions[e] = None


def _relation(f: Any) -> tuple[int, Any] | None:
    """Return the relation of a function f: (q, g) if f^q = g with q > 1, (−1, g) if f g = 1, None if it has none."""
    if isinstance(f, sympy.sin):
        return 2, 1 - sympy.cos(*f.args) ** 2
    if isinstance(f, sympy.cosh):
        return 2, 1 + sympy.sinh(*f.args) ** 2
    if isinstance(f, Sign):
        return 2, sympy.Integer(1)
    base, exponent = f.as_base_exp()
    if exponent.could_extract_minus_sign():
        return -1, base**-exponent
    return (int(exponent.q), base) if exponent.is_Rational and exponent != 1 else None


def _factors(e: Any) -> list[tuple[Any, int]]:
    """Return the factors of an expression as pairs (factor, exponent). For a function f, the result is [(f, 1)]."""
    if e.is_Mul:
        return [(a, 1) for a in e.args]
    if isinstance(e, sympy.Abs | sympy.sign):
        u = e.args[0]
        return [(u, 1), (Sign(u), 1)] if isinstance(e, sympy.Abs) else [(Sign(u), 1)]
    if type(e) in _QUOTIENTS:
        numerator, denominator = _QUOTIENTS[type(e)]
        return [(numerator(*e.args), 1), (1 / denominator(*e.args), 1)]
    if e.is_Pow or isinstance(e, sympy.exp):
        base, exponent = e.as_base_exp()
        terms = sympy.Add.make_args(expanded(exponent))
        return [pair for term in terms for pair in _powers(expanded(base), term)]
    return [(e.func(*map(expanded, e.args)) if e.args else e, 1)]


def _powers(base: Any, exponent: Any) -> list[tuple[Any, int]]:
    """Return the factors of base^exponent as pairs (factor, exponent).

    If the exponent is a number, a common factor of the coefficients of the base is split off: √(2x+2) becomes √2
    √(x+1). So √(2x+2) and √(x+1) contain the same function √(x+1).
    """
    c, m = exponent.as_coeff_Mul(rational=True)
    if m != 1:
        return [(base ** (sympy.sign(c) * m / c.q), abs(int(c.p)))]
    quotient, remainder = divmod(int(c.p), int(c.q))
    content, primitive = (sympy.S.One, base) if base.is_number else base.primitive()
    powers = [(content**c, 1), (primitive ** sympy.Rational(1, c.q), remainder)]
    if quotient > 0:
        powers.append((primitive, quotient))
    elif primitive.could_extract_minus_sign():
        powers += [(sympy.Integer(-1) ** quotient, 1), (1 / -primitive, -quotient)]
    else:
        powers.append((1 / primitive, -quotient))
    return [(f, n) for f, n in powers if n and f != 1]
