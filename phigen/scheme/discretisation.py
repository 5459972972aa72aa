"""Discretisation of a system. Two ways are compared: one generating function of the requested order for the whole step
(the direct series), and a composition of steps of order 2.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from phigen.errors import Diagnostic, LimitError, SpecError
from phigen.geometry.system import System
from phigen.realisations import karasev
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.composition import find, orders
from phigen.scheme.estimate import SparseRow, may_have, newton_operations, path_operations
from phigen.scheme.generating import GeneratingFunction, collected_form, forced_form, graph_form
from phigen.scheme.kernel import Kernel
from phigen.scheme.lowering import cost
from phigen.scheme.order import Order
from phigen.series.hamilton_jacobi import HamiltonJacobi
from phigen.spec import limits
from phigen.spec.names import FLOW_COMPOSITIONS
from phigen.symbolic.expression import ZERO, Expression, sparse_derivatives, symbol, total
from phigen.symbolic.symbols import STEP

#: Largest number of operations in one kernel. A program with a larger kernel is refused.
MOST_OPERATIONS = limits.OPERATIONS

#: Part of the hint in errors about the size of a program: an alternative to a lower order.
_ALTERNATIVE = "for scheme: splitting, "

#: If the gradient and the Hessian of S_h cost less than this number of additions, the direct series is chosen at once,
#: and no composition is computed for comparison. The error of the direct series is smaller.
MIN_COST_TO_COMPOSE = 2_000

#: Largest accepted value of the ratio: cost of the direct series, divided by that of a composition. Up to this ratio
#: the direct series is chosen, since its error constant is smaller.
MAX_DIRECT_COST_RATIO = 4

#: Largest number of terms S_1, S_2, … for which phigen also tries to write S_h as a graph of shared sub-expressions.
#: With more terms, only collected polynomials are tried.
MAX_GRAPH_TERMS = 5


def formal_alpha(system: System, realisation: BiRealisation, terms: int) -> tuple[Expression, ...]:
    """Return the map α, from which S_1, …, S_terms are computed.

    For steps along paths, α is a series in p up to the degree that these terms need.
    """
    return tuple(karasev.series(system, terms - 1)) if realisation.path and terms > 1 else realisation.alpha


def hamilton_jacobi(
    system: System, realisation: BiRealisation, max_terms: int, static: Sequence[str] = ()
) -> HamiltonJacobi:
    """Return the Hamilton–Jacobi series of a system, in a ring that is large enough for the terms S_1, …, S_max_terms.

    The ring also contains the step size and the ``static`` symbols, which are constant during a trajectory.
    """
    return HamiltonJacobi(
        system.hamiltonian,
        lambda terms: formal_alpha(system, realisation, terms),
        system.coordinates,
        [*system.parameter_names, *static, STEP],
        max_terms,
        symmetric=realisation.symmetric,
        times=system.times,
    )


def generating_function(
    system: System, series: HamiltonJacobi, terms: int, monitor: Expression | None = None
) -> GeneratingFunction:
    """Return ∇S_h and Hess S_h in their cheapest form. Raises `LimitError` if every form is too large.

    With a ``monitor`` g, ``series`` is that of K = g(H + e), where e is the energy level. If there are also forces, p =
    τg(∇H + ζ) takes the place of ∇S_h, where τ is the step size and ζ the covector force.
    """
    if monitor and system.forces:
        return forced_form(system, monitor, series.static)
    candidates, inputs = [], (*series.times, *system.increments)
    if terms <= MAX_GRAPH_TERMS:
        with suppress(OverflowError):
            candidates.append(graph_form(series.graph(terms), series.coordinates, series.static, inputs))
    least_cost = min((c.cost() for c in candidates), default=MOST_OPERATIONS)
    with suppress(OverflowError):
        inputs_of_step = series.times, system.increments
        collected = collected_form(
            series.polynomial(terms), series.coordinates, series.static, least_cost, *inputs_of_step
        )
        candidates = [*collected, *candidates]
    if not candidates or min(c.cost() for c in candidates) > MOST_OPERATIONS:
        raise too_large(system, f"S_1 … S_{terms} take more than {MOST_OPERATIONS} operations")
    best = min(candidates, key=GeneratingFunction.cost)
    if not (system.forces or system.noise):
        return best
    pushed = best.pushed(push(system), system.coordinates)
    return replace(pushed, free=best.pushed(_noise(system), system.coordinates).slope) if system.forces else pushed


def push(system: System) -> list[Expression]:
    """Return the terms that forces and noise add to ∇S_h in the covector p of a step.

    A covector force ζ adds hζ. Noise adds σ∇g ΔW for each source, with the Hamiltonian g, the amplitude σ and the
    increment ΔW of the source.
    """
    covector = system.forces.covector if system.forces else [ZERO] * system.dimension
    return [symbol(STEP) * z + e for z, e in zip(covector, _noise(system), strict=True)]


def _noise(system: System) -> list[Expression]:
    parts = [
        [symbol(name) * g for g in source.impulse(system.coordinates)]
        for source, name in zip(system.noise, system.increments, strict=True)
    ]
    return [total(entries) for entries in zip(*parts, strict=True)] or [ZERO] * system.dimension


@dataclass(frozen=True)
class Discretisation:
    """The generating function of a stage, and the sizes of the stages.

    ``terms`` is the number of the S_i in the generating function. ``fractions`` are the sizes of the stages in units of
    the step. ``note`` is a line about the composition for the header of generated files, empty without a composition.
    """

    generating: GeneratingFunction
    terms: int
    fractions: tuple[float, ...] = (1.0,)
    note: str = ""


def discretise(
    system: System,
    realisation: BiRealisation,
    series: HamiltonJacobi,
    order: Order,
    composition: str,
    monitor: Expression | None = None,
    *,
    affordable: bool = False,
) -> Discretisation:
    """Return the series of the requested order for the whole step, or a composition of steps of order 2.

    A composition is used if the spec asks for it. With ``auto`` it is used only if the direct series has too many
    operations, or costs more than `MAX_DIRECT_COST_RATIO` times all stages of the composition. This ratio is larger
    than 1, since the direct series has a much smaller error constant. ``affordable`` says that `expect_affordable` has
    already passed.
    """
    if system.noise:
        expect_noise(system, realisation, order, composition)
    if system.forces:
        return _forced(system, realisation, series, order, composition, monitor)
    if not affordable:
        expect_affordable(system, realisation)
    series.reach(order.order)  # a proof of the order k + 1 of a symmetric method with k terms needs S_{k+1} = 0
    if composition not in ("auto", "none"):
        return _composed(system, realisation, series, order, composition)
    can_compose = composition == "auto" and series.symmetric and find("auto", order.order) is not None
    can_compose = can_compose and not system.noise
    try:
        direct = Discretisation(_afforded(system, realisation, series, order.terms), order.terms)
    except LimitError:
        if not can_compose:
            raise
        return _composed(system, realisation, series, order, "auto")
    if not can_compose or direct.generating.cost() < MIN_COST_TO_COMPOSE:
        return direct
    composed = _composed(system, realisation, series, order, "auto")
    limit = MAX_DIRECT_COST_RATIO * len(composed.fractions) * (composed.generating.cost() + system.dimension**2)
    return composed if direct.generating.cost() > limit else direct


def expect_noise(system: System, realisation: BiRealisation, order: Order, composition: str) -> None:
    """Raise `SpecError` if the method of a spec with noise does not allow noise.

    The bi-realisation must be symmetric, since otherwise the integral of the noise would not be that of Stratonovich. A
    step must not be a composition: some stages go back in time, so the noise of a step cannot be divided among the
    stages. If there are forces too, the order must be at most 2.
    """
    reason, hint = "", ""
    if not realisation.symmetric:
        reason = f"noise needs a symmetric bi-realisation; {realisation.kind} is not"
        hint = "use `birealisation: auto`; only a symmetric bi-realisation gives the integral of Stratonovich"
    elif composition not in ("auto", "none"):
        reason, hint = (
            "noise: steps are not composed, since some stages of a composition go back in time",
            "composition: none",
        )
    elif system.forces and order.order > 2:
        reason, hint = f"with forces and noise a step has order 2, not {order.order}", "order: 2"
    if reason:
        place = system.locations.get(("noise",))
        raise SpecError([Diagnostic(reason, place, hint)])


def _forced(
    system: System,
    realisation: BiRealisation,
    series: HamiltonJacobi,
    order: Order,
    composition: str,
    monitor: Expression | None,
) -> Discretisation:
    """Return the discretisation with forces: p = h(∇H + ζ), where ζ is the covector force.

    If the bi-realisation is symmetric, one stage with this p has order 2, and compositions of several stages have
    higher orders. With any other bi-realisation the order is 1.
    """
    if realisation.path and system.forces and any(not f.is_zero for f in system.forces.vector):
        reason = f"forces: a vector force needs a bi-realisation in closed form, but {realisation.kind} follows paths"
        place = system.locations.get(("forces", "vector"))
        hint = "use a covector force, another birealisation, or scheme: splitting"
        raise SpecError([Diagnostic(reason, place, hint)])
    lowest = 2 if series.symmetric else 1
    if order.order > lowest and (composition == "none" or not series.symmetric):
        reason = f"with forces, {realisation.kind} has order {lowest} without a composition, not {order.order}"
        place = system.locations.get(("order",)) or system.locations.get(("forces",))
        hint = f"order: {lowest}" + ("" if not series.symmetric else ", or composition: auto")
        raise SpecError([Diagnostic(reason, place, hint)])
    if order.order <= lowest:
        return Discretisation(generating_function(system, series, 1, monitor), 1)
    return _composed(system, realisation, series, order, composition, monitor)


def _composed(
    system: System,
    realisation: BiRealisation,
    series: HamiltonJacobi,
    order: Order,
    name: str,
    monitor: Expression | None = None,
) -> Discretisation:
    composition = find(name, order.order)
    if composition is None or not series.symmetric:
        reason = (
            f"composition {name} composes the parts of a splitting; it needs scheme: splitting"
            if name in FLOW_COMPOSITIONS
            else f"composition {name} offers the orders {orders(name)}, not {order.order}"
            if series.symmetric
            else f"composition {name} needs a symmetric bi-realisation; {realisation.kind} is not"
        )
        place = system.locations.get(("composition",)) or system.locations.get(("order",))
        raise SpecError([Diagnostic(reason, place, "`composition: none` selects the series without a composition")])
    note = f"composition: {composition.name}, {len(composition.fractions)} stages of order 2"
    return Discretisation(_afforded(system, realisation, series, 1, monitor), 1, composition.fractions, note)


def is_large(system: System) -> bool:
    """Whether a system has so many coordinates that `expect_affordable` must count the operations for S_1 = H."""
    return may_have(system.dimension, MOST_OPERATIONS)


def expect_affordable(system: System, realisation: BiRealisation) -> None:
    """Raise `LimitError` if even a step with S_1 = H alone needs too many operations.

    This test precedes the computation of S_2, which may take long.
    """
    if not is_large(system):
        return
    index = {c: i for i, c in enumerate(system.coordinates)}
    (slopes,) = sparse_derivatives([system.hamiltonian], system.coordinates)
    rows = dict(zip(slopes, sparse_derivatives(list(slopes.values()), system.coordinates), strict=True))
    hessian = [{index[d]: e for d, e in rows.get(c, {}).items()} for c in system.coordinates]
    _expect_few(system, realisation, {c for c in index if c not in slopes}, hessian)


def _afforded(
    system: System, realisation: BiRealisation, series: HamiltonJacobi, terms: int, monitor: Expression | None = None
) -> GeneratingFunction:
    """Return the result of `generating_function`. Raises `LimitError` if the matrices of a step are too large."""
    generating = generating_function(system, series, terms, monitor)
    absent = {c for c, slope in zip(system.coordinates, generating.slope, strict=True) if slope.is_zero}
    hessian = [{j: e for j, e in enumerate(row) if not e.is_zero} for row in generating.hessian]
    _expect_few(system, realisation, absent, hessian)
    return generating


def _expect_few(
    system: System, realisation: BiRealisation, absent: Collection[str], hessian: Sequence[SparseRow]
) -> None:
    if realisation.path:
        operations = path_operations(system, hessian, MOST_OPERATIONS)
    else:
        operations = newton_operations(realisation, absent, hessian, MOST_OPERATIONS)
    if operations > MOST_OPERATIONS:
        raise too_large(system, f"the matrices of a step would take more than {MOST_OPERATIONS} operations")


def too_large(system: System, reason: str, alternative: str = _ALTERNATIVE) -> LimitError:
    """Return the error for a program with too many operations. The hint names a lower order and the ``alternative``."""
    hint = f"ask for a lower order, {alternative}or for fewer terms in H"
    return LimitError([Diagnostic(reason, system.locations.get(("order",)), hint)])


def expect_few(system: System, kernel: Kernel, other: str = _ALTERNATIVE) -> None:
    """Raise `LimitError` if a kernel has too many operations; ``other`` is the alternative that the hint names."""
    operations = cost(kernel.roots)
    if operations > MOST_OPERATIONS:
        raise too_large(system, f"{kernel.name} would take {operations} operations, more than {MOST_OPERATIONS}", other)
