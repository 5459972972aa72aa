"""The format of a spec file, as one table from which the validator and the JSON Schema are made."""

from __future__ import annotations

from dataclasses import replace

from phigen.registry import RUNNABLE, TARGETS
from phigen.spec import limits
from phigen.spec.kinds import (
    Boolean,
    Either,
    ExpressionText,
    Integer,
    Kind,
    ListOf,
    MapOf,
    OneOf,
    Record,
    RecordKey,
    ShapedText,
    Text,
)
from phigen.spec.model import DEFAULT_ORDER
from phigen.spec.names import (
    BIREALISATIONS,
    CLASSICAL_METHODS,
    COMPOSITIONS,
    DIRECTIONS,
    FAMILY_HELP,
    IDENTIFIER,
    KEPT,
    OTHER_TARGETS,
    OVER,
    PARTS,
    PROFILES,
    REALS,
    RECONSTRUCTIONS,
    REDUCTIONS,
    RELATIVE,
    SCHEMES,
    SPEC_NAME,
    STRUCTURES,
)
from phigen.spec.yaml_source import Mapping, Scalar, Sequence

FORMAT_VERSION = 1

NAME = ShapedText(
    IDENTIFIER, "a name", "a name consists of ASCII letters, digits and _, and does not start with a digit"
)
TIME = replace(NAME, expected="the name of the time", example="time: t declares it")
RUN_NAME = ShapedText(
    r"[A-Za-z0-9_][A-Za-z0-9_-]*",
    "the name of a run",
    "a name of a run consists of ASCII letters, digits, _ and -, and does not start with -",
)
NEIGHBOUR = ShapedText(IDENTIFIER + r" *(\[[^\[\]]*\])?", NAME.expected, NAME.hint)
FORMULA, CONSTANT, INLINE, PROSE = ExpressionText(), ExpressionText(constant=True), Text(), Text(lines=True)
FORMULAS = MapOf(NAME, FORMULA)
MATRIX = ListOf(ListOf(FORMULA, least=1), least=1)
BASIS = ShapedText(r"E[1-9][0-9]*", "the name of a basis element", "the names of the basis elements are E1, E2, …")

RANDOM = MapOf(NAME, CONSTANT, least=1)
#: Values at sites or bonds: a scalar (number, formula of the indices, or name of a file), a list, or a mapping
#: {random: …, seed: …, scale: …, mean: …}.
VALUES = Either({Scalar: CONSTANT, Sequence: ListOf(CONSTANT, least=1), Mapping: RANDOM})
PARAMETER = Record(
    "a parameter",
    (
        RecordKey("value", VALUES, "the default value of the parameter", required=True),
        RecordKey(
            "at",
            OneOf(("all", "sites", "bonds")),
            "on lattices: one value for all (all), or a value of its own for each site or for each bond",
            default="all",
        ),
        RecordKey(
            "positive",
            Boolean(),
            "true declares that the value is always greater than 0, which phigen uses to simplify formulas",
            default=False,
        ),
        RecordKey("nonnegative", Boolean(), "true declares that the value is never less than 0", default=False),
        RecordKey(
            "small",
            Boolean(),
            "for splittings: true declares that the terms of H with this factor are a small part of H",
            default=False,
        ),
        RecordKey("description", PROSE, "what the parameter means"),
        RecordKey(
            "unit", INLINE, "the unit of the parameter, such as kg.m2, as documentation; phigen does not convert units"
        ),
    ),
)
CANONICAL = Record(
    "canonical",
    (
        RecordKey(
            "q", ListOf(NAME, least=1), "the positions q_1, …, q_m, each the name of a coordinate", required=True
        ),
        RecordKey(
            "p",
            ListOf(NAME, least=1),
            "the momenta p_1, …, p_m of the positions q, in the same order: {q_i, p_i} = 1",
            required=True,
        ),
    ),
    example="{q: [x, y], p: [px, py]}",
)
ALGEBRA_NAME = ShapedText(r"[a-zA-Z]+\([0-9]+\)", "the name of a Lie algebra", f"write {FAMILY_HELP}")
LIE_ALGEBRA = Record(
    "lie_algebra",
    (
        RecordKey("name", ALGEBRA_NAME, f"the name of a Lie algebra: {FAMILY_HELP}"),
        RecordKey(
            "matrices", ListOf(MATRIX, least=1), "square matrices E_1, …, E_n that are a basis of the Lie algebra"
        ),
        RecordKey(
            "structure_constants",
            MapOf(BASIS, MapOf(BASIS, MapOf(BASIS, FORMULA))),
            "the commutators: {E1: {E2: {E3: c}}} means [E_1, E_2] = c E_3; those of missing pairs are 0",
        ),
        RecordKey(
            "sign",
            OneOf(("plus", "minus")),
            "the sign in {x_i, x_j} = ± Σ c_ij^k x_k, where c_ij^k are the structure constants",
            default="plus",
        ),
    ),
    alternatives=("name", "matrices", "structure_constants"),
    one_required=True,
    example="{name: so(3)}",
)
_FORMS: dict[str, tuple[Kind, str]] = {
    "matrix": (MATRIX, "the Poisson tensor π, as the n×n matrix of the brackets {x_i, x_j}"),
    "brackets": (
        MapOf(NAME, MapOf(NEIGHBOUR, FORMULA)),
        'brackets: {x1: {x2: f}} means {x1, x2} = f; those of missing pairs are 0; on lattices also {x: {"y[i-1]": f}}',
    ),
    "canonical": (CANONICAL, "positions q and momenta p with {q_i, p_i} = 1"),
    "log_canonical": (MATRIX, "the n×n matrix of the coefficients a_ij in {x_i, x_j} = a_ij x_i x_j"),
    "lie_algebra": (
        Either({Mapping: LIE_ALGEBRA, Scalar: ALGEBRA_NAME}),
        "the Lie–Poisson structure {x_i, x_j} = ± Σ c_ij^k x_k of a Lie algebra with structure constants c_ij^k",
    ),
    "nambu": (ListOf(FORMULA), "the n-2 Casimirs C_1, C_2, … in {f, g} = det ∂(f, g, C_1, …)/∂(x_1, …, x_n)"),
}


def _structure(subject: str, nested: int, *further_keys: RecordKey) -> Record:
    """Return the record of the keys for a Poisson structure. A spec has exactly one of the keys for the forms of π.

    Products and pull-backs may be nested to the depth ``nested``. Messages call the record ``subject``.
    """
    forms = [RecordKey(form, *described) for form, described in _FORMS.items()]
    if nested:
        names = ListOf(NAME, least=1)
        block = _structure(
            "a block of a product",
            nested - 1,
            RecordKey("coordinates", names, "the coordinates of the block", required=True),
        )
        pullback = Record(
            "pullback",
            (
                RecordKey(
                    "of",
                    _structure("of", nested - 1),
                    "the Poisson structure in the new coordinates, which the key `map` defines",
                    required=True,
                ),
                RecordKey(
                    "map",
                    MapOf(NAME, FORMULA, least=1),
                    "each new coordinate, as a function of the coordinates of the spec",
                    required=True,
                ),
                RecordKey(
                    "inverse",
                    FORMULAS,
                    "each coordinate of the spec, as a function of the new coordinates; needed if phigen cannot "
                    "invert the functions of map:",
                ),
            ),
        )
        forms.append(
            RecordKey(
                "product",
                ListOf(block, least=2),
                "blocks of coordinates, each with its own Poisson structure; brackets between blocks are 0",
            )
        )
        forms.append(
            RecordKey(
                "pullback", pullback, "a Poisson structure in other coordinates, and the map to these coordinates"
            )
        )
    keys = tuple(f.key for f in forms)
    substitutes: tuple[str, ...] = ()
    if subject == "poisson":
        substitutes = ("bonds",)
        bond_help = "for graphs: {x[a]: {y[b]: f}} is the bracket f of x and y at the ends a and b of a bond"
        forms.append(RecordKey("bonds", MapOf(NEIGHBOUR, MapOf(NEIGHBOUR, FORMULA)), bond_help))
    example = "{lie_algebra: {name: so(3)}}"
    return Record(
        subject,
        (*further_keys, *forms),
        alternatives=keys,
        one_required=True,
        substitutes=substitutes,
        example="" if further_keys else example,
    )


BOUNDARY = OneOf(("periodic", "open"))
#: Largest depth to which products and pull-backs of Poisson structures may be nested.
NESTED = 2
POISSON = _structure("poisson", NESTED)
KIND = OneOf(BIREALISATIONS)
TAU = Either({Scalar: FORMULA, Sequence: MATRIX})
SPRAY = Either({Scalar: OneOf(("auto", "flat", "natural")), Sequence: ListOf(FORMULA, least=1)})
BIREALISATION = Record(
    "birealisation",
    (
        RecordKey("kind", KIND, "the kind of bi-realisation; auto chooses by the form of π", required=True),
        RecordKey(
            "side",
            OneOf(("q", "p")),
            "for canonical-euler: with `q`, a step evaluates H at the initial q and the final p; with `p`, at the "
            "initial p and the final q",
            default="q",
        ),
        RecordKey(
            "of",
            KIND,
            "for product and pullback: the kind for each block, or for the structure that is pulled back",
            default="auto",
        ),
        RecordKey(
            "tau",
            TAU,
            "for group-map: τ as a rational function of the matrix P = Σ p_i E_i, or as a matrix of formulas in p_NAME",
        ),
        RecordKey(
            "alpha",
            ListOf(FORMULA, least=1),
            "for custom: the map α(x, p), an expression for each coordinate; p_NAME is the momentum of NAME",
        ),
        RecordKey(
            "beta",
            ListOf(FORMULA, least=1),
            "for custom: the map β(x, p), an expression for each coordinate; p_NAME is the momentum of NAME",
        ),
        RecordKey(
            "spray",
            SPRAY,
            "for spray: the name of a spray, or a list of the quadratic forms f_j(x, p) in ṗ_j = f_j(x, p)",
            default="auto",
        ),
        RecordKey(
            "degree",
            Integer(1, limits.ORDER, limit=True),
            "for spray: the degree in p at which formal series are cut off",
        ),
    ),
)
SOLVER = Record(
    "solver",
    (
        RecordKey(
            "method",
            OneOf(("auto", "newton")),
            "the method that solves implicit steps; auto and newton mean the same",
            default="auto",
        ),
        RecordKey(
            "tolerance",
            ExpressionText(),
            "the tolerance with which implicit steps are solved; auto means round-off",
            default="auto",
        ),
        RecordKey(
            "max_iterations",
            Integer(1, 1000),
            "the largest number of iterations for an implicit step; a step that needs more fails",
            default=20,
        ),
        RecordKey(
            "lanes",
            Boolean(),
            "also generate C that computes eight steps or members at once by SIMD: faster, but longer code",
            default=True,
        ),
        RecordKey(
            "compensated",
            Boolean(),
            "in C for lattices with scheme: splitting: compensated summation, with less rounding error but slower",
            default=False,
        ),
    ),
)
LATTICE = Record(
    "lattice",
    (
        RecordKey(
            "axes",
            ListOf(NAME, least=1, most=3),
            "for a grid: the names of its axes, the slowest first; x[i+1] is x at the next site along the axis i",
        ),
        RecordKey(
            "boundary",
            Either({Scalar: BOUNDARY, Sequence: ListOf(BOUNDARY)}),
            "for a grid: the boundary of all axes, or a list with the boundary of each axis",
            default="periodic",
        ),
        RecordKey(
            "graph",
            NAME,
            "for a graph: the name of its list of bonds, which runs give; x[a] and x[b] are x at the ends of a bond",
        ),
        RecordKey("pairs", OneOf(("all",)), "all means that every site interacts with every other site"),
    ),
    alternatives=("axes", "graph", "pairs"),
    one_required=True,
)
DENSITIES = Record(
    "hamiltonian",
    (
        RecordKey("sites", FORMULA, "the terms of H for one site; they are summed over all sites"),
        RecordKey("bonds", FORMULA, "the terms of H for one bond of a graph, from the site a to the site b"),
        RecordKey("pairs", FORMULA, "the terms of H for one pair of sites, a and b"),
    ),
    nonempty=True,
)
CASIMIR = Record(
    "a Casimir",
    (
        RecordKey("value", FORMULA, "the formula of the Casimir at one site", required=True),
        RecordKey(
            "at",
            OneOf(("sites", "sum", "product")),
            "on lattices: a Casimir at each site (sites), or the sum or the product over all sites",
        ),
    ),
)
OBSERVABLE = Record(
    "an observable of a lattice",
    (
        RecordKey("mean", FORMULA, "the mean of this formula over all sites, bonds or pairs"),
        RecordKey("sum", FORMULA, "the sum of this formula over all sites, bonds or pairs"),
        RecordKey("max", FORMULA, "the largest value of this formula at a site"),
        RecordKey("min", FORMULA, "the least value of this formula at a site"),
        RecordKey(
            "over",
            OneOf(OVER),
            "the set over which the mean or the sum is taken: sites, bonds or pairs",
            default="sites",
        ),
    ),
    alternatives=REDUCTIONS,
    one_required=True,
    example="{mean: x}",
)
FORCES = Record(
    "forces",
    (
        RecordKey("covector", FORMULAS, "ζ in ẋ = π(∇H + ζ), a formula for each coordinate; Casimirs remain constant"),
        RecordKey(
            "vector", FORMULAS, "f in ẋ = π∇H + f, a formula for each coordinate, such as a torque; Casimirs may change"
        ),
    ),
    example="{covector: {q: gamma*p}}",
)
SOURCE = Record(
    "a source of noise",
    (
        RecordKey("hamiltonian", FORMULA, "the function g of the coordinates in the noise σ π∇g ∘ dW", required=True),
        RecordKey(
            "amplitude",
            FORMULA,
            "the factor σ in the noise σ π∇g ∘ dW; it may depend on parameters and on the time",
            default="1",
        ),
    ),
)

#: Hints for words that users may write as keys of a run by mistake. A hint says where the setting belongs, or which key
#: a run has instead.
_BESIDE_RUNS = {
    key: f"`{key}` is a key of the whole spec: write `{key}` beside `runs`, not in a run"
    for key in ("order", "monitor", "scheme", "damping", "forces", "noise", "coordinates", "hamiltonian", "tangent")
} | {
    "tolerance": "`solver: {tolerance: …}` belongs to the whole spec: write `solver` beside `runs`, not in a run",
    "reconstruct": "`reconstruct` is a key of the whole spec: write `reconstruct` beside `runs`, not in a run. The "
    "initial attitude is the identity; in Python, the argument `attitude0` sets another initial attitude",
    "retry": "in Python, solver.integrate(…, retry=n) divides a step that fails into smaller steps",
    "time": "a run starts at the time `start`, and ends at the time `until`",
}

AVERAGE = Record(
    "average",
    (
        RecordKey("after", CONSTANT, "the time from which rows are averaged; earlier rows are left out"),
        RecordKey(
            "blocks",
            Integer(2, 10_000),
            "the number of blocks of rows from which standard errors are estimated; 20 if not given",
        ),
        RecordKey("of", ListOf(NAME, least=1), "the observables whose averages are shown; all if not given"),
    ),
    example="{after: 200, blocks: 20}",
)
SPECTRUM = Record(
    "spectrum",
    (
        RecordKey(
            "of",
            ListOf(NAME, least=1),
            "the coordinates f in S(q, ω) = Σ |f(q, ω)|², which is averaged over frames",
            required=True,
        ),
        RecordKey("after", CONSTANT, "the time from which states are used; earlier states are left out"),
    ),
    example="{of: [x, y], after: 100}",
)
CORRELATION = Record(
    "correlation",
    (
        RecordKey(
            "of",
            NAME,
            "the coordinate f in the correlation ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩ of sites r and r + d",
            required=True,
        ),
        RecordKey("with", NAME, "the coordinate g in the correlation ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩; f if not given"),
        RecordKey("axis", NAME, "the axis along which the distance d is measured; the first axis if not given"),
        RecordKey("up to", Integer(0, limits.SITES), "the largest distance d, in sites", required=True),
        RecordKey("after", CONSTANT, "the time from which states are used; earlier states are left out"),
    ),
    example="{of: x, with: y, axis: i, up to: 32}",
)
RUN = Record(
    "a run",
    (
        RecordKey(
            "initial",
            Either({Sequence: ListOf(CONSTANT, least=1), Mapping: MapOf(NAME, VALUES, least=1), Scalar: CONSTANT}),
            "the values at the start, as a list or by coordinate; on lattices also a file, or {random: sphere}",
            required=True,
        ),
        RecordKey(
            "sizes",
            ListOf(Integer(1, limits.SITES, limit=True), least=1, most=3),
            "for lattices: the number of sites along each axis",
        ),
        RecordKey(
            "bonds",
            Either({Scalar: INLINE, Sequence: ListOf(ListOf(Integer(0, limits.SITES)), most=limits.BONDS)}),
            "for graphs: the bonds, as pairs of sites counted from 0, or as the name of a .csv file",
        ),
        RecordKey(
            "names",
            ListOf(INLINE, least=1),
            "for graphs and pairs: the names of the sites, shown in figures and in the live panel of a report",
        ),
        RecordKey("step", CONSTANT, "the step size h", required=True),
        RecordKey("steps", Integer(1, limits.STEPS, limit=True), "the number of steps"),
        RecordKey(
            "duration",
            CONSTANT,
            "the length of the run in time, in place of the number of steps; a multiple of the step",
        ),
        RecordKey(
            "until",
            CONSTANT,
            "the time at which the run ends, in place of the number of steps; the last step may be shorter",
        ),
        RecordKey("stop", FORMULA, "the run ends where this expression passes through 0"),
        RecordKey("start", CONSTANT, "the time at the start, 0 if not given; for systems that depend on the time"),
        RecordKey("seed", Integer(0, limits.SEED), "for systems with noise: the seed of the random numbers", default=0),
        RecordKey(
            "members",
            Integer(1, limits.MEMBERS),
            "for systems with noise: the number of trajectories, all from the same initial state",
            default=1,
        ),
        RecordKey(
            "stride",
            Integer(1, limits.STEPS, limit=True),
            "the number of steps from one stored state to the next",
            default=1,
        ),
        RecordKey("every", CONSTANT, "the time from one stored state to the next, in place of stride"),
        RecordKey("at", ListOf(CONSTANT, least=1), "the times at which states are stored, in place of stride"),
        RecordKey("parameters", MapOf(NAME, VALUES), "values of parameters that differ from their default values"),
        RecordKey(
            "exact",
            FORMULAS,
            "the exact solution: a formula in the time t for each coordinate; x0_NAME is the initial value of NAME",
        ),
        RecordKey("compare", ListOf(OneOf(CLASSICAL_METHODS)), "classical methods with which phigen compares the run"),
        RecordKey(
            "section", FORMULA, "a Poincaré section: phigen stores the states at which this expression passes through 0"
        ),
        RecordKey(
            "direction",
            OneOf(DIRECTIONS),
            "which crossings of the section are stored: those where the expression rises (rising), those where it "
            "falls (falling), or all (both)",
            default="rising",
        ),
        RecordKey(
            "record",
            ListOf(NAME, least=1),
            "the columns of the output: state, energy, and names of Casimirs and observables; or all",
        ),
        RecordKey("average", AVERAGE, "time averages of the observables, and the rows over which phigen averages"),
        RecordKey(
            "spectrum", SPECTRUM, "for grids: phigen computes the dynamic structure factor S(q, ω) of coordinates"
        ),
        RecordKey(
            "correlation",
            CORRELATION,
            "for grids: phigen computes the correlation of two coordinates as a function of the distance along an axis",
        ),
        RecordKey(
            "box",
            MapOf(NAME, ListOf(CONSTANT, least=1)),
            "for phigen certify: the range [LOW, HIGH] of each coordinate in which the error of a step is bounded",
        ),
        RecordKey("description", PROSE, "what the run shows"),
    ),
    alternatives=("steps", "duration", "until"),
    one_required=True,
    hints=_BESIDE_RUNS,
)

#: A word under ``keep`` of a sweep, such as final or mean(M). Whether the observable M exists is checked later.
KEPT_WORD = ShapedText(
    r"\w+|\w+ *\( *\w+ *\)",
    "a result of a sweep",
    "one of " + ", ".join(KEPT) + ", or M, mean(M), std(M), error(M) of an observable M",
)

AXIS = Record(
    "a range",
    (
        RecordKey("from", CONSTANT, "the first value or, without count, the smallest random value"),
        RecordKey("to", CONSTANT, "the last value or, without count, the largest random value"),
        RecordKey(
            "count",
            Integer(1, limits.SWEPT, limit=True),
            "the number of values; without it the values are drawn at random",
        ),
        RecordKey(
            "scale", OneOf(("linear", "log")), "values are spaced or drawn evenly on this scale", default="linear"
        ),
    ),
)
SWEEP = Record(
    "a sweep",
    (
        RecordKey("run", RUN_NAME, "the run that the sweep repeats; the first run of the spec if not given"),
        RecordKey(
            "over",
            MapOf(NAME, Either({Scalar: CONSTANT, Sequence: ListOf(CONSTANT, least=1), Mapping: AXIS}), least=1),
            "the values of parameters, initial coordinates, step or start that vary; also random: N and "
            "seed, or file: FILE.csv",
            required=True,
        ),
        RecordKey(
            "keep",
            ListOf(KEPT_WORD, least=1),
            "the results to store for each member of the sweep; M, mean(M), std(M) or error(M) for an observable M",
        ),
        RecordKey(
            "frames",
            Integer(1, limits.STEPS, limit=True),
            "also store states of each member: the number of steps from one stored state to the next",
        ),
        RecordKey(
            "target",
            OneOf(("auto", *RUNNABLE)),
            "the target that computes the members, such as c or numpy",
            default="auto",
        ),
        RecordKey("description", PROSE, "what the sweep shows"),
    ),
)


#: Hints for keys that stand at the top of a spec, but belong inside a run.
_IN_RUNS = {f.key: f"`{f.key}` is a key of a run: write `runs: {{NAME: {{{f.key}: …}}}}`" for f in RUN.fields}
_IN_RUNS["step"] += ". The key `monitor` adapts steps to the motion"
_IN_RUNS["precision"] = "`order` sets the order of the method; `real: float` means single precision"
_IN_RUNS["tolerance"] = (
    "the keys `order` and `step` determine the error of a step; `solver: {tolerance: …}` is for the equations of "
    "implicit steps"
)

SPEC = Record(
    "a spec",
    (
        RecordKey("phigen", Integer(FORMAT_VERSION, FORMAT_VERSION), "1, the version of the format", required=True),
        RecordKey(
            "name",
            ShapedText(
                SPEC_NAME,
                "a spec name",
                "a spec name consists of at most 31 lower-case letters, digits and _, and starts with a letter",
                31,
            ),
            "the name of the system, with which all names in the generated code begin",
            required=True,
        ),
        RecordKey("title", INLINE, "what the system is, on one line"),
        RecordKey("description", PROSE, "what the system is, at length"),
        RecordKey("references", Either({Scalar: PROSE, Sequence: ListOf(PROSE)}), "publications about the system"),
        RecordKey("license", INLINE, "the licence of the generated code, as an SPDX identifier", default="0BSD"),
        RecordKey(
            "coordinates",
            ListOf(NAME, least=1, most=limits.COORDINATES),
            "the names of the coordinates x_1, …, x_n",
            required=True,
        ),
        RecordKey(
            "parameters",
            MapOf(NAME, Either({Scalar: CONSTANT, Mapping: PARAMETER})),
            "the parameters of the system with their default values; the generated code can take other values",
        ),
        RecordKey(
            "inputs",
            ListOf(NAME, least=1),
            "the parameters that change while a program runs; they are the inputs of an FMU",
        ),
        RecordKey("time", TIME, "the name of the time, for systems that depend on the time"),
        RecordKey("definitions", FORMULAS, "expressions with names, which every other expression can use"),
        RecordKey(
            "lattice",
            LATTICE,
            "how identical sites are connected: a grid, a graph, or all in pairs; each site has all coordinates",
        ),
        RecordKey("poisson", POISSON, "the Poisson structure π, in exactly one form such as brackets", required=True),
        RecordKey(
            "hamiltonian",
            Either({Scalar: FORMULA, Mapping: DENSITIES}),
            "the Hamiltonian H in ẋ = π∇H",
            required=True,
        ),
        RecordKey("forces", FORCES, "forces in addition to H: ẋ = π(∇H + covector) + vector"),
        RecordKey(
            "damping", FORMULA, "λ ≥ 0 in the damping −λ π πᵀ∇H: dH/dt = −λ |π∇H|², and Casimirs remain constant"
        ),
        RecordKey(
            "noise",
            MapOf(NAME, SOURCE, least=1),
            "the sources of noise, by name; each adds σ π∇g ∘ dW to dx, in the sense of Stratonovich",
        ),
        RecordKey(
            "casimirs",
            MapOf(NAME, Either({Scalar: FORMULA, Mapping: CASIMIR})),
            "the Casimirs, by name; phigen check examines them",
        ),
        RecordKey("invariants", FORMULAS, "first integrals other than Casimirs, by name; phigen check examines them"),
        RecordKey(
            "observables",
            MapOf(NAME, Either({Scalar: FORMULA, Mapping: OBSERVABLE})),
            "quantities to record, by name; formulas may use sign, min, max, heaviside, if(a < b, c, d); on "
            "lattices {mean: x}",
        ),
        RecordKey(
            "birealisation",
            Either({Scalar: KIND, Mapping: BIREALISATION}),
            "the maps (y, p) ↦ x, x' by which scheme: series makes a Poisson map; auto chooses by the form of π",
            default="auto",
        ),
        RecordKey("order", Integer(1, limits.ORDER, limit=True), "the order of the method", default=DEFAULT_ORDER),
        RecordKey(
            "terms",
            Integer(1, limits.ORDER, limit=True),
            "for scheme: series, in place of order: the number k of terms S_1, …, S_k",
        ),
        RecordKey(
            "composition",
            OneOf(COMPOSITIONS),
            "the composition that makes a step of high order from several shorter steps or flows",
            default="auto",
        ),
        RecordKey(
            "gauge",
            Either({Scalar: OneOf(("auto", "none")), Mapping: FORMULAS}),
            "multiples of Casimirs that are subtracted from H: the motion is the same, the error of a step smaller",
            default="auto",
        ),
        RecordKey(
            "monitor",
            FORMULA,
            "a function g > 0 of the state with dt = g dτ: steps are equal in τ; or log, for scheme: splitting",
        ),
        RecordKey(
            "scheme",
            OneOf(SCHEMES),
            "how a step is computed; auto chooses the scheme of the least expected cost",
            default="series, on lattices auto",
        ),
        RecordKey(
            "structure",
            OneOf(STRUCTURES),
            "for scheme: gauss: whether steps are Poisson maps (exact) or only up to truncation errors (to truncation)",
            default="exact",
        ),
        RecordKey(
            "coordinates_from",
            OneOf(RELATIVE),
            "for scheme: splitting of attracting bodies: H is split into Kepler motions in these coordinates "
            "and a remainder",
        ),
        RecordKey(
            "profile",
            OneOf(PROFILES),
            "the style of the C: fast, small (short and readable) or certified (MISRA C)",
            default="fast",
        ),
        RecordKey(
            "real", OneOf(REALS), "the number type of the generated C; float needs profile: small", default="double"
        ),
        RecordKey("without", ListOf(OneOf(PARTS)), "the parts of the generated code to leave out"),
        RecordKey("solver", SOLVER, "how the equations of implicit steps are solved"),
        RecordKey(
            "tangent", Boolean(), "also generate step_tangent, which computes the derivative of a step", default=False
        ),
        RecordKey(
            "adjoint",
            Boolean(),
            "also generate step_adjoint and pullback, which compute gradients of steps and runs",
            default=False,
        ),
        RecordKey(
            "modified_hamiltonian",
            Integer(0, limits.CORRECTIONS, limit=True),
            "also generate the Hamiltonian whose flow the steps follow, as H with this number of corrections",
            default=0,
        ),
        RecordKey(
            "reconstruct",
            OneOf(RECONSTRUCTIONS),
            "for a Lie–Poisson structure: also compute the attitude, as a quaternion (on se(3) with the "
            "position) or a matrix",
        ),
        RecordKey(
            "targets", ListOf(OneOf(tuple(TARGETS), OTHER_TARGETS), least=1), "the languages of the generated code"
        ),
        RecordKey("runs", MapOf(RUN_NAME, RUN), "named runs: each has initial values, a step size and a length"),
        RecordKey(
            "sweeps",
            MapOf(RUN_NAME, SWEEP),
            "named sweeps: each repeats a run for many parameters or initial values, by phigen sweep",
        ),
    ),
    alternatives=("order", "terms"),
    hints=_IN_RUNS,
)
