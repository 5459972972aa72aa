"""Tables of measurements in Markdown. Times are shown together with ratios of times from the same run of the
benchmark."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.measure import ENERGY, ORBIT, Cell, Study, Target, ratios
from phigen.runtime import toolchain

#: Flags of processors with SIMD, widest first, and the text that names them. Solvers in SIMD lanes are faster with
#: wider registers.
VECTORS = (("avx512f", ", AVX-512"), ("avx2", ", AVX2"))


def machine() -> str:
    """Return a line with the processor and its widest SIMD registers, the compiler and its flags, and the Python
    version."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text().splitlines()
        names = [line.partition(":")[2].strip() for line in lines if "model name" in line]
        flags = {flag for line in lines if line.startswith("flags") for flag in line.split()}
        widest = next((title for flag, title in VECTORS if flag in flags), "")
        model = f"{names[0]}, {len(names)} cores{widest}" if names else model
    compiler = toolchain.find()
    return f"{model}; {compiler.version}; `{' '.join(compiler.flags)}`; Python {platform.python_version()}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def work_precision(study: Study) -> str:
    """Return the table of a study: for each method and target its time over that of phigen's fastest method."""
    targets = list(dict.fromkeys(c.target for c in study.cells))
    best = {t: _best(study.cells, t, "phigen") for t in targets}
    rows = []
    for label in dict.fromkeys(c.method for c in study.cells):
        row = [label]
        found = {c.target: c for c in study.cells if c.method == label}
        row += [_entry(found.get(t), best[t]) for t in targets]
        results = [c.result for c in found.values() if c.result]
        sharp = min(results, key=lambda r: r.energy, default=None)
        row += [f"{sharp.casimir:.0e}", sharp.drift_class] if sharp else ["", ""]
        rows.append(row)
    rows.append(
        ["**phigen's best, ms**", *(f"{1e3 * median(b.times):.3g}" if b else "–" for b in best.values()), "", ""]
    )
    rows.append(["**best peer / phigen**", *(_speed_up(study, t, best[t]) for t in targets), "", ""])
    head = ["", *(f"{'energy' if t[0] == 'energy' else 'orbit'} {t[1]:.0e}" for t in targets), "Casimir", "drift"]
    failures = _failures(study)
    text = f"### {study.title}, T = {study.horizon:g}\n\n{table(head, rows)}\n"
    return text + "".join(f"\n- {note}" for note in [*study.notes, *failures]) + "\n"


def _entry(cell: Cell | None, best: Cell | None) -> str:
    if cell is None or cell.result is None or not cell.times:
        return "not reached"
    name = f"h={cell.result.setting:.3g}" if cell.result.step_based else f"{cell.result.setting:.0e}"
    if cell.result.variant:
        name = f"{cell.result.variant}, {name}"
    if best is None:
        return f"{1e3 * median(cell.times):.3g} ms ({name})"
    if cell is best:
        return f"**1** ({name})"
    middle, least, most = ratios(cell.times, best.times)
    return f"{middle:.2f} [{least:.2f}–{most:.2f}] ({name})"


def _speed_up(study: Study, target: Target, best: Cell | None) -> str:
    peer = _best(study.cells, target, "peer")
    if best is None or peer is None:
        return "phigen alone" if best else "peers alone" if peer else "–"
    middle, least, most = ratios(peer.times, best.times)
    return f"**{middle:.2f}** [{least:.2f}–{most:.2f}] {peer.method}"


def _best(cells: Sequence[Cell], target: Target, family: str) -> Cell | None:
    able = [c for c in cells if c.target == target and c.family == family and c.times]
    return min(able, key=lambda c: median(c.times), default=None)


def _failures(study: Study) -> list[str]:
    """Return a line for each method with failed runs. Such runs are not in the table."""
    failed: dict[tuple[str, str], list[float]] = {}
    for r in study.scans:
        if r.status not in ("ok", "too slow"):
            failed.setdefault((r.method, r.status), []).append(r.setting)
    return [f"{m}: {status} at h = {', '.join(f'{h:.3g}' for h in hs)}" for (m, status), hs in failed.items()]


def speed_up_row(study: Study) -> list[str]:
    """Return a row of the summary: for each target the time of the fastest other method over that of phigen's
    fastest."""
    entries = [_speed_up(study, t, _best(study.cells, t, "phigen")) for t in (*ENERGY, *ORBIT)]
    return [f"{study.title}, T = {study.horizon:g}", *entries]


def speed_ups(rows: Sequence[Sequence[str]]) -> str:
    """Return the table that summarises all problems and horizons."""
    return table(["best peer / phigen", *(f"{t[0]} {t[1]:.0e}" for t in (*ENERGY, *ORBIT))], rows) + "\n"


def cost_of_steps(rows: Sequence[dict[str, Any]]) -> str:
    text = [
        [
            r["problem"], r["method"], f"{r['h']:g}", f"{r['ns']:.0f}",
            f"{r['over_rk4']:.2f} [{r['least']:.2f}–{r['most']:.2f}]",
            f"{r['evaluations']:.2f}" if r["evaluations"] else "", r["status"],
        ]
        for r in rows
    ]  # fmt: skip
    return table(["", "method", "h", "ns per step", "over RK4 in C", "evaluations per step", "status"], text) + "\n"


def growth(rows: Sequence[dict[str, Any]]) -> str:
    text = []
    for r in rows:
        if "generating" in r:
            text.append([str(r["n"]), r["method"], "", f"{r['generating']:.2f} s, compiler {r['compiling']:.2f} s", ""])
        elif r["status"] != "ok":
            text.append([str(r["n"]), r["method"], "", "", r["status"]])
        else:
            over = f"{r['over_rk4']:.2f} [{r['least']:.2f}–{r['most']:.2f}]"
            text.append([str(r["n"]), r["method"], f"{r['ns_per_coordinate']:.1f}", over, "ok"])
    return table(["n", "method", "ns per step and coordinate", "over RK4 in C", "status"], text) + "\n"


def build_times(rows: Sequence[dict[str, Any]]) -> str:
    text = [
        [r["spec"], f"{r['phigen']:.2f}", f"{r['compiler']:.2f}", str(r["lines"])]
        if r["status"] == "ok"
        else [r["spec"], r["status"], "", ""]
        for r in rows
    ]
    return table(["spec", "phigen, s", "C compiler, s", "lines of C"], text) + "\n"
