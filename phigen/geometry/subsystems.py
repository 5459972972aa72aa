"""Systems inside a system: the blocks of a π, and a structure in other coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.geometry.forms import structure
from phigen.geometry.system import System
from phigen.spec.model import MatrixForm, PoissonForm, ProductForm
from phigen.symbolic.expression import ZERO


def part(system: System, coordinates: Sequence[str], form: PoissonForm) -> System:
    """The system of a form in some coordinates, with the parameters of the given one; its Hamiltonian is 0.

    Casimirs are not searched for. Raises `SpecError` as `structure` does.
    """
    matrix, shape = structure(form, coordinates)
    return replace(
        system,
        coordinates=tuple(coordinates),
        poisson=matrix,
        hamiltonian=ZERO,
        casimirs={},
        invariants={},
        shape=shape,
        form=form,
        declared=(),
        notes=(),
        spec=None,
    )


def block_of(system: System, indices: Sequence[int]) -> System:
    """The system of some coordinates that form a block, by the form that the spec gives for it if it does."""
    names = tuple(system.coordinates[i] for i in indices)
    if isinstance(system.form, ProductForm):
        for coordinates, form in system.form.blocks:
            if coordinates == names:
                return part(system, names, form)
    return part(system, names, MatrixForm(tuple(tuple(system.poisson[i][j] for j in indices) for i in indices)))
