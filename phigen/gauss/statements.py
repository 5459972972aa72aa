"""Statements about a Gauss step, decided for each system: symplecticity, order, brackets, momentum map.

A Gauss method has the coefficients μ_ij = a_ij/b_j (see `phigen.gauss.tableau`). It is symplectic and preserves
quadratic first integrals if these coefficients, as the solver uses them, satisfy μ_ij + μ_ji = 1. Coordinates with the
brackets of a Lie algebra are a momentum map J on the space of group elements. By the axioms of
`phigen.gauss.star_algebra`, J is quadratic and a Poisson map, and it has the value x at the unit element. Hence the
step in x is a Poisson map.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from phigen.gauss.realisation import AlgebraBlock, Realisation
from phigen.gauss.stage_map import (
    StageMap,
    at_unknowns,
    frame_symbol,
    functional_offsets,
    group_values,
    multiplied,
    offsets_of,
    stage_map,
    vector_field,
)
from phigen.gauss.star_algebra import difference
from phigen.gauss.tableau import Tableau
from phigen.geometry.system import System
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    gradient,
    power,
    product,
    sparse_derivatives,
    substitute,
    symbol,
    total,
)
from phigen.symbolic.symbols import Symbol
from phigen.symbolic.verdict import CHECKED, PROVED, REFUTED, Statement, decide_zero

#: Bound for the residuals of the order conditions: smaller residuals are the effect of rounding coefficients to
#: doubles.
ROUNDED = Fraction(1, 10**15)


def check(
    system: System, discretised: System, realisation: Realisation, tableau: Tableau, pace: Expression = ONE
) -> Iterator[Statement]:
    """Yield the statements about the coefficients of a Gauss method, then those about the realisation, with their
    proofs.

    ``pace`` multiplies ∇H and covector forces: the rate g of a monitor if there are forces, else 1.
    """
    yield _symplectic(tableau)
    yield _order(tableau)
    points = stage_map(discretised, realisation, pace)
    if realisation.exact:
        yield _brackets(system, realisation)
    for group in realisation.groups:
        yield _momentum_map(system, group)
    if any(group.ideal for group in realisation.groups):
        yield _functionals(system, points)
    lifted = realisation.lifted
    if lifted:
        yield _frames(system, points, stage_map(discretised, lifted, pace))
    field = discretised.vector_field() if pace is ONE else [pace * f for f in system.vector_field()]
    yield from _follows(system, points, field)


def _symplectic(tableau: Tableau) -> Statement:
    name = "μ_ij + μ_ji = 1 after rounding: the method is symplectic and preserves quadratic first integrals"
    defect = max(map(abs, tableau.defects))
    return Statement(name, REFUTED, residual=str(float(defect))) if defect else Statement(name, PROVED)


def _order(tableau: Tableau) -> Statement:
    """Decide the order conditions B(2s) and C(s) of Butcher for a method of s stages. They imply the order 2s."""
    s = tableau.stages
    c, b = (list(map(Fraction, values)) for values in (tableau.nodes, tableau.weights))
    residuals = [abs(sum(w * x**k for w, x in zip(b, c, strict=True)) - Fraction(1, k + 1)) for k in range(2 * s)]
    for row, x in zip(tableau.mixing, c, strict=True):
        values = [Fraction(m) * w for m, w in zip(row, b, strict=True)]
        residuals += [
            abs(sum(v * y**k for v, y in zip(values, c, strict=True)) - x ** (k + 1) / (k + 1)) for k in range(s)
        ]
    name = f"order {2 * s}: weights are exact for polynomials of degree {2 * s - 1}, stages for degree {s - 1}"
    worst = max(residuals)
    if worst > ROUNDED:
        return Statement(name, REFUTED, residual=f"{float(worst):.1e}")
    return Statement(name, CHECKED, f"coefficients rounded to double precision, defect {float(worst):.0e}")


def _brackets(system: System, realisation: Realisation) -> Statement:
    """Decide whether π has the brackets that the realisation assumes: those of Lie algebras, and constant brackets."""
    n = system.dimension
    expected: dict[tuple[int, int], Expression] = {}
    group_of = {i: group for group in realisation.groups for i in group.indices}
    for group in realisation.groups:
        expected |= _lie_poisson(system, group)
    logs = {i for part in realisation.logarithms for i in part.indices}
    residuals = []
    for i in range(n):
        for j in range(i):
            names = (system.coordinates[j], system.coordinates[i])
            entry, label = system.poisson[j][i], f"{{{names[0]}, {names[1]}}}"
            if group_of.get(i) is not None and group_of.get(i) is group_of.get(j):
                residuals.append((label, entry - expected.get((j, i), ZERO)))
            elif i in group_of or j in group_of:
                residuals.append((label, entry))
            else:
                scales = product(symbol(system.coordinates[k]) for k in (i, j) if k in logs)
                residuals += [(label, slope) for slope in gradient(entry * power(scales, -1), system.coordinates)]
    logarithms = ", ".join(f"log {system.coordinates[i]}" for i in sorted(logs))
    name = "each bracket belongs to a Lie algebra or is constant" + f", with {logarithms}" * bool(logarithms)
    return decide_zero(name, residuals, system.positive)


def _lie_poisson(system: System, group: AlgebraBlock) -> dict[tuple[int, int], Expression]:
    values = [symbol(system.coordinates[i]) + s for i, s in zip(group.indices, group.shift, strict=True)]
    values += [symbol(system.coordinates[0]) ** 0] if group.central else []
    brackets = {}
    for a, i in enumerate(group.indices):
        for b, j in enumerate(group.indices):
            brackets[i, j] = total(c * values[k] for k, c in group.lie.bracket(a, b).items())
    return brackets


def _momentum_map(system: System, group: AlgebraBlock) -> Statement:
    """Decide whether coordinates with the brackets of a Lie algebra are a quadratic momentum map on its star algebra
    (see `phigen.gauss.star_algebra`).
    """
    coordinate_names = ", ".join(system.coordinates[i] for i in group.indices)
    algebra = group.algebra
    name = (
        f"({coordinate_names}) = x̃(G E_a G*) is a quadratic momentum map on an algebra of dimension {algebra.dimension}"
    )
    failing = [axiom for axiom, residuals in algebra.axioms() if any(residuals)]
    field = algebra.field
    for a, e in enumerate(algebra.basis):
        for b, f in enumerate(algebra.basis):
            constants = group.lie.bracket(a, b)
            expected: dict[int, object] = {}
            for k, c in constants.items():
                expected = difference(expected, algebra.basis[k], -field.convert(c))
            if difference(algebra.commutator(e, f), expected, field.one):
                failing.append(f"[E_{a + 1}, E_{b + 1}] agrees with the brackets of the coordinates")
    if failing:
        return Statement(name, REFUTED, failing[0])
    return Statement(name, PROVED, "associative, with an involution; commutators of its skew elements are the brackets")


def _functionals(system: System, points: StageMap) -> Statement:
    """Decide whether two choices of unknowns give the same step: all components of group elements, or functionals λ in
    place of some components (see `phigen.gauss.square_zero`).

    Symbols stand for ∇H, so that the statement holds for any H.
    """
    complete = stage_map(points.system, points.realisation.with_elements, points.pace)
    values = _unknowns_by_elements(points, complete)
    residuals = _differences(system, points, complete, values, {})
    return decide_zero("g and λ(b) = x̃(gb) + 2x̃(nb) give the same step as G = g + n", residuals, system.positive)


def _frames(system: System, points: StageMap, lifted: StageMap) -> Statement:
    """Decide whether the unknowns U − F with U = FG give the same step as the unknowns G − 1.

    G is a group element, and F is the frame at the start of the step (see `phigen.gauss.lift`).
    """
    others = points.unknowns[: len(points.unknowns) - len(lifted.frames)]
    values = {name: symbol(name) for name in others}
    for group, places in zip(lifted.realisation.groups, lifted.places, strict=True):
        frame = [symbol(frame_symbol(k)) for k in places]
        components = multiplied(group.algebra, frame, offsets_of(points, places))
        values |= dict(zip((lifted.unknowns[k] for k in places), components, strict=True))
    names = {system.coordinates[i] for group in lifted.realisation.groups for i in group.indices}
    at_start = {name: e for name, e in at_unknowns(lifted).items() if name in names}
    states = dict(zip(at_start, substitute([*at_start.values()], dict.fromkeys(lifted.unknowns, ZERO)), strict=True))
    residuals = _differences(system, lifted, points, values, states)
    return decide_zero("U = FG gives the same step as G, where x̃(q) = k̃(FqF*)", residuals, system.positive)


def _differences(
    system: System,
    points: StageMap,
    reference: StageMap,
    values: Mapping[str, Expression],
    states: Mapping[str, Expression],
) -> list[tuple[str, Expression]]:
    """Return the differences between two steps that have different unknowns. The changes of x and the velocities are
    compared.

    The symbols "slope" stand for ∇H. So if the differences are 0, the steps are equal for any H. ``values`` has the
    unknowns of ``points`` as functions of the unknowns of ``reference``; ``states`` replaces coordinates at the start
    by other expressions.
    """
    slopes = [symbol(Symbol("slope", i)) for i in range(system.dimension)]
    reference_rates = substitute(vector_field(reference, at_unknowns(reference), slopes=slopes), states)
    rates_by_name = dict(zip(reference.unknowns, reference_rates, strict=True))
    changes = substitute(points.change, values), substitute(reference.change, states)
    residuals = [(name, a - b) for name, a, b in zip(system.coordinates, *changes, strict=True)]
    rates = substitute(vector_field(points, at_unknowns(points), slopes=slopes), values)
    rows = sparse_derivatives([values[name] for name in points.unknowns], reference.unknowns)
    for name, rate, row in zip(points.unknowns, rates, rows, strict=True):
        residuals.append((name, rate - total(rates_by_name[z] * e for z, e in row.items())))
    return residuals


def _unknowns_by_elements(points: StageMap, complete: StageMap) -> dict[str, Expression]:
    """Return a map from the names of the unknowns of ``points`` to expressions in the unknowns of ``complete``.

    Both arguments describe the stages of the same step. In ``complete``, all components of group elements are unknowns.
    In ``points``, functionals λ replace the components in square-zero ideals (`phigen.gauss.square_zero`).
    """
    first, size = len(points.moved) + len(points.system.times), len(points.scaled)
    common = [*range(first), *range(points.plain, points.plain + size)]
    values = {points.unknowns[k]: symbol(complete.unknowns[i]) for i, k in enumerate(common)}
    groups = zip(points.realisation.groups, points.places, complete.places, strict=True)
    for group, places, element_places in groups:
        w = offsets_of(complete, element_places)
        offsets = [w[k] for k in group.subalgebra]
        if group.ideal:
            offsets += functional_offsets(group, group_values(points.system, group), w)
        values |= dict(zip((points.unknowns[k] for k in places), offsets, strict=True))
    return values


def _follows(system: System, points: StageMap, field: Sequence[Expression]) -> Iterator[Statement]:
    """Decide two statements on a stage whose unknowns are all 0.

    First, the state x at the stage is the state at the start of the step. Second, ẋ = π∇H, where ẋ follows from the
    derivatives of the unknowns.
    """
    at_start = dict.fromkeys(points.unknowns, ZERO)
    start = [(c, e) for c, e in zip(system.coordinates, substitute(points.change, at_start), strict=True)]
    yield decide_zero("a stage whose unknowns are 0 has the state at the start of the step", start, system.positive)
    slopes = substitute(vector_field(points, at_unknowns(points)), at_start)
    columns = sparse_derivatives(points.change, points.unknowns)
    rates = [
        total(substitute([e], at_start)[0] * slopes[points.unknowns.index(name)] for name, e in row.items())
        for row in columns
    ]
    residuals = [(c, r - f) for c, r, f in zip(system.coordinates, rates, field, strict=True)]
    yield decide_zero("ẋ = π∇H at the start of a step", residuals, system.positive)
