"""Statements on a lattice, which hold for any number of sites, and statements on its method."""

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
    """Return the statements on a lattice, by group: on π, Casimirs, forces, noise, invariants, and pair
    interactions.

    If a statement on π is refuted, only the group on π is returned.
    """
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
    """Return the statements on the method of a lattice, as a map with one entry: title → statements.

    The statements for a splitting concern the parts of H and their flows. Those for a series concern the bi-realisation
    and the equation of a stage.
    """
    cell, plan = compilation.cell, compilation.sweeps
    group = f"{METHOD} ({plan.kind})" if plan.is_implicit else SPLITTING

    def of_splitting(splitting: SplittingPlan) -> Iterator[Statement]:
        if splitting.bodies:
            return relative_proofs.check(splitting.bodies, splitting.flows)
        return flow_proofs.check(cell, splitting)

    statements = plan.either(of_splitting, partial(series_proofs.check, cell))
    return {group: tuple(statements)}
