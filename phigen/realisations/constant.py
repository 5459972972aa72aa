"""Bi-realisation of a constant π: α = x − ½πp, β = x + ½πp. A step with the single term S_1 is the implicit midpoint
rule.
"""

from __future__ import annotations

from fractions import Fraction

from phigen.geometry.shapes import Canonical, Constant
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.protocol import BiRealisation, covector_symbols, is_symmetric, refuse
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import number, symbol

KIND = "constant"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the bi-realisation of a constant π.

    The bi-realisation is symmetric, and α and β are defined for all (x, p). Raises `SpecError` if π is not constant.
    """
    if not isinstance(system.shape, Constant | Canonical):
        raise refuse(f"birealisation {KIND} needs a constant π; this one is {system.shape}", "try auto")
    increment = hamiltonian_vector_field(system.shape.matrix, covector_symbols(system.coordinates))
    half = number(Fraction(1, 2))
    x = [symbol(c) for c in system.coordinates]
    alpha = tuple(a - half * d for a, d in zip(x, increment, strict=True))
    beta = tuple(a + half * d for a, d in zip(x, increment, strict=True))
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        tuple(-(half * d) for d in increment),
        increment,
        is_symmetric(alpha, beta, system.coordinates),
        explanation="π is constant: α = x − ½πp, β = x + ½πp, as for the midpoint rule; symmetric, for all x and p",
    )
