"""Bi-realisation of a linear or affine π by the exponential map, computed from the structure constants.

With M_p x = π(x)p and b(z) = z/(1 − e^{−z}) = 1 + z/2 + z²/12 − …

    α = b(−M_p)x,    β = b(M_p)x,    β − α = π(x)p,    β(x, p) = α(x, −p).

No matrix representation is needed. For linear π this is Karasev's construction. Steps are exact if H is linear, since
the generating function for the time t is then tH. On so(3), so(4) and se(3) the error constants of the exponential are
8 to 700 times smaller than those of the Cayley transform. An affine π comes from a Lie algebra with a cocycle; the
phase space is then the hyperplane z = 1 in the dual of the central extension. b(M_p)x is written in closed form if
`phigen.realisations.even_part` has a formula; otherwise the solver follows the path ṁ = π(m)p numerically.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from phigen.geometry.shapes import LiePoisson
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.realisations.even_part import EvenPart, even_part
from phigen.realisations.extension import dual_of
from phigen.realisations.protocol import PAPER, BiRealisation, covector_symbols, is_symmetric, refuse
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import Expression, number, symbol

KIND = "exponential"
REFERENCE = f"{PAPER}, the proposition on Lie–Poisson structures, with τ = exp; M. Karasev, Math. USSR Izv. 28 (1987)"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the exponential bi-realisation of a linear or affine π.

    The bi-realisation is symmetric. It is in closed form if phigen knows one; otherwise the solver follows paths.
    Raises `SpecError` if π is neither linear nor affine.
    """
    closed = closed_form(system)
    if closed is not None:
        return closed
    if dual_of(system) is None:
        raise refuse(f"birealisation {KIND} needs a linear or affine π; this π is {system.shape}", "try auto")
    return followed(system, choice)


def closed_form(system: System) -> BiRealisation | None:
    """Return the exponential bi-realisation in closed form; None if phigen knows none, or if π is neither linear nor
    affine.
    """
    dual = dual_of(system)
    even = even_part(dual.algebra, dual.x, dual.p) if dual else None
    if even is None:
        return None
    return _assembled(system, even)


def _assembled(system: System, even: EvenPart) -> BiRealisation:
    x = [symbol(c) for c in system.coordinates]
    increment = hamiltonian_vector_field(system.poisson, covector_symbols(system.coordinates))
    half = number(Fraction(1, 2))
    curvature = even.values[: len(x)]
    displacement = tuple(e - half * d for e, d in zip(curvature, increment, strict=True))
    alpha = _sums(x, displacement)
    beta = _sums(x, [e + half * d for e, d in zip(curvature, increment, strict=True)])
    shape = "linear" if isinstance(system.shape, LiePoisson) else "affine, linear on a central extension"
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        displacement,
        increment,
        is_symmetric(alpha, beta, system.coordinates),
        explanation=f"π is {shape}: τ = exp in closed form ({_forms_text(even.forms)}); symmetric, β − α = π(x)p, "
        "exact for linear H",
        reference=REFERENCE,
    )


def followed(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the exponential bi-realisation without a closed form. The solver follows the path ṁ = π(m)p with constant
    p.
    """
    from phigen.realisations import karasev

    path = karasev.build(system, choice)
    explanation = "π is linear or affine: τ = exp by following the path ṁ = π(m)p, since no closed form was found"
    return replace(path, kind=KIND, explanation=f"{explanation}; {path.explanation}")


def _sums(x: Sequence[Expression], shifts: Sequence[Expression]) -> tuple[Expression, ...]:
    return tuple(a + b for a, b in zip(x, shifts, strict=True))


def _forms_text(forms: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(forms)) or ["abelian"]
    return "; ".join(distinct[:3]) + (f" and {len(distinct) - 3} more" if len(distinct) > 3 else "")
