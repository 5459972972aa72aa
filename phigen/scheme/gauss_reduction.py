"""Gauss sweeps over a part of the unknowns, if linear equations give all other unknowns.

An example is q̇ = M⁻¹p with ṗ = −∇V(q): the sweeps iterate p alone. In general a *follower* f has ḟ = r₀ + Σ_k c_k z_k
with constants r₀ and c_k, and the derivatives of the other unknowns z_k depend only on followers. The unknowns are
offsets from the start of the step, where they are 0. The Gauss method has the nodes τ_i, the weights b_j and the matrix
A with the entries a_ij. L_k,j = h b_j ż_k is the increment of z_k at stage j. So z_k at stage i is Σ_j μ_ij L_k,j with
μ_ij = a_ij/b_j. Let ν be the product of the matrices A and μ. Then f at stage i, and its value f' at the end of the
step, are

    f_i = h (τ_i r₀ + Σ_k c_k Σ_j ν_ij L_k,j),    f' = h (r₀ + Σ_k c_k Σ_j (1 − τ_j) L_k,j).

One sweep over the z contracts as much as two sweeps over all unknowns. If ν_ij − ν_ji = τ_i − τ_j, and all brackets
between two followers or between two z are 0, the step is symplectic, as Suris showed. Unknowns on which no other
unknown depends, such as quadratures, are computed after the last sweep.
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

#: Kind of the symbols for integrals that the kernels of reduced sweeps read. The symbol for an unknown z_k stands for
#: its integral from the start of the step to a stage, divided by the step size. At stage i this is Σ_j ν_ij L_k,j; the
#: docstring of the module defines ν_ij and L_k,j.
INTEGRAL = "u"

#: Two symbols. The first is the time of a stage since the start of the step, as a fraction of the step. The second is
#: the step size.
TIME, LENGTH = Symbol("stage_time"), Symbol("stage_step")


def reduced_sweeps(points: StageMap, coefficients: Coefficients) -> ReducedSweeps | None:
    """Return the kernels of sweeps over a part of the unknowns; linear equations give all other unknowns.

    Returns None if the unknowns cannot be divided in this way, or if some unknowns are group elements or logarithms.
    Returns None also if the step must be symplectic and the reduced sweeps would not make it symplectic.
    """
    if points.realisation.groups or points.realisation.logarithms:
        return None
    rates = vector_field(points, at_unknowns(points))
    reads = [{k for k, z in enumerate(points.unknowns) if z in names} for names in map(symbols_of, rates)]
    rows = sparse_derivatives(rates, points.unknowns)
    linear = [
        k for k, row in enumerate(rows) if all(coefficients.is_state_independent(slope) for slope in row.values())
    ]
    required = _required_unknowns(reads)
    followers = [k for k in _followers(linear, reads) if k in required]
    iterated = [k for k in required if k not in followers]
    integrated = sorted({k for f in followers for k in reads[f]})
    if not integrated or any(not reads[i] <= set(followers) for i in iterated):
        return None
    if points.realisation.exact and not _are_conjugate(points, iterated, followers):
        return None
    symbols = [Symbol(INTEGRAL, k) for k in range(len(integrated))]
    integrals = {points.unknowns[k]: symbol(s) for k, s in zip(integrated, symbols, strict=True)}
    offsets = [_follower_at_stage(rates[f], rows[f], integrals) for f in followers]
    follower_offsets = dict(zip((points.unknowns[f] for f in followers), offsets, strict=True))
    values = [symbol(WEIGHT) * value for value in substitute([rates[i] for i in iterated], follower_offsets)]
    inputs = {"coef": coefficients.slots, "x": points.start, "u": tuple(symbols)}
    slope = Kernel(
        "reduced_field",
        "the derivatives of the iterated unknowns at a stage, times its weight w; u are integrals of increments",
        {**inputs, "w": (WEIGHT,), "time": (TIME, LENGTH)},
        (Output("move", tuple(coefficients.hoist(values))),),
    )
    follow = Kernel(
        "followers",
        "compute unknowns of a stage from u, the integrals of other unknowns from the start of the step to the stage",
        {**inputs, "time": (TIME, LENGTH)},
        (Output("offsets", tuple(coefficients.hoist(offsets))),),
    )
    return ReducedSweeps(slope, follow, tuple(iterated), tuple(followers), tuple(integrated))


def _are_conjugate(points: StageMap, iterated: Sequence[int], followers: Sequence[int]) -> bool:
    """Whether all brackets between unknowns in ``iterated`` are 0, and all brackets between unknowns in ``followers``.

    This is so if momenta are iterated and positions are followers. The result is False if some unknown other than the
    time is in neither of the two lists.
    """
    places = [{points.moved[k] for k in group if k < len(points.moved)} for group in (iterated, followers)]
    index_pairs = ((i, j) for group in places for i in group for j in group)
    complete = sum(map(len, places)) == len(points.moved)
    return complete and all(points.system.poisson[i][j].is_zero for i, j in index_pairs)


def _required_unknowns(reads: Sequence[set[int]]) -> list[int]:
    """Return the unknowns that must be known during the sweeps.

    These are the unknowns that depend on themselves, directly or through others, and all unknowns on which they depend.
    ``reads[k]`` has the unknowns on which the derivative of unknown k depends.
    """
    required = set(range(len(reads)))
    while True:
        read_unknowns = {k for i in required for k in reads[i]}
        if required <= read_unknowns:
            return sorted(required)
        required &= read_unknowns


def _followers(linear: Sequence[int], reads: Sequence[set[int]]) -> list[int]:
    """Return some of the unknowns in ``linear``, chosen such that the derivative of a chosen unknown depends on no
    chosen unknown.

    ``reads[k]`` has the unknowns on which the derivative of unknown k depends.
    """
    followers: list[int] = []
    for k in linear:
        candidates = {*followers, k}
        if not reads[k] & candidates and all(k not in reads[f] for f in followers):
            followers.append(k)
    return followers


def _follower_at_stage(
    rate: Expression, row: Mapping[str, Expression], integrals: Mapping[str, Expression]
) -> Expression:
    """Return the change of a follower from the start of the step to a stage.

    A follower is an unknown whose derivative is a linear function of other unknowns. The expression ``rate`` is this
    derivative, and ``row`` has the coefficients of the linear function. ``integrals`` has the integrals of the other
    unknowns up to the stage, divided by the step size.
    """
    (start,) = substitute([rate], {z: ZERO for z in symbols_of(rate) if kind_of(z) == OFFSET})
    terms = [symbol(TIME) * start, *(slope * integrals[z] for z, slope in row.items())]
    # The times of stages are exact numbers, so the product with the step size comes last and is rounded only once.
    return symbol(LENGTH) * total(terms)
