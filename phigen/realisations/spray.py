"""Poisson sprays and Moser's trick: a bi-realisation from the flow Φ of a vector field X on T*U.

T*U is the set of all (x, p). The field is X = Σ (πp)_i ∂_{x_i} + Σ f_j(x, p) ∂_{p_j} with f_j quadratic in p. Let ω = Σ
dx_i ∧ dp_i, and τ(x, p) = x. The article `PAPER` in `phigen.realisations.protocol`, section "Poisson Spray and Moser's
trick", has α̅ = τ, β̅ = τ∘Φ¹, Ω = ∫₀¹ Φˢ*ω ds, and a map ψ with ψ*Ω = ω. Then α = α̅∘ψ and β = β̅∘ψ. phigen takes ψ =
Φ^{−½}∘ψ₀ with a map ψ₀, so that

    α = τ∘Φ^{−½}∘ψ₀,    β = τ∘Φ^{½}∘ψ₀,    ψ₀*Ω₀ = ω,    Ω₀ = ∫_{−½}^{½} Φˢ*ω ds = Σ_{k even} L_Xᵏ ω / ((k+1)! 2ᵏ).

The map p ↦ −p takes X to −X, hence β(x, p) = α(x, −p) for every spray. ψ₀ is the identity to first order at p = 0. The
article says this of ψ, but ψ changes x by −½πp.

If L_X² ω = 0, then Ω₀ = ω and ψ₀ = id. If the flow also has a closed form, α and β have closed forms. Examples are the
constant and the log-canonical bi-realisation, and nilpotent flows for which Φˢ*ω is linear in s. For the flat
spray (f = 0), Ω₀ = Σ d(mean_i of the path) ∧ dp_i and p·(mean − x) = 0, so ψ₀ does not change p. This spray has the S_i
of Karasev's construction. Any other spray changes S_3 by a function G(x, ∇H) with G(x, p) cubic in p. The reason is
that two symmetric bi-realisations differ by a symplectic map that is the identity to first order at p = 0.

Sprays and symplectic realisations: M. Crainic, I. Mărcuţ, J. Symplectic Geom. 9 (2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from phigen.errors import LimitError
from phigen.geometry.system import System
from phigen.realisations.axioms import check
from phigen.realisations.cotangent import Cotangent, GradedFunction
from phigen.realisations.moser import Step, pulled_back, straighten
from phigen.realisations.protocol import PAPER, BiRealisation, is_symmetric, refuse, reversed_covector
from phigen.realisations.spray_field import Spray, centred_form, lie_series, make_spray
from phigen.spec.model import DEFAULT_ORDER, BirealisationChoice
from phigen.symbolic.expression import Expression, call, number, symbol
from phigen.symbolic.tower import Poly
from phigen.symbolic.verdict import PROVED

KIND = "spray"
REFERENCE = f"{PAPER}, section on Poisson sprays; M. Crainic, I. Mărcuţ, J. Symplectic Geom. 9 (2011)"

#: Largest number of terms of a Lie series that counts as finite.
LONGEST = 8
#: Largest number of terms of a polynomial in the search for a closed form. The search ends at a polynomial with more.
SEARCHED_TERMS = 500
#: End of the hint about a flat spray that has no closed form.
KARASEV = "; the kind karasev follows the flow of the same spray to round-off"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the bi-realisation of a Poisson spray.

    The bi-realisation is symmetric. It is exact if phigen finds a closed form; otherwise it is a truncated series.
    ``choice.spray`` is ``flat`` (f = 0), ``natural`` (for log-canonical π: f_j = −p_j Σ_i a_ji x_i p_i, which
    conserves each x_j p_j), ``auto`` (natural for log-canonical π, else flat), or the n expressions f_j.
    ``choice.degree`` is the degree in p of a truncated series. Let k be the order of the method, rounded up to an
    even number. The default is k + 1. Then a step is a Poisson map up to O(h^(k+2)).

    Raises `SpecError` unless each f_j is a quadratic form in p, and for a degree that is too small for the order.
    Raises `LimitError` for series that are too long.
    """
    spray = make_spray(system, choice.spray)
    exact = _half_flows(system, spray) or _terminating(system, spray)
    if exact is not None:
        return exact
    return _truncation(system, spray, choice)


# -- closed forms --------------------------------------------------------------------------------------


def _half_flows(system: System, spray: Spray) -> BiRealisation | None:
    """Return the bi-realisation α = τ∘Φ^{−½}, β = τ∘Φ^{½}, where Φ is the flow of the spray X, and τ(x, p) = x.

    Returns None unless L_X² ω = 0, where ω is the canonical 2-form, and Φ has a closed form.
    """
    space = spray.space
    if not space.vanishes(centred_form(spray, 3)[3]):
        return None
    flows = [_closed_flow(spray, i) for i in range(system.dimension)]
    if any(flow is None for flow in flows):
        return None
    displacement, increment = zip(*(flow for flow in flows if flow is not None), strict=True)
    explanation = "its flow has a closed form and ∫Φˢ*ω ds over −½ ≤ s ≤ ½ is ω, so that α and β are half a step of it"
    return _exact(system, spray, displacement, increment, explanation)


def _closed_flow(spray: Spray, i: int) -> tuple[Expression, Expression] | None:
    """Return x_i∘Φ^{−½} − x_i and x_i∘Φ^{½} − x_i∘Φ^{−½} for the flow Φ of the spray X.

    Returns None unless the Lie series of x_i is finite, or L_X x_i = v x_i with L_X v = 0.
    """
    tower = spray.space.tower
    x = tower.variable(spray.space.names[i])
    rate, remainder = divmod(spray.field[i], x)
    if remainder == 0 and rate != 0 and tower.is_zero(spray.apply(rate)):
        half = number(Fraction(1, 2)) * tower.expression(rate)
        coordinate = symbol(spray.space.names[i])
        return coordinate * (call("exp", -half) - 1), 2 * (coordinate * call("sinh", half))
    series = _finite_series(spray, x)
    if series is None:
        return None
    terms = {k: spray.space.scaled(term, Fraction(-1, 2) ** k) for k, term in enumerate(series)}
    return _differences(spray.space, terms)


def _finite_series(spray: Spray, f: Poly) -> list[Poly] | None:
    """Return the Lie series of the function f along the spray if it is finite, else None."""
    try:
        series = lie_series(spray, f, LONGEST, SEARCHED_TERMS)
    except LimitError:
        return None
    return series if spray.space.tower.is_zero(series[-1]) else None


def _differences(space: Cotangent, alpha: GradedFunction) -> tuple[Expression, Expression]:
    """Return α_i − x_i and β_i − α_i for one coordinate x_i.

    ``alpha`` has the parts of α_i by degree in p. β follows from α, since β(x, p) = α(x, −p).
    """
    displacement = space.tower.combine(f for k, f in alpha.items() if k > 0)
    odd = space.tower.combine(f for k, f in alpha.items() if k % 2)
    return space.tower.expression(displacement), space.tower.expression(odd * space.tower.constant(-2))


def _terminating(system: System, spray: Spray) -> BiRealisation | None:
    """Return the bi-realisation of a spray if its flow is nilpotent and the series of α is finite, else None.

    The axioms are proved here, since they show that the series is complete.
    """
    coordinates = [spray.space.tower.variable(c) for c in system.coordinates]
    if any(_finite_series(spray, x) is None for x in coordinates):
        return None
    try:
        alpha = alpha_series(spray, LONGEST)
    except LimitError:
        return None
    if any(part != 0 for f in alpha for k, part in f.items() if k > LONGEST // 2):
        return None
    displacement, increment = zip(*(_differences(spray.space, f) for f in alpha), strict=True)
    candidate = _exact(system, spray, displacement, increment, "its flow is nilpotent and Moser's recursion ends")
    return candidate if all(s.verdict == PROVED for s in check(system, candidate)) else None


def _exact(
    system: System, spray: Spray, displacement: Sequence[Expression], increment: Sequence[Expression], reason: str
) -> BiRealisation:
    alpha, beta = _maps(system, displacement)
    symmetric = is_symmetric(alpha, beta, system.coordinates)
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        tuple(displacement),
        tuple(increment),
        symmetric,
        explanation=f"Poisson spray ({spray.name}): {reason}; exact and symmetric",
        reference=REFERENCE,
    )


def _maps(system: System, displacement: Sequence[Expression]) -> tuple[tuple[Expression, ...], tuple[Expression, ...]]:
    alpha = tuple(symbol(c) + d for c, d in zip(system.coordinates, displacement, strict=True))
    return alpha, tuple(reversed_covector(alpha, system.coordinates))


# -- the formal series ---------------------------------------------------------------------------------


def moser_steps(spray: Spray, degree: int) -> list[Step]:
    """Return the factors of the map ψ₀ that are necessary to compute α up to ``degree`` in p.

    The head of the file defines ψ₀ and α.
    """
    return straighten(spray.space, centred_form(spray, degree + 1), degree + 1)


def alpha_series(spray: Spray, degree: int) -> list[GradedFunction]:
    """Return the components of α = τ∘Φ^{−½}∘ψ₀, each as its parts by degree in p, up to ``degree``.

    The head of the file defines the flow Φ and the maps τ and ψ₀.
    """
    space, result = spray.space, []
    steps = moser_steps(spray, degree)
    for x in space.variables[: space.size]:
        series = lie_series(spray, x, degree)
        flowed = {k: space.scaled(f, Fraction(-1, 2) ** k) for k, f in enumerate(series) if f != 0}
        result.append(pulled_back(space, flowed, steps, degree))
    return result


def _truncation(system: System, spray: Spray, choice: BirealisationChoice) -> BiRealisation:
    degree = _degree(system, choice)
    alpha = alpha_series(spray, degree)
    displacement, increment = zip(*(_differences(spray.space, f) for f in alpha), strict=True)
    maps = _maps(system, displacement)
    return BiRealisation(
        KIND,
        system.coordinates,
        *maps,
        tuple(displacement),
        tuple(increment),
        is_symmetric(*maps, system.coordinates),
        exact=False,
        degree=degree,
        explanation=f"Poisson spray ({spray.name}): no closed form was found; approximate, Poisson up to degree "
        f"{degree} in p: α and β are formal series cut off there, so that a step h is guaranteed to be a Poisson "
        f"map, and to keep Casimirs, up to O(h^{degree + 1}) only; symmetric"
        + (KARASEV if spray.name == "flat" else ""),
        reference=REFERENCE,
    )


def _degree(system: System, choice: BirealisationChoice) -> int:
    order = _order(system, choice)
    least = order + order % 2 - 1
    if choice.degree is None:
        return least + 2
    if choice.degree < least:
        raise refuse(
            f"degree {choice.degree} is too small for order {order}, which needs α and β up to degree {least} in p",
            f"degree: {least + 2} makes a step a Poisson map up to O(h^{least + 3})",
        )
    return choice.degree


def _order(system: System, choice: BirealisationChoice) -> int:
    return choice.order or (system.spec.wanted_order if system.spec else DEFAULT_ORDER)
