"""The mathematics of a system as statements: skew symmetry, Jacobi identity, Casimirs, invariants, rank."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.geometry.jacobi import jacobi_identity
from phigen.geometry.rank import ATTEMPTS, POINTS, generic_ranks
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.symbolic.expression import gradient, total
from phigen.symbolic.readable import shortened
from phigen.symbolic.verdict import CHECKED, PROVED, UNDECIDED, Statement, decide_zero


def check(system: System) -> list[Statement]:
    """All statements on a system; Casimirs and invariants in the order of the spec, found Casimirs after."""
    return [
        skew_symmetry(system),
        jacobi_identity(system),
        *casimir_statements(system),
        *invariant_statements(system),
        rank_statement(system),
    ]


def skew_symmetry(system: System) -> Statement:
    """π_ij = −π_ji."""
    pi, names = system.poisson, system.coordinates
    n = len(names)
    residuals = [(f"({names[i]}, {names[j]})", pi[i][j] + pi[j][i]) for i in range(n) for j in range(i, n)]
    return decide_zero("π is skew", residuals, system.positive)


def casimir_statements(system: System) -> Iterator[Statement]:
    """π∇C = 0 for each Casimir, declared or found."""
    for name, casimir in system.casimirs.items():
        flow = hamiltonian_vector_field(system.poisson, gradient(casimir, system.coordinates))
        residuals = [(f"{{{c}, {name}}}", f) for c, f in zip(system.coordinates, flow, strict=True)]
        origin = "" if name in system.declared else f"found: {shortened(casimir)}"
        yield decide_zero(f"{name} is a Casimir", residuals, system.positive, origin)


def invariant_statements(system: System) -> Iterator[Statement]:
    """{F, H} + ∂_t F = 0 for each further first integral F."""
    flow = system.vector_field()
    for name, invariant in system.invariants.items():
        slopes = gradient(invariant, system.coordinates)
        rate = total(s * f for s, f in zip(slopes, flow, strict=True) if not s.is_zero)
        rate += total(gradient(invariant, system.times))
        plain = f"d{name}/dt" if system.forces else f"{{{name}, H}}"
        label = f"{{{name}, H}} + ∂{name}/∂{system.time}" if system.time and not system.forces else plain
        yield decide_zero(f"{name} is invariant", [(label, rate)], system.positive)


def force_statements(system: System) -> Iterator[Statement]:
    """How forces change Casimirs, and that the damping takes energy as it should."""
    if system.forces is None:
        return
    for name, casimir in system.casimirs.items():
        rate = system.forced_rate_of_casimir(casimir)
        kept = decide_zero(f"the forces keep {name}", [(f"d{name}/dt", rate)], system.positive)
        yield kept if kept.holds else Statement(f"d{name}/dt = {shortened(rate)}, by the vector force", PROVED)
    damping = system.forces.damping
    if not damping.is_zero:
        slope = gradient(system.hamiltonian, system.coordinates)
        flow = hamiltonian_vector_field(system.poisson, slope)
        bracket = hamiltonian_vector_field(system.poisson, flow)
        work = total(s * b for s, b in zip(slope, bracket, strict=True)) + total(f * f for f in flow)
        yield decide_zero("the damping changes H at the rate -λ |π∇H|²", [("", work)], system.positive)


def rank_statement(system: System) -> Statement:
    """The rank of π at generic points against the number of independent Casimirs known."""
    slopes = [gradient(c, system.coordinates) for c in system.casimirs.values()]
    ranks = generic_ranks([system.poisson, slopes], system.positive)
    if ranks is None:
        return Statement("rank of π", UNDECIDED, f"no point of the domain among {ATTEMPTS} tried")
    rank, independent = ranks
    known = f"{independent} of {system.dimension - rank} independent Casimirs known"
    notes = "".join(f"; {note}" for note in system.notes)
    return Statement("rank of π", CHECKED, f"{rank} at {POINTS} generic points, {known}{notes}")
