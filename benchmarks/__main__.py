"""``python -m benchmarks``: all questions, or some of them; see docs/benchmarks.md."""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks import lattices, plots, studies, tables
from benchmarks.problems import PROBLEMS, Problem
from benchmarks.studies import Effort

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
    effort = studies.QUICK if options.quick else Effort()
    chosen = [p for p in PROBLEMS if p.name in options.problem]
    began = time.perf_counter()

    def say(text: str) -> None:
        print(f"{time.perf_counter() - began:6.1f} s  {text}", flush=True)

    data: dict[str, object] = {"machine": tables.machine()}
    parts = [f"Measured on {data['machine']}.\n"]
    options.output.mkdir(parents=True, exist_ok=True)
    # Compilers are timed too: an empty cache, and none that the user has.
    with tempfile.TemporaryDirectory() as empty:
        os.environ["PHIGEN_CACHE_DIR"] = empty
        for question in options.only:
            say(question)
            data[question], text = answer(question, chosen, effort, say, FIGURES if options.write_docs else None)
            parts.append(text)
            # after each question, for whoever interrupts the next
            (options.output / "results.md").write_text("\n".join(parts), encoding="utf-8")
            (options.output / "results.json").write_text(json.dumps(data, indent=1), encoding="utf-8")
    if options.write_docs:
        write_into(DOCUMENT, "\n".join(parts))
    say(f"done: {options.output}/results.md and results.json")


def answer(
    question: str, chosen: Sequence[Problem], effort: Effort, say: Callable[[str], None], figures: Path | None
) -> tuple[object, str]:
    """The data of one question, and its part of the text; figures are drawn where a folder for them is given."""
    if question == "work":
        found = [s for p in chosen for s in studies.work_precision(p, effort, say)]
        drawn = plots.draw(found, figures) if figures else {}
        parts = ["## Work and precision\n\n" + tables.speed_ups(found)]
        for s in found:
            parts += [tables.work_precision(s), drawn.pop(s.problem, "")]
        return [asdict(s) for s in found], "\n".join(parts)
    if question == "lattices":
        measured = {"kernels": lattices.kernels(effort.quick), "rings": lattices.rings(effort.quick)}
        return measured, f"## Lattices\n\n{lattices.shown(measured)}"
    if question == "steps":
        rows = [row for p in chosen for row in studies.cost_of_steps(p, effort)]
        return rows, "## Cost of a step\n\n" + tables.cost_of_steps(rows)
    if question == "ensembles":
        rows = studies.ensembles(effort)
        return rows, "## Ensembles\n\n" + tables.ensembles(rows)
    if question == "growth":
        rows = studies.growth(effort)
        return rows, "## Growth with dimension\n\n" + tables.growth(rows)
    rows = studies.build_times(ROOT / "specs", effort)
    return rows, "## Time to build\n\n" + tables.build_times(rows)


def write_into(document: Path, text: str) -> None:
    """Replace what stands between the markers."""
    before, _, rest = document.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    document.write_text(f"{before}{BEGIN}\n\n{text.replace('## ', '### ')}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
