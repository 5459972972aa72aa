"""The questions: work and precision, cost of a step, ensembles, growth with dimension, time to build."""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks import python_peers
from benchmarks.measure import ENERGY, ORBIT, SAMPLES, Cell, Judge, Study, cheapest, reach, run, scan, time_cells
from benchmarks.problems import PROBLEMS, Problem, volterra
from benchmarks.solvers import Method, build_phigen, c_peers, phigen_method, reference, vector_rk4
from phigen import spec as specs
from phigen.compiler import compile_proved, emit
from phigen.errors import PhigenError
from phigen.runtime import toolchain


@dataclass(frozen=True)
class Effort:
    """How much is run: rounds of timing, seconds that one run may take over the two horizons (0: not run)."""

    rounds: int = 5
    limit: float = 0.12
    long_limit: float = 1.5
    quick: bool = False


QUICK = Effort(rounds=3, limit=0.05, long_limit=0.0, quick=True)


def methods_of(problem: Problem, effort: Effort) -> tuple[list[Method], list[str]]:
    """phigen's solvers and the peers; what could not be built is a note."""
    notes: list[str] = []
    ours: list[Method] = []
    for method in problem.methods:
        orders = problem.orders_of(method)
        for order in orders[1:3] if effort.quick else orders:
            try:
                ours.append(phigen_method(problem, order, method))
            except PhigenError as error:
                notes.append(f"phigen {order} and above, {method}: {str(error).splitlines()[0]}")
                break
    peers = c_peers(problem)
    if not effort.quick:
        more, missing = python_peers.available(problem)
        peers += more
        notes += missing
    return [*ours, *peers], notes


def work_precision(problem: Problem, effort: Effort, say: Callable[[str], None]) -> list[Study]:
    """Time to reach each target, over the short and the long horizon."""
    say(f"{problem.name}: building")
    methods, notes = methods_of(problem, effort)
    states, uncertainty = reference(problem, problem.short, SAMPLES["short"])
    notes.append(f"uncertainty of the reference: {uncertainty:.1e}")
    judge, targets = Judge(problem, states), (*ENERGY, *ORBIT)
    say(f"{problem.name}: scanning")
    scans = {m.name: scan(m, problem, judge, targets, effort.limit) for m in methods}
    cells = [cell for target in targets for cell in _cells(methods, scans, target)]
    say(f"{problem.name}: timing")
    named = {m.name: m for m in methods}
    time_cells(cells, named, problem.short, SAMPLES["short"], judge, effort.rounds)
    everything = [r for results in scans.values() for r in results]
    studies = [Study(problem.name, problem.title, problem.short, everything, cells, notes)]
    if effort.long_limit:
        say(f"{problem.name}: long horizon")
        studies.append(_long(problem, methods, scans, cells, effort))
    return studies


def _long(problem: Problem, methods: list[Method], scans: dict[str, Any], short: list[Cell], effort: Effort) -> Study:
    """Those that were best over the short horizon, and the classics, over the long one (energy only)."""
    judge, cells, everything = Judge(problem), [], []
    for target in ENERGY:
        chosen = {c.result.method for c in short if c.target == target and c.family == "phigen" and c.result}
        # A target of the short horizon that needs order k may need a neighbour of it here.
        ours = [m for m in methods if m.family == "phigen" and m.name in chosen]
        peers = [
            m
            for m in methods
            if m.family != "phigen" and not m.name.startswith(("scipy", "RK4", "Kahan in", "Poisson"))
        ]
        results = {m.name: reach(m, problem, judge, scans[m.name], target, effort.long_limit) for m in [*ours, *peers]}
        everything += [r for rs in results.values() for r in rs]
        cells += _cells([*ours, *peers], results, target)
    rounds = max(2, effort.rounds - 3)
    time_cells(cells, {m.name: m for m in methods}, problem.long, SAMPLES["long"], judge, rounds)
    return Study(problem.name, problem.title, problem.long, everything, cells, [])


def _cells(methods: list[Method], scans: dict[str, Any], target: tuple[str, float]) -> list[Cell]:
    """One cell for each peer, and one for each gauge of phigen, of the best order."""
    cells = []
    groups: dict[str, list[Method]] = {}
    for m in methods:
        label = "phigen" + m.name.partition(",")[1] + m.name.partition(",")[2] if m.family == "phigen" else m.name
        groups.setdefault(label, []).append(m)
    for label, members in groups.items():
        results = [r for m in members for r in scans[m.name]]
        cells.append(Cell(label, members[0].family, target, cheapest(results, target)))
    return cells


def cost_of_steps(problem: Problem, effort: Effort) -> list[dict[str, Any]]:
    """Nanoseconds and evaluations per step at the typical step, all methods in interleaved rounds."""
    methods, _ = methods_of(problem, Effort(quick=True) if effort.quick else effort)
    judge, h = Judge(problem), problem.typical
    rows: dict[str, dict[str, Any]] = {}
    times: dict[str, list[float]] = {m.name: [] for m in methods if m.step_based}
    for _ in range(effort.rounds):
        for m in methods:
            if m.step_based:
                r = run(m, h, h * 20_000, 20, judge, math.inf)
                times[m.name].append(r.seconds / r.steps * 1e9)
                rows[m.name] = {"method": m.name, "status": r.status, "evaluations": r.evaluations / r.steps}
    base = times["RK4 in C"]
    for name, row in rows.items():
        each = [t / b for t, b in zip(times[name], base, strict=True)]
        row |= {"problem": problem.name, "h": h, "ns": median(times[name]), "over_rk4": median(each)}
        row |= {"least": min(each), "most": max(each)}
    return list(rows.values())


def ensembles(effort: Effort) -> list[dict[str, Any]]:
    """Many rigid bodies on one sphere: seconds per member and unit of time, worst energy error at the end."""
    problem, members, horizon = PROBLEMS[0], 256, 100.0 if effort.quick else 1000.0
    judge = Judge(problem)
    x0 = np.random.default_rng(1).normal(size=(3, members))
    x0 *= np.sqrt(3 / (x0**2).sum(0))
    libraries: dict[str, tuple[ctypes.CDLL, tuple[float, ...]]] = {
        "RK4 in C, 8 members at once": (vector_rk4(problem), (0.1, 0.05, 0.025, 0.0125))
    }
    for method, steps in (("gauge auto", (0.5, 0.25, 0.125)), ("splitting", (1.0, 0.5, 0.25, 0.125))):
        for order in (4, 6, 8):
            built = build_phigen(problem.spec(order, method))
            libraries[f"phigen {order}, {method}"] = (built.library, steps)
    rows: dict[tuple[str, float], dict[str, Any]] = {}
    for _ in range(min(effort.rounds, 3)):
        for name, (library, steps) in libraries.items():
            for h in steps:
                x, seconds = x0.copy(), np.zeros(1)
                function = library.measure_many
                function.argtypes = (ctypes.c_void_p, ctypes.c_long, ctypes.c_double, ctypes.c_long, ctypes.c_void_p)
                status = function(x.ctypes.data, members, h, round(horizon / h), seconds.ctypes.data)
                row = rows.setdefault((name, h), {"method": name, "h": h, "status": status, "times": []})
                row["times"].append(float(seconds[0]) / members / horizon * 1e9)
                with np.errstate(all="ignore"):
                    row["energy"] = float(np.abs(judge.energy(*x) / judge.energy(*x0) - 1).max())
                    row["casimir"] = float(np.abs((x**2).sum(0) / 3 - 1).max())
    return [*rows.values(), *_heyoka_ensemble(problem, x0, horizon, judge)]


def _heyoka_ensemble(problem: Problem, x0: np.ndarray, horizon: float, judge: Judge) -> list[dict[str, Any]]:
    try:
        import heyoka
    except ImportError:
        return []
    width = heyoka.recommended_simd_size()
    variables = heyoka.make_vars(*problem.coordinates)
    table = dict(zip(problem.symbols, variables, strict=True))
    system = [(v, heyoka.from_sympy(e.evalf(17), table)) for v, e in zip(variables, problem.field, strict=True)]
    rows = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
        solver = heyoka.taylor_adaptive_batch(system, x0[:, :width].copy(), tol=tolerance)
        x, seconds = x0.copy(), 0.0
        for m in range(0, x.shape[1], width):
            solver.set_time(0.0)
            solver.state[:] = x[:, m : m + width]
            began = time.thread_time()
            solver.propagate_until(horizon)
            seconds += time.thread_time() - began
            x[:, m : m + width] = solver.state
        row = {"method": f"heyoka, {width} members at once", "h": tolerance, "status": 0}
        row["times"] = [seconds / x.shape[1] / horizon * 1e9]
        row["energy"] = float(np.abs(judge.energy(*x) / judge.energy(*x0) - 1).max())
        row["casimir"] = float(np.abs((x**2).sum(0) / 3 - 1).max())
        rows.append(row)
    return rows


def growth(effort: Effort) -> list[dict[str, Any]]:
    """Volterra lattices: nanoseconds per step and coordinate, operation by operation the same system."""
    rows = []
    for n in (3, 5, 9) if effort.quick else (3, 5, 9, 15, 21, 30):
        problem = volterra(n)
        methods = {m.name: m for m in c_peers(problem) if m.name in ("RK4 in C", "DOP853 in C", "Kahan in C")}
        for order in problem.orders:
            try:
                built = build_phigen(problem.spec(order))
                methods[f"phigen {order}"] = phigen_method(problem, order, "gauge none")
                row = {"n": n, "method": f"build of phigen {order}", "generating": built.generating}
                rows.append(row | {"compiling": built.compiling})
            except PhigenError as error:
                rows.append({"n": n, "method": f"phigen {order}", "status": str(error).splitlines()[0][:80]})
        judge, h = Judge(problem), problem.typical
        times: dict[str, list[float]] = {name: [] for name in methods}
        for _ in range(min(3, effort.rounds)):
            for name, m in methods.items():
                r = run(m, h, h * 3200, 20, judge, math.inf)
                times[name].append(r.seconds / r.steps / n * 1e9)
        for name, each in times.items():
            over = [t / b for t, b in zip(each, times["RK4 in C"], strict=True)]
            row = {"n": n, "method": name, "status": "ok", "ns_per_coordinate": median(each), "over_rk4": median(over)}
            rows.append(row | {"least": min(over), "most": max(over)})
    return rows


def build_times(folder: Path, effort: Effort) -> list[dict[str, Any]]:
    """Seconds that phigen and the C compiler take for each spec of the corpus."""
    import tempfile

    rows = []
    for path in sorted(folder.glob("*.yaml"))[:: 6 if effort.quick else 1]:
        began = time.process_time()
        try:
            files = emit(compile_proved(specs.load(path)).program, "c", "")
        except PhigenError as error:
            rows.append({"spec": path.stem, "status": str(error).splitlines()[0]})
            continue
        generating = time.process_time() - began
        with tempfile.TemporaryDirectory() as scratch:
            for name, text in files.items():
                (Path(scratch) / name).write_text(text, encoding="utf-8")
            began = time.perf_counter()
            toolchain.compile_library([Path(scratch) / f"{path.stem}.c"], Path(scratch) / "library.so")
            compiling = time.perf_counter() - began
        lines = files[f"{path.stem}.c"].count("\n")
        rows.append({"spec": path.stem, "status": "ok", "phigen": generating, "compiler": compiling, "lines": lines})
    return rows
