"""``python -m benchmarks``: all questions, or some of them; see docs/benchmarks.md."""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path

from benchmarks import lattices, plots, studies, tables
from benchmarks.problems import PROBLEMS

ROOT = Path(__file__).resolve().parent.parent
DOCUMENT = ROOT / "docs" / "benchmarks.md"
FIGURES = DOCUMENT.parent / "figures"
BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"
QUESTIONS = ("work", "steps", "ensembles", "growth", "build", "lattices")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="less of everything, in about a minute")
    parser.add_argument("--only", nargs="+", choices=QUESTIONS, default=QUESTIONS, help="questions; all by default")
    names = [p.name for p in PROBLEMS]
    parser.add_argument("--problem", nargs="+", choices=names, default=names, help="problems; all by default")
    parser.add_argument("--output", type=Path, default=Path("benchmark-results"), help="folder for Markdown and JSON")
    parser.add_argument("--write-docs", action="store_true", help="put the tables into docs/benchmarks.md")
    options = parser.parse_args()
    effort = studies.QUICK if options.quick else studies.Effort()
    chosen = [p for p in PROBLEMS if p.name in options.problem]
    began = time.perf_counter()

    def say(text: str) -> None:
        print(f"{time.perf_counter() - began:6.1f} s  {text}", flush=True)

    data: dict[str, object] = {"machine": tables.machine()}
    parts = [f"Measured on {data['machine']}.\n"]
    if "work" in options.only:
        found = [s for p in chosen for s in studies.work_precision(p, effort, say)]
        data["work"] = [asdict(s) for s in found]
        parts.append("## Work and precision\n\n" + tables.speed_ups(found))
        figures = plots.draw(found, FIGURES) if options.write_docs else {}
        for s in found:
            parts += [tables.work_precision(s), figures.pop(s.problem, "")]
    if "steps" in options.only:
        say("cost of steps")
        rows = [row for p in chosen for row in studies.cost_of_steps(p, effort)]
        data["steps"] = rows
        parts.append("## Cost of a step\n\n" + tables.cost_of_steps(rows))
    for name, title, study in (
        ("ensembles", "Ensembles", lambda: studies.ensembles(effort)),
        ("growth", "Growth with dimension", lambda: studies.growth(effort)),
        ("build", "Time to build", lambda: studies.build_times(ROOT / "specs", effort)),
    ):
        if name in options.only:
            say(name)
            rows = study()
            data[name] = rows
            parts.append(f"## {title}\n\n" + getattr(tables, "build_times" if name == "build" else name)(rows))
    if "lattices" in options.only:
        say("lattices")
        measured = {"kernels": lattices.kernels(options.quick), "rings": lattices.rings(options.quick)}
        data["lattices"] = measured
        parts.append(f"## Lattices\n\n{lattices.shown(measured)}")
    text = "\n".join(parts)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "results.md").write_text(text, encoding="utf-8")
    (options.output / "results.json").write_text(json.dumps(data, indent=1), encoding="utf-8")
    if options.write_docs:
        write_into(DOCUMENT, text)
    say(f"done: {options.output}/results.md and results.json")


def write_into(document: Path, text: str) -> None:
    """Replace what stands between the markers."""
    before, _, rest = document.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    document.write_text(f"{before}{BEGIN}\n\n{text.replace('## ', '### ')}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
