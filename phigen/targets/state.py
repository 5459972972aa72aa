"""The members of the struct of a solver in generated code, in blocks, with the code that copies and resets them.

A solver has the blocks whose condition holds for its switches. In C the blocks determine three things: the members of
the struct; the code that restores them if a stage of a step fails; and the statements for a new step size. In
JavaScript they determine the fields of a copy of a solver.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from phigen.targets.features import holds


@dataclass(frozen=True)
class StateBlock:
    """Members of the struct of a solver that belong together. ``when`` is a condition on the switches of a solver: if
    it holds, the solver has the members. The condition "" always holds.

    ``members`` are declarations in C, with comments for users. ``saved`` are the members that are restored if a step
    fails. They are pairs: the name, and the length of an array or "" for a number. ``reset`` are statements for a new
    step size. ``copied`` are the statements of JavaScript that copy the fields to another solver.
    """

    name: str
    when: str = ""
    members: tuple[str, ...] = ()
    saved: tuple[tuple[str, str], ...] = ()
    reset: tuple[str, ...] = ()
    copied: tuple[str, ...] = ()

    def save(self) -> Iterator[str]:
        """Yield the statements that copy members of the struct to local variables before a step. The field ``saved``
        lists these members.
        """
        arrays = [f"{member}[{size}]" for member, size in self.saved if size]
        numbers = [f"{member} = s->{member}" for member, size in self.saved if not size]
        yield from [f"double {', '.join(arrays)};"] if arrays else []
        yield from [f"const double {', '.join(numbers)};"] if numbers else []
        yield from (f"PHI_COPY({member}, s->{member}, {member}, {size});" for member, size in self.saved if size)

    def restore(self) -> Iterator[str]:
        """Yield the statements that copy the local variables back to the struct. The field ``saved`` lists the members
        that are copied.
        """
        for member, size in self.saved:
            yield f"PHI_COPY(s->{member}, {member}, {member}, {size});" if size else f"s->{member} = {member};"


_COEFFICIENTS = "double PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS];"

#: The members of the struct of a solver, in blocks. The struct declares its members in this order.
STATE = (
    StateBlock(
        "x",
        members=(
            "double x[PHI_DIM];     /* the state; change it only by the functions below */",
            "double carry[PHI_DIM]; /* rounding error of x: x + carry is more accurate */",
            "size_t steps;          /* number of successful steps since phi_init */",
        ),
        saved=(("x", "PHI_DIM"), ("carry", "PHI_DIM")),
        copied=("twin.carry.set(this.carry);",),
    ),
    StateBlock(
        "evaluations", "GAUSS", ("size_t evaluations;    /* number of sweeps over the stages, for statistics */",)
    ),
    StateBlock(
        "evaluations",
        "IMPLICIT && !GAUSS",
        ("size_t evaluations;    /* number of evaluations of the generating function, for statistics */",),
    ),
    StateBlock(
        "evaluations",
        "!IMPLICIT && !GAUSS && !SPLITTING",
        ("size_t evaluations;    /* number of computed stages, for statistics */",),
    ),
    StateBlock("evaluations", "SPLITTING", ("size_t evaluations;    /* number of computed steps, for statistics */",)),
    StateBlock(
        "t",
        "MONITOR",
        ("double t, t_carry;     /* t + t_carry is the physical time since phi_init; steps are equal in tau */",),
        saved=(("t", ""), ("t_carry", "")),
        copied=("twin.tCarry = this.tCarry;",),
    ),
    StateBlock("t", "TIMED && !MONITOR", ("double t;              /* the time of x */",)),
    StateBlock("t", "!TIMED && !MONITOR", ("double t;              /* time since phi_init */",)),
    StateBlock(
        "noise",
        "NOISE",
        (
            "uint64_t seed, first_step; /* select, with `member`, the random numbers: see phi_set_noise */",
            "uint32_t member;",
            "double dw[PHI_DRAWS];  /* increments of the noise in the last step */",
        ),
        copied=("twin.dw.set(this.dw);",),
    ),
    StateBlock(
        "h",
        members=(
            "double h;              /* size of the last step; NaN before the first step */",
            "phi_params params;     /* the parameters, set by phi_init; do not change them */",
        ),
        reset=("s->h = h;",),
    ),
    StateBlock(
        "gauge",
        "GAUGE && MONITOR",
        ("double gauge[PHI_GAUGES]; /* the energy level e: -H(x0), or the value passed to phi_init_gauge */",),
    ),
    StateBlock(
        "gauge",
        "GAUGE && !MONITOR",
        ("double gauge[PHI_GAUGES]; /* gauge[k] times Casimir k is subtracted from H */",),
    ),
    StateBlock("common", "COMMON", ("PHI_COMMON_MEMBER",)),
    StateBlock(
        "coef",
        "NOISE && TIMED",
        (f"{_COEFFICIENTS} /* functions of params and h; then those that also depend on dw and the time */",),
    ),
    StateBlock(
        "coef",
        "NOISE && !TIMED",
        (f"{_COEFFICIENTS} /* functions of params and h; then those that also depend on dw */",),
    ),
    StateBlock(
        "coef",
        "RENEWED && !NOISE",
        (f"{_COEFFICIENTS} /* functions of params and h; then those that also depend on the time */",),
    ),
    StateBlock(
        "coef", "!RENEWED && !NOISE", (f"{_COEFFICIENTS} /* functions of params and h, computed when h changes */",)
    ),
    StateBlock(
        "attitude",
        "ATTITUDE && MATRICES",
        ("double attitude[PHI_ATTITUDE_SIZE]; /* a matrix, row by row; change it only by phi_set_attitude */",),
    ),
    StateBlock(
        "attitude",
        "ATTITUDE && !MATRICES",
        (
            "double attitude[PHI_ATTITUDE_SIZE];"
            " /* quaternion (w, x, y, z) that rotates body into space coordinates; see phi_set_attitude */",
        ),
    ),
    StateBlock(
        "position",
        "ATTITUDE && POSITION",
        ("double position[3]; /* position of the body in space; change it only by phi_set_attitude */",),
    ),
    StateBlock(
        "first", "ATTITUDE && MATRICES", ("double first[PHI_ELEMENT]; /* the attitude that phi_set_attitude set */",)
    ),
    StateBlock(
        "turned",
        "ATTITUDE",
        (
            "double turned[PHI_ELEMENT], turned_carry[PHI_ELEMENT];"
            " /* product of the rotations of all steps; its rounding error */",
        ),
        saved=(("turned", "PHI_ELEMENT"), ("turned_carry", "PHI_ELEMENT")),
        copied=(
            "twin.firstElement = Float64Array.from(this.firstElement);",
            "twin.turned = Float64Array.from(this.turned);",
            "twin.turnedCarry = Float64Array.from(this.turnedCarry);",
        ),
    ),
    StateBlock(
        "rate",
        "RATE_OF_GAUGE",
        (
            "double rate[PHI_RATE]; /* rate of an additional rotation: gradient of the function subtracted from H */",
            "double aside[PHI_ELEMENT]; /* the additional rotation in one step, minus the identity */",
        ),
        reset=("phi_set_aside(s);",),
        copied=(
            "twin.turningRate = Float64Array.from(this.turningRate);",
            "twin.attitudeFrom = this.attitudeFrom;",
        ),
    ),
    StateBlock(
        "aside_of_block",
        "RATE_OF_GAUGE && BLOCKS",
        ("double aside_of_block[PHI_ELEMENT]; /* the additional rotation in a block of steps, minus the identity */",),
    ),
    StateBlock(
        "before_h",
        "!MONITOR",
        (
            "size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */",
            "double t_before_h;",
        ),
        reset=("s->t_before_h = s->t;", "s->steps_before_h = s->steps;"),
    ),
    StateBlock(
        "history",
        "PREDICTED",
        ("phi_history PHI_OF(history, PHI_STAGES); /* predictor of the starting value of the iteration */",),
    ),
    StateBlock("steps", "GAUSS", copied=("twin.history = this.history.map((history) => history.copy());",)),
    StateBlock("forgotten", "PREDICTED && !GAUSS", reset=("PHI_FORGET(s->history);",)),
    StateBlock(
        "recurrence",
        "RECURRENCES",
        reset=("PHI_EACH_STAGE PHI_OF(s->history, stage).slow_steps_allowed = PHI_REPAY;",),
    ),
    StateBlock(
        "blocks",
        "BLOCKS",
        ("phi_block_measurements blocks;     /* measurements that decide when steps are made in blocks */",),
        reset=(
            "memset(&s->blocks, 0, sizeof s->blocks);",
            "s->blocks.single_steps = 2 * PHI_AHEAD;",
            "s->blocks.passes_without_recurrences = INT_MAX;",
        ),
    ),
)


def copied(switches: Mapping[str, bool]) -> list[str]:
    """Return the statements in JavaScript that copy the state of a solver to another solver."""
    return [line for block in STATE if block.copied and belongs(block, switches) for line in block.copied]


def belongs(block: StateBlock, switches: Mapping[str, bool]) -> bool:
    """Whether a solver with these switches has the block."""
    return not block.when or holds(block.when, switches)
