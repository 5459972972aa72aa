"""The kernels of a solver: the step in its three kinds, and the observables."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.program import Kernel, Output
from phigen.scheme.staging import Coefficients
from phigen.scheme.step import at_momenta, elimination, explicit_increment, explicit_order, inversion, linearise
from phigen.series.hamilton_jacobi import momentum
from phigen.symbolic.expression import ONE, ZERO, Expression, number, total

#: Largest dimension whose elimination is unrolled.
UNROLLED = 4


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
    return kernels | _elimination_kernel(n) | ({"invert": inverse(n)} if n <= UNROLLED else {})


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


def inverse(n: int) -> Kernel:
    """The inverse of a matrix, and a product with it, unrolled."""
    entries, gain, reciprocals = inversion(n)
    pairs = [(i, j) for i in range(n) for j in range(n)]
    return Kernel(
        "invert",
        "elimination without pivoting: the inverse, the slope times the inverse, the reciprocals of the pivots",
        {"matrix": tuple(f"J:{i}:{j}" for i, j in pairs), "slope": tuple(f"K:{i}:{j}" for i, j in pairs)},
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
    return {"generate": generate} | _elimination_kernel(n)


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
