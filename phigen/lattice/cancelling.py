"""Cancellation of parameters that have a value at every site and may be 0, such as the masses of test
particles.

A factor m of H and a factor 1/m of a bracket are cancelled, so that the equations of motion are defined at m = 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from phigen.lattice.cell import GRID, Cell
from phigen.symbolic.expression import ONE, Expression, fold, gradient, mul, power, product, rebuild, symbol
from phigen.symbolic.neighbours import ENDS

#: An expression f·Π s^k with powers of certain symbols s, as a pair: the factor f, and a map from each s to its
#: exponent k.
Factored = tuple[Expression, Mapping[str, int]]


def cancelled(values: Sequence[Expression], names: Iterable[str]) -> list[Expression]:
    """Return the expressions after combining the powers of each symbol in ``names``: m·m⁻¹ becomes 1."""
    return [_multiplied(f) for f in _factored(values, names)]


def divided(e: Expression, exponents: Mapping[str, int]) -> Expression:
    """Return ``e`` divided by powers of symbols, in a form without common factors. ``exponents`` has the exponents by
    symbol.
    """
    return cancelled([mul(e, powers({name: -k for name, k in exponents.items()}))], exponents)[0]


def common_powers(values: Sequence[Expression], names: Iterable[str]) -> dict[str, int]:
    """Return the greatest exponent k of each symbol in ``names`` for which symbol^k divides all expressions.

    Symbols with k = 0 are left out.
    """
    exponent_maps = [exponents for _, exponents in _factored(values, names)]
    lowest = (
        {name: min(exponents.get(name, 0) for exponents in exponent_maps) for name in names} if exponent_maps else {}
    )
    return {name: k for name, k in lowest.items() if k > 0}


def powers(exponents: Mapping[str, int]) -> Expression:
    """Return the product of the symbols, each raised to its exponent."""
    return product(power(symbol(name), k) for name, k in exponents.items())


@dataclass(frozen=True)
class SumFactors:
    """The common factor of the forces that bonds or pairs exert on one field.

    The factor is a product of powers of parameters. These parameters have a value at every site, which may be 0.
    Solvers sum the forces without the factor, and then multiply the sum by the factor. ``at_site`` is the factor as an
    expression. ``at_end`` is the factor as a map from symbols such as ``m[a]`` to their exponents. Bonds and pairs have
    the ends a and b; the site is at the end a.
    """

    at_site: Expression = ONE
    at_end: Mapping[str, int] = field(default_factory=dict)


def sum_factors(cell: Cell, name: str) -> SumFactors:
    """Return the factor that all summands of the force on the field ``name`` have in common.

    The factor is 1 if the lattice is a grid, if there are brackets along bonds, or if no parameter may be 0.
    """
    if not cell.vanishing or cell.bond_bracket or cell.relation == GRID:
        return SumFactors()
    density = cell.bond_hamiltonian + cell.pair_hamiltonian
    slopes = {end: gradient(density, [cell.at(name, (end,))])[0] for end in ENDS}
    exponents: list[dict[str, int]] = [
        {p: common_powers([slope], [cell.at(p, (end,))]).get(cell.at(p, (end,)), 0) for p in sorted(cell.vanishing)}
        for end, slope in slopes.items()
        if not slope.is_zero
    ]
    common = {p: min(of_end[p] for of_end in exponents) for p in sorted(cell.vanishing)} if exponents else {}
    common = {p: k for p, k in common.items() if k}
    return SumFactors(powers(common), {cell.at(p, ("a",)): k for p, k in common.items()})


def _factored(values: Sequence[Expression], names: Iterable[str]) -> list[Factored]:
    separated = frozenset(names)

    def visit(node: Expression, args: list[Factored]) -> Factored:
        match node.op:
            case "symbol" if node.value in separated:
                return ONE, {node.value: 1}
            case "mul":
                (a, of_a), (b, of_b) = args
                return mul(a, b), {name: of_a.get(name, 0) + of_b.get(name, 0) for name in of_a.keys() | of_b.keys()}
            case "neg":
                return rebuild(node, [args[0][0]]), args[0][1]
            case "pow" if node.value.denominator == 1:
                base, exponents = args[0]
                return power(base, node.value), {name: k * int(node.value) for name, k in exponents.items()}
            case "add" | "sub":
                bases = args[0][1].keys() | args[1][1].keys()
                common = {name: min(exponents.get(name, 0) for _, exponents in args) for name in bases}
                rests = [_multiplied((e, {n: of_e.get(n, 0) - k for n, k in common.items()})) for e, of_e in args]
                return rebuild(node, rests), common
        return rebuild(node, [_multiplied(a) for a in args]), {}

    return fold(values, visit)


def _multiplied(value: Factored) -> Expression:
    cofactor, exponents = value
    nonzero = {name: k for name, k in sorted(exponents.items()) if k}
    return mul(cofactor, powers(nonzero)) if nonzero else cofactor
