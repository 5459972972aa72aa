"""Builders of the functions for paths. A path is a solution m(s) of ṁ = π(m)p, computed by recurrences for its Taylor
coefficients.

Each node of the expression graph of π(m)p has a Taylor series, an array of coefficients by order. The recurrences are
the same in all languages; a `PathLayout` says where the values are stored. The functions for SIMD lanes
(`lane_functions`) have loops for the sums over orders, and also compute derivatives of the path.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.passes.function_parameters import typed_function
from phigen.ir.walk import names_in
from phigen.scheme.kernel import Role
from phigen.scheme.lowering import expand_powers
from phigen.scheme.path import ConvolutionTerm, NodeSeries, PathSlopes, Recurrences, SeriesEntry
from phigen.scheme.program import Program
from phigen.scheme.steps import PathAdjoint
from phigen.symbolic.expression import Expression, symbols_of
from phigen.symbolic.symbols import FIXED, SERIES, Symbol, coefficient, cotangent, momentum, variation

#: Largest number of Taylor terms of a path. If more terms are needed, the path is divided into several parts.
TERMS = 30

#: Largest number of statements in a loop over lanes, since compile time is quadratic in this number.
LONGEST_LOOP = 60

COEF, P, F, S, E, M, K, J, LANE, FIELD, SHARE, SUM, FROM, TO = (
    ir.fixed(name)
    for name in ("coef", "p", "f", "s", "e", "m", "k", "j", "lane", "field", "share", "sum", "from", "to")
)
ZERO, ONE = ir.Constant(0), ir.Constant(1.0)


class PathLayout:
    """The names of the arrays that hold the values of a path. The array of a Taylor series has one entry for each
    order.
    """

    def coefficient(self, i: int) -> ir.Value:
        """Return coefficient i of the step; `phigen.scheme.staging` defines coefficients."""
        return ir.entry(COEF, i)

    def covector(self, i: int) -> ir.Value:
        """Return component i of the covector p."""
        return ir.entry(P, i)

    def fixed(self, i: int) -> ir.Value:
        """Return the array element for one of the values that are constant along a path; ``i`` is the number of the
        value.
        """
        return ir.entry(F, i)

    def series(self, i: int) -> ir.Value:
        """Return the array of the Taylor coefficients of series i."""
        return ir.entry(S, i)

    def order(self, i: int, k: ir.Value) -> ir.Value:
        """Return the Taylor coefficient of order k of series i."""
        return ir.Entry(self.series(i), k)

    def following(self, i: int, k: ir.Value, value: ir.Value) -> ir.Statement:
        """Return the statement that assigns ``value`` to the Taylor coefficient of order k of series i."""
        return ir.Assign(self.order(i, k), value)


@dataclass(frozen=True)
class PathFunctions:
    """Builder of the recurrences for a path; ``layout`` says where the values are stored."""

    program: Program
    path: Recurrences
    layout: PathLayout

    @property
    def derived(self) -> list[tuple[int, NodeSeries]]:
        """A list of pairs for all nodes except the coordinates: the number of the node, and its Taylor series."""
        return [*enumerate(self.path.series)][self.program.dimension :]

    def blocks(self) -> dict[str, ir.Function]:
        """Return the pieces of code that compute the path, by name; each piece is a function without parameters."""
        parts = (self.fixed, self.first, self.rules, self.slopes, self.nodes, self.field)
        return {part.__name__: ir.Function(part.__name__, "", Role.OTHER, (), part()) for part in parts}

    def fixed(self) -> ir.Block:
        """Return the statements that compute the values which are constant along the path."""
        reads = self.reads(self.path.fixed)
        return (*reads, *(ir.Assign(self.layout.fixed(i), _expanded(e)) for i, e in enumerate(self.path.fixed)))

    def first(self) -> ir.Block:
        """Return the statements that compute the Taylor coefficients of order 0 of all nodes except the coordinates."""
        layout, derived = self.layout, self.derived
        reads = self.reads(q.first for _, q in derived)
        return (*reads, *(layout.following(i, ZERO, _expanded(q.first)) for i, q in derived))

    def rules(self) -> ir.Block:
        """Return the statements that compute the Taylor coefficients of order k ≥ 1 of all nodes except the
        coordinates.
        """
        reads = self.reads(factor for _, q in self.derived for _, factor in q.linear)
        return (*reads, *(self.layout.following(i, K, self._rule(q)) for i, q in self.derived))

    def slopes(self) -> ir.Block:
        """Return the statements that compute the Taylor coefficients of order k + 1 of the coordinates from the
        coefficients of ṁ.
        """
        after, layout = ir.plus(K, 1), self.layout
        values = (
            ir.Binary("/", layout.order(derivative_index, K), ir.Cast(after, "real"))
            for derivative_index in self.path.slopes
        )
        return tuple(layout.following(i, after, value) for i, value in enumerate(values))

    def nodes(self) -> ir.Block:
        """Return the statements that evaluate the expression graph of the path at a point m. They store the values of
        its nodes in the array ``e``.
        """
        reads = self.reads((q.first for _, q in self.derived), at_point=True)
        return (*reads, *(ir.Assign(ir.entry(E, i), _expanded(q.first)) for i, q in self.derived))

    def field(self) -> ir.Block:
        """Return the statements that copy ṁ at a point from the array ``e``. The array has the values of all nodes."""
        derivatives = (ir.entry(E, index) for index in self.path.slopes)
        return tuple(ir.Assign(ir.entry(FIELD, i), value) for i, value in enumerate(derivatives))

    def reads(self, expressions: Iterable[Expression], *, at_point: bool = False) -> list[ir.Statement]:
        """Return the declarations of the symbols in expressions.

        A symbol may stand for a node of the expression graph. Without ``at_point``, its value is the Taylor coefficient
        of order 0 of the node. With ``at_point``, its value is the entry of the array ``e`` for the node.
        """
        used = {*symbols_of(*expressions)}
        listed = {momentum(c): self.layout.covector(i) for i, c in enumerate(self.program.coordinates)}
        listed |= {coefficient(i): self.layout.coefficient(i) for i in range(self.program.step.coefficients)}
        for i in range(len(self.path.series)):
            listed[Symbol(SERIES, i)] = ir.entry(E, i) if at_point else self.layout.order(i, ZERO)
        listed |= {Symbol(FIXED, i): self.layout.fixed(i) for i in range(len(self.path.fixed))}
        return [ir.in_place(s, place) for s, place in listed.items() if s in used]

    def linear(self, q: NodeSeries) -> ir.Value | None:
        """Return the sum of the terms ``q.linear`` of a recurrence; None if there are no terms. Each term is a multiple
        of a coefficient of another series.
        """
        total: ir.Value | None = None
        for index, factor in q.linear:
            term = self.layout.order(index, K)
            unit = factor.is_number and abs(factor.value) == 1
            sign = "-" if unit and factor.value < 0 else "+"
            term = term if unit else ir.Binary("*", _expanded(factor), term)
            total = ir.Binary(sign, total, term) if total else ir.Prefix("-", term) if sign == "-" else term
        return total

    def _rule(self, q: NodeSeries) -> ir.Value:
        linear = self.linear(q)
        terms = [*([linear] if linear else []), *map(self._sum, q.terms)]
        total = ir.joined("+", *terms) if terms else ir.Constant(0.0)
        return ir.Binary("/", ir.Grouped(total), self.layout.order(q.divisor, ZERO)) if q.divisor is not None else total

    def _sum(self, t: ConvolutionTerm) -> ir.Value:
        """Return the call of the function of the runtime that computes a convolution: the sum over orders in a product
        of two Taylor series.
        """
        exponent = (_exponent(t),) if t.kind == "power" else ()
        return ir.Called(f"taylor_{t.kind}", (self.layout.series(t.a), self.layout.series(t.b), *exponent, K))


def functions(program: Program, path: Recurrences, kind: str) -> list[ir.Function]:
    """Return three functions of a path. They compute the Taylor coefficients of order 0, the Taylor coefficients of
    order k, and the derivative ṁ at a point m.

    ``kind`` is the beginning of their names, and describes the path in comments.
    """
    build, n = PathFunctions(program, path, PathLayout()), ir.Constant(program.dimension)
    series, orders = ir.Constant(len(path.series)), ir.Binary("+", ir.fixed("TERMS"), ir.Constant(1))
    values = ir.Vector(ir.Constant(max(1, len(path.fixed))))
    types: dict[str, ir.ParameterType] = {
        "p": ir.Vector(n, constant=True),
        "m": ir.Vector(n, constant=True),
        "s": ir.Vector(orders, rows=series),
        "f": values,
        "k": ir.Type.FLAG,
        "field": ir.Vector(n),
    }

    def function(name: str, doc: str, parameters: Sequence[str], *body: ir.Statement) -> ir.Function:
        listed = {**types, **({"f": replace(values, constant=True)} if name == "order" else {})}
        return typed_function(f"{kind}_{name}", doc, parameters, body, listed)

    rules = build.rules()
    later = [ir.If(ir.Binary(">", K, ZERO), rules)] if rules else []
    point = [ir.vectors(ir.Vector(series), E), *[ir.vectors(values, F)] * bool(path.fixed)]
    said = {"tangent": "a path with its variation", "back": "a path in the reverse pass"}.get(kind, f"a {kind}")
    of_series = (
        f"Compute the coefficients of order 0 of all Taylor series of {said}; those of the coordinates are given"
    )
    of_order = "Compute coefficient k of all Taylor series, and coefficient k + 1 of the coordinates"
    at_point = (*point, *build.fixed(), ir.Copy(E, M, n), *build.nodes(), *build.field())
    return [
        function("begin", of_series, ("coef", "p", "s", "f"), *build.fixed(), *build.first()),
        function("order", of_order, ("coef", "p", "s", "f", "k"), *later, *build.slopes()),
        function(
            "field", f"Compute the derivative dm/dt of {said} at a point m", ("coef", "p", "m", "field"), *at_point
        ),
    ]


def tangent_program(program: Program) -> Program:
    """Return a copy of the program for tangent paths: its coordinates are the state and the variation of the state."""
    return replace(program, coordinates=(*program.coordinates, *map(variation, program.coordinates)))


def adjoint_program(program: Program, path: PathAdjoint) -> Program:
    """Return a copy of the program for paths in the reverse pass: its coordinates are the state and all cotangents."""
    names = program.coordinates
    bars = [
        *map(cotangent, names),
        *(cotangent(momentum(c)) for c in names),
        *(cotangent(coefficient(k)) for k in path.used),
    ]
    return replace(program, coordinates=(*names, *bars))


# ---- SIMD lanes


class _LaneLayout(PathLayout):
    """The places of the values of a path in one SIMD lane. The record ``e`` has the values of all lanes.

    Additional values, which only the derivatives of the path need, are in separate arrays.
    """

    def __init__(self, path: Recurrences) -> None:
        self._series, self._fixed = len(path.series), len(path.fixed)

    def coefficient(self, i: int) -> ir.Value:
        return _in_lane(ir.entry(COEF, i))

    def covector(self, i: int) -> ir.Value:
        return _in_lane(ir.entry(ir.Member(E, "p"), i))

    def fixed(self, i: int) -> ir.Value:
        further = i - self._fixed
        place = ir.entry(ir.Member(E, "fixed"), i) if further < 0 else ir.entry(ir.Member(E, "slope_fixed"), further)
        return _in_lane(place)

    def series(self, i: int) -> ir.Value:
        further = i - self._series
        return ir.entry(ir.Member(E, "s"), i) if further < 0 else ir.entry(ir.Member(E, "slope"), further)

    def order(self, i: int, k: ir.Value) -> ir.Value:
        return _in_lane(super().order(i, k))


def lane_functions(program: Program, path: Recurrences, slopes: PathSlopes, used: Sequence[int]) -> list[ir.Function]:
    """Return the functions of a path and of its derivatives in SIMD lanes.

    ``used`` are the numbers of the coefficients with respect to which the path is differentiated.
    """
    whole = Recurrences((*path.series, *slopes.series), path.slopes, (*path.fixed, *slopes.fixed))
    build = _LaneFunctions(PathFunctions(program, whole, _LaneLayout(path)))
    base, n = len(path.series), program.dimension
    along_m = [(e.row * 2 * n + e.column, SHARE, e) for e in slopes.jacobian]
    half = ir.Binary("*", ir.Constant(0.5), SHARE)
    along_p = [(e.row * 2 * n + n + e.column, half, e) for e in slopes.tensor]
    functions = [
        build.follow("follow", "the series that follow from those of the coordinates", range(n, base)),
        build.follow("follow_slopes", "the series that derivatives need", range(base, len(whole.series))),
        build.variation("vary_by", "v", slopes.jacobian, 2 * n, "the derivatives"),
        build.source("vary_source", "v", [*along_m, *along_p], "the derivatives"),
    ]
    if used:
        along = [(e.row * len(used) + e.column, SHARE, e) for e in slopes.along]
        functions += [
            build.variation("vary_along_by", "w", slopes.jacobian, len(used), "the derivatives by coefficients"),
            build.source("vary_along_source", "w", along, "the derivatives by coefficients"),
        ]
    return functions


@dataclass(frozen=True)
class _LaneFunctions:
    """Builder of the functions of a path in SIMD lanes."""

    path: PathFunctions

    def follow(self, name: str, purpose: str, numbers: range) -> ir.Function:
        """Return the function that computes the Taylor coefficients of order k ≥ 1 of some of the series. ``numbers``
        are the numbers of these series.

        The function first adds the products of coefficients of orders j and k − j for 0 < j < k, then the remaining
        terms, which may contain coefficients of order k.
        """
        layout, between, ends = self.path.layout, list[ir.Statement](), list[ir.Statement]()
        series = [(i, self.path.path.series[i]) for i in numbers]
        for i, q in series:
            terms = list[ir.Value]()
            for t in q.terms:
                total = _in_lane(ir.entry(SUM, len(between)))
                contribution, rest = _orders(layout, t)
                terms += [total if t.kind == "product" else ir.Binary("*", SHARE, total), *rest]
                between.append(ir.Assign(total, contribution, adds=True))
            value = ir.joined("+", *terms) if terms else self.path.linear(q) or ir.Constant(0.0)
            value = ir.Binary("/", ir.Grouped(value), layout.order(q.divisor, ZERO)) if q.divisor is not None else value
            ends.append(ir.Assign(layout.order(i, K), value))
        reads = self.path.reads(factor for _, q in series for _, factor in q.linear)
        sums = ir.vectors(ir.Vector(ir.Constant(max(1, len(between))), lanes=True), SUM)
        over_orders = ir.Loop("stages", tuple(_over_lanes(between)), "j", ir.Constant(1), K)
        body = (*reads, sums, ir.Clear(SUM, None, None), over_orders, *_over_lanes(ends))
        share = [ir.real(SHARE, ir.Binary("/", ONE, ir.Cast(K, "real")))] * (SHARE.symbol in names_in(body))
        doc = f"Coefficient k >= 1 of {purpose}: first convolutions over orders between 0 and k, then all other terms"
        return typed_function(name, doc, ("coef", "e", "k"), (*share, *body), _TYPES)

    def variation(
        self, name: str, array: str, jacobian: Sequence[SeriesEntry], width: int, description: str
    ) -> ir.Function:
        """Return the function that adds one product of two Taylor coefficients to the derivatives of the path.

        The factors are the coefficient of order j of ∂(π p)/∂m, and the coefficient of order k − j of the derivatives.
        The generated function has the arguments j and k. The derivatives are matrices with ``width`` columns, in the
        member ``array`` of the record ``e``. The text ``description`` names the derivatives in the comment of the
        generated function.
        """
        statements = list[ir.Statement]()
        for e in jacobian:
            entry = ir.Binary("*", SHARE, self.path.layout.order(e.series, J))
            statements.append(ir.real(_entry(e), entry))
        for row in range(self.path.program.dimension):
            entries = [e for e in jacobian if e.row == row]
            for k in range(width if entries else 0):
                products = [ir.Binary("*", _entry(e), _in_lane(ir.entry(FROM, e.column * width + k))) for e in entries]
                statements.append(
                    ir.Assign(_in_lane(ir.entry(TO, row * width + k)), ir.joined("+", *products), adds=True)
                )
        before = ir.Entry(ir.Member(E, array), ir.Binary("-", K, J))
        doc = f"Contribution of order j of d(pi p)/dm to order k + 1 of {description}"
        return _of_order(name, doc, ("e", "j", "k"), array, statements, {FROM: before})

    def source(
        self, name: str, array: str, entries: Sequence[tuple[int, ir.Value, SeriesEntry]], description: str
    ) -> ir.Function:
        """Return the function that adds one term for each item of ``entries`` to the derivatives of the path.

        An item has the index of a derivative, a factor, and a matrix entry. The term is the factor times the Taylor
        coefficient of order k of the matrix entry. `PathSlopes` defines the derivatives and the matrices: ∂(π p)/∂m, π,
        and ∂(π p)/∂c for coefficients c. For ``description`` see `variation`.
        """
        statements = [
            ir.Assign(_in_lane(ir.entry(TO, i)), ir.Binary("*", factor, self.path.layout.order(e.series, K)), adds=True)
            for i, factor, e in entries
        ]
        doc = f"Contribution of order k of the entries of pi to order k + 1 of {description}"
        return _of_order(name, doc, ("e", "k"), array, statements, {})


def _of_order(
    name: str,
    doc: str,
    parameters: Sequence[str],
    array: str,
    statements: Sequence[ir.Statement],
    places: dict[ir.Name, ir.Value],
) -> ir.Function:
    """Return a function that adds terms to Taylor coefficients of derivatives of the path. The order of these
    coefficients is k + 1, where k is an argument of the function.

    The body is a loop over lanes, and ``statements`` is the body of this loop.
    """
    pointers = {**places, TO: ir.Entry(ir.Member(E, array), ir.plus(K, 1))}
    body = (
        ir.Declare(ir.Pointer(constant=False, lanes=True), tuple((n.symbol, place) for n, place in pointers.items())),
        ir.real(SHARE, ir.Binary("/", ONE, ir.Cast(ir.plus(K, 1), "real"))),
        _lanes(statements),
    )
    return typed_function(name, doc, parameters, body if statements else (), _TYPES)


#: Type of each parameter of the functions that `lane_functions` returns.
_TYPES: Mapping[str, ir.ParameterType] = {
    "coef": ir.Vector(None, lanes=True, restricted=True),
    "e": ir.RecordType("expansion", mutable=True),
    "j": ir.Type.FLAG,
    "k": ir.Type.FLAG,
}


def _lanes(statements: Iterable[ir.Statement]) -> ir.Loop:
    return ir.Loop("lanes", tuple(statements), "lane", ZERO, ir.fixed("LANES"), independent="LANE")


def _over_lanes(statements: Sequence[ir.Statement]) -> Iterator[ir.Loop]:
    """Divide ``statements`` into pieces of at most `LONGEST_LOOP` statements, and yield a loop over all lanes for each
    piece.
    """
    for start in range(0, len(statements), LONGEST_LOOP):
        yield _lanes(statements[start : start + LONGEST_LOOP])


def _orders(layout: PathLayout, t: ConvolutionTerm) -> tuple[ir.Value, list[ir.Value]]:
    """Return a convolution of two series at order k (see `ConvolutionTerm`) in two parts: a summand and a list of end
    terms.

    The summand contains a_j b_{k−j} and is to be summed over 0 < j < k; for some kinds of convolutions, the caller
    multiplies the sum by 1/k. The end terms contain the coefficients of order 0 and k.
    """
    a, b, real = layout.order(t.a, J), layout.order(t.b, ir.Binary("-", K, J)), ir.Cast(J, "real")
    last = (layout.order(t.a, K), layout.order(t.b, ZERO))
    match t.kind:
        case "product" if t.a == t.b:
            return ir.joined("*", a, b), [ir.joined("*", ir.Constant(2.0), *last)]
        case "product":
            return ir.joined("*", a, b), [
                ir.joined("*", layout.order(t.a, ZERO), layout.order(t.b, K)),
                ir.joined("*", *last),
            ]
        case "chain":
            return ir.joined("*", real, a, b), [ir.joined("*", *last)]
    weight = ir.Binary("-", ir.joined("*", ir.Binary("+", _exponent(t), ONE), real), ir.Cast(K, "real"))
    return ir.joined("*", weight, a, b), [ir.joined("*", _exponent(t), *last)]


# ---- values


def _in_lane(array: ir.Value) -> ir.Entry:
    return ir.Entry(array, LANE)


def _entry(e: SeriesEntry) -> ir.Name:
    return ir.fixed(f"a{e.row}_{e.column}")


def _expanded(e: Expression) -> Expression:
    return expand_powers([e])[0]


def _exponent(t: ConvolutionTerm) -> ir.Value:
    """Return the exponent of a power as a quotient of two numbers."""
    numerator, denominator = (ir.Constant(float(n)) for n in (t.exponent.numerator, t.exponent.denominator))
    return ir.Binary("/", numerator, denominator)
