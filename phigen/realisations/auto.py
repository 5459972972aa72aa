"""The choice of a kind by the shape of π."""

from __future__ import annotations

from dataclasses import replace

from phigen.geometry.shapes import Canonical, Constant, LiePoisson, LogCanonical
from phigen.geometry.system import System
from phigen.realisations import cayley, constant, log_canonical
from phigen.realisations.protocol import BiRealisation, refuse
from phigen.spec.model import BirealisationChoice

KIND = "auto"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """The bi-realisation that fits the shape of π; its ``explanation`` says what was picked and why.

    Raises `SpecError`, saying what was tried, when no available kind applies.
    """
    match system.shape:
        case Constant() | Canonical():
            found = constant.build(system, choice)
        case LogCanonical():
            found = log_canonical.build(system, choice)
        case LiePoisson():
            found = cayley.build(system, choice)
        case _:
            raise refuse(
                "no available bi-realisation applies: π is not constant, not log-canonical and not linear",
                "the kind karasev, which handles every smooth π, is planned; "
                "a bi-realisation of your own can be given with kind: custom",
            )
    return replace(found, explanation=f"auto picked {found.kind}, since {found.explanation}")
