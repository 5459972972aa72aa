"""Elimination of unknowns whose derivatives are linear in others, as those of positions are for q̇ = M⁻¹p.

If ḟ = r₀ + Σ_k c_k z_k with constant c_k, the stages and the end of f follow from the stage increments L of the z_k:
Z_f = h (τ_i r₀ + Σ_k c_k Σ_j ν_ij L_k,j), f' = f + h (r₀ + Σ_k c_k Σ_j (1 − τ_j) L_k,j). Here τ are the nodes, A is the
matrix of the method, and ν = Aμ.

If all other unknowns depend on such f only, as momenta depend on positions, sweeps iterate these other unknowns alone;
one such sweep contracts as much as two sweeps over all unknowns. If ν_ij − ν_ji = τ_i − τ_j, and brackets of two f or
of two other unknowns are 0, the step is symplectic, as Suris showed. Unknowns that no other unknown depends on, such as
quadratures, are computed after the last sweep.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phigen.gauss.stage_map import OFFSET, StageMap, at_unknowns, vector_field
from phigen.scheme.gauss_kernels import WEIGHT
from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import ReducedSweeps
from phigen.symbolic.expression import ZERO, Expression, sparse_derivatives, substitute, symbol, symbols_of, total
from phigen.symbolic.symbols import Symbol, kind_of

#: Kind of the symbols of the inputs of reduced sweeps: integrals of the increments of unknowns.
READ = "u"

#: Symbols of the time of a stage since the start of the step, in steps, and of the step.
TIME, LENGTH = Symbol("stage_time"), Symbol("stage_step")


def reduced_sweeps(points: StageMap, coefficients: Coefficients) -> ReducedSweeps | None:
    """Return sweeps over some of the unknowns; None if these depend on unknowns that are not followers."""
    if points.realisation.groups or points.realisation.logarithms:
        return None
    rates = vector_field(points, at_unknowns(points))
    reads = [{k for k, z in enumerate(points.unknowns) if z in names} for names in map(symbols_of, rates)]
    rows = sparse_derivatives(rates, points.unknowns)
    linear = [k for k, row in enumerate(rows) if all(coefficients.is_static(slope) for slope in row.values())]
    required = _required_unknowns(reads)
    followers = [k for k in _followers(linear, reads) if k in required]
    iterated = [k for k in required if k not in followers]
    integrated = sorted({k for f in followers for k in reads[f]})
    if not integrated or any(not reads[i] <= set(followers) for i in iterated):
        return None
    if points.realisation.exact and not _are_conjugate(points, iterated, followers):
        return None
    symbols = [Symbol(READ, k) for k in range(len(integrated))]
    integrals = {points.unknowns[k]: symbol(s) for k, s in zip(integrated, symbols, strict=True)}
    offsets = [_followed(rates[f], rows[f], integrals) for f in followers]
    follower_offsets = dict(zip((points.unknowns[f] for f in followers), offsets, strict=True))
    values = [symbol(WEIGHT) * value for value in substitute([rates[i] for i in iterated], follower_offsets)]
    inputs = {"coef": coefficients.slots, "x": points.start, "u": tuple(symbols)}
    slope = Kernel(
        "reduced_field",
        "w times the derivatives of the iterated unknowns of a stage, by integrals u of increments",
        {**inputs, "w": (WEIGHT,), "time": (TIME, LENGTH)},
        (Output("move", tuple(coefficients.hoist(values))),),
    )
    follow = Kernel(
        "followers",
        "the unknowns of a stage that follow from others, by integrals u of their increments",
        {**inputs, "time": (TIME, LENGTH)},
        (Output("offsets", tuple(coefficients.hoist(offsets))),),
    )
    return ReducedSweeps(slope, follow, tuple(iterated), tuple(followers), tuple(integrated))


def _are_conjugate(points: StageMap, iterated: Sequence[int], followers: Sequence[int]) -> bool:
    """Whether iterated unknowns and followers are conjugate.

    Together they must be all unknowns except the time, and only brackets between the two sets may be nonzero.
    """
    places = [{points.moved[k] for k in group if k < len(points.moved)} for group in (iterated, followers)]
    index_pairs = ((i, j) for group in places for i in group for j in group)
    complete = sum(map(len, places)) == len(points.moved)
    return complete and all(points.system.poisson[i][j].is_zero for i, j in index_pairs)


def _required_unknowns(reads: Sequence[set[int]]) -> list[int]:
    """Return the unknowns that others depend on, directly or indirectly, and those that depend on themselves."""
    required = set(range(len(reads)))
    while True:
        read_unknowns = {k for i in required for k in reads[i]}
        if required <= read_unknowns:
            return sorted(required)
        required &= read_unknowns


def _followers(linear: Sequence[int], reads: Sequence[set[int]]) -> list[int]:
    """Return a set of linear unknowns, none of which depends on itself or on another one of the set."""
    followers: list[int] = []
    for k in linear:
        candidates = {*followers, k}
        if not reads[k] & candidates and all(k not in reads[f] for f in followers):
            followers.append(k)
    return followers


def _followed(rate: Expression, row: Mapping[str, Expression], integrals: Mapping[str, Expression]) -> Expression:
    """Return the increment of a follower up to a stage, from the increments ``integrals`` of the other unknowns.

    At zero offsets a follower has the constant ``rate``; ``row`` has its derivatives with respect to other unknowns.
    """
    (start,) = substitute([rate], {z: ZERO for z in symbols_of(rate) if kind_of(z) == OFFSET})
    terms = [symbol(TIME) * start, *(slope * integrals[z] for z, slope in row.items())]
    # the times of stages are exact, their products with the step are not
    return symbol(LENGTH) * total(terms)
