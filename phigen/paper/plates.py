"""Figures of the paper by file name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from phigen.paper import foliation, leaf_change, lotka_volterra, rigid_body
from phigen.paper.plate import Plate

PLATES: Mapping[str, Callable[[], Plate]] = {
    "lotka_volterra": lotka_volterra.errors_plate,
    "singularity": lotka_volterra.singularity_plate,
    "foliation": foliation.foliation_plate,
    "poisson_not_hamiltonian": leaf_change.leaf_change_plate,
    "rigid_body": rigid_body.errors_plate,
    "rigid_body_section": rigid_body.section_plate,
}
