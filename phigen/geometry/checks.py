"""Statements about the mathematics of a system, with verdicts: skew symmetry, Jacobi identity, Casimirs, invariants,
forces, noise, and the rank of π.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.geometry.jacobi import jacobi_identity
from phigen.geometry.rank import ATTEMPTS, POINTS, generic_ranks
from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.symbolic.expression import Expression, gradient, number, substitute, symbols_of, total
from phigen.symbolic.readable import shortened
from phigen.symbolic.tower import Tower
from phigen.symbolic.verdict import CHECKED, PROVED, REFUTED, UNDECIDED, Statement, decide_zero, sample_point

#: Name of the statement that the sources of noise commute. The strong order is then 1.
COMMUTING = "the sources of noise commute, hence strong order 1"


def check(system: System) -> list[Statement]:
    """Return the statements about π, the Casimirs, the invariants and the rank of π.

    The Casimirs are in the order of the spec; those that phigen found come last. Statements about forces and noise are
    made by `force_statements` and `noise_statements`.
    """
    return [
        skew_symmetry(system),
        jacobi_identity(system),
        *casimir_statements(system),
        *invariant_statements(system),
        rank_statement(system),
    ]


def skew_symmetry(system: System) -> Statement:
    """Decide whether π_ij = −π_ji for all i, j."""
    pi, names = system.poisson, system.coordinates
    n = len(names)
    residuals = [(f"({names[i]}, {names[j]})", pi[i][j] + pi[j][i]) for i in range(n) for j in range(i, n)]
    return decide_zero("π is skew", residuals, system.positive)


def casimir_statements(system: System) -> Iterator[Statement]:
    """Yield the statement π∇C = 0 for each Casimir C, whether the spec declares it or phigen found it."""
    for name, casimir in system.casimirs.items():
        flow = hamiltonian_vector_field(system.poisson, gradient(casimir, system.coordinates))
        residuals = [(f"{{{c}, {name}}}", f) for c, f in zip(system.coordinates, flow, strict=True)]
        origin = "" if name in system.declared else f"found: {shortened(casimir)}"
        yield decide_zero(f"{name} is a Casimir", residuals, system.positive, origin)


def invariant_statements(system: System) -> Iterator[Statement]:
    """Yield the statement dF/dt = 0 for each declared invariant F, along the vector field of the system without
    noise.

    Without forces, dF/dt is {F, H} + ∂_t F.
    """
    flow = system.vector_field()
    for name, invariant in system.invariants.items():
        slopes = gradient(invariant, system.coordinates)
        rate = total(s * f for s, f in zip(slopes, flow, strict=True) if not s.is_zero)
        rate += total(gradient(invariant, system.times))
        title = f"d{name}/dt" if system.forces else f"{{{name}, H}}"
        label = f"{{{name}, H}} + ∂{name}/∂{system.time}" if system.time and not system.forces else title
        yield decide_zero(f"{name} is invariant", [(label, rate)], system.positive)


def force_statements(system: System) -> Iterator[Statement]:
    """Yield the statements about forces.

    One statement for each Casimir says at which rate the forces change the Casimir. With damping, a further statement
    says that the damping changes H at the rate −λ |π∇H|².
    """
    if system.forces is None:
        return
    for name, casimir in system.casimirs.items():
        rate = system.forced_rate_of_casimir(casimir)
        conserved = decide_zero(f"the forces keep {name}", [(f"d{name}/dt", rate)], system.positive)
        yield (
            conserved if conserved.holds else Statement(f"d{name}/dt = {shortened(rate)}, by the vector force", PROVED)
        )
    damping = system.forces.damping
    if not damping.is_zero:
        slope = gradient(system.hamiltonian, system.coordinates)
        flow = hamiltonian_vector_field(system.poisson, slope)
        bracket = hamiltonian_vector_field(system.poisson, flow)
        work = total(s * b for s, b in zip(slope, bracket, strict=True)) + total(f * f for f in flow)
        yield decide_zero("the damping changes H at the rate -λ |π∇H|²", [("", work)], system.positive)


def noise_statements(system: System) -> Iterator[Statement]:
    """Yield the statements about noise.

    The first statement says whether the sources of noise commute, which decides the strong order. The second statement
    says that the density exp(−H/T) is stationary for some temperature T. The second statement is left out unless it
    holds.
    """
    if not system.noise:
        return
    commute = _commutation(system)
    unlike = "the sources of noise do not commute, hence strong order 1/2"
    yield commute if commute.verdict != REFUTED else Statement(unlike, PROVED)
    fields = [hamiltonian_vector_field(system.poisson, s.impulse(system.coordinates)) for s in system.noise]
    if system.forces is None or system.time:
        return
    slope = gradient(system.hamiltonian, system.coordinates)
    rates = [total(a * b for a, b in zip(slope, field, strict=True)) for field in fields]
    spread = [total(r * e for r, e in zip(rates, entries, strict=True)) for entries in zip(*fields, strict=True)]
    tangent = hamiltonian_vector_field(system.poisson, system.forces.covector)
    diffusive_rate = [a + b for a, b in zip(tangent, system.forces.vector, strict=True)]
    temperature = _temperature(system, slope, diffusive_rate, spread)
    if temperature is None:
        return
    residuals = [
        (c, 2 * temperature * a + b) for c, a, b in zip(system.coordinates, diffusive_rate, spread, strict=True)
    ]
    name = f"the density exp(−H/θ) on the leaves is stationary, with θ = {shortened(temperature)}"
    balanced = decide_zero(name, residuals, system.positive)
    if balanced.holds:
        yield balanced


def commuting(system: System) -> bool:
    """Whether the flows of all sources of noise commute; False if phigen cannot decide it."""
    return _commutation(system).holds


def _commutation(system: System) -> Statement:
    count = len(system.noise)
    brackets = [_noise_bracket(system, i, j) for i in range(count) for j in range(i)]
    return decide_zero(COMMUTING, brackets, system.positive)


def _noise_bracket(system: System, i: int, j: int) -> tuple[str, Expression]:
    """Return a label, and an expression that is 0 if and only if the flows of the noise sources i and j
    commute.

    Let g_i be the Hamiltonian of source i, and σ_i its amplitude. The expression is |π∇{σ_i g_i, σ_j g_j}|².
    """
    first, second = system.noise[i], system.noise[j]
    field = hamiltonian_vector_field(system.poisson, second.impulse(system.coordinates))
    bracket = total(a * b for a, b in zip(first.impulse(system.coordinates), field, strict=True))
    bracket_field = hamiltonian_vector_field(system.poisson, gradient(bracket, system.coordinates))
    return f"{{{first.name}, {second.name}}}", total(m * m for m in bracket_field)


def _temperature(
    system: System, slope: Sequence[Expression], diffusive_rate: Sequence[Expression], spread: Sequence[Expression]
) -> Expression | None:
    """Return a temperature T for which the density exp(−H/T) may be stationary, or None if no sample point
    gives one.

    If the density is stationary, then ∇H·(2T(πζ + f) + Σ σ²(XH)X) = 0. T solves this equation at one sample point.
    ``slope`` is ∇H. ``diffusive_rate`` is πζ + f, the vector field of the forces. ``spread`` is Σ σ²(XH)X, the sum over
    the sources of noise, each with an amplitude σ and a vector field X.
    """
    loss = total(a * b for a, b in zip(slope, diffusive_rate, strict=True))
    gained = total(a * b for a, b in zip(slope, spread, strict=True))
    for k in range(ATTEMPTS):
        point = {c: number(v) for c, v in sample_point(system.coordinates, (), k).items()}
        loss_value, gain_value = substitute([loss, gained], point)
        if not (loss_value.is_zero or gain_value.is_zero):
            return _ratio(-gain_value, 2 * loss_value)
    return None


def _ratio(numerator: Expression, denominator: Expression) -> Expression:
    """Return the quotient of two expressions, with common factors cancelled."""
    # There are two rounds: the first one replaces squares of roots, and only then the second one finds common factors.
    for _ in range(2):
        tower = Tower(symbols_of(numerator, denominator), [numerator, denominator])
        a, b = (tower.simplified(e) for e in tower.convert_all([numerator, denominator]))
        common = a.gcd(b)
        numerator, denominator = tower.expression(a / common), tower.expression(b / common)
    return numerator / denominator


def rank_statement(system: System) -> Statement:
    """Return the statement about the rank of π at generic points, and about the number of independent Casimirs."""
    slopes = [gradient(c, system.coordinates) for c in system.casimirs.values()]
    ranks = generic_ranks([system.poisson, slopes], system.positive)
    if ranks is None:
        return Statement("rank of π", UNDECIDED, f"no point of the domain among {ATTEMPTS} tried")
    rank, independent = ranks
    casimir_count = f"{independent} of {system.dimension - rank} independent Casimirs known"
    notes = "".join(f"; {note}" for note in system.notes)
    return Statement("rank of π", CHECKED, f"{rank} at {POINTS} generic points, {casimir_count}{notes}")
