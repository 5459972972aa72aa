"""Stages of a Gauss step: coordinates and derivatives as functions of the unknowns, and the change of frame.

The unknowns are offsets, which are 0 at the start of a step, so that small steps lose no digits. The offset is x −
x_start for a plain coordinate, t − t_start for the time, and log x − log x_start for a coordinate whose logarithm is an
unknown. For a group element G the offsets are the components of G − 1 or, if there is a frame F (`phigen.gauss.lift`),
the components of U − F with U = FG. If the star algebra has a square-zero ideal (`phigen.gauss.square_zero`), the
components of G along the ideal are replaced by λ − λ_start for the functional λ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from phigen.gauss.lift import momentum_form
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

#: Kinds of symbols: unknowns of a stage, and components of the frames F of group elements (`phigen.gauss.lift`).
OFFSET, FRAME = "z", "frame"


@dataclass(frozen=True)
class StageMap:
    """The state at a stage of a Gauss step, as a function of the state at the start of the step and of the
    unknowns.

    ``unknowns`` are names of symbols. Their order is: the offsets of the coordinates with the indices ``moved``; the
    offset of the time if H depends on the time; the offsets of functionals λ; the offsets of the logarithms of the
    coordinates with the indices ``scaled``; the components of the group elements, minus 1 or minus the frame F. There
    is a functional λ for each star algebra with a square-zero ideal (`phigen.gauss.square_zero`). ``places`` has a
    tuple of indices of unknowns for each group element: first the unknowns of the group element, then those of the
    functional λ of its star algebra. ``change`` is x − x_start for each coordinate.
    """

    system: System
    realisation: Realisation
    unknowns: tuple[str, ...]
    moved: tuple[int, ...]
    scaled: tuple[int, ...]
    places: tuple[tuple[int, ...], ...]
    change: tuple[Expression, ...] = field(default=())
    pace: Expression = ONE  # factor of ∇H and covector forces: the rate g if a system with forces has a monitor

    @property
    def logarithms(self) -> dict[int, Expression]:
        """The unknowns that are offsets of logarithms, as symbols by the index of the coordinate."""
        first = self.plain
        return {i: symbol(self.unknowns[first + k]) for k, i in enumerate(self.scaled)}

    @property
    def plain(self) -> int:
        """The number of unknowns for coordinates, time and functionals. These unknowns come first."""
        groups = self.realisation.groups
        return len(self.moved) + len(self.system.times) + sum(len(g.subalgebra) for g in groups if g.ideal)

    @property
    def start(self) -> tuple[str, ...]:
        """The names of the symbols for the state at the start of a step: coordinates, the time, then frames of group
        elements.
        """
        return (*self.system.coordinates, *self.system.times, *self.frames)

    @property
    def frames(self) -> tuple[str, ...]:
        """The names of the symbols for the components of all frames F, in the order of the unknowns for group
        elements.
        """
        groups = zip(self.realisation.groups, self.places, strict=True)
        return tuple(frame_symbol(k) for group, places in groups if group.copies for k in places)


def _moves(system: System, i: int) -> bool:
    """Whether coordinate ``i`` may change. With ẋ = π(∇H + ζ) + f, the coordinate is constant if f_i = 0 and π_ij = 0
    for all j.
    """
    pushed = system.forces is not None and not system.forces.vector[i].is_zero
    return pushed or any(not e.is_zero for e in system.poisson[i])


def frame_symbol(place: int) -> str:
    """Return the symbol for the component of a frame F that belongs to the unknown with index ``place``."""
    return Symbol(FRAME, place)


def stage_map(system: System, realisation: Realisation, pace: Expression = ONE) -> StageMap:
    """Return the state of a system at a stage as a function of the unknowns. ``pace`` is a factor of ∇H and of covector
    forces, such as the rate g of a monitor.
    """
    plain_indices = tuple(i for part in realisation.parts if isinstance(part, Plain) for i in part.indices)
    scaled = tuple(i for part in realisation.logarithms for i in part.indices)
    if realisation.exact:
        plain_indices = tuple(i for i in plain_indices if _moves(system, i))
    if not (plain_indices or scaled or realisation.groups or system.times):
        # If all brackets are zero, no unknown is needed. One coordinate is an unknown nevertheless, since arrays in C
        # have at least one entry.
        plain_indices = (0,)
    places, count = _places(realisation, len(plain_indices) + len(system.times), len(scaled))
    unknowns = tuple(Symbol(OFFSET, k) for k in range(count))
    change = [ZERO] * system.dimension
    for k, i in enumerate(plain_indices):
        change[i] = symbol(unknowns[k])
    points = StageMap(system, realisation, unknowns, plain_indices, scaled, places, pace=pace)
    for i, offset in points.logarithms.items():
        change[i] = symbol(system.coordinates[i]) * call("expm1", offset)
    for group, at in zip(realisation.groups, places, strict=True):
        values = _momentum_change(points, group, at)
        for i, value in zip(group.indices, values, strict=False):
            change[i] = value
    return replace(points, change=tuple(change))


def _places(realisation: Realisation, plain: int, scaled: int) -> tuple[tuple[tuple[int, ...], ...], int]:
    """Return the field ``places`` of the `StageMap`, and the number of all unknowns.

    ``plain`` is the number of unknowns for coordinates and the time, and ``scaled`` the number of unknowns for
    logarithms.
    """
    functional = plain
    element = plain + scaled + sum(len(g.subalgebra) for g in realisation.groups if g.ideal)
    places = []
    for group in realisation.groups:
        size = len(group.subalgebra)
        of_functional = range(functional, functional + size) if group.ideal else range(0)
        places.append((*range(element, element + size), *of_functional))
        functional, element = functional + len(of_functional), element + size
    return tuple(places), element


def group_values(system: System, group: AlgebraBlock) -> list[Expression]:
    """Return the values of the basis elements of a Lie algebra at the start of a step: shifted coordinates x_i + s_i.

    A central basis element without a coordinate has the value 1.
    """
    coordinates = [symbol(system.coordinates[i]) + s for i, s in zip(group.indices, group.shift, strict=True)]
    return [*coordinates, *([ONE] if group.central else [])]


def _scalar(algebra: StarAlgebra, value: object) -> Expression:
    return algebra.field.expression(value)


def _combined(algebra: StarAlgebra, factors: Mapping[int, object], values: Sequence[Expression]) -> Expression:
    """Return Σ_k factors[k]·values[k]."""
    return total(_scalar(algebra, c) * values[k] for k, c in factors.items() if not values[k].is_zero)


@dataclass(frozen=True)
class _Scaled:
    """A functional x̃ and elements f_k of a star algebra, divided by numbers such that products need few
    multiplications by constants.

    The functional x̃ extends the state x, which is a functional on the Lie algebra. It is divided by a number q:
    ``at_basis`` has the values of x̃/q at the basis of the star algebra. The f_k are the elements `StarAlgebra.frame`,
    and ``frame`` has the elements f_k/c_k with numbers c_k. For the basis E_a of the Lie algebra, x̃(E_a) =
    Σ_k ``combination[a][k]`` (x̃/q)(f_k/c_k).
    """

    at_basis: list[Expression]
    frame: list[Vector]
    combination: list[Vector]


def _scaled(group: AlgebraBlock, x: Sequence[Expression]) -> _Scaled:
    algebra = group.algebra
    unit = algebra.field.one

    def first(coefficients: Iterable[Scalar]) -> Scalar:
        return next(iter(coefficients), unit) if algebra.field.is_rational else unit

    q = unit if group.copies else first(c for form in algebra.functional for c in form.values())
    starred = [algebra.starred({j: unit}) for j in range(algebra.dimension)]
    scales = [first(c for s in starred for c in algebra.product(f, s).values()) for f in algebra.frame]
    if group.copies:
        scales = [first(momentum_form(algebra, group.copies, f).values()) for f in algebra.frame]
    return _Scaled(
        [_combined(algebra, combined([form], {0: unit / q}), x) for form in algebra.functional],
        [combined([f], {0: unit / c}) for f, c in zip(algebra.frame, scales, strict=True)],
        [{k: v * q * scales[k] for k, v in parts.items()} for parts in algebra.combination],
    )


def offset_element(group: AlgebraBlock, offsets: Sequence[Expression]) -> list[Expression]:
    """Return the element w of the star algebra by which a group element differs from its start; ``offsets`` are the
    unknowns.

    Components in the square-zero ideal of the group have no unknowns; they are 0.
    """
    components = dict(zip(group.subalgebra, offsets, strict=False))
    return [components.get(k, ZERO) for k in range(group.algebra.dimension)]


def _start_of(group: AlgebraBlock, places: Sequence[int]) -> list[Expression]:
    """Return the components of a group element at the start of a step: those of 1, or the symbols of its frame F.

    Frames are explained in `phigen.gauss.lift`.
    """
    if group.copies:
        return [symbol(frame_symbol(k)) for k in places]
    unit = group.algebra.unit
    return [_scalar(group.algebra, unit[k]) if k in unit else ZERO for k in range(group.algebra.dimension)]


def _element_at(points: StageMap, group: AlgebraBlock, places: Sequence[int]) -> list[Expression]:
    """Return the components of a group element, as functions of the unknowns w: G = 1 + w, or F + w with a
    frame F.

    Components in the square-zero ideal of the group have no unknowns; they are those of the element 1.
    """
    offsets = offset_element(group, offsets_of(points, places))
    return [w + start for w, start in zip(offsets, _start_of(group, places), strict=True)]


def _momentum_change(points: StageMap, group: AlgebraBlock, places: Sequence[int]) -> list[Expression]:
    """Return the changes of the momenta x_a since the start of a step, as functions of the unknowns, without
    cancellation.

    Let E_a be the basis of the Lie algebra, and x̃ the functional on the star algebra with x̃(E_a) = x_a that is 0 on
    symmetric elements. A change is x̃(G E_a G*) − x_a. For G = 1 + w this is 2x̃(wE_a) + x̃(wE_a w*), since E_a is
    skew. If the unknowns include a functional u, for an ideal of the star algebra, let λ = x̃ + u. The change is then
    u(E_a) + λ(E_a w*) for each E_a outside the ideal. If there is a frame F, the change is k̃(U E_a U*) − k̃(F E_a F*)
    with U = FG; `phigen.gauss.lift` defines the functional k̃.
    """
    algebra, offsets = group.algebra, offsets_of(points, places)
    scaled, w = _scaled(group, group_values(points.system, group)), offset_element(group, offsets)
    if group.copies:
        start = _start_of(group, places)
        forms = [momentum_form(algebra, group.copies, f) for f in scaled.frame]
        at_frame = [_form_change(algebra, form, start, w) for form in forms]
        return [_combined(algebra, parts, at_frame) for parts in scaled.combination]
    left = _functional_times(algebra, scaled, w)
    linear, quadratic = [number(2) * value for value in left], list(left)
    if group.ideal:
        for k, u in zip(group.subalgebra, offsets[len(group.subalgebra) :], strict=True):
            linear[k], quadratic[k] = u, scaled.at_basis[k] + u
    at_frame = [_combined(algebra, f, linear) + _with_star(algebra, f, quadratic, w) for f in scaled.frame]
    return [_combined(algebra, parts, at_frame) for parts in scaled.combination]


def _form_change(
    algebra: StarAlgebra,
    form: Mapping[tuple[int, int], Scalar],
    start: Sequence[Expression],
    w: Sequence[Expression],
) -> Expression:
    """Return the change of the quadratic form ``form`` if its argument changes from ``start`` to start + w."""
    terms = ((c, w[i] * (start[j] + w[j]) + w[j] * start[i]) for (i, j), c in form.items())
    return total(_scalar(algebra, c) * change for c, change in terms)


def _momentum(points: StageMap, group: AlgebraBlock, places: Sequence[int]) -> list[Expression]:
    """Return the momentum x̃(G E_a G*) for each basis element E_a of the Lie algebra.

    G is a group element, and x̃ the functional of the star algebra. ``places`` are the indices of the unknowns of G.
    """
    at_frame, combination = _at_frame(points, group, places)
    return [_combined(group.algebra, parts, at_frame) for parts in combination]


def _at_frame(points: StageMap, group: AlgebraBlock, places: Sequence[int]) -> tuple[list[Expression], list[Vector]]:
    """Return x̃(G f_k G*)/(q c_k) for a group element G and all k, with x̃, f_k, q and c_k as in `_Scaled`.

    For each basis element E_a of the Lie algebra, x̃(G E_a G*) is a linear combination of these values. The second
    result has the coefficients of the linear combinations.
    """
    algebra, g = group.algebra, _element_at(points, group, places)
    scaled = _scaled(group, group_values(points.system, group))
    if group.copies:
        forms = [momentum_form(algebra, group.copies, f) for f in scaled.frame]
        values = [total(_scalar(algebra, c) * (g[i] * g[j]) for (i, j), c in form.items()) for form in forms]
        return values, scaled.combination
    left = _left(points, group, places)
    return [_with_star(algebra, f, left, g) for f in scaled.frame], scaled.combination


def _left(points: StageMap, group: AlgebraBlock, places: Sequence[int]) -> list[Expression]:
    """Return x̃(Gb)/q for a group element G and the basis elements b of the star algebra.

    x̃ is the functional of the momenta, and q a number (`_Scaled`). If ``group.ideal`` is not empty, an unknown
    functional λ on the subalgebra replaces the components of G in the ideal (`phigen.gauss.square_zero`). Then the
    result has λ(b)/q in place of x̃(Gb)/q for elements b of the subalgebra.
    """
    scaled = _scaled(group, group_values(points.system, group))
    left = _functional_times(group.algebra, scaled, _element_at(points, group, places))
    if group.ideal:
        offsets = offsets_of(points, places)
        for k, u in zip(group.subalgebra, offsets[len(group.subalgebra) :], strict=True):
            left[k] = scaled.at_basis[k] + u
    return left


def _functional_times(algebra: StarAlgebra, scaled: _Scaled, w: Sequence[Expression]) -> list[Expression]:
    """Return x̃(wb)/q for an element w and all basis elements b of the star algebra.

    x̃ is the functional of the momenta, and q a number. ``scaled`` has the values of x̃/q at the basis elements
    (`_Scaled`).
    """
    left = []
    for k in range(algebra.dimension):
        values = [_combined(algebra, algebra.table.get((i, k), {}), scaled.at_basis) for i in range(algebra.dimension)]
        left.append(total(w[i] * value for i, value in enumerate(values) if not value.is_zero))
    return left


def _with_star(
    algebra: StarAlgebra, f: Mapping[int, Scalar], left: Sequence[Expression], w: Sequence[Expression]
) -> Expression:
    """Return x̃(wfw*)/q for two elements w and f of the star algebra.

    x̃ is the functional of the momenta, and q a number (`_Scaled`). ``left`` has the values x̃(wb)/q at the basis
    elements b, as `_functional_times` returns them.
    """
    unit = algebra.field.one
    terms = []
    for j in range(algebra.dimension):
        value = _combined(algebra, algebra.product(f, algebra.starred({j: unit})), left)
        if not value.is_zero:
            terms.append(w[j] * value)
    return total(terms)


def at_unknowns(points: StageMap) -> dict[str, Expression]:
    """Return the coordinates and the time at a stage by name, as functions of the unknowns."""
    system = points.system
    stage_values = {c: symbol(c) + d for c, d in zip(system.coordinates, points.change, strict=True)}
    stage_values |= {
        system.coordinates[i]: symbol(system.coordinates[i]) * call("exp", z) for i, z in points.logarithms.items()
    }
    for group, at in zip(points.realisation.groups, points.places, strict=True):
        momenta = _momentum(points, group, at)
        for i, value, shift in zip(group.indices, momenta, group.shift, strict=False):
            stage_values[system.coordinates[i]] = value - shift
    return stage_values | {t: symbol(t) + symbol(points.unknowns[len(points.moved)]) for t in system.times}


def _element(
    algebra: StarAlgebra, elements: Sequence[Mapping[int, object]], factors: Sequence[Expression]
) -> list[Expression]:
    """Return the components of Σ_a factors[a]·elements[a], a combination of elements of the star algebra."""
    return [
        total(_scalar(algebra, e[k]) * r for e, r in zip(elements, factors, strict=False) if k in e)
        for k in range(algebra.dimension)
    ]


def offsets_of(points: StageMap, places: Sequence[int]) -> list[Expression]:
    """Return the symbols of the unknowns with the indices ``places``."""
    return [symbol(points.unknowns[k]) for k in places]


def vector_field(
    points: StageMap,
    stage_values: Mapping[str, Expression],
    weight: Expression = ONE,
    hold: Callable[[Expression], Expression] | None = None,
    slopes: Sequence[Expression] | None = None,
    *,
    collected: bool = False,
) -> list[Expression]:
    """Return the derivatives of the unknowns at a stage, times ``weight``.

    ``stage_values`` has the coordinates and the time at the stage by name. ``slopes`` replaces ∇H if it is not None.
    Group elements follow Ġ = Gξ with a velocity ξ in the Lie algebra; ``hold`` replaces each component of ξ by another
    expression. If ``collected``, components of ξ that are affine in the momenta have a shorter form: they are linear
    combinations of the values x̃(G f G*). Here x̃ is the functional of the star algebra, and f runs over the elements
    in ``frame`` of the `StarAlgebra`.
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
    derivatives += [ZERO] * (points.plain - len(derivatives))
    derivatives += [weight * value for value in substitute(relative, stage_values)]
    derivatives += [ZERO] * (len(points.unknowns) - len(derivatives))
    rates = [-weight * value for value in substitute(slopes, stage_values)]
    for group, at in zip(realisation.groups, points.places, strict=True):
        # If the last basis element stands for the constant 1, this element has no rate. No rate is needed, since the
        # element is central.
        velocity = _element(group.algebra, group.algebra.basis, [rates[i] for i in group.indices])
        if collected:
            sums = _collected(points, group, at, slopes, weight)
            velocity = [v if s is None else s for v, s in zip(velocity, sums, strict=True)]
        velocity = [number(2) * v if k in group.ideal else v for k, v in enumerate(velocity)]
        if hold is not None:
            velocity = [hold(value) for value in velocity]
        for k, value in zip(at, _derivatives(points, group, at, velocity), strict=True):
            derivatives[k] = value
    return derivatives


def _derivatives(
    points: StageMap, group: AlgebraBlock, places: Sequence[int], velocity: Sequence[Expression]
) -> list[Expression]:
    """Return the derivatives of the unknowns of a group, whose element G follows Ġ = Gξ; ``velocity`` has the
    components of ξ.

    If the group has a square-zero ideal, components of ξ along the ideal must be passed with the factor 2.
    """
    of_element = multiplied(group.algebra, _element_at(points, group, places), velocity)
    if not group.ideal:
        return of_element
    left = _left(points, group, places)
    return [*(of_element[k] for k in group.subalgebra), *_pulled_back(group, velocity, left)]


def functional_offsets(group: AlgebraBlock, x: Sequence[Expression], w: Sequence[Expression]) -> list[Expression]:
    """Return the offset (λ − λ_start)/q of the functional λ of `phigen.gauss.square_zero`, with the number q of
    `_Scaled`.

    λ replaces those components of a group element G that are in the square-zero ideal. ``w`` = G − 1 has all
    components, also those in the ideal. ``x`` are the values of the basis elements of the Lie algebra at the start, see
    `group_values`.
    """
    doubled = [number(2) * v if k in group.ideal else v for k, v in enumerate(w)]
    left = _functional_times(group.algebra, _scaled(group, x), doubled)
    return [left[k] for k in group.subalgebra]


def _pulled_back(group: AlgebraBlock, a: Sequence[Expression], left: Sequence[Expression]) -> list[Expression]:
    """Return f(ab) for each basis element b that is not in the square-zero ideal.

    ``a`` is an element of the star algebra, and ``left`` has the values of a functional f at all basis elements.
    """
    n = range(group.algebra.dimension)
    rows = [[_combined(group.algebra, group.algebra.table.get((i, k), {}), left) for i in n] for k in group.subalgebra]
    return [total(a[i] * value for i, value in enumerate(row) if not (a[i].is_zero or value.is_zero)) for row in rows]


def _collected(
    points: StageMap, group: AlgebraBlock, places: Sequence[int], slopes: Sequence[Expression], weight: Expression
) -> list[Expression | None]:
    """Return the components of the velocity −w Σ_a E_a ∂H/∂x_a of a group element G, for w = ``weight``.

    E_a is the basis of the Lie algebra. A component that is affine in the momenta is written as a linear combination of
    x̃(G f_k G*), which needs fewer multiplications. x̃ is the functional of the momenta, and f_k are the elements in
    the field ``frame`` of `StarAlgebra`. All other components are None.
    """
    system, algebra = points.system, group.algebra
    names = [system.coordinates[i] for i in group.indices]
    state = {*system.coordinates, *system.times}
    at_frame, combination = _at_frame(points, group, places)
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
    """Return the derivative of log x_i, from {log x_i, x_j} and ∇H."""
    rates = [(j, rate) for part in points.realisation.logarithms for (k, j), rate in part.rates.items() if k == i]
    return total(rate * slopes[j] for j, rate in rates if not slopes[j].is_zero)


def multiplied(algebra: StarAlgebra, a: Sequence[Expression], b: Sequence[Expression]) -> list[Expression]:
    """Return the components of the product ab of two elements of a star algebra."""
    terms: list[list[Expression]] = [[] for _ in range(algebra.dimension)]
    for (i, j), row in sorted(algebra.table.items()):
        if a[i].is_zero or b[j].is_zero:
            continue
        for k, c in row.items():
            terms[k].append(_scalar(algebra, c) * (a[i] * b[j]))
    return [total(t) for t in terms]


def lifted_functionals(points: StageMap) -> list[Expression]:
    """Return x̃(i), x̃(j) and x̃(k) for each copy of the quaternions in star algebras, as a single list.

    x̃ is the functional that the state x at the start of a step defines on a star algebra
    (`phigen.gauss.star_algebra`). The frame F of a copy satisfies F* k F = y, where y is the vector of the three values
    (`phigen.gauss.lift`).
    """
    values: list[Expression] = []
    for group in points.realisation.groups:
        x = group_values(points.system, group)
        for copy in group.copies:
            values += [_combined(group.algebra, group.algebra.functional[i], x) for i in copy[1:]]
    return values


def derivatives_in_next_frame(points: StageMap, slopes: Sequence[Expression]) -> list[Expression]:
    """Return the derivatives of the unknowns as the next step needs them, where group elements start from 1 again.

    ``slopes`` has the derivatives in the present step. The derivative of a group element is multiplied from the left by
    G* = G⁻¹, where G is the group element at the end of the step. Derivatives of functionals λ are transformed by
    `_functional_in_next_frame`. Derivatives of coordinates, time and logarithms do not change.
    """
    values = list(slopes)
    for group, places in zip(points.realisation.groups, points.places, strict=True):
        algebra, offsets, k = group.algebra, offsets_of(points, places), [slopes[i] for i in places]
        element = offset_element(group, k)
        star = _element(algebra, algebra.star, offset_element(group, offsets))
        element_rate = [a + b for a, b in zip(element, multiplied(algebra, star, element), strict=True)]
        in_frame = [element_rate[i] for i in group.subalgebra]
        if group.ideal:
            in_frame += _functional_in_next_frame(points, group, places, k[len(group.subalgebra) :], element_rate)
        for i, value in zip(places, in_frame, strict=True):
            values[i] = value
    return values


def _functional_in_next_frame(
    points: StageMap,
    group: AlgebraBlock,
    places: Sequence[int],
    k: Sequence[Expression],
    element_rate: Sequence[Expression],
) -> list[Expression]:
    """Return the derivative of the functional λ in the frame of the next step; see `phigen.gauss.square_zero`.

    At the end of the present step the group element is G = g + n, with g in the subalgebra and n in the ideal. ``k`` is
    the derivative of λ in the present step, and ``element_rate`` the derivative ġ in the frame of the next step. The
    result has the entry k(bg*) − λ(sg*) for each basis element b of the subalgebra, where s is the symmetric part of
    ġb. The first term contains the contribution λ(sg*) of s. In the next step this contribution is 0, since x̃ vanishes
    on symmetric elements.
    """
    algebra, half = group.algebra, group.algebra.field.one / group.algebra.field.number(2)
    left = _left(points, group, places)
    g, n = _element_at(points, group, places), range(algebra.dimension)
    units = [{i: algebra.field.one} for i in n]
    at_symmetric = [ZERO] * algebra.dimension
    for i in group.subalgebra:
        at_symmetric[i] = _with_star(algebra, combined([units[i], algebra.star[i]], {0: half, 1: half}), left, g)
    moved = dict(zip(group.subalgebra, k, strict=True))
    at_basis = [moved.get(i, ZERO) for i in n]
    w = offset_element(group, offsets_of(points, places))
    shears = _pulled_back(group, element_rate, at_symmetric)
    return [
        moved[i] + _with_star(algebra, units[i], at_basis, w) - shear
        for i, shear in zip(group.subalgebra, shears, strict=True)
    ]
