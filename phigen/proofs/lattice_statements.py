"""Statements on a lattice of any size and on its method."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from phigen.compilation import CompiledLattice
from phigen.lattice import flow_proofs, forcing, proofs, relative_proofs, series_proofs
from phigen.lattice.cell import Cell
from phigen.lattice.sweep_plans import SplittingPlan
from phigen.proofs.statements import CASIMIRS, FORCES, INVARIANTS, METHOD, NOISE, SPLITTING
from phigen.symbolic.verdict import REFUTED, Statement


def lattice(cell: Cell) -> dict[str, tuple[Statement, ...]]:
    """Return the statements on π, Casimirs and invariants of a lattice of any size, by group."""
    groups = {"Poisson tensor": proofs.tensor(cell)}
    if any(s.verdict == REFUTED for s in groups["Poisson tensor"]):
        return groups
    statements = {
        CASIMIRS: tuple(proofs.casimirs(cell)),
        FORCES: tuple(forcing.force_statements(cell)),
        NOISE: tuple(forcing.noise_statements(cell)),
        INVARIANTS: tuple(proofs.invariants(cell)),
        "Hamiltonian": tuple(proofs.pair_symmetry(cell)),
    }
    return groups | {group: group_statements for group, group_statements in statements.items() if group_statements}


def sweeps(compilation: CompiledLattice) -> dict[str, tuple[Statement, ...]]:
    """Return the statements on the method of a lattice, by group.

    A splitting has statements on the parts of H and their flows, a series on its bi-realisation and the equation of a
    stage.
    """
    cell, plan = compilation.cell, compilation.sweeps
    group = f"{METHOD} ({plan.kind})" if plan.is_implicit else SPLITTING

    def of_splitting(splitting: SplittingPlan) -> Iterator[Statement]:
        if splitting.bodies:
            return relative_proofs.check(splitting.bodies, splitting.flows)
        return flow_proofs.check(cell, splitting)

    statements = plan.either(of_splitting, partial(series_proofs.check, cell))
    return {group: tuple(statements)}
