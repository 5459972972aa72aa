"""The loop of every integration of a lattice: rows at and between steps, sections, checkpoints, continued runs."""

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

if TYPE_CHECKING:
    from phigen.runtime.lattice import LatticeSession, LatticeSolver

#: Largest number of values in the states of a block of steps that is searched for crossings: 32 MB.
MOST_FOLLOWED = 1 << 22


class Sink(Protocol):
    """Storage of rows. ``seconds`` is the time between two checkpoints."""

    seconds: float

    def see(self, sites: LatticeSession) -> None:
        """Store the present state of a session as the next row."""
        ...

    def begin(self, past: Past) -> None:
        """Store the rows of a finished run that this one continues."""
        ...

    def saved(self) -> dict[str, Any]:
        """Arrays for `restore`, without those that are in files."""
        ...

    def restore(self, arrays: Mapping[str, Any]) -> None:
        """Restore the rows that were stored when the checkpoint was saved; raises `MismatchError`."""
        ...


@dataclass
class LatticeRun:
    """One integration: ``rows`` stores its rows, of which ``count`` are complete, ``crossings`` those of a section."""

    solver: LatticeSolver
    plan: IntegrationPlan
    rows: Sink
    crossings: Sink
    checkpoints: Path | None
    identity: Mapping[str, Any] = field(default_factory=dict)
    count: int = 0
    crossed: list[float] = field(default_factory=list)  # the times of the crossings
    course: Any = None
    last: Any = None  # the session at the latest row

    def make(self, progress: Progress | None) -> None:
        """Make all remaining rows. Raises `BackendError`."""
        self._begin()
        rows, saved = self.plan.rows, time.monotonic()
        for k in range(self.count, len(rows)):
            self._advance(int(rows.whole[k]) - self.course.steps)
            self.last = self._reached(k).sites
            self.rows.see(self.last)
            self.count += 1
            if self.checkpoints and time.monotonic() - saved >= self.rows.seconds:
                self._save()
                saved = time.monotonic()
            if progress:
                progress(int(rows.whole[k]))

    @property
    def times(self) -> Floats:
        """The times of the complete rows."""
        return self.plan.times[: self.count + (len(self.plan.past.t) - 1 if self.plan.past else 0)]

    def _begin(self) -> None:
        """Store the first row, or restore the checkpoint."""
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
            return
        if plan.past:
            self.rows.begin(plan.past)
        else:
            self.rows.see(self.course.sites)
        self.count = 1

    def _finder(self, arrays: Mapping[str, Any]) -> CrossingFinder[ObservedCourse]:
        """The finder of the crossings of the section, restored from ``arrays``."""
        plan, section = self.plan, self.plan.section
        assert section
        block = max(1, min(BLOCK, MOST_FOLLOWED // plan.at.x.size))
        clock: dict[str, Any] = {"timed": bool(self.solver.interface.time), "direction": section.direction}
        finder = CrossingFinder[ObservedCourse](section.g, plan.at.h, plan.begin, block=block, **clock)
        if "section.values" in arrays:
            finder.values = arrays["section.values"].tolist()
            before = {name.removeprefix("past."): a for name, a in arrays.items() if name.startswith("past.")}
            finder.past = [ObservedCourse.restored(self.solver, plan.at, plan.retry, before)] if before else []
        return finder

    def _advance(self, steps: int) -> None:
        """Make whole steps, and store the crossings of the section among them."""
        course, h = self.course, self.plan.at.h
        if self.finder is None:
            course.advance(h, steps)
            return
        for _, crossings in self.finder.follow(course, steps, lambda: course.advance(h, 1)):
            self._cross(crossings)

    def _cross(self, crossings: list[tuple[float, Floats]]) -> None:
        """Store crossings with the states of the finder's sessions at them."""
        assert self.finder
        for (t, _), (_, there) in zip(crossings, self.finder.places, strict=False):
            self.crossed.append(t)
            self.crossings.see(there.sites)

    def _reached(self, k: int) -> ObservedCourse:
        """The course at row k, from the whole steps before it."""
        rows, part = self.plan.rows, float(self.plan.rows.part[k])
        course: ObservedCourse = self.course
        if k == len(rows) - 1 and rows.end:
            there: ObservedCourse
            there, number = rows.end.finish(course)
            if self.finder and number > course.steps:
                self._cross(self.finder.within(course, number - course.steps))
            return there
        if not part:
            return course
        between: ObservedCourse = course.branch()
        between.advance(part, 1)
        return between

    # --- checkpoints

    def forget(self) -> None:
        """Remove the checkpoint."""
        if self.checkpoints:
            self.checkpoints.unlink(missing_ok=True)

    def _save(self) -> None:
        assert self.checkpoints
        arrays: dict[str, Any] = {"count": np.array(self.count), **self.course.saved(), **self.rows.saved()}
        arrays |= {f"section.{name}": array for name, array in self.crossings.saved().items()}
        arrays["crossed"] = np.array(self.crossed)
        if self.finder:
            arrays["section.values"] = np.array(self.finder.values)
            for before in self.finder.past:
                arrays |= {f"past.{name}": array for name, array in before.saved().items()}
        Checkpoint(self._identity(), arrays).save(self.checkpoints)

    def _identity(self) -> dict[str, Any]:
        plan = self.plan
        about = identity_of(self.solver, plan.at, plan.rows.described())
        about |= {"retry": plan.retry} if plan.retry else {}
        about |= {"section": [plan.section.text, plan.section.direction]} if plan.section else {}
        about |= {"past": len(plan.past.t)} if plan.past else {}
        return {**about, **self.identity}

    def _loaded(self) -> Mapping[str, Any]:
        """The arrays of the checkpoint, if there is one."""
        if self.checkpoints is None or not self.checkpoints.exists():
            return {}
        return checkpoint.load(self.checkpoints, self._identity())
