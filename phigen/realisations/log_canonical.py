"""Bi-realisation of a log-canonical π, {x_i, x_j} = a_ij x_i x_j.

The maps are α_j = x_j exp(½u_j), β_j = x_j exp(−½u_j) with u_j = Σ_i a_ij x_i p_i. The article `PAPER` in
`phigen.realisations.protocol` prints α with the opposite sign in the exponent, but its Lotka–Volterra scheme has the
sign that is used here.
"""

from __future__ import annotations

from fractions import Fraction

from phigen.geometry.shapes import LogCanonical
from phigen.geometry.system import System
from phigen.realisations.protocol import PAPER, BiRealisation, covector_symbols, is_symmetric, refuse
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import call, number, symbol, total

KIND = "log-canonical"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the symmetric bi-realisation of a log-canonical π, {x_i, x_j} = a_ij x_i x_j.

    The maps are defined for all (x, p). β − α is −2 x_j sinh(½u_j) with u_j = Σ_i a_ij x_i p_i, written without
    cancellation for small u_j. Raises `SpecError` if π is not log-canonical.
    """
    if not isinstance(system.shape, LogCanonical):
        raise refuse(f"birealisation {KIND} needs {{x_i, x_j}} = a_ij x_i x_j; this π is {system.shape}", "try auto")
    a = system.shape.a
    x = [symbol(c) for c in system.coordinates]
    products = [xi * pi for xi, pi in zip(x, covector_symbols(system.coordinates), strict=True)]
    half = number(Fraction(1, 2))
    exponents = [
        half * total(row[j] * w for row, w in zip(a, products, strict=True) if not row[j].is_zero)
        for j in range(len(x))
    ]
    # All formulas of the solver are rational functions of t = exp(u/2) − 1. For example, 2 sinh(u/2) = t (1 + 1/(1 +
    # t)).
    growth = [call("expm1", u) for u in exponents]
    alpha = tuple(xj * call("exp", u) for xj, u in zip(x, exponents, strict=True))
    beta = tuple(xj * call("exp", -u) for xj, u in zip(x, exponents, strict=True))
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        tuple(xj * t for xj, t in zip(x, growth, strict=True)),
        tuple(-(xj * (t * (1 + 1 / (1 + t)))) for xj, t in zip(x, growth, strict=True)),
        is_symmetric(alpha, beta, system.coordinates),
        explanation="π is log-canonical: α_j = x_j exp(u_j/2), β_j = x_j exp(−u_j/2) with u_j = Σ a_ij x_i p_i; "
        "symmetric, for all x and p; coordinates keep their signs and zeros",
        reference=f"{PAPER}, the quadratic example, with the sign of its Lotka–Volterra scheme",
    )
