"""Content of a spec file as data: the first stage of the compiler.

Nothing here is checked mathematically. Expressions have their definitions substituted and use the names
of the spec's coordinates and parameters as symbols; ``p_NAME`` in a custom bi-realisation is the
symbol ``momentum(NAME)``. Decimals are exact rationals.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, TypedDict, Unpack

from phigen.errors import Diagnostic, Location
from phigen.registry import DEFAULT
from phigen.spec.names import LEFT_OUT, STATISTICS
from phigen.symbolic.expression import ZERO, Expression

#: The default order of a method.
DEFAULT_ORDER = 4

#: The default order with noise, which limits the order.
NOISY_ORDER = 2

Matrix = tuple[tuple[Expression, ...], ...]


@dataclass(frozen=True)
class Values:
    """An array over the sites, or the bonds, of a lattice.

    ``formula`` uses the symbols of the indices and sizes, ``i`` and ``N_i``. ``listed`` is in the order of the array,
    the last axis fastest. ``file`` is a path from the folder of the spec. ``random`` names a distribution: ``normal``,
    ``uniform`` between −1 and 1, or, for all fields of a site together, ``sphere``; it is
    multiplied by ``scale``, and the formula, if there is one, added. Else exactly one of these sources is given.
    """

    formula: Expression | None = None
    listed: tuple[Fraction, ...] = ()
    file: str = ""
    random: str = ""
    seed: int = 0
    scale: Fraction = Fraction(1)


@dataclass(frozen=True)
class Parameter:
    """A run-time argument of the generated code, with its default.

    ``small`` says that the terms with this factor are a small part of H, ``nonnegative`` that it is 0 or positive.
    ``at`` says of a lattice whether it is one number (``all``), or an array with a value at each of the ``sites`` or
    ``bonds``; ``values`` are its defaults where they are not all ``value``. ``unit`` is text for readers: nothing is
    converted.
    """

    name: str
    value: Fraction
    positive: bool = False
    description: str = ""
    at: str = "all"
    values: Values | None = None
    unit: str = ""
    small: bool = False
    nonnegative: bool = False

    @property
    def bound(self) -> str:
        """``positive``, ``nonnegative``, or "" if every number is allowed."""
        return "positive" if self.positive else "nonnegative" if self.nonnegative else ""

    @property
    def inequality(self) -> str:
        """The bound as it is shown: `` > 0``, `` ≥ 0`` or nothing."""
        return {"positive": " > 0", "nonnegative": " ≥ 0"}.get(self.bound, "")

    def refuses(self, value: float | Fraction) -> bool:
        """Whether a number is beyond the bound."""
        return bool(self.bound and (value < 0 or (self.positive and value == 0)))


@dataclass(frozen=True)
class MatrixForm:
    """π given entry by entry, π_ij = {x_i, x_j} (from ``matrix:`` or, completed by skew symmetry, ``brackets:``)."""

    entries: Matrix


@dataclass(frozen=True)
class CanonicalForm:
    """{q_i, p_i} = 1, all other brackets 0; coordinates named in neither list are Casimirs."""

    q: tuple[str, ...]
    p: tuple[str, ...]


@dataclass(frozen=True)
class LogCanonicalForm:
    """{x_i, x_j} = a_ij x_i x_j; the a_ij may contain parameters."""

    a: Matrix


@dataclass(frozen=True)
class LieAlgebraForm:
    """{x_i, x_j} = ± Σ_k c_ij^k x_k on the dual of a Lie algebra; exactly one of the three sources is given.

    ``structure_constants[i][j][k]`` is c_ij^k over 0-based basis indices, only the pairs that were given.
    """

    sign: int = 1
    family: str = ""  # "so", "se", "sl", "gl", "su", "sp", "heisenberg", "aff"
    size: int = 0  # the n of so(n); 2n for sp(2n)
    matrices: tuple[Matrix, ...] = ()
    structure_constants: Mapping[int, Mapping[int, Mapping[int, Expression]]] = field(default_factory=dict)


@dataclass(frozen=True)
class NambuForm:
    """{f, g} = det ∂(f, g, C_1, …, C_{n−2})/∂(x_1, …, x_n)."""

    casimirs: tuple[Expression, ...]


@dataclass(frozen=True)
class ProductForm:
    """Blocks side by side, as pairs (coordinates, form); every coordinate is in exactly one of them."""

    blocks: tuple[tuple[tuple[str, ...], PoissonForm], ...]


@dataclass(frozen=True)
class PullbackForm:
    """A structure in other coordinates y: ``of`` is its form, ``map`` gives y as expressions in the spec's x.

    ``inverse`` gives x as expressions in y, if the spec does.
    """

    coordinates: tuple[str, ...]
    of: PoissonForm
    map: tuple[Expression, ...]
    inverse: tuple[Expression, ...] | None = None


PoissonForm = MatrixForm | CanonicalForm | LogCanonicalForm | LieAlgebraForm | NambuForm | ProductForm | PullbackForm


@dataclass(frozen=True)
class BirealisationChoice:
    """The user's choice: a kind of the catalogue and its options (``custom``: alpha, beta).

    ``order`` is the order of the method where the caller overrides that of the spec; truncations need it.
    """

    kind: str = "auto"
    alpha: tuple[Expression, ...] = ()
    beta: tuple[Expression, ...] = ()
    side: str = "q"  # canonical-euler
    of: str = "auto"  # product, pullback: the kind for the blocks, for the structure that is pulled back
    tau: Expression | Matrix | None = None  # group-map: f(MATRIX), or the entries of τ in the momenta
    spray: str | tuple[Expression, ...] = "auto"  # spray: auto, flat, natural or the components f_j(x, p)
    degree: int | None = None  # spray: degree in p of a truncation, None for what the order needs
    order: int | None = None


@dataclass(frozen=True)
class SolverOptions:
    """The inner solve: ``method`` auto or newton, ``tolerance`` None for auto.

    ``lanes``: whether C makes steps, and members of ensembles, in SIMD lanes; without lanes the code is shorter and
    slower. ``compensated``: whether C compensates sums over the steps of lattices.
    """

    method: str = "auto"
    tolerance: Fraction | None = None
    max_iterations: int = 20
    lanes: bool = True
    compensated: bool = False


@dataclass(frozen=True)
class Extras:
    """Functions of the code beside the solver: ``tangent`` adds ``step_tangent``, the derivative of a step.

    ``modified_hamiltonian`` adds the function of that name, with so many correction terms; 0 for none. ``without`` are
    parts to leave out (`phigen.spec.names.PARTS`). ``adjoint`` adds the transpose of a step and of a run, along state
    and parameters. ``real`` are the numbers of the C, double or float. ``included`` are parts that the code has
    although its profile leaves them out.
    """

    tangent: bool = False
    modified_hamiltonian: int = 0
    without: frozenset[str] = frozenset()
    adjoint: bool = False
    real: str = "double"
    included: frozenset[str] = frozenset()

    def offers(self, part: str, profile: str) -> bool:
        """Whether the code of a profile has a part, where it applies."""
        return part not in self.without | (LEFT_OUT[profile] - self.included)


NO_EXTRAS = Extras()


class Overrides(TypedDict, total=False):
    """Options of a command or a call, which override what a spec says; None, False and () leave it as it is."""

    order: int | None
    scheme: str | None
    profile: str | None
    real: str | None
    modified_hamiltonian: int | None
    tangent: bool
    adjoint: bool
    without: Collection[str]


@dataclass(frozen=True)
class AverageChoice:
    """``average:`` of a run: rows from the time ``after`` on, None for all rows, in at least ``blocks`` blocks.

    The averages are those ``of`` some observables, of all if it is empty.
    """

    after: Fraction | None = None
    blocks: int | None = None
    of: tuple[str, ...] = ()


@dataclass(frozen=True)
class Run:
    """A run of the spec: initial state, step, number of steps, and the rows to store."""

    name: str
    initial: tuple[Fraction, ...]
    step: Fraction
    steps: int
    stride: int = 1
    start: Fraction = Fraction(0)  # the time at the start
    seed: int = 0  # of the noise
    members: int = 1  # paths of the noise from the same start
    parameters: Mapping[str, Fraction] = field(default_factory=dict)
    exact: Mapping[str, Expression] = field(default_factory=dict)  # in ELAPSED, the time, initial(NAME), parameters
    compare: tuple[str, ...] = ()
    section: Expression | None = None
    direction: str = "rising"  # in which the section is crossed
    duration: Fraction | None = None  # what says how many steps there are, if that is a time
    until: Fraction | None = None  # the physical time where it ends, by a part of a step
    every: Fraction | None = None  # of physical time between rows that are stored, in place of the stride
    average: AverageChoice = AverageChoice()
    at: tuple[Fraction, ...] = ()  # the times of rows, in place of the stride
    stop: Expression | None = None  # it ends where this passes through 0
    record: tuple[str, ...] = ()  # columns of the output: state, energy, Casimirs, observables; all by default
    box: Mapping[str, tuple[Fraction, Fraction]] = field(default_factory=dict)  # ranges for which certify bounds errors
    description: str = ""
    lattice: LatticeRunSettings | None = None

    @property
    def is_timed(self) -> bool:
        """Whether rows are at given times, not after given steps."""
        return self.every is not None or bool(self.at)

    @property
    def records_numbers(self) -> bool:
        """Whether no states are recorded."""
        return bool(self.record) and "state" not in self.record


@dataclass(frozen=True)
class SpectrumChoice:
    """``spectrum:`` of a run of a lattice: S(q, ω) of the fields ``of``, over the frames from a time ``after`` on."""

    of: tuple[str, ...]
    after: Fraction | None = None


@dataclass(frozen=True)
class CorrelationChoice:
    """``correlation:`` of a run of a lattice: two fields, the ``axis`` and the largest distance, and `after`."""

    of: str
    other: str
    axis: str
    up_to: int
    after: Fraction | None = None


@dataclass(frozen=True)
class LatticeRunSettings:
    """Further settings of a run of a lattice.

    ``sizes`` are those of the axes; where there are none, the number of sites. ``state`` has initial values by field,
    or of all fields under the name ``""``. ``bonds`` are pairs of sites, counted from 0, or a file with them.
    ``arrays`` are the values of parameters at sites and bonds that differ from the defaults. ``spectrum`` and
    ``correlation`` are computed from the frames. ``names`` are those of the sites of graphs and pairs, in pictures.
    """

    sizes: tuple[int, ...] = ()
    state: Mapping[str, Values] = field(default_factory=dict)
    bonds: tuple[tuple[int, int], ...] | str = ()
    arrays: Mapping[str, Values] = field(default_factory=dict)
    spectrum: SpectrumChoice | None = None
    correlation: CorrelationChoice | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Axis:
    """The values of a parameter, of an initial coordinate, of ``step`` or ``start``, or numbers of draws (``seed``).

    They are ``values``, or ``count`` of them from one of the ``ends`` to the other; drawn between these if count is 0.
    """

    name: str
    values: tuple[float, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    count: int = 0
    scale: str = "linear"

    @property
    def size(self) -> int:
        """Number of values, 0 if they are drawn."""
        return len(self.values) or self.count


@dataclass(frozen=True)
class Statistic:
    """Value of an observable that a sweep stores: one of `STATISTICS` over the run, or, for "", the last."""

    observable: str
    of: str = ""

    @classmethod
    def read(cls, word: str, observables: Iterable[str]) -> Statistic | None:
        """Return what ``M``, ``mean(M)``, ``std(M)`` or ``error(M)`` asks for; None if that is nothing."""
        function, bracket, argument = word.partition("(")
        name = argument.removesuffix(")").strip() if bracket else function
        is_known = name in observables and (not bracket or (function in STATISTICS and argument.endswith(")")))
        return cls(name, function if bracket else "") if is_known else None


@dataclass(frozen=True)
class SweepSettings:
    """A run for many values: a grid of axes, or a number of ``random`` members, or those in a ``file``.

    ``keep`` (`phigen.spec.names.KEPT`, and statistics of observables) says what is stored of each member; with
    ``frames``, the states after that number of steps are stored too. ``target`` is that of ``phigen sweep -t``.
    """

    name: str
    run: str
    over: tuple[Axis, ...] = ()
    random: int = 0
    seed: int = 0
    file: str = ""
    keep: tuple[str, ...] = ("final",)
    frames: int = 0
    target: str = "auto"
    description: str = ""

    @property
    def stored(self) -> tuple[str, ...]:
        """``keep``, with the standard error of each mean, which figures show."""
        errors = (word.replace("mean(", "error(", 1) for word in self.keep if word.startswith("mean("))
        return tuple(dict.fromkeys((*self.keep, *errors)))


@dataclass(frozen=True)
class Reduction:
    """Reduction of the density of an observable to one number: its ``kind`` is one of `phigen.spec.names.REDUCTIONS`.

    ``over`` says what the density belongs to: ``sites``, ``bonds`` or ``pairs``.
    """

    kind: str
    over: str = "sites"


@dataclass(frozen=True)
class Lattice:
    """Relation between the sites of a lattice, each of which has the coordinates of the spec.

    ``axes`` name the directions of a grid, with the ``boundary`` of each: ``periodic`` or ``open``. ``graph`` is the
    name of the list of bonds; ``pairs`` says that each site is paired with each other. ``poisson`` and ``hamiltonian``
    of the spec are those of a site. ``bonds`` is the density of H of a bond or a pair. ``brackets`` maps (f, g), as
    symbols of two different sites, to their bracket, in one order of the two. ``kinds`` says of Casimirs whether they
    are those of ``sites``, a ``sum`` or a ``product``. ``reductions`` says how observables are reduced to one number;
    those without a reduction are fields, with a value at each site.
    """

    axes: tuple[str, ...] = ()
    boundary: tuple[str, ...] = ()
    graph: str = ""
    pairs: bool = False
    bonds: Expression = ZERO
    brackets: Mapping[tuple[str, str], Expression] = field(default_factory=dict)
    kinds: Mapping[str, str] = field(default_factory=dict)
    reductions: Mapping[str, Reduction] = field(default_factory=dict)

    @property
    def indices(self) -> tuple[str, ...]:
        """The names of the indices of a site."""
        return self.axes or ("i",)

    @property
    def relation(self) -> str:
        """The relation between the sites: ``grid``, ``graph`` or ``pairs``."""
        return "grid" if self.axes else "graph" if self.graph else "pairs"


@dataclass(frozen=True)
class SpecForces:
    """Forces of ``forces:`` and ``damping:``: ζ and f by coordinates, where they are not 0, and λ."""

    covector: Mapping[str, Expression] = field(default_factory=dict)
    vector: Mapping[str, Expression] = field(default_factory=dict)
    damping: Expression | None = None

    def __bool__(self) -> bool:
        return bool(self.covector or self.vector or self.damping is not None)


NO_FORCES = SpecForces()


@dataclass(frozen=True)
class SpecNoise:
    """A source of noise, one of those of ``noise:``: + σ π∇g ∘ dW, with the Hamiltonian g and the amplitude σ."""

    hamiltonian: Expression
    amplitude: Expression


@dataclass(frozen=True)
class Spec:
    """A spec file, about a cell where there is a ``lattice``.

    `locations` gives the place of a part by its path of keys, e.g. ``("casimirs", "C")``. `written` is the spec of
    the file, if options of a command or a call override it.
    """

    name: str
    coordinates: tuple[str, ...]
    poisson: PoissonForm
    hamiltonian: Expression
    time: str = ""  # the name of the time, where functions may depend on it
    forces: SpecForces = SpecForces()
    noise: Mapping[str, SpecNoise] = field(default_factory=dict)
    parameters: tuple[Parameter, ...] = ()
    inputs: tuple[str, ...] = ()  # the parameters that change while a program runs
    casimirs: Mapping[str, Expression] = field(default_factory=dict)
    invariants: Mapping[str, Expression] = field(default_factory=dict)
    observables: Mapping[str, Expression] = field(default_factory=dict)  # to record; nothing is proved of them
    birealisation: BirealisationChoice = BirealisationChoice()
    order: int | None = DEFAULT_ORDER  # None where terms are given
    terms: int | None = None
    composition: str = "auto"
    gauge: str | Mapping[str, Expression] = "auto"  # or the multiple of each Casimir
    monitor: str | Expression | None = None  # log, or g of dt = g dτ
    scheme: str = "series"
    structure: str = "exact"  # of a Gauss method: exact, to truncation
    coordinates_from: str = ""  # of bodies in a splitting: jacobi, democratic_heliocentric
    profile: str = "fast"
    solver: SolverOptions = SolverOptions()
    extras: Extras = NO_EXTRAS
    reconstruct: str = ""  # quaternion, matrix: the attitude beside the state
    targets: tuple[str, ...] = DEFAULT
    runs: Mapping[str, Run] = field(default_factory=dict)
    sweeps: Mapping[str, SweepSettings] = field(default_factory=dict)
    lattice: Lattice | None = None
    title: str = ""
    description: str = ""
    references: tuple[str, ...] = ()
    license: str = "0BSD"
    source_sha256: str = ""
    file: str = "<spec>"
    source: str = ""
    locations: Mapping[tuple[Any, ...], Location] = field(default_factory=dict)
    written: Spec | None = field(default=None, repr=False, compare=False)

    @property
    def recorded(self) -> tuple[str, ...]:
        """Names of the observables that are one number each; of a lattice those of sites are none."""
        lattice = self.lattice
        return tuple(name for name in self.observables if lattice is None or name in lattice.reductions)

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def wanted_order(self) -> int:
        """The requested order; if terms are requested, the order of a symmetric method with this number of terms."""
        return self.order or (self.terms or DEFAULT_ORDER) + (self.terms or 0) % 2

    def overridden(
        self,
        *,
        order: int | None = None,
        scheme: str | None = None,
        profile: str | None = None,
        real: str | None = None,
        modified_hamiltonian: int | None = None,
        tangent: bool = False,
        adjoint: bool = False,
        without: Collection[str] = (),
    ) -> Spec:
        """Return the spec with the options of a command or a call applied.

        ``tangent``, ``adjoint`` and ``without`` are added to those of the spec, the others replace it; an ``order``
        replaces ``terms`` too. Single precision has the profile small only.
        """
        extras = Extras(
            tangent or self.extras.tangent,
            self.extras.modified_hamiltonian if modified_hamiltonian is None else modified_hamiltonian,
            self.extras.without.union(without),
            adjoint or self.extras.adjoint,
            real or self.extras.real,
            self.extras.included,
        )
        ordered = replace(self, order=order, terms=None, birealisation=replace(self.birealisation, order=order))
        return replace(
            ordered if order else self,
            scheme=scheme or self.scheme,
            profile=_profile(profile or self.profile, extras.real),
            extras=extras,
            written=self.written or self,
        )

    def for_running(self, **options: Unpack[Overrides]) -> Spec:
        """Return the spec with options applied, for code that phigen itself runs: in the profile fast unless the
        options name one, and with parameters that can be changed between steps in any profile.

        The ``profile`` of a spec is about the code that ``phigen build`` writes.
        """
        options["profile"] = options.get("profile") or "fast"
        spec = self.overridden(**options)
        if spec.extras.offers("parameters", spec.profile):
            return spec
        return replace(spec, extras=replace(spec.extras, included=spec.extras.included | {"parameters"}))

    def parameters_of(self, run: Run) -> dict[str, float]:
        """Return the values of all parameters in a run: those of the run, else the defaults."""
        return {p.name: float(run.parameters.get(p.name, p.value)) for p in self.parameters}

    def diagnostic(self, path: tuple[Any, ...], message: str, hint: str = "") -> Diagnostic:
        """A diagnostic at the part with that path of keys, or at the nearest part around it."""
        while path and path not in self.locations:
            path = path[:-1]
        location = self.locations.get(path)
        line = self.source.split("\n")[location.line - 1] if location else ""
        return Diagnostic(message, location, hint, line)


def _profile(profile: str, real: str) -> str:
    """The profile of C with numbers of a type: that for speed has double precision only."""
    return "small" if profile == "fast" and real == "float" else profile
