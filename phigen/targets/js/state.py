"""The state of a solver in JavaScript, block by block: its fields, the fields that a failing step restores, its
options."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from phigen.targets import state
from phigen.targets.features import holds


@dataclass(frozen=True)
class StateFields:
    """Fields of a solver that belong together; ``when`` is a condition on switches, empty for all solvers.

    ``fields`` are lines of the class, ``saved`` the names of those that a failing step restores. ``options`` are lines
    that describe options of the constructor, ``arguments`` those of a step.
    """

    when: str = ""
    fields: tuple[str, ...] = ()
    saved: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    arguments: tuple[str, ...] = ()


#: In the order of the fields of the class.
SOLVER = (
    StateFields(
        options=(
            "@param {ArrayLike<number>} options.x0 the coordinates, in the order of COORDINATES",
            "@param {Partial<Parameters>} [options.params] parameters that differ from the defaults",
        )
    ),
    StateFields(
        fields=(
            "/** The state; change it by setState and kick only. */",
            "x;",
            "/** Rounding error of x (compensated summation): x + carry is more accurate. */",
            "carry = new Float64Array(DIM);",
        ),
        saved=("x", "carry"),
    ),
    StateFields(
        "MONITOR",
        (
            "/** Rounding error of t, the physical time since the start. Steps are equal in tau, not in t. */",
            "tCarry = 0;",
        ),
        ("tCarry",),
        ("@param {ArrayLike<number>} [options.gauge] energy level e: steps with one e follow one Hamiltonian",),
    ),
    StateFields(
        "TIMED",
        ("/** The time of x. */", "t;"),
        options=("@param {number} [options.t0] the time of x0, 0 by default",),
    ),
    StateFields("!TIMED", ("/** Time since the start. */", "t = 0;")),
    StateFields(saved=("t",)),
    StateFields(
        "NOISE",
        (
            "/** The random numbers of a step are a function of these three and of the number of steps made before. */",
            "seed = 0;",
            "member = 0;",
            "step0 = 0;",
            "/** The increments of the noise in the last step. */",
            "dw = new Float64Array(DRAWS);",
        ),
        options=(
            "@param {number | bigint} [options.seed] seed of the random numbers, 64 bits, 0 by default",
            "@param {number} [options.member] member of an ensemble, 32 bits, 0 by default",
            "@param {number} [options.step0] number of steps made before x0, 0 by default",
        ),
        arguments=("@param {ArrayLike<number>} [dw] increments of the noise; random ones by default",),
    ),
    StateFields(
        fields=(
            "/** Number of successful steps since the start. */",
            "steps = 0;",
            "/** Number of evaluations of the step equations, or of explicit stages, for statistics. */",
            "evaluations = 0;",
            "/** Size of the last step. */",
            "h = NaN;",
            "/** @type {Readonly<Parameters>} */",
            "params;",
        )
    ),
    StateFields("MONITOR", ("/** The energy level e: -H(x0), or the value passed as gauge. */", "gauge;")),
    StateFields(
        "GAUGE && !MONITOR",
        ("/** Factors of the Casimirs in GAUGE that are subtracted from H. */", "gauge;"),
        options=(
            "@param {ArrayLike<number>} [options.gauge] multiples of one's own: the step is an exact Poisson map",
            "  for each",
        ),
    ),
    StateFields(
        "RENEWED",
        ("/** Coefficients of each stage: functions of parameters and step size; then those of the time or noise. */",),
    ),
    StateFields("!RENEWED", ("/** Coefficients of each stage: functions of parameters and step size. */",)),
    StateFields(fields=("coef = emptyTables();",)),
    StateFields("HISTORY", ("/** Predictor of each stage. */", "history = FRACTIONS.map(() => new History());")),
    StateFields(
        "ATTITUDE",
        (
            "/** The attitude that was set; the product of the rotations since then; its rounding error. */",
            "firstElement;",
            "turned;",
            "turnedCarry;",
        ),
        ("turned", "turnedCarry"),
        (
            "@param {ArrayLike<number>} [options.attitude0] the attitude at x0, a quaternion (w, x, y, z) of any",
            "  length, or a matrix row by row; the identity by default",
        ),
    ),
    StateFields(
        "POSITION",
        options=("@param {ArrayLike<number>} [options.position0] the position, the origin by default",),
    ),
    StateFields(
        "RATE_OF_GAUGE",
        (
            "/** Rate of the gauge rotation, a gradient of Casimirs; the time when it was set. */",
            "turningRate;",
            "attitudeFrom;",
        ),
    ),
)


#: Lattices: their options only.
LATTICE = (
    StateFields(
        options=(
            "@param {ArrayLike<number>} options.x0 one field after the other, in the order of COORDINATES",
            "@param {number[]} [options.sizes] sites along each axis; with one axis those of x0 by default",
            "@param {object} [options.params] parameters; those at sites and at bonds are arrays, or one number",
            "for all",
        )
    ),
    StateFields("TIMED", options=("@param {number} [options.t0] the time of x0, 0 by default",)),
    StateFields(
        "NOISE",
        options=(
            "@param {number | bigint} [options.seed] seed of the random numbers, 64 bits, 0 by default",
            "@param {number} [options.member] member of an ensemble, 32 bits, 0 by default",
            "@param {number} [options.step0] number of steps made before x0, below 2^48, 0 by default",
        ),
    ),
    StateFields(
        "GRAPH",
        options=(
            "@param {ArrayLike<number>} options.bonds the ends of all bonds, counted from 0: a, b of the first, …",
        ),
    ),
)


def _names(blocks: list[StateFields]) -> Iterator[str]:
    """Yield the line with the names of the options."""
    described = [line for block in blocks for line in block.options if line.startswith("@param")]
    names = [line.partition(" options.")[2] or line.partition("[options.")[2] for line in described]
    yield f'const OPTIONS = "{" ".join(name.split()[0].rstrip("]") for name in names)}".split(" ");'


def _saved(blocks: list[StateFields], switches: Mapping[str, bool]) -> Iterator[str]:
    names = ", ".join(f'"{name}"' for block in blocks for name in block.saved)
    yield f"const SAVED = [{names}];"


#: The text that replaces ``#state NAME``, by NAME.
PARTS: Mapping[str, Callable[[list[StateFields], Mapping[str, bool]], Iterator[str]]] = {
    "fields": lambda blocks, _: (line for b in blocks for line in b.fields),
    "saved": _saved,
    "options": lambda blocks, _: (line for b in blocks for line in b.options),
    "names": lambda blocks, _: _names(blocks),
    "arguments": lambda blocks, _: (line for b in blocks for line in b.arguments),
    "copied": lambda _, switches: iter(state.copied(switches)),
}


def part(name: str, switches: Mapping[str, bool]) -> list[str]:
    """Return the lines of one of `PARTS` for a solver; for lattices the name begins with ``lattice_``."""
    records = LATTICE if name.startswith("lattice_") else SOLVER
    blocks = [block for block in records if not block.when or holds(block.when, switches)]
    return list(PARTS[name.removeprefix("lattice_")](blocks, switches))
