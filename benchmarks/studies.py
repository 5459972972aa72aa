"""Studies of the benchmarks: error against time, cost of a step, growth of the cost with the dimension, build times."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import python_peers
from benchmarks.lanes import lanes_methods
from benchmarks.measure import (
    ENERGY,
    ORBIT,
    SAMPLES,
    Cell,
    Judge,
    Result,
    Scan,
    Study,
    cheapest,
    reach,
    run,
    scan,
    time_cells,
)  # fmt: skip
from benchmarks.problems import Problem, volterra
from benchmarks.solvers import Method, build_phigen, c_peers, dop853_in_vectors, phigen_method, reference
from phigen import spec as specs
from phigen.compiler import compile_proved, emit
from phigen.errors import PhigenError
from phigen.runtime import toolchain


@dataclass(frozen=True)
class Effort:
    """Amount of work: rounds of timing, and limits in seconds of a run over the short and the long horizon.

    If ``long_limit`` is 0, the long horizon is left out.
    """

    rounds: int = 5
    limit: float = 0.12
    long_limit: float = 1.5
    quick: bool = False


#: Beginning of the notes for which the benchmark counts as failed.
GRID_FAILED = "the grid ends too soon"

QUICK = Effort(rounds=3, limit=0.05, long_limit=0.0, quick=True)


def methods_of(problem: Problem, effort: Effort) -> tuple[list[Method], list[str]]:
    """Return phigen's solvers and the other methods for a problem, and notes on methods that could not be built."""
    notes: list[str] = []
    ours: list[Method] = []
    for method in problem.methods:
        if method == "splitting" and _is_exact(problem):
            notes.append("phigen, splitting: left out, since its step is the exact flow of H")
            continue
        orders = problem.orders_of(method)
        for order in orders[1:3] if effort.quick else orders:
            try:
                ours.append(phigen_method(problem, order, method))
            except PhigenError as error:
                notes.append(f"phigen {order} and above, {method}: {str(error).splitlines()[0]}")
                break
    peers = [*c_peers(problem), *lanes_methods(problem)]
    if not effort.quick:
        more, missing = python_peers.available(problem)
        peers += more
        notes += missing
    return [*ours, *peers], notes


def _is_exact(problem: Problem) -> bool:
    """Whether the splitting of a problem gives the exact flow of H. Such a method needs only one step for any
    accuracy."""
    try:
        return build_phigen(problem.spec(2, "splitting")).exact
    except PhigenError:
        return False


def work_precision(problem: Problem, effort: Effort, say: Callable[[str], None]) -> list[Study]:
    """Return the studies of the time that each method needs for each target, over the short and the long horizon."""
    say(f"{problem.name}: building")
    methods, notes = methods_of(problem, effort)
    states, uncertainty = reference(problem, problem.short, SAMPLES["short"])
    notes.append(f"uncertainty of the reference: {uncertainty:.1e}")
    judge, targets = Judge(problem, states), (*ENERGY, *ORBIT)
    say(f"{problem.name}: scanning")
    scans = {m.name: scan(m, problem, judge, targets, effort.limit) for m in methods}
    notes += [f"{GRID_FAILED}: {error}" for s in scans.values() if (error := s.failure())]
    results = {name: list(scanned.results.values()) for name, scanned in scans.items()}
    cells = [cell for target in targets for cell in _cells(methods, results, target)]
    say(f"{problem.name}: timing")
    named = {m.name: m for m in methods}
    time_cells(cells, named, problem.short, SAMPLES["short"], judge, effort.rounds)
    everything = [r for each in results.values() for r in dict.fromkeys(each)]
    studies = [Study(problem.name, problem.title, problem.short, everything, cells, notes)]
    if effort.long_limit:
        say(f"{problem.name}: long horizon")
        studies.append(_long(problem, methods, scans, cells, effort))
    return studies


def _long(problem: Problem, methods: list[Method], scans: dict[str, Scan], short: list[Cell], effort: Effort) -> Study:
    """Return the study over the long horizon, for targets of the energy error only.

    In each row of the table, phigen's method is the one that was fastest over the short horizon. Slow methods of low
    order are left out.
    """
    judge, cells = Judge(problem), []
    runs: dict[str, dict[int, Result]] = {m.name: {} for m in methods}
    for target in ENERGY:
        chosen = {c.result.method for c in short if c.target == target and c.family == "phigen" and c.result}
        # For each row, only the order that was fastest for this target over the short horizon is run.
        ours = [m for m in methods if m.family == "phigen" and m.name in chosen]
        peers = [m for m in methods if m.family != "phigen" and not m.name.startswith(("RK4", "Kahan in", "Poisson"))]
        for m in (*ours, *peers):
            reach(scans[m.name], judge, target, effort.long_limit, runs[m.name])
        cells += _cells([*ours, *peers], {name: list(results.values()) for name, results in runs.items()}, target)
    rounds = max(2, effort.rounds - 3)
    time_cells(cells, {m.name: m for m in methods}, problem.long, SAMPLES["long"], judge, rounds)
    everything = [r for results in runs.values() for r in results.values()]
    return Study(problem.name, problem.title, problem.long, everything, cells, [])


def _cells(methods: list[Method], scans: dict[str, list[Result]], target: tuple[str, float]) -> list[Cell]:
    """Return one cell for each row of the table: the fastest result of all methods that share the row."""
    cells = []
    groups: dict[str, list[Method]] = {}
    for m in methods:
        groups.setdefault(m.row or m.name, []).append(m)
    for label, members in groups.items():
        results = [r for m in members for r in scans[m.name]]
        cells.append(Cell(label, members[0].family, target, cheapest(results, target)))
    return cells


def cost_of_steps(problem: Problem, effort: Effort) -> list[dict[str, Any]]:
    """Return rows with the nanoseconds and evaluations of a step of the typical size, measured for all methods in
    turn."""
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


def growth(effort: Effort) -> list[dict[str, Any]]:
    """Return rows with the nanoseconds per step and coordinate for Volterra lattices of several sizes."""
    rows = []
    for n in (3, 5, 9) if effort.quick else (3, 5, 9, 15, 21, 30):
        problem = volterra(n)
        peers = [m for m in c_peers(problem) if m.name in ("RK4 in C", "DOP853 in C", "Kahan in C")]
        methods = {m.name: m for m in (*peers, dop853_in_vectors(problem), *lanes_methods(problem))}
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
    """Return rows with the seconds that phigen and the C compiler take for each spec of the corpus."""
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
