"""Any smooth π: Karasev's construction, followed numerically.

Let m(t), 0 ≤ t ≤ 1, solve ṁ = π(m)p with p constant. Then α is the start, β the end and x the mean ∫₀¹ m dt of
one and the same path. A step of the solver is: find p with p = ∇S_h(mean of the path that starts at x under
p); the new state is the end of that path. The path is the flow of the linear Hamiltonian p·x, so it stays on
the leaf whatever p is, and following it to round-off makes the step a Poisson map to round-off.

The S_i come from the formal side: mean_j = D^j x/(j+1)!, D = Σ (πp)_a ∂_a, inverted for α to the degree in p that
S_1 … S_k need, k − 1. For linear π this is the exponential bi-realisation.
"""

from __future__ import annotations

from fractions import Fraction
from math import factorial

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import PAPER, BiRealisation, covector_symbols
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ZERO, Expression, derivatives, number, substitute, symbol, total

KIND = "karasev"

#: Degree in p of the formal series that `BiRealisation.alpha` holds: enough for S_1 … S_3, order 4.
DEGREE = 2


def build(system: System, choice: BirealisationChoice, *, degree: int = DEGREE) -> BiRealisation:
    """The bi-realisation of any π; ``alpha`` is exact up to ``degree`` in p, and symmetric by the reversal of paths."""
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
    """α(x, p) to a degree in p, from mean(α, p) = x: α = x − Σ_{j=1}^{degree} (D^j x)(α)/(j+1)!, by substitution.

    Terms of higher degree produced by the substitution are not those of the series, and must not be used.
    """
    coordinates = system.coordinates
    x: list[Expression] = [symbol(c) for c in coordinates]
    flow = hamiltonian_vector_field(system.poisson, covector_symbols(coordinates))
    powers = [list(flow)]
    for _ in range(degree - 1):
        powers.append(_derivatives_along_flow(powers[-1], coordinates, flow))
    approximations = [x]  # approximations[d] is α up to degree d
    for order in range(1, degree + 1):
        # D^j x is itself of degree j in p, so there α is needed up to degree order − j only.
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
    """D f for each function: the derivative along the flow."""
    columns = [derivatives(functions, c) for c in coordinates]
    return [
        total(column[i] * f for column, f in zip(columns, flow, strict=True) if not (column[i] is ZERO or f is ZERO))
        for i in range(len(functions))
    ]
