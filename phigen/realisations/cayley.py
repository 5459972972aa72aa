"""Placeholder until the Cayley chart is committed."""

from __future__ import annotations

from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation, refuse
from phigen.spec.model import BirealisationChoice

KIND = "cayley"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Not there yet."""
    raise refuse("cayley is being written")
