"""The axioms of a bi-realisation. They are proved for the maps α and β of each system.

The proofs assume nothing about the kind of a bi-realisation. With {F, G} = Σ_i ∂F/∂x_i ∂G/∂p_i − ∂F/∂p_i ∂G/∂x_i for
functions of (x, p), the axioms are

    α(x, 0) = β(x, 0) = x,   {α_i, α_j} = π_ij∘α,   {β_i, β_j} = −π_ij∘β,   {α_i, β_j} = 0

(the article `PAPER` in `phigen.realisations.protocol`, section "Bi-realisation I", definition 1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from phigen import progress
from phigen.geometry.system import System
from phigen.realisations import truncated
from phigen.realisations.protocol import BiRealisation, covector_names, is_symmetric
from phigen.realisations.pullback import is_composed
from phigen.realisations.sampled import brackets_at_points, is_large
from phigen.symbolic.expression import ZERO, Expression, call, fold, number, rebuild, substitute, symbol, symbols_of
from phigen.symbolic.tower import Poly, Tower
from phigen.symbolic.verdict import Statement, decide_elements, decide_zero

#: Names of the statements on the brackets of α, of β, and of α with β.
ALPHA, BETA, MIXED = "{α_i, α_j} = π_ij∘α", "{β_i, β_j} = −π_ij∘β", "{α_i, β_j} = 0"

#: Indices i and j, and a polynomial that is 0 if the axiom holds for this pair.
Residual = tuple[int, int, Poly]


def check(system: System, realisation: BiRealisation) -> list[Statement]:
    """Return the statements on α and β at p = 0, on their brackets, and on the simplified forms that the solver
    uses.

    If the spec states π in other coordinates y (a pull-back), the brackets are proved in y. For truncated
    bi-realisations, and if steps follow paths, α and β are truncated series in p. If these series are correct up to
    degree d in p, the brackets are proved up to degree d − 1.
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
    """Return the statements on the brackets of the maps α and β of ``inner``.

    ``inner`` is a system and its bi-realisation, in the coordinates in which the spec states π. The details of the
    statements name these coordinates.
    """
    place = f"in the coordinates {', '.join(inner[0].coordinates)}"
    return [replace(s, detail=f"{s.detail}, {place}" if s.detail else place) for s in check(*inner)[1:4]]


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
    """Return the expression with sinh and cosh written in terms of exp.

    The ring knows relations of exp, but none of sinh and cosh.
    """

    def visit(node: Expression, args: list[Expression]) -> Expression:
        if node.op in ("sinh", "cosh"):
            growing, decaying = call("exp", args[0]), call("exp", -args[0])
            return number(Fraction(1, 2)) * (growing - decaying if node.op == "sinh" else growing + decaying)
        return rebuild(node, args)

    return fold([e], visit)[0]


def _pulled_back(system: System, maps: Sequence[Expression], pairs: Sequence[tuple[int, int]]) -> list[Expression]:
    """Return the functions π_ij∘α for pairs (i, j), or π_ij∘β if ``maps`` are the components of β."""
    return substitute([system.poisson[i][j] for i, j in pairs], dict(zip(system.coordinates, maps, strict=True)))


def _brackets(system: System, realisation: BiRealisation) -> Iterator[Statement]:
    if is_large(system, realisation):
        yield from brackets_at_points(system, realisation, (ALPHA, BETA, MIXED))
        return
    covector = covector_names(system.coordinates)
    variables = [*system.coordinates, *covector]
    alpha, beta = list(realisation.alpha), list(realisation.beta)
    n = len(alpha)
    pairs = [(i, j) for j in range(n) for i in range(j)]
    pulled = _pulled_back(system, alpha, pairs), _pulled_back(system, beta, pairs)
    # The map p ↦ −p changes the sign of every bracket. If it maps α to β, the axioms for {β_i, β_j} follow from those
    # for {α_i, α_j}, and the axiom for {α_j, β_i} follows from that for {α_i, β_j}.
    mirrored = realisation.symmetric and is_symmetric(alpha, beta, system.coordinates)
    everything = [*alpha, *beta, *pulled[0], *([] if mirrored else pulled[1])]
    parameters = [s for s in symbols_of(*everything) if s not in variables]
    tower = Tower([*variables, *parameters], everything, variables)
    images = tower.convert_all([*alpha, *beta])
    a, b = ([_Differential(tower, f, system.coordinates, covector) for f in half] for half in (images[:n], images[n:]))

    def own(differentials: list[_Differential], targets: Sequence[Expression], sign: int) -> Iterator[Residual]:
        for (i, j), target in zip(pairs, targets, strict=True):
            yield i, j, differentials[i].bracket(differentials[j]) - sign * tower.convert(target)

    def decided(title: str, count: int, residuals: Iterator[Residual]) -> Statement:
        names, labelled = system.coordinates, []
        with progress.stage(title, count) as running:
            for i, j, element in residuals:
                running.done += 1
                if element != 0:
                    labelled.append((f"({names[i]}, {names[j]})", element))
        return decide_elements("bi-realisation: " + title, tower, labelled, system.positive)

    first = decided(ALPHA, len(pairs), own(a, pulled[0], 1))
    yield first
    if mirrored:
        yield replace(first, name="bi-realisation: " + BETA, detail="as for α, by β(x, p) = α(x, −p)", residual="")
    else:
        yield decided(BETA, len(pairs), own(b, pulled[1], -1))
    mixed_pairs = [(i, j) for i in range(n) for j in range(i if mirrored else 0, n)]
    yield decided(MIXED, len(mixed_pairs), ((i, j, a[i].bracket(b[j])) for i, j in mixed_pairs))


class _Differential:
    """The nonzero partial derivatives of a function of (x, p), with respect to the x_i and to the p_i, by index."""

    def __init__(self, tower: Tower, element: Poly, coordinates: Sequence[str], covector: Sequence[str]) -> None:
        self._zero, used_names = tower.zero, tower.names_in(element)

        def slopes(names: Sequence[str]) -> dict[int, Poly]:
            return {i: d for i, c in enumerate(names) if c in used_names and (d := tower.derivative(element, c)) != 0}

        self.in_x, self.in_p = slopes(coordinates), slopes(covector)

    def bracket(self, other: _Differential) -> Poly:
        """Return the canonical bracket of this function and another one."""
        result = self._zero
        for i in self.in_x.keys() & other.in_p.keys():
            result += self.in_x[i] * other.in_p[i]
        for i in self.in_p.keys() & other.in_x.keys():
            result -= self.in_p[i] * other.in_x[i]
        return result
