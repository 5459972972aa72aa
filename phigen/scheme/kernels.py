"""The kernels of a step with a generating function, and the kernels of the observables of any solver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import BiRealisation
from phigen.scheme.elimination import (
    Factors,
    Pattern,
    elimination,
    factorise,
    inversion,
    operations,
    transposed_elimination,
)
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.kernel import Kernel, Output, Role
from phigen.scheme.program import Observables
from phigen.scheme.staging import Coefficients
from phigen.scheme.step import at_momenta, explicit_increment, explicit_order, linearise
from phigen.scheme.steps import Factorisation
from phigen.spec import limits
from phigen.symbolic.expression import ONE, ZERO, Expression, number, sparse_derivatives, symbol, total
from phigen.symbolic.symbols import STEP, Symbol, momentum

#: Largest dimension in which elimination is always written as straight-line code, even for matrices without zeros.
UNROLLED_DIMENSION = 4
#: Limit for higher dimensions n: elimination is written as straight-line code if it takes at most this number times n³
#: operations. A full matrix takes 0.7 n³; matrices with many zeros stay below the limit.
MAX_SPARSE_SHARE = 0.6


def ends(system: System, realisation: BiRealisation) -> tuple[Sequence[Expression], Sequence[Expression]]:
    """Return α − y and β − α of a step, including the impulse hf of a vector force f.

    Half of the impulse acts before the motion, half after it: the step is α(y, p) = x + hf(y)/2 and x' = β(y, p) +
    hf(y)/2. If the bi-realisation is symmetric, the step is symmetric too, and has order 2.
    """
    if system.forces is None:
        return realisation.displacement, realisation.increment
    impulse, one_half = [symbol(STEP) * f for f in system.forces.vector], number(Fraction(1, 2))
    displacement = [a - one_half * f for a, f in zip(realisation.displacement, impulse, strict=True)]
    return displacement, [d + f for d, f in zip(realisation.increment, impulse, strict=True)]


def is_centred(system: System, realisation: BiRealisation) -> bool:
    """Whether the solution y of the implicit equation is the mean of the ends x and x' of the step.

    Then the derivative of the increment β − α with respect to y is 2(1 − J), where J is the Newton matrix.
    """
    half = number(Fraction(1, 2))
    means = [a + half * d for a, d in zip(*ends(system, realisation), strict=True)]
    names = [*system.coordinates, *map(momentum, system.coordinates)]
    return not any(e for row in sparse_derivatives(means, names) for e in row.values() if not e.is_zero)


def explicit_kernel(
    system: System, realisation: BiRealisation, generating: GeneratingFunction, coefficients: Coefficients
) -> Kernel | None:
    """Return the kernel of the increment of an explicit step; None if the equation for y cannot be solved by
    substitution."""
    coordinates = system.coordinates
    to_start, to_end = ends(system, realisation)
    displacement = at_momenta(to_start, coordinates, generating.slope)
    sequence = explicit_order(displacement, coordinates)
    if sequence is None:
        return None
    increment = at_momenta(to_end, coordinates, generating.slope)
    values = coefficients.hoist(explicit_increment(displacement, increment, coordinates, sequence))
    return Kernel(
        "explicit",
        "the increment of one step from the state",
        {"coef": coefficients.slots, "state": coordinates},
        (Output("increment", tuple(values)),),
    )


def linearise_kernel(
    system: System, realisation: BiRealisation, generating: GeneratingFunction, coefficients: Coefficients
) -> Kernel:
    """Return the kernel of one Newton iteration: α − y, β − α and their Jacobians at a point y (see
    `phigen.scheme.step`)."""
    n, coordinates = system.dimension, system.coordinates
    point = linearise(*ends(system, realisation), coordinates, generating)
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
    equations = tuple((momentum(c), e) for c, e in zip(coordinates, flat[sum(sizes) :], strict=True))
    return Kernel(
        "linearise",
        f"at the point y, with the momenta p{'' if system.forces else ' = grad S_h(y)'}: the displacement alpha - y, "
        "the increment beta - alpha, the Jacobian of alpha, and the Jacobian of the increment",
        {"coef": coefficients.slots, "y": coordinates},
        outputs,
        equations,
    )


@dataclass(frozen=True)
class Solvers:
    """Kernels for linear equations with the Newton matrix: the solution, the inverse, or the factors; see `Newton`."""

    eliminate: Kernel | None = None
    invert: Kernel | None = None
    factors: Factorisation | None = None


def newton_solvers(linearised: Kernel, *, centred: bool) -> Solvers:
    """Return kernels of unrolled elimination for the pattern of the Newton matrix; no kernels if a loop is better.

    ``centred`` is the result of `is_centred`.
    """
    jacobian, slope = _patterns(linearised)
    n = len(jacobian)
    if n <= UNROLLED_DIMENSION:
        return Solvers(_elimination_kernel(jacobian), inverse(jacobian, centred=centred))
    if operations(jacobian) > min(MAX_SPARSE_SHARE * n**3, limits.OPERATIONS):
        return Solvers()
    return Solvers(_elimination_kernel(jacobian), factors=_factorisation(factorise(jacobian), slope))


def transposed_elimination_kernel(linearised: Kernel) -> Kernel:
    """Return the kernel of elimination with the transposed Newton matrix, for the pattern of the Newton matrix."""
    return _elimination_kernel(_patterns(linearised)[0], transposed=True)


def _patterns(linearised: Kernel) -> tuple[Pattern, Pattern]:
    """Return two patterns: of the Newton matrix, and of the derivative of the increment β − α with respect to y."""
    _, _, jacobian, slope = linearised.outputs
    return _pattern(jacobian.values), _pattern(slope.values)


def _pattern(entries: Sequence[Expression]) -> Pattern:
    n = math.isqrt(len(entries))
    return [[not entries[i * n + j].is_zero for j in range(n)] for i in range(n)]


def full(n: int) -> Pattern:
    """Return the pattern of an n×n matrix all of whose entries may be nonzero."""
    return [[True] * n] * n


def _elimination_kernel(pattern: Pattern, *, transposed: bool = False) -> Kernel:
    n = len(pattern)
    solution, reciprocals = transposed_elimination(pattern) if transposed else elimination(pattern)
    which = "(transposed `matrix`)" if transposed else "`matrix`"
    return Kernel(
        "eliminate_transposed" if transposed else "eliminate",
        f"solve {which} * `solution` = `side` by elimination without pivoting; `reciprocal` receives 1 / pivots",
        {"matrix": _entries("J", n), "side": tuple(Symbol("r", i) for i in range(n))},
        (Output("solution", tuple(solution)), Output("reciprocal", reciprocals)),
    )


def _entries(name: str, n: int) -> tuple[str, ...]:
    return tuple(Symbol(name, i, j) for i in range(n) for j in range(n))


def _factorisation(factors: Factors, slope: Pattern) -> Factorisation:
    """Return Gaussian elimination as two kernels: one factorises the matrix once, the other then solves for many
    right-hand sides.

    The second kernel also multiplies each solution by a matrix K, the derivative of the increment β − α with respect to
    y. ``slope`` is the pattern of K.
    """
    n, factor_symbols = len(slope), factors.named("f")
    side = tuple(Symbol("r", i) for i in range(n))
    solution = factor_symbols.solved([symbol(s) for s in side])
    product = [total(symbol(Symbol("K", i, j)) * solution[j] for j in range(n) if slope[i][j]) for i in range(n)]
    return Factorisation(
        Kernel(
            "factorise",
            "elimination without pivoting: the factors of the matrix, the reciprocals of the pivots first",
            {"matrix": _entries("J", n)},
            (Output("factor", factors.values),),
        ),
        Kernel(
            "substitute",
            "compute the `solution` for the right-hand side `side`, and `product` = `slope` * `solution`",
            {"factor": tuple(e.value for e in factor_symbols.values), "slope": _entries("K", n), "side": side},
            (Output("solution", tuple(solution)), Output("product", tuple(product))),
        ),
    )


def inverse(pattern: Pattern, *, centred: bool = False) -> Kernel:
    """Return the kernel that computes J⁻¹ and K J⁻¹ for the Newton matrix J.

    K is the derivative of the increment β − α with respect to y. If the step is ``centred``, K = 2(1 − J).
    """
    n = len(pattern)
    entries, reciprocals = inversion(pattern)
    if centred:
        gain = [2 * (e - ONE if k % (n + 1) == 0 else e) for k, e in enumerate(entries)]
    else:
        gain = [
            total(symbol(Symbol("K", i, k)) * entries[k * n + j] for k in range(n)) for i in range(n) for j in range(n)
        ]
    return Kernel(
        "invert",
        "compute the `inverse` of `matrix` by elimination without pivoting, `gain` = `slope` * `inverse`, and"
        " `reciprocal` = 1 / pivots",
        {"matrix": _entries("J", n), "slope": _entries("K", n)},
        (Output("inverse", tuple(entries)), Output("gain", tuple(gain)), Output("reciprocal", tuple(reciprocals))),
    )


def generate_kernel(system: System, generating: GeneratingFunction, coefficients: Coefficients) -> Kernel:
    """Return the kernel of ∇S_h(y) and 1 − ½ Hess S_h(y) π(y) at the mean y of a path, for steps along paths.

    A step solves p − ∇S_h(y(p)) = 0 for p. Up to O(h²), the matrix is the Jacobian of this equation.
    """
    n, hessian, pi = system.dimension, generating.hessian, system.poisson
    half = number(Fraction(1, 2))
    jacobian = [
        (ONE if i == j else ZERO) - half * total(hessian[i][k] * pi[k][j] for k in range(n))
        for i in range(n)
        for j in range(n)
    ]
    flat = coefficients.hoist([*generating.slope, *jacobian])
    return Kernel(
        "generate",
        "compute the momenta `slope` = grad S_h(y), and `jacobian` = 1 - Hess S_h(y) pi(y) / 2, which differs by "
        "O(h^2) from the Jacobian of the equation for p",
        {"coef": coefficients.slots, "y": system.coordinates},
        _outputs(flat, ("slope", "jacobian"), (n, n * n)),
    )


def path_elimination(n: int) -> Kernel | None:
    """Return the kernel that solves linear equations with a full n×n matrix; None if a loop is faster.

    In a step along a path, each iteration for p calls this kernel.
    """
    return _elimination_kernel(full(n)) if n <= UNROLLED_DIMENSION else None


def _outputs(values: Sequence[Expression], names: Sequence[str], sizes: Sequence[int]) -> tuple[Output, ...]:
    result, start = [], 0
    for name, size in zip(names, sizes, strict=True):
        result.append(Output(name, tuple(values[start : start + size])))
        start += size
    return tuple(result)


def system_inputs(system: System) -> dict[str, tuple[str, ...]]:
    """Return the arguments of a function on phase space: parameters, the time if H depends on it, coordinates."""
    time = {"t": system.times} if system.time else {}
    return {"params": system.parameter_names, **time, "x": system.coordinates}


def step_inputs(system: System) -> dict[str, tuple[str, ...]]:
    """Return the inputs of a step that are new in each step, by name: the time and the noise increments, if there are
    any."""
    inputs = {"t": system.times, "dw": system.increments}
    return {name: symbols for name, symbols in inputs.items() if symbols}


def noise_fields(system: System) -> Kernel:
    """Return the kernel of the vector fields σ π∇g, one for each source of noise with Hamiltonian g and amplitude σ."""
    fields = [hamiltonian_vector_field(system.poisson, s.impulse(system.coordinates)) for s in system.noise]
    values = tuple(e for field in fields for e in field)
    purpose = "for each source of noise with the amplitude sigma and Hamiltonian g: the vector field sigma pi grad g"
    return Kernel("noise_fields", purpose, system_inputs(system), (Output("out", values),))


def field_formula(*, timed: bool, forced: bool) -> str:
    """Return the formula of the vector field as text for comments; ``timed`` adds the argument t, ``forced`` the
    forces."""
    at = "(t, x)" if timed else "(x)"
    return f"pi(x) (grad H{at} + zeta{at}) + f{at}" if forced else f"pi(x) grad H{at}"


def observables(system: System) -> Observables:
    """Return the kernels of H, the Casimirs, the vector field and the observables of the spec."""
    inputs, timeless = system_inputs(system), {"params": system.parameter_names, "x": system.coordinates}
    field, observable_values = system.vector_field(), tuple(system.observables.values())
    observable_kernel = (
        Kernel("observables", "the observables", inputs, (Output("out", observable_values),))
        if observable_values
        else None
    )
    casimirs = tuple(system.casimirs.values())
    formula = field_formula(timed=bool(system.times), forced=system.forces is not None)
    purpose = f"the right-hand side {formula}"
    return Observables(
        Kernel("energy", "the Hamiltonian", inputs, (Output("energy", (system.hamiltonian,)),)),
        Kernel("casimirs", "the Casimirs", timeless, (Output("out", casimirs),), role=Role.CASIMIRS),
        Kernel("vector_field", purpose, inputs, (Output("out", field),)),
        observable_kernel,
    )
