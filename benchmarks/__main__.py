"""Command line ``python -m benchmarks``: makes the tables of docs/benchmarks.md, docs/gradients.md and
docs/devices.md."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks import devices, document, eccentric, ensembles, lattices, planets, plots, pullbacks, studies, tables
from benchmarks.problems import PROBLEMS, Problem
from benchmarks.studies import Effort
from phigen.errors import PhigenError

ROOT = Path(__file__).resolve().parent.parent
TABLES = (
    "work", "steps", "ensembles", "growth", "build", "lattices", "eccentric", "planets",
    "pullbacks", "gradients", "sharing", "devices",
)  # fmt: skip
#: Tables that need a graphics card. They are made only if ``--only`` names them.
CARDS = ("devices",)
#: Tables that are made in a separate process, since packages that they import read environment variables at the start.
ALONE = ("gradients", "sharing")


@dataclass(frozen=True)
class Session:
    """Settings from the command line."""

    problems: Sequence[Problem]
    effort: Effort
    folder: Path
    docs: bool
    target: str | None
    say: Callable[[str], None]

    def save(self, name: str, data: object, text: str) -> None:
        """Write a table and its data to the folder of results, and with ``--write-docs`` to its page in docs/."""
        (self.folder / f"{name}.json").write_text(json.dumps(data, indent=1), encoding="utf-8")
        (self.folder / f"{name}.md").write_text(text, encoding="utf-8")
        if self.docs:
            document.publish(self.folder, [name])


def main() -> int:
    options = parsed()
    began = time.perf_counter()

    def say(text: str) -> None:
        print(f"{time.perf_counter() - began:6.1f} s  {text}", flush=True)

    problems = [p for p in PROBLEMS if p.name in options.problem]
    effort = studies.QUICK if options.quick else Effort()
    options.output.mkdir(parents=True, exist_ok=True)
    os.environ["PHIGEN_CACHE_DIR"] = str((options.output / "cache").resolve())
    session = Session(problems, effort, options.output, options.write_docs, options.target, say)
    if options.prepare:
        prepare(problems, say)
        return 0
    if options.publish:
        document.publish(options.output, [file.stem for file in options.output.glob("*.md")])
        return 0
    session.save("machine", {}, f"Measured on {tables.machine()}.")
    failures: list[str] = []
    for name in options.only:
        say(name)
        failures += MAKERS[name](session)
    for line in failures:
        say(line)
    say(f"done: {options.output}")
    return 1 if failures else 0


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer and shorter measurements, to try the program")
    parser.add_argument("--only", nargs="+", choices=TABLES, help="tables; by default all but devices",
                        default=[t for t in TABLES if t not in CARDS])  # fmt: skip
    parser.add_argument(
        "--target", choices=("cuda", "opencl"), help="target of the table devices (default: that of a card)"
    )
    names = [p.name for p in PROBLEMS]
    parser.add_argument(
        "--problem", nargs="+", choices=names, default=names, help="problems of the tables work and steps"
    )
    parser.add_argument("--output", type=Path, default=Path("benchmark-results"), help="folder for tables and data")
    parser.add_argument("--prepare", action="store_true", help="only compile the solvers of the tables work and steps")
    parser.add_argument("--publish", action="store_true", help="only put the tables of the folder into docs/")
    parser.add_argument("--write-docs", action="store_true", help="put the tables into the pages of docs/")
    return parser.parse_args()


def prepare(problems: Sequence[Problem], say: Callable[[str], None]) -> None:
    """Compile the solvers of all problems into the cache. Nothing is timed, so two processes work at once."""
    with ProcessPoolExecutor(max_workers=2) as pool:
        for name, notes in zip([p.name for p in problems], pool.map(built, problems), strict=True):
            say("; ".join([name, *notes]))


def built(problem: Problem) -> list[str]:
    return studies.methods_of(problem, Effort())[1]


@contextmanager
def empty_cache() -> Iterator[None]:
    """Context with an empty cache of compiled solvers, for the measurement of compile times."""
    before = os.environ["PHIGEN_CACHE_DIR"]
    with tempfile.TemporaryDirectory() as empty:
        os.environ["PHIGEN_CACHE_DIR"] = empty
        yield
    os.environ["PHIGEN_CACHE_DIR"] = before


def work(session: Session) -> list[str]:
    """Make the table of work against precision for each problem and horizon, and the summary; return failed scans as
    notes.

    The summary covers all problems whose results are in the folder, including those of earlier calls.
    """
    failures = []
    for problem in session.problems:
        measured = studies.work_precision(problem, session.effort, session.say)
        failures += [note for s in measured for note in s.notes if note.startswith(studies.GRID_FAILED)]
        drawn = plots.draw(measured, session.folder / "figures")
        text = "\n".join(f"{tables.work_precision(s)}{drawn.pop(s.problem, '')}" for s in measured)
        data = {"summary": [tables.speed_up_row(s) for s in measured], "studies": [asdict(s) for s in measured]}
        session.save(f"work-{problem.name}", data, text)
    files = [session.folder / f"work-{p.name}.json" for p in PROBLEMS]
    rows = [row for f in files if f.exists() for row in json.loads(f.read_text(encoding="utf-8"))["summary"]]
    session.save("summary", rows, tables.speed_ups(rows))
    return failures


def steps(session: Session) -> list[str]:
    rows = [row for p in session.problems for row in studies.cost_of_steps(p, session.effort)]
    session.save("steps", rows, tables.cost_of_steps(rows))
    return []


def members(session: Session) -> list[str]:
    data = ensembles.measured(session.effort.quick)
    session.save("ensembles", data, ensembles.shown(data))
    return []


def growth(session: Session) -> list[str]:
    with empty_cache():
        rows = studies.growth(session.effort)
    session.save("growth", rows, tables.growth(rows))
    return []


def build(session: Session) -> list[str]:
    rows = studies.build_times(ROOT / "specs", session.effort)
    session.save("build", rows, tables.build_times(rows))
    return []


def sites(session: Session) -> list[str]:
    quick = session.effort.quick
    data = {"kernels": lattices.kernels(quick), "rings": lattices.rings(quick)}
    session.save("lattices", data, lattices.shown(data))
    return []


def orbit(session: Session) -> list[str]:
    periods = 20 if session.effort.quick else 200
    rows = eccentric.measured(periods, session.say)
    session.save("eccentric", [asdict(r) for r in rows], eccentric.shown(rows, periods))
    return []


def bodies(session: Session) -> list[str]:
    session.save("planets", {}, planets.measured(session.effort.quick, session.say))
    return []


def passes(session: Session) -> list[str]:
    """Make the tables of docs/gradients.md. Returns no failures."""
    for name, text in pullbacks.measured(session.effort.quick, session.say).items():
        session.save(name, {}, text)
    return []


def cards(session: Session) -> list[str]:
    """Make the tables of docs/devices.md, and return failures. Each part is saved at once, since a card may fail
    later."""
    parts: list[str] = []
    try:
        for part in devices.measured(session.target, session.effort.quick, session.say):
            parts.append(part)
            session.save("devices", {}, "\n\n".join(parts) + "\n")
    except PhigenError as error:
        return [f"devices: {error}"]
    return [line for line in "\n".join(parts).splitlines() if "failed: " in line]


def alone(name: str) -> Callable[[Session], list[str]]:
    """Return the function that makes a table by running the module ``benchmarks.NAME`` in another process."""

    def make(session: Session) -> list[str]:
        import subprocess

        command = [sys.executable, "-m", f"benchmarks.{name}", *(["--quick"] if session.effort.quick else [])]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
        if done.returncode:
            return [f"{name}: {done.stderr.strip().splitlines()[-1]}"]
        session.save(name, {}, done.stdout)
        return []

    return make


MAKERS: dict[str, Callable[[Session], list[str]]] = {
    "work": work, "steps": steps, "ensembles": members, "growth": growth, "build": build, "lattices": sites,
    "eccentric": orbit, "planets": bodies, "pullbacks": passes, "devices": cards,
    **{name: alone(name) for name in ALONE},
}  # fmt: skip

if __name__ == "__main__":
    sys.exit(main())
