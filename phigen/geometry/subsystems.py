"""Systems inside a system: blocks of π, and structures in other coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.geometry.forms import structure
from phigen.geometry.system import System
from phigen.spec.model import MatrixForm, PoissonForm, ProductForm
from phigen.symbolic.expression import ZERO


def part(system: System, coordinates: Sequence[str], form: PoissonForm) -> System:
    """Return a system with the form ``form`` of π in some coordinates, with the parameters of ``system`` and H = 0.

    Casimirs are not searched for. Raises the errors of `structure`.
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
    """Return the system of the coordinates of a block; its form is the one in the spec, if the spec has one for the
    block."""
    names = tuple(system.coordinates[i] for i in indices)
    if isinstance(system.form, ProductForm):
        for coordinates, form in system.form.blocks:
            if coordinates == names:
                return part(system, names, form)
    return part(system, names, MatrixForm(tuple(tuple(system.poisson[i][j] for j in indices) for i in indices)))
