"""The kind ``auto``: choice of a bi-realisation by the shape of π.

Exact closed forms are tried first. The last choice is a solver that follows paths, which is possible for every π.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from phigen.errors import SpecError
from phigen.geometry.blocks import blocks
from phigen.geometry.shapes import Affine, Canonical, Constant, LiePoisson, LogCanonical
from phigen.geometry.system import System
from phigen.realisations import cayley, constant, exponential, gauged, karasev, log_canonical, product, pullback
from phigen.realisations.protocol import BiRealisation
from phigen.spec.model import BirealisationChoice, PullbackForm

KIND = "auto"

#: Reason for the choice, as text for the user. The numbers 8 to 26 were measured for random quadratic H and for tops:
#: the median of |π∇S_3| with the Cayley transform, divided by the median with the exponential. The quotient is 26 on
#: so(3)*, 8 on se(3)* and 15 on so(4)*. For |π∇S_5| the quotients are 710, 49 and 330. On sl(2)* and gl(2)*, all
#: quotients are between 0.9 and 2.
_BETTER = "preferred to the Cayley transform, whose error constants are 8 to 26 times larger on so(3), so(4) and se(3)"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the bi-realisation that suits the shape of π; its ``explanation`` names the chosen kind and the reason."""
    match system.shape:
        case Constant() | Canonical():
            realisation = constant.build(system, choice)
        case LogCanonical():
            realisation = log_canonical.build(system, choice)
        case LiePoisson() | Affine():
            realisation = _of_algebra(system, choice)
        case _:
            realisation = _general(system, choice)
    return replace(realisation, explanation=f"auto picked {realisation.kind}, since {realisation.explanation}")


def _of_algebra(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return a bi-realisation of a linear or affine π: the first one in a list that applies.

    The list is: the exponential in closed form; a bi-realisation for each block of π; the Cayley transform; the
    exponential by following paths.
    """
    candidate = exponential.closed_form(system)
    if candidate is not None:
        return replace(candidate, explanation=f"{candidate.explanation}; {_BETTER}")
    candidate = _applicable(_by_blocks, system, choice)
    if candidate is not None:
        return candidate
    try:
        candidate = cayley.build(system, choice)
    except SpecError as error:
        followed = exponential.followed(system, choice)
        reason = error.diagnostics[0].message
        return replace(followed, explanation=f"{followed.explanation}; no Cayley transform either: {reason}")
    reason = "the exponential has no closed form that phigen finds, and would have to follow paths numerically"
    return replace(candidate, explanation=f"{candidate.explanation}; {reason}")


def _general(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return a bi-realisation of a π with none of the simpler shapes: the first one in a list that applies.

    The list is: the bi-realisation ``gauged``, if π is constant in coordinates y_i that are functions of x_i only; a
    bi-realisation in the coordinates in which the spec states π; a bi-realisation for each block of π; Karasev's
    construction.
    """
    for kind in (_gauged, _pulled_back, _by_blocks):
        candidate = _applicable(kind, system, choice)
        if candidate is not None:
            return candidate
    candidate = karasev.build(system, choice)
    return replace(candidate, explanation=f"no closed form is known for this π: {candidate.explanation}")


def _gauged(system: System, choice: BirealisationChoice) -> BiRealisation:
    return gauged.build(system, choice)


def _pulled_back(system: System, choice: BirealisationChoice) -> BiRealisation | None:
    return pullback.build(system, choice, build) if isinstance(system.form, PullbackForm) else None


def _by_blocks(system: System, choice: BirealisationChoice) -> BiRealisation | None:
    if len(blocks(system.coordinates, system.poisson)) < 2:
        return None
    return product.assembled(system, product.grouped(system), build, choice)


def _applicable(
    kind: Callable[[System, BirealisationChoice], BiRealisation | None], system: System, choice: BirealisationChoice
) -> BiRealisation | None:
    try:
        return kind(system, choice)
    except SpecError:
        return None
