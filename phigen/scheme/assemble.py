"""From a system, its bi-realisation and an order to a program: series, staging and the step put together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.errors import Diagnostic, LimitError, SpecError
from phigen.geometry.shapes import LogCanonical
from phigen.geometry.system import System
from phigen.realisations import karasev
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.composition import find, orders
from phigen.scheme.generating import STEP, GeneratingFunction, collected_form, graph_form
from phigen.scheme.lowering import cost, operation_counts
from phigen.scheme.path import build_path
from phigen.scheme.program import Kernel, Output, Program
from phigen.scheme.staging import Coefficients
from phigen.scheme.step import (
    at_momenta,
    elimination,
    explicit_increment,
    explicit_order,
    linearise,
)
from phigen.series.hamilton_jacobi import PolynomialSeries, graph_series, momentum, polynomial_series
from phigen.spec.model import SolverOptions
from phigen.symbolic.expression import ONE, ZERO, Expression, number, total

#: Most operations in one kernel; about 5 MB of C and a minute of compilation.
MOST_OPERATIONS = 100_000

#: Below this cost of gradient and Hessian no composition is considered.
COMPOSE_ABOVE = 2_000

#: A direct series may cost this many times a composition: its error constant is that much better.
DIRECT_WORTH = 4

DRIVERS = {
    "explicit": "explicit",
    "newton": "implicit, Newton iteration with the analytic matrix",
    "path": "implicit in p, each path followed by its Taylor series to round-off",
}

#: Largest dimension whose elimination is unrolled.
UNROLLED = 4

#: The graph form is tried up to this many terms, and beyond only if the collected form is too large.
GRAPH_TERMS = 5


@dataclass(frozen=True)
class Order:
    """The order of the method and the number of terms S_1 … S_k that give it."""

    order: int
    terms: int
    note: str = ""


def plan_order(order: int | None, terms: int | None, *, symmetric: bool) -> Order:
    """The terms that an order needs, or the order that terms give.

    In a symmetric bi-realisation the even S_i vanish and the method is symmetric, so its order is even:
    S_1 … S_k with k odd gives order k + 1. Otherwise S_1 … S_k gives order k.
    """
    if terms is not None:
        if not symmetric:
            return Order(terms, terms)
        kept = terms if terms % 2 else terms - 1 or 1
        note = "" if kept == terms else f"S_{terms} = 0 in a symmetric bi-realisation"
        return Order(kept + 1, kept, note)
    order = order or 2
    if not symmetric:
        return Order(order, order)
    if order % 2:
        return Order(order + 1, order, f"order {order} was asked for; a symmetric method has even order")
    return Order(order, order - 1)


def formal_alpha(system: System, realisation: BiRealisation, terms: int) -> tuple[Expression, ...]:
    """The source map from which S_1 … S_terms are computed: for paths, its series to the degree that they need."""
    return tuple(karasev.series(system, terms - 1)) if realisation.path and terms > 1 else realisation.alpha


def series_of(system: System, realisation: BiRealisation, terms: int) -> PolynomialSeries:
    """S_1 … S_terms in a tower that also contains the step size."""
    return polynomial_series(
        system.hamiltonian,
        formal_alpha(system, realisation, terms),
        system.coordinates,
        [*system.parameter_names, STEP],
        terms,
        symmetric=realisation.symmetric,
    )


def generating_function(system: System, realisation: BiRealisation, terms: int) -> GeneratingFunction:
    """∇S_h and Hess S_h in the cheapest form. LimitError if every form is too large."""
    coordinates, static, symmetric = system.coordinates, system.parameter_names, realisation.symmetric
    candidates = []
    if terms <= GRAPH_TERMS:
        alpha = formal_alpha(system, realisation, terms)
        graph = graph_series(system.hamiltonian, alpha, coordinates, terms, symmetric=symmetric)
        candidates.append(graph_form(graph, coordinates, static))
    worth = min((c.cost() for c in candidates), default=MOST_OPERATIONS)
    try:
        series = series_of(system, realisation, terms)
        candidates = [*collected_form(series, coordinates, static, worth), *candidates]
    except OverflowError:
        pass
    if not candidates or min(c.cost() for c in candidates) > MOST_OPERATIONS:
        raise too_large(system, f"S_1 … S_{terms} take more than {MOST_OPERATIONS} operations")
    return min(candidates, key=GeneratingFunction.cost)


@dataclass(frozen=True)
class Discretisation:
    """How the order is reached: the terms of one stage, and the stages of a step."""

    generating: GeneratingFunction
    terms: int
    fractions: tuple[float, ...] = (1.0,)
    note: str = ""


def discretise(system: System, realisation: BiRealisation, order: Order, composition: str) -> Discretisation:
    """The direct series, or a symmetric composition of the method of order 2 where that was asked for or is cheaper.

    ``auto`` composes only if the direct series is beyond the budget or costs more than `DIRECT_WORTH` times
    the stages of a composition, since its error constant is much smaller.
    """
    if composition not in ("auto", "none"):
        return _composed(system, realisation, order, composition)
    possible = composition == "auto" and realisation.symmetric and find("auto", order.order) is not None
    try:
        direct = Discretisation(generating_function(system, realisation, order.terms), order.terms)
    except LimitError:
        if not possible:
            raise
        return _composed(system, realisation, order, "auto")
    if not possible or direct.generating.cost() < COMPOSE_ABOVE:
        return direct
    composed = _composed(system, realisation, order, "auto")
    price = DIRECT_WORTH * len(composed.fractions) * (composed.generating.cost() + system.dimension**2)
    return composed if direct.generating.cost() > price else direct


def _composed(system: System, realisation: BiRealisation, order: Order, name: str) -> Discretisation:
    found = find(name, order.order)
    if found is None or not realisation.symmetric:
        reason = (
            f"composition {name} offers the orders {orders(name)}, not {order.order}"
            if realisation.symmetric
            else f"composition {name} needs a symmetric bi-realisation; {realisation.kind} is not"
        )
        place = system.locations.get(("composition",)) or system.locations.get(("order",))
        raise SpecError([Diagnostic(reason, place, "composition: none takes the series directly")])
    note = f"composition: {found.name}, {len(found.fractions)} stages of order 2"
    return Discretisation(generating_function(system, realisation, 1), 1, found.fractions, note)


def build_program(
    system: System,
    realisation: BiRealisation,
    order: Order,
    *,
    composition: str = "auto",
    solver: SolverOptions | None = None,
    title: str = "",
    licence: str = "0BSD",
    spec_sha256: str = "",
) -> Program:
    """The solver of a system as a program. LimitError if a kernel exceeds `MOST_OPERATIONS`."""
    solver = solver or SolverOptions()
    scheme = discretise(system, realisation, order, composition)
    generating = scheme.generating
    coefficients = generating.coefficients
    path = build_path(system, coefficients) if realisation.path else None
    if path:
        kernels = _path_kernels(system, generating, coefficients)
    else:
        kernels = _step_kernels(system, realisation, generating, coefficients)
    driver = "path" if path else "explicit" if "explicit" in kernels else "newton"
    kernels |= _observables(system)
    prepare = Kernel(
        "prepare",
        "everything that depends on parameters and step size only",
        {"params": system.parameter_names, "h": (STEP,)},
        (Output("coef", tuple(coefficients.values)),),
    )
    main = kernels[{"path": "generate", "newton": "linearise"}.get(driver, driver)]
    for kernel in (prepare, main):
        _within_budget(kernel, system)
    facts = [
        f"bi-realisation: {realisation.kind}, {'symmetric' if realisation.symmetric else 'not symmetric'}",
        *approximation(realisation),
        f"generating function: {'S_1' if scheme.terms == 1 else f'S_1 ... S_{scheme.terms}'} ({generating.form}"
        + (f", {generating.terms} terms)" if generating.terms else ")"),
        f"step: {DRIVERS[driver]}",
    ]
    return Program(
        name=system.name,
        title=title,
        coordinates=system.coordinates,
        parameters=system.parameters,
        casimirs=tuple(system.casimirs),
        order=order.order,
        driver=driver,
        coefficients=len(coefficients.values),
        kernels={"prepare": prepare, **kernels},
        path=path,
        fractions=scheme.fractions,
        relative=isinstance(system.shape, LogCanonical),
        symmetric=realisation.symmetric,
        max_iterations=solver.max_iterations,
        tolerance=1e-17 if solver.tolerance is None else float(solver.tolerance),
        license=licence,
        spec_sha256=spec_sha256,
        facts=tuple(fact for fact in (*facts, scheme.note, order.note) if fact),
        operations=operation_counts(main.roots),
    )


def approximation(realisation: BiRealisation) -> list[str]:
    """The line that labels a solver built on a truncation; none for an exact bi-realisation."""
    if realisation.exact:
        return []
    degree = realisation.degree
    how = "" if degree is None else f": alpha and beta are cut off at degree {degree} in p"
    rate = "" if degree is None else f", up to O(h^{degree + 1}) a step"
    return [f"approximate{how}; it is a Poisson map and keeps Casimirs only approximately{rate}"]


def _within_budget(kernel: Kernel, system: System) -> None:
    operations = cost(kernel.roots)
    if operations > MOST_OPERATIONS:
        raise too_large(system, f"{kernel.name} would take {operations} operations, more than {MOST_OPERATIONS}")


def too_large(system: System, reason: str) -> LimitError:
    """The error for a program beyond the budget."""
    return LimitError([Diagnostic(reason, system.locations.get(("order",)), "ask for a lower order")])


def _step_kernels(
    system: System, realisation: BiRealisation, generating: GeneratingFunction, coefficients: Coefficients
) -> dict[str, Kernel]:
    n, coordinates = system.dimension, system.coordinates
    displacement = at_momenta(realisation.displacement, coordinates, generating.slope)
    sequence = explicit_order(displacement, coordinates)
    if sequence is not None:
        increment = at_momenta(realisation.increment, coordinates, generating.slope)
        values = coefficients.hoist(explicit_increment(displacement, increment, coordinates, sequence))
        return {
            "explicit": Kernel(
                "explicit",
                "the increment of one step from the state",
                {"coef": _slots(coefficients), "state": coordinates},
                (Output("increment", tuple(values)),),
            )
        }
    point = linearise(realisation.displacement, realisation.increment, coordinates, generating)
    flat = [
        *point.displacement,
        *point.increment,
        *(e for row in point.jacobian for e in row),
        *(e for row in point.increment_jacobian for e in row),
        *generating.slope,
    ]
    flat = coefficients.hoist(flat)
    sizes = (n, n, n * n, n * n)
    outputs = _outputs(flat, ("displacement", "increment", "jacobian", "increment_jacobian"), sizes)
    named = tuple((momentum(c), e) for c, e in zip(coordinates, flat[sum(sizes) :], strict=True))
    kernels = {
        "linearise": Kernel(
            "linearise",
            "at the point y: displacement alpha - y, increment beta - alpha, the Jacobian of alpha and that of the "
            "increment, all with the momenta p = grad S_h(y)",
            {"coef": _slots(coefficients), "y": coordinates},
            outputs,
            named,
        )
    }
    return kernels | _elimination_kernel(n)


def _elimination_kernel(n: int) -> dict[str, Kernel]:
    if n > UNROLLED:
        return {}
    solution, reciprocals = elimination(n)
    return {
        "eliminate": Kernel(
            "eliminate",
            "elimination without pivoting: the solution, and the reciprocals of the pivots",
            {
                "matrix": tuple(f"J:{i}:{j}" for i in range(n) for j in range(n)),
                "side": tuple(f"r:{i}" for i in range(n)),
            },
            (Output("solution", tuple(solution)), Output("reciprocal", tuple(reciprocals))),
        )
    }


def _path_kernels(system: System, generating: GeneratingFunction, coefficients: Coefficients) -> dict[str, Kernel]:
    """∇S_h at the mean m of a path, and 1 − ½ Hess S_h(m) π(m): the Jacobian of p − ∇S_h(m(p)) up to O(h²)."""
    n, hessian, pi = system.dimension, generating.hessian, system.poisson
    half = number(Fraction(1, 2))
    jacobian = [
        (ONE if i == j else ZERO) - half * total(hessian[i][k] * pi[k][j] for k in range(n))
        for i in range(n)
        for j in range(n)
    ]
    flat = coefficients.hoist([*generating.slope, *jacobian])
    generate = Kernel(
        "generate",
        "p = grad S_h(y), and the Jacobian 1 - Hess S_h(y) pi(y) / 2 of the equation for p, up to O(h^2)",
        {"coef": _slots(coefficients), "y": system.coordinates},
        _outputs(flat, ("slope", "jacobian"), (n, n * n)),
    )
    return {"generate": generate} | _elimination_kernel(n)


def _slots(coefficients: Coefficients) -> tuple[str, ...]:
    return tuple(f"c:{k}" for k in range(len(coefficients.values)))


def _outputs(values: Sequence[Expression], names: Sequence[str], sizes: Sequence[int]) -> tuple[Output, ...]:
    result, start = [], 0
    for name, size in zip(names, sizes, strict=True):
        result.append(Output(name, tuple(values[start : start + size])))
        start += size
    return tuple(result)


def _observables(system: System) -> dict[str, Kernel]:
    inputs = {"params": system.parameter_names, "x": system.coordinates}
    field = system.vector_field()
    return {
        "energy": Kernel("energy", "the Hamiltonian", inputs, (Output("energy", (system.hamiltonian,)),)),
        "casimirs": Kernel("casimirs", "the Casimirs", inputs, (Output("out", tuple(system.casimirs.values())),)),
        "vector_field": Kernel("vector_field", "pi(x) grad H(x)", inputs, (Output("out", field),)),
    }
