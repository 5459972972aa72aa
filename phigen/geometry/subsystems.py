"""Systems with H = 0 that are derived from a system: for a block of π, and for a structure in other coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.geometry.forms import structure
from phigen.geometry.system import System
from phigen.spec.model import MatrixForm, PoissonForm, ProductForm
from phigen.symbolic.expression import ZERO


def part(system: System, coordinates: Sequence[str], form: PoissonForm) -> System:
    """Return a system with H = 0 in the given ``coordinates``, with the π of ``form`` and the parameters of
    ``system``.

    The system has no Casimirs and no invariants, since none are searched for. Raises the errors of `structure`.
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
    """Return a system with H = 0 for a block of π; ``indices`` are the numbers of its coordinates, from 0.

    The π of the new system has the form that the spec states for the block. If the spec states none, π is a matrix.
    """
    names = tuple(system.coordinates[i] for i in indices)
    if isinstance(system.form, ProductForm):
        for coordinates, form in system.form.blocks:
            if coordinates == names:
                return part(system, names, form)
    return part(system, names, MatrixForm(tuple(tuple(system.poisson[i][j] for j in indices) for i in indices)))
