"""Casimir functions that the form of a Poisson tensor gives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from phigen.geometry.shapes import Matrix, Shape
from phigen.spec.model import PoissonForm
from phigen.symbolic.expression import Expression


def found_casimirs(
    coordinates: Sequence[str],
    poisson: Matrix,
    shape: Shape,
    form: PoissonForm,
    declared: Mapping[str, Expression],
    taken: Collection[str],
) -> tuple[dict[str, Expression], tuple[str, ...]]:
    """Stub."""
    return {}, ()
