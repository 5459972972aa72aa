"""The steps of all kinds, with their kernels: Newton, Explicit, Path, Gauss, Splitting and Sweeps.

The kernels of a step belong to three stages of evaluation. ``prepare`` computes, from parameters and step size, the
values that depend neither on the state nor on inputs of the single step: the coefficients ``c:0``, ``c:1``, … If H
depends on the time, or there is noise, ``refresh`` computes further coefficients once in each stage, from these and
from the time in the middle of the stage or the increments of the noise. All other kernels read the coefficients and the
state only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from phigen.gauss.tableau import Tableau
from phigen.scheme.alternation import Schedule
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.path import PathSlopes, Recurrences
from phigen.scheme.step_kinds import EXPLICIT, GAUSS, NEWTON, PATH, SPLITTING, SWEEPS, StepKind
from phigen.symbolic.symbols import Symbol

#: Suffix of the name of a transposed kernel of a lattice.
BACK = "_back"


@dataclass(frozen=True)
class PathAdjoint:
    """The path integrated backwards with cotangents (`phigen.scheme.adjoint`).

    ``recurrences`` yield the cotangents, those of the ``used`` coefficients last. ``curvature`` is ∇S_h and its Hessian
    at the mean, ``slope`` the transpose of ∇S_h with respect to coefficients. ``slopes`` are the recurrences for the
    derivatives of a path, for many paths at once.
    """

    recurrences: Recurrences
    used: tuple[int, ...]
    curvature: Kernel
    slope: Kernel
    slopes: PathSlopes


@dataclass(frozen=True)
class Adjoint:
    """The transpose of a step.

    It has the transposes of the kernels of the step or of its flows (``steps``), of ``prepare``, of ``refresh`` and, if
    the step follows a path, of the ``path``.
    """

    steps: tuple[Kernel, ...]
    prepare: Kernel
    refresh: Kernel | None = None
    path: PathAdjoint | None = None

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once, without the curvature of a path."""
        slope = self.path.slope if self.path else None
        return _present((*self.steps, slope, self.prepare, self.refresh))


@dataclass(frozen=True)
class _Staged:
    """Base class of all steps. ``adjoint`` is the transpose of the step, if it was requested."""

    prepare: Kernel
    refresh: Kernel | None = field(default=None, kw_only=True)
    adjoint: Adjoint | None = field(default=None, kw_only=True)

    #: The properties of steps of this kind.
    kind: ClassVar[StepKind]

    @property
    def transposed(self) -> tuple[Kernel, ...]:
        """The kernels of the transpose; empty if it was not requested."""
        return self.adjoint.kernels if self.adjoint else ()

    @property
    def inner_solve(self) -> InnerSolve | None:
        """Settings of the solve for one point; None for steps without such a solve."""
        return None

    @property
    def eliminate(self) -> Kernel | None:
        """Kernel that solves with one Newton matrix; None if elimination is not unrolled."""
        return None

    @property
    def eliminate_transposed(self) -> Kernel | None:
        """Kernel that solves with the transpose of a Newton matrix; None if elimination is not unrolled."""
        return None

    @property
    def invert(self) -> Kernel | None:
        """Kernel of the inverse of a Newton matrix; None if it is not unrolled."""
        return None

    @property
    def centred(self) -> bool:
        """Whether the point y of an implicit step is the mean of its ends."""
        return False

    @property
    def frame(self) -> Kernel | None:
        """Kernel of the change from the frame of a step to that of the next; None if steps have no frames."""
        return None

    @property
    def lift(self) -> Lift | None:
        """Frames of group elements that move from step to step; None if there are none."""
        return None

    @property
    def lifted(self) -> Gauss | None:
        """The same step in such frames, if there is one."""
        return None

    @property
    def reduced(self) -> ReducedSweeps | None:
        """Sweeps over some of the unknowns of a step, if the other unknowns follow from them; else None."""
        return None

    @property
    def path(self) -> Recurrences | None:
        """The recurrences of the path that a step follows; None if it follows none."""
        return None

    @property
    def varied_path(self) -> Recurrences | None:
        """The recurrences of the path with its variation, for derivatives; None if the step follows no path."""
        return None

    @property
    def back(self) -> PathAdjoint | None:
        """The path integrated backwards with cotangents, if the step follows a path and its adjoint was requested;
        else None."""
        return self.adjoint.path if self.adjoint else None

    @property
    def flow_schedule(self) -> Schedule | None:
        """The schedule of the flows of a step; None if the step is not a sequence of flows."""
        return None

    @property
    def flow_kernels(self) -> tuple[Kernel, ...]:
        """The flows of a splitting with their derivatives and transposes; empty for other steps."""
        return ()

    @property
    def multiples(self) -> tuple[float, ...]:
        """The multiples of the modified potential in kicks, by rows of the schedule; empty without modified kicks."""
        return self.flow_schedule.multiples if self.flow_schedule else ()

    @property
    def method_name(self) -> str:
        """The name of the composition of flows or stages; "" if the step has none."""
        return ""

    @property
    def swept(self) -> Sweeps | None:
        """The step itself if it is one of a lattice, else None."""
        return None

    def maps(self, stages: int) -> int:
        """Return the number of maps (stages or flows) whose composition is a step with this number of stages."""
        return stages

    @property
    def prepared(self) -> int:
        """The number of values that one call of ``prepare`` computes."""
        return len(self.prepare.outputs[0].values)

    @property
    def renewed(self) -> int:
        """The number of values that one call of ``refresh`` computes."""
        return len(self.refresh.outputs[0].values) if self.refresh else 0

    @property
    def row(self) -> int:
        """The number of values in a row of coefficients: those of ``prepare`` and those of ``refresh``."""
        return self.prepared + self.renewed

    @property
    def coefficients(self) -> int:
        """The number of coefficients of one stage."""
        return self.row

    @property
    def corrected(self) -> bool:
        """Whether a run of steps begins and ends with a corrector."""
        return self.flow_schedule is not None and bool(self.flow_schedule.begin)


@dataclass(frozen=True)
class InnerSolve:
    """Settings of the solve of an implicit step.

    ``relative`` says that errors count relative to each coordinate, for coordinates that are positive or keep their
    sign (log-canonical π).
    """

    max_iterations: int = 20
    tolerance: float = 1e-20
    relative: bool = False


@dataclass(frozen=True)
class Factorisation:
    """A Newton matrix with many zeros: ``factorise`` it once, then ``substitute`` right-hand sides."""

    factorise: Kernel
    substitute: Kernel


@dataclass(frozen=True)
class Newton(_Staged):
    """Step by Newton's method: α(y, ∇S_h(y)) = x is solved for y; then x' = x + (β − α)(y, ∇S_h(y)).

    ``eliminate`` solves with one matrix, ``eliminate_transposed`` with its transpose, if the adjoint was requested. For
    many right-hand sides there is ``invert``, ``factors``, or neither. If a kernel is None, the runtime uses a loop.
    ``centred`` says that y is the mean of x and x'.
    """

    linearise: Kernel
    inner: InnerSolve
    eliminate: Kernel | None = None
    invert: Kernel | None = None
    factors: Factorisation | None = None
    centred: bool = False
    eliminate_transposed: Kernel | None = None

    kind = NEWTON

    @property
    def inner_solve(self) -> InnerSolve:
        """Settings of the solve for y."""
        return self.inner

    @property
    def main(self) -> Kernel:
        """The kernel that takes most of the time."""
        return self.linearise

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        factors = (self.factors.factorise, self.factors.substitute) if self.factors else ()
        kernels = (self.prepare, self.refresh, self.linearise, self.eliminate, self.eliminate_transposed, self.invert)
        return _present((*kernels, *factors, *self.transposed))


@dataclass(frozen=True)
class Explicit(_Staged):
    """Explicit step: the increment is a formula. ``tangent`` is its Jacobian, if the tangent map was requested."""

    increment: Kernel
    tangent: Kernel | None = None

    kind = EXPLICIT

    @property
    def main(self) -> Kernel:
        """The kernel that takes most of the time."""
        return self.increment

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        return _present((self.prepare, self.refresh, self.increment, self.tangent, *self.transposed))


@dataclass(frozen=True)
class PathLanes:
    """Kernels for several paths in lanes: the recurrences of the derivatives of a path, and kernels that use these
    derivatives."""

    slopes: PathSlopes
    curvature: Kernel
    along_mean: Kernel
    invert: Kernel


@dataclass(frozen=True)
class PathTangent:
    """The path with its variation (`phigen.scheme.tangent`), and the Hessian of S_h at its mean."""

    recurrences: Recurrences
    curvature: Kernel


@dataclass(frozen=True)
class Path(_Staged):
    """Step along a path: p = ∇S_h(mean of the path ṁ = π(m)p) is solved for p; α and β are the ends of the path."""

    recurrences: Recurrences
    generate: Kernel
    inner: InnerSolve
    eliminate: Kernel | None = None
    lanes: PathLanes | None = None
    tangent: PathTangent | None = None

    kind = PATH

    @property
    def inner_solve(self) -> InnerSolve:
        """Settings of the solve for p."""
        return self.inner

    @property
    def path(self) -> Recurrences:
        """The recurrences of the path."""
        return self.recurrences

    @property
    def varied_path(self) -> Recurrences | None:
        """The recurrences of the path with its variation, if derivatives were requested."""
        return self.tangent.recurrences if self.tangent else None

    @property
    def main(self) -> Kernel:
        """The kernel that takes most of the time apart from the recurrences."""
        return self.generate

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        lanes = (self.lanes.curvature, self.lanes.along_mean, self.lanes.invert) if self.lanes else ()
        varied = (self.curvature,) if not self.lanes else ()
        kernels = (self.prepare, self.refresh, self.generate, self.eliminate)
        return _present((*kernels, *lanes, *varied, *self.transposed))

    @property
    def curvature(self) -> Kernel | None:
        """Kernel of ∇S_h and its Hessian; None unless derivatives of a step were requested."""
        if self.tangent:
            return self.tangent.curvature
        return self.back.curvature if self.back else None


@dataclass(frozen=True)
class GaussTangent:
    """The Jacobians of the vector field of a stage, with respect to the start and to the unknowns, and that of
    ``change``."""

    slope: Kernel
    change: Kernel


@dataclass(frozen=True)
class ReducedSweeps:
    """Sweeps over the ``iterated`` unknowns of a Gauss method; the lists contain indices of unknowns.

    The iterated unknowns depend on the ``followers`` only. The followers are linear in the ``integrated`` unknowns,
    some of the iterated ones. Both kernels read integrals of the increments of the integrated unknowns: ``slope``
    computes the increments, ``follow`` the followers.
    """

    slope: Kernel
    follow: Kernel
    iterated: tuple[int, ...]
    followers: tuple[int, ...]
    integrated: tuple[int, ...]


@dataclass(frozen=True)
class Lift:
    """Frames F of group elements, components of which follow the coordinates and the time in the start of a step.

    ``functionals`` gives y = F* k F, three numbers for each copy of the quaternions; ``copies`` are the places of its
    basis 1, i, j, k among the ``size`` components, which belong to the last unknowns.
    """

    functionals: Kernel
    copies: tuple[tuple[int, int, int, int], ...]
    size: int


@dataclass(frozen=True)
class Gauss(_Staged):
    """Step by Gauss collocation.

    Z_i = Σ_j μ_ij L_j with L_j = h b_j f(x, Z_j) is solved by fixed-point sweeps; then x' = x + D(x, Σ_j L_j). The
    unknowns Z are offsets, 0 at the start of the step. ``slope`` is f; its input x is the point, with the time as the
    last entry if f depends on the time. ``change`` is D. ``frame`` transforms the L_j of a step to the frame of the
    next step, if that differs. The first ``plain`` unknowns have the scale of the state; the others, of group elements,
    have the scale 1. ``lifted`` is the same step in frames that move along, None if there is
    none; its ``lift`` describes the frames.
    """

    slope: Kernel
    change: Kernel
    tableau: Tableau
    plain: int
    frame: Kernel | None = None
    most_sweeps: int = 100
    tangent: GaussTangent | None = None
    reduced: ReducedSweeps | None = None
    lift: Lift | None = None
    lifted: Gauss | None = None

    kind = GAUSS

    @property
    def main(self) -> Kernel:
        """The kernel that takes most of the time."""
        return self.slope

    @property
    def unknowns(self) -> int:
        """Number of unknowns of a stage."""
        return len(self.slope.roots)

    @property
    def stage_transposes(self) -> tuple[Kernel, ...]:
        """Transposed kernels of a stage: those that read its weight w."""
        return tuple(k for k in (self.adjoint.steps if self.adjoint else ()) if "w" in k.inputs)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        varied = (self.tangent.slope, self.tangent.change) if self.tangent else ()
        reduced = (self.reduced.slope, self.reduced.follow) if self.reduced else ()
        return _present((self.prepare, self.slope, *reduced, self.change, self.frame, *varied, *self.transposed))


class _Scheduled(_Staged):
    """A step of flows that follow a schedule."""

    schedule: Schedule
    composition: str

    @property
    def flow_schedule(self) -> Schedule:
        """The order and the times of the flows in a step."""
        return self.schedule

    @property
    def method_name(self) -> str:
        """The name of the composition."""
        return self.composition

    @property
    def coefficients(self) -> int:
        """The number of coefficients of one step, in all rows."""
        return self.row * len(self.schedule.times)


@dataclass(frozen=True)
class Splitting(_Scheduled):
    """Step of a splitting: the exact flows of the parts of H, one after another as the ``schedule`` lists them.

    ``prepare`` computes a row of coefficients for each row of the schedule. ``composition`` is the name of the method;
    ``tangents`` are the Jacobians of the increments of the flows, if the tangent map was requested.
    """

    flows: tuple[Kernel, ...]
    schedule: Schedule
    composition: str
    tangents: tuple[Kernel, ...] = ()

    kind = SPLITTING

    @property
    def flow_kernels(self) -> tuple[Kernel, ...]:
        """The flows with their derivatives and transposes."""
        return (*self.flows, *self.tangents, *(self.adjoint.steps if self.adjoint else ()))

    def maps(self, stages: int) -> int:
        """The number of flows in a step, including those of a corrector."""
        return len(self.schedule.flows_of_run)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        return _present((self.prepare, self.refresh, *self.flows, *self.tangents, *self.transposed))


@dataclass(frozen=True)
class Seam:
    """The boundary seam along an axis, for sizes that are not multiples of the ``period`` of the colours.

    The seam consists of the last sites: the remainder of the size, and enough periods to make it at least ``wide``.
    The terms that start on it also update sites within the distance ``near``. All other terms have colours that fit
    their neighbours.
    """

    period: int = 1
    wide: int = 0
    near: int = 0

    @property
    def least(self) -> int:
        """The smallest size for which every remainder is possible: the seam, and at least as many other sites."""
        return 2 * self.wide + self.period - 1


@dataclass(frozen=True)
class Sites:
    """The sites of a lattice, whose sizes are arguments of the solver.

    ``places`` maps each symbol of kernels to a field, or parameter at sites, and an offset, with the fastest axis last.
    The colour of a site is Σ ``weights``·position modulo ``colours``. Sizes are multiples of ``periods``, and at least
    ``least``.
    """

    axes: tuple[str, ...]
    open: tuple[bool, ...]
    parameters: tuple[str, ...]
    places: Mapping[str, tuple[str, tuple[int, ...]]]
    colours: int = 1
    weights: tuple[int, ...] = ()
    periods: tuple[int, ...] = ()
    least: tuple[int, ...] = ()
    ends: Mapping[str, tuple[str, str]] = field(
        default_factory=dict
    )  # symbols of kernels of bonds or pairs: field and end
    at_bonds: tuple[str, ...] = ()  # parameters at bonds
    increments: tuple[str, ...] = ()  # noise increments of a site in one part of a step
    derived: tuple[Symbol, ...] = ()  # values at sites that the solver computes from the parameters
    seams: tuple[Seam, ...] = ()  # boundary seams along the axes, with which the colours fit every size


@dataclass(frozen=True)
class Ends:
    """A ``kernel`` of bonds or pairs between a site, a, and another site, b.

    Its inputs are ``coef`` or ``params``, ``site``, and ``bonds``, the parameters at bonds. ``end`` is the end of the
    bond at which the site lies, in the order of the user: a, b, or "" for either. ``chosen`` says which of the two must
    have the colour of the sweep: ``here`` (a), ``there`` (b), or "" for neither. ``extremes`` maps the indices of
    outputs that are reduced to ``max`` or ``min``; all other outputs are summed. For pairs, b runs over the sites from
    ``first`` on; if the kernel is ``massive``, the sites after the last one with a mass contribute nothing and are
    omitted.
    """

    kernel: Kernel
    end: str = ""
    chosen: str = ""
    extremes: Mapping[int, str] = field(default_factory=dict)
    first: int = 0
    massive: bool = False

    @property
    def of_all(self) -> bool:
        """Whether both sites of every bond or pair add the contribution of the bond or pair."""
        return not (self.end or self.chosen)


@dataclass(frozen=True)
class Gather:
    """Sums over the bonds of a site, or over its pairs with other sites: one value for each of the ``names``."""

    ends: tuple[Ends, ...]
    names: tuple[str, ...]

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """The kernels of all ends."""
        return tuple(e.kernel for e in self.ends)


@dataclass(frozen=True)
class Partners:
    """Sums over bonds or pairs at a site: half of the energies, and the forces or rates.

    They are functions of the parameters. ``varied`` has the forces with their derivatives along variations of the
    fields, for steps that solve an `Equation`. ``observed`` are the densities of observables of bonds and pairs,
    ``of_parts`` the energies of parts of H and their derivatives, by the names of the kernels that read them
    (`PartRates`).
    """

    energy: Gather
    field: Gather
    graph: bool = False
    varied: Gather = Gather((), ())
    observed: Gather = Gather((), ())
    of_parts: tuple[tuple[str, Gather], ...] = ()

    def sums_of(self, kernel: Kernel) -> Gather:
        """Return the sums that an observable reads; no sums if it reads none."""
        sums = {Role.ENERGY: self.energy, Role.VECTOR_FIELD: self.field, Role.OBSERVABLES: self.observed}
        return dict(self.of_parts).get(kernel.name) or sums.get(kernel.role, Gather((), ()))

    @property
    def gathers(self) -> tuple[Gather, ...]:
        """All sums, including empty ones."""
        return (self.energy, self.field, self.varied, self.observed, *(gather for _, gather in self.of_parts))


@dataclass(frozen=True)
class PartRates:
    """Steps of a lattice that are equal in τ: K = log(A + e) − log(−B), where H = A + B has two parts.

    The flow of a part of K is that of the part of H over the time τ/(A + e), or τ/(−B). ``energies`` are the densities
    of both parts, in the order of the parts of the step; the part with the number ``negative`` is B. ``slopes`` are the
    derivatives of the densities along a variation, if derivatives of a step were requested: then ``prepare`` reads the
    variation of the time of the flow, as the input ``late``.
    """

    energies: tuple[Kernel, Kernel]
    negative: int
    slopes: tuple[Kernel, ...] = ()

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        return (*self.energies, *self.slopes)


@dataclass(frozen=True)
class Sweep:
    """Increments of the fields with the indices ``moved`` at all sites of one ``colour``.

    A sweep reads no values that it changes. Without a colour, it updates every site. If it is ``inside``, it omits
    sites near seams. With a ``window``, it updates only sites near seams, by the terms that begin on the seams of these
    axes (a bit mask), or on none. It updates no sites before the ``first``.

    The inputs of the ``kernel`` are ``coef``, ``site``, ``present`` and ``gathered``. The symbols of ``present`` are 1
    if a term of H lies within open ends, or if a site has the colour of the sweep, else 0. ``gathered`` are the sums of
    ``gather``. ``tangent`` exists if derivatives of a step were requested: it has the increments of the variations of
    the fields, from the inputs of this sweep and the variations ``varied``.
    """

    kernel: Kernel
    moved: tuple[int, ...]
    colour: int | None = 0
    gather: Gather | None = None
    tangent: Sweep | None = None
    inside: bool = False
    window: int | None = None
    first: int = 0

    @property
    def is_tangent(self) -> bool:
        """Whether the sweep updates variations of the fields."""
        return self.kernel.role is Role.SWEEP_TANGENT


@dataclass(frozen=True)
class Equation:
    """The equation of a stage on a lattice: y = x − (α − x)(y, h∇H(y)); x is then updated by (β − α)(y, h∇H(y)).

    The inputs of the kernels are those of sweeps, with values of y as ``site``. ``relax``, the right-hand side at a
    site, also reads ``start``, the x of the site. ``advance`` is the increment of x. ``slope`` is the derivative of
    ``relax`` along a variation of y, for Newton's method. ``tangents`` exist if derivatives of a step were requested:
    those of ``relax`` along a variation of x, and of ``advance`` along one of y.
    """

    relax: Kernel
    advance: Kernel
    slope: Kernel
    tangents: tuple[Kernel, ...] = ()
    most_sweeps: int = 200

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        return self.relax, self.advance, self.slope, *self.tangents


@dataclass(frozen=True)
class RelativeSites:
    """The relative coordinates in which steps of a lattice of bodies are made (`phigen.lattice.relative_bodies`).

    ``axes`` pairs the index of each position with that of its momentum or velocity. ``remainder`` is the index of the
    part B. The sums over pairs in B read positions; its ``shifts`` further sums read velocities. ``mass`` is a
    parameter at sites.
    """

    jacobi: bool
    momenta: bool
    axes: tuple[tuple[int, int], ...]
    mass: str
    remainder: int
    shifts: int


@dataclass(frozen=True)
class Sweeps(_Scheduled):
    """A step of a lattice, by sweeps over its sites.

    In a splitting each of the ``parts`` is a list of sweeps, which may run in any order; the ``schedule`` lists the
    parts.

    If some parts belong to one colour of a graph (``by_colour``), the flows of a step are those of all parts, repeated
    for each colour. The ``schedule`` then contains these numbers instead of parts: 0 the first flow, 1 the flows in the
    middle, 2 the last flow, 3 the flows in the middle in reverse order. If H depends on the time, the advance of the
    time takes the place of the last flow, and the last flow is in the middle.

    In the series there is an ``equation`` instead of parts, and the schedule lists its stages.

    Bodies in ``relative`` coordinates are transformed to these before the flows, and back afterwards.
    """

    sites: Sites
    parts: tuple[tuple[Sweep, ...], ...]
    schedule: Schedule
    composition: str
    casimir_kinds: tuple[str, ...] = ()
    partners: Partners | None = None
    by_colour: tuple[bool, ...] = ()  # graphs: whether a part belongs to one colour
    equation: Equation | None = None
    rates: PartRates | None = None
    relative: RelativeSites | None = None

    kind = SWEEPS

    @property
    def swept(self) -> Sweeps:
        """The step itself, since it consists of sweeps over sites."""
        return self

    @property
    def is_by_hand(self) -> bool:
        """Whether a caller can make the sweeps of a step one by one, plane by plane: splittings on grids.

        Noise is drawn in the sweep that reads it, so no sweep may read the noise of neighbours. A seam lies at the end
        of the whole lattice, which a caller with a part of the lattice does not have.
        """
        reads_neighbour_increments = any(
            base in self.sites.increments and any(offset) for base, offset in self.sites.places.values()
        )
        return (
            self.partners is None and self.equation is None and not reads_neighbour_increments and not self.sites.seams
        )

    def stage(self, part: int, fields: Sequence[str]) -> tuple[int, int, int, int]:
        """Return the access of a part on a grid: its extent behind and ahead along the first axis, and two bit masks of
        fields.

        The masks are the fields that it reads at these distances, and the fields that it updates.
        """
        places = [self.sites.places[s] for sweep in self.parts[part] for s in sweep.kernel.inputs["site"]]
        distant = [(f, offset[0]) for f, offset in places if offset[0]]
        read_fields = {f for f, _ in distant if f in fields}
        updated = {fields[i] for sweep in self.parts[part] for i in sweep.moved}
        behind, ahead = max([0, *(-o for _, o in distant)]), max([0, *(o for _, o in distant)])
        bits = [sum(1 << k for k, f in enumerate(fields) if f in names) for names in (read_fields, updated)]
        return behind, ahead, bits[0], bits[1]

    @property
    def sweeps(self) -> tuple[Sweep, ...]:
        """The sweeps of all parts, each before its derivative."""
        return tuple(s for part in self.parts for sweep in part for s in (sweep, sweep.tangent) if s)

    @property
    def tangents(self) -> tuple[tuple[Sweep, ...], ...]:
        """The derivatives of the sweeps of each part; empty if they were not requested."""
        if any(sweep.tangent is None for part in self.parts for sweep in part):
            return ()
        return tuple(tuple(sweep.tangent for sweep in part if sweep.tangent) for part in self.parts)

    @property
    def others(self) -> Partners:
        """The sums over bonds or pairs; empty on grids."""
        return self.partners or Partners(Gather((), ()), Gather((), ()))

    @property
    def sums(self) -> int:
        """The largest number of sums over other sites that are stored for each site."""
        swept = [sweep.gather for sweep in self.sweeps if sweep.gather]
        return max(len(g.names) for g in (*swept, *self.others.gathers))

    @property
    def rate_kernels(self) -> tuple[Kernel, ...]:
        """The kernels of the energies of parts; empty without a monitor."""
        return self.rates.kernels if self.rates else ()

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        swept = [sweep for part in self.parts for sweep in part]
        swept += [sweep.tangent for sweep in swept if sweep.tangent]
        swept_kernels = [sweep.kernel for sweep in swept]
        swept_kernels += self.equation.kernels if self.equation else ()
        swept_kernels += self.rate_kernels
        gathers = [sweep.gather for sweep in swept if sweep.gather]
        gathers += self.others.gathers
        kernels = (*swept_kernels, *(k for g in gathers for k in g.kernels))
        return _present((self.prepare, self.refresh, *kernels, *self.transposed))


Step = Newton | Explicit | Path | Gauss | Splitting | Sweeps


def _present(kernels: Iterable[Kernel | None]) -> tuple[Kernel, ...]:
    return tuple(k for k in kernels if k is not None)
