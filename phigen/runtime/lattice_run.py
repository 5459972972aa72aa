"""The loop that all integrations of lattices use: it makes the rows, and handles sections, checkpoints and continued
runs.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from phigen.runtime import checkpoint
from phigen.runtime.checkpoint import Checkpoint
from phigen.runtime.crossings import BLOCK, CrossingFinder
from phigen.runtime.interface import Floats, Progress
from phigen.runtime.lattice_course import ObservedCourse
from phigen.runtime.lattice_frames import identity_of
from phigen.runtime.lattice_rows import IntegrationPlan, Past
from phigen.runtime.timed import EQUAL, reached, steps_until

if TYPE_CHECKING:
    from phigen.runtime.lattice import LatticeSession, LatticeSolver

#: Crossings are searched in blocks of steps, whose states are in memory. The states of a block have at most this number
#: of values, which take 32 MB.
MOST_FOLLOWED = 1 << 22


class Sink(Protocol):
    """Protocol of objects that store the rows of a run. ``seconds`` is the least time between two checkpoints."""

    seconds: float

    def see(self, sites: LatticeSession) -> None:
        """Store the present state of a session as the next row."""
        ...

    def begin(self, earlier_run: Past) -> None:
        """Store the rows of a finished run, which the present run continues."""
        ...

    def saved(self) -> dict[str, Any]:
        """Return the arrays that a checkpoint stores for `restore`; rows that are already in a file are left out."""
        ...

    def restore(self, arrays: Mapping[str, Any]) -> None:
        """Restore the rows that were stored when the checkpoint was saved. Raises `MismatchError`."""
        ...


@dataclass
class LatticeRun:
    """One integration of a lattice: ``rows`` stores its rows, ``crossings`` the crossings of its section.

    ``count`` is the number of rows that are complete.
    """

    solver: LatticeSolver
    plan: IntegrationPlan
    rows: Sink
    crossings: Sink
    checkpoints: Path | None
    identity: Mapping[str, Any] = field(default_factory=dict)
    count: int = 0
    crossed: list[float] = field(default_factory=list)  # times of the crossings
    clocks: list[float] = field(default_factory=list)  # physical time since the start, for each row
    numbers: list[float] = field(default_factory=list)
    course: Any = None
    last: Any = None  # the session at the latest row

    def make(self, progress: Progress | None) -> None:
        """Make all remaining rows. Raises `BackendError`."""
        self._begin()
        rows, saved = self.plan.rows, time.monotonic()
        for k in range(self.count, len(rows)):
            self._advance(self._steps_before(k) - self.course.steps)
            course_at_row, number = self._reached(k)
            self._store_mark(course_at_row, number)
            self.last = course_at_row.sites
            self.rows.see(self.last)
            self.count += 1
            if self.checkpoints and time.monotonic() - saved >= self.rows.seconds:
                self._save()
                saved = time.monotonic()
            if progress:
                progress(self.course.steps)

    @property
    def times(self) -> Floats:
        """The times of the complete rows. If this run continues an earlier run, the times of the earlier run come
        first."""
        if self.solver.interface.monitored:
            earlier_times = [] if self.plan.past is None else self.plan.past.t[:-1].tolist()
            return np.array([*earlier_times, *(self.plan.begin + t for t in self.clocks)])
        return self.plan.times[: self.count + (len(self.plan.past.t) - 1 if self.plan.past else 0)]

    @property
    def tau(self) -> Floats | None:
        """The values of τ at the complete rows, if a monitor rescales time by dt = g dτ.

        None without a monitor, and for a run that continues another run.
        """
        if not self.solver.interface.monitored or self.plan.past is not None:
            return None
        return self.plan.at.h * np.array(self.numbers)

    def _store_mark(self, course: ObservedCourse, number: float) -> None:
        """Store the time of a row, and the number of steps before the row. Inside a step, the number has a fraction."""
        self.clocks.append(course.time())
        self.numbers.append(number)

    def _steps_before(self, k: int) -> int:
        """Return the number of whole steps from the start of the run to row k."""
        rows, course = self.plan.rows, self.course
        if rows.spans is None or k == len(rows) - 1:
            return int(rows.whole[k])
        ahead, _ = steps_until(course, self.plan.at.h, float(rows.spans[k]) - course.time())
        return int(course.steps + ahead)

    def _begin(self) -> None:
        """Store the first row or, if there is a checkpoint, restore the rows and the state that it holds."""
        plan, arrays = self.plan, self._loaded()
        if arrays:
            self.course = ObservedCourse.restored(self.solver, plan.at, plan.retry, arrays)
            self.count = int(arrays["count"])
        else:
            self.course = ObservedCourse.begun(self.solver, plan.at, plan.retry)
        self.finder, self.last = self._finder(arrays) if plan.section else None, self.course.sites
        if arrays:
            self.rows.restore(arrays)
            self.crossings.restore({name.removeprefix("section."): array for name, array in arrays.items()})
            self.crossed = arrays["crossed"].tolist()
            self.clocks, self.numbers = (arrays[name].tolist() for name in ("clocks", "numbers"))
            return
        self._store_mark(self.course, 0.0)
        if plan.past:
            self.rows.begin(plan.past)
        else:
            self.rows.see(self.course.sites)
        self.count = 1

    def _finder(self, arrays: Mapping[str, Any]) -> CrossingFinder[ObservedCourse]:
        """Return the object that finds crossings of the section. It continues from ``arrays`` of a checkpoint, if there
        are any.
        """
        plan, section = self.plan, self.plan.section
        assert section
        block = max(1, min(BLOCK, MOST_FOLLOWED // plan.at.x.size))
        clock: dict[str, Any] = {"timed": bool(self.solver.interface.time), "direction": section.direction}
        finder = CrossingFinder[ObservedCourse](section.g, plan.at.h, plan.begin, block=block, **clock)
        if "section.values" in arrays:
            finder.values = arrays["section.values"].tolist()
            finder_arrays = {name.removeprefix("past."): a for name, a in arrays.items() if name.startswith("past.")}
            finder.past = (
                [ObservedCourse.restored(self.solver, plan.at, plan.retry, finder_arrays)] if finder_arrays else []
            )
        return finder

    def _advance(self, steps: int) -> None:
        """Make ``steps`` whole steps. If the run has a section, store each crossing of the section."""
        course, h = self.course, self.plan.at.h
        if self.finder is None:
            course.advance(h, steps)
            return
        for _, crossings in self.finder.follow(course, steps, lambda: course.advance(h, 1)):
            self._store_crossings(crossings)

    def _store_crossings(self, crossings: list[tuple[float, Floats]]) -> None:
        """Store the given crossings, with the states of the lattice at which the finder located them."""
        assert self.finder
        for (t, _), (_, crossing_session) in zip(crossings, self.finder.places, strict=False):
            self.crossed.append(t)
            self.crossings.see(crossing_session.sites)

    def _reached(self, k: int) -> tuple[ObservedCourse, float]:
        """Return a session at row k, and the number of steps before row k.

        All whole steps before the row must have been made. If the row lies inside a step, a copy of the run's session
        makes the shorter step to the row.
        """
        rows, part, h = self.plan.rows, float(self.plan.rows.part[k]), self.plan.at.h
        course: ObservedCourse = self.course
        inner_course: ObservedCourse
        if k == len(rows) - 1 and rows.end:
            end_course: ObservedCourse
            end_course, number = rows.end.finish(course)
            if self.finder and number > course.steps:
                self._store_crossings(self.finder.within(course, number - course.steps))
            return end_course, number
        if rows.spans is not None:
            left = float(rows.spans[k]) - course.time()
            if abs(left) <= EQUAL * abs(rows.spans[k]):
                return course, float(course.steps)
            inner_course, part = reached(course, h, left)
            return inner_course, course.steps + part / h
        if not part:
            return course, float(course.steps)
        inner_course = course.branch()
        inner_course.advance(part, 1)
        return inner_course, course.steps + part / h

    # --- checkpoints

    def forget(self) -> None:
        """Remove the checkpoint file, if there is one."""
        if self.checkpoints:
            self.checkpoints.unlink(missing_ok=True)

    def _save(self) -> None:
        assert self.checkpoints
        arrays: dict[str, Any] = {"count": np.array(self.count), **self.course.saved(), **self.rows.saved()}
        arrays |= {f"section.{name}": array for name, array in self.crossings.saved().items()}
        marks = {"crossed": self.crossed, "clocks": self.clocks, "numbers": self.numbers}
        arrays |= {name: np.array(values) for name, values in marks.items()}
        if self.finder:
            arrays["section.values"] = np.array(self.finder.values)
            for crossing in self.finder.past:
                arrays |= {f"past.{name}": array for name, array in crossing.saved().items()}
        Checkpoint(self._identity(), arrays).save(self.checkpoints)

    def _identity(self) -> dict[str, Any]:
        plan = self.plan
        identity = identity_of(self.solver, plan.at, plan.rows.described())
        identity |= {"retry": plan.retry} if plan.retry else {}
        identity |= {"section": [plan.section.text, plan.section.direction]} if plan.section else {}
        identity |= {"past": len(plan.past.t)} if plan.past else {}
        return {**identity, **self.identity}

    def _loaded(self) -> Mapping[str, Any]:
        """Return the arrays of the checkpoint file; {} if there is no file."""
        if self.checkpoints is None or not self.checkpoints.exists():
            return {}
        return checkpoint.load(self.checkpoints, self._identity())
