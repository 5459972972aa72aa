"""Benchmark of a very eccentric orbit over many periods: time transformations (monitors) against step size control.

All methods integrate over the same physical time. A timed run goes from the start to the first step at or after the
end, and stores only the last state; the time is CPU time of one core. A second run stores the states after all steps,
from which the energy errors are computed.
"""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache as cached
from pathlib import Path
from typing import Any

import numpy as np

import phigen
from benchmarks.lanes import lanes_source, tuned
from benchmarks.solvers import tables, texts
from benchmarks.tables import table
from phigen import spec
from phigen.api import solver_of
from phigen.compiler import compile_spec
from phigen.runtime import cache

ECCENTRICITY, OBLATENESS = 0.99, 1e-6
START = (1 - ECCENTRICITY, 0.0, 0.0, math.sqrt((1 + ECCENTRICITY) / (1 - ECCENTRICITY)))
PERIOD = 2 * math.pi

#: Energy errors for which the cheapest setting of each method is compared.
TARGETS = (1e-6, 1e-8, 1e-10)

#: Upper bound for the length of a period in τ divided by its length in t, where dt = r^(3/2) dτ; it makes runs long
#: enough.
TAU_OVER_T = 4.75

#: Factor between the step sizes of neighbouring settings, and largest number of settings of a method that are tried.
FINER = 2 ** (1 / 3)
MOST_SETTINGS = 18


@dataclass(frozen=True)
class Row:
    """Result of a method at one setting: end time, number of steps, CPU seconds, and largest energy errors.

    ``first`` is the largest error in the first tenth of the steps, ``worst`` the largest in all steps.
    """

    method: str
    setting: str
    time: float
    steps: int
    first: float
    worst: float
    seconds: float


Trial = Callable[[float], Row]
"""Function that makes a run at a setting, which is a number of steps per period or a tolerance."""


@dataclass(frozen=True)
class Contestant:
    """Method with the coarsest setting of its scan, and the factor from one setting to the next finer one."""

    name: str
    trial: Trial
    coarsest: float
    factor: float


def energy(x: np.ndarray) -> np.ndarray:
    """Return H of states (rows, 4)."""
    r2 = x[:, 0] ** 2 + x[:, 1] ** 2
    quadrupole = OBLATENESS / (2 * r2**1.5) * (1 - 3 * x[:, 1] ** 2 / r2)
    return np.asarray((x[:, 2] ** 2 + x[:, 3] ** 2) / 2 - r2**-0.5 - quadrupole)


def errors(x: np.ndarray) -> tuple[float, float]:
    """Return the largest relative energy errors of states (rows, 4): in the first tenth of the rows, and in all
    rows."""
    each = np.abs(energy(x) / energy(np.array([START]))[0] - 1)
    return float(each[: max(2, len(each) // 10)].max()), float(each.max())


def cpu_seconds(work: Callable[[], Any]) -> float:
    """Return the CPU time of a call, the smaller of two measurements."""
    times = []
    for _ in range(2):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return min(times)


def contestants(periods: int) -> Iterator[Contestant]:
    """Yield all methods; heyoka only if it is installed."""
    yield monitored("splitting", 8, periods, 240)
    for order, coarsest in ((8, 24), (10, 16)):
        yield monitored("series", order, periods, coarsest)
    for order in (12, 16):
        yield monitored("gauss", order, periods, 8)
    yield Contestant("DOP853 with step control, in C", controlled(periods), 1e-6, 0.1)
    for order in (12, 16):
        yield Contestant(f"Gauss {order}, SIMD, g = r^(3/2), in C", gauss(order, periods), 8, FINER)
    try:
        yield Contestant("heyoka", taylor(periods), 1e-6, 0.1)
    except ImportError:
        return


def monitored(scheme: str, order: int, periods: int, coarsest: float) -> Contestant:
    """Return phigen with a monitor: the logarithmic monitor for a splitting, g = r^(3/2) for other schemes."""
    text = (Path(phigen.__file__).parents[1] / "specs" / "kepler_eccentric.yaml").read_text(encoding="utf-8")
    monitor = "log" if scheme == "splitting" else "r2**(3/4)"
    changes = {"scheme: splitting": f"scheme: {scheme}", "monitor: log": f"monitor: {monitor}", "profile: small": ""}
    for old, new in changes.items():
        text = text.replace(old, new)
    solver = solver_of(compile_spec(spec.loads(text), order=order), "c")
    name = f"phigen {order}, " + ("`log`" if scheme == "splitting" else f"{scheme}, g = r^(3/2)")
    start, end = list(START), periods * PERIOD

    def advance(h: float, steps: int, stride: int) -> Any:
        return solver.integrate(start, h, steps, stride, oblateness=OBLATENESS)

    def trial(steps_of_period: float) -> Row:
        h = PERIOD / steps_of_period
        pace = advance(h, math.ceil(20 * steps_of_period), 1).t[-1] / 20
        count = math.ceil(steps_of_period * (end / pace + 1))
        whole = advance(h, count, 1)
        while whole.t[-1] < end:
            count = math.ceil(1.05 * count)
            whole = advance(h, count, 1)
        steps = int(np.searchsorted(whole.t, end))
        seconds = cpu_seconds(lambda: advance(h, steps, steps))
        return row(name, "", whole.t[steps], steps, periods, whole.x[: steps + 1], seconds)

    return Contestant(name, trial, coarsest, FINER)


def row(name: str, setting: str, end: float, steps: int, periods: int, x: np.ndarray, seconds: float) -> Row:
    text = f"{steps / periods:.0f} steps a period"
    return Row(name, f"{setting}: {text}" if setting else text, float(end), steps, *errors(x), seconds)


@cached
def controlled_library() -> ctypes.CDLL:
    main = "\n".join(
        [
            "#define _POSIX_C_SOURCE 199309L",
            f'#define OBLATENESS {OBLATENESS!r}\n#include "common.h"\n#include "kepler.h"',
            tables(("dop853",)),
            '#include "step_control.h"\n',
        ]
    )
    library = cache.load({"main.c": main, **texts()})
    pointer, double, long = ctypes.c_void_p, ctypes.c_double, ctypes.c_long
    library.follow_controlled.restype = long
    library.follow_controlled.argtypes = (pointer, double, double, long, pointer)
    library.measure_controlled.argtypes = (
        pointer, double, double, long, double, pointer, pointer, pointer, pointer,
    )  # fmt: skip
    return library


def controlled(periods: int) -> Trial:
    """Return the runs of DOP853 in C, with the step size control of its authors."""
    library, start, end = controlled_library(), np.array(START), periods * PERIOD

    def trial(tolerance: float) -> Row:
        last, number = np.zeros(4), np.zeros(3)
        each = [number[i:].ctypes.data for i in range(3)]

        def work() -> None:
            library.measure_controlled(start.ctypes.data, tolerance, end, 1, math.inf, last.ctypes.data, *each)

        seconds = cpu_seconds(work)
        states = np.empty((int(number[2]) + 1, 4))
        steps = library.follow_controlled(start.ctypes.data, tolerance, end, len(states), states.ctypes.data)
        name = "DOP853 with step control, in C"
        return row(name, f"tolerance {tolerance:.0e}", end, steps, periods, states[:steps], seconds)

    return trial


def gauss(order: int, periods: int) -> Trial:
    """Return the runs of a Gauss method in C, with SIMD stages, for K = g (H − H₀).

    Steps are equal in τ, where dt = g dτ, so step size control is not needed.
    """
    constants = {"OBLATENESS": OBLATENESS, "ENERGY": float(energy(np.array([START]))[0])}
    lines = [f"#define {name} ({value!r})" for name, value in constants.items()]
    run = tuned(lanes_source("\n".join([*lines, '#include "kepler_monitored.h"']), order), order // 2)
    start, end = [*START, 0.0], periods * PERIOD
    name = f"Gauss {order}, SIMD, g = r^(3/2), in C"

    def trial(steps_of_period: float) -> Row:
        h, count = PERIOD / steps_of_period, math.ceil(TAU_OVER_T * steps_of_period * (periods + 1))
        whole = run(start, h, 1, count, math.inf)
        while whole.status == "ok" and whole.states[-1, 4] < end:
            count = math.ceil(1.1 * count)
            whole = run(start, h, 1, count, math.inf)
        if whole.status != "ok":
            return Row(name, f"{steps_of_period:.0f} steps in 2π of τ: {whole.status}", math.nan, 0, *[math.inf] * 3)
        steps = int(np.searchsorted(whole.states[:, 4], end)) + 1
        seconds = cpu_seconds(lambda: run(start, h, steps, 1, math.inf))
        return row(name, "", whole.states[steps - 1, 4], steps, periods, whole.states[:steps, :4], seconds)

    return trial


def taylor(periods: int) -> Trial:
    """Return the runs of heyoka's Taylor method; its compilation is not timed."""
    import heyoka as hy

    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    r2 = x * x + y * y
    potential = r2**-0.5 + OBLATENESS * 0.5 * r2**-1.5 * (1 - 3 * y * y / r2)
    system = [(x, u), (y, v), (u, hy.diff(potential, x)), (v, hy.diff(potential, y))]
    end = periods * PERIOD

    def trial(tolerance: float) -> Row:
        solver = hy.taylor_adaptive(system, list(START), tol=tolerance, high_accuracy=tolerance < 1e-12)

        def again() -> None:
            solver.time = 0.0
            solver.state[:] = START

        def work() -> None:
            again()
            solver.propagate_until(end)

        seconds = cpu_seconds(work)
        again()
        states = []
        while solver.time < end:
            solver.step(end - solver.time)
            states.append(solver.state.copy())
        return row("heyoka", f"tolerance {tolerance:.0e}", end, len(states), periods, np.array(states), seconds)

    return trial


def rows_of(contestant: Contestant, targets: Sequence[float]) -> list[Row]:
    """Return the results of a method from its coarsest setting to the first that meets all targets.

    While the coarsest setting is the fastest for some target, coarser settings are added.
    """
    setting, found = contestant.coarsest, []
    for _ in range(MOST_SETTINGS):
        found.append(contestant.trial(setting))
        if found[-1].worst <= min(targets) or setting < 3e-16:
            break
        setting *= contestant.factor
    setting = contestant.coarsest
    while any(best(found, target) is found[0] for target in targets):
        setting /= contestant.factor
        found.insert(0, contestant.trial(setting))
    return found


def best(rows: Sequence[Row], target: float) -> Row | None:
    return min((r for r in rows if r.worst <= target), key=lambda r: r.seconds, default=None)


def measured(periods: int, say: Callable[[str], None]) -> list[Row]:
    """Return the results of all methods at all settings."""
    rows: list[Row] = []
    for contestant in contestants(periods):
        rows += rows_of(contestant, TARGETS)
        say(f"{contestant.name}: {len(rows)} rows")
    return rows


def shown(rows: Sequence[Row], periods: int) -> str:
    """Return a table with the fastest setting of each method for each target.

    The last column divides the error over all steps by that in the first tenth, for the smallest target that was
    reached.
    """
    entries = []
    for name in dict.fromkeys(r.method for r in rows):
        chosen = [best([r for r in rows if r.method == name], target) for target in TARGETS]
        entry = [f"{1e3 * r.seconds:.3g} ms ({r.setting})" if r else "not reached" for r in chosen]
        reached = [r for r in chosen if r]
        growth = f"{reached[-1].worst / reached[-1].first:.1f}" if reached else ""
        entries.append([name, *entry, growth])
    head = (f"{periods:,} periods", *(f"energy to {t:.0e}" for t in TARGETS), "error in all / in the first tenth")
    return f"{table(head, entries)}\n"
