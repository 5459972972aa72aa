"""The kinds of steps, with their kernels: ``Step = Newton Explicit Path Gauss Splitting Sweeps``.

Kernels of a step are of three stages. ``prepare`` computes, from parameters and step size, the values that depend
neither on the state nor on inputs of the single step: the coefficients ``c:0``, ``c:1``, … Where H depends on the
time, or there is noise, ``refresh`` computes further coefficients once in each stage, from these and from the time in
the middle of the stage or the increments of the noise. All other kernels read the coefficients and the state only.
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

#: The end of the name of a transposed kernel of a lattice.
BACK = "_back"


@dataclass(frozen=True)
class PathAdjoint:
    """The path integrated backward with cotangents (`phigen.scheme.adjoint`).

    ``recurrences`` give the cotangents, those of the ``used`` coefficients last. ``curvature`` is ∇S_h and
    its Hessian at the mean, ``slope`` the transpose of ∇S_h along coefficients. ``slopes`` are the recurrences for the
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

    It has the transposes of the kernels of ``steps`` (one, or one for each flow), of ``prepare``, of ``refresh``, and
    of the ``path`` if the step follows one.
    """

    steps: tuple[Kernel, ...]
    prepare: Kernel
    refresh: Kernel | None = None
    path: PathAdjoint | None = None

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once, but for the curvature of a path."""
        slope = self.path.slope if self.path else None
        return _present((*self.steps, slope, self.prepare, self.refresh))


@dataclass(frozen=True)
class _Staged:
    """Any step; ``adjoint`` is its transpose, if requested."""

    prepare: Kernel
    refresh: Kernel | None = field(default=None, kw_only=True)
    adjoint: Adjoint | None = field(default=None, kw_only=True)

    #: The facts about steps of this kind.
    kind: ClassVar[StepKind]

    @property
    def transposed(self) -> tuple[Kernel, ...]:
        """The kernels of the transpose."""
        return self.adjoint.kernels if self.adjoint else ()

    @property
    def inner_solve(self) -> InnerSolve | None:
        """Settings of the solve for one point; None for steps without an equation for one point."""
        return None

    @property
    def eliminate(self) -> Kernel | None:
        """Kernel that solves with one Newton matrix, if it is unrolled."""
        return None

    @property
    def eliminate_transposed(self) -> Kernel | None:
        """Kernel that solves with the transpose of a Newton matrix, if it is unrolled."""
        return None

    @property
    def invert(self) -> Kernel | None:
        """Kernel of the inverse of a Newton matrix, if it is unrolled."""
        return None

    @property
    def centred(self) -> bool:
        """Whether the point of an implicit step is the mean of its ends."""
        return False

    @property
    def frame(self) -> Kernel | None:
        """Kernel of the change from the frame of a step to that of the next, if steps have frames."""
        return None

    @property
    def reduced(self) -> ReducedSweeps | None:
        """Sweeps over some of the unknowns of a step, if the others follow from these."""
        return None

    @property
    def path(self) -> Recurrences | None:
        """The recurrences of the path that a step follows, if it follows one."""
        return None

    @property
    def varied_path(self) -> Recurrences | None:
        """The recurrences of the path with its variation, if the step follows one, for derivatives."""
        return None

    @property
    def back(self) -> PathAdjoint | None:
        """The path integrated backward with cotangents, if the step follows one and its adjoint was requested."""
        return self.adjoint.path if self.adjoint else None

    @property
    def flow_schedule(self) -> Schedule | None:
        """The schedule of the flows of a step; None where it is no sequence of flows."""
        return None

    @property
    def flow_kernels(self) -> tuple[Kernel, ...]:
        """The flows of a splitting with their derivatives and transposes."""
        return ()

    @property
    def multiples(self) -> tuple[float, ...]:
        """The multiples of the modified potential in kicks, by rows of the schedule; nothing where there are none."""
        return self.flow_schedule.multiples if self.flow_schedule else ()

    @property
    def method_name(self) -> str:
        """The name of the composition of flows or stages, where the step has it."""
        return ""

    @property
    def swept(self) -> Sweeps | None:
        """The step, if it is one of a lattice."""
        return None

    def maps(self, stages: int) -> int:
        """Return the number of maps that a step with this number of stages is composed of."""
        return stages

    @property
    def prepared(self) -> int:
        """The number of values that ``prepare`` computes in one call."""
        return len(self.prepare.outputs[0].values)

    @property
    def renewed(self) -> int:
        """The number of values that ``refresh`` computes in one call."""
        return len(self.refresh.outputs[0].values) if self.refresh else 0

    @property
    def row(self) -> int:
        """The number of values that one call of each computes."""
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

    ``relative`` says that the coordinates are positive or keep their sign (log-canonical π), so that errors count
    relative to each coordinate.
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
    """α(y, ∇S_h(y)) = x, solved for y by Newton's method; then x + (β − α)(y, ∇S_h(y)).

    ``eliminate`` solves with one matrix, ``eliminate_transposed`` with its transpose, if the adjoint was requested.
    For many right-hand sides there is ``invert``, ``factors``, or neither. Where a kernel is None, the runtime uses a
    loop. ``centred`` says that y is the mean of x and x'.
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
    """The increment of a step as a formula; ``tangent`` is its Jacobian, if the tangent map was requested."""

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
    """Kernels for several paths in lanes: the recurrences of the derivatives of a path, and their use."""

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
    """p = ∇S_h at the mean of the path ṁ = π(m)p, solved for p; α and β are the ends of the path."""

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
        """The kernel that takes most of the time, but for the recurrences."""
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
        """∇S_h and its Hessian, if derivatives of a step were requested."""
        if self.tangent:
            return self.tangent.curvature
        return self.back.curvature if self.back else None


@dataclass(frozen=True)
class GaussTangent:
    """The Jacobians of the vector field of a stage, along the start of the step and the unknowns, and of the change."""

    slope: Kernel
    change: Kernel


@dataclass(frozen=True)
class ReducedSweeps:
    """Sweeps over the ``iterated`` unknowns of a Gauss method; all entries are indices of unknowns.

    These depend on the ``followers`` only, and the followers are linear in the ``integrated`` ones among them. Both
    kernels read integrals of the moves of the latter: ``slope`` gives the moves, ``follow`` the followers.
    """

    slope: Kernel
    follow: Kernel
    iterated: tuple[int, ...]
    followers: tuple[int, ...]
    integrated: tuple[int, ...]


@dataclass(frozen=True)
class Gauss(_Staged):
    """Gauss collocation: Z_i = Σ_j μ_ij L_j with L_j = h b_j f(x, Z_j), by fixed-point sweeps; then x + D(x, Σ_j L_j).

    The unknowns Z are offsets, 0 at the start of the step. ``slope`` is f; the input x is the point, with the time as
    the last entry if f depends on it. ``change`` is D. ``frame`` transforms the L_j of a step to the frame of the
    next step, where that differs. The first ``plain`` unknowns have the scale of the state; the others, of group
    elements, have the scale 1.
    """

    slope: Kernel
    change: Kernel
    tableau: Tableau
    plain: int
    frame: Kernel | None = None
    most_sweeps: int = 100
    tangent: GaussTangent | None = None
    reduced: ReducedSweeps | None = None

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
        """Coefficients of one step, in all rows."""
        return self.row * len(self.schedule.times)


@dataclass(frozen=True)
class Splitting(_Scheduled):
    """The exact flows of the parts of H, one after another as the ``schedule`` lists them.

    ``prepare`` computes a row of coefficients for each row of the schedule. ``composition`` is the name of the
    method; ``tangents`` are the Jacobians of the increments of the flows, if the tangent map was requested.
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
        """The number of flows, with those of a corrector."""
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
        """The smallest size for any remainder: the seam, and at least the same number of other sites."""
        return 2 * self.wide + self.period - 1


@dataclass(frozen=True)
class Sites:
    """The sites of a lattice, whose number is an argument of the solver.

    ``places`` maps each symbol of kernels to the field, or parameter at sites, and the offset, with the fastest axis
    last. A site has the colour Σ ``weights``·position modulo ``colours``; sizes are multiples of ``periods``, at
    least ``least``.
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
    increments: tuple[str, ...] = ()  # of the noise of a site in a part of a step
    derived: tuple[str, ...] = ()  # values at sites that the solver computes from the parameters
    seams: tuple[Seam, ...] = ()  # the axes along which the colours fit every size


@dataclass(frozen=True)
class Ends:
    """A ``kernel`` of bonds or pairs between a site, a, and another, b.

    Its inputs are ``coef`` or ``params``, ``site`` and ``bonds``, the parameters at bonds. ``end`` says which end of
    the bond, in the order of the user, the site is: a, b, or "" for either. ``chosen`` says which of the two must
    have the colour of the sweep: ``here``, ``there``, or "" for neither. ``extremes`` maps numbers of outputs, of
    which the largest or the least value is kept in place of the sum, to ``max`` or ``min``. Of pairs, b is a site from
    ``first`` on; the sites after the last one with a mass contribute nothing where the kernel is ``massive``.
    """

    kernel: Kernel
    end: str = ""
    chosen: str = ""
    extremes: Mapping[int, str] = field(default_factory=dict)
    first: int = 0
    massive: bool = False

    @property
    def of_all(self) -> bool:
        """Whether both sites of every bond or pair add its contribution."""
        return not (self.end or self.chosen)


@dataclass(frozen=True)
class Gather:
    """Sums over the bonds of a site, or over its pairs with other sites: a value for each of the ``names``."""

    ends: tuple[Ends, ...]
    names: tuple[str, ...]

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """The kernels of all ends."""
        return tuple(e.kernel for e in self.ends)


@dataclass(frozen=True)
class Partners:
    """Sums over bonds or pairs at a site: half the energies, and the forces or rates, as functions of the parameters.

    ``varied`` has the forces with their derivatives along variations of the fields, where a step solves an
    `Equation`. ``observed`` are the densities of observables of bonds and pairs, ``of_parts`` the energies of parts of
    H and their derivatives, by the names of the kernels that read them (`PartRates`).
    """

    energy: Gather
    field: Gather
    graph: bool = False
    varied: Gather = Gather((), ())
    observed: Gather = Gather((), ())
    of_parts: tuple[tuple[str, Gather], ...] = ()

    def sums_of(self, kernel: Kernel) -> Gather:
        """The sums that an observable reads; empty where it reads none."""
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
    """Increments of the fields with the indices ``moved`` at all sites of one ``colour``, from values that the sweep
    does not change.

    Without a colour the sweep updates every site. If it is ``inside``, it omits sites near seams. With a ``window``
    it updates only sites near seams, by the terms that begin on the seams of these axes (bits), or on none. It updates
    no sites before the ``first``.

    The inputs of the ``kernel`` are ``coef``, ``site``, ``present`` and ``gathered``. The symbols of ``present`` are
    1 if a term of H lies within open ends, or if a site has the colour of the sweep, else 0; ``gathered`` are the
    sums of ``gather``. ``tangent`` exists if derivatives of a step were requested: the increments of the variations
    of the fields, from the inputs of this sweep and the variations ``varied``.
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
        """Whether the sweep updates variations."""
        return self.kernel.role is Role.SWEEP_TANGENT


@dataclass(frozen=True)
class Equation:
    """y = x − (α − x)(y, h∇H(y)) at all sites of a lattice, solved for y; x is then updated by (β − α)(y, h∇H(y)).

    The inputs of the kernels are those of sweeps, with values of y as ``site``. ``relax``, the right-hand side at a
    site, also reads ``start``, the x of the site. ``advance`` is the increment of x. ``slope`` is the derivative of
    ``relax`` along a variation of y, for Newton's method. ``tangents`` exist if derivatives of a step were
    requested: those of ``relax`` along a variation of x, and of ``advance`` along one of y.
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
    """The relative coordinates in which a lattice of bodies makes its steps (`phigen.lattice.relative_bodies`).

    ``axes`` pairs the indices of each position and of its momentum or velocity. ``remainder`` is the part B; its sums
    over pairs read positions, and ``shifts`` further sums read velocities. ``mass`` is a parameter at sites.
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

    In a splitting each of the ``parts`` is a list of sweeps, which may run in any order, and the ``schedule`` lists
    the parts.

    If some parts belong to one colour of a graph (``by_colour``), the flows of a step are those of all parts,
    repeated for each colour. The ``schedule`` then has these numbers in place of parts: 0 the first flow, 1 the flows
    in the middle, 2 the last, 3 the flows in the middle backwards. If H depends on the time, which advances in place
    of the last flow, the last flow is in the middle too.

    In the series there is an ``equation`` in place of parts, and the schedule lists its stages.

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
        """This step, since it consists of sweeps over sites."""
        return self

    @property
    def is_by_hand(self) -> bool:
        """Whether a caller can drive the sweeps of a step one by one over planes: in grids that are split.

        Noise is drawn with the sweep that reads it, so no sweep may read the noise of neighbours. A seam lies at the
        end of the lattice, which a caller with a part of the lattice does not have.
        """
        reads_neighbour_increments = any(
            base in self.sites.increments and any(offset) for base, offset in self.sites.places.values()
        )
        return (
            self.partners is None and self.equation is None and not reads_neighbour_increments and not self.sites.seams
        )

    def stage(self, part: int, fields: Sequence[str]) -> tuple[int, int, int, int]:
        """Return the access of a part on a grid: its extent behind and ahead along the first axis, and two sets.

        The sets, as bits of numbers, are the fields that it reads at these distances, and the fields that it updates.
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
        """The largest number of sums over other sites that a site stores."""
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
