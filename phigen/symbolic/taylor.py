"""Truncated power series in t of an expression whose symbols are power series in t.

A `Taylor` contains the series of every node of the expression. The coefficients are elements of a ring: polynomials (a
`Tower`), or expressions (`ExpressionRing`). *Level* i has the coefficient of tⁱ of every node. Level i is
computed before level i + 1. So the coefficient of a symbol at level i may depend on results at level i − 1, as in the
Hamilton–Jacobi recursion.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Protocol

from phigen import progress
from phigen.symbolic import budgets
from phigen.symbolic.arithmetic import Arithmetic
from phigen.symbolic.expression import (
    EULER,
    PI,
    ZERO,
    Expression,
    call,
    number,
    partials,
    power,
    symbol,
    topological,
    total,
)
from phigen.symbolic.special import SPECIAL, coefficient, order_of


class RingOperations(Protocol):
    """Operations of a ring of coefficients, in addition to + and −."""

    @property
    def bytes_per_term(self) -> int:
        """Memory in bytes of one term of an element; 0 if elements have a fixed size."""

    def product(self, a: Any, b: Any) -> Any:
        """Return a·b. Raises `OverflowError` if the product may be larger than memory."""

    def constant(self, value: int | Fraction) -> Any:
        """Return a rational number as an element of the ring."""

    def variable(self, name: str) -> Any:
        """Return a symbol as an element of the ring."""

    def function(self, name: str, args: list[Any]) -> Any:
        """Return the value of an elementary function at elements of the ring; without arguments, the constant ``pi`` or
        ``E``.
        """

    def power(self, base: Any, exponent: Fraction | int) -> Any:
        """Return a rational power of an element."""

    def combine(self, terms: list[Any]) -> Any:
        """Return the sum of the terms."""

    def vanishes(self, element: Any) -> bool:
        """Whether the element is literally 0; identities such as sin² + cos² = 1 are not used."""


class ExpressionRing(Arithmetic[Expression]):
    """The ring of expressions: products are not multiplied out, and equal sub-expressions are shared."""

    bytes_per_term = 0

    def product(self, a: Expression, b: Expression) -> Expression:
        """Return the product of two expressions, simplified."""
        return a * b

    def constant(self, value: int | Fraction) -> Expression:
        """Return a rational number as an expression."""
        return number(value)

    def variable(self, name: str) -> Expression:
        """Return the symbol ``name`` as an expression."""
        return symbol(name)

    def function(self, name: str, args: list[Expression]) -> Expression:
        """Return the call of a function as an expression, or the constant ``pi`` or ``E``."""
        if not args:
            return PI if name == "pi" else EULER
        return power(*args) if name == "power" else call(name, *args)

    def power(self, base: Expression, exponent: Fraction | int) -> Expression:
        """Return a rational power of an expression, simplified."""
        return power(base, exponent)

    def combine(self, terms: list[Expression]) -> Expression:
        """Return the sum as a balanced tree of additions."""
        return total(terms)

    def vanishes(self, element: Expression) -> bool:
        """Whether the element is the literal 0."""
        return element is ZERO


def closure(roots: Sequence[Expression]) -> list[Expression]:
    """Return all nodes whose series are needed for the series of the expressions.

    Nodes of partial derivatives are included, since the series of f(a) is computed from the series of f'(a). Arguments
    come before the nodes that use them.
    """
    closed = list(roots)
    while True:
        order = topological(closed)
        known_ids = {id(e) for e in order}
        missing_nodes = [d for e in order if _by_derivative(e) for d in partials(e) if id(d) not in known_ids]
        if not missing_nodes:
            return order
        closed += missing_nodes


def _by_derivative(e: Expression) -> bool:
    return bool(e.args) and e.op not in ("add", "sub", "neg", "mul", "pow", *SPECIAL)


class Taylor:
    """Power series in t of the nodes of some expressions; ``series[id(node)]`` has the coefficients computed so
    far.

    The symbols ``variable_symbols`` are power series; all other symbols are constants. The constructor and `advance`
    raise `OverflowError` if one coefficient, or all coefficients together, need too much memory.
    """

    def __init__(self, roots: Sequence[Expression], ring: RingOperations, variable_symbols: Sequence[str]) -> None:
        self.ring = ring
        self.order = closure(roots)
        self.moving = set(variable_symbols)
        self.series: dict[int, list[Any]] = {id(e): [] for e in self.order}
        self._zero = ring.constant(0)
        self._powers: dict[int, list[list[Any]]] = {}
        self._bytes = 0

    def coefficients(self, e: Expression) -> list[Any]:
        """Return the coefficients of the series of a node that have been computed so far."""
        return self.series[id(e)]

    def advance(self, inputs: dict[str, Any], running: progress.Stage | None = None) -> None:
        """Compute one more coefficient of the series of every node (the next level).

        ``inputs`` maps each of the ``variable_symbols`` to its coefficient at this level. The stage ``running``
        of the progress display counts the nodes.
        """
        for count, e in enumerate(self.order, 1):
            coefficients = self.series[id(e)]
            coefficients.append(self._coefficient(e, len(coefficients), inputs))
            if e.op in ("add", "sub", "neg"):  # the memory of products is counted by `_product`
                self._count(coefficients[-1])
            if running:
                running.done = count

    def _product(self, a: Any, b: Any) -> Any:
        product = self.ring.product(a, b)
        self._count(product)
        return product

    def _count(self, element: Any) -> None:
        """Add the memory of an element to the total. Raises `OverflowError` if the total exceeds TAYLOR_BYTES."""
        if self.ring.bytes_per_term:
            self._bytes += len(element) * self.ring.bytes_per_term
            if self._bytes > budgets.TAYLOR_BYTES:
                raise OverflowError("a series of polynomials with too many terms")

    def _coefficient(self, e: Expression, i: int, inputs: dict[str, Any]) -> Any:
        if not e.args:
            if e.op == "symbol" and e.value in self.moving:
                return inputs[e.value]
            return self._constant(e) if i == 0 else self._zero
        args = [self.series[id(a)] for a in e.args]
        match e.op:
            case "add":
                return args[0][i] + args[1][i]
            case "sub":
                return args[0][i] - args[1][i]
            case "neg":
                return -args[0][i]
            case "mul":
                return self._convolve(args[0], args[1], i)
            case "pow":
                return self._power(e, args[0], i)
        return self._analytic(e, args[0], i) if e.op in SPECIAL else self._function(e, args, i)

    def _constant(self, e: Expression) -> Any:
        if e.op == "number":
            return self.ring.constant(e.value)
        if e.op == "symbol":
            return self.ring.variable(e.value)
        return self.ring.function(e.op, [])

    def _convolve(self, a: list[Any], b: list[Any], i: int) -> Any:
        zero = self.ring.vanishes
        if a is b:
            twice, indices = self.ring.constant(2), (j for j in range((i + 1) // 2) if not zero(a[j]))
            pairs = [self._product(a[j], a[i - j]) * twice for j in indices]
            return self.ring.combine(pairs + ([self._product(a[i // 2], a[i // 2])] if i % 2 == 0 else []))
        indices = (j for j in range(i + 1) if not (zero(a[j]) or zero(b[i - j])))
        return self.ring.combine([self._product(a[j], b[i - j]) for j in indices])

    def _power(self, e: Expression, a: list[Any], i: int) -> Any:
        exponent: Fraction = e.value
        if exponent.denominator == 1 and exponent > 0:
            return self._integer_power(a, int(exponent), i)
        if i == 0:
            return self.ring.power(a[0], exponent)
        # The series c = a**r satisfies a·c' = r·a'·c.
        powers, zero = self.series[id(e)], self.ring.vanishes
        terms = [
            self._product(a[j], powers[i - j]) * self.ring.constant((exponent * j - (i - j)) / i)
            for j in range(1, i + 1)
            if not (zero(a[j]) or zero(powers[i - j]))
        ]
        # If there are no terms, the base is constant. Its reciprocal is then not computed, because the ring may lack
        # it.
        return self.ring.combine(terms) * self.ring.power(a[0], -1) if terms else self._zero

    def _integer_power(self, a: list[Any], n: int, i: int) -> Any:
        if n == 1:
            return a[i]
        if n == 2:
            return self._convolve(a, a, i)
        half = [self._integer_power(a, n // 2, j) for j in range(i + 1)]
        if n % 2 == 0:
            return self._convolve(half, half, i)
        squared = [self._convolve(half, half, j) for j in range(i + 1)]
        return self._convolve(squared, a, i)

    def _function(self, e: Expression, args: list[list[Any]], i: int) -> Any:
        if i == 0:
            return self.ring.function(e.op, [a[0] for a in args])
        # The series c = f(a) satisfies c' = Σ ∂f/∂a_k(a) · a_k'. The partial derivatives are nodes too, and have
        # series.
        zero = self.ring.vanishes
        terms = []
        for partial, a in zip(partials(e), args, strict=True):
            d = self.series[id(partial)]
            terms += [
                self._product(a[j], d[i - j]) * self.ring.constant(Fraction(j, i))
                for j in range(1, i + 1)
                if not (zero(a[j]) or zero(d[i - j]))
            ]
        return self.ring.combine(terms)

    def _analytic(self, e: Expression, a: list[Any], i: int) -> Any:
        """Return the coefficient of tⁱ in f(a), where f is φ or a derivative of φ, by the power series of f at
        0.

        φ is the function of the exponential bi-realisation. ``a`` has the coefficients of the argument. Raises
        `ValueError` if the first coefficient is not 0.
        """
        order = order_of(e.op)
        if i == 0:
            if not self.ring.vanishes(a[0]):
                raise ValueError(f"{e.op} has a series about 0 only, and its argument does not vanish at p = 0")
            return self.ring.constant(coefficient(order, 0))
        powers = self._powers.setdefault(id(e), [])  # powers[k - 1] has the coefficients of a**k; the first k are 0
        powers.append([self._zero] * i)
        for k in range(i):
            powers[k].append(a[i] if k == 0 else self._convolve(a, [*powers[k - 1], self._zero], i))
        terms = [p[i] * self.ring.constant(coefficient(order, k)) for k, p in enumerate(powers, 1)]
        return self.ring.combine([t for t in terms if not self.ring.vanishes(t)])
