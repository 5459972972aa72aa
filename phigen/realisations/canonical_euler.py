"""The bi-realisation of the symplectic Euler method, for a canonical π: α = (q, p + a), β = (q + b, p).

Here (a, b) is the covector at (q, p). With the single term S_1 the step is the symplectic Euler method, which is
explicit for separable H. The bi-realisation is not symmetric; its adjoint exchanges the roles of q and p.
"""

from __future__ import annotations

from phigen.geometry.shapes import Canonical
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import BiRealisation, covector_symbols, is_symmetric, refuse
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import ZERO, symbol

KIND = "canonical-euler"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the bi-realisation of the symplectic Euler method for a canonical π.

    ``choice.side``, q or p, names the coordinates that α leaves unchanged. With side q: α = (q, p + a), β = (q + b, p),
    where (a, b) is the covector at (q, p). With side p: α = (q − b, p), β = (q, p − a). The bi-realisation is not
    symmetric, so a method of order k needs S_1 … S_k. Coordinates that are Casimirs do not change. Raises `SpecError`
    unless all other coordinates form canonical pairs.
    """
    shape = system.shape
    if not isinstance(shape, Canonical):
        raise refuse(f"birealisation {KIND} needs pairs with {{q, p}} = 1; this π is {shape}", "try auto")
    if choice.side not in ("q", "p"):
        raise refuse(f"side must be q or p, not {choice.side!r}")
    increment = hamiltonian_vector_field(shape.matrix, covector_symbols(system.coordinates))
    fixed = shape.q if choice.side == "q" else shape.p
    displacement = [ZERO if c in fixed else -d for c, d in zip(system.coordinates, increment, strict=True)]
    x = [symbol(c) for c in system.coordinates]
    alpha = tuple(xi + d for xi, d in zip(x, displacement, strict=True))
    beta = tuple(xi + (d if c in fixed else ZERO) for xi, d, c in zip(x, increment, system.coordinates, strict=True))
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        tuple(displacement),
        increment,
        is_symmetric(alpha, beta, system.coordinates),
        explanation=f"π is canonical: one-sided, α does not change {', '.join(fixed)}; explicit for separable H, "
        "not symmetric, so order k takes S_1 … S_k",
    )
