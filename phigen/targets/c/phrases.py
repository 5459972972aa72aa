"""Phrases of the runtime in C that depend on features: arguments, types and statements of one line.

The runtime names a phrase (``PHI_AND_STAGE``); what it stands for is written here, once for each feature, and put in
its place in generated code (`phigen.targets.c.macros`). `header` states the same as a header with conditions, for a
compiler that reads the runtime as it lies there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from phigen.targets.c.files import holds


@dataclass(frozen=True)
class Choice:
    """Phrases by names, with the parameters that they have, and their texts.

    Each text belongs to one of the ``conditions`` on switches, of which the first that holds counts; the last text is
    for none.
    """

    about: str
    conditions: tuple[str, ...]
    phrases: Mapping[str, tuple[str, ...]]

    def definitions(self, switches: Mapping[str, bool]) -> Iterator[str]:
        """The definitions for a solver."""
        which = next((k for k, c in enumerate(self.conditions) if holds(c, switches)), len(self.conditions))
        yield from (_definition(name, texts[which]) for name, texts in self.phrases.items())

    def header(self) -> Iterator[str]:
        """The definitions for all solvers."""
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
    "With one stage, code has no loop over stages, no array of one, and no argument for it. OF is a place in an array,"
    " and with STAGES its declaration; IN and TO go from a pointer to the first of several structs, which ADDRESS makes"
    " of their array.",
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
        "STAGE_OF_LANE": ("PHI_STAGES * lane + stage", "lane"),
    },
)

VALUES = Choice(
    "The value of the unknown of a stage in the step that was made last.",
    ("RECURRENCES", "GUESSED"),
    {
        "LAST_VALUE": (
            "PHI_OF(s->history, stage).past[PHI_OF(s->history, stage).count - 1]",
            "PHI_OF(s->history, stage).difference[0]",
            "at->x",
        )
    },
)

#: The time of a lattice after so many steps: counted from the last change of h, so that no rounding adds up.
LATTICE_TIME = "s->t_before_h + (double)(steps - s->steps_before_h) * s->h"

TIME = Choice(
    "H depends on the time, which functions of the model and starts of runs then receive.",
    ("TIMED",),
    {
        "AND_T(t)": (", t", ""),
        "AND_T0": (", double t0", ""),
        "OR_NO_T0": ("|| !isfinite(t0)", ""),
        "INIT_AT(s, params, x, t)": ("phi_init_at(s, params, x, t)", "phi_init(s, params, x)"),
        "ENSEMBLE_AT": ("phi_ensemble_at", "phi_ensemble"),
        "INIT": ("phi_init_at", "phi_init"),
        "TAKE_T0": ("s->t = s->now = t0;", ""),
        "SET_TIME(s)": ("s->t = s->now =", "s->t ="),
        "TIME_AFTER(s, steps)": (LATTICE_TIME, LATTICE_TIME),
    },
)

GAUGE = Choice(
    "A trajectory holds a gauge fixed, which coefficients depend on.",
    ("GAUGE",),
    {
        "AND_GAUGE(gauge)": (", gauge", ""),
        "AND_GAUGE_OF(all, m)": (", all->gauge != NULL ? all->gauge + m * PHI_GAUGES : NULL", ""),
    },
)

LEVEL = Choice(
    "Steps are equal in tau: the energy level e has a derivative, and a step takes the time that it moves.",
    ("MONITOR",),
    {
        "AND_DOUBLE(e_bar)": (", double *e_bar", ""),
        "AND_LEVEL(level)": (", level", ""),
        "PASS(s, elapsed)": ("phi_pass(s, elapsed);", ""),
        "TAKE_LEVEL(s, from)": ("if (!phi_take_level(s, from, carry)) return PHI_BAD_ARGUMENT;", ""),
    },
)

OWN = Choice(
    "Each member of an ensemble has a start of its own in time, or a gauge.",
    ("TIMED", "GAUGE"),
    {
        "OWN_POINTER": ("const double *t0,", "const double *gauge,", ""),
        "INIT_OWN(s, params, x, t, gauge)": (
            "phi_init_at(s, params, x, t)",
            "phi_init_gauge(s, params, x, gauge)",
            "phi_init(s, params, x)",
        ),
        "TAKE_OWN": ("all.t0 = t0;", "all.gauge = gauge;", ""),
    },
)

NOISE = Choice(
    "Noise is drawn once in a step; a run is told which random numbers are its own.",
    ("NOISE",),
    {
        "AND_DW(dw)": (", dw", ""),
        "RENEWAL": ("phi_at_step", "phi_at_time"),
        "ENSEMBLE_OF": ("phi_ensemble_of", "PHI_ENSEMBLE_AT"),
        "RANDOM_NUMBERS": ("uint64_t seed, uint32_t first_member, uint64_t first_step,", ""),
    },
)

ATTITUDE = Choice(
    "The body turns by the Casimirs taken from H too.",
    ("RATE_OF_GAUGE",),
    {"AND_ASIDE(pointer)": (", PHI_AT_FIRST(pointer)", "")},
)

POSITION = Choice(
    "A body has a position beside its attitude.",
    ("POSITION",),
    {"AND_POSITION(position)": (", position", "")},
)

SIDES = Choice(
    "What a factor, given less 1, adds to an element of a group: one of a step, and one from the other side.",
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
    "The row of a lattice that r is the number of, or that a piece is of. One row has no number and no place.",
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
    "What lies beside the sites of a row: nothing, where no site reads of others along it.",
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
    "The doubles of a row, of which those of the sites are a multiple of 8.",
    ("HALO",),
    {"WIDE(sites)": ("PHI_LEAD + (sites + PHI_HALO + 7) / 8 * 8", "sites")},
)

COLOURS = Choice(
    "Sizes of lattices that are multiples of the periods of their colours.",
    ("PERIODIC_COLOURS",),
    {"OR_MISFIT(a)": ("|| sizes[a] % phi_periods[a] != 0", "")},
)

GRAPHS = Choice(
    "The sites of a graph are connected by bonds.",
    ("GRAPH",),
    {
        "SIZES": ("const size_t sizes[PHI_AXES], const phi_bonds *bonds", "const size_t sizes[PHI_AXES]"),
        "SIZES_OF_WORK": ("const size_t sizes[PHI_AXES], size_t bonds", "const size_t sizes[PHI_AXES]"),
        "AND_GRAPH": (", bonds", ""),
        "AND_BONDS": (", bonds != NULL ? bonds->count : 0", ""),
        "OR_TOO_MANY(sites)": ("|| !phi_few(sites, bonds)", ""),
        "OR_UNCONNECTED(sites)": ("|| !phi_connected(bonds, sites)", ""),
    },
)

TABLES = Choice(
    "The bytes of tables beside the fields: of bonds, or of the rows beside each row.",
    ("GRAPH", "!ONE_ROW"),
    {"AND_TABLES": ("+ phi_graph_size(sizes[0], bonds)", "+ rows * PHI_LINES * sizeof(ptrdiff_t)", "")},
)

MATRIX = Choice(
    "The equation of a stage is solved by elimination, in a matrix.",
    ("BANDED",),
    {
        "AND_MATRIX(sites)": ("+ phi_matrix_size(sites)", ""),
        "DOUBLES_OF_SITE": ("(PHI_RESERVED + 8 * PHI_BAND * PHI_DIM)", "PHI_RESERVED"),
    },
)

JOINED = Choice(
    "Steps of flows are joined: what is behind the last flow of a step may stay open.",
    ("SERIES",),
    {"NOT_OPEN(s)": ("", "s->open = 0;")},
)

FAR = Choice(
    "Whether arguments of functions may be large, where functions have another form for them.",
    ("NEAR",),
    {
        "AND_FAR(far)": (", far", ""),
        "AND_INT_FAR": (", int far", ""),
        "TRY_FLOWS": ("phi_close(s)", "phi_try(s, 0)"),
    },
)

PREDICTORS = Choice(
    "Each stage has a predictor of its own, if there are any.",
    ("GUESSES",),
    {"AND_GUESS": ("PHI_AND_STAGE", "")},
)

ALL = (
    STAGES,
    VALUES,
    TIME,
    GAUGE,
    LEVEL,
    OWN,
    NOISE,
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
    FAR,
    PREDICTORS,
)


def definitions(switches: Mapping[str, bool]) -> Iterator[str]:
    """Definitions of all phrases that the switches decide."""
    known = {s: False for choice in ALL for s in _switches(choice)} | dict(switches)
    for choice in ALL:
        yield from choice.definitions(known)


def header() -> str:
    """All phrases as a header of C that has conditions."""
    return "\n".join(line for choice in ALL for line in choice.header())


def _switches(choice: Choice) -> Iterator[str]:
    for condition in choice.conditions:
        yield from (word.removeprefix("!") for word in condition.split() if word not in ("&&", "||"))
