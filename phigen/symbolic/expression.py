"""Expressions: an immutable, interned directed acyclic graph of real arithmetic.

All formulas in phigen are expressions: the parser makes them, the geometry differentiates them, the scheme assembles
the one-step map from them, and the targets print them. Two formulas that are built in the same way are the same object,
so a shared sub-expression is stored, differentiated and printed once.

Node kinds (``op``):

=========== ======================= =====================================
op          value                   args
=========== ======================= =====================================
``number``  `fractions.Fraction`    ()
``symbol``  its name                ()
``pi``/``E`` ``None``               ()
``add``     ``None``                (a, b)
``sub``     ``None``                (a, b)
``neg``     ``None``                (a,)
``mul``     ``None``                (a, b)
``pow``     the rational exponent   (base,)
a function  ``None``                its arguments, see `phigen.symbolic.functions`
=========== ======================= =====================================

A quotient is a product with a ``pow`` of exponent −1. Names of symbols that phigen adds contain a colon, such as
``p:x1`` and ``h:`` (`phigen.symbolic.symbols`). Names in a spec contain no colon, so that they cannot clash with
symbols of phigen.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache, reduce
from hashlib import blake2b
from typing import Any, TypeVar
from weakref import ref

from phigen import progress
from phigen.symbolic.functions import FUNCTIONS

_RANK = {"number": 0, "pi": 1, "E": 1, "symbol": 2}

#: An expression with this number of nodes is large: a walk over it takes a tenth of a second or more, and reports
#: progress.
LARGE_GRAPH = 10_000

Number = int | Fraction
T = TypeVar("T")


class Expression:
    """A node of the graph of expressions. Nodes are made by the functions of this module and by operators only."""

    __slots__ = ("__weakref__", "_digest", "args", "depth", "op", "value")

    op: str
    args: tuple[Expression, ...]
    value: Any
    depth: int
    _digest: bytes  # hash of the content; empty until the property `digest` computes it

    def __add__(self, other: Expression | Number) -> Expression:
        return add(self, as_expression(other))

    def __radd__(self, other: Number) -> Expression:
        return add(as_expression(other), self)

    def __sub__(self, other: Expression | Number) -> Expression:
        return sub(self, as_expression(other))

    def __rsub__(self, other: Number) -> Expression:
        return sub(as_expression(other), self)

    def __mul__(self, other: Expression | Number) -> Expression:
        return mul(self, as_expression(other))

    def __rmul__(self, other: Number) -> Expression:
        return mul(as_expression(other), self)

    def __truediv__(self, other: Expression | Number) -> Expression:
        return mul(self, power(as_expression(other), -1))

    def __rtruediv__(self, other: Number) -> Expression:
        return mul(as_expression(other), power(self, -1))

    def __pow__(self, exponent: Expression | Number) -> Expression:
        return power(self, exponent)

    def __neg__(self) -> Expression:
        return neg(self)

    @property
    def is_zero(self) -> bool:
        """Whether this is the literal number 0; an expression such as sin² + cos² − 1 is not."""
        return self is ZERO

    @property
    def is_number(self) -> bool:
        """Whether this is a literal rational number."""
        return self.op == "number"

    @property
    def digest(self) -> bytes:
        """A hash of the content, equal in every process; it determines the order of commuting factors."""
        stack = [] if self._digest else [self]
        while stack:
            node = stack[-1]
            left = [a for a in node.args if not a._digest]
            if left:
                stack += left
            else:
                head = f"{node.op}|{node.value}".encode()
                node._digest = blake2b(b"|".join([head, *(a._digest for a in node.args)]), digest_size=10).digest()
                stack.pop()
        return self._digest

    def __str__(self) -> str:
        return text(self)

    def __repr__(self) -> str:
        return f"<{text(self)}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _node, (self.op, self.args, self.value)


class _Reference(ref[Expression]):
    """Weak reference to a node. It is stored under ``key`` in the table of all nodes, and removed from the table when
    the node is deleted.
    """

    __slots__ = ("key",)

    key: tuple[Any, ...]


_NODES: dict[tuple[Any, ...], _Reference] = {}


def _forget(dead: _Reference, nodes: dict[tuple[Any, ...], _Reference] = _NODES) -> None:
    if nodes.get(dead.key) is dead:
        del nodes[dead.key]


def _node(op: str, args: tuple[Expression, ...] = (), value: Any = None) -> Expression:
    # The keys contain integers, not fractions: at interpreter exit, keys are still compared when nodes are removed from
    # the table, and Fraction may not work any more.
    key = (op, (value.numerator, value.denominator) if type(value) is Fraction else value, args)
    weak = _NODES.get(key)
    node = weak() if weak else None
    if node is None:
        node = Expression.__new__(Expression)
        node.op, node.args, node.value, node._digest = op, args, value, b""
        depth = 0
        for a in args:
            depth = max(a.depth, depth)
        node.depth = 1 + depth
        reference = _NODES[key] = _Reference(node, _forget)
        reference.key = key
    return node


@lru_cache(maxsize=4096)
def natural_key(name: str) -> tuple[tuple[int, int | str], ...]:
    """Return a sort key for names by which ``x2`` precedes ``x10``."""
    return tuple((0, int(t)) if t.isdigit() else (1, t) for t in re.findall(r"\d+|\D+", name))


def _ordered(a: Expression, b: Expression) -> tuple[Expression, Expression]:
    """Return two terms or factors in a fixed order, which is the same in every process."""
    first, second = _place(a), _place(b)
    if first == second:
        first, second = a.digest, b.digest
    return (b, a) if second < first else (a, b)


def _place(e: Expression) -> Any:
    name = natural_key(e.value) if e.op == "symbol" else ()
    return _RANK.get(e.op, 3), name, e.depth


def raw(op: str, args: tuple[Expression, ...], value: Any = None) -> Expression:
    """Return a node without simplification, for passes that choose the form of the code themselves."""
    return _node(op, args, value)


def number(value: Number) -> Expression:
    """Return a literal rational number."""
    return _node("number", (), value if type(value) is Fraction else Fraction(value))


def symbol(name: str) -> Expression:
    """Return the symbol of that name; two symbols are the same object if and only if their names are equal."""
    if type(name) is str and ":" in name:
        raise ValueError(
            f"{name!r} is no name of a spec, since it contains ':'; names that phigen adds have the type Symbol"
        )
    return _node("symbol", (), name)


def as_expression(value: Expression | Number) -> Expression:
    """Return an expression unchanged, and a number as a literal."""
    return value if isinstance(value, Expression) else number(value)


ZERO = number(0)
ONE = number(1)
PI = _node("pi")
EULER = _node("E")


def add(a: Expression, b: Expression) -> Expression:
    """Return a + b, simplified."""
    if a.is_zero:
        return b
    if b.is_zero:
        return a
    if a.is_number and b.is_number:
        return number(a.value + b.value)
    if b.op == "neg":
        return sub(a, b.args[0])
    if a.op == "neg":
        return sub(b, a.args[0])
    if _has_minus(b):
        return sub(a, neg(b))
    if _has_minus(a):
        return sub(b, neg(a))
    return _node("add", _ordered(a, b))


def sub(a: Expression, b: Expression) -> Expression:
    """Return a − b, simplified."""
    if b.is_zero:
        return a
    if a is b:
        return ZERO
    if a.is_zero:
        return neg(b)
    if a.is_number and b.is_number:
        return number(a.value - b.value)
    if b.op == "neg":
        return add(a, b.args[0])
    if a.op == "neg":
        return neg(add(a.args[0], b))
    if (b.is_number and b.value < 0) or _has_minus(b):
        return add(a, neg(b))
    return _node("sub", (a, b))


def _has_minus(e: Expression) -> bool:
    return e.op == "mul" and e.args[0].is_number and e.args[0].value < 0


def neg(a: Expression) -> Expression:
    """Return −a, simplified."""
    if a.is_number:
        return number(-a.value)
    if a.op == "neg":
        return a.args[0]
    if a.op == "sub":
        return sub(a.args[1], a.args[0])
    if a.op == "mul" and a.args[0].is_number:
        return mul(number(-a.args[0].value), a.args[1])
    return _node("neg", (a,))


def mul(a: Expression, b: Expression) -> Expression:
    """Return a · b, simplified."""
    if a.is_number and b.is_number:
        return number(a.value * b.value)
    if b.is_number:
        a, b = b, a
    if a.is_number:
        if a.value == 0:
            return ZERO
        if a.value == 1:
            return b
        if b.op == "neg":
            return mul(number(-a.value), b.args[0])
        if b.op == "mul" and b.args[0].is_number:
            return mul(number(a.value * b.args[0].value), b.args[1])
        if a.value == -1:
            return neg(b)
        return _node("mul", (a, b))
    if a.op == "neg":
        return neg(mul(a.args[0], b))
    if b.op == "neg":
        return neg(mul(a, b.args[0]))
    # A number becomes the outermost factor, so that it is combined with the numbers of later factors.
    if a.op == "mul" and a.args[0].is_number:
        return mul(a.args[0], mul(a.args[1], b))
    if b.op == "mul" and b.args[0].is_number:
        return mul(b.args[0], mul(a, b.args[1]))
    if a is b:
        return power(a, 2)
    if a.op == "pow" and a.args[0] is b:
        return power(b, a.value + 1)
    if b.op == "pow" and b.args[0] is a:
        return power(a, b.value + 1)
    if a.op == "pow" and b.op == "pow" and a.args[0] is b.args[0]:
        return power(a.args[0], a.value + b.value)
    return _node("mul", _ordered(a, b))


def power(base: Expression, exponent: Expression | Number) -> Expression:
    """Return base ** exponent, simplified. If the exponent is not a rational number, the result calls the function
    ``power``.
    """
    if isinstance(exponent, Expression):
        if not exponent.is_number:
            return call("power", base, exponent)
        value: Fraction = exponent.value
        exponent = value
    exponent = Fraction(exponent)
    if exponent == 0:
        return ONE
    if exponent == 1:
        return base
    integer = exponent.denominator == 1
    if base.is_number:
        if base.value == 1:
            return ONE
        if integer and (base.value != 0 or exponent > 0):
            return number(base.value ** int(exponent))
        if base.value == 0 and exponent > 0:
            return ZERO
    if integer and base.op == "pow":
        return power(base.args[0], base.value * exponent)
    if integer and base.op == "neg":
        inner = power(base.args[0], exponent)
        return inner if exponent % 2 == 0 else neg(inner)
    if integer and base.op == "mul" and base.args[0].is_number:
        return mul(power(base.args[0], exponent), power(base.args[1], exponent))
    return _node("pow", (base,), exponent)


def sqrt(a: Expression) -> Expression:
    """Return the square root, as a power of exponent ½."""
    return power(a, Fraction(1, 2))


def call(function: str, *args: Expression) -> Expression:
    """Return the call of the function with this name in `FUNCTIONS`.

    If the value is known to be rational, such as log(1) = 0, the result is this number instead of a call.
    """
    record = FUNCTIONS[function]
    if record.arity != len(args):
        raise ValueError(f"{function} takes {record.arity} argument(s), not {len(args)}")
    first = args[0]
    if first.is_zero and record.at_zero is not None:
        return number(record.at_zero)
    if function == "log" and first is ONE:
        return ZERO
    if record.rational and record.value and all(a.is_number for a in args):
        return number(record.value(None, *(a.value for a in args)))
    return _node(function, args)


def total(terms: Iterable[Expression]) -> Expression:
    """Return the sum of the terms as a balanced tree.

    Compared with a chain of additions, a balanced tree has smaller rounding errors, and a processor can execute more of
    its additions in parallel.
    """
    return _balanced(add, list(terms), ZERO)


def total_at(terms: Mapping[int, Expression]) -> Expression:
    """Return the `total` of a list, given by its nonzero terms: position in the list → term.

    The terms are added in the same order as in `total`, so the result is the same as for the list with its zeros.
    """
    items = dict(sorted(terms.items()))
    while len(items) > 1 or any(items):
        sums: dict[int, Expression] = {}
        for position, e in items.items():
            parent = position // 2
            sums[parent] = add(sums[parent], e) if parent in sums else e
        items = sums
    return items.get(0, ZERO)


def product(factors: Iterable[Expression]) -> Expression:
    """Return the product of the factors, as a balanced tree."""
    return _balanced(mul, list(factors), ONE)


def _balanced(
    combine: Callable[[Expression, Expression], Expression], items: list[Expression], empty: Expression
) -> Expression:
    if not items:
        return empty
    while len(items) > 1:
        pairs = [combine(items[i], items[i + 1]) for i in range(0, len(items) - 1, 2)]
        items = pairs + (items[-1:] if len(items) % 2 else [])
    return items[0]


def topological(roots: Iterable[Expression], excluded: Container[int] = ()) -> list[Expression]:
    """Return the roots and all nodes below them; the arguments of a node come before the node.

    The order depends only on the expressions, not on addresses in memory. Nodes whose ``id`` is in ``excluded`` are
    left out. A node that occurs only as an argument of excluded nodes is left out too.
    """
    order: list[Expression] = []
    visited: set[Expression] = set()
    for root in roots:
        stack = [] if root in visited or (excluded and id(root) in excluded) else [root]
        while stack:
            for a in stack[-1].args:
                if a in visited or (excluded and id(a) in excluded):
                    continue
                if a.args:
                    stack.append(a)
                    break
                visited.add(a)
                order.append(a)
            else:
                node = stack.pop()
                visited.add(node)
                order.append(node)
    return order


def symbols_of(*roots: Expression) -> list[str]:
    """Return the names of the symbols in the expressions, sorted by `natural_key`."""
    return sorted({e.value for e in topological(roots) if e.op == "symbol"}, key=natural_key)


def fold(roots: Sequence[Expression], visit: Callable[[Expression, list[T]], T]) -> list[T]:
    """Return the values of the roots, computed from the leaves upwards.

    ``visit(node, values)`` returns the value of a node from the list of the values of its arguments. Every node is
    visited once, even if several nodes use it. Substitution, evaluation, conversion and printing of expressions are
    calls of this function.
    """
    values: dict[Expression, T] = {}
    for node in _with_progress(topological(roots)):
        values[node] = visit(node, [values[a] for a in node.args])
    return [values[r] for r in roots]


def _with_progress(order: Sequence[Expression]) -> Iterable[Expression]:
    """Return an iterable over the nodes. It reports progress if there are at least `LARGE_GRAPH` nodes."""
    if len(order) < LARGE_GRAPH:
        return order

    def counted() -> Iterator[Expression]:
        with progress.stage("expressions", len(order)) as running:
            for node in order:
                yield node
                running.done += 1

    return counted()


_BUILDERS: dict[str, Callable[..., Expression]] = {"add": add, "sub": sub, "neg": neg, "mul": mul, "power": power}


def rebuild(node: Expression, args: Sequence[Expression]) -> Expression:
    """Return the node with its arguments replaced by ``args``; the result is simplified."""
    if not node.args:
        return node
    if node.op == "pow":
        return power(args[0], node.value)
    build = _BUILDERS.get(node.op)
    return build(*args) if build else call(node.op, *args)


def familiar(roots: Sequence[Expression]) -> list[Expression]:
    """Return the expressions ``roots`` with well-known functions in place of internal functions of phigen; for
    instance, cos √s replaces cosroot(s).

    If a replacement has two forms, for positive and for negative arguments, the form for positive arguments is used.
    """

    def visit(node: Expression, args: list[Expression]) -> Expression:
        known_values = FUNCTIONS[node.op].known if node.op in FUNCTIONS else None
        if known_values:
            return familiar([known_values(call, *args)])[0]
        same = all(a is b for a, b in zip(args, node.args, strict=True))
        return node if same else rebuild(node, args)

    return fold(roots, visit)


def substitute(roots: Sequence[Expression], values: Mapping[str, Expression]) -> list[Expression]:
    """Return the roots with symbols replaced by their ``values``. All symbols are replaced simultaneously."""

    def visit(node: Expression, args: list[Expression]) -> Expression:
        if node.op == "symbol":
            return values.get(node.value, node)
        return rebuild(node, args)

    return fold(roots, visit)


def partials(e: Expression) -> list[Expression]:
    """Return the partial derivatives of a node with respect to its arguments."""
    if not e.args:
        return []
    a = e.args[0]
    match e.op:
        case "add":
            return [ONE, ONE]
        case "sub":
            return [ONE, number(-1)]
        case "neg":
            return [number(-1)]
        case "mul":
            return [e.args[1], a]
        case "pow":
            return [e.value * power(a, e.value - 1)]
    slopes = FUNCTIONS[e.op].slopes
    if slopes is None:
        raise ValueError(f"no derivative is known for {e.op}")
    return [as_expression(d) for d in slopes(call, e, *e.args)]


def derivatives(roots: Sequence[Expression], name: str) -> list[Expression]:
    """Return the derivative of each root with respect to the symbol ``name``, by forward accumulation."""

    def visit(node: Expression, args: list[tuple[Expression, Expression]]) -> tuple[Expression, Expression]:
        if node.op == "symbol":
            return node, ONE if node.value == name else ZERO
        if all(d.is_zero for _, d in args):
            return node, ZERO
        terms = [partial * d for partial, (_, d) in zip(partials(node), args, strict=True) if not d.is_zero]
        return node, reduce(add, terms)

    return [d for _, d in fold(roots, visit)]


def sparse_derivatives(roots: Sequence[Expression], names: Iterable[str]) -> list[dict[str, Expression]]:
    """Return one dictionary for each root: name of a symbol → partial derivative with respect to this symbol.
    Derivatives that are 0 are left out.

    The results equal those of `derivatives`, but one walk over the expressions serves all names.
    """
    variables = frozenset(names)
    slopes: dict[int, dict[str, Expression]] = {}
    for node in _with_progress(topological(roots)):
        if node.op == "symbol":
            slopes[id(node)] = {node.value: ONE} if node.value in variables else {}
            continue
        row: dict[str, Expression] = {}
        if any(slopes[id(a)] for a in node.args):
            for partial, a in zip(partials(node), node.args, strict=True):
                for name, d in slopes[id(a)].items():
                    # Sums are the most frequent nodes. Their partial derivatives are 1, so the product is left out.
                    term = d if partial is ONE else mul(partial, d)
                    row[name] = add(row[name], term) if name in row else term
        slopes[id(node)] = {name: d for name, d in row.items() if not d.is_zero}
    return [slopes[id(r)] for r in roots]


def derivative(e: Expression, name: str) -> Expression:
    """Return the derivative of an expression with respect to the symbol ``name``."""
    return derivatives([e], name)[0]


def gradient(e: Expression, names: Sequence[str]) -> list[Expression]:
    """Return the derivatives of one expression with respect to many symbols, by reverse accumulation."""
    order = topological([e])
    variables = set(names)
    active: set[int] = set()
    for node in order:
        if (node.op == "symbol" and node.value in variables) or any(id(a) in active for a in node.args):
            active.add(id(node))
    contributions: dict[int, list[Expression]] = {id(e): [ONE]}
    adjoint_of: dict[str, Expression] = {}
    for node in reversed(order):
        if id(node) not in active:
            continue
        adjoint = total(contributions.pop(id(node), []))
        if node.op == "symbol":
            adjoint_of[node.value] = adjoint
        elif not adjoint.is_zero:
            for partial, a in zip(partials(node), node.args, strict=True):
                if id(a) in active:
                    contributions.setdefault(id(a), []).append(adjoint * partial)
    return [adjoint_of.get(n, ZERO) for n in names]


_PRECEDENCE = {"add": 1, "sub": 1, "neg": 1, "mul": 2, "pow": 3}


def text(e: Expression, longest: int = 2000) -> str:
    """Return the expression in the syntax of a spec; parsing the text yields an equal expression.

    The text is for messages. Shared sub-expressions are written out at each occurrence. A text of more than ``longest``
    characters is cut, and ends with an ellipsis.
    """

    def wrap(part: tuple[str, int], level: int) -> str:
        return part[0] if part[1] >= level else f"({part[0]})"

    def visit(node: Expression, args: list[tuple[str, int]]) -> tuple[str, int]:
        match node.op:
            case "number":
                is_integer = node.value.denominator == 1
                return str(node.value), (4 if is_integer and node.value >= 0 else 2 if node.value > 0 else 1)
            case "symbol":
                return node.value, 4
            case "pi" | "E":
                return node.op, 4
            case "add":
                written = f"{wrap(args[0], 1)} + {wrap(args[1], 2)}", 1
            case "sub":
                written = f"{wrap(args[0], 1)} - {wrap(args[1], 2)}", 1
            case "neg":
                written = f"-{wrap(args[0], 2)}", 1
            case "mul":
                if node.args[1].op == "pow" and node.args[1].value == -1:
                    written = f"{wrap(args[0], 2)}/{args[1][0].removeprefix('1/')}", 2
                else:
                    written = f"{wrap(args[0], 2)}*{wrap(args[1], 3)}", 2
            case "pow":
                if node.value == Fraction(1, 2):
                    written = f"sqrt({args[0][0]})", 4
                elif node.value == -1:
                    written = f"1/{wrap(args[0], 4)}", 2
                elif node.value.denominator == 1 and node.value > 0:
                    written = f"{wrap(args[0], 4)}**{node.value}", 3
                else:
                    written = f"{wrap(args[0], 4)}**({node.value})", 3
            case "power":
                written = f"{wrap(args[0], 4)}**({args[1][0]})", 3
            case _:
                written = f"{node.op}({', '.join(a for a, _ in args)})", 4
        return (written[0], written[1]) if len(written[0]) <= longest else ("…", 4)

    return fold([e], visit)[0][0]
