"""Benchmark of ensembles of rigid bodies: CPU time for a member and unit of time, for given energy errors at the
end."""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np

from benchmarks.measure import FINER, ratios
from benchmarks.problems import PROBLEMS
from benchmarks.solvers import build_phigen, vector_peers
from benchmarks.tables import table

TARGETS = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
MEMBERS = 256

#: A scan of a method ends if a run takes this many times as long as the first, coarsest run.
PATIENCE = 60

PROBLEM = PROBLEMS[0]

Advance = Callable[[np.ndarray, float], float]
"""Function that integrates states [coordinate, member] in place over the horizon, with a step size or a tolerance, and
returns the CPU seconds."""


@dataclass(frozen=True)
class Contestant:
    """Method with the first setting of its scan and the factor to the next finer setting.

    Methods with the same ``row`` share a row of the table, which shows the fastest of them.
    """

    row: str
    variant: str
    advance: Advance
    first: float
    factor: float


@dataclass
class Trial:
    """Result of a method at one setting: largest energy and Casimir errors of all members, and the seconds of each
    run."""

    contestant: Contestant
    setting: float
    energy: float
    casimir: float
    seconds: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class Bodies:
    """Ensemble of rigid bodies with random momenta on one sphere, and the time over which they are integrated."""

    horizon: float

    @property
    def starts(self) -> np.ndarray:
        x = np.random.default_rng(1).normal(size=(3, MEMBERS))
        return x * np.sqrt(3 / (x**2).sum(0))

    def energy(self, x: np.ndarray) -> np.ndarray:
        return np.asarray((x[0] ** 2 + x[1] ** 2 / 2 + x[2] ** 2 / 3) / 2)

    def trial(self, contestant: Contestant, setting: float) -> Trial:
        starts = self.starts
        x = starts.copy()
        seconds = contestant.advance(x, setting)
        with np.errstate(all="ignore"):
            energy = float(np.abs(self.energy(x) / self.energy(starts) - 1).max())
            casimir = float(np.abs((x**2).sum(0) / 3 - 1).max())
        return Trial(contestant, setting, energy if seconds < math.inf else math.inf, casimir, [seconds])


def contestants(horizon: float, orders: Sequence[int]) -> Iterator[Contestant]:
    for method in ("gauge auto", "splitting"):
        for order in orders:
            built = build_phigen(PROBLEM.spec(order, method))
            first = 1.0 if method == "splitting" else 0.5
            yield Contestant(
                f"phigen, {method}", f"order {order}", _compiled(built.library, 0, horizon), first, 1 / FINER
            )
    for width in (4, 8):
        library = vector_peers(PROBLEM, width)
        for index, (name, first) in enumerate((("RK4 in C", 0.2), ("DOP853 in C", 1.0))):
            yield Contestant(name, f"{width} at once", _compiled(library, index, horizon), first, 1 / FINER)
    try:
        import heyoka
    except ImportError:
        return
    width = heyoka.recommended_simd_size()
    yield Contestant("heyoka, batch mode", f"{width} at once", _heyoka(heyoka, width, horizon), 1e-4, 0.1)


def _compiled(library: ctypes.CDLL, index: int, horizon: float) -> Advance:
    function = library.measure_many
    long, double, pointer = ctypes.c_long, ctypes.c_double, ctypes.c_void_p
    function.argtypes = (ctypes.c_int, pointer, long, double, long, pointer)

    def advance(x: np.ndarray, h: float) -> float:
        seconds, steps = np.zeros(1), math.ceil(horizon / h)
        status = function(index, x.ctypes.data, MEMBERS, horizon / steps, steps, seconds.ctypes.data)
        return math.inf if status else float(seconds[0])

    return advance


def _heyoka(heyoka: Any, width: int, horizon: float) -> Advance:
    variables = heyoka.make_vars(*PROBLEM.coordinates)
    names = dict(zip(PROBLEM.symbols, variables, strict=True))
    system = [(v, heyoka.from_sympy(e.evalf(17), names)) for v, e in zip(variables, PROBLEM.field, strict=True)]
    solvers: dict[float, Any] = {}

    def advance(x: np.ndarray, tolerance: float) -> float:
        if tolerance not in solvers:
            solvers[tolerance] = heyoka.taylor_adaptive_batch(system, x[:, :width].copy(), tol=tolerance)
        solver, seconds = solvers[tolerance], 0.0
        for m in range(0, x.shape[1], width):
            solver.set_time(0.0)
            solver.state[:] = x[:, m : m + width]
            began = time.thread_time()
            solver.propagate_until(horizon)
            seconds += time.thread_time() - began
            x[:, m : m + width] = solver.state
        return seconds

    return advance


def scanned(bodies: Bodies, contestant: Contestant) -> list[Trial]:
    """Return the runs of a method from its first setting to the first that meets all targets.

    While the coarsest setting is the fastest for some target, coarser settings are added.
    """
    trials, setting = [], contestant.first
    for _ in range(40):
        trials.append(bodies.trial(contestant, setting))
        slow = trials[-1].seconds[0] > PATIENCE * trials[0].seconds[0]
        if trials[-1].energy <= min(TARGETS) or slow or setting < 1e-15:
            break
        setting *= contestant.factor
    while any(best(trials, target) is trials[0] for target in TARGETS):
        trials.insert(0, bodies.trial(contestant, trials[0].setting / contestant.factor))
    return trials


def best(trials: Sequence[Trial], target: float) -> Trial | None:
    return min((t for t in trials if t.energy <= target), key=lambda t: median(t.seconds), default=None)


def measured(quick: bool) -> dict[str, Any]:
    """Return the rows of the table: for each method and target the fastest setting. Final settings are timed in
    turn."""
    bodies = Bodies(100.0 if quick else 1000.0)
    trials = [t for c in contestants(bodies.horizon, (4,) if quick else (4, 6, 8, 10)) for t in scanned(bodies, c)]
    rows = list(dict.fromkeys(t.contestant.row for t in trials))
    chosen = {(row, target): best([t for t in trials if t.contestant.row == row], target)
              for row in rows for target in TARGETS}  # fmt: skip
    finalists = list({id(t): t for t in chosen.values() if t}.values())
    for t in finalists:
        t.seconds.clear()
    for _ in range(2 if quick else 5):
        for t in finalists:
            t.seconds += bodies.trial(t.contestant, t.setting).seconds
    return {"rows": [[row, *(_entry(chosen, rows, row, target, bodies.horizon) for target in TARGETS)] for row in rows]}


def _entry(chosen: dict[tuple[str, float], Trial | None], rows: Sequence[str], row: str, target: float,
           horizon: float) -> str:  # fmt: skip
    """Return a cell of the table: time relative to phigen's fastest method, nanoseconds, and the setting."""
    trial = chosen[row, target]
    ours = [chosen[r, target] for r in rows if r.startswith("phigen")]
    if trial is None:
        return "not reached"
    reference = min((t for t in ours if t), key=lambda t: median(t.seconds), default=trial)
    middle, least, most = ratios(trial.seconds, reference.seconds)
    ns = 1e9 * median(trial.seconds) / MEMBERS / horizon
    ratio = "**1**" if trial is reference else f"{middle:.2f} [{least:.2f}–{most:.2f}]"
    return f"{ratio}, {ns:.1f} ns ({trial.contestant.variant}, {trial.setting:.3g})"


def shown(data: dict[str, Any]) -> str:
    head = ("time over phigen's best, ns for a member and unit of time", *(f"energy {t:.0e}" for t in TARGETS))
    return f"{table(head, data['rows'])}\n"
