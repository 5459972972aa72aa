"""Moser's trick by recursion: a map ψ of T*U with ψ*Ω = ω that is the identity to first order at p = 0.

T*U is the set of all (x, p), and ω = Σ dx_i ∧ dp_i. The closed 2-form Ω is a sum ω + Ω₃ + Ω₅ + …, in which Ω_w has the
weight w: the number of factors p and dp (`phigen.realisations.cotangent`). Let w > 1 be the lowest weight with Ω_w ≠ 0.
The 1-form λ = ι_E Ω_w / w, with the Euler field E, is a primitive of Ω_w, since w Ω_w = L_E Ω_w = d ι_E Ω_w. Let Y be
the vector field with ι_Y ω = −λ. Then

    exp(Y)*Ω = Ω + L_Y Ω + ½ L_Y² Ω + … = ω + (terms of weight above w).

Repetition gives ψ = exp(Y_2) ∘ exp(Y_4) ∘ …, where Y_{w−1} raises weights by w − 1. Moser's trick itself integrates a
single field, which depends on a time. The recursion reaches the same normal form by a sequence of homogeneous fields,
one for each weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.realisations.cotangent import Components, Cotangent, GradedForm, GradedFunction


@dataclass(frozen=True)
class Step:
    """A factor exp(Y) of the map ψ in Moser's trick.

    ``field`` is the vector field Y. The weight of a function or form is the number of its factors p and dp; the
    derivative along Y raises the weight by ``weight``.
    """

    weight: int
    field: Components


def straighten(space: Cotangent, forms: GradedForm, top: int) -> list[Step]:
    """Return the factors exp(Y) of a map ψ with ψ*Ω = ω up to the weight ``top``, where ω is the canonical
    form.

    The factors are in the order in which `pulled_back` applies them. ``forms`` has the parts of the 2-form Ω by weight:
    ω at weight 1, and parts of odd weight. Parts that vanish give no factor.
    """
    steps = []
    for weight in range(3, top + 1, 2):
        remainder = forms.get(weight, {})
        if space.vanishes(remainder):
            continue
        primitive = space.contract(space.euler(), remainder)
        field = space.dual([space.scaled(f, Fraction(-1, weight)) for f in primitive])
        forms = _transported(space, forms, Step(weight - 1, field), top)
        steps.append(Step(weight - 1, field))
    return steps


def _transported(space: Cotangent, forms: GradedForm, step: Step, top: int) -> GradedForm:
    """Return the pull-back exp(Y)*Ω of a 2-form Ω up to the weight ``top``.

    ``forms`` has the parts of Ω by weight, and ``step`` is the factor exp(Y) of Moser's trick.
    """
    result: GradedForm = {}
    for weight, form in forms.items():
        term = form
        for j in range((top - weight) // step.weight + 1):
            if j:
                term = space.sum([(Fraction(1, j), space.lie(step.field, term))])
            if not term:
                break
            raised = weight + j * step.weight
            result[raised] = space.sum([(Fraction(1), result.get(raised, {})), (Fraction(1), term)])
    return result


def pulled_back(space: Cotangent, f: GradedFunction, steps: Sequence[Step], top: int) -> GradedFunction:
    """Return the pull-back of the function f by a map ψ, up to the weight ``top``. ``steps`` are the factors exp(Y) of
    ψ.

    Each exp(Y) acts on functions by the Lie series of Y.
    """
    for step in steps:
        result: GradedFunction = {}
        for weight, part in f.items():
            term = part
            for j in range((top - weight) // step.weight + 1):
                if j:
                    term = space.scaled(space.along(step.field, term), Fraction(1, j))
                if term == 0:
                    break
                raised = weight + j * step.weight
                result[raised] = result[raised] + term if raised in result else term
        f = result
    return f
