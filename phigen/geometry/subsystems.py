"""Systems made of a system: the system of a block of π, and a structure in other coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.geometry.forms import structure
from phigen.geometry.system import System
from phigen.spec.model import MatrixForm, PoissonForm, ProductForm
from phigen.symbolic.expression import ZERO


def part(system: System, coordinates: Sequence[str], form: PoissonForm) -> System:
    """Return a system with H = 0 in the given coordinates, with π by ``form`` and with the parameters of ``system``.

    Its Casimirs and invariants are left empty, without a search. Raises the errors of `structure`.
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
    """Return the system with H = 0 of the coordinates of a block of π, given by their indices.

    Its form of π is the one that the spec states for this block, if there is one, else the matrix.
    """
    names = tuple(system.coordinates[i] for i in indices)
    if isinstance(system.form, ProductForm):
        for coordinates, form in system.form.blocks:
            if coordinates == names:
                return part(system, names, form)
    return part(system, names, MatrixForm(tuple(tuple(system.poisson[i][j] for j in indices) for i in indices)))
