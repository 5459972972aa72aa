"""Lowering: from expression graphs to assignments that a target prints without further changes.

Two passes run in this order. `expand_powers` writes powers as products, quotients and roots. `assign` stores shared or
long sub-expressions in temporaries. The result is a list of expression trees over symbols.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.symbolic.expression import Expression, fold, raw, symbol, topological
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.symbols import TEMPORARY, Symbol

#: Cost of an operation in units of an addition, from its throughput measured on current x86-64 processors. "call" is a
#: call of a library function.
COST = {"add": 1, "sub": 1, "mul": 1, "neg": 0, "reciprocal": 4, "sqrt": 5, "call": 20}

#: Largest number of operations in one printed statement, so that lines remain readable.
MAX_STATEMENT_OPERATIONS = 14


@dataclass(frozen=True)
class Assignment:
    """The assignment of ``value`` to the name ``target``; ``value`` is an expression tree over symbols and earlier
    temporaries.
    """

    target: str
    value: Expression


def expand_powers(roots: Sequence[Expression]) -> list[Expression]:
    """Return the roots with powers written as products of squares, reciprocals, square roots and cube roots.

    Powers for which this is impossible remain, as calls of pow.
    """

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e.op == "pow":
            return _power(args[0], e.value)
        return raw(e.op, tuple(args), e.value) if e.args else e

    return fold(roots, visit)


def _power(base: Expression, exponent: Fraction) -> Expression:
    if exponent < 0:
        if exponent.denominator == 1:  # all negative powers of the base share one reciprocal
            return _integer_power(raw("pow", (base,), Fraction(-1)), -int(exponent))
        # A fractional power takes one reciprocal root, then products: r**(-3/2) is (1/sqrt(r))**3.
        root = _root(base, exponent.denominator)
        if root is not None:
            return _integer_power(raw("pow", (root,), Fraction(-1)), -exponent.numerator)
        return raw("pow", (base,), exponent)
    if exponent.denominator == 1:
        return _integer_power(base, int(exponent))
    root = _root(base, exponent.denominator)
    if root is None:
        return raw("pow", (base,), exponent)
    quotient, remainder = divmod(exponent.numerator, exponent.denominator)
    part = _integer_power(root, remainder)
    return part if quotient == 0 else raw("mul", (_integer_power(base, quotient), part))


def _root(base: Expression, degree: int) -> Expression | None:
    """Return base^(1/degree) as an expression with square roots and at most one cube root. Other powers of the base can
    share the roots.

    Returns None if ``degree`` is not 2^n or 3·2^n.
    """
    if degree in (2, 3):
        return raw("pow", (base,), Fraction(1, degree))
    half = _root(base, degree // 2) if degree % 2 == 0 else None
    return raw("pow", (half,), Fraction(1, 2)) if half is not None else None


def _integer_power(base: Expression, n: int) -> Expression:
    if n == 1:
        return base
    half = _integer_power(base, n // 2)
    square = raw("pow", (half,), Fraction(2))
    return square if n % 2 == 0 else raw("mul", (base, square))


def cost(roots: Sequence[Expression]) -> int:
    """Return the cost of the expressions ``roots`` in units of an addition (`COST`); a shared value counts once."""
    return sum(_cost(e) for e in topological(expand_powers(roots)))


def _cost(e: Expression) -> int:
    if not e.args:
        return 0
    if e.op == "pow":
        return {Fraction(2): 1, Fraction(-1): COST["reciprocal"], Fraction(1, 2): COST["sqrt"]}.get(
            e.value, COST["call"]
        )
    return FUNCTIONS[e.op].cost if e.op in FUNCTIONS else COST[e.op]


def with_numbers_shared(roots: Sequence[Expression]) -> list[Expression]:
    """Return the expressions ``roots`` with ½(ab) and ½(ac) written as (½a)b and (½a)c, if this saves operations."""
    roots = list(roots)
    while True:
        regrouped = _numbers_regrouped(roots)
        if cost(regrouped) >= cost(roots):
            return roots
        roots = regrouped


def _numbers_regrouped(roots: Sequence[Expression]) -> list[Expression]:
    """Return the expressions ``roots`` with products such as ½(ab), a number times a product, written as (½a)b.

    The number is multiplied with the factor that occurs in the most products with the same number. A product ½(ab)
    remains unchanged if neither a nor b occurs in another product with the number ½.
    """
    scaled = [e for e in topological(roots) if e.op == "mul" and e.args[0].is_number and e.args[1].op == "mul"]
    counts = Counter((e.args[0], factor) for e in scaled for factor in e.args[1].args)
    chosen_factor = {
        e: int(counts[e.args[0], e.args[1].args[1]] > counts[e.args[0], e.args[1].args[0]]) for e in scaled
    }

    def visit(e: Expression, args: list[Expression]) -> Expression:
        if e not in chosen_factor or counts[e.args[0], e.args[1].args[chosen_factor[e]]] == 1:
            return raw(e.op, tuple(args), e.value) if e.args else e
        factor, cofactor = args[1].args if chosen_factor[e] == 0 else args[1].args[::-1]
        return raw("mul", (raw("mul", (args[0], factor)), cofactor))

    return fold(roots, visit)


def operation_counts(roots: Sequence[Expression]) -> dict[str, int]:
    """Return the numbers of additions, multiplications, divisions and function calls that compute all roots
    together."""
    counts = {"additions": 0, "multiplications": 0, "divisions": 0, "functions": 0}
    for e in topological(expand_powers(roots)):
        if e.op in ("add", "sub"):
            counts["additions"] += 1
        elif e.op == "mul" or (e.op == "pow" and e.value == 2):
            counts["multiplications"] += 1
        elif e.op == "pow" and e.value == -1:
            counts["divisions"] += 1
        elif e.args and e.op != "neg":
            counts["functions"] += 1
    return counts


def assign(
    roots: Sequence[Expression], temporaries: Mapping[int, str] | None = None
) -> tuple[list[Assignment], list[Expression]]:
    """Return assignments of temporaries, and the roots as trees over these temporaries.

    A value gets a temporary in four cases: it is used more than once; it is the operand of a square; its tree would
    exceed `MAX_STATEMENT_OPERATIONS` operations; or ``temporaries`` gives it a name, by the ``id`` of its node in the
    graph of ``roots``. The roots must have passed `expand_powers`.
    """
    temporaries = temporaries or {}
    order = topological(roots)
    uses: dict[int, int] = {}
    for e in order:
        for a in e.args:
            uses[id(a)] = uses.get(id(a), 0) + (2 if e.op == "pow" and e.value == 2 else 1)
    for r in roots:
        uses[id(r)] = uses.get(id(r), 0) + 1
    assignments: list[Assignment] = []
    trees: dict[int, Expression] = {}
    sizes: dict[int, int] = {}
    count = 0
    for e in order:
        if not e.args:
            trees[id(e)], sizes[id(e)] = e, 0
            continue
        args = [trees[id(a)] for a in e.args]
        tree = raw(e.op, tuple(args), e.value)
        size = 1 + sum(sizes[id(a)] for a in e.args)
        cheap = e.op == "neg" and not args[0].args
        if id(e) in temporaries or (uses[id(e)] > 1 and not cheap) or size > MAX_STATEMENT_OPERATIONS:
            if id(e) in temporaries:
                target = temporaries[id(e)]
            else:
                count += 1
                target = Symbol(TEMPORARY, count)
            assignments.append(Assignment(target, tree))
            tree, size = symbol(target), 0
        trees[id(e)], sizes[id(e)] = tree, size
    return assignments, [trees[id(r)] for r in roots]


__all__ = ["Assignment", "assign", "cost", "expand_powers", "operation_counts", "with_numbers_shared"]
