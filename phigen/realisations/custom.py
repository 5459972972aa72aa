"""The kind ``custom``: α and β are formulas in the spec. Their axioms are proved as for every other kind."""

from __future__ import annotations

from phigen.geometry.system import System
from phigen.realisations.protocol import BiRealisation, covector_names, is_symmetric, refuse, simplified_differences
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import symbol, symbols_of
from phigen.symbolic.symbols import plain

KIND = "custom"


def build(system: System, choice: BirealisationChoice) -> BiRealisation:
    """Return the bi-realisation with the maps ``choice.alpha`` and ``choice.beta`` of the spec.

    Raises `SpecError` for a wrong number of components and for unknown symbols.
    """
    known_symbols = {*system.coordinates, *system.parameter_names, *covector_names(system.coordinates)}
    for name, maps in (("alpha", choice.alpha), ("beta", choice.beta)):
        if len(maps) != system.dimension:
            raise refuse(f"birealisation {name} has {len(maps)} components for {system.dimension} coordinates")
        unknown = [s for s in symbols_of(*maps) if s not in known_symbols]
        if unknown:
            unknown_name = plain(unknown[0])
            raise refuse(f"birealisation {name} uses {unknown_name}, which is not a coordinate, a parameter or p_NAME")
    x = [symbol(c) for c in system.coordinates]
    return BiRealisation(
        KIND,
        system.coordinates,
        choice.alpha,
        choice.beta,
        simplified_differences(choice.alpha, x),
        simplified_differences(choice.beta, choice.alpha),
        is_symmetric(choice.alpha, choice.beta, system.coordinates),
        explanation="α and β as given in the spec",
        reference="given in the spec",
    )
