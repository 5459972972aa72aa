"""The program: the representation of a solver that targets print.

A `Program` has a step (`phigen.scheme.steps`), whose kernels are straight-line functions, a description, and further
kernels such as observables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

from phigen._version import __version__
from phigen.scheme.kernel import Kernel
from phigen.scheme.steps import Step
from phigen.spec.model import NO_EXTRAS, Extras, Parameter, Reduction
from phigen.symbolic.symbols import LEVEL

if TYPE_CHECKING:
    from phigen.attitude.group import Group

#: Precision of single-precision code in which functions of the library have one name for all types, as on devices.
OVERLOADED = "overloaded float"


@dataclass(frozen=True)
class About:
    """Content of the header of a generated file: ``facts`` are its lines, ``operations`` the operation counts of a
    step."""

    title: str = ""
    license: str = "0BSD"
    spec_sha256: str = ""
    facts: tuple[str, ...] = ()
    operations: Mapping[str, int] = field(default_factory=dict)

    @property
    def counts(self) -> str:
        """The numbers of operations in words, such as ``3 additions, 2 divisions``."""
        worded_counts = (
            (n, operation.removesuffix("s") if n == 1 else operation) for operation, n in self.operations.items()
        )
        return ", ".join(f"{n} {operation}" for n, operation in worded_counts if n)


@dataclass(frozen=True)
class Observables:
    """The Hamiltonian, the Casimirs, the vector field, and the observables of the spec, if there are any.

    For lattices, ``named`` has the densities of observables that ``reductions`` turn into numbers. ``at_sites`` has the
    observables that are fields; their names are ``fields``.
    """

    energy: Kernel
    casimirs: Kernel
    vector_field: Kernel
    named: Kernel | None = None
    reductions: tuple[Reduction, ...] = ()
    at_sites: Kernel | None = None
    fields: tuple[str, ...] = ()

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels."""
        return (self.energy, self.casimirs, self.vector_field, *(k for k in (self.named, self.at_sites) if k))


@dataclass(frozen=True)
class FreeGauge:
    """The Casimirs whose multiples the solver chooses for each trajectory, and the kernels for the choice."""

    casimirs: tuple[str, ...]
    guide: Kernel
    products: Kernel


@dataclass(frozen=True)
class Monitor:
    """Steps of equal size in τ: ``rate`` is dt/dτ at a state, ``elapsed`` the time of a step (at its point y).

    In a splitting the kernels of flows return their time, and ``elapsed`` is None. ``level`` is the gradient of H, on
    which e depends, if the transpose of steps was requested.
    """

    rate: Kernel
    elapsed: Kernel | None
    level: Kernel | None = None


#: Largest normal variate; larger ones are truncated, so that no rare one makes a step impossible. One pair in 7e7 is
#: larger; the truncation reduces the variance by 1.5e-8.
MAX_NORMAL_VARIATE = 6.0


@dataclass(frozen=True)
class Noise:
    """Sources of noise by name. Each source has ``parts`` increments in a step, independent and identically
    distributed.

    ``fields`` is the kernel of σπ∇g of all sources; None for lattices, where each site has separate noise.
    """

    sources: tuple[str, ...]
    parts: int
    fields: Kernel | None = None

    @property
    def draws(self) -> int:
        """The number of increments in a step."""
        return self.parts * len(self.sources)


@dataclass(frozen=True)
class Modified:
    """The modified Hamiltonian as a kernel, and the lowest power of h that it omits."""

    kernel: Kernel
    power: int


@dataclass(frozen=True)
class Attitude:
    """Kernels of the group elements whose action on x is a step: one for each stage, or one for each flow.

    ``turn`` is the element of an implicit stage as a function of the solved y, ``along`` as a function of p. All
    elements are returned minus 1. For exp(P) of a matrix P, these kernels return the covector p of P and a bound for
    the square of its size; ``exponential`` is exp(P) − 1 for a size of at most 1/2. ``turns`` are the flows of a
    splitting, each with the product of the elements of the step up to this flow. ``rate`` is the gradient of the
    Casimirs that were subtracted from H: they rotate the body, but do not change x.
    """

    group: Group
    cayley: bool
    turn: Kernel | None = None
    along: Kernel | None = None
    turns: tuple[Kernel, ...] = ()
    rate: Kernel | None = None
    exponential: Kernel | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of an attitude as an array."""
        rows = self.group.rows
        return (rows, rows) if rows else (4,)

    @property
    def quaternion(self) -> bool:
        """Whether an element is a single quaternion, without matrices and translations."""
        return not (self.group.matrices or self.group.translation)

    @property
    def lengthened(self) -> bool:
        """Whether the quaternion of a step must be normalised; this is so for products of the elements of flows."""
        return bool(self.turns) and self.quaternion

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        return tuple(k for k in (self.turn, self.along, *self.turns, self.rate, self.exponential) if k is not None)


@dataclass(frozen=True)
class StackBound:
    """Bytes of stack of the longest chains of calls, measured with a ``compiler`` and its flags.

    The chains start in ``init`` or in ``step``; ``longest`` is the largest value of all functions.
    """

    compiler: str
    init: int
    step: int
    longest: int


@dataclass(frozen=True)
class Program:
    """A solver, ready to be printed.

    A step of size h is a composition: one ``step`` of size f h for each f in ``fractions``. ``time`` is the name of t
    if H depends on the time, else "". ``pushed`` are the Casimirs that forces change. ``extras`` are the requested
    parts of the code other than the step; ``observed`` has the names of the observables of the spec.

    ``lanes`` requests C that makes several steps or members at once; ``profile`` (``fast``, ``small``) says whether the
    C is optimised for speed or for size. ``compensated`` requests compensated sums over the steps of a lattice that is
    split. ``truncated`` says that a step is a Poisson map only up to its truncation error. ``stack`` is the measured
    stack that the header of the C states.
    """

    name: str
    about: About
    coordinates: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    casimirs: tuple[str, ...]
    order: int
    step: Step
    observables: Observables
    fractions: tuple[float, ...] = (1.0,)
    time: str = ""
    forced: bool = False
    pushed: tuple[str, ...] = ()
    noise: Noise | None = None
    gauge: FreeGauge | None = None
    monitor: Monitor | None = None
    modified: Modified | None = None
    attitude: Attitude | None = None
    extras: Extras = NO_EXTRAS
    lanes: bool = True
    profile: str = "fast"
    compensated: bool = False
    observed: tuple[str, ...] = ()
    truncated: bool = False
    stack: StackBound | None = None

    @property
    def version(self) -> str:
        """The version of phigen that made this program."""
        return __version__

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    def offers(self, part: str) -> bool:
        """Whether the code contains a part of `phigen.spec.names.PARTS`, if that part applies to the system."""
        return self.extras.offers(part, self.profile)

    @property
    def single(self) -> bool:
        """Whether the C computes in single precision."""
        return self.extras.real != "double"

    @property
    def searches_gauge(self) -> bool:
        """Whether the solver searches for the gauge of a trajectory, instead of computing it by a formula."""
        return self.gauge is not None and self.offers("gauge-search")

    @property
    def choice(self) -> tuple[Kernel, ...]:
        """The kernels with which the gauge of a trajectory is chosen."""
        guide = (self.gauge.guide,) if self.gauge and self.searches_gauge else ()
        return (*guide, *((self.gauge.products,) if self.gauge else ()))

    @property
    def midpoints(self) -> tuple[float, ...]:
        """The middles of the stages, as fractions of the step."""
        stage_ends = [Fraction(0), *accumulate(Fraction(f) for f in self.fractions)]
        return tuple(float((a + b) / 2) for a, b in pairwise(stage_ends))

    @property
    def is_monitored(self) -> bool:
        """Whether steps are equal in τ, not in the time."""
        return self.monitor is not None or bool(self.step.swept and self.step.swept.rates)

    @property
    def held(self) -> tuple[str, ...]:
        """The quantities with a constant value for each trajectory: the Casimirs with a chosen multiple, or e."""
        return (LEVEL.kind,) if self.monitor else self.gauge.casimirs if self.gauge else ()

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels, each once."""
        modified = (self.modified.kernel,) if self.modified else ()
        timed = [k for k in (self.monitor.elapsed, self.monitor.rate, self.monitor.level) if k] if self.monitor else []
        attitude_kernels = self.attitude.kernels if self.attitude else ()
        noisy = (self.noise.fields,) if self.noise and self.noise.fields else ()
        return (
            *self.step.kernels,
            *attitude_kernels,
            *timed,
            *modified,
            *self.observables.kernels,
            *noisy,
            *self.choice,
        )
