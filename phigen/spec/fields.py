"""The format of a spec file, as one table; the validator and the JSON Schema are both made from it."""

from __future__ import annotations

from dataclasses import replace

from phigen.registry import TARGETS
from phigen.spec import limits
from phigen.spec.kinds import (
    Boolean,
    Choice,
    Either,
    Field,
    Formula,
    Integer,
    Kind,
    ListOf,
    MapOf,
    Name,
    Record,
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
    SCHEMES,
    SPEC_NAME,
    STRUCTURES,
)
from phigen.spec.yaml_source import Mapping, Scalar, Sequence

FORMAT_VERSION = 1

NAME = Name(IDENTIFIER, "a name", "names are ASCII letters, digits and _, and start with a letter or _")
TIME = replace(NAME, expected="the name of the time", example="time: t declares it")
RUN_NAME = Name(r"[A-Za-z0-9_][A-Za-z0-9_-]*", "the name of a run", "use ASCII letters, digits, _ and -")
NEIGHBOUR = Name(IDENTIFIER + r" *(\[[^\[\]]*\])?", NAME.expected, NAME.hint)
FORMULA, CONSTANT, INLINE, PROSE = Formula(), Formula(constant=True), Text(), Text(lines=True)
FORMULAS = MapOf(NAME, FORMULA)
MATRIX = ListOf(ListOf(FORMULA, least=1), least=1)
BASIS = Name(r"E[1-9][0-9]*", "the name of a basis element", "basis elements are E1, E2, …")

RANDOM = MapOf(NAME, CONSTANT, least=1)
#: A number, a formula of the indices or a file; a list; {random: …, seed: …, scale: …, mean: …}.
VALUES = Either({Scalar: CONSTANT, Sequence: ListOf(CONSTANT, least=1), Mapping: RANDOM})
PARAMETER = Record(
    "a parameter",
    (
        Field("value", VALUES, "default value", required=True),
        Field(
            "at",
            Choice(("all", "sites", "bonds")),
            "lattices: sites or bonds, each with a value of its own",
            default="all",
        ),
        Field("positive", Boolean(), "the value is always greater than 0; simplifications may use it", default=False),
        Field("nonnegative", Boolean(), "the value is never less than 0", default=False),
        Field("small", Boolean(), "splittings: the terms with this factor are a small part of H", default=False),
        Field("description", PROSE, "the meaning of the parameter"),
        Field("unit", INLINE, "its unit, such as kg.m2; documentation only, nothing is converted"),
    ),
)
CANONICAL = Record(
    "canonical",
    (
        Field("q", ListOf(NAME, least=1), "positions q_1, …, q_m among the coordinates", required=True),
        Field("p", ListOf(NAME, least=1), "their momenta p_1, …, p_m; {q_i, p_i} = 1", required=True),
    ),
    example="{q: [x, y], p: [px, py]}",
)
LIE_ALGEBRA = Record(
    "lie_algebra",
    (
        Field("name", Name(r"[a-zA-Z]+\([0-9]+\)", "the name of a Lie algebra", f"write {FAMILY_HELP}"), FAMILY_HELP),
        Field("matrices", ListOf(MATRIX, least=1), "square matrices E_1, …, E_n that span the algebra"),
        Field(
            "structure_constants",
            MapOf(BASIS, MapOf(BASIS, MapOf(BASIS, FORMULA))),
            "{E1: {E2: {E3: c}}} for [E_1, E_2] = c E_3; missing pairs are 0",
        ),
        Field("sign", Choice(("plus", "minus")), "{x_i, x_j} = ± Σ c_ij^k x_k", default="plus"),
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
    "lie_algebra": (LIE_ALGEBRA, "the Lie–Poisson structure {x_i, x_j} = ± Σ c_ij^k x_k"),
    "nambu": (ListOf(FORMULA), "n-2 Casimirs C_k of {f, g} = det ∂(f, g, C_1, …)/∂(x_1, …, x_n)"),
}


def _structure(what: str, nested: int, *more: Field) -> Record:
    """A Poisson structure in one of its forms; products and pull-backs hold others, ``nested`` levels deep."""
    forms = [Field(form, *described) for form, described in _FORMS.items()]
    if nested:
        names = ListOf(NAME, least=1)
        block = _structure(
            "a block of a product",
            nested - 1,
            Field("coordinates", names, "the coordinates of the block", required=True),
        )
        pullback = Record(
            "pullback",
            (
                Field("of", _structure("of", nested - 1), "a form in the coordinates that map defines", required=True),
                Field(
                    "map",
                    MapOf(NAME, FORMULA, least=1),
                    "the coordinates of the form, as functions of those of the spec",
                    required=True,
                ),
                Field("inverse", FORMULAS, "the inverse of map, if phigen cannot find it"),
            ),
        )
        forms.append(Field("product", ListOf(block, least=2), "blocks, with zero brackets between them"))
        forms.append(Field("pullback", pullback, "a structure in other coordinates"))
    keys = tuple(f.key for f in forms)
    instead: tuple[str, ...] = ()
    if what == "poisson":
        instead = ("bonds",)
        along = "graphs: {x[a]: {x[b]: f}} for the bracket of the ends of a bond; alone, or beside a form"
        forms.append(Field("bonds", MapOf(NEIGHBOUR, MapOf(NEIGHBOUR, FORMULA)), along))
    example = "{lie_algebra: {name: so(3)}}"
    return Record(what, (*more, *forms), one=keys, exactly=True, instead=instead, example="" if more else example)


BOUNDARY = Choice(("periodic", "open"))
#: How deep products and pull-backs may be nested.
NESTED = 2
POISSON = _structure("poisson", NESTED)
KIND = Choice(BIREALISATIONS)
TAU = Either({Scalar: FORMULA, Sequence: MATRIX})
SPRAY = Either({Scalar: Choice(("auto", "flat", "natural")), Sequence: ListOf(FORMULA, least=1)})
BIREALISATION = Record(
    "birealisation",
    (
        Field("kind", KIND, "the kind; auto chooses by the form of π", required=True),
        Field("side", Choice(("q", "p")), "canonical-euler: the half of the coordinates that is implicit", default="q"),
        Field(
            "of",
            KIND,
            "product, pullback: the kind for the blocks, or for the form that is pulled back",
            default="auto",
        ),
        Field("tau", TAU, "group-map: a rational function of P = Σ p_i E_i, or a matrix with entries in p_NAME"),
        Field("alpha", ListOf(FORMULA, least=1), "custom: α(x, p), one expression per coordinate, momenta are p_NAME"),
        Field("beta", ListOf(FORMULA, least=1), "custom: β(x, p), one expression per coordinate, momenta are p_NAME"),
        Field("spray", SPRAY, "spray: the quadratic forms f_j of ṗ_j, or the name of a spray", default="auto"),
        Field("degree", Integer(1, limits.ORDER, limit=True), "spray: where formal series in p are cut off"),
    ),
)
SOLVER = Record(
    "solver",
    (
        Field("method", Choice(("auto", "newton")), "how the implicit step is solved", default="auto"),
        Field("tolerance", Formula(), "auto, or the tolerance of the solve", default="auto"),
        Field("max_iterations", Integer(1, 1000), "iterations before a step fails", default=20),
        Field("lanes", Boolean(), "C: many steps, and ensembles, eight at a time; longer code", default=True),
        Field(
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
        Field("axes", ListOf(NAME, least=1, most=3), "the axes of a grid, the slowest first; x[i+1] is a neighbour"),
        Field(
            "boundary",
            Either({Scalar: BOUNDARY, Sequence: ListOf(BOUNDARY)}),
            "of all axes, or of each",
            default="periodic",
        ),
        Field(
            "graph", NAME, "the name of a list of bonds, which is given at run time; x[a] and x[b] are x at the ends"
        ),
        Field("pairs", Choice(("all",)), "all: every site is paired with every other"),
    ),
    one=("axes", "graph", "pairs"),
    exactly=True,
)
DENSITIES = Record(
    "hamiltonian",
    (
        Field("sites", FORMULA, "the terms of each site"),
        Field("bonds", FORMULA, "the terms of each bond of a graph, from a to b"),
        Field("pairs", FORMULA, "the terms of each pair, a and b"),
    ),
    some=True,
)
CASIMIR = Record(
    "a Casimir",
    (
        Field("value", FORMULA, "the density", required=True),
        Field(
            "at", Choice(("sites", "sum", "product")), "lattices: a Casimir of each site, or the sum or product of all"
        ),
    ),
)
OBSERVABLE = Record(
    "an observable of a lattice",
    (
        Field("mean", FORMULA, "the mean of a density over sites, bonds or pairs"),
        Field("sum", FORMULA, "its sum"),
        Field("max", FORMULA, "its largest value at a site"),
        Field("min", FORMULA, "its least value at a site"),
        Field("over", Choice(OVER), "the sites, bonds or pairs of the density", default="sites"),
    ),
    one=REDUCTIONS,
    exactly=True,
    example="{mean: x}",
)
FORCES = Record(
    "forces",
    (
        Field("covector", FORMULAS, "by coordinate: tangent to the leaves, so it keeps Casimirs"),
        Field("vector", FORMULAS, "by coordinate: torques, thrust, growth; changes Casimirs"),
    ),
    example="{covector: {q: gamma*p}}",
)
SOURCE = Record(
    "a source of noise",
    (
        Field("hamiltonian", FORMULA, "g of σ π∇g ∘ dW, a function of the coordinates", required=True),
        Field("amplitude", FORMULA, "σ, which may depend on parameters and the time", default="1"),
    ),
)

#: Where keys of specs, and the time, belong that are looked for in runs.
_BESIDE_RUNS = {
    key: f"{key}: belongs beside runs, to the whole spec"
    for key in ("order", "monitor", "scheme", "damping", "forces", "noise", "coordinates", "hamiltonian", "tangent")
} | {
    "tolerance": "solver: {tolerance: …} belongs beside runs, to the whole spec",
    "reconstruct": "reconstruct: belongs beside runs; an attitude starts at the identity, in Python at attitude0=",
    "retry": "solver.integrate(…, retry=n) in Python makes steps that fail in parts",
    "time": "start is the time at the start of a run, until that at its end",
}

AVERAGE = Record(
    "average",
    (
        Field("after", CONSTANT, "rows before this time are left out"),
        Field("blocks", Integer(2, 10_000), "blocks of rows for the standard error; 20 if not given"),
    ),
    example="{after: 200, blocks: 20}",
)
SPECTRUM = Record(
    "spectrum",
    (
        Field("of", ListOf(NAME, least=1), "the fields f of the mean over frames of Σ |f(q, ω)|²", required=True),
        Field("after", CONSTANT, "states before this time are left out"),
    ),
    example="{of: [x, y], after: 100}",
)
CORRELATION = Record(
    "correlation",
    (
        Field("of", NAME, "the field f of ⟨f(r) g(r + d)⟩ − ⟨f⟩⟨g⟩", required=True),
        Field("with", NAME, "the field g; f if not given"),
        Field("axis", NAME, "the axis of d; the first if not given"),
        Field("up to", Integer(0, limits.SITES), "the largest distance d, in sites", required=True),
        Field("after", CONSTANT, "states before this time are left out"),
    ),
    example="{of: x, with: y, axis: i, up to: 32}",
)
RUN = Record(
    "a run",
    (
        Field(
            "initial",
            Either({Sequence: ListOf(CONSTANT, least=1), Mapping: MapOf(NAME, VALUES, least=1), Scalar: CONSTANT}),
            "initial values, as a list or by the name of the coordinate; of lattices also a file or {random: sphere}",
            required=True,
        ),
        Field(
            "sizes", ListOf(Integer(1, limits.SITES, limit=True), least=1, most=3), "lattices: the sizes of the axes"
        ),
        Field(
            "bonds",
            Either({Scalar: INLINE, Sequence: ListOf(ListOf(Integer(0, limits.SITES)), most=limits.BONDS)}),
            "graphs: pairs of sites, counted from 0, or a file of them, .csv",
        ),
        Field("step", CONSTANT, "step size h", required=True),
        Field("steps", Integer(1, limits.STEPS, limit=True), "number of steps"),
        Field("duration", CONSTANT, "time span instead of the number of steps; a multiple of the step"),
        Field("until", CONSTANT, "the end time, reached by a shorter last step, instead of the number of steps"),
        Field("stop", FORMULA, "the run ends where this expression passes through 0"),
        Field("start", CONSTANT, "the time at the start, 0 if not given; for systems with a time"),
        Field("seed", Integer(0, limits.SEED), "noise: the seed of the random numbers", default=0),
        Field(
            "members", Integer(1, limits.MEMBERS), "noise: the number of paths from the same initial state", default=1
        ),
        Field(
            "stride",
            Integer(1, limits.STEPS, limit=True),
            "the number of steps from one stored state to the next",
            default=1,
        ),
        Field("every", CONSTANT, "the time from one stored state to the next, instead of the stride"),
        Field("at", ListOf(CONSTANT, least=1), "the times of the stored states, instead of the stride"),
        Field("parameters", MapOf(NAME, VALUES), "parameter values that differ from the defaults"),
        Field("exact", FORMULAS, "closed form by coordinate, in t and x0_NAME for initial values"),
        Field("compare", ListOf(Choice(CLASSICAL_METHODS)), "classical methods to compare with"),
        Field("section", FORMULA, "Poincaré section: where this expression passes through 0, as direction says"),
        Field("direction", Choice(DIRECTIONS), "how the section is crossed: rising, falling or both", default="rising"),
        Field("record", ListOf(NAME, least=1), "columns of the output: state, energy, Casimirs, observables; or all"),
        Field("average", AVERAGE, "time averages of the observables: the rows to average over"),
        Field("spectrum", SPECTRUM, "grids: the dynamic structure factor S(q, ω) of fields"),
        Field("correlation", CORRELATION, "grids: the correlation of two fields over distances along an axis"),
        Field("description", PROSE, "what the run shows"),
    ),
    one=("steps", "duration", "until"),
    exactly=True,
    elsewhere=_BESIDE_RUNS,
)

#: What a sweep keeps; which observables there are is known later.
KEPT_WORD = Name(
    r"\w+|\w+ *\( *\w+ *\)",
    "a result of a sweep",
    "one of " + ", ".join(KEPT) + ", or M, mean(M), std(M), error(M) of an observable M",
)

AXIS = Record(
    "a range",
    (
        Field("from", CONSTANT, "the first value, or the smallest random value"),
        Field("to", CONSTANT, "the last value, or the largest random value"),
        Field("count", Integer(1, limits.SWEPT, limit=True), "the number of values; without it values are random"),
        Field("scale", Choice(("linear", "log")), "spacing or distribution of the values", default="linear"),
    ),
)
SWEEP = Record(
    "a sweep",
    (
        Field("run", RUN_NAME, "the run to repeat; the first if not given"),
        Field(
            "over",
            MapOf(NAME, Either({Scalar: CONSTANT, Sequence: ListOf(CONSTANT, least=1), Mapping: AXIS}), least=1),
            "values of parameters, initial coordinates, step, start: a grid; random: N and seed, or file: members.csv",
            required=True,
        ),
        Field(
            "keep",
            ListOf(KEPT_WORD, least=1),
            "results to store for each member; also M, mean(M), std(M), error(M) of observables M",
        ),
        Field(
            "frames",
            Integer(1, limits.STEPS, limit=True),
            "also store states: the number of steps from one to the next",
        ),
        Field("description", PROSE, "what the sweep shows"),
    ),
)


def _switch(key: str, *words: str) -> Kind:
    return Choice(words)


#: Keys of runs that are looked for beside them.
_IN_RUNS = {f.key: f"{f.key}: belongs to a run, runs: {{NAME: {{{f.key}: …}}}}" for f in RUN.fields}
_IN_RUNS["step"] += "; monitor: adapts steps to the motion"
_IN_RUNS["precision"] = "order: sets the order of the error; real: float is single precision"
_IN_RUNS["tolerance"] = "solver: {tolerance: …} bounds the inner solve; order and step set the error of a step"

SPEC = Record(
    "a spec",
    (
        Field("phigen", Integer(FORMAT_VERSION, FORMAT_VERSION), "1, the version of the format", required=True),
        Field(
            "name",
            Name(SPEC_NAME, "a spec name", "lower-case letters, digits and _, starting with a letter, at most 31", 31),
            "prefix of every generated symbol",
            required=True,
        ),
        Field("title", INLINE, "what the system is, on one line"),
        Field("description", PROSE, "what the system is, at length"),
        Field("references", Either({Scalar: PROSE, Sequence: ListOf(PROSE)}), "where the system comes from"),
        Field("license", INLINE, "SPDX identifier of the licence of the generated code", default="0BSD"),
        Field("coordinates", ListOf(NAME, least=1, most=limits.COORDINATES), "names of x_1, …, x_n", required=True),
        Field(
            "parameters",
            MapOf(NAME, Either({Scalar: CONSTANT, Mapping: PARAMETER})),
            "run-time arguments of the generated code, with defaults",
        ),
        Field("inputs", ListOf(NAME, least=1), "parameters that change while it runs: the inputs of an FMU"),
        Field("time", TIME, "the name of the time, for a Hamiltonian that depends on it"),
        Field("definitions", FORMULAS, "named sub-expressions, usable in every expression"),
        Field("lattice", LATTICE, "identical sites on a grid, on a graph, or all paired; each has the coordinates"),
        Field("poisson", POISSON, "the Poisson structure, in one of its forms", required=True),
        Field(
            "hamiltonian",
            Either({Scalar: FORMULA, Mapping: DENSITIES}),
            "the Hamiltonian H; ẋ = π∇H",
            required=True,
        ),
        Field("forces", FORCES, "what acts beside H: ẋ = π(∇H + covector) + vector"),
        Field("damping", FORMULA, "λ ≥ 0 of the damping −λ π πᵀ∇H, which keeps the leaves: dH/dt = −λ |π∇H|²"),
        Field("noise", MapOf(NAME, SOURCE, least=1), "sources of noise by name: ẋ = … + σ π∇g ∘ dW, Stratonovich"),
        Field("casimirs", MapOf(NAME, Either({Scalar: FORMULA, Mapping: CASIMIR})), "Casimirs by name; checked"),
        Field("invariants", FORMULAS, "further first integrals by name; checked"),
        Field(
            "observables",
            MapOf(NAME, Either({Scalar: FORMULA, Mapping: OBSERVABLE})),
            "quantities to record by name, also with sign, min, max, heaviside, if(a < b, c, d); of lattices {mean: x}",
        ),
        Field(
            "birealisation", Either({Scalar: KIND, Mapping: BIREALISATION}), "the bi-realisation to use", default="auto"
        ),
        Field("order", Integer(1, limits.ORDER, limit=True), "order of the method", default=DEFAULT_ORDER),
        Field("terms", Integer(1, limits.ORDER, limit=True), "instead of order: use exactly S_1, …, S_k"),
        Field("composition", _switch("composition", *COMPOSITIONS), "symmetric composition of steps", default="auto"),
        Field(
            "gauge",
            Either({Scalar: _switch("gauge", "auto", "none"), Mapping: FORMULAS}),
            "Casimirs subtracted from H before discretising",
            default="auto",
        ),
        Field("monitor", FORMULA, "equal steps of τ, dt = g dτ: g > 0, or log for a splitting"),
        Field("scheme", _switch("scheme", *SCHEMES), "how the one-step map is made", default="auto"),
        Field(
            "structure",
            _switch("structure", *STRUCTURES),
            "scheme gauss: whether steps are exact Poisson maps, or to truncation only",
            default="exact",
        ),
        Field(
            "profile",
            Choice(PROFILES),
            "fast, or small: short readable code, without blocks and gauge search",
            default="fast",
        ),
        Field("real", Choice(REALS), "the number type of the C; float needs profile: small", default="double"),
        Field("without", ListOf(Choice(PARTS)), "parts of the code to leave out"),
        Field("solver", SOLVER, "the inner solve of a step"),
        Field("tangent", Boolean(), "also generate step_tangent, the derivative of a step", default=False),
        Field(
            "adjoint", Boolean(), "also generate step_adjoint and pullback: gradients of steps and runs", default=False
        ),
        Field(
            "modified_hamiltonian",
            Integer(0, limits.CORRECTIONS, limit=True),
            "also generate the modified Hamiltonian, with this number of corrections",
            default=0,
        ),
        Field(
            "reconstruct",
            Choice(RECONSTRUCTIONS),
            "on the dual of a Lie algebra: also the attitude, as a quaternion (se(3): with the position) or a matrix",
        ),
        Field("targets", ListOf(Choice(tuple(TARGETS)), least=1), "languages of the generated code"),
        Field("runs", MapOf(RUN_NAME, RUN), "named experiments"),
        Field("sweeps", MapOf(RUN_NAME, SWEEP), "runs over ranges of parameters and initial values, for phigen sweep"),
    ),
    one=("order", "terms"),
    elsewhere=_IN_RUNS,
)
