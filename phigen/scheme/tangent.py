"""Kernels for the tangent map of a step, DΦ = Dx_{n+1}/Dx_n, by implicit differentiation.

*newton*: α(y, ∇S_h(y)) = x gives Dy = J⁻¹, and x' = x + d(y) gives DΦ = 1 + M J⁻¹, where J and M are the matrices of
the kernel ``linearise``. So no further kernel is needed. *explicit*: DΦ = 1 + the Jacobian of the increment. *path*:
let μ(x, p) be the mean and m(x, p) the end of the path. The equation p = ∇S_h(μ(x, p)) gives (1 − Hess S_h μ_p) Dp =
Hess S_h μ_x, and then DΦ = m_x + m_p Dp. The derivatives of μ and m are those along a path with its variation
(`tangent_path`).
"""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.scheme.generating import GeneratingFunction
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.path import Recurrences, path_of
from phigen.scheme.staging import Coefficients
from phigen.symbolic.expression import Expression, derivatives, symbol, total
from phigen.symbolic.symbols import momentum, variation


def explicit_jacobian(
    explicit: Kernel, coordinates: Sequence[str], coefficients: Coefficients, name: str = "explicit_tangent"
) -> Kernel:
    """Return the kernel that differentiates the increment of an explicit step or a flow; its output is an n×n
    matrix.
    """
    columns = [derivatives(explicit.roots, c) for c in coordinates]
    n = len(coordinates)
    flat = coefficients.hoist([columns[j][i] for i in range(n) for j in range(n)])
    return Kernel(
        name,
        "the Jacobian of the increment of one step",
        {"coef": coefficients.slots, "state": tuple(coordinates)},
        (Output("increment_jacobian", tuple(flat)),),
    )


def curvature(system: System, generating: GeneratingFunction, coefficients: Coefficients) -> Kernel:
    """Return the kernel of ∇S_h and Hess S_h at a point y, for steps along paths, where y is the mean of the path."""
    n = system.dimension
    flat = coefficients.hoist([*generating.slope, *(e for row in generating.hessian for e in row)])
    return Kernel(
        "curvature",
        "the gradient of S_h and its Hessian at y",
        {"coef": coefficients.slots, "y": system.coordinates},
        (Output("slope", tuple(flat[:n])), Output("slope_jacobian", tuple(flat[n:]))),
    )


def tangent_path(system: System, coefficients: Coefficients) -> Recurrences:
    """Return the recurrences of a path ṁ = π(m)p together with its variation v.

    v is due to variations of the start and of p. With the variation w of p, v̇ = ∂_m(π(m)p) v + π(m) w. The coordinates
    of the recurrences are first the x, then the components ``v:x`` of v. The components of w have the symbols
    ``p:v:x``.
    """
    coordinates = system.coordinates
    p = [symbol(momentum(c)) for c in coordinates]
    w = [symbol(momentum(variation(c))) for c in coordinates]
    flow = list(hamiltonian_vector_field(system.poisson, p))
    columns = [derivatives(flow, c) for c in coordinates]
    by_covector = hamiltonian_vector_field(system.poisson, w)
    varied: list[Expression] = [
        total([*(columns[j][i] * symbol(variation(c)) for j, c in enumerate(coordinates)), by_covector[i]])
        for i in range(len(coordinates))
    ]
    return path_of([*coordinates, *map(variation, coordinates)], coefficients.hoist([*flow, *varied]))
