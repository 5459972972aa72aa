"""The kinds of steps, with their kernels: ``Step = Newton | Explicit | Path | Gauss | Splitting | Sweeps``.

Kernels of a step are of three stages. ``prepare`` computes, from parameters and step size, every value that does not
depend on the state, nor on inputs of the single step: the coefficients ``c:0``, ``c:1``, … Where H depends on the time,
``refresh`` computes from these, and from the time in the middle of a stage, those that come after them, once in each
stage; so it does with the increments of noise. All others read the coefficients and the state only.
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

#: The end of the name of a kernel of lattices that is the transpose of another.
BACK = "_back"


@dataclass(frozen=True)
class PathAdjoint:
    """The path traced back with cotangents (`phigen.scheme.adjoint`): their ``recurrences``, those of the ``used``
    coefficients last; ∇S_h and its Hessian at the mean, and the transpose of ∇S_h along coefficients; ``slopes``, from
    which the derivatives of many paths at once follow."""

    recurrences: Recurrences
    used: tuple[int, ...]
    curvature: Kernel
    slope: Kernel
    slopes: PathSlopes


@dataclass(frozen=True)
class Adjoint:
    """The transpose of a step: of the kernels of the ``steps`` (one, or one for each flow), of ``prepare`` and of
    ``refresh``; if the step follows a path, that of the ``path``."""

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
    """Any step; ``adjoint`` is there if it was asked for."""

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
        """The solution of the equation for one point; None where there is no such equation."""
        return None

    @property
    def eliminate(self) -> Kernel | None:
        """The solution with one Newton matrix, where it is unrolled."""
        return None

    @property
    def eliminate_transposed(self) -> Kernel | None:
        """The solution with the transpose of one, where it is unrolled."""
        return None

    @property
    def invert(self) -> Kernel | None:
        """The inverse of a Newton matrix, where it is unrolled."""
        return None

    @property
    def centred(self) -> bool:
        """Whether the point of an implicit step is the mean of its ends."""
        return False

    @property
    def frame(self) -> Kernel | None:
        """The turn from the frame of a step to that of the next, where steps have frames."""
        return None

    @property
    def path(self) -> Recurrences | None:
        """The recurrences of the path that a step follows, if it follows one."""
        return None

    @property
    def varied_path(self) -> Recurrences | None:
        """Those of the path with its variation, if derivatives of such a step were asked for."""
        return None

    @property
    def back(self) -> PathAdjoint | None:
        """The path traced back, if a step follows one and its adjoint was asked for."""
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
        """The number of maps that a step of so many stages is composed of."""
        return stages

    @property
    def prepared(self) -> int:
        """Values that ``prepare`` computes in one call."""
        return len(self.prepare.outputs[0].values)

    @property
    def renewed(self) -> int:
        """Values that ``refresh`` computes in one call."""
        return len(self.refresh.outputs[0].values) if self.refresh else 0

    @property
    def row(self) -> int:
        """Values that are computed by one call of each."""
        return self.prepared + self.renewed

    @property
    def coefficients(self) -> int:
        """Coefficients of one stage."""
        return self.row


@dataclass(frozen=True)
class InnerSolve:
    """How the equation of an implicit step is solved.

    ``relative`` tells that the coordinates are positive or keep their sign (log-canonical π), so that errors count
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

    ``eliminate`` solves with one matrix, ``eliminate_transposed`` with the transpose of one, if the adjoint was asked
    for; of ``invert`` and ``factors``, for many right-hand sides, there is at most one. What is None is left to a loop.
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
        """The solution of the equation."""
        return self.inner

    @property
    def main(self) -> Kernel:
        """The kernel that takes most of the time."""
        return self.linearise

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        factors = (self.factors.factorise, self.factors.substitute) if self.factors else ()
        own = (self.prepare, self.refresh, self.linearise, self.eliminate, self.eliminate_transposed, self.invert)
        return _present((*own, *factors, *self.transposed))


@dataclass(frozen=True)
class Explicit(_Staged):
    """The increment of a step as a formula; ``tangent`` is its Jacobian, if the tangent map was asked for."""

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
    """What following several paths at once needs: the recurrences of the derivatives of a path, and their use."""

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
        """The solution of the equation for p."""
        return self.inner

    @property
    def path(self) -> Recurrences:
        """The recurrences of the path."""
        return self.recurrences

    @property
    def varied_path(self) -> Recurrences | None:
        """Those of the path with its variation, if derivatives were asked for."""
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
        own = (self.prepare, self.refresh, self.generate, self.eliminate)
        return _present((*own, *lanes, *varied, *self.transposed))

    @property
    def curvature(self) -> Kernel | None:
        """∇S_h and its Hessian, where derivatives of a step were asked for."""
        if self.tangent:
            return self.tangent.curvature
        return self.back.curvature if self.back else None


@dataclass(frozen=True)
class GaussTangent:
    """The Jacobians of the vector field of a stage, along the start of the step and the unknowns, and of the change."""

    slope: Kernel
    change: Kernel


@dataclass(frozen=True)
class Gauss(_Staged):
    """Gauss collocation: Z_i = Σ_j μ_ij L_j with L_j = h b_j f(x, Z_j), by fixed-point sweeps; then x + D(x, Σ_j L_j).

    The unknowns Z are offsets, 0 at the start of the step. ``slope`` is f; the input x is the point, with the time as
    the last entry if f depends on it. ``change`` is D. ``frame`` turns the L_j of a step into those that the next one
    would see, where that starts in another frame. The first ``plain`` unknowns are of the size of the state, those of
    group elements of that of the unit.
    """

    slope: Kernel
    change: Kernel
    tableau: Tableau
    plain: int
    frame: Kernel | None = None
    most_sweeps: int = 100
    tangent: GaussTangent | None = None

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
        return _present((self.prepare, self.slope, self.change, self.frame, *varied, *self.transposed))


@dataclass(frozen=True)
class Splitting(_Staged):
    """The exact flows of the parts of H, one after another as the ``schedule`` lists them.

    ``prepare`` computes a row of coefficients for each row of the schedule. ``composition`` is the name of the method;
    ``tangents`` are the Jacobians of the increments of the flows, if the tangent map was asked for.
    """

    flows: tuple[Kernel, ...]
    schedule: Schedule
    composition: str
    tangents: tuple[Kernel, ...] = ()

    kind = SPLITTING

    @property
    def flow_schedule(self) -> Schedule:
        """The schedule."""
        return self.schedule

    @property
    def method_name(self) -> str:
        """The name of the composition."""
        return self.composition

    @property
    def coefficients(self) -> int:
        """Coefficients of one step, in all rows."""
        return self.row * len(self.schedule.times)

    @property
    def flow_kernels(self) -> tuple[Kernel, ...]:
        """The flows with their derivatives and transposes."""
        return (*self.flows, *self.tangents, *(self.adjoint.steps if self.adjoint else ()))

    def maps(self, stages: int) -> int:
        """The number of flows."""
        return len(self.schedule.flows)

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        return _present((self.prepare, self.refresh, *self.flows, *self.tangents, *self.transposed))


@dataclass(frozen=True)
class Seam:
    """Where the last site along an axis meets the first, of sizes that are no multiples of the ``period`` of colours.

    It is as many of the last sites as are left over, and so many periods more that it is at least so ``wide``. Sites on
    it and so ``near`` it are moved by its terms too. Others have colours that fit those around them.
    """

    period: int = 1
    wide: int = 0
    near: int = 0

    @property
    def least(self) -> int:
        """The smallest size, whatever is left over: the seam and as many sites beside it."""
        return 2 * self.wide + self.period - 1


@dataclass(frozen=True)
class Sites:
    """The sites of a lattice, whose number is an argument of the solver.

    ``places`` tells of each symbol of kernels the field, or parameter at sites, and the offset, the fastest axis last.
    A site has the colour Σ ``weights``·position modulo ``colours``; sizes are multiples of ``periods``, at least
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
    ends: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # of bonds, pairs: what is read at a, or at b
    at_bonds: tuple[str, ...] = ()  # parameters at bonds
    increments: tuple[str, ...] = ()  # of the noise that each site has in a part of a step
    seams: tuple[Seam, ...] = ()  # along each axis, where colours take every size


@dataclass(frozen=True)
class Ends:
    """A ``kernel`` of bonds or pairs between a site, a, and another, b.

    Its inputs are ``coef`` or ``params``, ``site`` and ``bonds``, the parameters at bonds. ``end`` tells of bonds at
    which end, as they are given, the site is: a, b, or either; ``chosen`` which of the two must have the colour of the
    sweep: ``here``, ``there``, or none.
    """

    kernel: Kernel
    end: str = ""
    chosen: str = ""

    @property
    def of_all(self) -> bool:
        """Whether both sites of every bond or pair add up what it gives them."""
        return not (self.end or self.chosen)


@dataclass(frozen=True)
class Gather:
    """What all bonds, or pairs with other sites, add up at a site, a value for each of some ``names``."""

    ends: tuple[Ends, ...]
    names: tuple[str, ...]

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """The kernels of all ends."""
        return tuple(e.kernel for e in self.ends)


@dataclass(frozen=True)
class Partners:
    """The sites of a graph or all pairs: half the energies of a site with others, and what moves it, by parameters.

    ``varied`` is the latter with its derivative along variations of the fields, where a step solves an `Equation`.
    ``observed`` are the densities of observables of bonds and pairs.
    """

    energy: Gather
    field: Gather
    graph: bool = False
    varied: Gather = Gather((), ())
    observed: Gather = Gather((), ())

    @property
    def gathers(self) -> tuple[Gather, ...]:
        """All sums, also those of nothing."""
        return (self.energy, self.field, self.varied, self.observed)


@dataclass(frozen=True)
class Sweep:
    """Changes of the ``moved`` fields (indices) at all sites of one ``colour``, read from what stands still.

    Without a colour it is made at every site. If it is ``inside``, it leaves out sites near seams. With a ``window`` it
    is made at these alone, for terms that begin on these seams, as bits of their axes, or on none.

    The inputs of the ``kernel`` are ``coef``, ``site``, ``present``, symbols that are 1 where a term of H reaches
    beyond no open end, or where a site has the colour of the sweep, else 0, and ``gathered``, what ``gather`` adds up.
    ``tangent`` is there if derivatives of a step were asked for: how the variations of the moved fields change, from
    what this sweep reads and from variations, ``varied``, of it.
    """

    kernel: Kernel
    moved: tuple[int, ...]
    colour: int | None = 0
    gather: Gather | None = None
    tangent: Sweep | None = None
    inside: bool = False
    window: int | None = None

    @property
    def is_tangent(self) -> bool:
        """Whether it changes variations."""
        return self.kernel.role is Role.SWEEP_TANGENT


@dataclass(frozen=True)
class Equation:
    """y = x − (α − x)(y, h∇H(y)) at all sites of a lattice, solved for y; then x moves by (β − α)(y, h∇H(y)).

    The inputs of the kernels are those of sweeps, where ``site`` are values of y, and of ``relax``, the right-hand
    side at a site, also ``start``: x there. ``advance`` is what x moves by. ``slope`` is the derivative of ``relax``
    along a variation of y, for Newton's method. ``tangents`` are there if derivatives of a step were asked for: that
    of ``relax`` along a variation of x, and that of ``advance`` along one of y.
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
class Sweeps(_Staged):
    """A step of a lattice, by sweeps over its sites.

    Of a splitting each of the ``parts`` is a list of sweeps, which may be made in any order, and the ``schedule`` is
    that of the parts. Where some are ``by_colour``, the flows are those of all parts, of each colour where they are so,
    and the ``schedule`` has in place of parts: 0 the first flow, 1 those in the middle, 2 the last, 3 the middle
    backwards; where H depends on the time, which advances in place of the last, that one is in the middle too. Of the
    series there is an ``equation`` in place of parts, and the schedule has its stages.
    """

    sites: Sites
    parts: tuple[tuple[Sweep, ...], ...]
    schedule: Schedule
    composition: str
    casimir_kinds: tuple[str, ...] = ()
    partners: Partners | None = None
    by_colour: tuple[bool, ...] = ()  # of graphs: the parts that belong to one colour, and are done for each
    equation: Equation | None = None

    kind = SWEEPS

    @property
    def flow_schedule(self) -> Schedule:
        """The schedule."""
        return self.schedule

    @property
    def method_name(self) -> str:
        """The name of the composition."""
        return self.composition

    @property
    def coefficients(self) -> int:
        """Coefficients of one step, in all rows."""
        return self.row * len(self.schedule.times)

    @property
    def swept(self) -> Sweeps:
        """The step itself."""
        return self

    @property
    def is_by_hand(self) -> bool:
        """Whether the sweeps of a step can be driven one by one over planes: those of a grid that is split.

        Noise is drawn with the sweep that reads it, so that must not be that of neighbours. Seams are where the lattice
        has its ends, of which those who have but a piece of it know nothing.
        """
        beside = any(base in self.sites.increments and any(offset) for base, offset in self.sites.places.values())
        return self.partners is None and self.equation is None and not beside and not self.sites.seams

    def stage(self, part: int, fields: Sequence[str]) -> tuple[int, int, int, int]:
        """Of a part on a grid: how far behind and ahead it reads along the first axis, and as bits of a number the
        fields that it reads there, and those that it changes."""
        places = [self.sites.places[s] for sweep in self.parts[part] for s in sweep.kernel.inputs["site"]]
        far = [(f, offset[0]) for f, offset in places if offset[0]]
        read = {f for f, _ in far if f in fields}
        changed = {fields[i] for sweep in self.parts[part] for i in sweep.moved}
        behind, ahead = max([0, *(-o for _, o in far)]), max([0, *(o for _, o in far)])
        bits = [sum(1 << k for k, f in enumerate(fields) if f in names) for names in (read, changed)]
        return behind, ahead, bits[0], bits[1]

    @property
    def sweeps(self) -> tuple[Sweep, ...]:
        """The sweeps of all parts, each before its derivative."""
        return tuple(s for part in self.parts for sweep in part for s in (sweep, sweep.tangent) if s)

    @property
    def tangents(self) -> tuple[tuple[Sweep, ...], ...]:
        """The derivatives of the sweeps of each part; nothing where they were not asked for."""
        if any(sweep.tangent is None for part in self.parts for sweep in part):
            return ()
        return tuple(tuple(sweep.tangent for sweep in part if sweep.tangent) for part in self.parts)

    @property
    def others(self) -> Partners:
        """Bonds or pairs; nothing where there are none."""
        return self.partners or Partners(Gather((), ()), Gather((), ()))

    @property
    def sums(self) -> int:
        """The most sums over other sites that are held for each."""
        swept = [sweep.gather for sweep in self.sweeps if sweep.gather]
        return max(len(g.names) for g in (*swept, *self.others.gathers))

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        swept = [sweep for part in self.parts for sweep in part]
        swept += [sweep.tangent for sweep in swept if sweep.tangent]
        swept_kernels = [sweep.kernel for sweep in swept]
        swept_kernels += self.equation.kernels if self.equation else ()
        gathers = [sweep.gather for sweep in swept if sweep.gather]
        gathers += self.others.gathers
        own = (*swept_kernels, *(k for g in gathers for k in g.kernels))
        return _present((self.prepare, self.refresh, *own, *self.transposed))


Step = Newton | Explicit | Path | Gauss | Splitting | Sweeps


def _present(kernels: Iterable[Kernel | None]) -> tuple[Kernel, ...]:
    return tuple(k for k in kernels if k is not None)
