"""Division of H into parts, as few as possible: each part is a sum of commuting terms with elementary flows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf

from phigen import progress
from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System
from phigen.splitting.conflicts import Conflicts
from phigen.splitting.flow import SMALL_MATRICES, Flow, NoFlowError, Term, flow_of, joint_flow
from phigen.splitting.grouping import groupings
from phigen.splitting.near_integrable import size_of, small_part, with_motions
from phigen.splitting.regrouping import by_blocks, with_companions
from phigen.splitting.ring import Ring, ring_of
from phigen.splitting.terms import hamiltonian_terms, terms_of
from phigen.symbolic.expression import Expression
from phigen.symbolic.readable import shortened
from phigen.symbolic.tower import Poly

#: Largest number of companions whose multiples are subtracted from terms. Companions are Casimirs and similar
#: functions; see `phigen.splitting.regrouping`.
MAX_COMPANIONS = 3


@dataclass(frozen=True)
class SplitHamiltonian:
    """H as a sum of parts: the flows of the parts, in the order in which a step applies them.

    ``kick`` is the index of the part V if the method requires {V, {V, {V, T}}} = 0 (`phigen.splitting.kicks`). Then the
    flow of this part may be that of V + κ{V, {V, T}}. ``small`` is the index of the part εB if H = A + εB is
    near-integrable.
    """

    flows: tuple[Flow, ...]
    kick: int | None = None
    small: int | None = None


def split(system: System, *, motions: bool = True, rigid: bool = True) -> SplitHamiltonian:
    """Return H as a sum of parts with elementary flows.

    The number of parts is as small as possible. If several divisions have this number of parts, the one that preserves
    the most invariants is chosen. If ``motions``, a Kepler motion is a single term. If ``rigid`` is set as well, a free
    rigid body is also a single term. A near-integrable H is divided into its large and its small part. Raises
    `SpecError` at the Hamiltonian if a term has no flow; the message names the term.
    """
    summands = hamiltonian_terms(system)
    ring = ring_of(system, summands)
    # A constant H becomes one term, so that there is at least one part. The flow of this part changes nothing.
    terms = terms_of(ring, summands) or [Term(system.hamiltonian, ring.tower.convert(system.hamiltonian))]
    invariants = _invariants(system, ring)
    refused: NoFlowError | None = None
    best: SplitHamiltonian | None = None
    least: tuple[float, ...] = (inf, inf, inf, inf)
    conflicts = Conflicts(ring)
    for candidate in _candidates(system, conflicts, terms, motions=motions, rigid=rigid):
        parts = conflicts.grouped(candidate)
        small_index = small_part(system, ring, parts)
        if (small_index is None, len(parts)) > least[:2]:
            continue
        rank: tuple[float, ...] = (small_index is None, len(parts), _lost_invariant_count(ring, parts, invariants), 0)
        if rank >= least:
            continue
        try:
            flows = tuple(flow_of(ring, part) for part in parts)
        except NoFlowError as error:
            refused = refused or error
            continue
        rank = (*rank[:-1], sum(flow.calls_remainders for flow in flows))
        if rank < least:
            best, least = SplitHamiltonian(flows, small=small_index), rank
        if best and best.small is not None:
            break  # a division into a large and a small part is always preferred
    if best is None:
        raise _refusal(system, refused)
    return (
        best
        if best.small is not None
        else SplitHamiltonian(tuple(_exact_linear_flow(ring, _merged(ring, list(best.flows)))))
    )


def _invariants(system: System, ring: Ring) -> list[Poly]:
    """Return the invariants of the spec as elements of the ring. Invariants with functions or symbols that H and π lack
    are omitted.
    """
    elements = []
    for e in system.invariants.values():
        try:
            elements.append(ring.tower.convert(e))
        except ValueError:
            continue
    return elements


def _lost_invariant_count(ring: Ring, parts: Sequence[Sequence[Term]], invariants: Sequence[Poly]) -> int:
    """Return the number of invariants that change along the flow of at least one part.

    For example, let (x_i, y_i, z_i) be two spins, i = 1, 2. Their sum is constant along the flow of their scalar
    product x_1 x_2 + y_1 y_2 + z_1 z_2, but not along the flow of the single term x_1 x_2.
    """
    sums = [ring.tower.combine(t.element for t in part) for part in parts]
    return sum(not all(ring.commute(invariant, g) for g in sums) for invariant in invariants)


def _candidates(
    system: System, conflicts: Conflicts, terms: list[Term], *, motions: bool, rigid: bool
) -> Iterator[list[Term]]:
    """Yield lists of terms whose sum is H; each list is a candidate for the best division of H into parts.

    The lists come in this order:

    - terms as written;
    - summands of H as single terms, not expanded into monomials;
    - the Hamiltonians of Kepler motions and rigid bodies as single terms;
    - one sum for all terms that couple the same blocks of π;
    - terms after subtraction of companions (Casimirs and similar functions);
    - sums of groups of terms.
    """
    yield terms
    ring = conflicts.ring
    whole_terms = _with_whole_summands(ring, hamiltonian_terms(system))
    if whole_terms:
        yield whole_terms
    with_moving = with_motions(ring, terms, rigid=rigid) if motions else None
    if with_moving:
        yield with_moving
        moving = [t for t in with_moving if t.motion]
        for grouping in groupings(ring, [t for t in with_moving if not t.motion]):
            yield [*moving, *grouping]
    blocked = by_blocks(system, ring, terms)
    if blocked:
        yield blocked
    yield from _without_companions(system, conflicts, terms)
    for grouping in groupings(ring, terms):
        yield grouping
        yield from _without_companions(system, conflicts, grouping)


def _with_whole_summands(ring: Ring, listed: Sequence[Expression]) -> list[Term] | None:
    """Return the terms of H. A summand of H is one term if phigen finds its flow; other summands are expanded into
    monomials.

    An example on so(3) is (v·m)². Its flow rotates m about v, but its monomials do not commute with each other. Returns
    None if all summands are expanded.
    """
    whole_terms: list[Term] = []
    remaining: list[Expression] = []
    for e in listed:
        element = ring.tower.convert(e)
        support = ring.support(element)
        mixed = any((i, j) not in ring.zero_pairs for i in support for j in support)
        term = Term(e, element)
        if mixed and len(ring.terms(element, ring.state)) > 1 and isinstance(joint_flow(ring, [term]), Flow):
            whole_terms.append(term)
        else:
            remaining.append(e)
    return [*whole_terms, *terms_of(ring, remaining)] if whole_terms else None


def _without_companions(system: System, conflicts: Conflicts, terms: list[Term]) -> Iterator[list[Term]]:
    """Yield lists of terms from which multiples of companions have been subtracted, if this reduces the number of
    parts.

    Companions are Casimirs and similar functions; see `phigen.splitting.regrouping`.
    """
    ring = conflicts.ring
    for _ in range(MAX_COMPANIONS):
        fewest = len(conflicts.grouped(terms))
        if fewest == 1:
            return
        with progress.stage("companions of the terms") as running:
            improved = []
            for running.done, c in enumerate(with_companions(system, conflicts, terms), 1):
                if len(conflicts.grouped(c)) < fewest:
                    improved.append(c)
        if not improved:
            return
        improved.sort(key=lambda c: (len(conflicts.grouped(c)), size_of(system, ring, c)))
        yield from improved
        terms = improved[0]


def _merged(ring: Ring, flows: list[Flow]) -> list[Flow]:
    """Return the flows after merging parts: two parts become one if the equations of motion of their sum are linear,
    with a solution in closed form.
    """
    for i, first in enumerate(flows):
        for second in flows[i + 1 :]:
            if first.has_motion or second.has_motion:
                continue
            terms = [Term(f.hamiltonian, ring.tower.convert(f.hamiltonian)) for f in (first, second)]
            joint = joint_flow(ring, terms, linear=True)
            if isinstance(joint, Flow):
                return _merged(ring, [joint, *(f for f in flows if f not in (first, second))])
    return flows


def _exact_linear_flow(ring: Ring, flows: list[Flow]) -> list[Flow]:
    """Return the exact flow of H as the only part, if its equations of motion are linear and phigen can solve
    them.

    Otherwise the given flows are returned.
    """
    if len(flows) == 1:
        return flows
    terms = [Term(f.hamiltonian, ring.tower.convert(f.hamiltonian)) for f in flows]
    joint = joint_flow(ring, terms, linear=True, methods=SMALL_MATRICES)
    return [joint] if isinstance(joint, Flow) else flows


def _refusal(system: System, error: NoFlowError | None) -> SpecError:
    place = system.locations.get(("hamiltonian",))
    if error is None:
        return SpecError([Diagnostic("scheme splitting: H has no terms", place)])
    message = f"scheme splitting: the term {shortened(error.term.expression)} has no elementary flow: {error.reason}"
    hint = "scheme: series applies to every H; terms in coordinates that commute with one another always split"
    return SpecError([Diagnostic(message, place, hint)])
