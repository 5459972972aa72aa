"""Content of a spec file as data: the first stage of the compiler.

No mathematics is checked here. Definitions have been substituted into expressions, which use the names of coordinates
and parameters as symbols; ``p_NAME`` in a custom bi-realisation is the symbol ``momentum(NAME)``. Decimals are exact
rationals.
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

#: The default order with noise, for which no higher order is possible.
NOISY_ORDER = 2

Matrix = tuple[tuple[Expression, ...], ...]


@dataclass(frozen=True)
class Values:
    """An array over the sites, or the bonds, of a lattice.

    ``formula`` uses the symbols of the indices and sizes, ``i`` and ``N_i``. ``listed`` is in the order of the array,
    the last axis fastest. ``file`` is a path relative to the folder of the spec. ``random`` names a distribution:
    ``normal``, ``uniform`` between −1 and 1, or ``sphere`` for all fields of a site together. Random numbers are
    multiplied by ``scale``, and the formula is added if there is one. In all other cases exactly one of these sources
    is present.
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

    ``small`` says that the terms with this factor are a small part of H, ``nonnegative`` that the parameter is 0 or
    positive. For lattices ``at`` is ``all`` for one number, ``sites`` or ``bonds`` for an array with a value at each
    site or bond; ``values`` are the defaults if not all are equal, and then ``value`` is 1, and no default. ``unit`` is
    text for readers: nothing is converted.
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
        """The bound as displayed: `` > 0``, `` ≥ 0`` or ""."""
        return {"positive": " > 0", "nonnegative": " ≥ 0"}.get(self.bound, "")

    def refuses(self, value: float | Fraction) -> bool:
        """Whether a number violates the bound."""
        return bool(self.bound and (value < 0 or (self.positive and value == 0)))


@dataclass(frozen=True)
class MatrixForm:
    """π as a matrix of entries, π_ij = {x_i, x_j}, from ``matrix:`` or, completed by skew symmetry, from
    ``brackets:``."""

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
    """{x_i, x_j} = ± Σ_k c_ij^k x_k on the dual of a Lie algebra, from exactly one of three sources.

    ``structure_constants[i][j][k]`` is c_ij^k with indices from 0; only the pairs in the spec are present.
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
    """π with diagonal blocks, as pairs (coordinates, form); every coordinate belongs to exactly one block."""

    blocks: tuple[tuple[tuple[str, ...], PoissonForm], ...]


@dataclass(frozen=True)
class PullbackForm:
    """A structure in other coordinates y: ``of`` is its form, ``map`` has y as expressions in the spec's x.

    ``inverse`` has x as expressions in y, if the spec states it.
    """

    coordinates: tuple[str, ...]
    of: PoissonForm
    map: tuple[Expression, ...]
    inverse: tuple[Expression, ...] | None = None


PoissonForm = MatrixForm | CanonicalForm | LogCanonicalForm | LieAlgebraForm | NambuForm | ProductForm | PullbackForm


@dataclass(frozen=True)
class BirealisationChoice:
    """The choice of a bi-realisation in a spec: a kind of the catalogue and its options (``custom``: alpha, beta).

    ``order`` is the order of the method if the caller overrides that of the spec; truncations depend on it.
    """

    kind: str = "auto"
    alpha: tuple[Expression, ...] = ()
    beta: tuple[Expression, ...] = ()
    side: str = "q"  # canonical-euler
    of: str = "auto"  # product: the kind for the blocks; pullback: the kind for the inner structure
    tau: Expression | Matrix | None = None  # group-map: f(MATRIX), or the entries of τ in the momenta
    spray: str | tuple[Expression, ...] = "auto"  # spray: auto, flat, natural or the components f_j(x, p)
    degree: int | None = None  # spray: degree in p of a truncation; None for the degree that the order needs
    order: int | None = None


@dataclass(frozen=True)
class SolverOptions:
    """Options of the inner solve: ``method`` is auto or newton, ``tolerance`` None for automatic.

    ``lanes`` says whether C makes steps, and members of ensembles, in SIMD lanes; without lanes the code is shorter and
    slower. ``compensated`` says whether C compensates sums over the steps of lattices.
    """

    method: str = "auto"
    tolerance: Fraction | None = None
    max_iterations: int = 20
    lanes: bool = True
    compensated: bool = False


@dataclass(frozen=True)
class Extras:
    """Parts of the generated code that are optional.

    ``tangent`` adds ``step_tangent``, the derivative of a step. ``modified_hamiltonian`` adds the function of that name
    with this number of correction terms; 0 for no function. ``without`` are parts to leave out
    (`phigen.spec.names.PARTS`). ``adjoint`` adds the transpose of a step and of a run, with respect to state and
    parameters. ``real`` is the number type of the C, double or float. ``included`` are parts that are included although
    the profile leaves them out.
    """

    tangent: bool = False
    modified_hamiltonian: int = 0
    without: frozenset[str] = frozenset()
    adjoint: bool = False
    real: str = "double"
    included: frozenset[str] = frozenset()

    def offers(self, part: str, profile: str) -> bool:
        """Whether code with this profile includes a part, if the part applies to the system."""
        return part not in self.without | (LEFT_OUT[profile] - self.included)


NO_EXTRAS = Extras()


class Overrides(TypedDict, total=False):
    """Options of a command or a call, which override those of a spec; None, False and () leave the spec unchanged."""

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
    """Setting ``average:`` of a run: rows from the time ``after`` on (None: all rows), in at least ``blocks`` blocks.

    ``of`` names the observables to be averaged; empty for all.
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
    start: Fraction = Fraction(0)  # time of the initial state
    seed: int = 0  # seed of the noise
    members: int = 1  # number of paths of the noise from the same initial state
    parameters: Mapping[str, Fraction] = field(default_factory=dict)
    # functions of ELAPSED, the time, initial(NAME) and parameters
    exact: Mapping[str, Expression] = field(default_factory=dict)
    compare: tuple[str, ...] = ()
    section: Expression | None = None
    direction: str = "rising"  # direction of the crossings of the section
    duration: Fraction | None = None  # duration of the run, if it determines the number of steps
    until: Fraction | None = None  # physical time of the end, which may be inside a step
    every: Fraction | None = None  # physical time between stored rows, instead of the stride
    average: AverageChoice = AverageChoice()
    at: tuple[Fraction, ...] = ()  # times of stored rows, instead of the stride
    stop: Expression | None = None  # the run ends where this passes through 0
    record: tuple[str, ...] = ()  # columns of the output (state, energy, Casimirs, observables); all by default
    # ranges of coordinates for which certify bounds errors
    box: Mapping[str, tuple[Fraction, Fraction]] = field(default_factory=dict)
    description: str = ""
    lattice: LatticeRunSettings | None = None

    @property
    def is_timed(self) -> bool:
        """Whether rows are at given times, not after given steps."""
        return self.every is not None or bool(self.at)

    @property
    def records_numbers(self) -> bool:
        """Whether only numbers, and no states, are recorded."""
        return bool(self.record) and "state" not in self.record


@dataclass(frozen=True)
class SpectrumChoice:
    """Setting ``spectrum:`` of a run of a lattice: S(q, ω) of the fields ``of``, over the frames from the time
    ``after`` on."""

    of: tuple[str, ...]
    after: Fraction | None = None


@dataclass(frozen=True)
class CorrelationChoice:
    """Setting ``correlation:`` of a run of a lattice: the correlation of the fields ``of`` and ``other``.

    ``axis`` is the direction, ``up_to`` the largest distance in sites. Frames from the time ``after`` on are used.
    """

    of: str
    other: str
    axis: str
    up_to: int
    after: Fraction | None = None


@dataclass(frozen=True)
class LatticeRunSettings:
    """Additional settings of a run of a lattice.

    ``sizes`` are the sizes of the axes; for lattices without axes, the number of sites. ``state`` has initial values by
    field, or of all fields under the name ``""``. ``bonds`` are pairs of sites, counted from 0, or a file with such
    pairs. ``arrays`` are the values of parameters at sites and bonds that differ from the defaults. ``spectrum`` and
    ``correlation`` are computed from the frames. ``names`` are labels of the sites of graphs and pairs, for pictures.
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
    """Range of a sweep: values of a parameter, of an initial coordinate, of ``step`` or ``start``, or of ``seed``.

    The range consists of the listed ``values``, or of ``count`` values from one of the ``ends`` to the other. If
    ``count`` is 0, values between the ends are drawn at random.
    """

    name: str
    values: tuple[float, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    count: int = 0
    scale: str = "linear"

    @property
    def size(self) -> int:
        """Number of values; 0 if they are drawn at random."""
        return len(self.values) or self.count


@dataclass(frozen=True)
class Statistic:
    """Value of an observable that a sweep stores: one of `STATISTICS` over the run, or, for "", the last value."""

    observable: str
    of: str = ""

    @classmethod
    def read(cls, word: str, observables: Iterable[str]) -> Statistic | None:
        """Return the statistic that ``M``, ``mean(M)``, ``std(M)`` or ``error(M)`` names; None for another word."""
        function, bracket, argument = word.partition("(")
        name = argument.removesuffix(")").strip() if bracket else function
        is_known = name in observables and (not bracket or (function in STATISTICS and argument.endswith(")")))
        return cls(name, function if bracket else "") if is_known else None


@dataclass(frozen=True)
class SweepSettings:
    """A sweep, a run for many values: a grid of axes, a number of ``random`` members, or the members in a ``file``.

    ``keep`` (`phigen.spec.names.KEPT`, and statistics of observables) lists what is stored for each member. With
    ``frames``, the states after every such number of steps are stored too. ``target`` is that of ``phigen sweep -t``.
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
        """The entries of ``keep``, and the standard error of each mean, which figures display."""
        errors = (word.replace("mean(", "error(", 1) for word in self.keep if word.startswith("mean("))
        return tuple(dict.fromkeys((*self.keep, *errors)))


@dataclass(frozen=True)
class Reduction:
    """Reduction of the density of an observable to one number: its ``kind`` is one of `phigen.spec.names.REDUCTIONS`.

    ``over`` is what the density belongs to: ``sites``, ``bonds`` or ``pairs``.
    """

    kind: str
    over: str = "sites"


@dataclass(frozen=True)
class Lattice:
    """Relation between the sites of a lattice, each of which has the coordinates of the spec.

    ``axes`` name the directions of a grid, with a ``boundary`` for each: ``periodic`` or ``open``. ``graph`` is the
    name of the list of bonds. ``pairs`` says that every two sites form a pair. ``poisson`` and ``hamiltonian`` of the
    spec are those of a site. ``bonds`` is the density of H of a bond or a pair. ``brackets`` maps (f, g), symbols of
    two different sites, to their bracket, in one order. ``kinds`` maps Casimirs to ``sites``, ``sum`` or ``product``.
    ``reductions`` has the reductions of observables to one number; observables without a reduction are fields, with a
    value at each site.
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
    """Forces of ``forces:`` and ``damping:``: the nonzero ζ and f by coordinate, and λ."""

    covector: Mapping[str, Expression] = field(default_factory=dict)
    vector: Mapping[str, Expression] = field(default_factory=dict)
    damping: Expression | None = None

    def __bool__(self) -> bool:
        return bool(self.covector or self.vector or self.damping is not None)


NO_FORCES = SpecForces()


@dataclass(frozen=True)
class SpecNoise:
    """A source of noise of ``noise:``, + σ π∇g ∘ dW, with the Hamiltonian g and the amplitude σ."""

    hamiltonian: Expression
    amplitude: Expression


@dataclass(frozen=True)
class Spec:
    """Content of a spec file. If there is a ``lattice``, it describes one cell.

    `locations` has the place of a part by its path of keys, e.g. ``("casimirs", "C")``. `written` is the spec of the
    file, if options of a command or a call override it.
    """

    name: str
    coordinates: tuple[str, ...]
    poisson: PoissonForm
    hamiltonian: Expression
    time: str = ""  # the name of the time; "" if nothing depends on the time
    forces: SpecForces = SpecForces()
    noise: Mapping[str, SpecNoise] = field(default_factory=dict)
    parameters: tuple[Parameter, ...] = ()
    inputs: tuple[str, ...] = ()  # the parameters that change while a program runs
    casimirs: Mapping[str, Expression] = field(default_factory=dict)
    invariants: Mapping[str, Expression] = field(default_factory=dict)
    observables: Mapping[str, Expression] = field(default_factory=dict)  # to record; nothing is proved of them
    birealisation: BirealisationChoice = BirealisationChoice()
    order: int | None = DEFAULT_ORDER  # None if the spec states terms
    terms: int | None = None
    composition: str = "auto"
    gauge: str | Mapping[str, Expression] = "auto"  # auto, none, or the multiple of each Casimir
    monitor: str | Expression | None = None  # log, or g of dt = g dτ
    scheme: str = "series"
    structure: str = "exact"  # for a Gauss method: exact, or to truncation
    coordinates_from: str = ""  # for bodies in a splitting: jacobi or democratic_heliocentric
    profile: str = "fast"
    solver: SolverOptions = SolverOptions()
    extras: Extras = NO_EXTRAS
    reconstruct: str = ""  # quaternion or matrix, if the attitude is reconstructed
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
        """Names of the observables that are one number each; fields of lattices are not among them."""
        lattice = self.lattice
        return tuple(name for name in self.observables if lattice is None or name in lattice.reductions)

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def wanted_order(self) -> int:
        """The requested order or, if terms are requested, the order of a symmetric method with this number of terms."""
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

        ``tangent``, ``adjoint`` and ``without`` are added to those of the spec. The other options replace those of the
        spec; an ``order`` replaces ``terms`` too. Single precision requires the profile small.
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
        """Return the spec with options applied, for code that phigen itself runs.

        The ``profile`` of a spec applies to the code that ``phigen build`` writes. Code that phigen runs has the
        profile fast, unless the options name another one, and parameters that can be changed between steps.
        """
        options["profile"] = options.get("profile") or "fast"
        spec = self.overridden(**options)
        if spec.extras.offers("parameters", spec.profile):
            return spec
        return replace(spec, extras=replace(spec.extras, included=spec.extras.included | {"parameters"}))

    def parameters_of(self, run: Run) -> dict[str, float]:
        """Return the values of all parameters in a run: those of the run, and defaults for the others."""
        return {p.name: float(run.parameters.get(p.name, p.value)) for p in self.parameters}

    def diagnostic(self, path: tuple[Any, ...], message: str, hint: str = "") -> Diagnostic:
        """Return a diagnostic located at the part with that path of keys, or at the nearest part around it."""
        while path and path not in self.locations:
            path = path[:-1]
        location = self.locations.get(path)
        line = self.source.split("\n")[location.line - 1] if location else ""
        return Diagnostic(message, location, hint, line)


def _profile(profile: str, real: str) -> str:
    """Return the profile of C for a number type: the profile fast is for double precision only."""
    return "small" if profile == "fast" and real == "float" else profile
