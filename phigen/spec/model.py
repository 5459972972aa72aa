"""Content of a spec file as data: the first stage of the compiler.

No mathematics is checked here. The symbols in expressions are the names of coordinates and parameters; definitions have
been substituted. In a custom bi-realisation, ``p_NAME`` is the symbol ``momentum(NAME)``. Decimals are exact rationals.
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

    The values come from one of four sources. ``formula`` uses the symbols of the indices and sizes, ``i`` and ``N_i``.
    ``listed`` is in the order of the array, the last axis fastest. ``file`` is a path relative to the folder of the
    spec. ``random`` names a distribution: ``normal``, ``uniform`` between −1 and 1, or ``sphere`` for all fields of a
    site together. Random numbers are multiplied by ``scale``. Together with ``random``, a formula is the mean of the
    random numbers.
    """

    formula: Expression | None = None
    listed: tuple[Fraction, ...] = ()
    file: str = ""
    random: str = ""
    seed: int = 0
    scale: Fraction = Fraction(1)


@dataclass(frozen=True)
class Parameter:
    """A parameter of the spec, which is a run-time argument of the generated code.

    ``value`` is the default. If ``small`` is true, the terms of H with this factor are a small perturbation. If
    ``nonnegative`` is true, the parameter is 0 or positive. The field ``at`` is "all" if the parameter is one number.
    In lattices the field may also be "sites" or "bonds": the parameter is then an array with a value at each site or
    bond. If the defaults of an array are not all equal, ``values`` describes them, and ``value`` is 1 and unused.
    ``unit`` is shown to users: nothing is converted.
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
        """The declared bound in words, ``positive`` or ``nonnegative``; "" if every number is allowed."""
        return "positive" if self.positive else "nonnegative" if self.nonnegative else ""

    @property
    def inequality(self) -> str:
        """The declared bound as a formula after the name: `` > 0``, `` ≥ 0``, or "" if every number is allowed."""
        return {"positive": " > 0", "nonnegative": " ≥ 0"}.get(self.bound, "")

    def refuses(self, value: float | Fraction) -> bool:
        """Whether a number violates the declared bound (positive or nonnegative) of this parameter."""
        return bool(self.bound and (value < 0 or (self.positive and value == 0)))


@dataclass(frozen=True)
class MatrixForm:
    """π as a full matrix with the entries π_ij = {x_i, x_j}.

    The entries come from ``matrix:``, or from ``brackets:`` together with skew symmetry.
    """

    entries: Matrix


@dataclass(frozen=True)
class CanonicalForm:
    """{q_i, p_i} = 1, and all other brackets are 0. Coordinates that are neither in ``q`` nor in ``p`` are Casimirs."""

    q: tuple[str, ...]
    p: tuple[str, ...]


@dataclass(frozen=True)
class LogCanonicalForm:
    """{x_i, x_j} = a_ij x_i x_j with constants a_ij, which may contain parameters."""

    a: Matrix


@dataclass(frozen=True)
class LieAlgebraForm:
    """Lie–Poisson brackets {x_i, x_j} = ± Σ_k c_ij^k x_k on the dual of a Lie algebra; ``sign`` is 1 or −1.

    The algebra comes from exactly one of three sources: a ``family`` with a ``size``, the ``matrices`` of a basis, or
    ``structure_constants``. The structure constant c_ij^k is ``structure_constants[i][j][k]``, with indices from 0, for
    the pairs (i, j) in the spec.
    """

    sign: int = 1
    family: str = ""  # "so", "se", "sl", "gl", "su", "sp", "heisenberg", "aff"
    size: int = 0  # the n of so(n); 2n for sp(2n)
    matrices: tuple[Matrix, ...] = ()
    structure_constants: Mapping[int, Mapping[int, Mapping[int, Expression]]] = field(default_factory=dict)


@dataclass(frozen=True)
class NambuForm:
    """Nambu bracket {f, g} = det ∂(f, g, C_1, …, C_{n−2})/∂(x_1, …, x_n), defined by its ``casimirs`` C_k."""

    casimirs: tuple[Expression, ...]


@dataclass(frozen=True)
class ProductForm:
    """Block-diagonal π. A block is a pair (coordinates, form); every coordinate belongs to exactly one block."""

    blocks: tuple[tuple[tuple[str, ...], PoissonForm], ...]


@dataclass(frozen=True)
class PullbackForm:
    """A Poisson structure that is given in other coordinates y.

    ``coordinates`` has the names of y, and ``of`` is the form of the structure in y. ``map`` has y as expressions in
    the coordinates x of the spec. ``inverse`` has x as expressions in y; it is None if the spec does not state it.
    """

    coordinates: tuple[str, ...]
    of: PoissonForm
    map: tuple[Expression, ...]
    inverse: tuple[Expression, ...] | None = None


PoissonForm = MatrixForm | CanonicalForm | LogCanonicalForm | LieAlgebraForm | NambuForm | ProductForm | PullbackForm


@dataclass(frozen=True)
class BirealisationChoice:
    """The choice of a bi-realisation in a spec: its ``kind``, and options for some kinds.

    ``alpha`` and ``beta`` are for the kind ``custom``. ``order`` is set if an option of a command, or a call, overrides
    the order in the spec. The series of the kind ``spray`` are truncated according to ``order``.
    """

    kind: str = "auto"
    alpha: tuple[Expression, ...] = ()
    beta: tuple[Expression, ...] = ()
    side: str = "q"  # for canonical-euler: q or p, the coordinates that α leaves unchanged
    of: str = "auto"  # for product: the kind of the blocks; for pullback: the kind of the inner structure
    tau: Expression | Matrix | None = None  # for group-map: the map from the algebra to the group, a function or matrix
    spray: str | tuple[Expression, ...] = "auto"  # for spray: auto, flat, natural or the components f_j(x, p)
    degree: int | None = None  # for spray: largest degree in p of the series; None for the degree that the order needs
    order: int | None = None


@dataclass(frozen=True)
class SolverOptions:
    """Options of ``solver:``. They concern the solution of implicit equations, and the code of steps.

    ``method`` is auto or newton. If ``tolerance`` is None, phigen chooses the tolerance. ``lanes`` says whether the C
    uses SIMD lanes for steps and for members of ensembles; without lanes the code is shorter and slower.
    ``compensated`` says whether the C for lattices uses compensated summation of the steps.
    """

    method: str = "auto"
    tolerance: Fraction | None = None
    max_iterations: int = 20
    lanes: bool = True
    compensated: bool = False


@dataclass(frozen=True)
class Extras:
    """Parts of the generated code that are optional.

    ``tangent`` adds the function ``step_tangent``, the derivative of a step. If ``modified_hamiltonian`` is n > 0, a
    function is added that computes H plus n correction terms. ``without`` lists parts of `phigen.spec.names.PARTS` to
    leave out. ``included`` lists parts to include although the profile leaves them out. ``adjoint`` adds the transposed
    derivatives of a step and of a run, with respect to state and parameters. ``real`` is the number type of the C:
    double or float.
    """

    tangent: bool = False
    modified_hamiltonian: int = 0
    without: frozenset[str] = frozenset()
    adjoint: bool = False
    real: str = "double"
    included: frozenset[str] = frozenset()

    def offers(self, part: str, profile: str) -> bool:
        """Whether these settings and the profile allow a part of `phigen.spec.names.PARTS` in the code.

        Whether the part fits the system is not checked here.
        """
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
    """Setting ``average:`` of a run: the time averages to compute.

    ``of`` lists the observables to average; () stands for all observables. The averages are over the rows from the time
    ``after`` on; None stands for all rows. The rows are divided into at least ``blocks`` blocks, and the statistical
    error follows from the means of the blocks.
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
    # exact solution by coordinate; its symbols are the time (ELAPSED), initial values (initial(NAME)) and parameters
    exact: Mapping[str, Expression] = field(default_factory=dict)
    compare: tuple[str, ...] = ()
    section: Expression | None = None
    direction: str = "rising"  # direction of the crossings of the section
    duration: Fraction | None = None  # duration of the run, if the spec states it instead of the number of steps
    until: Fraction | None = None  # physical time of the end, which may be inside a step
    every: Fraction | None = None  # physical time between stored rows, instead of the stride
    average: AverageChoice = AverageChoice()
    at: tuple[Fraction, ...] = ()  # times of stored rows, instead of the stride
    stop: Expression | None = None  # the run ends where this expression passes through 0
    record: tuple[str, ...] = ()  # columns of the output (state, energy, Casimirs, observables); all by default
    # ranges of coordinates; for states in these ranges, ``phigen certify`` computes bounds for the errors of a step
    box: Mapping[str, tuple[Fraction, Fraction]] = field(default_factory=dict)
    description: str = ""
    lattice: LatticeRunSettings | None = None

    @property
    def is_timed(self) -> bool:
        """Whether the stored rows are given by physical times (``every`` or ``at``), not by a number of steps."""
        return self.every is not None or bool(self.at)

    @property
    def records_numbers(self) -> bool:
        """Whether ``record`` is set and does not include the states. Then each row has only a few numbers."""
        return bool(self.record) and "state" not in self.record


@dataclass(frozen=True)
class SpectrumChoice:
    """Setting ``spectrum:`` of a run of a lattice: the power spectrum S(q, ω), with wave vector q and frequency ω.

    ``of`` lists the coordinates to transform. The stored states (frames) from the time ``after`` on are used; None
    means all frames.
    """

    of: tuple[str, ...]
    after: Fraction | None = None


@dataclass(frozen=True)
class CorrelationChoice:
    """Setting ``correlation:`` of a run of a lattice: the correlation of two coordinates, ``of`` and ``other``.

    ``axis`` is the direction, and ``up_to`` is the largest distance in sites. The stored states (frames) from the time
    ``after`` on are used; None means all frames.
    """

    of: str
    other: str
    axis: str
    up_to: int
    after: Fraction | None = None


@dataclass(frozen=True)
class LatticeRunSettings:
    """Additional settings of a run of a lattice.

    ``sizes`` are the sizes of the axes; without axes, the number of sites. ``state`` has the initial values by field;
    one array of all fields together has the name ``""``. ``bonds`` are pairs of sites, counted from 0, or the name of
    a file that lists these pairs. ``arrays`` has the values of parameters at sites or bonds, if the run replaces the
    defaults. ``spectrum`` and ``correlation`` are computed from the stored states. ``names`` label the sites in
    figures, if the lattice has no axes.
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

    The range consists of the listed ``values``, or of ``count`` values from the first of the ``ends`` to the second. If
    there are no values and ``count`` is 0, values between the ends are drawn at random. ``scale`` is linear or log.
    """

    name: str
    values: tuple[float, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    count: int = 0
    scale: str = "linear"

    @property
    def size(self) -> int:
        """Number of values of the range; 0 if its values are drawn at random."""
        return len(self.values) or self.count


@dataclass(frozen=True)
class Statistic:
    """Number that a sweep stores for an observable: a statistic over the run, or the value at its end.

    The field ``of`` names the statistic: ``mean``, ``std`` (standard deviation) or ``error`` (standard error of the
    mean). If the field is "", the number is the value at the end.
    """

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
    """A sweep: one run, repeated for many values of parameters and initial values. Each repetition is a member.

    The members are a grid of the axes ``over``, or a number of ``random`` members, or the rows of a ``file``. ``keep``
    lists the results to store for each member: words of `phigen.spec.names.KEPT` and statistics of observables. If
    ``frames`` is not 0, states are stored too, one after every ``frames`` steps. ``target`` is the target whose code
    integrates the members.
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
        """The entries of ``keep``, and ``error(M)`` for each ``mean(M)``, because figures draw the error bars
        of means.
        """
        errors = (word.replace("mean(", "error(", 1) for word in self.keep if word.startswith("mean("))
        return tuple(dict.fromkeys((*self.keep, *errors)))


@dataclass(frozen=True)
class Reduction:
    """Reduction of an observable of a lattice to one number. Its ``kind`` is mean, sum, max or min.

    The observable is a density, with a value at each element of ``over``: ``sites``, ``bonds`` or ``pairs``.
    """

    kind: str
    over: str = "sites"


@dataclass(frozen=True)
class Lattice:
    """Relation between the sites of a lattice. Each site has the coordinates of the spec.

    ``axes`` name the directions of a grid, with a ``boundary`` for each: ``periodic`` or ``open``. ``graph`` is the
    name of the list of bonds. ``pairs`` says that every two sites form a pair. ``poisson`` and ``hamiltonian`` of the
    spec are those of a site. ``bonds`` is the contribution of one bond or one pair to H. ``brackets`` maps pairs (f, g)
    of symbols at two different sites to the bracket {f, g}; it contains (f, g) or (g, f), not both. ``kinds`` says for
    the density of each Casimir what is constant: its value at every site (``sites``), or its ``sum`` or ``product``
    over the sites. ``reductions`` has the reductions of observables to one number; an observable without a reduction is
    a field, with a value at each site.
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
        """Names of the indices of a site in formulas: the axes of a grid, or ``i`` if there are no axes."""
        return self.axes or ("i",)

    @property
    def relation(self) -> str:
        """The relation between the sites: ``grid``, ``graph`` or ``pairs``."""
        return "grid" if self.axes else "graph" if self.graph else "pairs"


@dataclass(frozen=True)
class SpecForces:
    """Forces of ``forces:`` and ``damping:``, for the equation ẋ = π(∇H + ζ + λ π∇H) + f.

    ``covector`` has the nonzero components of ζ by coordinate, and ``vector`` those of f. ``damping`` is λ.
    """

    covector: Mapping[str, Expression] = field(default_factory=dict)
    vector: Mapping[str, Expression] = field(default_factory=dict)
    damping: Expression | None = None

    def __bool__(self) -> bool:
        return bool(self.covector or self.vector or self.damping is not None)


NO_FORCES = SpecForces()


@dataclass(frozen=True)
class SpecNoise:
    """A source of noise of ``noise:``: the term σ π∇g ∘ dW of the equation, with Hamiltonian g and amplitude σ."""

    hamiltonian: Expression
    amplitude: Expression


@dataclass(frozen=True)
class Spec:
    """Content of a spec file. With a ``lattice``, coordinates, π and H are those of one site.

    `locations` maps the path of keys of each part, such as ``("casimirs", "C")``, to the place of the part in the file.
    If options of a command or a call have replaced parts, `written` is the spec as it stands in the file.
    """

    name: str
    coordinates: tuple[str, ...]
    poisson: PoissonForm
    hamiltonian: Expression
    time: str = ""  # the name of the time; "" if nothing depends on the time
    forces: SpecForces = SpecForces()
    noise: Mapping[str, SpecNoise] = field(default_factory=dict)
    parameters: tuple[Parameter, ...] = ()
    inputs: tuple[str, ...] = ()  # parameters that the calling program may change between steps
    casimirs: Mapping[str, Expression] = field(default_factory=dict)
    invariants: Mapping[str, Expression] = field(default_factory=dict)
    observables: Mapping[str, Expression] = field(default_factory=dict)  # quantities to record, without proofs
    birealisation: BirealisationChoice = BirealisationChoice()
    order: int | None = DEFAULT_ORDER  # None if the spec states terms
    terms: int | None = None
    composition: str = "auto"
    gauge: str | Mapping[str, Expression] = "auto"  # auto, none, or the multiple of each Casimir
    monitor: str | Expression | None = None  # log, or the factor g of dt = g dτ
    scheme: str = "series"
    structure: str = "exact"  # for a Gauss method: exact, or to truncation
    coordinates_from: str = ""  # for a splitting of attracting bodies: jacobi or democratic_heliocentric
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
        """Names of the observables that are one number; an observable with a value at every site is not among them."""
        lattice = self.lattice
        return tuple(name for name in self.observables if lattice is None or name in lattice.reductions)

    @property
    def solve_settings(self) -> list[str]:
        """The keys of ``solver`` by which the spec controls the solution of implicit steps."""
        stated = [key for key in ("tolerance", "max_iterations") if ("solver", key) in self.locations]
        return [key for key in stated if key != "tolerance" or self.solver.tolerance is not None]

    @property
    def series_settings(self) -> list[str]:
        """The keys of the spec that apply to ``scheme: series`` only."""
        stated = {
            "terms": self.terms is not None,
            "birealisation": self.birealisation.kind != "auto",
            "modified_hamiltonian": self.extras.modified_hamiltonian > 0,
        }
        return [key for key, is_stated in stated.items() if is_stated]

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def wanted_order(self) -> int:
        """Order that the spec requests. Without an order, it is the number ``terms``, rounded up to an even number."""
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

        ``tangent``, ``adjoint`` and ``without`` are added to the settings of the spec. Other options replace settings
        of the spec; an ``order`` replaces ``terms`` too. With single precision, the profile fast becomes small.
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

        This code has the profile fast, unless the options name another one. Its parameters can be changed between
        steps. The ``profile`` in the spec applies only to the code that ``phigen build`` writes.
        """
        options["profile"] = options.get("profile") or "fast"
        spec = self.overridden(**options)
        if spec.extras.offers("parameters", spec.profile):
            return spec
        return replace(spec, extras=replace(spec.extras, included=spec.extras.included | {"parameters"}))

    def parameters_of(self, run: Run) -> dict[str, float]:
        """Return the values of all parameters in a run: the value that the run states, else the default."""
        return {p.name: float(run.parameters.get(p.name, p.value)) for p in self.parameters}

    def diagnostic(self, path: tuple[Any, ...], message: str, hint: str = "") -> Diagnostic:
        """Return a diagnostic with the place of the part that has this path of keys.

        If the place of this part is unknown, the diagnostic has the place of the nearest part around it.
        """
        while path and path not in self.locations:
            path = path[:-1]
        location = self.locations.get(path)
        line = self.source.split("\n")[location.line - 1] if location else ""
        return Diagnostic(message, location, hint, line)


def _profile(profile: str, real: str) -> str:
    """Return the profile of the C for the number type ``real``: with float, the profile fast is replaced by small."""
    return "small" if profile == "fast" and real == "float" else profile
