"""The program: the representation of a solver from which targets print source code.

A `Program` has a step (`phigen.scheme.steps`), whose kernels are functions without loops or branches. It also has a
description, and kernels that are not part of a step, such as those of observables.
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

#: Value of the precision option for single-precision code in languages such as those of graphics cards, where a library
#: function has one name for all types of numbers.
OVERLOADED = "overloaded float"


@dataclass(frozen=True)
class About:
    """Content of the header of generated files. ``facts`` are the lines of the header.

    ``operations`` maps the name of an operation, such as ``divisions``, to the number of these operations.
    `StepKind.unit` says to what the numbers refer: to a whole step, or for instance to one Newton iteration.
    """

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
    """Kernels of the Hamiltonian, the Casimirs, the vector field, and the ``named`` observables of the spec.

    On a lattice, ``named`` computes densities at a site, which the ``reductions`` combine into numbers. ``at_sites``
    computes the observables that are fields; ``fields`` has their names.
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
        """All kernels of observables, which a target prints as functions."""
        return (self.energy, self.casimirs, self.vector_field, *(k for k in (self.named, self.at_sites) if k))


@dataclass(frozen=True)
class FreeGauge:
    """The Casimirs whose multiples the solver chooses for each trajectory, and two kernels for this choice.

    ``guide`` is the error vector π∇S_3; ``products`` are scalar products of gradients, those of H and of the Casimirs.
    """

    casimirs: tuple[str, ...]
    guide: Kernel
    products: Kernel


@dataclass(frozen=True)
class Monitor:
    """Kernels of a solver with a monitor, whose steps have equal size in the rescaled time τ.

    ``rate`` is dt/dτ at a state. ``elapsed`` is the physical time of a step, as a function of the solution y of its
    implicit equation; in a splitting it is None, since the kernels of the flows return their time. ``level`` is ∇H, or
    None if no gradients were requested. The reverse pass needs ∇H, because the energy level e = −H(x₀) depends on the
    start x₀.
    """

    rate: Kernel
    elapsed: Kernel | None
    level: Kernel | None = None


#: Largest absolute value of a normal variate; larger ones are set to this value, so that no rare variate makes a step
#: impossible. One pair of variates in 7e7 is affected, and the variance decreases by 1.5e-8.
MAX_NORMAL_VARIATE = 6.0


@dataclass(frozen=True)
class Noise:
    """The sources of noise by name.

    In a step each source has as many increments ΔW as ``parts`` says; they are independent and have the same
    distribution. ``fields`` is the kernel of the vector fields σπ∇g of all sources. On lattices, ``fields`` is None,
    since each site has independent noise.
    """

    sources: tuple[str, ...]
    parts: int
    fields: Kernel | None = None

    @property
    def draws(self) -> int:
        """The number of noise increments that a step takes."""
        return self.parts * len(self.sources)


@dataclass(frozen=True)
class Modified:
    """The modified Hamiltonian as a kernel, and the lowest power of h that it omits."""

    kernel: Kernel
    power: int


@dataclass(frozen=True)
class Attitude:
    """Kernels of the group elements whose action on x is a step: one element for each stage, or for each flow of a
    splitting.

    Each kernel returns an element minus 1. ``turn`` is the element of an implicit stage as a function of y, the
    solution of its equation. ``along`` is the element of a step along a path as a function of the covector p. If
    elements are matrices exp(P), these two kernels return the components p of P, followed by a bound for the square of
    the size of P. Then ``exponential`` computes exp(P) − 1, if the size is at most 1/2. ``turns`` has a kernel for each
    flow of a splitting: the increments of the flow, and the product of the elements of the step up to this flow.
    ``rate`` is the gradient of the Casimirs that were subtracted from H: they rotate the body, but do not change x.
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
        """The shape of an attitude as an array: (rows, rows) for a matrix, (4,) for a quaternion."""
        rows = self.group.rows
        return (rows, rows) if rows else (4,)

    @property
    def quaternion(self) -> bool:
        """Whether an attitude is a quaternion alone: neither a matrix nor a quaternion with a translation."""
        return not (self.group.matrices or self.group.translation)

    @property
    def lengthened(self) -> bool:
        """Whether the quaternion of a step must be normalised.

        This is necessary in splittings, since the quaternions of flows may have any norm.
        """
        return bool(self.turns) and self.quaternion

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the attitude without repetitions; targets print them as functions."""
        return tuple(k for k in (self.turn, self.along, *self.turns, self.rate, self.exponential) if k is not None)


@dataclass(frozen=True)
class StackBound:
    """Bytes of stack that a generated C solver needs, measured with a ``compiler`` and its flags.

    Each number is for the longest chain of calls that begins in a function of the solver: in `NAME_init` (``init``), in
    `NAME_step` (``step``), or in any function (``longest``).
    """

    compiler: str
    init: int
    step: int
    longest: int


@dataclass(frozen=True)
class Program:
    """A solver, with everything that a target needs to print it.

    A step of size h is a composition: it makes one ``step`` of size f h for each f in ``fractions``. ``time`` is the
    name of the time if H depends on it, else "". ``pushed`` are the Casimirs that forces change. ``extras`` says which
    parts of the code were requested in addition to the step. ``observed`` has the names of the observables of the spec.

    ``lanes`` requests C that makes several steps, or steps of several members of an ensemble, in SIMD lanes.
    ``profile`` (``fast``, ``small``) says whether the C is optimised for speed or for size. ``compensated`` requests
    compensated sums over the steps of a lattice with a splitting. ``truncated`` says that a step is a Poisson map only
    up to its truncation error. ``stack`` is the measured use of stack, which the header of the C states.
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
        """The version of phigen with which this program was made."""
        return __version__

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    def offers(self, part: str) -> bool:
        """Whether the generated code contains a part of `phigen.spec.names.PARTS`, provided that the part applies to
        the system."""
        return self.extras.offers(part, self.profile)

    @property
    def single(self) -> bool:
        """Whether the generated C computes in single precision."""
        return self.extras.real != "double"

    @property
    def searches_gauge(self) -> bool:
        """Whether the solver finds the gauge of a trajectory by a search over sample states, instead of by a
        formula."""
        return self.gauge is not None and self.offers("gauge-search")

    @property
    def choice(self) -> tuple[Kernel, ...]:
        """The kernels by which the solver chooses the multiples of Casimirs for a trajectory."""
        guide = (self.gauge.guide,) if self.gauge and self.searches_gauge else ()
        return (*guide, *((self.gauge.products,) if self.gauge else ()))

    @property
    def midpoints(self) -> tuple[float, ...]:
        """The times in the middle of the stages of a step, as fractions of the step."""
        stage_ends = [Fraction(0), *accumulate(Fraction(f) for f in self.fractions)]
        return tuple(float((a + b) / 2) for a, b in pairwise(stage_ends))

    @property
    def is_monitored(self) -> bool:
        """Whether steps have equal size in τ, the time of a monitor, instead of in the physical time."""
        return self.monitor is not None or bool(self.step.swept and self.step.swept.rates)

    @property
    def held(self) -> tuple[str, ...]:
        """The names of the quantities that have a constant value for each trajectory.

        These are the Casimirs whose multiples the solver chooses or, for a monitored system, the energy level e.
        """
        return (LEVEL.kind,) if self.monitor else self.gauge.casimirs if self.gauge else ()

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """All kernels of the solver without repetitions; targets print them as functions."""
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
