"""The kernels of a Gauss step: the vector field of a stage, what the step adds to x, and the change of frame.

The unknowns are offsets from the start of the step, which is 0: of a plain coordinate x − x_start, of the time
t − t_start, of a group element G − 1. So no digits are lost where steps are small.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from phigen.gauss.realisation import Group, Realisation
from phigen.gauss.star_algebra import StarAlgebra, combined
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import ONE, ZERO, Expression, gradient, number, substitute, symbol, total
from phigen.symbolic.symbols import Symbol

#: The kinds of symbols of unknowns, and of the derivatives that are taken into a new frame.
OFFSET, SLOPE = "z", "k"


@dataclass(frozen=True)
class StageMap:
    """Points as expressions in the start of the step and the unknowns.

    ``unknowns`` are symbols, ``change`` is x − x_start by coordinates; the first ``plain`` unknowns are offsets of
    coordinates, whose indices are ``moved``; then that of the time, if there is one, and those of group elements.
    """

    system: System
    realisation: Realisation
    unknowns: tuple[str, ...]
    moved: tuple[int, ...]
    starts: tuple[int, ...]  # the first unknown of each group
    change: tuple[Expression, ...] = field(default=())

    @property
    def start(self) -> tuple[str, ...]:
        """The symbols of the point where a step starts: coordinates, then the time."""
        return (*self.system.coordinates, *self.system.times)


def stage_map(system: System, realisation: Realisation) -> StageMap:
    """The points of a system by the unknowns of a step."""
    moved = tuple(i for part in realisation.parts if not isinstance(part, Group) for i in part.indices)
    moved = tuple(i for i in moved if not realisation.exact or any(not e.is_zero for e in system.poisson[i]))
    count = len(moved) + len(system.times)
    starts = []
    for group in realisation.groups:
        starts.append(count)
        count += group.algebra.dimension
    unknowns = tuple(Symbol(OFFSET, k) for k in range(count))
    change = [ZERO] * system.dimension
    for k, i in enumerate(moved):
        change[i] = symbol(unknowns[k])
    for group, first in zip(realisation.groups, starts, strict=True):
        offsets = [symbol(s) for s in unknowns[first : first + group.algebra.dimension]]
        for i, value in zip(group.indices, _momentum_change(group, _values(system, group), offsets), strict=False):
            change[i] = value
    return StageMap(system, realisation, unknowns, moved, tuple(starts), tuple(change))


def _values(system: System, group: Group) -> list[Expression]:
    """The values of the elements E_a of a Lie algebra at the start of a step."""
    own = [symbol(system.coordinates[i]) + s for i, s in zip(group.indices, group.shift, strict=True)]
    return [*own, *([ONE] if group.central else [])]


def _scalar(algebra: StarAlgebra, value: object) -> Expression:
    return algebra.field.expression(value)


def _element(algebra: StarAlgebra, factors: Mapping[int, object], values: Sequence[Expression]) -> Expression:
    """Σ_k factors[k]·values[k]."""
    return total(_scalar(algebra, c) * values[k] for k, c in factors.items() if not values[k].is_zero)


def _momentum_change(group: Group, x: Sequence[Expression], w: Sequence[Expression]) -> list[Expression]:
    """x̃(G E_a G*) − x_a for G = 1 + w: 2x̃(wE_a) + x̃(wE_a w*), as E_a is skew.

    Frames are doubled, and x̃ is halved: basis elements are twice those of the Lie algebra, as a rule.
    """
    algebra = group.algebra
    half = algebra.field.one / algebra.field.number(2)
    at_basis = [_element(algebra, combined([form], {0: half}), x) for form in algebra.functional]
    one = algebra.field.one
    left = []  # x̃(w b) for the basis b
    for k in range(algebra.dimension):
        terms = []
        for i in range(algebra.dimension):
            value = _element(algebra, algebra.table.get((i, k), {}), at_basis)
            if not value.is_zero:
                terms.append(w[i] * value)
        left.append(total(terms))
    moved = []
    for f in (combined([f], {0: algebra.field.number(2)}) for f in algebra.frame):
        twice = number(2) * _element(algebra, f, left)
        quadratic = []
        for j in range(algebra.dimension):
            value = _element(algebra, algebra.product(f, algebra.starred({j: one})), left)
            if not value.is_zero:
                quadratic.append(w[j] * value)
        moved.append(twice + total(quadratic))
    return [_element(algebra, parts, moved) for parts in algebra.combination]


def field_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """The vector field of the unknowns at a stage, before it is multiplied by h b_j."""
    values = coefficients.hoist(vector_field(points, at_unknowns(points)))
    return Kernel(
        "stage_field",
        "the derivatives of the unknowns of a stage, which are offsets from x, the start of the step",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns},
        (Output("slope", tuple(values)),),
    )


def at_unknowns(points: StageMap) -> dict[str, Expression]:
    """The coordinates and the time at a stage, by the unknowns."""
    system = points.system
    at = {c: symbol(c) + d for c, d in zip(system.coordinates, points.change, strict=True)}
    return at | {t: symbol(t) + symbol(points.unknowns[len(points.moved)]) for t in system.times}


def vector_field(points: StageMap, at: Mapping[str, Expression]) -> list[Expression]:
    """The derivatives of the unknowns at a stage, where the coordinates have these values."""
    system, realisation = points.system, points.realisation
    if not realisation.exact:
        field_ = system.vector_field()
        return [*substitute([field_[i] for i in points.moved], at), *(ONE for _ in system.times)]
    slopes = gradient(system.hamiltonian, system.coordinates)
    if system.forces:
        slopes = [s + z for s, z in zip(slopes, system.forces.covector, strict=True)]
    constant = hamiltonian_vector_field(system.poisson, slopes)
    if system.forces:
        constant = tuple(a + b for a, b in zip(constant, system.forces.vector, strict=True))
    found = [*substitute([constant[i] for i in points.moved], at), *(ONE for _ in system.times)]
    there = substitute(slopes, at)
    for group, first in zip(realisation.groups, points.starts, strict=True):
        algebra = group.algebra
        w = [symbol(s) for s in points.unknowns[first : first + algebra.dimension]]
        rates = [-there[i] for i in group.indices]  # the constant, if there is one, acts as 0: it is central
        velocity = [
            total(_scalar(algebra, e[k]) * r for e, r in zip(algebra.basis, rates, strict=False) if k in e)
            for k in range(algebra.dimension)
        ]
        found += [v + m for v, m in zip(velocity, _multiplied(algebra, w, velocity), strict=True)]
    return found


def _multiplied(algebra: StarAlgebra, a: Sequence[Expression], b: Sequence[Expression]) -> list[Expression]:
    """The product of two elements."""
    terms: list[list[Expression]] = [[] for _ in range(algebra.dimension)]
    for (i, j), row in sorted(algebra.table.items()):
        if a[i].is_zero or b[j].is_zero:
            continue
        for k, c in row.items():
            terms[k].append(_scalar(algebra, c) * (a[i] * b[j]))
    return [total(t) for t in terms]


def change_kernel(points: StageMap, coefficients: Coefficients) -> Kernel:
    """Kernel of the change of the coordinates in a step."""
    return Kernel(
        "stage_change",
        "the change of the coordinates from x, by the unknowns",
        {"coef": coefficients.slots, "x": points.start, "z": points.unknowns},
        (Output("change", tuple(coefficients.hoist(points.change))),),
    )


def frame_kernel(points: StageMap, coefficients: Coefficients) -> Kernel | None:
    """Derivatives of group elements in the frame of the next step: the inverse of G, which is G*, times them."""
    if not points.realisation.groups:
        return None
    slopes = [symbol(Symbol(SLOPE, k)) for k in range(len(points.unknowns))]
    found = slopes[: points.starts[0]]
    for group, first in zip(points.realisation.groups, points.starts, strict=True):
        algebra = group.algebra
        w = [symbol(s) for s in points.unknowns[first : first + algebra.dimension]]
        k = slopes[first : first + algebra.dimension]
        star: list[Expression] = [
            total(_scalar(algebra, image[i]) * v for image, v in zip(algebra.star, w, strict=True) if i in image)
            for i in range(algebra.dimension)
        ]
        found += [a + b for a, b in zip(k, _multiplied(algebra, star, k), strict=True)]
    return Kernel(
        "next_frame",
        "derivatives k of the unknowns as seen from the end z of a step, where the next one starts",
        {"coef": coefficients.slots, "z": points.unknowns, "k": tuple(Symbol(SLOPE, i) for i in range(len(slopes)))},
        (Output("seen", tuple(coefficients.hoist(found))),),
    )
