"""Cost of gradients of runs: the tables of docs/gradients.md, for single runs, ensembles and lattices.

A row has the CPU time of a step without gradient, and with the gradient with respect to the state and all parameters.
Times are the least of repetitions in turn. Solvers are compiled as for users of Python: C of profile ``fast``.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import phigen
from benchmarks.tables import table

os.environ["OMP_NUM_THREADS"] = "1"

MEMBERS, MEMBER_STEPS = 64, 1000
#: Least CPU seconds of a timed call, so that the resolution of the clock and the cost of a Python call do not matter.
CALL_SECONDS = 0.03


@dataclass(frozen=True)
class Row:
    """Row of a table: a system of the corpus, its scheme and order, and for lattices the sizes.

    An empty scheme or the order None means that of the spec.
    """

    label: str
    spec: str
    scheme: str = "series"
    order: int | None = 4
    sizes: tuple[int, ...] = ()

    def solver(self, **options: Any) -> Any:
        return phigen.compile(
            phigen.load(self.spec), scheme=self.scheme or None, order=self.order, target="c", profile="fast", **options
        )

    def title(self) -> str:
        order = "" if self.order is None else f", order {self.order}"
        sites = "" if not self.sizes else f", {self.sizes[0]:,} sites" if len(self.sizes) == 1 else _shape(self.sizes)
        return f"{self.label}{', splitting' if self.scheme == 'splitting' and not self.sizes else ''}{order}{sites}"


def _shape(sizes: Sequence[int]) -> str:
    return ", " + " × ".join(map(str, sizes))


SINGLE = (
    Row("rigid body, three parameters", "rigid_body"),
    Row("Hénon–Heiles", "henon_heiles", order=6),
    Row("Lagrange top, three parameters", "lagrange_top"),
    Row("three vortices", "vortices3"),
    Row("Kepler's problem", "kepler"),
    Row("rigid body", "rigid_body", "splitting"),
    Row("pendulum, kicks", "pendulum", "splitting", 6),
    Row("pendulum, symplectic Euler", "pendulum_euler", order=None),
    Row("along paths: Nambu's pendulum", "nambu_pendulum"),
    Row("SIR epidemic", "sir_epidemic", order=None),
    Row("the same, energy and Casimir exchanged", "sir_final_size", order=None),
    Row("Sklyanin's gyrostat", "sklyanin_gyrostat"),
    Row("charged particle in a magnetic field", "charged_particle", order=None),
    Row("Toda lattice, quadratic bracket", "toda3_quadratic", order=None),
    Row("Ablowitz and Ladik's lattice, three sites", "ablowitz_ladik3", order=None),
    Row("guiding centre", "guiding_centre", order=None),
)  # fmt: skip

IN_LANES = (
    Row("Hénon–Heiles", "henon_heiles", "splitting"),
    Row("rigid body", "rigid_body", "splitting"),
    Row("Kepler's problem", "kepler", "splitting"),
    Row("Lagrange top", "lagrange_top", "splitting"),
    Row("Lotka–Volterra, three species", "lotka_volterra", "splitting"),
    Row("pendulum", "pendulum", "splitting"),
    Row("five spins", "spin_chain5", "splitting"),
    Row("pendulum, symplectic Euler", "pendulum_euler", order=None),
    Row("rigid body", "rigid_body"),
    Row("Hénon–Heiles", "henon_heiles", order=6),
    Row("Lagrange top", "lagrange_top"),
    Row("three vortices", "vortices3"),
    Row("five species", "volterra5"),
    Row("body with thrusters, forces along covectors", "thruster_body", order=None),
    Row("along paths: Nambu's pendulum", "nambu_pendulum"),
    Row("SIR epidemic", "sir_epidemic", order=None),
)

LATTICES = (
    Row("Fermi, Pasta, Ulam and Tsingou's chain", "fput", "splitting", 4, (1024,)),
    Row("the same", "fput", "splitting", 4, (1_000_000,)),
    Row("spins on a cubic lattice", "heisenberg", "splitting", 2, (16, 16, 16)),
    Row("the same", "heisenberg", "splitting", 2, (32, 32, 32)),
    Row("the same", "heisenberg", "splitting", 2, (64, 64, 64)),
    Row("Toda's chain", "toda", "splitting", 4, (1024,)),
    Row("Klein and Gordon's chain", "klein_gordon", "splitting", 4, (1024,)),
    Row("sine-Gordon chain", "sine_gordon", "splitting", 4, (1024,)),
    Row("discrete nonlinear Schrödinger equation", "dnls", "splitting", 4, (1024,)),
    Row("waves in a nonlinear bar", "nonlinear_wave", "splitting", 4, (256,)),
    Row("Ablowitz and Ladik's lattice", "ablowitz_ladik", "", None, (96,)),
    Row("spins in a plane with open ends", "heisenberg_plane", "splitting", 4, (48, 48)),
    Row("KdV equation, a grid by the series", "kdv", "", None, ()),
    Row("food web, a graph", "food_web", "", None, ()),
    Row("chiral magnet, a graph", "chiral_magnet", "", None, ()),
    Row("outer planets, pairs", "outer_planets", "", None, ()),
    Row("point vortices, pairs by the series", "point_vortices", "", None, ()),
)


def seconds(work: Callable[[], object]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def least(works: Sequence[Callable[[], object]], repetitions: int) -> list[float]:
    """Return the CPU seconds of each call, the least of several repetitions in which the calls take turns."""
    times = [[seconds(work) for work in works] for _ in range(repetitions)]
    return [min(column) for column in zip(*times, strict=True)]


def enough_steps(run: Callable[[int], object], most: int) -> int:
    """Return a number of steps for which a call takes at least `CALL_SECONDS`, at most ``most``."""
    for steps in (2**k for k in range(most.bit_length())):
        begun = time.process_time()
        run(steps)
        if time.process_time() - begun > CALL_SECONDS:
            return steps
    return most


def _nanoseconds(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:,.0f}"


def single(row: Row, repetitions: int) -> list[str]:
    """Return a row of the table of single runs: times of a step without and with the gradient, and their ratio."""
    solver = row.solver(adjoint=True)
    start = solver.run(steps=1)
    x0, h = start.x[0], start.h
    weights = np.random.default_rng(1).normal(size=len(x0))
    steps = enough_steps(lambda n: solver.integrate(x0, h, n, stride=n), 20_000)
    forwards, both = least(
        [
            lambda: solver.integrate(x0, h, steps, stride=steps),
            lambda: solver.pullback(x0, h, steps, weights),
        ],
        repetitions,
    )
    each = [1e9 * t / steps for t in (forwards, both)]
    return [row.title(), *map(_nanoseconds, each), f"{both / forwards:.1f}"]


def in_lanes(row: Row, repetitions: int) -> list[str]:
    """Return a row of the table of ensembles, with times for a member and step.

    The times are those without gradient, with the gradients of the members one by one, and with those of several
    members at once in SIMD lanes.
    """
    solver = row.solver(adjoint=True)
    start = solver.run(steps=1)
    h = start.h
    spread = 1 + 0.01 * np.random.default_rng(1).normal(size=(MEMBERS, len(start.x[0])))
    x0 = start.x[0] * spread
    weights = np.random.default_rng(2).normal(size=x0.shape)

    def one_by_one() -> None:
        for x, w in zip(x0, weights, strict=True):
            solver.pullback(x, h, MEMBER_STEPS, w)

    times = least(
        [
            lambda: solver.ensemble(x0, h, MEMBER_STEPS, threads=1),
            one_by_one,
            lambda: solver.pullback(x0, h, MEMBER_STEPS, weights, threads=1),
        ],
        repetitions,
    )
    each = [1e9 * t / (MEMBERS * MEMBER_STEPS) for t in times]
    return [row.title(), *map(_nanoseconds, each), f"{each[2] / each[0]:.1f}"]


def lattice(row: Row, repetitions: int) -> list[str]:
    """Return a row of the table of lattices: nanoseconds for a site and step without and with the gradient, and
    their ratio."""
    solver = row.solver(adjoint=True)
    start = solver.run(steps=1, **({"sizes": row.sizes} if row.sizes else {}))
    x0, h, parameters = start.x[0], start.h, start.parameters
    weights = np.random.default_rng(1).normal(size=x0.shape)
    # The reverse pass of a reversible method stores every 32nd state, so the number of steps is a multiple of 64.
    steps = 64 * -(-enough_steps(lambda n: solver.integrate(x0, h, n, stride=n, parameters=parameters), 1024) // 64)
    forwards, both = least(
        [
            lambda: solver.integrate(x0, h, steps, stride=steps, parameters=parameters),
            lambda: solver.pullback(x0, h, steps, weights, parameters=parameters),
        ],
        repetitions,
    )
    sites = x0[0].size
    each = [1e9 * t / (steps * sites) for t in (forwards, both)]
    return [row.title(), *map(_nanoseconds, each), f"{both / forwards:.1f}"]


def measured(quick: bool, say: Callable[[str], None]) -> dict[str, str]:
    """Return the three tables by their names, which are those of the markers in docs/gradients.md."""
    repetitions = 1 if quick else 7
    tables = {
        "pullbacks": (single, SINGLE, ["", "a step, ns", "with the gradient", "ratio"]),
        "pullbacks-members": (
            in_lanes, IN_LANES, ["", "forwards, ns", "with the gradient, one by one", "in lanes", "ratio"],
        ),
        "pullbacks-lattices": (lattice, LATTICES, ["", "forwards, ns", "with the gradient", "ratio"]),
    }  # fmt: skip
    texts = {}
    for name, (make, rows, head) in tables.items():
        lines = []
        for row in rows[:1] if quick else rows:
            lines.append(make(row, repetitions))
            say(" | ".join(lines[-1]))
        texts[name] = table(head, lines)
    return texts
