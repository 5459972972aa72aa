"""Recurrences for the Taylor coefficients of the path ṁ = π(m)p of Karasev's bi-realisation.

A solver follows the path by these recurrences. Each node of the expression graph of π(m)p is a Taylor series in the
time along the path. For sums and products, the coefficient of order k of a node follows from the coefficients of its
arguments up to order k. For powers and functions it also needs the lower coefficients of the node itself. So the
coefficients of m are computed one order after another; a larger p requires more orders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.scheme.lowering import expand_powers
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import Expression, derivatives, fold, partials, raw, symbol, symbols_of
from phigen.symbolic.symbols import FIXED, SERIES, Symbol, momentum
from phigen.symbolic.taylor import closure


@dataclass(frozen=True)
class ConvolutionTerm:
    """A sum over j of products of Taylor coefficients a_j and b_{k−j} of two series, given by their numbers ``a`` and
    ``b``.

    ``kind`` is one of these:

    - ``product``: Σ_{j=0}^{k} a_j b_{k−j}
    - ``chain``: Σ_{j=1}^{k} (j/k) a_j b_{k−j}, where b is the series of ∂f/∂a for a function f
    - ``power``: Σ_{j=1}^{k} (r j/k − (k−j)/k) a_j b_{k−j}, for b = aʳ with r = ``exponent``
    """

    kind: str
    a: int
    b: int
    exponent: Fraction = Fraction(0)


@dataclass(frozen=True)
class NodeSeries:
    """The Taylor series of a node: its value ``first`` at order 0, and the rule for its coefficients of the orders k ≥
    1.

    The coefficient of order k is a sum of two kinds of terms. ``linear`` lists pairs of a series a and a factor; each
    pair contributes factor · a_k. ``terms`` are sums of products of coefficients. For powers these sums are divided by
    the value at order 0 of another series, whose number is ``divisor``. In expressions, the symbol ``s:i`` is the value
    of series i at order 0.
    """

    first: Expression
    linear: tuple[tuple[int, Expression], ...] = ()
    terms: tuple[ConvolutionTerm, ...] = ()
    divisor: int | None = None


@dataclass(frozen=True)
class Recurrences:
    """The Taylor series of a path: series 0 … n−1 are the coordinates m_i, and series number ``slopes[i]`` is that of
    ṁ_i.

    ``fixed`` are values that are constant along a path; their symbols are ``f:i``. They depend on p and on the
    coefficients of the step.
    """

    series: tuple[NodeSeries, ...]
    slopes: tuple[int, ...]
    fixed: tuple[Expression, ...]


@dataclass(frozen=True)
class SeriesEntry:
    """A matrix entry that is not identically 0: its row, its column, and the number of its Taylor series."""

    row: int
    column: int
    series: int


@dataclass(frozen=True)
class PathSlopes:
    """Recurrences for the derivatives of a path with respect to its start, to p, and to some coefficients c.

    Let J = ∂(π(m)p)/∂m. The derivatives V = (∂m/∂m_0, ∂m/∂p) satisfy V̇ = J V + (0, π), and the derivatives W with
    respect to c satisfy Ẇ = J W + ∂(π(m)p)/∂c. ``jacobian`` has the entries of J, ``tensor`` those of π(m), and
    ``along`` those of ∂(π(m)p)/∂c, a column for each c. ``series`` and ``fixed`` are appended to the lists of the path
    with these names.
    """

    series: tuple[NodeSeries, ...]
    fixed: tuple[Expression, ...]
    jacobian: tuple[SeriesEntry, ...]
    tensor: tuple[SeriesEntry, ...]
    along: tuple[SeriesEntry, ...] = ()


def build_path(system: System, coefficients: Coefficients) -> Recurrences:
    """Return the recurrences of the path ṁ = π(m)p. Values that depend on parameters only are added to
    ``coefficients``."""
    return path_of(system.coordinates, _flow(system, coefficients))


def build_slopes(system: System, coefficients: Coefficients, variables: Sequence[str] = ()) -> PathSlopes:
    """Return the recurrences for the derivatives of the path ṁ = π(m)p with respect to its start and to p.

    The recurrences also give the derivatives with respect to the coefficients named in ``variables``.
    """
    n, flow = system.dimension, _flow(system, coefficients)
    columns = [derivatives(flow, c) for c in system.coordinates]
    jacobian = [columns[j][i] for i in range(n) for j in range(n)]
    tensor = coefficients.hoist([e for row in system.poisson for e in row])
    by_coefficient = [derivatives(flow, c) for c in variables]
    sources = [by_coefficient[u][i] for i in range(n) for u in range(len(variables))]
    return _PathBuilder(system.coordinates).slopes(_powers_as_products([*flow, *jacobian, *tensor, *sources]))


def used_by_path(system: System, coefficients: Coefficients) -> list[str]:
    """Return the symbols of the coefficients on which π(m)p depends."""
    symbols = set(symbols_of(*_flow(system, coefficients)))
    return [s for s in coefficients.slots if s in symbols]


def _flow(system: System, coefficients: Coefficients) -> list[Expression]:
    covector = [symbol(momentum(c)) for c in system.coordinates]
    return coefficients.hoist(hamiltonian_vector_field(system.poisson, covector))


def path_of(coordinates: Sequence[str], flow: Sequence[Expression]) -> Recurrences:
    """Return the recurrences of the path ṁ = f. ``flow`` has the components of f, which contain m and constants."""
    return _PathBuilder(coordinates).path(_powers_as_products(flow))


def _powers_as_products(roots: Sequence[Expression]) -> list[Expression]:
    """Return the expressions with products in place of powers whose exponent is a positive integer.

    Other powers remain, and need a recurrence of their own.
    """

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if not e.args:
            return e
        if e.op == "pow" and e.value.denominator == 1 and e.value > 0:
            return expand_powers([raw("pow", (args[0],), e.value)])[0]
        return raw(e.op, tuple(args), e.value)

    return fold(roots, visit)


class _PathBuilder:
    def __init__(self, coordinates: Sequence[str]) -> None:
        self.coordinates = tuple(coordinates)
        self.series = [NodeSeries(symbol(c)) for c in coordinates]
        self.fixed: list[Expression] = []
        self._series_of: dict[int, int] = {}
        self._in_motion: set[int] = set()
        self._fixed_of: dict[int, Expression] = {}
        self._keep: list[Expression] = []

    def path(self, flow: Sequence[Expression]) -> Recurrences:
        self._include(flow)
        slopes = tuple(self._as_series(f) for f in flow)  # may append to self.series
        return Recurrences(tuple(self.series), slopes, tuple(self.fixed))

    def slopes(self, roots: Sequence[Expression]) -> PathSlopes:
        n = len(self.coordinates)
        path = self.path(roots[:n])
        self._include(roots[n:])
        matrices = roots[n : n + n * n], roots[n + n * n : n + 2 * n * n], roots[n + 2 * n * n :]
        entries = [self._entries(matrix) for matrix in matrices]
        return PathSlopes(tuple(self.series[len(path.series) :]), tuple(self.fixed[len(path.fixed) :]), *entries)

    def _entries(self, matrix: Sequence[Expression]) -> tuple[SeriesEntry, ...]:
        width = max(1, len(matrix) // len(self.coordinates))
        return tuple(SeriesEntry(*divmod(k, width), self._as_series(e)) for k, e in enumerate(matrix) if not e.is_zero)

    def _include(self, roots: Sequence[Expression]) -> None:
        order = closure(roots)
        self._keep += order  # keeps the nodes alive, since they are identified by id
        self._in_motion |= self._moving(order)
        fresh = [e for e in order if id(e) in self._in_motion and id(e) not in self._series_of]
        for e in fresh:
            if e.op == "symbol":
                self._series_of[id(e)] = self.coordinates.index(e.value)
            else:
                self._series_of[id(e)] = len(self.series)
                # This entry is a placeholder, replaced below: the rule of a function refers to the series of its
                # derivative, which may have a later number.
                self.series.append(NodeSeries(symbol("pending")))
        for e in fresh:
            if e.args:
                self.series[self._series_of[id(e)]] = self._rule(e)

    def _moving(self, order: Sequence[Expression]) -> set[int]:
        moving: set[int] = set()
        for e in order:
            if (e.op == "symbol" and e.value in self.coordinates) or any(id(a) in moving for a in e.args):
                moving.add(id(e))
        return moving

    def _as_series(self, e: Expression) -> int:
        """Return the index of the Taylor series of an expression, in the list ``series``.

        If the expression is constant along the path, a series is added that has only the coefficient of order 0.
        """
        if id(e) not in self._series_of:
            value = self._value(e)
            self._series_of[id(e)] = len(self.series)
            self.series.append(NodeSeries(value))
        return self._series_of[id(e)]

    def _value(self, e: Expression) -> Expression:
        """Return the value of a node at order 0 of its series: a symbol or a number."""
        if id(e) in self._series_of:
            return symbol(Symbol(SERIES, self._series_of[id(e)]))
        if not e.args:
            return e
        if id(e) not in self._fixed_of:
            self._fixed_of[id(e)] = symbol(Symbol(FIXED, len(self.fixed)))
            self.fixed.append(e)
        return self._fixed_of[id(e)]

    def _rule(self, e: Expression) -> NodeSeries:
        values = [self._value(a) for a in e.args]
        first = raw(e.op, tuple(values), e.value)
        moving = [(k, self._series_of[id(a)]) for k, a in enumerate(e.args) if id(a) in self._in_motion]
        unit, minus = raw("number", (), Fraction(1)), raw("number", (), Fraction(-1))
        match e.op:
            case "add":
                return NodeSeries(first, tuple((s, unit) for _, s in moving))
            case "sub":
                return NodeSeries(first, tuple((s, minus if k else unit) for k, s in moving))
            case "neg":
                return NodeSeries(first, ((moving[0][1], minus),))
            case "mul" if len(moving) == 1:
                (k, s) = moving[0]
                return NodeSeries(first, ((s, values[1 - k]),))
            case "mul":
                return NodeSeries(first, (), (ConvolutionTerm("product", moving[0][1], moving[1][1]),))
            case "pow" if e.value == 2:
                return NodeSeries(first, (), (ConvolutionTerm("product", moving[0][1], moving[0][1]),))
            case "pow":
                result = self._series_of[id(e)]
                term = ConvolutionTerm("power", moving[0][1], result, e.value)
                return NodeSeries(first, (), (term,), moving[0][1])
        slopes = partials(e)
        chain = tuple(ConvolutionTerm("chain", s, self._as_series(slopes[k])) for k, s in moving)
        return NodeSeries(first, (), chain)
