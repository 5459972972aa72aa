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

NAME = ShapedText(IDENTIFIER, "a name", "names are ASCII letters, digits and _, and start with a letter or _")
TIME = replace(NAME, expected="the name of the time", example="time: t declares it")
RUN_NAME = ShapedText(r"[A-Za-z0-9_][A-Za-z0-9_-]*", "the name of a run", "use ASCII letters, digits, _ and -")
NEIGHBOUR = ShapedText(IDENTIFIER + r" *(\[[^\[\]]*\])?", NAME.expected, NAME.hint)
FORMULA, CONSTANT, INLINE, PROSE = ExpressionText(), ExpressionText(constant=True), Text(), Text(lines=True)
FORMULAS = MapOf(NAME, FORMULA)
MATRIX = ListOf(ListOf(FORMULA, least=1), least=1)
BASIS = ShapedText(r"E[1-9][0-9]*", "the name of a basis element", "basis elements are E1, E2, …")

RANDOM = MapOf(NAME, CONSTANT, least=1)
#: Values at sites or bonds: a scalar (number, formula of the indices, or name of a file), a list, or a mapping
#: {random: …, seed: …, scale: …, mean: …}.
VALUES = Either({Scalar: CONSTANT, Sequence: ListOf(CONSTANT, least=1), Mapping: RANDOM})
PARAMETER = Record(
    "a parameter",
    (
        RecordKey("value", VALUES, "default value", required=True),
        RecordKey(
            "at",
            OneOf(("all", "sites", "bonds")),
            "lattices: sites or bonds, each with a value of its own",
            default="all",
        ),
        RecordKey(
            "positive", Boolean(), "the value is always greater than 0; simplifications may use it", default=False
        ),
        RecordKey("nonnegative", Boolean(), "the value is never less than 0", default=False),
        RecordKey("small", Boolean(), "splittings: the terms with this factor are a small part of H", default=False),
        RecordKey("description", PROSE, "the meaning of the parameter"),
        RecordKey("unit", INLINE, "its unit, such as kg.m2; documentation only, nothing is converted"),
    ),
)
CANONICAL = Record(
    "canonical",
    (
        RecordKey("q", ListOf(NAME, least=1), "positions q_1, …, q_m among the coordinates", required=True),
        RecordKey("p", ListOf(NAME, least=1), "their momenta p_1, …, p_m; {q_i, p_i} = 1", required=True),
    ),
    example="{q: [x, y], p: [px, py]}",
)
ALGEBRA_NAME = ShapedText(r"[a-zA-Z]+\([0-9]+\)", "the name of a Lie algebra", f"write {FAMILY_HELP}")
LIE_ALGEBRA = Record(
    "lie_algebra",
    (
        RecordKey("name", ALGEBRA_NAME, FAMILY_HELP),
        RecordKey("matrices", ListOf(MATRIX, least=1), "square matrices E_1, …, E_n that span the algebra"),
        RecordKey(
            "structure_constants",
            MapOf(BASIS, MapOf(BASIS, MapOf(BASIS, FORMULA))),
            "{E1: {E2: {E3: c}}} for [E_1, E_2] = c E_3; missing pairs are 0",
        ),
        RecordKey("sign", OneOf(("plus", "minus")), "{x_i, x_j} = ± Σ c_ij^k x_k", default="plus"),
    ),
    one=("name", "matrices", "structure_constants"),
    exactly=True,
    example="{name: so(3)}",
)
_FORMS: dict[str, tuple[Kind, str]] = {
    "matrix": (MATRIX, "π as an n×n matrix of brackets {x_i, x_j}"),
    "brackets": (
        MapOf(NAME, MapOf(NEIGHBOUR, FORMULA)),
        '{x1: {x2: f}} for {x1, x2} = f; missing pairs are 0; of lattices also {x: {"y[i-1]": f}}',
    ),
    "canonical": (CANONICAL, "{q_i, p_i} = 1"),
    "log_canonical": (MATRIX, "the n×n matrix a of {x_i, x_j} = a_ij x_i x_j"),
    "lie_algebra": (
        Either({Mapping: LIE_ALGEBRA, Scalar: ALGEBRA_NAME}),
        "the Lie–Poisson structure {x_i, x_j} = ± Σ c_ij^k x_k",
    ),
    "nambu": (ListOf(FORMULA), "n-2 Casimirs C_k of {f, g} = det ∂(f, g, C_1, …)/∂(x_1, …, x_n)"),
}


def _structure(subject: str, nested: int, *further_keys: RecordKey) -> Record:
    """Return the record of keys for a Poisson structure, which is given in exactly one form (matrix, brackets, …).

    Products and pull-backs may be nested to the depth ``nested``. ``subject`` is the name of the record in messages.
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
                    "of", _structure("of", nested - 1), "a form in the coordinates that map defines", required=True
                ),
                RecordKey(
                    "map",
                    MapOf(NAME, FORMULA, least=1),
                    "the coordinates of the form, as functions of those of the spec",
                    required=True,
                ),
                RecordKey("inverse", FORMULAS, "the inverse of map, if phigen cannot find it"),
            ),
        )
        forms.append(RecordKey("product", ListOf(block, least=2), "blocks, with zero brackets between them"))
        forms.append(RecordKey("pullback", pullback, "a structure in other coordinates"))
    keys = tuple(f.key for f in forms)
    instead: tuple[str, ...] = ()
    if subject == "poisson":
        instead = ("bonds",)
        bond_help = "graphs: {x[a]: {x[b]: f}} for the bracket of the ends of a bond; alone, or beside a form"
        forms.append(RecordKey("bonds", MapOf(NEIGHBOUR, MapOf(NEIGHBOUR, FORMULA)), bond_help))
    example = "{lie_algebra: {name: so(3)}}"
    return Record(
        subject,
        (*further_keys, *forms),
        one=keys,
        exactly=True,
        instead=instead,
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
        RecordKey("kind", KIND, "the kind; auto chooses by the form of π", required=True),
        RecordKey(
            "side",
            OneOf(("q", "p")),
            "canonical-euler: a step takes H at these coordinates of its start and at the others of its end",
            default="q",
        ),
        RecordKey(
            "of",
            KIND,
            "product, pullback: the kind for the blocks, or for the form that is pulled back",
            default="auto",
        ),
        RecordKey("tau", TAU, "group-map: a rational function of P = Σ p_i E_i, or a matrix with entries in p_NAME"),
        RecordKey(
            "alpha", ListOf(FORMULA, least=1), "custom: α(x, p), one expression per coordinate, momenta are p_NAME"
        ),
        RecordKey(
            "beta", ListOf(FORMULA, least=1), "custom: β(x, p), one expression per coordinate, momenta are p_NAME"
        ),
        RecordKey("spray", SPRAY, "spray: the quadratic forms f_j of ṗ_j, or the name of a spray", default="auto"),
        RecordKey("degree", Integer(1, limits.ORDER, limit=True), "spray: where formal series in p are cut off"),
    ),
)
SOLVER = Record(
    "solver",
    (
        RecordKey("method", OneOf(("auto", "newton")), "how the implicit step is solved", default="auto"),
        RecordKey("tolerance", ExpressionText(), "auto, or the tolerance of the solve", default="auto"),
        RecordKey("max_iterations", Integer(1, 1000), "iterations before a step fails", default=20),
        RecordKey("lanes", Boolean(), "C: many steps, and ensembles, eight at a time; longer code", default=True),
        RecordKey(
            "compensated",
            Boolean(),
            "C of split lattices: compensated summation, less rounding in more time",
            default=False,
        ),
    ),
)
LATTICE = Record(
    "lattice",
    (
        RecordKey(
            "axes", ListOf(NAME, least=1, most=3), "the axes of a grid, the slowest first; x[i+1] is a neighbour"
        ),
        RecordKey(
            "boundary",
            Either({Scalar: BOUNDARY, Sequence: ListOf(BOUNDARY)}),
            "of all axes, or of each",
            default="periodic",
        ),
        RecordKey(
            "graph", NAME, "the name of a list of bonds, which is given at run time; x[a] and x[b] are x at the ends"
        ),
        RecordKey("pairs", OneOf(("all",)), "all: every site is paired with every other"),
    ),
    one=("axes", "graph", "pairs"),
    exactly=True,
)
DENSITIES = Record(
    "hamiltonian",
    (
        RecordKey("sites", FORMULA, "the terms of each site"),
        RecordKey("bonds", FORMULA, "the terms of each bond of a graph, from a to b"),
        RecordKey("pairs", FORMULA, "the terms of each pair, a and b"),
    ),
    some=True,
)
CASIMIR = Record(
    "a Casimir",
    (
        RecordKey("value", FORMULA, "the density", required=True),
        RecordKey(
            "at", OneOf(("sites", "sum", "product")), "lattices: a Casimir of each site, or the sum or product of all"
        ),
    ),
)
OBSERVABLE = Record(
    "an observable of a lattice",
    (
        RecordKey("mean", FORMULA, "the mean of a density over sites, bonds or pairs"),
        RecordKey("sum", FORMULA, "its sum"),
        RecordKey("max", FORMULA, "its largest value at a site"),
        RecordKey("min", FORMULA, "its least value at a site"),
        RecordKey("over", OneOf(OVER), "the sites, bonds or pairs of the density", default="sites"),
    ),
    one=REDUCTIONS,
    exactly=True,
    example="{mean: x}",
)
FORCES = Record(
    "forces",
    (
        RecordKey("covector", FORMULAS, "by coordinate: tangent to the leaves, so it keeps Casimirs"),
        RecordKey("vector", FORMULAS, "by coordinate: torques, thrust, growth; changes Casimirs"),
    ),
    example="{covector: {q: gamma*p}}",
)
SOURCE = Record(
    "a source of noise",
    (
        RecordKey("hamiltonian", FORMULA, "g of σ π∇g ∘ dW, a function of the coordinates", required=True),
        RecordKey("amplitude", FORMULA, "σ, which may depend on parameters and the time", default="1"),
    ),
)

#: Hints for words that users may write as keys of a run. The setting belongs to the whole spec or to a call in Python,
#: or the key has another name.
_BESIDE_RUNS = {
    key: f"{key}: belongs beside runs, to the whole spec"
    for key in ("order", "monitor", "scheme", "damping", "forces", "noise", "coordinates", "hamiltonian", "tangent")
} | {
    "tolerance": "solver: {tolerance: …} belongs beside runs, to the whole spec",
    "reconstruct": "reconstruct: belongs beside runs; an attitude starts at the identity, in Python at attitude0=",
    "retry": "solver.integrate(…, retry=n) in Python divides a step that fails into smaller ones",
    "time": "start is the time at the start of a run, until that at its end",
}

AVERAGE = Record(
    "average",
    (
        RecordKey("after", CONSTANT, "rows before this time are left out"),
        RecordKey("blocks", Integer(2, 10_000), "blocks of rows for the standard error; 20 if not given"),
        RecordKey("of", ListOf(NAME, least=1), "the observables whose averages are shown; all if not given"),
    ),
    example="{after: 200, blocks: 20}",
)
SPECTRUM = Record(
    "spectrum",
    (
        RecordKey("of", ListOf(NAME, least=1), "the fields f of the mean over frames of Σ |f(q, ω)|²", required=True),
        RecordKey("after", CONSTANT, "states before this time are left out"),
    ),
    example="{of: [x, y], after: 100}",
)
CORRELATION = Record(
    "correlation",
    (
        RecordKey("of", NAME, "the field f of ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩", required=True),
        RecordKey("with", NAME, "the field g; f if not given"),
        RecordKey("axis", NAME, "the axis of d; the first if not given"),
        RecordKey("up to", Integer(0, limits.SITES), "the largest distance d, in sites", required=True),
        RecordKey("after", CONSTANT, "states before this time are left out"),
    ),
    example="{of: x, with: y, axis: i, up to: 32}",
)
RUN = Record(
    "a run",
    (
        RecordKey(
            "initial",
            Either({Sequence: ListOf(CONSTANT, least=1), Mapping: MapOf(NAME, VALUES, least=1), Scalar: CONSTANT}),
            "initial values, as a list or by the name of the coordinate; of lattices also a file or {random: sphere}",
            required=True,
        ),
        RecordKey(
            "sizes", ListOf(Integer(1, limits.SITES, limit=True), least=1, most=3), "lattices: the sizes of the axes"
        ),
        RecordKey(
            "bonds",
            Either({Scalar: INLINE, Sequence: ListOf(ListOf(Integer(0, limits.SITES)), most=limits.BONDS)}),
            "graphs: pairs of sites, counted from 0, or a file of them, .csv",
        ),
        RecordKey(
            "names", ListOf(INLINE, least=1), "graphs and pairs: the names of the sites, in figures and the live panel"
        ),
        RecordKey("step", CONSTANT, "step size h", required=True),
        RecordKey("steps", Integer(1, limits.STEPS, limit=True), "number of steps"),
        RecordKey("duration", CONSTANT, "time span instead of the number of steps; a multiple of the step"),
        RecordKey("until", CONSTANT, "the end time, reached by a shorter last step, instead of the number of steps"),
        RecordKey("stop", FORMULA, "the run ends where this expression passes through 0"),
        RecordKey("start", CONSTANT, "the time at the start, 0 if not given; for systems with a time"),
        RecordKey("seed", Integer(0, limits.SEED), "noise: the seed of the random numbers", default=0),
        RecordKey(
            "members", Integer(1, limits.MEMBERS), "noise: the number of paths from the same initial state", default=1
        ),
        RecordKey(
            "stride",
            Integer(1, limits.STEPS, limit=True),
            "the number of steps from one stored state to the next",
            default=1,
        ),
        RecordKey("every", CONSTANT, "the time from one stored state to the next, instead of the stride"),
        RecordKey("at", ListOf(CONSTANT, least=1), "the times of the stored states, instead of the stride"),
        RecordKey("parameters", MapOf(NAME, VALUES), "parameter values that differ from the defaults"),
        RecordKey("exact", FORMULAS, "closed form by coordinate, in t and x0_NAME for initial values"),
        RecordKey("compare", ListOf(OneOf(CLASSICAL_METHODS)), "classical methods to compare with"),
        RecordKey("section", FORMULA, "Poincaré section: where this expression passes through 0, as direction says"),
        RecordKey(
            "direction", OneOf(DIRECTIONS), "how the section is crossed: rising, falling or both", default="rising"
        ),
        RecordKey(
            "record", ListOf(NAME, least=1), "columns of the output: state, energy, Casimirs, observables; or all"
        ),
        RecordKey("average", AVERAGE, "time averages of the observables: the rows to average over"),
        RecordKey("spectrum", SPECTRUM, "grids: the dynamic structure factor S(q, ω) of fields"),
        RecordKey("correlation", CORRELATION, "grids: the correlation of two fields over distances along an axis"),
        RecordKey(
            "box",
            MapOf(NAME, ListOf(CONSTANT, least=1)),
            "ranges [LOW, HIGH] of coordinates, for which certify bounds errors",
        ),
        RecordKey("description", PROSE, "what the run shows"),
    ),
    one=("steps", "duration", "until"),
    exactly=True,
    elsewhere=_BESIDE_RUNS,
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
        RecordKey("from", CONSTANT, "the first value, or the smallest random value"),
        RecordKey("to", CONSTANT, "the last value, or the largest random value"),
        RecordKey("count", Integer(1, limits.SWEPT, limit=True), "the number of values; without it values are random"),
        RecordKey("scale", OneOf(("linear", "log")), "spacing or distribution of the values", default="linear"),
    ),
)
SWEEP = Record(
    "a sweep",
    (
        RecordKey("run", RUN_NAME, "the run to repeat; the first if not given"),
        RecordKey(
            "over",
            MapOf(NAME, Either({Scalar: CONSTANT, Sequence: ListOf(CONSTANT, least=1), Mapping: AXIS}), least=1),
            "values of parameters, initial coordinates, step, start: a grid; random: N and seed, or file: members.csv",
            required=True,
        ),
        RecordKey(
            "keep",
            ListOf(KEPT_WORD, least=1),
            "results to store for each member; also M, mean(M), std(M), error(M) of observables M",
        ),
        RecordKey(
            "frames",
            Integer(1, limits.STEPS, limit=True),
            "also store states: the number of steps from one to the next",
        ),
        RecordKey("target", OneOf(("auto", *RUNNABLE)), "target that runs the members", default="auto"),
        RecordKey("description", PROSE, "what the sweep shows"),
    ),
)


#: Hints for keys that stand at the top of a spec, but belong inside a run.
_IN_RUNS = {f.key: f"{f.key}: belongs to a run, runs: {{NAME: {{{f.key}: …}}}}" for f in RUN.fields}
_IN_RUNS["step"] += "; monitor: adapts steps to the motion"
_IN_RUNS["precision"] = "order: sets the order of the error; real: float is single precision"
_IN_RUNS["tolerance"] = "solver: {tolerance: …} bounds the inner solve; order and step set the error of a step"

SPEC = Record(
    "a spec",
    (
        RecordKey("phigen", Integer(FORMAT_VERSION, FORMAT_VERSION), "1, the version of the format", required=True),
        RecordKey(
            "name",
            ShapedText(
                SPEC_NAME, "a spec name", "lower-case letters, digits and _, starting with a letter, at most 31", 31
            ),
            "prefix of every generated symbol",
            required=True,
        ),
        RecordKey("title", INLINE, "what the system is, on one line"),
        RecordKey("description", PROSE, "what the system is, at length"),
        RecordKey("references", Either({Scalar: PROSE, Sequence: ListOf(PROSE)}), "where the system comes from"),
        RecordKey("license", INLINE, "SPDX identifier of the licence of the generated code", default="0BSD"),
        RecordKey("coordinates", ListOf(NAME, least=1, most=limits.COORDINATES), "names of x_1, …, x_n", required=True),
        RecordKey(
            "parameters",
            MapOf(NAME, Either({Scalar: CONSTANT, Mapping: PARAMETER})),
            "run-time arguments of the generated code, with defaults",
        ),
        RecordKey("inputs", ListOf(NAME, least=1), "parameters that change while it runs: the inputs of an FMU"),
        RecordKey("time", TIME, "the name of the time, for a Hamiltonian that depends on it"),
        RecordKey("definitions", FORMULAS, "named sub-expressions, usable in every expression"),
        RecordKey("lattice", LATTICE, "identical sites on a grid, on a graph, or all paired; each has the coordinates"),
        RecordKey("poisson", POISSON, "the Poisson structure, in one of its forms", required=True),
        RecordKey(
            "hamiltonian",
            Either({Scalar: FORMULA, Mapping: DENSITIES}),
            "the Hamiltonian H; ẋ = π∇H",
            required=True,
        ),
        RecordKey("forces", FORCES, "what acts beside H: ẋ = π(∇H + covector) + vector"),
        RecordKey("damping", FORMULA, "λ ≥ 0 of the damping −λ π πᵀ∇H, which keeps the leaves: dH/dt = −λ |π∇H|²"),
        RecordKey("noise", MapOf(NAME, SOURCE, least=1), "sources of noise by name: ẋ = … + σ π∇g ∘ dW, Stratonovich"),
        RecordKey("casimirs", MapOf(NAME, Either({Scalar: FORMULA, Mapping: CASIMIR})), "Casimirs by name; checked"),
        RecordKey("invariants", FORMULAS, "further first integrals by name; checked"),
        RecordKey(
            "observables",
            MapOf(NAME, Either({Scalar: FORMULA, Mapping: OBSERVABLE})),
            "quantities to record by name, also with sign, min, max, heaviside, if(a < b, c, d); of lattices {mean: x}",
        ),
        RecordKey(
            "birealisation", Either({Scalar: KIND, Mapping: BIREALISATION}), "the bi-realisation to use", default="auto"
        ),
        RecordKey("order", Integer(1, limits.ORDER, limit=True), "order of the method", default=DEFAULT_ORDER),
        RecordKey("terms", Integer(1, limits.ORDER, limit=True), "instead of order: use exactly S_1, …, S_k"),
        RecordKey("composition", OneOf(COMPOSITIONS), "symmetric composition of steps", default="auto"),
        RecordKey(
            "gauge",
            Either({Scalar: OneOf(("auto", "none")), Mapping: FORMULAS}),
            "Casimirs subtracted from H before discretising",
            default="auto",
        ),
        RecordKey("monitor", FORMULA, "equal steps of τ, dt = g dτ: g > 0, or log for a splitting"),
        RecordKey(
            "scheme",
            OneOf(SCHEMES),
            "how the one-step map is made; auto chooses by the expected cost",
            default="series, of lattices auto",
        ),
        RecordKey(
            "structure",
            OneOf(STRUCTURES),
            "scheme gauss: exact for steps that are Poisson maps, or to truncation for steps that are none",
            default="exact",
        ),
        RecordKey(
            "coordinates_from",
            OneOf(RELATIVE),
            "scheme splitting, attracting bodies: H is split into motions in these coordinates and a small remainder",
        ),
        RecordKey(
            "profile",
            OneOf(PROFILES),
            "fast, or small: short readable code, without blocks and gauge search",
            default="fast",
        ),
        RecordKey("real", OneOf(REALS), "the number type of the C; float needs profile: small", default="double"),
        RecordKey("without", ListOf(OneOf(PARTS)), "parts of the code to leave out"),
        RecordKey("solver", SOLVER, "the inner solve of a step"),
        RecordKey("tangent", Boolean(), "also generate step_tangent, the derivative of a step", default=False),
        RecordKey(
            "adjoint", Boolean(), "also generate step_adjoint and pullback: gradients of steps and runs", default=False
        ),
        RecordKey(
            "modified_hamiltonian",
            Integer(0, limits.CORRECTIONS, limit=True),
            "also generate the modified Hamiltonian, with this number of corrections",
            default=0,
        ),
        RecordKey(
            "reconstruct",
            OneOf(RECONSTRUCTIONS),
            "on the dual of a Lie algebra: also the attitude, as a quaternion (se(3): with the position) or a matrix",
        ),
        RecordKey("targets", ListOf(OneOf(tuple(TARGETS)), least=1), "languages of the generated code"),
        RecordKey("runs", MapOf(RUN_NAME, RUN), "named experiments"),
        RecordKey(
            "sweeps", MapOf(RUN_NAME, SWEEP), "runs over ranges of parameters and initial values, for phigen sweep"
        ),
    ),
    one=("order", "terms"),
    elsewhere=_IN_RUNS,
)
