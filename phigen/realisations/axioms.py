"""The axioms of a bi-realisation, proved for each build rather than assumed for each kind.

With {F, G} = Σ_i ∂F/∂x_i ∂G/∂p_i − ∂F/∂p_i ∂G/∂x_i on (x, p):

    α(x, 0) = β(x, 0) = x,   {α_i, α_j} = π_ij∘α,   {β_i, β_j} = −π_ij∘β,   {α_i, β_j} = 0

(paper, section "Bi-realisation I", definition 1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from phigen.geometry.system import System
from phigen.realisations import truncated
from phigen.realisations.protocol import BiRealisation, covector_names
from phigen.realisations.pullback import is_composed
from phigen.symbolic.expression import ZERO, Expression, call, fold, number, rebuild, substitute, symbol, symbols_of
from phigen.symbolic.tower import Poly, Tower
from phigen.symbolic.verdict import Statement, decide_elements, decide_zero


def check(system: System, realisation: BiRealisation) -> list[Statement]:
    """Statements on the unit, the three families of brackets, and the simplified forms used by the solver.

    Of a pull-back the brackets are proved in the other coordinates. Of a truncation (``exact`` False), and of the
    formal series of a path, the brackets are stated, and proved, up to its degree less one.
    """
    if realisation.inner is not None and is_composed(system, realisation):
        return [_unit(system, realisation), *_inner(realisation.inner), _simplified_forms(system, realisation)]
    degree = None if realisation.exact and not realisation.path else realisation.degree
    return [
        _unit(system, realisation),
        *(_brackets(system, realisation) if degree is None else truncated.brackets(system, realisation, degree)),
        _simplified_forms(system, realisation),
    ]


def _inner(inner: tuple[System, BiRealisation]) -> list[Statement]:
    """The brackets of what is pulled back, said to be in its coordinates."""
    where = f"in the coordinates {', '.join(inner[0].coordinates)}"
    return [replace(s, detail=f"{s.detail}, {where}" if s.detail else where) for s in check(*inner)[1:4]]


def _unit(system: System, realisation: BiRealisation) -> Statement:
    zero = dict.fromkeys(covector_names(system.coordinates), ZERO)
    residuals = []
    for name, maps in (("alpha", realisation.alpha), ("beta", realisation.beta)):
        for c, image in zip(system.coordinates, substitute(maps, zero), strict=True):
            residuals.append((f"{name} of {c}", image - symbol(c)))
    return decide_zero("bi-realisation: α(x, 0) = β(x, 0) = x", residuals, system.positive)


def _simplified_forms(system: System, realisation: BiRealisation) -> Statement:
    residuals = []
    for i, c in enumerate(system.coordinates):
        a, b = realisation.alpha[i], realisation.beta[i]
        residuals.append((f"displacement of {c}", realisation.displacement[i] - (a - symbol(c))))
        residuals.append((f"increment of {c}", realisation.increment[i] - (b - a)))
    name = "bi-realisation: the simplified α − x and β − α"
    return decide_zero(name, [(label, _in_exponentials(e)) for label, e in residuals], system.positive)


def _in_exponentials(e: Expression) -> Expression:
    """Hyperbolic functions written with exp, whose relations the ring knows."""

    def visit(node: Expression, args: list[Expression]) -> Expression:
        if node.op in ("sinh", "cosh"):
            up, down = call("exp", args[0]), call("exp", -args[0])
            return number(Fraction(1, 2)) * (up - down if node.op == "sinh" else up + down)
        return rebuild(node, args)

    return fold([e], visit)[0]


def _pulled_back(system: System, maps: Sequence[Expression], pairs: Sequence[tuple[int, int]]) -> list[Expression]:
    """π_ij∘maps for the pairs."""
    return substitute([system.poisson[i][j] for i, j in pairs], dict(zip(system.coordinates, maps, strict=True)))


def _brackets(system: System, realisation: BiRealisation) -> Iterator[Statement]:
    covector = covector_names(system.coordinates)
    variables = [*system.coordinates, *covector]
    alpha, beta = list(realisation.alpha), list(realisation.beta)
    pairs = [(i, j) for j in range(len(alpha)) for i in range(j)]
    at_alpha = _pulled_back(system, alpha, pairs)
    at_beta = _pulled_back(system, beta, pairs)
    everything = [*alpha, *beta, *at_alpha, *at_beta]
    others = [s for s in symbols_of(*everything) if s not in variables]
    tower = Tower([*variables, *others], everything, variables)
    images = tower.convert_all(everything)
    n, m = len(alpha), len(pairs)
    a = [_Differential(tower, f, system.coordinates, covector) for f in images[:n]]
    b = [_Differential(tower, f, system.coordinates, covector) for f in images[n : 2 * n]]
    pulled_a, pulled_b = images[2 * n : 2 * n + m], images[2 * n + m :]

    def label(i: int, j: int) -> str:
        return f"({system.coordinates[i]}, {system.coordinates[j]})"

    name = "bi-realisation: "
    yield decide_elements(
        name + "{α_i, α_j} = π_ij∘α",
        tower,
        [(label(i, j), a[i].bracket(a[j]) - f) for (i, j), f in zip(pairs, pulled_a, strict=True)],
        system.positive,
    )
    yield decide_elements(
        name + "{β_i, β_j} = −π_ij∘β",
        tower,
        [(label(i, j), b[i].bracket(b[j]) + f) for (i, j), f in zip(pairs, pulled_b, strict=True)],
        system.positive,
    )
    yield decide_elements(
        name + "{α_i, β_j} = 0",
        tower,
        [(label(i, j), a[i].bracket(b[j])) for i in range(n) for j in range(n)],
        system.positive,
    )


class _Differential:
    """The non-zero partial derivatives of an element in x and in p."""

    def __init__(self, tower: Tower, element: Poly, coordinates: Sequence[str], covector: Sequence[str]) -> None:
        self._zero = tower.zero
        self.in_x = {i: d for i, c in enumerate(coordinates) if (d := tower.derivative(element, c)) != 0}
        self.in_p = {i: d for i, c in enumerate(covector) if (d := tower.derivative(element, c)) != 0}

    def bracket(self, other: _Differential) -> Poly:
        """{self, other}."""
        result = self._zero
        for i, d in self.in_x.items():
            if i in other.in_p:
                result = result + d * other.in_p[i]
        for i, d in self.in_p.items():
            if i in other.in_x:
                result = result - d * other.in_x[i]
        return result
