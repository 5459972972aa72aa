"""Bi-realisation of any smooth π by Karasev's construction: the solver follows a path numerically.

Let m(t), 0 ≤ t ≤ 1, solve ṁ = π(m)p with constant p. Then α is the start of this path, β its end, and y its mean ∫₀¹ m
dt. A step from the state x₀ solves p = ∇S_h(y) for p, where y is the mean of the path that starts at x₀; the new state
is the end of this path. The path is a trajectory of the linear Hamiltonian p·x, so it stays on its symplectic leaf for
every p. If the path is exact to round-off, the step is a Poisson map to round-off.

The generating function S_h = Σ h^i S_i is computed from a formal series for α. A path from x has the mean y = Σ D^j
x/(j+1)! with D = Σ (πp)_a ∂_a. This series is solved for x = α(y, p). S_1 … S_k require α up to degree k − 1 in p. If π
is linear, α and β are the maps of the exponential bi-realisation.
"""

from __future__ import annotations

from fractions import Fraction
from math import factorial

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import PAPER, BiRealisation, covector_symbols
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ZERO, Expression, derivatives, number, substitute, symbol, total

KIND = "karasev"

#: Degree in p of the formal series `BiRealisation.alpha`. The degree 2 suffices for S_1 … S_3, and hence for order 4.
DEGREE = 2


def build(system: System, choice: BirealisationChoice, *, degree: int = DEGREE) -> BiRealisation:
    """Return the bi-realisation of any smooth π, for a solver that follows paths.

    The bi-realisation is symmetric, since reversing a path exchanges α and β. ``alpha`` is a series that is correct up
    to ``degree`` in p.
    """
    alpha = series(system, degree)
    mirrored = substitute(alpha, {s.value: -s for s in covector_symbols(system.coordinates)})
    x = [symbol(c) for c in system.coordinates]
    return BiRealisation(
        KIND,
        system.coordinates,
        tuple(alpha),
        tuple(mirrored),
        tuple(a - xi for a, xi in zip(alpha, x, strict=True)),
        tuple(b - a for a, b in zip(alpha, mirrored, strict=True)),
        symmetric=True,
        path=True,
        degree=degree,
        explanation="Karasev's construction, which holds for every smooth π: each step follows the path ṁ = π(m)p "
        "to round-off; symmetric",
        reference=f"{PAPER}, section 3.2; M. V. Karasev, Math. USSR Izvestiya 28 (1987)",
    )


def series(system: System, degree: int) -> list[Expression]:
    """Return α(x, p) as a series that is correct up to ``degree`` in p. The result has terms of higher degree, which
    are wrong.

    The path ṁ = π(m)p that starts at α has the mean x. Therefore α = x − Σ_{j=1}^{degree} (D^j x)(α)/(j+1)! up to this
    degree, where D is the derivative along πp. The equation is solved by repeated substitution.
    """
    coordinates = system.coordinates
    x: list[Expression] = [symbol(c) for c in coordinates]
    flow = hamiltonian_vector_field(system.poisson, covector_symbols(coordinates))
    powers = [list(flow)]
    for _ in range(degree - 1):
        powers.append(_derivatives_along_flow(powers[-1], coordinates, flow))
    approximations = [x]  # approximations[d]: α, correct up to degree d in p
    for order in range(1, degree + 1):
        # Here α is computed up to degree ``order`` in p. D^j x has degree j in p, so it suffices to substitute an α
        # that is correct up to degree order − j.
        shifts = [
            substitute(powers[j - 1], dict(zip(coordinates, approximations[order - j], strict=True)))
            for j in range(1, order + 1)
        ]
        approximations.append(
            [
                xi - total(number(Fraction(1, factorial(j + 2))) * shift[i] for j, shift in enumerate(shifts))
                for i, xi in enumerate(x)
            ]
        )
    return approximations[-1]


def _derivatives_along_flow(
    functions: list[Expression], coordinates: tuple[str, ...], flow: tuple[Expression, ...]
) -> list[Expression]:
    """Return the derivative of each function along the vector field ``flow``."""
    columns = [derivatives(functions, c) for c in coordinates]
    return [
        total(column[i] * f for column, f in zip(columns, flow, strict=True) if not (column[i] is ZERO or f is ZERO))
        for i in range(len(functions))
    ]
