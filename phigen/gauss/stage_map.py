"""Stages of a Gauss step: points and their vector field in terms of the unknowns, and the change of frame.

The unknowns are offsets, 0 at the start of the step: x − x_start of a plain coordinate, t − t_start of the time,
log x − log x_start of a coordinate with a logarithm, G − 1 of a group element. So small steps lose no digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from phigen.gauss.realisation import AlgebraBlock, Plain, Realisation
from phigen.gauss.star_algebra import StarAlgebra, Vector, combined
from phigen.geometry.field import Scalar
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    call,
    gradient,
    number,
    sparse_derivatives,
    substitute,
    symbol,
    symbols_of,
    total,
)
from phigen.symbolic.symbols import Symbol

#: The kind of symbols of unknowns.
OFFSET = "z"


@dataclass(frozen=True)
class StageMap:
    """Points as expressions in the start of the step and the unknowns.

    ``unknowns`` are symbols, and ``change`` is x − x_start by coordinates. The first ``plain`` unknowns are offsets
    of the coordinates with the indices ``moved``. Then come the offset of the time, if H depends on it, the offsets of
    the logarithms of the coordinates ``scaled``, and the unknowns of group elements.
    """

    system: System
    realisation: Realisation
    unknowns: tuple[str, ...]
    moved: tuple[int, ...]
    scaled: tuple[int, ...]
    starts: tuple[int, ...]  # the first unknown of each group
    change: tuple[Expression, ...] = field(default=())
    pace: Expression = ONE  # the factor of ∇H + ζ: g with a monitor and forces

    @property
    def logarithms(self) -> dict[int, Expression]:
        """The unknowns that are offsets of logarithms, by their coordinates."""
        first = len(self.moved) + len(self.system.times)
        return {i: symbol(self.unknowns[first + k]) for k, i in enumerate(self.scaled)}

    @property
    def start(self) -> tuple[str, ...]:
        """The symbols of the start of a step: coordinates, then the time."""
        return (*self.system.coordinates, *self.system.times)


def stage_map(system: System, realisation: Realisation, pace: Expression = ONE) -> StageMap:
    """Return the points of a system in terms of the unknowns of a step; ``pace`` multiplies ∇H and covector forces."""
    plain_indices = tuple(i for part in realisation.parts if isinstance(part, Plain) for i in part.indices)
    scaled = tuple(i for part in realisation.logarithms for i in part.indices)
    if realisation.exact:
        plain_indices = tuple(i for i in plain_indices if any(not e.is_zero for e in system.poisson[i]))
    if not (plain_indices or scaled or realisation.groups or system.times):
        plain_indices = (0,)  # all brackets are zero; arrays in C have at least one entry
    count = len(plain_indices) + len(system.times) + len(scaled)
    starts = []
    for group in realisation.groups:
        starts.append(count)
        count += group.algebra.dimension
    unknowns = tuple(Symbol(OFFSET, k) for k in range(count))
    change = [ZERO] * system.dimension
    for k, i in enumerate(plain_indices):
        change[i] = symbol(unknowns[k])
    points = StageMap(system, realisation, unknowns, plain_indices, scaled, tuple(starts), pace=pace)
    for i, offset in points.logarithms.items():
        change[i] = symbol(system.coordinates[i]) * call("expm1", offset)
    for group, first in zip(realisation.groups, starts, strict=True):
        offsets = [symbol(s) for s in unknowns[first : first + group.algebra.dimension]]
        for i, value in zip(group.indices, _momentum_change(group, _values(system, group), offsets), strict=False):
            change[i] = value
    return replace(points, change=tuple(change))


def _values(system: System, group: AlgebraBlock) -> list[Expression]:
    """Return the values of the elements E_a of a Lie algebra at the start of a step."""
    coordinates = [symbol(system.coordinates[i]) + s for i, s in zip(group.indices, group.shift, strict=True)]
    return [*coordinates, *([ONE] if group.central else [])]


def _scalar(algebra: StarAlgebra, value: object) -> Expression:
    return algebra.field.expression(value)


def _combined(algebra: StarAlgebra, factors: Mapping[int, object], values: Sequence[Expression]) -> Expression:
    """Return Σ_k factors[k]·values[k]."""
    return total(_scalar(algebra, c) * values[k] for k, c in factors.items() if not values[k].is_zero)


@dataclass(frozen=True)
class _Scaled:
    """The functional x̃ divided by q, and frame elements f divided by numbers c.

    With suitable q and c the products need few multiplications by numbers. ``combination`` gives the E_a from the
    values of x̃/q at the f/c.
    """

    at_basis: list[Expression]
    frame: list[Vector]
    combination: list[Vector]


def _scaled(group: AlgebraBlock, x: Sequence[Expression]) -> _Scaled:
    algebra = group.algebra
    unit = algebra.field.one

    def first(coefficients: Iterable[Scalar]) -> Scalar:
        return next(iter(coefficients), unit) if algebra.field.is_rational else unit

    q = first(c for form in algebra.functional for c in form.values())
    starred = [algebra.starred({j: unit}) for j in range(algebra.dimension)]
    scales = [first(c for s in starred for c in algebra.product(f, s).values()) for f in algebra.frame]
    return _Scaled(
        [_combined(algebra, combined([form], {0: unit / q}), x) for form in algebra.functional],
        [combined([f], {0: unit / c}) for f, c in zip(algebra.frame, scales, strict=True)],
        [{k: v * q * scales[k] for k, v in parts.items()} for parts in algebra.combination],
    )


def _momentum_change(group: AlgebraBlock, x: Sequence[Expression], w: Sequence[Expression]) -> list[Expression]:
    """Return x̃(G E_a G*) − x_a for G = 1 + w: 2x̃(wE_a) + x̃(wE_a w*), as E_a is skew."""
    algebra, scaled = group.algebra, _scaled(group, x)
    left = _functional_times(algebra, scaled, w)
    at_frame = [number(2) * _combined(algebra, f, left) + _with_star(algebra, f, left, w) for f in scaled.frame]
    return [_combined(algebra, parts, at_frame) for parts in scaled.combination]


def _momentum(group: AlgebraBlock, x: Sequence[Expression], g: Sequence[Expression]) -> list[Expression]:
    """Return x̃(G E_a G*) for a group element G."""
    at_frame, combination = _at_frame(group, x, g)
    return [_combined(group.algebra, parts, at_frame) for parts in combination]


def _at_frame(
    group: AlgebraBlock, x: Sequence[Expression], g: Sequence[Expression]
) -> tuple[list[Expression], list[Vector]]:
    """Return multiples of x̃(G f G*) for the frame elements f, and the combinations of these that are x̃(G E_a G*)."""
    algebra, scaled = group.algebra, _scaled(group, x)
    left = _functional_times(algebra, scaled, g)
    return [_with_star(algebra, f, left, g) for f in scaled.frame], scaled.combination


def _functional_times(algebra: StarAlgebra, scaled: _Scaled, w: Sequence[Expression]) -> list[Expression]:
    """Return x̃(wb)/q for the elements b of the basis."""
    left = []
    for k in range(algebra.dimension):
        values = [_combined(algebra, algebra.table.get((i, k), {}), scaled.at_basis) for i in range(algebra.dimension)]
        left.append(total(w[i] * value for i, value in enumerate(values) if not value.is_zero))
    return left


def _with_star(
    algebra: StarAlgebra, f: Mapping[int, Scalar], left: Sequence[Expression], w: Sequence[Expression]
) -> Expression:
    """Return x̃(wfw*)/q, where ``left`` are the values x̃(wb)/q."""
    unit = algebra.field.one
    terms = []
    for j in range(algebra.dimension):
        value = _combined(algebra, algebra.product(f, algebra.starred({j: unit})), left)
        if not value.is_zero:
            terms.append(w[j] * value)
    return total(terms)


def at_unknowns(points: StageMap) -> dict[str, Expression]:
    """Return the coordinates and the time at a stage, in terms of the unknowns."""
    system = points.system
    stage_values = {c: symbol(c) + d for c, d in zip(system.coordinates, points.change, strict=True)}
    stage_values |= {
        system.coordinates[i]: symbol(system.coordinates[i]) * call("exp", z) for i, z in points.logarithms.items()
    }
    for group, first in zip(points.realisation.groups, points.starts, strict=True):
        momenta = _momentum(group, _values(system, group), _group_element(points, group, first))
        for i, value, shift in zip(group.indices, momenta, group.shift, strict=False):
            stage_values[system.coordinates[i]] = value - shift
    return stage_values | {t: symbol(t) + symbol(points.unknowns[len(points.moved)]) for t in system.times}


def _element(
    algebra: StarAlgebra, elements: Sequence[Mapping[int, object]], factors: Sequence[Expression]
) -> list[Expression]:
    """Return the components of Σ_a factors[a]·elements[a]."""
    return [
        total(_scalar(algebra, e[k]) * r for e, r in zip(elements, factors, strict=False) if k in e)
        for k in range(algebra.dimension)
    ]


def _group_element(points: StageMap, group: AlgebraBlock, first: int) -> list[Expression]:
    """Return G = 1 + w, with the unknowns w from the index ``first`` on."""
    algebra = group.algebra
    return [
        symbol(points.unknowns[first + k]) + (_scalar(algebra, algebra.unit[k]) if k in algebra.unit else ZERO)
        for k in range(algebra.dimension)
    ]


def vector_field(
    points: StageMap,
    stage_values: Mapping[str, Expression],
    weight: Expression = ONE,
    hold: Callable[[Expression], Expression] | None = None,
    slopes: Sequence[Expression] | None = None,
    *,
    collected: bool = False,
) -> list[Expression]:
    """Return the derivatives of the unknowns at a stage, with these values of the coordinates, times a weight.

    ``hold`` receives each component of the velocities in Lie algebras, and returns its replacement. ``slopes`` stand
    for ∇H, where H is not that of the system. With ``collected``, velocities that are affine in the momenta are sums
    over x̃(G f G*) for the elements f of the frame.
    """
    system, realisation = points.system, points.realisation
    slopes = gradient(system.hamiltonian, system.coordinates) if slopes is None else slopes
    if system.forces:
        slopes = [s + z for s, z in zip(slopes, system.forces.covector, strict=True)]
    slopes = [points.pace * s for s in slopes]
    field_ = hamiltonian_vector_field(system.poisson, slopes)
    if system.forces:
        field_ = tuple(a + b for a, b in zip(field_, system.forces.vector, strict=True))
    plain_rates = substitute([field_[i] for i in points.moved], stage_values)
    derivatives = [*(weight * value for value in plain_rates), *(weight for _ in system.times)]
    relative = [_logarithmic_rate(points, i, slopes) for i in points.scaled]
    derivatives += [weight * value for value in substitute(relative, stage_values)]
    rates = [-weight * value for value in substitute(slopes, stage_values)]
    for group, first in zip(realisation.groups, points.starts, strict=True):
        # A constant among the basis elements, if there is one, acts as 0: it is central.
        velocity = _element(group.algebra, group.algebra.basis, [rates[i] for i in group.indices])
        if collected:
            sums = _collected(points, group, first, slopes, weight)
            velocity = [v if s is None else s for v, s in zip(velocity, sums, strict=True)]
        if hold is not None:
            velocity = [hold(value) for value in velocity]
        derivatives += _multiplied(group.algebra, _group_element(points, group, first), velocity)
    return derivatives


def _collected(
    points: StageMap, group: AlgebraBlock, first: int, slopes: Sequence[Expression], weight: Expression
) -> list[Expression | None]:
    """Return −w Σ_a E_a ∂H/∂x_a as sums over x̃(G f G*); None for components that are not affine in the momenta."""
    system, algebra = points.system, group.algebra
    names = [system.coordinates[i] for i in group.indices]
    state = {*system.coordinates, *system.times}
    at_frame, combination = _at_frame(group, _values(system, group), _group_element(points, group, first))
    components = _element(algebra, algebra.basis, [slopes[i] for i in group.indices])
    sums: list[Expression | None] = []
    for component, row in zip(components, sparse_derivatives(components, names), strict=True):
        (constant,) = substitute([component], dict.fromkeys(names, ZERO))
        if not state.isdisjoint(symbols_of(constant, *row.values())):
            sums.append(None)
            continue
        factors = [ZERO] * len(at_frame)
        for name, slope in row.items():
            a = names.index(name)
            constant = constant - slope * group.shift[a]
            for k, c in combination[a].items():
                factors[k] = factors[k] + slope * _scalar(algebra, c)
        terms = [(constant, ONE), *zip(factors, at_frame, strict=True)]
        sums.append(total(-factor * weight * value for factor, value in terms if not factor.is_zero))
    return sums


def _logarithmic_rate(points: StageMap, i: int, slopes: Sequence[Expression]) -> Expression:
    """Return the derivative of log x_i."""
    rates = [(j, rate) for part in points.realisation.logarithms for (k, j), rate in part.rates.items() if k == i]
    return total(rate * slopes[j] for j, rate in rates if not slopes[j].is_zero)


def _multiplied(algebra: StarAlgebra, a: Sequence[Expression], b: Sequence[Expression]) -> list[Expression]:
    """Return the product of two elements."""
    terms: list[list[Expression]] = [[] for _ in range(algebra.dimension)]
    for (i, j), row in sorted(algebra.table.items()):
        if a[i].is_zero or b[j].is_zero:
            continue
        for k, c in row.items():
            terms[k].append(_scalar(algebra, c) * (a[i] * b[j]))
    return [total(t) for t in terms]


def derivatives_in_next_frame(points: StageMap, slopes: Sequence[Expression]) -> list[Expression]:
    """Return derivatives of the unknowns in the frame of the end of a step: G* = G⁻¹ times those of group elements."""
    values = list(slopes[: points.starts[0]])
    for group, first in zip(points.realisation.groups, points.starts, strict=True):
        algebra = group.algebra
        w = [symbol(s) for s in points.unknowns[first : first + algebra.dimension]]
        k = slopes[first : first + algebra.dimension]
        values += [a + b for a, b in zip(k, _multiplied(algebra, _element(algebra, algebra.star, w), k), strict=True)]
    return values
