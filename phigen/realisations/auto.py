"""The choice of a kind by the shape of π."""

from __future__ import annotations

from dataclasses import replace

from phigen.geometry.shapes import Canonical, Constant, LiePoisson, LogCanonical
from phigen.geometry.system import System
from phigen.realisations import cayley, constant, karasev, log_canonical
from phigen.realisations.protocol import BiRealisation
from phigen.spec.model import BirealisationChoice

KIND = "auto"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """The bi-realisation that fits the shape of π; its ``explanation`` says what was picked and why."""
    match system.shape:
        case Constant() | Canonical():
            found = constant.build(system, choice)
        case LogCanonical():
            found = log_canonical.build(system, choice)
        case LiePoisson():
            found = cayley.build(system, choice)
        case _:
            found = karasev.build(system, choice)
    return replace(found, explanation=f"auto picked {found.kind}, since {found.explanation}")
