"""The kernels of a solver: the step in its three kinds, and the observables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.elimination import Factors, Pattern, elimination, factorise, inversion
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.lowering import cost
from phigen.scheme.program import Kernel, Output
from phigen.scheme.staging import Coefficients
from phigen.scheme.step import at_momenta, explicit_increment, explicit_order, linearise
from phigen.series.hamilton_jacobi import momentum
from phigen.symbolic.expression import ONE, ZERO, Expression, number, symbol, total

#: Largest dimension whose elimination is unrolled in any case; beyond, where zeros leave no more than such a part of n³
#: operations (a full matrix takes 0.7).
UNROLLED, SPARSE = 4, 0.6


def step_kernels(
    system: System, realisation: BiRealisation, generating: GeneratingFunction, coefficients: Coefficients
) -> dict[str, Kernel]:
    """``explicit`` where y can be found by substitution, else ``linearise`` (and ``eliminate`` in low dimension)."""
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
                {"coef": coefficients.slots, "state": coordinates},
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
            {"coef": coefficients.slots, "y": coordinates},
            outputs,
            named,
        )
    }
    jacobian, slope = (_pattern(o.values) for o in outputs[2:])
    if n <= UNROLLED:
        return kernels | _elimination_kernel(jacobian) | {"invert": inverse(n)}
    factors = factorise(jacobian)
    if cost(factors.solved([symbol(f"r:{i}") for i in range(n)])) > SPARSE * n**3:
        return kernels
    return kernels | _elimination_kernel(jacobian) | _factor_kernels(factors, slope)


def _pattern(entries: Sequence[Expression]) -> Pattern:
    n = math.isqrt(len(entries))
    return [[not entries[i * n + j].is_zero for j in range(n)] for i in range(n)]


def _full(n: int) -> Pattern:
    return [[True] * n] * n


def _elimination_kernel(pattern: Pattern) -> dict[str, Kernel]:
    n = len(pattern)
    solution, reciprocals = elimination(pattern)
    return {
        "eliminate": Kernel(
            "eliminate",
            "elimination without pivoting: the solution, and the reciprocals of the pivots",
            {
                "matrix": _entries("J", n),
                "side": tuple(f"r:{i}" for i in range(n)),
            },
            (Output("solution", tuple(solution)), Output("reciprocal", reciprocals)),
        )
    }


def _entries(name: str, n: int) -> tuple[str, ...]:
    return tuple(f"{name}:{i}:{j}" for i in range(n) for j in range(n))


def _factor_kernels(factors: Factors, slope: Pattern) -> dict[str, Kernel]:
    """Elimination in two parts, for many right-hand sides, and the product of each solution with the slope."""
    n, named = len(slope), factors.named("f")
    side = tuple(f"r:{i}" for i in range(n))
    solution = named.solved([symbol(s) for s in side])
    product = [total(symbol(f"K:{i}:{j}") * solution[j] for j in range(n) if slope[i][j]) for i in range(n)]
    return {
        "factorise": Kernel(
            "factorise",
            "elimination without pivoting: the factors of the matrix, the reciprocals of the pivots first",
            {"matrix": _entries("J", n)},
            (Output("factor", factors.values),),
        ),
        "substitute": Kernel(
            "substitute",
            "the solution for a right-hand side, from the factors, and the slope times it",
            {"factor": tuple(str(e.value) for e in named.values), "slope": _entries("K", n), "side": side},
            (Output("solution", tuple(solution)), Output("product", tuple(product))),
        ),
    }


def inverse(n: int) -> Kernel:
    """The inverse of a matrix, and a product with it, unrolled."""
    entries, gain, reciprocals = inversion(n)
    return Kernel(
        "invert",
        "elimination without pivoting: the inverse, the slope times the inverse, the reciprocals of the pivots",
        {"matrix": _entries("J", n), "slope": _entries("K", n)},
        (Output("inverse", tuple(entries)), Output("gain", tuple(gain)), Output("reciprocal", tuple(reciprocals))),
    )


def path_kernels(system: System, generating: GeneratingFunction, coefficients: Coefficients) -> dict[str, Kernel]:
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
        {"coef": coefficients.slots, "y": system.coordinates},
        _outputs(flat, ("slope", "jacobian"), (n, n * n)),
    )
    return {"generate": generate} | (_elimination_kernel(_full(n)) if n <= UNROLLED else {})


def _outputs(values: Sequence[Expression], names: Sequence[str], sizes: Sequence[int]) -> tuple[Output, ...]:
    result, start = [], 0
    for name, size in zip(names, sizes, strict=True):
        result.append(Output(name, tuple(values[start : start + size])))
        start += size
    return tuple(result)


def observables(system: System) -> dict[str, Kernel]:
    """The Hamiltonian, the Casimirs and the vector field."""
    inputs = {"params": system.parameter_names, "x": system.coordinates}
    field = system.vector_field()
    return {
        "energy": Kernel("energy", "the Hamiltonian", inputs, (Output("energy", (system.hamiltonian,)),)),
        "casimirs": Kernel("casimirs", "the Casimirs", inputs, (Output("out", tuple(system.casimirs.values())),)),
        "vector_field": Kernel("vector_field", "pi(x) grad H(x)", inputs, (Output("out", field),)),
    }
