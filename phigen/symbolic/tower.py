"""The differential ring in which phigen computes: polynomials over Q in symbols and in values of functions.

H or π may contain functions that are not polynomial, such as ``exp(x)``, ``1/(x**2+1)`` or ``sqrt(l)``. Each
value of a function that is not polynomial is one more variable of the ring, a *generator*. The derivatives of
generators are again elements of the ring. So one fast arithmetic of polynomials serves every Hamiltonian. Generators
satisfy relations, such as r·f = 1 for r = 1/f, w² = q for w = √q, and sin² + cos² = 1. `Tower.is_zero` uses the
relations to decide whether an element is 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx

from phigen import progress
from phigen.symbolic import budgets
from phigen.symbolic.arithmetic import Arithmetic
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import (
    EULER,
    ONE,
    PI,
    Expression,
    call,
    number,
    power,
    sparse_derivatives,
    symbol,
    topological,
)
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.horner import horner
from phigen.symbolic.numeric import DomainError, evaluate
from phigen.symbolic.special import SPECIAL, coefficient, order_of
from phigen.symbolic.symbols import Symbol

#: Reducing an element by the relations takes minutes if it contains seven roots. So an element with at least
#: MANY_GENERATORS generators is first evaluated at a point. Its value counts as nonzero if it is larger than ROUNDING
#: times the sum of the absolute values of its terms.
MANY_GENERATORS, ROUNDING = 5, 1e-9

#: An element of a tower: ``flint.fmpq_mpoly``. Elements of different towers do not mix.
Poly = Any


@dataclass
class Generator:
    """A generator: the value of a function as a variable of the ring.

    ``kind`` is the name of a function, or a constant (``pi``, ``E``), or ``reciprocal`` (1/argument, where the argument
    is irreducible), or ``root``: argument**(1/degree), or argument**(−1/degree) if ``inverse``. ``derivative`` maps the
    name of a symbol to the derivative of the generator, if it is not 0.
    """

    name: str
    kind: str
    arguments: list[Poly]
    expression: Expression
    degree: int = 1
    inverse: bool = False
    derivative: dict[str, Poly] = field(default_factory=dict)


class _MissingError(Exception):
    """Raised for an expression that needs a generator that the ring lacks.

    The generator is then added, or the expression is refused.
    """

    def __init__(self, kind: str, arguments: list[Poly], degree: int = 1, inverse: bool = False) -> None:
        self.kind, self.arguments, self.degree, self.inverse = kind, arguments, degree, inverse


class Tower(Arithmetic[Poly]):
    """The ring Q[symbols, generators] that contains the given expressions and their derivatives.

    The variables of the ring are the ``symbols``, then the generators. Generators are added until the ring contains the
    ``expressions``, and also the derivatives of its elements with respect to the symbols ``variables``.

    Raises `OverflowError` if a polynomial may be larger than memory.
    """

    def __init__(
        self, symbols: Sequence[str], expressions: Iterable[Expression] = (), variables: Sequence[str] = ()
    ) -> None:
        self.symbols = tuple(symbols)
        self.variables = tuple(variables)
        self.generators: list[Generator] = []
        self._index = {n: i for i, n in enumerate(self.symbols)}
        self._meanings = [*map(symbol, self.symbols)]
        self._sampled: list[float] = []
        functions = [e for e in topological(list(expressions)) if not _is_arithmetic(e)]
        self._set_context(spare=len(functions))
        self._renamed = True
        with progress.stage("functions") as running:
            while self._renamed:
                self._renamed, running.done = False, 0
                for e in functions:
                    self._absorb(e)
                    running.done += 1
                self._close(running)
        if self._room > len(self._index):
            self._set_context()

    # -- the ring ---------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the ring's variables: the symbols, then the generators."""
        return tuple(self._index)

    def _set_context(self, spare: int = 0) -> None:
        """Make the ring of polynomials in all names, and convert the generators to it.

        The ring has ``spare`` further variables, for generators that may follow.
        """
        self._room = max(len(self._index) + spare, 1)
        self.context = fmpq_mpoly_ctx.get([f"v{i}" for i in range(self._room)], Ordering.degrevlex)
        self.gens = self.context.gens()
        for g in self.generators:
            g.arguments = [self._lift(a) for a in g.arguments]
            g.derivative = {v: self._lift(d) for v, d in g.derivative.items()}
        self._forget()

    def _forget(self) -> None:
        """Drop the cached values, which are no longer valid after a change of the generators."""
        self._pairs: list[tuple[int, int]] | None = None
        self._below: dict[str, frozenset[str]] = {}
        self._known: dict[int, Poly] = {}  # values by the id of the node; `_kept` keeps the nodes alive
        self._kept: list[Expression] = []

    def constant(self, value: int | Fraction) -> Poly:
        """Return a rational number as an element."""
        value = Fraction(value)
        return self.context.constant(fmpq(value.numerator, value.denominator))

    def variable(self, name: str) -> Poly:
        """Return the symbol or generator with this name as an element."""
        return self.gens[self._index[name]]

    @property
    def zero(self) -> Poly:
        """The element 0 of the tower."""
        return self.constant(0)

    # -- adding generators ----------------------------------------------------------------------------------

    def _absorb(self, e: Expression) -> Poly:
        """Return the expression as an element; generators that are missing are added to the ring."""
        while True:
            try:
                for node in topological([e], self._known):
                    if not _is_arithmetic(node):
                        self._known[id(node)] = self.values([node], self._known)[0]
                        self._kept.append(node)
                return self.values([e], self._known)[0]
            except _MissingError as missing:
                self._grow(missing)

    def _grow(self, missing: _MissingError) -> None:
        # The generator 1/√q is added. If 1/q is a generator too, 1/q must become the square of 1/√q. So all elements
        # are converted again.
        is_inverse_root = missing.kind == "root" and missing.inverse
        if is_inverse_root and any(g.kind == "reciprocal" for g in self.generators):
            self._renamed = True
            self._forget()
        name = Symbol("g", len(self.generators))
        arguments = [self.expression(a) for a in missing.arguments]
        self.generators.append(
            Generator(
                name,
                missing.kind,
                missing.arguments,
                _generator_expression(missing.kind, arguments, missing.degree, missing.inverse),
                missing.degree,
                missing.inverse,
            )
        )
        self._index[name] = len(self._index)
        self._meanings.append(self.generators[-1].expression)
        self._pairs = None
        if len(self._index) > self._room:
            self._set_context(spare=len(self.generators))

    def _lift(self, element: Poly) -> Poly:
        size = self._room
        return self.context.from_dict(
            {m + (0,) * (size - len(m)) if len(m) < size else m[:size]: c for m, c in element.to_dict().items()}
        )

    def _close(self, running: progress.Stage) -> None:
        """Add generators until the derivatives of all generators are elements of the ring; store the derivatives."""
        closed_count = size = 0
        while closed_count < len(self.generators):
            (rules,) = sparse_derivatives([self.generators[closed_count].expression], self.variables)
            for v in self.variables:
                if v in rules:
                    value = self._absorb(rules[v])  # this may add generators and replace the ring by a larger one
                    self.generators[closed_count].derivative[v] = value
                    size += len(value) * self.bytes_per_term
                    if size > budgets.PRODUCT_BYTES:
                        raise OverflowError("derivatives with too many terms, of functions inside functions")
            closed_count += 1
            running.done += 1

    # -- conversion -------------------------------------------------------------------------------

    def convert(self, e: Expression) -> Poly:
        """Return the expression as an element. Raises `ValueError` if it needs a generator that the ring lacks."""
        return self.convert_all([e])[0]

    def convert_all(self, expressions: Sequence[Expression]) -> list[Poly]:
        """Return several expressions as elements; shared parts are converted once. Raises the errors of `convert`."""
        try:
            return self.values(expressions)
        except _MissingError as missing:
            raise ValueError(f"no polynomial represents the function {missing.kind} here") from None

    def function(self, name: str, args: list[Poly]) -> Poly:
        """Return the value of a function at elements, as an element of the ring: a generator, or an expression in
        generators.

        If the ring lacks the generator, `_MissingError` is raised.
        """
        if not args:
            return self._generator(name, [])
        args = [self.cancelled(a) for a in args]
        if name == "abs":
            return self.function("sign", args) * args[0]
        if name in ("inv", "inv0"):
            return self._reciprocal(args[0])
        first = args[0]
        if name in ENTIRE:
            return self._entire(name, first)
        if name in SPECIAL:
            return self._special(order_of(name), first)
        record = FUNCTIONS[name]
        if record.known:
            return record.known(lambda f, *a: self.function(f, list(a)), *args)
        if record.at_zero is not None and first.is_constant() and first == 0:
            return self.constant(record.at_zero)
        if name == "log" and first == 1:
            return self.zero
        if record.parity and rational(first.leading_coefficient()) < 0:
            # For an even or odd function f, the generator of f(-q) also serves f(q).
            mirrored = self._generator(name, [-first])
            return mirrored if record.parity == "even" else -mirrored
        if name == "exp":
            for g in self.generators:
                ratio = _ratio(first, g.arguments[0]) if g.kind == "exp" else None
                if ratio and ratio > 0 and ratio.denominator == 1:
                    return self.variable(g.name) ** int(ratio)
        return self._generator(name, args)

    def _entire(self, name: str, s: Poly) -> Poly:
        """Return the value of the function ``name`` at s; `ENTIRE` defines the function.

        The value is written with exp, 1/s, cosroot and sinroot. Here cosroot(s) = cos √s and sinroot(s) = sin(√s)/√s.
        If cosroot(s) or sinroot(s) is needed, the ring receives both as generators.
        """
        if s.is_constant() and s == 0:
            return self.constant(ENTIRE[name].coefficient(0))
        if name in ("exprel", "exprel1"):
            inverse, exp = self._reciprocal(s), self.function("exp", [s])
            relative = (exp - 1) * inverse
            return relative if name == "exprel" else (exp - relative) * inverse
        if name == "arcroot1":
            sine = self._entire("sinroot", s * self.constant(Fraction(1, 4)))
            numerator = sine**2 * self.constant(Fraction(1, 2)) - 3 * self._entire("arcroot", s)
            return numerator * self._reciprocal(s) * self.constant(Fraction(1, 2))
        if name == "arcroot":  # written with functions of s/4, since formulas of flows contain these too
            quarter = s * self.constant(Fraction(1, 4))
            return (1 - self._entire("sinroot", quarter) * self._entire("cosroot", quarter)) * self._reciprocal(s)
        cos, sin = self._generator("cosroot", [s]), self._generator("sinroot", [s])
        if name == "sinroot1":
            return (cos - sin) * self._reciprocal(s) * self.constant(Fraction(1, 2))
        return cos if name == "cosroot" else sin

    def _special(self, order: int, s: Poly) -> Poly:
        """Return φ(s), φ'(s) or φ''(s) for an element s of the ring; ``order`` is the number of primes.

        `phigen.symbolic.special` defines φ. By the Riccati equation of φ, φ' and φ'' are polynomials in φ, s and 1/s.
        """
        if s.is_constant() and s == 0:
            return self.constant(coefficient(order, 0))
        phi = self._generator("phi0", [s])
        if order == 0:
            return phi
        inverse = self._reciprocal(s) * self.constant(Fraction(1, 2))
        slope = (s * phi**2 - 3 * phi + self.constant(Fraction(1, 4))) * inverse
        if order == 1:
            return slope
        return (phi**2 - 5 * slope + 2 * s * phi * slope) * inverse

    @property
    def bytes_per_term(self) -> int:
        """Memory in bytes of one term of an element, measured for products and sums."""
        return 60 + 3 * len(self._index)

    def product(self, a: Poly, b: Poly) -> Poly:
        """Return a·b. Raises `OverflowError` before a product is made that may be larger than memory."""
        self._expect_room(len(a) * len(b))
        return a * b

    def integer_power(self, base: Poly, n: int) -> Poly:
        """Return base ** n for n ≥ 0. Raises the errors of `product`."""
        if n > 1 and len(base) > 1:
            dense = math.prod(n * int(d) + 1 for d in base.degrees())
            self._expect_room(min(math.comb(len(base) + n - 1, n), dense))
        return base**n

    def _expect_room(self, terms: int) -> None:
        if terms > budgets.PRODUCT_TERMS or terms * self.bytes_per_term > budgets.PRODUCT_BYTES:
            raise OverflowError(f"a polynomial of up to {terms} terms")

    def power(self, base: Poly, exponent: Fraction | int) -> Poly:
        """Return base ** exponent for a rational exponent. Raises the errors of `product`."""
        base, exponent = self.cancelled(base), Fraction(exponent)
        if exponent.denominator == 1:
            n = int(exponent)
            return self.integer_power(base, n) if n >= 0 else self._reciprocal(base) ** (-n)
        if base.is_constant() and (root := _rational_root(base, exponent.denominator)) is not None:
            return self.constant(root**exponent.numerator)
        n, k = exponent.denominator, exponent.numerator
        if k < 0:
            return self._generator("root", [base], n, True) ** (-k)
        return self.integer_power(base, k // n) * self._generator("root", [base], n, False) ** (k % n)

    def inverse(self, base: Poly) -> Poly | None:
        """Return 1/base if it is an element of the ring, else None."""
        try:
            return self._reciprocal(base)
        except (_MissingError, ZeroDivisionError):
            return None

    def _reciprocal(self, base: Poly) -> Poly:
        if base == 0:
            raise ZeroDivisionError("reciprocal of zero")
        for g in self.generators:
            if g.kind == "root" and g.inverse and (ratio := _ratio(base, g.arguments[0])):
                return self.variable(g.name) ** g.degree * self.constant(1 / ratio)
        content, factors = base.factor()
        result = self.context.constant(1 / content)
        for f, multiplicity in factors:
            result *= self._inverse_of_factor(f) ** int(multiplicity)
        return result

    def _inverse_of_factor(self, f: Poly) -> Poly:
        for g in self.generators:
            if g.kind == "root" and g.inverse and (ratio := _ratio(f, g.arguments[0])):
                return self.variable(g.name) ** g.degree * self.constant(1 / ratio)
            if g.kind == "root" and f == self.variable(g.name):
                return self._generator("root", g.arguments, g.degree, not g.inverse)
            if g.kind == "reciprocal" and f == self.variable(g.name):
                return g.arguments[0]
            if g.kind == "exp" and f == self.variable(g.name):
                return self._generator("exp", [-g.arguments[0]])
        return self._generator("reciprocal", [f])

    def _generator(self, kind: str, args: list[Poly], degree: int = 1, inverse: bool = False) -> Poly:
        for g in self.generators:
            if g.kind == kind and g.degree == degree and g.inverse == inverse and g.arguments == args:
                return self.variable(g.name)
        raise _MissingError(kind, args, degree, inverse)

    def expression(self, element: Poly) -> Expression:
        """Return the element as an expression in Horner form, with generators written as functions."""
        return self.expression_in(element, {})

    def expression_in(self, element: Poly, values: Mapping[str, Expression]) -> Expression:
        """Return the element as an expression, in which some symbols and generators are replaced by ``values``."""
        variables = self._meanings
        if values:
            variables = [values.get(n, meaning) for n, meaning in zip(self.names, variables, strict=True)]
        terms = {_exponents(m): number(rational(c)) for m, c in element.to_dict().items()}
        return horner({m[: len(variables)]: c for m, c in terms.items()}, variables)

    # -- calculus ---------------------------------------------------------------------------------

    def derivative(self, element: Poly, name: str) -> Poly:
        """Return the derivative with respect to one of `variables`, including the derivatives of the generators."""
        # Adding 0 makes a copy, so that the memory of terms that were cancelled is freed.
        result = element.derivative(self._index[name]) + 0
        degrees = element.degrees()
        for g in self.generators:
            k = self._index[g.name]
            chain = g.derivative.get(name) if degrees[k] > 0 else None
            if chain is not None and chain != 0:
                result += self.product(element.derivative(k), chain)
        return self.cancelled(result)

    def gradient(self, element: Poly, names: Iterable[str]) -> list[Poly]:
        """Return the derivatives with respect to some of `variables`.

        Raises `OverflowError` if all derivatives together are larger than memory.
        """
        slopes, size = [], 0
        for name in names:
            slopes.append(self.derivative(element, name))
            size += len(slopes[-1]) * self.bytes_per_term
            if size > budgets.PRODUCT_BYTES:
                raise OverflowError("a gradient with too many terms")
        return slopes

    def partial(self, element: Poly, name: str) -> Poly:
        """Return the derivative with respect to a symbol. Raises `ValueError` if a generator contains the symbol."""
        if any(self.depends_on(a, [name]) for g in self.generators for a in g.arguments):
            raise ValueError(f"{name} is in a function")
        return element.derivative(self._index[name])

    def depends_on(self, element: Poly, names: Iterable[str]) -> bool:
        """Whether some of the symbols occur in the element, directly or inside a generator."""
        return not self.names_in(element).isdisjoint(names)

    def names_in(self, element: Poly) -> set[str]:
        """Return the symbols and generators that occur in the element, directly or inside a generator."""
        if element == 0:  # the library reports the degrees −1 for 0
            return set()
        names: set[str] = set()
        for i, degree in enumerate(element.degrees()):
            if degree and i < len(self.symbols):
                names.add(self.symbols[i])
            elif degree:
                names |= self._names_below(self.generators[i - len(self.symbols)])
        return names

    def _names_below(self, g: Generator) -> frozenset[str]:
        """Return the name of a generator, and the names of the symbols and generators in its arguments."""
        if g.name not in self._below:
            self._below[g.name] = frozenset({g.name}.union(*map(self.names_in, g.arguments)))
        return self._below[g.name]

    # -- tests for 0 ---------------------------------------------------------------------------------

    def is_zero(self, element: Poly) -> bool:
        """Return whether the element is proved to vanish identically.

        False is no proof of the contrary: the relations did not reduce the element to 0.
        """
        if element == 0 or self._is_nonzero_at_a_point(element):
            return bool(element == 0)
        return bool(self.numerator(element) == 0)

    def _is_nonzero_at_a_point(self, element: Poly) -> bool:
        """Whether an element has a nonzero value at a sample point.

        An element with fewer than `MANY_GENERATORS` generators is not evaluated; the result is then False.
        """
        degrees = element.degrees()
        if sum(degrees[self._index[g.name]] > 0 for g in self.generators) < MANY_GENERATORS:
            return False
        values = self._values_at_a_point()
        terms = [
            float(rational(c)) * math.prod(v ** int(e) for v, e in zip(values, m, strict=False) if e)
            for m, c in element.to_dict().items()
        ]
        return abs(math.fsum(terms)) > ROUNDING * math.fsum(map(abs, terms))

    def _values_at_a_point(self) -> list[float]:
        """Return the values of symbols and generators at one point, as floats. If one value is undefined, all
        are NaN.
        """
        if len(self._sampled) != len(self._meanings):
            point = {n: 0.5 + math.modf((k + 1) * (math.sqrt(5) - 1) / 2)[0] for k, n in enumerate(self.symbols)}
            try:
                self._sampled = evaluate(self._meanings, point)
            except DomainError:
                self._sampled = [math.nan] * len(self._meanings)
        return self._sampled

    def numerator(self, element: Poly) -> Poly:
        """Return the product of the element and a function without zeros, chosen such that the product contains no
        reciprocals.

        The product is simplified by relations between generators, such as sin² + cos² = 1.
        """
        degrees = element.degrees()
        for g in reversed(self.generators):
            if degrees[self._index[g.name]] > 0:
                element = self._eliminate(element, g)
                degrees = element.degrees()
        return element

    def simplified(self, element: Poly) -> Poly:
        """Return the element in a form with fewer terms, if the relations (r·f = 1, w² = q, sin² + cos² = 1)
        give one.
        """
        return self._shortened(element, relations=True)

    def reduced(self, element: Poly) -> Poly:
        """Return the element with common factors of numerator and denominator cancelled, if this leaves fewer terms."""
        return self._shortened(self.cancelled(element), relations=False)

    def _shortened(self, element: Poly, *, relations: bool) -> Poly:
        degrees = element.degrees()
        for g in reversed(self.generators):
            if degrees[self._index[g.name]] <= 0:
                continue
            if g.kind == "reciprocal" or (g.kind == "root" and g.inverse):
                shorter = self._divided(element, g)
            elif relations and self._is_related(g):
                shorter = self._eliminate(element, g)
            else:
                continue
            if len(shorter) < len(element):
                element, degrees = shorter, shorter.degrees()
        return element

    def _is_related(self, g: Generator) -> bool:
        """Whether a relation replaces powers of a generator by lower powers: w² = q, or sin² = 1 − cos²."""
        return g.kind in ("sin", "cosh", "cosroot", "sign") or (g.kind == "root" and not self._partner(g))

    def _divided(self, element: Poly, g: Generator) -> Poly:
        """Return the element with lower powers of the generator ``g``, which is r = f^(−1/n). For the reciprocal r =
        1/f, n is 1.

        The coefficient c of rᵉ is divided by f: c = q·f + remainder. Since rⁿ·f = 1, the term q·f·rᵉ becomes q·rᵉ⁻ⁿ.
        """
        parts, generator, base = self._parts(element, g.name), self.variable(g.name), g.arguments[0]
        for e in range(max(parts, default=0), g.degree - 1, -1):
            quotient, parts[e] = divmod(parts.get(e, self.zero), base)
            parts[e - g.degree] = parts.get(e - g.degree, self.zero) + quotient
        return self.combine(c * generator**e for e, c in parts.items())

    def _partner(self, g: Generator) -> Generator | None:
        """Return the generator before ``g`` that is the reciprocal of the root ``g``; None if there is none."""
        for candidate in self.generators[: self.generators.index(g)]:
            if candidate.kind == "root" and candidate.degree == g.degree and candidate.arguments == g.arguments:
                return candidate
        return None

    def _eliminate(self, element: Poly, g: Generator) -> Poly:
        parts = self._parts(element, g.name)
        if set(parts) <= {0}:
            return element
        if g.kind == "reciprocal":
            top = max(parts)
            return self.combine(c * g.arguments[0] ** (top - e) for e, c in parts.items())
        if g.kind == "root":
            return self._eliminate_root(parts, g)
        partner = {"sin": "cos", "cosh": "sinh"}.get(g.kind)
        if g.kind == "sign":
            return self.combine(c * self.variable(g.name) ** (e % 2) for e, c in parts.items())
        if g.kind == "exp":
            for other_generator in self.generators:
                if (
                    other_generator is not g
                    and other_generator.kind == "exp"
                    and other_generator.arguments[0] == -g.arguments[0]
                ):
                    top, w = max(parts), self.variable(other_generator.name)
                    return self.combine(c * w ** (top - e) for e, c in parts.items())
        if g.kind == "cosroot":
            return self._eliminate_cosroot(parts, g)
        if partner:
            for other_generator in self.generators:
                if other_generator.kind == partner and other_generator.arguments == g.arguments:
                    square = (
                        1 - self.variable(other_generator.name) ** 2
                        if g.kind == "sin"
                        else 1 + self.variable(other_generator.name) ** 2
                    )
                    generator = self.variable(g.name)
                    return self.combine(c * generator ** (e % 2) * square ** (e // 2) for e, c in parts.items())
        return element

    def _eliminate_cosroot(self, parts: dict[int, Poly], g: Generator) -> Poly:
        """Return the element Σ parts[k] gᵏ with g² replaced by 1 − s·sinroot(s)².

        Here g is cosroot(s). `phigen.symbolic.entire` defines cosroot and sinroot.
        """
        generator, sin = self.variable(g.name), self._generator("sinroot", g.arguments)
        square = 1 - g.arguments[0] * sin**2
        return self.combine(c * generator ** (e % 2) * square ** (e // 2) for e, c in parts.items())

    def _eliminate_root(self, parts: dict[int, Poly], g: Generator) -> Poly:
        base, n, generator = g.arguments[0], g.degree, self.variable(g.name)
        if partner := self._partner(g):
            # g·w = 1. Multiplication of the element by a power of w eliminates g.
            top, w = max(parts), self.variable(partner.name)
            return self.combine(c * w ** (top - e) for e, c in parts.items())
        if not g.inverse:
            return self.combine(c * generator ** (e % n) * base ** (e // n) for e, c in parts.items())
        top = max(e // n for e in parts)
        return self.combine(c * generator ** (e % n) * base ** (top - e // n) for e, c in parts.items())

    def _parts(self, element: Poly, name: str) -> dict[int, Poly]:
        """Return the element as a polynomial in the generator ``name``: {exponent: coefficient}.

        The coefficients are found by divisions by powers of the generator. The C library divides faster than a loop
        over terms in Python.
        """
        i, parts = self._index[name], dict[int, Poly]()
        while (exponent := int(element.degrees()[i])) > 0:
            parts[exponent], element = divmod(element, self.gens[i] ** exponent)
        return {**parts, 0: element} if element != 0 else parts

    def combine(self, terms: Iterable[Poly]) -> Poly:
        """Return the sum of the terms, in which products of a generator and its reciprocal are cancelled."""
        result = self.zero
        for t in terms:
            result += t
        return self.cancelled(result)

    def cancelled(self, element: Poly) -> Poly:
        """Return the element with products v · (1/v) cancelled, where v is a variable of the ring or a root."""
        degrees = element.degrees()
        pairs = [(i, j) for i, j in self._inverse_pairs() if degrees[i] and degrees[j]]
        if not pairs:
            return element
        for i, j in pairs:
            product = self.gens[i] * self.gens[j]
            for k in reversed(range(min(int(degrees[i]), int(degrees[j])).bit_length())):
                _, element = divmod(element, product ** (2**k) - 1)
        return element

    def _inverse_pairs(self) -> list[tuple[int, int]]:
        """Return pairs of indices (i, j) of ring variables: the product of variable i and variable j is 1."""
        if self._pairs is None:
            self._pairs = []
            for g in self.generators:
                index = self._index[g.name]
                if g.kind == "reciprocal":
                    self._pairs += [(i, index) for i, v in enumerate(self.gens) if v == g.arguments[0]]
                if g.kind == "root" and g.inverse:
                    self._pairs += [
                        (self._index[o.name], index)
                        for o in self.generators
                        if o.kind == "root" and not o.inverse and (o.degree, o.arguments) == (g.degree, g.arguments)
                    ]
        return self._pairs

    def vanishes(self, element: Poly) -> bool:
        """Whether the element is 0 as a polynomial; relations between generators are not used."""
        return bool(element == 0)


def _is_arithmetic(e: Expression) -> bool:
    """Whether a node of an expression is a polynomial in its arguments. Such a node needs no generator."""
    if e.op == "pow":
        return bool(e.value > 0 and e.value.denominator == 1)
    return e.op in ("number", "symbol", "add", "sub", "neg", "mul")


def rational(c: Any) -> Fraction:
    """Return a flint rational as a Fraction."""
    return Fraction(int(c.p), int(c.q))


def _exponents(m: Iterable[Any]) -> tuple[int, ...]:
    return tuple(int(e) for e in m)


def _ratio(a: Poly, b: Poly) -> Fraction | None:
    """Return a/b if that is a rational number, else None."""
    if a == 0 or b == 0 or len(a) != len(b):
        return None
    r = a.leading_coefficient() / b.leading_coefficient()
    return rational(r) if a == b * r else None


def _rational_root(base: Poly, degree: int) -> Fraction | None:
    value = rational(base.leading_coefficient()) if base != 0 else Fraction(0)
    if value < 0:
        return None
    top, bottom = (_integer_root(v, degree) for v in (value.numerator, value.denominator))
    return Fraction(top, bottom) if top is not None and bottom is not None else None


def _integer_root(value: int, degree: int) -> int | None:
    low, high = 0, value + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if middle**degree <= value else (low, middle)
    return low if low**degree == value else None


def _generator_expression(kind: str, args: list[Expression], degree: int, inverse: bool) -> Expression:
    if kind == "pi":
        return PI
    if kind == "E":
        return EULER
    if kind == "reciprocal":
        return ONE / args[0]
    if kind == "root":
        return power(args[0], Fraction(-1 if inverse else 1, degree))
    return call(kind, *args)
