"""Step-by-step runs of classical methods in compiled C, for long runs and for Poincaré sections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from phigen.compilation import Compilation
from phigen.runtime.interface import BackendError
from phigen.study import race
from phigen.symbolic.arrays import Floats


@dataclass
class ClassicalCourse:
    """Run of a classical method that is continued step by step, with the interface of `phigen.runtime.session.Course`.

    The compiled function ``runner`` makes the steps. It reads its initial state from the array ``place``. ``x`` is the
    state after ``steps`` steps.
    """

    runner: race.Runner
    place: Floats
    x: Floats
    steps: int = 0

    def state(self) -> Floats:
        """The current state (DIM,), as in `Course`."""
        return self.x.copy()

    def advance(self, h: float, steps: int) -> None:
        """Advance by a number of steps of size ``h``, as in `Course`."""
        self.place[:] = self.x
        end = self.runner(h, steps, 1)
        if end is None:
            raise BackendError("NOT_FINITE", self.steps, self.x[None])
        self.x = end
        self.steps += steps

    def branch(self) -> ClassicalCourse:
        """Return an independent run that starts at the current state, as in `Course`."""
        return ClassicalCourse(self.runner, self.place, self.x, self.steps)


def started(method: str, compilation: Compilation, x0: Floats, parameters: Mapping[str, float]) -> ClassicalCourse:
    """Return a run that starts at x0 (DIM,), by the classical method ``method``.

    Raises `ToolchainError` without a C compiler.
    """
    state = np.array(x0, dtype=np.float64)
    return ClassicalCourse(race.compiled(compilation, [method], state, parameters).runners[method], state, state.copy())
