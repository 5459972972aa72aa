"""The fields of the class Solver in JavaScript, in blocks, and the options of its constructor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from phigen.targets import state
from phigen.targets.features import holds


@dataclass(frozen=True)
class Option:
    """Option of the constructor: its name, its type in JSDoc, and a description of one or several lines."""

    name: str
    type: str
    description: str
    required: bool = False

    @property
    def lines(self) -> Iterator[str]:
        """Yield the lines of JSDoc that describe the option."""
        name = f"options.{self.name}" if self.required else f"[options.{self.name}]"
        first, *others = self.description.split("\n")
        yield f"@param {{{self.type}}} {name} {first}"
        yield from (f"  {line}" for line in others)


@dataclass(frozen=True)
class StateFields:
    """Fields of a solver that belong together. ``when`` is a condition on the switches of a solver: if it holds, the
    solver has the fields. The condition "" always holds.

    ``fields`` are lines of the class. ``saved`` are the names of the fields that are restored if a step fails.
    ``options`` are options of the constructor. ``arguments`` are lines of JSDoc that describe additional arguments of a
    step.
    """

    when: str = ""
    fields: tuple[str, ...] = ()
    saved: tuple[str, ...] = ()
    options: tuple[Option, ...] = ()
    arguments: tuple[str, ...] = ()


#: The fields of the class Solver, in blocks, for systems that are no lattices. The class declares its fields in this
#: order.
SOLVER = (
    StateFields(
        options=(
            Option("x0", "ArrayLike<number>", "the coordinates, in the order of COORDINATES", required=True),
            Option("params", "Partial<Parameters>", "parameters that differ from the defaults"),
        ),
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
        (Option("gauge", "ArrayLike<number>", "energy level e, -H(x0) by default"),),
    ),
    StateFields(
        "TIMED",
        ("/** The time of x. */", "t;"),
        options=(Option("t0", "number", "the time of x0, 0 by default"),),
    ),
    StateFields("!TIMED", ("/** Time since the start. */", "t = 0;")),
    StateFields(saved=("t",)),
    StateFields(
        "NOISE",
        (
            "/** The random numbers of a step depend on seed, member and step0 + steps. */",
            "seed = 0;",
            "member = 0;",
            "step0 = 0;",
            "/** The increments of the noise in the last step. */",
            "dw = new Float64Array(DRAWS);",
        ),
        options=(
            Option("seed", "number | bigint", "seed of the random numbers, 64 bits, 0 by default"),
            Option("member", "number", "number of the trajectory, 32 bits, 0 by default"),
            Option("step0", "number", "number of steps made before x0, 0 by default"),
        ),
        arguments=("@param {ArrayLike<number>} [dw] increments of the noise; random ones by default",),
    ),
    StateFields(fields=("/** Number of successful steps since the start. */", "steps = 0;")),
    StateFields("GAUSS", ("/** Number of sweeps over the stages, for statistics. */", "evaluations = 0;")),
    StateFields(
        "IMPLICIT && !GAUSS",
        ("/** Number of evaluations of the step equations, for statistics. */", "evaluations = 0;"),
    ),
    StateFields("EXPLICIT", ("/** Number of computed stages, for statistics. */", "evaluations = 0;")),
    StateFields("SPLITTING", ("/** Number of computed steps, for statistics. */", "evaluations = 0;")),
    StateFields(
        fields=(
            "/** Size of the last step. */",
            "h = NaN;",
            "/** @type {Readonly<Parameters>} */",
            "params;",
        )
    ),
    StateFields("MONITOR", ("/** The energy level e: -H(x0), or the value passed as gauge. */", "gauge;")),
    StateFields(
        "GAUGE && !MONITOR",
        ("/** gauge[k] times Casimir k of GAUGE is subtracted from H. */", "gauge;"),
        options=(
            Option(
                "gauge",
                "ArrayLike<number>",
                "gauge[k] times Casimir k of GAUGE is subtracted from H;\nby default, gauge is chosen for x0. "
                "With a fixed gauge, a step is a Poisson map",
            ),
        ),
    ),
    StateFields(
        "RENEWED && NOISE",
        ("/** For each stage, an array of coefficients; the last ones depend on noise or time. */",),
    ),
    StateFields(
        "RENEWED && !NOISE",
        ("/** For each stage, an array of coefficients; the last ones depend on the time. */",),
    ),
    StateFields(
        "!RENEWED", ("/** For each stage, an array of coefficients. They depend on parameters and step size. */",)
    ),
    StateFields(fields=("coef = emptyTables();",)),
    StateFields("HISTORY", ("/** Predictor of each stage. */", "history = FRACTIONS.map(() => new History());")),
    StateFields(
        "ATTITUDE",
        (
            "/** The attitude that was set last; the product of the rotations since then, and its rounding error. */",
            "firstElement;",
            "turned;",
            "turnedCarry;",
        ),
        ("turned", "turnedCarry"),
        (
            Option(
                "attitude0",
                "ArrayLike<number>",
                "the attitude at x0, a quaternion (w, x, y, z) of any\n"
                "length, or a matrix row by row; the identity by default",
            ),
        ),
    ),
    StateFields(
        "POSITION",
        options=(Option("position0", "ArrayLike<number>", "the position, the origin by default"),),
    ),
    StateFields(
        "RATE_OF_GAUGE",
        (
            "/** Rate of the gauge rotation (gradient of the function subtracted from H), and time when it was set. */",
            "turningRate;",
            "attitudeFrom;",
        ),
    ),
)


#: The options of the constructor for lattices, in blocks. These blocks declare no fields of the class Solver.
LATTICE = (
    StateFields(
        options=(
            Option(
                "x0",
                "ArrayLike<number>",
                "the values of each coordinate at all sites, in the order of\nCOORDINATES",
                required=True,
            ),
            Option(
                "sizes", "number[]", "number of sites along each axis; with one axis,\nit follows from x0 by default"
            ),
            Option("params", "object", "parameters by name: numbers, or arrays of values at sites or bonds"),
        ),
    ),
    StateFields("TIMED", options=(Option("t0", "number", "the time of x0, 0 by default"),)),
    StateFields(
        "NOISE",
        options=(
            Option("seed", "number | bigint", "seed of the random numbers, 64 bits, 0 by default"),
            Option("member", "number", "number of the trajectory, 32 bits, 0 by default"),
            Option("step0", "number", "number of steps made before x0, below 2^48, 0 by default"),
        ),
    ),
    StateFields(
        "GRAPH",
        options=(
            Option(
                "bonds",
                "ArrayLike<number>",
                "the sites at the ends of all bonds, counted from 0: a, b of the\nfirst bond, a, b of the second, …",
                required=True,
            ),
        ),
    ),
)


def _names(blocks: list[StateFields], switches: Mapping[str, bool]) -> Iterator[str]:
    """Yield the line of code that lists the names of the options."""
    yield f'const OPTIONS = "{" ".join(option.name for b in blocks for option in b.options)}".split(" ");'


def _saved(blocks: list[StateFields], switches: Mapping[str, bool]) -> Iterator[str]:
    names = ", ".join(f'"{name}"' for block in blocks for name in block.saved)
    yield f"const SAVED = [{names}];"


#: The functions that return the lines for ``#state NAME`` in the runtime, by NAME.
PARTS: Mapping[str, Callable[[list[StateFields], Mapping[str, bool]], Iterator[str]]] = {
    "fields": lambda blocks, _: (line for b in blocks for line in b.fields),
    "saved": _saved,
    "options": lambda blocks, _: (line for b in blocks for option in b.options for line in option.lines),
    "names": _names,
    "arguments": lambda blocks, _: (line for b in blocks for line in b.arguments),
    "copied": lambda _, switches: iter(state.copied(switches)),
}


def part(name: str, switches: Mapping[str, bool]) -> list[str]:
    """Return the lines that replace the comment ``// #state NAME`` in the runtime of a solver.

    ``name`` is the word in the place of NAME. Names that begin with ``lattice_`` are for solvers of lattices.
    """
    records = LATTICE if name.startswith("lattice_") else SOLVER
    blocks = [block for block in records if not block.when or holds(block.when, switches)]
    return list(PARTS[name.removeprefix("lattice_")](blocks, switches))
