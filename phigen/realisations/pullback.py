"""Bi-realisation of a π that a spec states in other coordinates y = ψ(x), in which π is simpler.

Let α_y be the map α in the coordinates y, and q_a = Σ_i p_i ∂x_i/∂y_a the covector in these coordinates. Then α(x, p) =
ψ⁻¹(α_y(ψ(x), q)), in short α = ψ⁻¹ ∘ α_y ∘ T*ψ⁻¹. β is transformed in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.forms import poisson_matrix
from phigen.geometry.pullback import Coordinates, change_of_coordinates
from phigen.geometry.subsystems import part
from phigen.geometry.system import System
from phigen.realisations.protocol import (
    BiRealisation,
    Builder,
    covector_names,
    covector_symbols,
    is_symmetric,
    refuse,
    simplified_differences,
)
from phigen.spec.model import BirealisationChoice, PullbackForm
from phigen.symbolic.expression import Expression, substitute, symbol, total

KIND = "pullback"


def build(system: System, choice: BirealisationChoice, build_inner: Builder) -> BiRealisation:
    """Return the bi-realisation in the coordinates x of the spec, for a π that the spec states in other
    coordinates y.

    ``build_inner`` makes the bi-realisation in the coordinates y. Raises `SpecError` if the spec does not state π as a
    pull-back, and if the bi-realisation in the coordinates y is truncated or follows paths.
    """
    form = system.form
    if not isinstance(form, PullbackForm):
        raise refuse(f"birealisation {KIND} needs poisson: {{pullback: …}}")
    change = change_of_coordinates(form, system.coordinates)
    structure = part(system, form.coordinates, form.of)
    inner = build_inner(structure, choice)
    if inner.path or not inner.exact:
        raise refuse(
            f"birealisation {KIND}: no closed form is known in the coordinates of the map",
            "use birealisation: karasev, which needs no closed form",
        )
    alpha, beta = (moved(system, form, change, maps) for maps in (inner.alpha, inner.beta))
    x = [symbol(c) for c in system.coordinates]
    return BiRealisation(
        KIND,
        system.coordinates,
        alpha,
        beta,
        simplified_differences(alpha, x),
        simplified_differences(beta, alpha),
        is_symmetric(alpha, beta, system.coordinates),
        inner=(structure, inner),
        explanation=f"π is given in the coordinates {', '.join(form.coordinates)}, and there {inner.explanation}",
        reference=inner.reference,
    )


def is_composed(system: System, realisation: BiRealisation) -> bool:
    """Whether α and β are the maps of ``realisation.inner``, transformed from the coordinates y = ψ(x) to x.

    If so, the axioms for α and β follow from the axioms in the coordinates y, since the lift of ψ to (x, p) is
    symplectic. `change_of_coordinates` proves that ψ⁻¹ is the inverse of ψ.
    """
    if realisation.inner is None or not isinstance(system.form, PullbackForm):
        return False
    change = change_of_coordinates(system.form, system.coordinates)
    structure, inner = realisation.inner
    if structure.form is not system.form.of or system.poisson != poisson_matrix(system.form, system.coordinates):
        return False
    pairs = ((realisation.alpha, inner.alpha), (realisation.beta, inner.beta))
    return all(outer == moved(system, system.form, change, maps) for outer, maps in pairs)


def moved(
    system: System, form: PullbackForm, change: Coordinates, maps: Sequence[Expression]
) -> tuple[Expression, ...]:
    """Return α or β in the coordinates x, from its components ``maps`` in the coordinates y = ψ(x)."""
    p = covector_symbols(system.coordinates)
    covector = [total(pi * row[a] for pi, row in zip(p, change.jacobian, strict=True)) for a in range(len(p))]
    substitution = dict(zip(form.coordinates, change.forward, strict=True))
    substitution |= dict(zip(covector_names(form.coordinates), covector, strict=True))
    images = substitute(maps, substitution)
    return tuple(substitute(change.backward, dict(zip(form.coordinates, images, strict=True))))
