"""The steps of all kinds, with their kernels: Newton, Explicit, Path, Gauss, Splitting and Sweeps.

The kernels of a step are evaluated at three different times. ``prepare`` computes the coefficients ``c:0``, ``c:1``, …
from parameters and step size, before the steps. If H depends on the time, or if there is noise, ``refresh`` computes
further coefficients once in each stage, from the time in the middle of the stage or from the noise increments. All
other kernels read only the coefficients and the state.
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

#: Suffix of the names of transposed kernels on a lattice.
BACK = "_back"


@dataclass(frozen=True)
class PathAdjoint:
    """The kernels and recurrences that transpose a step along a path; the formulas are in
    `phigen.scheme.adjoint`.

    ``recurrences`` compute the path backwards, the cotangents of its states, and the cotangents of the coefficients
    that the path reads. ``used`` has the indices of these coefficients. ``curvature`` computes ∇S_h and its Hessian at
    the mean of the path. ``slope`` computes the cotangents of the coefficients of S_h from the cotangent of p = ∇S_h.
    ``slopes`` are recurrences for the derivatives of a path with respect to its start, to p and to coefficients. These
    recurrences are used where many paths are transposed at once.
    """

    recurrences: Recurrences
    used: tuple[int, ...]
    curvature: Kernel
    slope: Kernel
    slopes: PathSlopes


@dataclass(frozen=True)
class Adjoint:
    """The transpose of a step, for gradients.

    ``steps`` are the transposed kernels of the step, or of its flows. ``prepare`` and ``refresh`` are the transposes of
    the kernels with these names. ``path`` is the transpose of the path that the step follows, if there is one.
    """

    steps: tuple[Kernel, ...]
    prepare: Kernel
    refresh: Kernel | None = None
    path: PathAdjoint | None = None

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the transpose, each once, except ``curvature`` of a path, which the step has too."""
        slope = self.path.slope if self.path else None
        return _present((*self.steps, slope, self.prepare, self.refresh))


@dataclass(frozen=True)
class _Staged:
    """Base class of all steps, with defaults for the properties that only some kinds of steps have.

    ``prepare`` and ``refresh`` compute the coefficients. ``adjoint`` is the transpose of the step, if gradients were
    requested.
    """

    prepare: Kernel
    refresh: Kernel | None = field(default=None, kw_only=True)
    adjoint: Adjoint | None = field(default=None, kw_only=True)

    #: The kind of step. Each subclass sets this attribute.
    kind: ClassVar[StepKind]

    @property
    def transposed(self) -> tuple[Kernel, ...]:
        """The kernels of the transposed step; empty if gradients were not requested."""
        return self.adjoint.kernels if self.adjoint else ()

    @property
    def inner_solve(self) -> InnerSolve | None:
        """Settings of the iteration that solves the implicit equation of a step; None for steps that solve no such
        equation."""
        return None

    @property
    def eliminate(self) -> Kernel | None:
        """Kernel that solves linear equations with the Newton matrix; None if the runtime does this in a loop."""
        return None

    @property
    def eliminate_transposed(self) -> Kernel | None:
        """Kernel that solves linear equations with the transposed Newton matrix; None if the runtime does this in a
        loop."""
        return None

    @property
    def invert(self) -> Kernel | None:
        """Kernel of the inverse of the Newton matrix; None if there is no such kernel."""
        return None

    @property
    def centred(self) -> bool:
        """Whether y, the solution of the implicit equation of a step, is the mean of the old and the new state."""
        return False

    @property
    def frame(self) -> Kernel | None:
        """Kernel that transforms derivatives of group elements to the frame of the next Gauss step; None if no frame
        changes."""
        return None

    @property
    def lift(self) -> Lift | None:
        """The frames at which the group elements of a Gauss step start; None if all group elements start at 1."""
        return None

    @property
    def lifted(self) -> Gauss | None:
        """The Gauss step in its form with frames: group elements start at frames F instead of 1. None if the step has
        no form with frames.
        """
        return None

    @property
    def reduced(self) -> ReducedSweeps | None:
        """Sweeps over a part of the unknowns of a Gauss step, if linear equations give all other unknowns; else
        None.
        """
        return None

    @property
    def path(self) -> Recurrences | None:
        """The recurrences for the Taylor series of the path that a step follows; None for steps that follow no path."""
        return None

    @property
    def varied_path(self) -> Recurrences | None:
        """The recurrences of a path together with its variation, for tangent maps; None if there are none."""
        return None

    @property
    def back(self) -> PathAdjoint | None:
        """The transpose of the path that a step follows; None if there is no path, or if no gradients are requested."""
        return self.adjoint.path if self.adjoint else None

    @property
    def flow_schedule(self) -> Schedule | None:
        """The order and the durations of the flows of a step; None if the step is not a sequence of flows."""
        return None

    @property
    def flow_kernels(self) -> tuple[Kernel, ...]:
        """The kernels of a splitting that compute flows, derivatives of flows, and transposed flows; empty for other
        steps.
        """
        return ()

    @property
    def multiples(self) -> tuple[float, ...]:
        """The numbers m of the modified potentials V + m h² {V, {V, T}} for H = T + V, one for each row of the
        schedule; () if the method has no modified potentials.
        """
        return self.flow_schedule.multiples if self.flow_schedule else ()

    @property
    def method_name(self) -> str:
        """The name of the composition of flows, or "" if the step is not composed of flows."""
        return ""

    @property
    def swept(self) -> Sweeps | None:
        """The step itself if it is the step of a lattice, else None."""
        return None

    def maps(self, stages: int) -> int:
        """Return how many maps a step applies: its flows or, without flows, the ``stages`` of its composition."""
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
        """The number of coefficients in a row of the table: those of ``prepare`` and those of ``refresh``."""
        return self.prepared + self.renewed

    @property
    def coefficients(self) -> int:
        """The number of coefficients of one step. Steps without a schedule have one row of coefficients."""
        return self.row

    @property
    def corrected(self) -> bool:
        """Whether a run of steps begins and ends with flows of a symplectic corrector."""
        return self.flow_schedule is not None and bool(self.flow_schedule.begin)


@dataclass(frozen=True)
class InnerSolve:
    """Settings of the iteration that solves the implicit equation of a step.

    The iteration ends when the error that remains after a correction is estimated to be below ``tolerance``. If
    ``relative``, errors are measured relative to each coordinate. Relative errors are used for log-canonical π, whose
    coordinates keep their signs.
    """

    max_iterations: int = 20
    tolerance: float = 1e-20
    relative: bool = False


@dataclass(frozen=True)
class Factorisation:
    """Two kernels for linear equations whose matrix has many zeros.

    ``factorise`` computes the factors of the matrix once; ``substitute`` then solves for each right-hand side.
    """

    factorise: Kernel
    substitute: Kernel


@dataclass(frozen=True)
class Newton(_Staged):
    """Step by Newton's method: it solves α(y, ∇S_h(y)) = x for y; then x' = x + (β − α)(y, ∇S_h(y)).

    ``linearise`` is one iteration. ``eliminate`` solves linear equations with the Newton matrix. For gradients,
    ``eliminate_transposed`` solves equations with the transposed matrix. ``invert`` and ``factors`` are for equations
    with many right-hand sides: ``invert`` computes the inverse of the matrix, and ``factors`` computes its factors. At
    most one of the two is present. Where a kernel is None, the runtime uses a loop. ``centred`` says that y is the mean
    of x and x'.
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
        """Settings of the iteration that solves for y."""
        return self.inner

    @property
    def main(self) -> Kernel:
        """The kernel that takes most of the computing time: one Newton iteration."""
        return self.linearise

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the step without repetitions; targets print them as functions."""
        factors = (self.factors.factorise, self.factors.substitute) if self.factors else ()
        kernels = (self.prepare, self.refresh, self.linearise, self.eliminate, self.eliminate_transposed, self.invert)
        return _present((*kernels, *factors, *self.transposed))


@dataclass(frozen=True)
class Explicit(_Staged):
    """Explicit step x' = x + d(x): the kernel ``increment`` is d.

    ``tangent`` is the Jacobian of d, if tangent maps were requested.
    """

    increment: Kernel
    tangent: Kernel | None = None

    kind = EXPLICIT

    @property
    def main(self) -> Kernel:
        """The kernel that takes most of the computing time: the increment."""
        return self.increment

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the step without repetitions; targets print them as functions."""
        return _present((self.prepare, self.refresh, self.increment, self.tangent, *self.transposed))


@dataclass(frozen=True)
class PathLanes:
    """Kernels for the solution of several steps along paths at once, in SIMD lanes.

    ``slopes`` are the recurrences for the derivatives of a path; the other kernels use these derivatives.
    """

    slopes: PathSlopes
    curvature: Kernel
    along_mean: Kernel
    invert: Kernel


@dataclass(frozen=True)
class PathTangent:
    """Recurrences and a kernel for the tangent map of a step along a path.

    ``recurrences`` compute the path and its variation (`phigen.scheme.tangent`). ``curvature`` computes ∇S_h and Hess
    S_h at the mean of the path.
    """

    recurrences: Recurrences
    curvature: Kernel


@dataclass(frozen=True)
class Path(_Staged):
    """Step along a path ṁ = π(m)p: it solves p = ∇S_h(y) for p, where y = ∫ m dt is the mean of the path.

    The path starts at the old state and ends at the new state.
    """

    recurrences: Recurrences
    generate: Kernel
    inner: InnerSolve
    eliminate: Kernel | None = None
    lanes: PathLanes | None = None
    tangent: PathTangent | None = None

    kind = PATH

    @property
    def inner_solve(self) -> InnerSolve:
        """Settings of the iteration that solves for p."""
        return self.inner

    @property
    def path(self) -> Recurrences:
        """The recurrences for the Taylor coefficients of the path."""
        return self.recurrences

    @property
    def varied_path(self) -> Recurrences | None:
        """The recurrences of the path together with its variation; None if tangent maps were not requested."""
        return self.tangent.recurrences if self.tangent else None

    @property
    def main(self) -> Kernel:
        """The kernel of ∇S_h, which takes most of the computing time apart from the recurrences of the path."""
        return self.generate

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the step without repetitions; targets print them as functions."""
        lanes = (self.lanes.curvature, self.lanes.along_mean, self.lanes.invert) if self.lanes else ()
        varied = (self.curvature,) if not self.lanes else ()
        kernels = (self.prepare, self.refresh, self.generate, self.eliminate)
        return _present((*kernels, *lanes, *varied, *self.transposed))

    @property
    def curvature(self) -> Kernel | None:
        """Kernel of ∇S_h and Hess S_h at the mean of the path; None unless tangent maps or gradients were requested."""
        if self.tangent:
            return self.tangent.curvature
        return self.back.curvature if self.back else None


@dataclass(frozen=True)
class GaussTangent:
    """The Jacobians of the kernels ``slope`` and ``change`` of a Gauss step, for tangent maps.

    The derivatives are with respect to the start of the step and to the unknowns of a stage.
    """

    slope: Kernel
    change: Kernel


@dataclass(frozen=True)
class ReducedSweeps:
    """Sweeps over a part of the unknowns of a Gauss step; all lists contain indices of unknowns.

    The kernel ``slope`` computes the derivatives of the ``iterated`` unknowns. These derivatives depend only on the
    ``followers``. The kernel ``follow`` computes the followers. The derivatives of followers are linear functions of
    the ``integrated`` unknowns, which are some of the iterated ones. The two kernels read integrals of the integrated
    unknowns, from the start of the step to a stage, divided by the step size.
    """

    slope: Kernel
    follow: Kernel
    iterated: tuple[int, ...]
    followers: tuple[int, ...]
    integrated: tuple[int, ...]


@dataclass(frozen=True)
class Lift:
    """Frames of a Gauss step: quaternions F, at which the group elements of the step start instead of at 1.

    The star algebra contains copies of the quaternions, with the basis 1, i, j, k. There is a frame F for each copy.
    ``functionals`` computes a vector y of three numbers for each copy; F satisfies F* k F = y. All frames together have
    ``size`` components, which are the last unknowns of the step. ``copies`` has, for each copy, the indices of the
    components along 1, i, j, k.
    """

    functionals: Kernel
    copies: tuple[tuple[int, int, int, int], ...]
    size: int


@dataclass(frozen=True)
class Gauss(_Staged):
    """Step by Gauss collocation.

    Fixed-point sweeps solve the stage equations Z_i = Σ_j μ_ij L_j with L_j = h b_j f(x, Z_j), where b_j are the
    weights of the method, and μ_ij = a_ij/b_j follows from its matrix a_ij. Then x' = x + D(x, Σ_j L_j). The unknowns Z
    are offsets from the start of the step, where they are 0. ``slope`` is f; its input x is the start of the step,
    followed by the time if f depends on the time. ``change`` is D. ``frame`` transforms the L_j to the frame of the
    next step, if that frame differs. ``plain`` is the number of unknowns that have the scale of the state; these
    unknowns come first. All further unknowns are increments of logarithms or of group elements, and have the scale 1.

    ``lifted`` is the same step with the unknowns U = FG in place of the group elements G. The frame F is the value of U
    at the start of the step. The field ``lift`` of the step ``lifted`` describes the frames. ``lifted`` is None if some
    group element has no frame.
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
        """The kernel that takes most of the computing time: the vector field of a stage."""
        return self.slope

    @property
    def unknowns(self) -> int:
        """Number of unknowns of a stage."""
        return len(self.slope.roots)

    @property
    def stage_transposes(self) -> tuple[Kernel, ...]:
        """The transposed kernels that are called once for each stage: those that read the weight w of the stage."""
        return tuple(k for k in (self.adjoint.steps if self.adjoint else ()) if "w" in k.inputs)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the step without repetitions; targets print them as functions."""
        varied = (self.tangent.slope, self.tangent.change) if self.tangent else ()
        reduced = (self.reduced.slope, self.reduced.follow) if self.reduced else ()
        return _present((self.prepare, self.slope, *reduced, self.change, self.frame, *varied, *self.transposed))


class _Scheduled(_Staged):
    """Base class of steps that apply flows in the order of a schedule."""

    schedule: Schedule
    composition: str

    @property
    def flow_schedule(self) -> Schedule:
        """The order and the durations of the flows in a step."""
        return self.schedule

    @property
    def method_name(self) -> str:
        """The name of the composition of flows."""
        return self.composition

    @property
    def coefficients(self) -> int:
        """The number of coefficients in the table of one step. The table has one row for each duration in the
        schedule.
        """
        return self.row * len(self.schedule.times)


@dataclass(frozen=True)
class Splitting(_Scheduled):
    """Step of a splitting: the exact flows of the parts of H, in the order of the ``schedule``.

    ``prepare`` computes a row of coefficients for each row of the schedule. ``composition`` is the name of the method.
    ``tangents`` are the Jacobians of the increments of the flows, if tangent maps were requested.
    """

    flows: tuple[Kernel, ...]
    schedule: Schedule
    composition: str
    tangents: tuple[Kernel, ...] = ()

    kind = SPLITTING

    @property
    def flow_kernels(self) -> tuple[Kernel, ...]:
        """The kernels that compute flows, derivatives of flows, and transposed flows."""
        return (*self.flows, *self.tangents, *(self.adjoint.steps if self.adjoint else ()))

    def maps(self, stages: int) -> int:
        """The number of flows in a run of one step, including those of a corrector; ``stages`` does not matter."""
        return len(self.schedule.flows_of_run)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the step without repetitions; targets print them as functions."""
        return _present((self.prepare, self.refresh, *self.flows, *self.tangents, *self.transposed))


@dataclass(frozen=True)
class Seam:
    """The boundary seam of a lattice along a periodic axis whose size is not a multiple of the ``period`` of the
    colouring.

    The seam consists of the last sites of the axis. Let r be the remainder when the size is divided by the period. The
    seam has r sites plus the smallest number of whole periods that makes it at least ``min_length`` sites long. The
    terms of H that start on the seam are separate parts; they update the seam and up to ``margin`` sites on each side
    of it. All other terms are coloured as on a lattice without a seam.
    """

    period: int = 1
    min_length: int = 0
    margin: int = 0

    @property
    def min_size(self) -> int:
        """The smallest allowed number of sites along the axis.

        The longest possible seam has ``min_length`` + ``period`` − 1 sites. The rest of the axis must have
        ``min_length`` sites.
        """
        return 2 * self.min_length + self.period - 1


@dataclass(frozen=True)
class Sites:
    """The sites of a lattice, whose sizes are arguments of the solver.

    ``places`` maps each symbol of kernels to a pair: the name of a field, or of a parameter with a value at each site,
    and an offset from the site. Offsets have one entry for each axis, the fastest axis last. The colour of a site is Σ
    ``weights``·position modulo ``colours``. Three fields have one entry for each axis: ``periods``, ``min_sizes`` and
    ``open_axes``. The size of an axis must be a multiple of its period, and not smaller than its minimal size.
    ``open_axes`` says whether an axis has open ends.
    """

    axes: tuple[str, ...]
    open_axes: tuple[bool, ...]
    parameters: tuple[str, ...]
    places: Mapping[str, tuple[str, tuple[int, ...]]]
    colours: int = 1
    weights: tuple[int, ...] = ()
    periods: tuple[int, ...] = ()
    min_sizes: tuple[int, ...] = ()
    ends: Mapping[str, tuple[str, str]] = field(
        default_factory=dict
    )  # for bonds and pairs: symbol of kernels → (field, end of the bond)
    at_bonds: tuple[str, ...] = ()  # names of the parameters with a value at each bond
    increments: tuple[str, ...] = ()  # symbols of the noise increments of a site in one part of a step
    derived: tuple[Symbol, ...] = ()  # symbols of values at sites, computed from parameters
    seams: tuple[Seam, ...] = ()  # boundary seams along axes whose size may not fit the colouring


@dataclass(frozen=True)
class Ends:
    """A ``kernel`` for the bonds or pairs between the site of a loop and another site.

    The inputs of the kernel are ``coef`` or ``params``, ``site``, and ``bonds``, the parameters of the bond. ``end``
    selects the bonds that begin at the site of the loop ("a"), the bonds that end at this site ("b"), or all bonds of
    the site (""). ``chosen`` says which site must have the colour of the sweep: ``here`` (the site of the loop),
    ``there`` (the other site), or "" for neither. ``extremes`` maps the index of an output to ``max`` or ``min``, if
    this output is reduced in this way; all other outputs are summed. For pairs, the other sites begin with number
    ``first``. If ``massive`` is true, the other sites end with the last site of nonzero mass, since sites without mass
    contribute nothing.
    """

    kernel: Kernel
    end: str = ""
    chosen: str = ""
    extremes: Mapping[int, str] = field(default_factory=dict)
    first: int = 0
    massive: bool = False

    @property
    def of_all(self) -> bool:
        """Whether every bond or pair contributes to both of its sites. Then ``end`` and ``chosen`` are ""."""
        return not (self.end or self.chosen)


@dataclass(frozen=True)
class Gather:
    """Sums over the bonds of a site, or over its pairs with other sites; each of the ``names`` is the symbol of one
    sum."""

    ends: tuple[Ends, ...]
    names: tuple[str, ...]

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """The kernels that compute what a bond or pair adds to the sums: one kernel for each item of ``ends``."""
        return tuple(e.kernel for e in self.ends)


@dataclass(frozen=True)
class Partners:
    """Sums over the bonds or pairs of a site, as functions of the parameters. The sums of a sweep are in
    `Sweep.gather`.

    ``energy`` has half of the energy of a bond or pair, since a bond or pair is counted at both of its sites. ``field``
    has the forces or rates of the vector field. For steps that solve an `Equation`, ``varied`` has the forces, and
    their derivatives in the direction of a variation of the fields. ``observed`` has the densities of observables.
    ``of_parts`` has the energies of parts of H and their derivatives, by the name of the kernel that reads them
    (`PartRates`). ``graph`` says that the bonds are those of a graph.
    """

    energy: Gather
    field: Gather
    graph: bool = False
    varied: Gather = Gather((), ())
    observed: Gather = Gather((), ())
    of_parts: tuple[tuple[str, Gather], ...] = ()

    def sums_of(self, kernel: Kernel) -> Gather:
        """Return the sums over bonds or pairs that the kernel of an observable reads; no sums if it reads none."""
        sums = {Role.ENERGY: self.energy, Role.VECTOR_FIELD: self.field, Role.OBSERVABLES: self.observed}
        return dict(self.of_parts).get(kernel.name) or sums.get(kernel.role, Gather((), ()))

    @property
    def gathers(self) -> tuple[Gather, ...]:
        """All groups of sums over bonds or pairs; a group that a lattice does not need is empty."""
        return (self.energy, self.field, self.varied, self.observed, *(gather for _, gather in self.of_parts))


@dataclass(frozen=True)
class PartRates:
    """Kernels for the monitor ``log`` on a lattice, with H = A + B.

    Steps have equal size in the time τ of K = log(A + e) − log(−B). The flow of a part of K over τ is the flow of A
    over τ/(A + e), or that of B over τ/(−B). ``energies`` are the kernels of the densities of A and B, in the order of
    the parts of the step; the part with the number ``negative`` is B. If tangent maps were requested, ``slopes`` are
    the derivatives of the densities in the direction of a variation. Then ``prepare`` has one more input, ``late``: the
    variation of the duration of the flow.
    """

    energies: tuple[Kernel, Kernel]
    negative: int
    slopes: tuple[Kernel, ...] = ()

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """The kernels of the densities and of their derivatives, each once."""
        return (*self.energies, *self.slopes)


@dataclass(frozen=True)
class Sweep:
    """Loop over the sites of a lattice that adds increments to the fields with the indices ``moved``.

    The sites are those of one ``colour``, or all sites if ``colour`` is None. A sweep reads no values that it changes.
    If ``omits_seams`` is true, the sweep omits the sites near seams. If ``window`` is not None, the sweep updates only
    sites near seams, by the terms of H that start on the seams of certain axes. ``window`` is the bit mask of these
    axes; 0 stands for terms that start on no seam. Sites before number ``first`` are not updated.

    The inputs of the ``kernel`` are ``coef``, ``site``, ``present`` and ``gathered``. A symbol of ``present`` is 1 or
    0. The symbol says whether a term of H stays within the open ends, or whether a site has the colour of the sweep.
    ``gathered`` are the sums of ``gather``. ``tangent`` is the derivative of the sweep, if tangent maps were requested:
    it adds increments to a variation of the fields. It has the inputs of this sweep, and the input ``varied``.
    """

    kernel: Kernel
    moved: tuple[int, ...]
    colour: int | None = 0
    gather: Gather | None = None
    tangent: Sweep | None = None
    omits_seams: bool = False
    window: int | None = None
    first: int = 0

    @property
    def is_tangent(self) -> bool:
        """Whether the sweep updates a variation (tangent vector) of the fields instead of the fields."""
        return self.kernel.role is Role.SWEEP_TANGENT


@dataclass(frozen=True)
class Equation:
    """The implicit equation of a stage on a lattice: y = x − (α − x)(y, h∇H(y)); then (β − α)(y, h∇H(y)) is added to x.

    The kernels have the inputs of a sweep, with the values of y as ``site``. ``relax`` is the right-hand side at a
    site; it also reads ``start``, the x of this site. ``advance`` is the increment of x. For Newton's method, ``slope``
    is the derivative of ``relax`` along a variation of y. If tangent maps were requested, ``tangents`` are two more
    derivatives: that of ``relax`` along a variation of x, and that of ``advance`` along a variation of y.
    """

    relax: Kernel
    advance: Kernel
    slope: Kernel
    tangents: tuple[Kernel, ...] = ()
    most_sweeps: int = 200

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the equation, each once."""
        return self.relax, self.advance, self.slope, *self.tangents


@dataclass(frozen=True)
class RelativeSites:
    """The relative coordinates in which the steps of a lattice of attracting bodies are made.

    The coordinates are Jacobi coordinates if ``jacobi``, else democratic heliocentric ones. The fields are positions
    and momenta if ``momenta``, else positions and velocities. ``axes`` pairs the index of each position with that of
    its momentum or velocity. ``remainder`` is the index of the part B of H = A + B. The forces of B are sums over
    pairs. The last sums read velocities, and ``shifts`` is their number; all others read positions. ``mass`` is the
    name of the parameter at sites.
    """

    jacobi: bool
    momenta: bool
    axes: tuple[tuple[int, int], ...]
    mass: str
    remainder: int
    shifts: int


@dataclass(frozen=True)
class Sweeps(_Scheduled):
    """A step of a lattice, which consists of sweeps over its sites.

    In a splitting each of the ``parts`` of H is a list of sweeps, which may run in any order. The ``schedule`` lists
    the parts in the order of their flows. For a step with a generating function there is an ``equation`` instead of
    parts, and the schedule lists the stages.

    On a graph, ``by_colour`` may be true. The flows of all parts are then repeated for each colour, and form one list.
    A number in the ``schedule`` selects flows of this list: 0 the first, 1 all between the first and the last, 2 the
    last, and 3 those of number 1 in reverse order. If H depends on the time, the list ends with the advance of the
    time.

    On a lattice of attracting bodies, ``relative`` may describe relative coordinates. Then the fields are transformed
    to these coordinates before the flows, and back after the flows.
    """

    sites: Sites
    parts: tuple[tuple[Sweep, ...], ...]
    schedule: Schedule
    composition: str
    casimir_kinds: tuple[str, ...] = ()
    partners: Partners | None = None
    by_colour: tuple[bool, ...] = ()  # graphs: whether a part updates the sites of one colour only
    equation: Equation | None = None
    rates: PartRates | None = None
    relative: RelativeSites | None = None

    kind = SWEEPS

    @property
    def swept(self) -> Sweeps:
        """The step itself. In other classes of steps, this property is None."""
        return self

    @property
    def is_by_hand(self) -> bool:
        """Whether a caller can make the sweeps of a step one by one, on planes of the lattice.

        This is offered for splittings on grids. Noise is drawn by the sweep that reads it, so no sweep may read the
        noise of a neighbour. There must be no seam: a seam lies at the end of the whole lattice, and the caller may
        have only a part of the lattice.
        """
        reads_neighbour_increments = any(
            base in self.sites.increments and any(offset) for base, offset in self.sites.places.values()
        )
        return (
            self.partners is None and self.equation is None and not reads_neighbour_increments and not self.sites.seams
        )

    def stage(self, part: int, fields: Sequence[str]) -> tuple[int, int, int, int]:
        """Return four numbers that say which values the sweeps of a part of H access.

        The first two are the distances, along the first axis of a grid, of the farthest neighbours that are read:
        behind a site, and ahead of it. The third is the bit mask of the fields that are read at other positions along
        this axis. The fourth is the bit mask of the fields that are updated.
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
        """The sweeps of all parts in order; each sweep is followed by its derivative, if there is one."""
        return tuple(s for part in self.parts for sweep in part for s in (sweep, sweep.tangent) if s)

    @property
    def tangents(self) -> tuple[tuple[Sweep, ...], ...]:
        """For each part the derivatives of its sweeps; empty if tangent maps were not requested."""
        if any(sweep.tangent is None for part in self.parts for sweep in part):
            return ()
        return tuple(tuple(sweep.tangent for sweep in part if sweep.tangent) for part in self.parts)

    @property
    def others(self) -> Partners:
        """The sums over bonds or pairs that are not part of a sweep; empty on grids."""
        return self.partners or Partners(Gather((), ()), Gather((), ()))

    @property
    def sums(self) -> int:
        """The largest number of sums in a `Gather` of the step. Each site has memory for this number of values."""
        swept = [sweep.gather for sweep in self.sweeps if sweep.gather]
        return max(len(g.names) for g in (*swept, *self.others.gathers))

    @property
    def rate_kernels(self) -> tuple[Kernel, ...]:
        """The kernels that the monitor ``log`` needs; empty without this monitor."""
        return self.rates.kernels if self.rates else ()

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the step without repetitions; targets print them as functions."""
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
