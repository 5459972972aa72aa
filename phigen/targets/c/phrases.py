"""Phrases of the C runtime that depend on features: arguments, types and statements of one line.

A phrase is a macro. The runtime contains its name, such as ``PHI_AND_STAGE``. Its text depends on switches of the
solver, and replaces the name in generated code (`phigen.targets.c.macros`). `header` prints all definitions with
``#if`` conditions, so that a compiler can also read the runtime itself, in which the names are not replaced.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from phigen.targets.features import holds


@dataclass(frozen=True)
class Choice:
    """Macros whose texts depend on the same switches.

    For each macro, ``phrases`` has a text for each of the ``conditions``, and one more text. A solver gets the text for
    the first condition that holds, or the last text if none holds. ``about`` says in a comment what the macros are for.
    """

    about: str
    conditions: tuple[str, ...]
    phrases: Mapping[str, tuple[str, ...]]

    def definitions(self, switches: Mapping[str, bool]) -> Iterator[str]:
        """Yield the ``#define`` lines for a solver."""
        which = next((k for k, c in enumerate(self.conditions) if holds(c, switches)), len(self.conditions))
        yield from (_definition(name, texts[which]) for name, texts in self.phrases.items())

    def header(self) -> Iterator[str]:
        """Yield the ``#define`` lines of the macros for all solvers, with an ``#if`` for each condition."""
        yield f"/* {self.about} */"
        for k, condition in enumerate((*self.conditions, "")):
            expression = " ".join(
                f"PHI_{word}" if word.isupper() else word for word in condition.replace("!", "! ").split()
            )
            yield f"#{'if' if k == 0 else 'elif'} {expression}" if expression else "#else"
            yield from (_definition(name, texts[k]) for name, texts in self.phrases.items())
        yield "#endif"


def _definition(name: str, text: str) -> str:
    return f"#define PHI_{name} {text}".rstrip()


STAGES = Choice(
    "If a step has one stage, code has no loop over stages, no arrays over stages, and no argument for the stage."
    " OF(array, stage) is an entry of an array over stages, or declares the array. ADDRESS is a pointer to the first"
    " struct of an array over stages. From this pointer, TO makes a pointer to the struct of a stage, and IN reads a"
    " member of this struct.",
    ("COMPOSED",),
    {
        "EACH_STAGE": ("for (int stage = 0; stage < PHI_STAGES; ++stage)", ""),
        "EACH_STAGE_BACK": ("for (int stage = PHI_STAGES - 1; stage >= 0; --stage)", ""),
        "AND_STAGE": (", stage", ""),
        "AND_INT_STAGE": (", int stage", ""),
        "OF(array, stage)": ("array[stage]", "array"),
        "ADDRESS(array)": ("array", "&array"),
        "IN(pointer, stage, member)": ("pointer[stage].member", "pointer->member"),
        "TO(pointer, stage)": ("pointer + stage", "pointer"),
        "ROW_OF(pointer, stage)": ("pointer + stage * PHI_ROW", "pointer"),
        "ALL_STAGES(number)": ("(int)PHI_STAGES * number", "number"),
        "FRACTION(h)": ("phi_fractions[stage] * h", "h"),
        "AT_FIRST(pointer)": ("stage == 0 ? pointer : NULL", "pointer"),
        "PER_STAGE": ("/ (double)PHI_STAGES", ""),
        "LENT_BEFORE": ("stage * PHI_DIFFERENCES * PHI_DIM", "0"),
        "STAGE_OF_LANE": ("PHI_STAGES * lane + stage", "lane"),
        "AND_STAGES": (", PHI_STAGES", ""),
        "AND_INT_STAGES": (", int stages", ""),
        "STEP_OF(k)": ("k / PHI_STAGES", "k"),
        "TAKE_STAGE_OF(k)": ("const int stage = (int)(k % PHI_STAGES);", ""),
        "IF_LAST_STAGE": ("if (stage == PHI_STAGES - 1)", ""),
        "AND_ONE_STAGE": (", 1", ""),
    },
)

SWEPT = Choice(
    "If a block is solved by a sweep over the stages of each step: the matrix that passes corrections to the next"
    " stage.",
    ("SWEPT",),
    {"TURN_OF_BLOCK": ("phi_lanes turn[PHI_DIM * PHI_DIM];", ""), "AND_TURN": (", turn", "")},
)

ORDERS = Choice(
    "The starting value of y in a stage is the start of the stage plus half of its increment. The error of this value"
    " is proportional to this power of the size c of the stage.",
    ("CENTRED",),
    {"POWER_OF_STAGE(c)": ("c * c * c", "c * c")},
)

VALUES = Choice(
    "LAST_VALUE is the solution of a stage in the last step, from which predictors start. AND_ITERATION is an argument"
    " of predictors.",
    ("RECURRENCES", "PREDICTED"),
    {
        "LAST_VALUE": (
            "PHI_OF(s->history, stage).past[PHI_OF(s->history, stage).count - 1]",
            "PHI_OF(s->history, stage).difference[0]",
            "at->x",
        ),
        "AND_ITERATION": (", iteration", "", ""),
    },
)

#: Expression for the time of a lattice after a number of steps. The time is counted from the last change of h, so that
#: rounding errors do not accumulate.
LATTICE_TIME = "s->t_before_h + (double)(steps - s->steps_before_h) * s->h"

TIME = Choice(
    "If H depends on the time: the time as an argument of functions of the model, and at the start of runs.",
    ("TIMED",),
    {
        "AND_T(t)": (", t", ""),
        "AND_DOUBLE_T": (", double t", ""),
        "AND_T0": (", double t0", ""),
        "BEGIN_AT_T0(s)": ("s.t = t0;", ""),
        "OR_NO_T0": ("|| !isfinite(t0)", ""),
        "INIT_AT(s, params, x, t)": ("phi_init_at(s, params, x, t)", "phi_init(s, params, x)"),
        "ENSEMBLE_AT": ("phi_ensemble_at", "phi_ensemble"),
        "INIT": ("phi_init_at", "phi_init"),
        "TAKE_T0": ("s->t = s->now = t0;", ""),
        "SET_TIME(s)": ("s->t = s->now =", "s->t ="),
        "TIMES_OF_SLOPES": ("static const double after[4] = { 0.0, 0.5, 0.5, 1.0 };", ""),
        "BEGIN_OF_STAGES(s)": ("double begin = s->t;", ""),
        "NEXT_BEGIN(h)": ("begin += h;", ""),
    },
)

PASSING = Choice(
    "The time of a lattice. With a monitor, steps are equal in tau, and a clock adds up the physical times of the"
    " flows.",
    ("MONITOR",),
    {"TIME_AFTER(s, steps)": ("s->clock[0] + s->clock[1]", LATTICE_TIME)},
)

LATE = Choice(
    "With a monitor, the duration of a flow varies along a tangent vector. Where coefficients are computed without this"
    " variation, the argument that contains it is 0.",
    ("LATE",),
    {"AND_ON_TIME": (", phi_on_time", "")},
)

GAUGE = Choice(
    "If the coefficients of a trajectory depend on its gauge, which is constant: arguments and copies of the gauge.",
    ("GAUGE",),
    {
        "AND_GAUGE(gauge)": (", gauge", ""),
        "CHOOSE_GAUGE(s)": ("if (gauge == NULL) phi_choose_gauge(&s.params, s.x, s.gauge);", ""),
        "TAKE_GAUGE(s)": ("else PHI_COPY(s.gauge, gauge, s.gauge, PHI_GAUGES);", ""),
        "ASK_FOR_GAUGE(s)": ("if (!phi_finite(s.gauge, PHI_GAUGES)) return PHI_BAD_ARGUMENT;", ""),
        "AND_GAUGE_OF(all, m)": (", all->gauge != NULL ? all->gauge + m * PHI_GAUGES : NULL", ""),
        "COPY_GAUGE(to, from)": ("memcpy(to, from, sizeof to);", ""),
        "GAUGES_OF_MEMBERS": ("double gauge[PHI_LANES][PHI_GAUGES]; /* of each member */", ""),
    },
)

LEVEL = Choice(
    "With a monitor, steps are equal in tau. The physical time of a step depends on the state, and derivatives by the"
    " energy level e are computed.",
    ("MONITOR",),
    {
        "AND_DOUBLE(e_bar)": (", double *e_bar", ""),
        "AND_LEVEL(level)": (", level", ""),
        "AND_E_BAR": (", e_bar", ""),
        "AND_NO_LEVEL": (", NULL", ""),
        "COUNT_TIME(s)": ("", "s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;"),
        "TIME_OF(s)": ("phi_solver_time(s)", "s->t"),
        "IN_TAU(time, s)": ("time / (double)phi_monitor(&s.params, s.x)", "time"),
        "TAKE_RATE_OF_TIME(s)": ("if (!phi_time_passes(&s.params, s.x)) return PHI_BAD_ARGUMENT;", ""),
        "PASS(s, elapsed)": ("phi_pass(s, elapsed);", ""),
        "TAKE_LEVEL(s, from)": ("if (!phi_take_level(s, from, carry)) return PHI_BAD_ARGUMENT;", ""),
        "ELAPSED_OF_BLOCK": ("phi_lanes elapsed, lost;", ""),
        "ELAPSE": ("if (!phi_elapse(s, table, PHI_ADDRESS(model), elapsed, lost)) return 0;", ""),
        "BAR_OF_LEVEL": ("double level[1];", ""),
        "ADD_BAR_OF_LEVEL(e_bar)": ("if (e_bar != NULL) *e_bar += level[0];", ""),
        "E_BAR_FROM_ZERO": ("double e_bar = 0.0;", ""),
        "AND_TO_E_BAR": (", &e_bar", ""),
    },
)

OWN = Choice(
    "The initial time, or the gauge, of each member of an ensemble.",
    ("TIMED", "GAUGE"),
    {
        "OWN_POINTER": ("const double *t0,", "const double *gauge,", ""),
        "INIT_OWN(s, params, x, t, gauge)": (
            "phi_init_at(s, params, x, t)",
            "phi_init_gauge(s, params, x, gauge)",
            "phi_init(s, params, x)",
        ),
        "TAKE_OWN": ("all.t0 = t0;", "all.gauge = gauge;", ""),
        "ASK_FOR_OWN": ("if (members > 0 && t0 == NULL) return PHI_BAD_ARGUMENT;", "", ""),
        "INIT_FROM": ("phi_init_at", "phi_init_gauge", "phi_init"),
        "AND_START": (", double t0", ", const double gauge[PHI_GAUGES]", ""),
        "AND_USUAL_START": (", 0.0", ", NULL", ""),
    },
)

NOISE = Choice(
    "With noise, increments are drawn once in a step; a run receives the seed and the numbers of member and step.",
    ("NOISE",),
    {
        "AND_DW(dw)": (", dw", ""),
        "DRAW": ("if (!phi_draw(s, dw)) return PHI_END_RUN(PHI_BAD_ARGUMENT);", ""),
        "NEXT_DRAW": ("if (dw != NULL) dw += PHI_DRAWS;", ""),
        "RENEWAL": ("phi_at_step", "phi_at_time"),
        "ENSEMBLE_OF": ("phi_ensemble_of", "PHI_ENSEMBLE_AT"),
        "RANDOM_NUMBERS": ("uint64_t seed, uint32_t first_member, uint64_t first_step,", ""),
    },
)

PARAMETERS = Choice(
    "The check of parameters at the start: the model allows them, and all coefficients are finite.",
    ("PARAMETERS",),
    {
        "TRY_PARAMETERS(s)": ("phi_prepare(&s.params PHI_AND_GAUGE(s.gauge), PHI_PROBE_STEP, PHI_OF(s.coef, 0));", ""),
        "OR_BAD_PARAMETERS(s)": (
            "|| !phi_allowed(&s.params) || !phi_finite(PHI_OF(s.coef, 0), PHI_COEFFICIENTS)",
            "",
        ),
        "SUMS_OF_PARAMETERS": ("double sums[sizeof(phi_params) / sizeof(double)] = { 0.0 };", "(void)params_bar;"),
        "TAKE_SUMS(sums, bar)": ("if (bar != NULL) memcpy(sums, bar, sizeof *bar);", ""),
        "ADD_TO_SUMS(sums, more)": (
            "for (size_t i = 0; i < sizeof sums / sizeof sums[0]; ++i) sums[i] += more[i];",
            "",
        ),
        "GIVE_SUMS(bar, sums)": ("if (bar != NULL) memcpy(bar, sums, sizeof *bar);", ""),
        "NO_NAMED_PARAMETERS(bar)": ("", "(void)bar;"),
    },
)

UNUSED_PARAMETERS = Choice(
    "If nothing depends on parameters, derivatives by parameters are an unused argument.",
    ("PARAMETERS || MONITOR",),
    {"NO_PARAMETERS(bar)": ("", "(void)bar;")},
)

UNUSED_GROUP = Choice(
    "If there is a gauge but no parameter, the reverse pass of a group of members does not use its argument `group`.",
    ("GAUGE && !PARAMETERS && !MONITOR",),
    {"NO_GROUP(group)": ("(void)group;", "")},
)

KICKS = Choice(
    "If coefficients of the flows of a splitting also depend on the square of h: the multiple of the square as an"
    " argument.",
    ("KICKS",),
    {"KICK(k, h)": ("const double kick[1] = { phi_multiples[k] * (h * h) };", ""), "AND_KICK": (", kick", "")},
)

TAPE = Choice(
    "What one step writes to the tape of the reverse pass, and the call of the reverse pass of one step.",
    ("SPLITTING", "GAUSS"),
    {
        "RECORD_OF_STEP": (
            "double phi_step_tape[PHI_FLOWS][PHI_DIM]",
            "double phi_step_tape[PHI_TRAIL]",
            "double PHI_OF(phi_step_tape, PHI_STAGES)[PHI_DIM]",
        ),
        "STEP_BACK(s, tape, bar)": (
            "phi_stage_adjoint(s->coef, tape, bar, bar->coef)",
            "phi_stage_adjoint(s, tape, bar)",
            "phi_stages_adjoint(s, tape, bar)",
        ),
        "AND_STARTS_OF_BATCHES": (", &bar", "", ""),
    },
)

BATCHES = Choice(
    "The reverse pass of an ensemble is vectorised over batches of members.",
    ("BATCHED",),
    {
        "BACK_MEMBERS": ("PHI_BACK_GROUP", "1"),
        "PULL_MEMBERS(all, m)": ("phi_pull_group(all, m)", "phi_pull_member(all, m)"),
    },
)

PACKS = Choice(
    "A batch has several SIMD packs of members.",
    ("PACKS",),
    {"COUNT_PACKS(group, count)": ("group.packs = (count + PHI_LANES - 1) / PHI_LANES;", "")},
)

RECOMPUTED = Choice(
    "If the reverse pass recomputes states by inverse flows, a segment between checkpoints has at least 16 steps.",
    ("RECOMPUTED",),
    {"STEPS_OF_SEGMENT(steps)": ("16 + steps", "steps")},
)

RENEWED = Choice(
    "If coefficients depend on the time: the time in the middle of the stage in each lane.",
    ("RENEWED",),
    {"NOTE_TIME_OF_LANE(g, at)": ("g->t[lane] = at->t + PHI_OF(phi_middles, stage) * at->h;", "")},
)

PATHS = Choice(
    "If stages are paths, the reverse pass of a path begins at the state where the path ended.",
    ("PATH",),
    {
        "NOTE_START(bar, g)": ("bar->end[i] = g->start[i][lane];", ""),
        "BEGIN_PATHS_BACK(bar, s)": ("memcpy(bar.end, s->x, sizeof bar.end);", ""),
    },
)

GAINS = Choice(
    "The corrections of the increments of a block of steps. Sparse elimination has computed them already.",
    ("SPARSE",),
    {
        "GAIN(model)": ("", "phi_lanes gained[PHI_DIM]; phi_gain(model, model->residual, gained);"),
        "GAINED(model)": ("model->gained", "gained"),
    },
)

RUN = Choice(
    "The function that makes steps one by one. Its last argument points to the increments of the noise, or to the tape"
    " for the states before all flows.",
    ("BLOCKS", "NOISE", "SPLITTING && ADJOINT"),
    {
        "RUN": (
            "static phi_status phi_single_steps",
            "phi_status phi_integrate_along",
            "static phi_status phi_integrate_recording",
            "phi_status phi_integrate",
        ),
        "AND_RECORD": ("", ", const double *dw", ", double (*tape)[PHI_DIM]", ""),
        "ABOUT_RUN": (
            "/* Make steps one by one. */",
            "",
            "/* As phi_integrate; also writes the state before each flow to tape, unless tape is NULL. */",
            "",
        ),
    },
)

STEP = Choice(
    "One step of a run, and what happens after it. If the method has one explicit stage, the step is written in place.",
    ("EXPLICIT && !COMPOSED", "CORRECTED && ADJOINT", "SPLITTING && ADJOINT", "COMPOSED || SPLITTING"),
    {
        "NAME_INCREMENT": ("double increment[PHI_DIM];", *[""] * 4),
        "COMPUTE_INCREMENT(s)": ("phi_explicit(PHI_COEFFICIENTS_OF(s), s->x, increment);", *[""] * 4),
        "COUNT_EVALUATION(s)": ("++s->evaluations;", *[""] * 4),
        "MAKE_STEP(s)": (
            "",
            "const phi_status status = phi_stages(s, tape != NULL ? tape + PHI_BEGUN : NULL);",
            "const phi_status status = phi_stages(s, tape);",
            "const phi_status status = phi_stages(s);",
            "const phi_status status = phi_stage(s);",
        ),
        "END_IF_STEP_FAILED(s)": (
            "if (!phi_advance(s, increment, s->carry)) return PHI_END_RUN(PHI_NOT_FINITE);",
            *["if (status != PHI_OK) return PHI_END_RUN(status);"] * 4,
        ),
        "NEXT_RECORD": ("", *["if (tape != NULL) tape += PHI_FLOWS;"] * 2, "", ""),
    },
)

CORRECTORS = Choice(
    "With correctors, the tape of a step has room for the flows before and after a run. The reverse pass goes through"
    " these flows at the states that a run returned, since correctors were applied there.",
    ("CORRECTED && ADJOINT",),
    {
        "AND_TAPE": (", tape", ""),
        "AND_TAPE_AT(place)": (", tape != NULL ? tape + (place) : NULL", ""),
        "AND_STATES_TAPE": (", double (*tape)[PHI_DIM]", ""),
        "FIRST_FLOW": ("PHI_BEGUN", "0"),
        "LAST_FLOW": ("(PHI_FLOWS - PHI_BEGUN - 1)", "(PHI_FLOWS - 1)"),
        "CORRECTOR_AFTER_BACK": (
            "if (done == steps || done % stride == 0)"
            " phi_flows_back(s->coef, tape[done - 1], PHI_FLOWS - PHI_BEGUN, PHI_FLOWS - 1, bar, bar->coef);",
            "",
        ),
        "CORRECTOR_BEFORE_BACK": (
            "if ((done - 1) % stride == 0) phi_flows_back(s->coef, tape[done - 1], 0, PHI_BEGUN - 1, bar, bar->coef);",
            "",
        ),
    },
)

ENDS = Choice(
    "What a run does before its first step and after its last step: correctors, and the update of the public attitude.",
    ("CORRECTED", "ATTITUDE && !BLOCKS"),
    {
        "BEFORE_RUN": ("const phi_solver before = *s;", "", ""),
        "CORRECT_START": ("if (steps > 0 && phi_correct(s, 0 PHI_AND_TAPE) != PHI_OK) return PHI_NOT_FINITE;", "", ""),
        "END_RUN(status)": ("phi_end_run(s, &before, status PHI_AND_TAPE)", "phi_end_turning(s, status)", "status"),
    },
)

CHAPTERS = Choice(
    "Titles of chapters by the kind of step.",
    ("GAUSS", "IMPLICIT", "SPLITTING"),
    {
        "CHAPTER_OF_ALGEBRA": (
            "/* ---- Compensated sums ---- */",
            "/* ---- Compensated sums, linear equations ---- */",
            "/* ---- The explicit step ---- */",
            "/* ---- The solver ---- */",
        ),
        "CHAPTER_OF_SOLVER": (*["/* ---- The solver ---- */"] * 3, ""),
    },
)

ATTITUDE = Choice(
    "If Casimirs are subtracted from H, the attitude has an additional rotation, the gauge rotation.",
    ("RATE_OF_GAUGE",),
    {
        "AND_ASIDE(pointer)": (", PHI_AT_FIRST(pointer)", ""),
        "AND_DOUBLE_ASIDE": (", const double *aside", ""),
        "AND_ASIDE_OF_BLOCK": (", k == 0 ? s->aside_of_block : NULL", ""),
    },
)

POSITION = Choice(
    "If the state of motion of a body includes its position: the position as an argument.",
    ("POSITION",),
    {"AND_POSITION(position)": (", position", "")},
)

FRAME = Choice(
    "The order of products of group elements. It depends on whether momenta are in space or in body coordinates.",
    ("SPATIAL",),
    {
        "INTO_CONSTANT_FRAME(q, element)": (
            "const double q[4] = { element[0], -element[1], -element[2], -element[3] };",
            "const double *q = element;",
        ),
        "READ_PRODUCT(s)": (
            "phi_group_product(s->turned, s->first, s->attitude);",
            "phi_group_product(s->first, s->turned, s->attitude);",
        ),
        "PRODUCT_WITH_TRANSPOSE(g, i, j, k, N)": ("g[i * N + k] * g[j * N + k]", "g[k * N + i] * g[k * N + j]"),
    },
)

ASIDE = Choice(
    "The gauge rotation of a block of steps.",
    ("BLOCKS",),
    {"SET_ASIDE_OF_BLOCK(s)": ("phi_uniform(s->rate, (double)PHI_AHEAD * s->h, s->aside_of_block);", "")},
)

SIDES = Choice(
    "The change of a group element if it is multiplied by a factor. The argument is the factor minus the identity."
    " The factor of a step and the factor of the gauge rotation are on opposite sides of the element.",
    ("POSITION && SPATIAL", "POSITION", "SPATIAL"),
    {
        "ADDED_FACTOR(element, factor, change)": (
            "phi_added_left(element, factor, change)",
            "phi_added_right(element, factor, change)",
            "phi_group_product(factor, element, change)",
            "phi_group_product(element, factor, change)",
        ),
        "ADDED_ASIDE(element, factor, change)": (
            "phi_added_right(element, factor, change)",
            "phi_added_left(element, factor, change)",
            "phi_group_product(element, factor, change)",
            "phi_group_product(factor, element, change)",
        ),
    },
)

ROWS = Choice(
    "Row number r of a lattice, or the row of a segment. A lattice of a single row needs no number and no offset.",
    ("ONE_ROW",),
    {
        "EACH_ROW": ("", "for (size_t r = 0; r < s->rows; ++r)"),
        "WHOLE_ROW": ("phi_row_of(s)", "phi_piece_of(s, r)"),
        "ROW_AT(first)": ("first", "first + (ptrdiff_t)r * s->width"),
        "VALUES_AT(first)": ("first", "first + r * (size_t)s->length"),
        "HERE(first)": ("first", "first + row.at[0]"),
        "SITE(i)": ("i", "row.at[0] + i"),
        "DOUBLES": ("(size_t)s->width", "s->rows * (size_t)s->width"),
        "BEYOND": ("s->width", "(ptrdiff_t)s->rows * s->width"),
        "LAST_AXIS": ("0", "PHI_AXES - 1"),
    },
)

HALO = Choice(
    "The halo beyond the ends of a row. There is none if sites read no neighbours along the row.",
    ("HALO",),
    {
        "MEMORY_OF(first)": ("first - PHI_LEAD", "first"),
        "FIRST_SITE(memory)": ("memory + PHI_LEAD", "memory"),
        "LEAST": ("-PHI_LEAD", "0"),
        "FIRST_COPY(site)": ("site - PHI_HALO", "site"),
        "LEAST_COPY": ("-PHI_HALO", "0"),
        "AND_COPIES(sites)": ("sites + PHI_HALO", "sites"),
        "WITH_COPIES(sites)": ("sites + 2 * PHI_HALO", "sites"),
        "COPY_ENDS(row, length, from, to)": ("phi_ends(row, length, from, to);", ""),
    },
)

WIDTH = Choice(
    "The number of doubles in a row with its halo. The sites and the halo after them take a multiple of 8 doubles.",
    ("HALO",),
    {"WIDE(sites)": ("PHI_LEAD + (sites + PHI_HALO + 7) / 8 * 8", "sites")},
)

COLOURS = Choice(
    "The check that sizes of a lattice are multiples of the periods of its colours.",
    ("PERIODIC_COLOURS",),
    {"OR_MISFIT(a)": ("|| sizes[a] % phi_periods[a] != 0", "")},
)

GRAPHS = Choice(
    "If the lattice is a graph: its bonds as arguments, and their checks.",
    ("GRAPH",),
    {
        "SIZES": ("const size_t sizes[PHI_AXES], const phi_bonds *bonds", "const size_t sizes[PHI_AXES]"),
        "SIZES_OF_WORK": ("const size_t sizes[PHI_AXES], size_t bonds", "const size_t sizes[PHI_AXES]"),
        "AND_GRAPH": (", bonds", ""),
        "AND_BONDS": (", bonds != NULL ? bonds->count : 0", ""),
        "AND_NUMBER_OF_BONDS": (", (size_t)s->bonds[s->sites] / 2", ""),
        "OR_TOO_MANY(sites)": ("|| !phi_few(sites, bonds)", ""),
        "OR_UNCONNECTED(sites)": ("|| !phi_connected(bonds, sites)", ""),
    },
)

TABLES = Choice(
    "The bytes of tables in the memory of a lattice: of bonds, or of the neighbouring rows of each row.",
    ("GRAPH", "!ONE_ROW"),
    {"AND_TABLES": ("+ phi_graph_size(sizes[0], bonds)", "+ rows * PHI_LINES * sizeof(ptrdiff_t)", "")},
)

MATRIX = Choice(
    "If the equation of a stage is solved by elimination: the memory for the matrix.",
    ("BANDED",),
    {
        "AND_MATRIX(sites)": ("+ phi_matrix_size(sites)", ""),
        "DOUBLES_OF_SITE": ("(PHI_RESERVED + 8 * PHI_BAND * PHI_DIM)", "PHI_RESERVED"),
    },
)

JOINED = Choice(
    "In a splitting, the last flow of a step is merged with the first flow of the next step; here no flow is pending.",
    ("SERIES",),
    {"NOT_OPEN(s)": ("", "s->open = 0;"), "NOT_FULL_RANGE(s)": ("", "s->full_range = 0;")},
)

MOMENTA = Choice(
    "If bodies have momenta, masses must be positive: velocities are momenta divided by masses.",
    ("MOMENTA",),
    {"OR_NO_MASS(mass)": ("|| !(mass > 0.0)", "")},
)

FULL_RANGE = Choice(
    "If functions have versions for small arguments: the flag full_range, which is 1 if arguments may be large.",
    ("NEAR",),
    {
        "AND_FULL_RANGE(full_range)": (", full_range", ""),
        "AND_INT_FULL_RANGE": (", int full_range", ""),
        "TRY_FLOWS": ("phi_close(s)", "phi_try(s, 0)"),
    },
)

MEMORY = Choice(
    "Copies of arrays, tables, and the default parameters. Languages for devices have no functions for memory, have"
    " tables in another address space, and have no pointer to the defaults.",
    ("DEVICE",),
    {
        "COPY(to, from, array, count)": ("phi_copy(to, from, count)", "memcpy(to, from, sizeof array)"),
        "COPY_FIRST(to, from, count)": ("phi_copy(to, from, count)", "memcpy(to, from, count * sizeof to[0])"),
        "COPY_ENTRIES(to, from, count)": (
            "phi_copy(to, from, count)",
            "memcpy(to, from, (size_t)count * sizeof to[0])",
        ),
        "CLEAR_FIRST(array, count)": ("phi_clear(array, count)", "memset(array, 0, count * sizeof array[0])"),
        "COPY_STAGES(to, from, array)": (
            "phi_copy(to[0], from[0], PHI_UNKNOWNS * PHI_WIDTH)",
            "memcpy(to, from, sizeof array)",
        ),
        "CLEAR_STAGES(z)": ("phi_clear(z[0], PHI_UNKNOWNS * PHI_WIDTH)", "memset(z, 0, sizeof z)"),
        "CLEAR_STAGE(array)": ("phi_clear(array, PHI_WIDTH)", "memset(array, 0, sizeof array)"),
        "TAKE_INCREMENTS(to, from)": ("phi_copy(to, from, PHI_DRAWS)", "memmove(to, from, sizeof to)"),
        "UNROLL": ("phi_UNROLL", ""),
        "LOCAL_TABLE": ("const", "static const"),
        "TABLE": ("PHI_TABLE_POINTER", "const"),
        "FORGET(history)": (
            "PHI_EACH_STAGE phi_forget(&PHI_OF(history, stage))",
            "memset(&history, 0, sizeof history)",
        ),
        "EMPTY(s)": ("phi_empty(&s);", "memset(&s, 0, sizeof s);"),
        "DEFAULT_PARAMETERS": ("", "if (params == NULL) params = &phi_default_params;"),
    },
)

DEVICE_STARTS = Choice(
    "The initial time, or the gauge, of each member of an ensemble on a device.",
    ("TIMED", "GAUGE"),
    {
        "OWN_STARTS": (
            "PHI_GLOBAL const double *t0, int start_per_member,",
            "PHI_GLOBAL const double *gauge, int start_per_member,",
            "",
        ),
        "GAUGE_OF_MEMBER(level)": (
            "",
            "double level[PHI_GAUGES]; phi_gauge_of(&member, start,"
            " gauge != NULL && start_per_member ? gauge + m * PHI_GAUGES : gauge, level);",
            "",
        ),
    },
)

DEVICE_COEFFICIENTS = Choice(
    "The coefficients of a step. On a device, all members may share coefficients, which are then an argument of the"
    " kernel.",
    ("COMMON",),
    {
        "COEFFICIENTS_OF(s)": ("phi_COEF_OF(s)", "s->coef"),
        "COMMON_MEMBER": ("phi_COMMON_MEMBER", ""),
        "COMMON_ARGUMENT": ("phi_COMMON_ARGUMENT ", ""),
        "TAKE_COMMON(s)": ("phi_TAKE_COMMON(s)", ""),
    },
)

COMMON_GAUGE = Choice(
    "The gauge that all members on a device have, as an argument.",
    ("GAUGE",),
    {
        "GAUGE_ARGUMENT": ("PHI_GLOBAL const double *gauge, ", ""),
        "COPY_OF_GAUGE": ("double gauges[PHI_GAUGES]; for (int k = 0; k < PHI_GAUGES; ++k) gauges[k] = gauge[k];", ""),
    },
)

DEVICE_NOISE = Choice(
    "The random numbers of a member on a device.",
    ("NOISE",),
    {"SET_NOISE(s)": ("phi_set_noise(s, seed, first_member + (uint32_t)m, first_step);", "")},
)

DEVICE_MEMORY = Choice(
    "The shared memory of a device in which the predictors of members are stored.",
    ("PREDICTED && !GAUSS",),
    {
        "LENT_MEMORY": ("PHI_SHARED_ARRAY double memory[PHI_LENT * PHI_GROUP];", ""),
        "LEND(s)": ("phi_lend(s, memory);", ""),
    },
)

DEVICE_PREDICTOR = Choice(
    "The statement that makes a predictor on a device start again.",
    ("GAUSS",),
    {"FORGET_ORDER(history)": ("", "history->order = 0;")},
)

STAGE_PREDICTORS = Choice(
    "Gauss steps with stages in lanes choose one of several predictors, which read one or two steps. All other Gauss"
    " steps have one predictor, which reads the last step.",
    ("STAGED",),
    {
        "PREDICT(past, z)": (
            "phi_predict(past, past->count < PHI_EARLIER ? PHI_PREDICTORS - 1 : past->predictor, z)",
            "phi_mixed(phi_prediction, past->increments, z)",
        ),
        "PREDICTOR_BY_ONE": ("phi_prediction[PHI_PREDICTORS - 1]", "phi_prediction"),
        "LAST_INCREMENTS(past)": ("past->increments[past->latest]", "past->increments"),
    },
)

SWEEPS = Choice(
    "Some sweeps of a Gauss step iterate over part of the unknowns only, and read time integrals of these unknowns. All"
    " other sweeps iterate over all unknowns.",
    ("REDUCED",),
    {
        "ITERATED_COUNT": ("PHI_ITERATED", "PHI_UNKNOWNS"),
        "READ_COUNT": ("PHI_READS", "PHI_UNKNOWNS"),
        "FACTOR_COUNT": ("PHI_FACTORS", "1"),
        "SET_FACTORS(h, factors)": (
            "phi_set_factors(h, factors);",
            "for (int i = 0; i < PHI_NODES; ++i) factors[0][i] = h * phi_weights[i];",
        ),
        "ITERATES(now, increments)": ("phi_lanes now[PHI_ITERATED];", "phi_lanes *now = increments;"),
        "SWEEP(s, point, factors, z, now)": (
            "phi_reduced_field_lanes(s->coef, point, z, factors, factors + 1, now)",
            "phi_slopes(s, point, factors, z, now)",
        ),
        "READ_INCREMENTS(now, z)": ("phi_read(now, z)", "phi_mixed(phi_mixing, now, z)"),
    },
)

LIFTS = Choice(
    "The weight of squared changes of group elements in the error measure. Group elements have the size 1, or that of"
    " their frames.",
    ("LIFTED",),
    {"ELEMENT_SCALE(s)": ("phi_element_scale(s)", "1.0")},
)

_SHIFT = "for (int i = 0; i < PHI_DIM; ++i) {}.difference[0][i] += s->x[i] - from[i];"
SHIFTED = Choice(
    "If the state is set or kicked, predictors are shifted by the change of the state.",
    ("RECURRENCES", "PREDICTED && !GAUSS && COMPOSED", "PREDICTED && !GAUSS"),
    {
        "SHIFT_PREDICTORS(s, from)": (
            "phi_shift_predictors(s, from);",
            f"PHI_EACH_STAGE {_SHIFT.format('s->history[stage]')}",
            _SHIFT.format("s->history"),
            "",
        )
    },
)

PREDICTORS = Choice(
    "If stages of a lattice have predictors: the stage as an argument.",
    ("SWEEP_PREDICTORS",),
    {"AND_PREDICTOR": ("PHI_AND_STAGE", "")},
)

ALL = (
    GAINS,
    PATHS,
    RENEWED,
    RECOMPUTED,
    PACKS,
    BATCHES,
    TAPE,
    KICKS,
    UNUSED_GROUP,
    UNUSED_PARAMETERS,
    ORDERS,
    SWEPT,
    ASIDE,
    FRAME,
    STAGES,
    VALUES,
    TIME,
    PASSING,
    LATE,
    GAUGE,
    LEVEL,
    OWN,
    NOISE,
    PARAMETERS,
    RUN,
    STEP,
    CORRECTORS,
    ENDS,
    CHAPTERS,
    ATTITUDE,
    POSITION,
    SIDES,
    ROWS,
    HALO,
    WIDTH,
    COLOURS,
    GRAPHS,
    TABLES,
    MATRIX,
    JOINED,
    MOMENTA,
    FULL_RANGE,
    STAGE_PREDICTORS,
    SWEEPS,
    LIFTS,
    PREDICTORS,
    SHIFTED,
    MEMORY,
    DEVICE_STARTS,
    DEVICE_COEFFICIENTS,
    COMMON_GAUGE,
    DEVICE_NOISE,
    DEVICE_MEMORY,
    DEVICE_PREDICTOR,
)


def definitions(switches: Mapping[str, bool]) -> Iterator[str]:
    """Yield the ``#define`` lines of all phrases for a solver with these switches."""
    known = {s: False for choice in ALL for s in _switches(choice)} | dict(switches)
    for choice in ALL:
        yield from choice.definitions(known)


def names() -> frozenset[str]:
    """Return the names of all phrases (macros of the C runtime), without their parameters."""
    return frozenset(f"PHI_{phrase.partition('(')[0]}" for choice in ALL for phrase in choice.phrases)


def header() -> str:
    """Return a C header that defines all phrases. Lines with ``#if`` select the texts by the features of the solver."""
    return "\n".join(line for choice in ALL for line in choice.header())


def _switches(choice: Choice) -> Iterator[str]:
    for condition in choice.conditions:
        yield from (word.removeprefix("!") for word in condition.split() if word not in ("&&", "||"))
