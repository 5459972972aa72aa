"""Splitting methods for any number of parts of H.

Let φ_k be the flow of part k over the time h. The methods alternate χ_h = φ_m ∘ … ∘ φ_1 and its adjoint χ*_h = φ_1 ∘ …
∘ φ_m: a step is Φ_h = χ_{α_2s h} ∘ χ*_{α_2s−1 h} ∘ … ∘ χ_{α_2 h} ∘ χ*_{α_1 h} with α_i = α_{2s+1−i}. It is a symmetric
Poisson map if the φ_k are exact flows. Strang's splitting is α = (½, ½). A symmetric composition of Strang's splitting
has α = (γ_1/2, γ_1/2, γ_2/2, γ_2/2, …).

A splitting method for two parts has the coefficients a_1 = α_1, b_1 = α_1 + α_2, a_2 = α_2 + α_3, …. The α give the
same order for any number of parts: R. I. McLachlan, On the numerical integration of ordinary differential equations by
symmetric composition methods, SIAM J. Sci. Comput. 16 (1995). Where χ and χ* meet, two successive flows of one part are
merged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from phigen.scheme.composition import COMPOSITIONS, Composition

# Coefficients of the methods S_6 of order 4 and S_10 of order 6, by S. Blanes, P. C. Moan, Practical symplectic
# partitioned Runge–Kutta and Runge–Kutta–Nyström methods, J. Comput. Appl. Math. 142 (2002). A method is given by the
# first half of a_1, a_2, … and the first half of b_1, b_2, … The middle values are left out; they follow from Σa = Σb =
# 1.
_S6 = ("0.0792036964311957 0.353172906049774 -0.0420650803577195", "0.209515106613362 -0.143851773179818")
_S10 = (
    "0.0502627644003922 0.413514300428344 0.0450798897943977 -0.188054853819569 0.541960678450780",
    "0.148816447901042 -0.132385865767784 0.067307604692185 0.432666402578175",
)


@dataclass(frozen=True)
class Alternation:
    """A splitting method for any number of parts: its name, its order, and the fractions α_1, …, α_2s of the step."""

    name: str
    order: int
    fractions: tuple[Fraction, ...]

    @property
    def stages(self) -> int:
        """The number of stages of a step. A stage applies χ* and then χ, as defined in this module."""
        return len(self.fractions) // 2


def _partitioned(name: str, order: int, halves: tuple[str, str]) -> Alternation:
    """Return a method from the first halves of its coefficients a_1, … and b_1, … for two parts.

    The coefficients are symmetric; the middle values follow from Σa = Σb = 1.
    """
    a, b = ([Fraction(v) for v in half.split()] for half in halves)
    a = [*a, 1 - 2 * sum(a, Fraction(0)), *reversed(a)]
    remainder = Fraction(1, 2) - sum(b, Fraction(0))
    b = [*b, remainder, remainder, *reversed(b)]
    times = [t for pair in zip(a, b, strict=False) for t in pair]
    alpha = [times[0]]
    for t in times[1:]:
        alpha.append(t - alpha[-1])
    return Alternation(name, order, tuple(alpha))


def _composed(composition: Composition) -> Alternation:
    halves = [Fraction(f) / 2 for f in composition.fractions for _ in range(2)]
    return Alternation(composition.name, composition.order, tuple(halves))


STRANG = Alternation("strang", 2, (Fraction(1, 2),) * 2)

#: All splitting methods for any number of parts. The first one of each order is recommended.
ALTERNATIONS = (
    STRANG,
    _partitioned("blanes-moan", 4, _S6),
    _partitioned("blanes-moan", 6, _S10),
    *(_composed(c) for c in COMPOSITIONS),
)


def find(name: str, order: int) -> Alternation | None:
    """Return the splitting method with this name and order, or None.

    ``auto`` stands for the recommended method of the order, and ``none`` for Strang's splitting.
    """
    names = {"auto": [a.name for a in ALTERNATIONS], "none": [STRANG.name]}.get(name, [name])
    return next((a for a in ALTERNATIONS if a.order == order and a.name in names), None)


def orders(name: str) -> list[int]:
    """Return the orders for which there is a splitting method with this name."""
    return sorted({a.order for a in ALTERNATIONS if find(name, a.order)})


@dataclass(frozen=True)
class Schedule:
    """The order and the durations of the flows of one step, in units of the step size.

    A step begins with the flow of part 0 over ``times[0]``. Then ``stages`` repetitions of the ``pattern`` follow. The
    pattern lists pairs of a part and a row: the flow of this part runs for the time in this row of ``times``. In the
    pattern, rows are counted from the first row of the stage.

    If H = T + V, a method may replace V by a modified potential V + κ{V, {V, T}} with κ = m h². Then ``multiples`` has
    the number m for each row; m is 0 for flows without a modified potential. If H depends on the time, ``moments`` has
    for each row the fraction of the step at which H is evaluated.

    If the method has a corrector, a run starts with the flows ``begin`` and ends with the flows ``end``. Their rows
    follow the rows of the step.
    """

    times: tuple[float, ...]
    stages: int
    pattern: tuple[tuple[int, int], ...]
    multiples: tuple[float, ...] = ()
    moments: tuple[float, ...] = ()
    begin: tuple[tuple[int, int], ...] = ()
    end: tuple[tuple[int, int], ...] = ()

    @property
    def rows(self) -> int:
        """The number of entries that the list ``times`` has for each stage."""
        of_step = len(self.times) - len(self.begin) - len(self.end)
        return (of_step - 1) // self.stages if self.stages else 0

    @property
    def flows(self) -> list[tuple[int, int]]:
        """All flows of a step in order, as pairs of a part and a row of ``times``."""
        later = [(part, 1 + k * self.rows + row) for k in range(self.stages) for part, row in self.pattern]
        return [(0, 0), *later]

    @property
    def flows_of_run(self) -> list[tuple[int, int]]:
        """All flows of a run that consists of a single step, including the flows of the corrector, in order."""
        return [*self.begin, *self.flows, *self.end]


def with_clock(schedule: Schedule, carrier: int, parts: int) -> Schedule:
    """Return the schedule for an H that depends on the time, with the time at which each flow evaluates H.

    The times are fractions of the step. The Hamiltonian is H + e, where e is the conjugate of the time. e belongs to
    the part with the number ``carrier``, which is the first or the last part. The time advances during the flows of
    this part, and is fixed during all other flows. If ``carrier`` equals ``parts``, the number of parts of H, then e is
    a part by itself. The flows of e alone only advance the time, and the result omits them.
    """
    clock, moments = Fraction(0), dict[int, Fraction]()
    for part, row in schedule.flows:
        if part == carrier:
            clock += Fraction(schedule.times[row])
        elif moments.setdefault(row, clock) != clock:
            raise ValueError(f"row {row} occurs at two times")
    pattern = tuple(flow for flow in schedule.pattern if flow[0] < parts)
    fractions = tuple(float(moments.get(row, Fraction(0))) for row in range(len(schedule.times)))
    return replace(schedule, pattern=pattern, moments=fractions)


def schedule(method: Alternation, parts: int) -> Schedule:
    """Return the flows of a step of a method, for a number of ``parts`` of H. If there is only one part, a step is its
    exact flow.
    """
    if parts == 1:
        return Schedule((1.0,), 0, ())
    alpha = [*method.fractions, Fraction(0)]
    times: list[Fraction] = [alpha[0]]
    for k in range(0, 2 * method.stages, 2):
        first, second, next_first = alpha[k : k + 3]
        stage: Sequence[Fraction] = (first, first + second, second, second + next_first)
        times += stage if parts > 2 else (stage[1], stage[3])
    last, middle = parts - 1, range(1, parts - 1)
    if parts == 2:
        pattern = [(1, 0), (0, 1)]
    else:
        pattern = [*((k, 0) for k in middle), (last, 1), *((k, 2) for k in reversed(middle)), (0, 3)]
    return Schedule(tuple(float(t) for t in times), method.stages, tuple(pattern))
