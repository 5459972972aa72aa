"""Plans of integrations of lattices: the steps at which rows are stored, and the other settings of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phigen.runtime.arguments import Beginning
from phigen.runtime.crossings import Function
from phigen.runtime.ending import End
from phigen.runtime.interface import Floats, row_steps
from phigen.runtime.timed import EQUAL, whole_steps

if TYPE_CHECKING:
    from phigen.runtime.spectra import Transforms


@dataclass(frozen=True)
class RowSteps:
    """Positions of the rows of a run. Row k is reached by ``whole[k]`` whole steps and a shorter step.

    ``part[k]`` is the size of the shorter step, or 0 if row k is at the end of a whole step. The first row is the
    start. The last row is the end of the run, which ``end`` describes. If ``end`` is None, the run ends after a whole
    number of steps. With a monitor and rows at given times, ``spans`` (rows,) are the times from the start to the rows;
    the number of steps before each row is then counted during the run.
    """

    whole: NDArray[np.int64]
    part: Floats
    end: End | None = None
    spans: Floats | None = None

    def __len__(self) -> int:
        return len(self.whole)

    @property
    def steps(self) -> int:
        """Number of whole steps up to the last row."""
        return int(self.whole[-1])

    def times(self, begin: float, h: float) -> Floats:
        """Return the times of the rows (rows,); ``begin`` is the time of the start."""
        return np.asarray(begin + (h * self.whole + self.part), dtype=np.float64)

    def described(self) -> list[int | float]:
        """Return a few numbers that identify the rows.

        A checkpoint stores the numbers. A run can be resumed only from a checkpoint with the same numbers.
        """
        rows = [len(self), self.steps, int(self.whole[min(1, len(self) - 1)])]
        spans = [] if self.spans is None else [float(self.spans.sum())]
        return [*rows, *spans, *([] if not self.part.any() else [float(self.part.sum()), float(self.part[-1])])]


def strided(h: float, steps: int, stride: int, end: End | None = None) -> RowSteps:
    """Return rows after every ``stride``-th step, and a last row at the end of the run.

    The run ends at ``end`` or, if ``end`` is None, after ``steps`` steps.
    """
    if end is None or not end.part:
        whole_rows = row_steps(steps if end is None else end.steps, stride)
        return RowSteps(whole_rows, np.zeros(len(whole_rows)), end)
    whole_rows = np.append(np.arange(0, end.steps + 1, stride, dtype=np.int64), end.steps)
    part = np.zeros(len(whole_rows))
    part[-1] = end.span - end.steps * h
    return RowSteps(whole_rows, part, end)


def timed(h: float, steps: int, spans: Sequence[float], end: End | None = None) -> RowSteps:
    """Return rows at the times ``spans`` after the start, and a last row at the end of the run.

    The run ends at ``end`` or, if ``end`` is None, after ``steps`` steps.
    """
    last = h * steps if end is None else end.span
    inner = [span for span in spans if abs(last - span) > EQUAL * abs(last)]
    step_numbers = [whole_steps(h, span) for span in inner]
    left = np.array([span - h * count for span, count in zip(inner, step_numbers, strict=True)])
    part = np.where(np.abs(left) > EQUAL * np.abs(inner), left, 0.0)
    tail = strided(h, steps, max(1, steps if end is None else end.steps), end)
    step_numbers = [0, *step_numbers, int(tail.whole[-1])]
    return RowSteps(np.array(step_numbers, dtype=np.int64), np.array([0.0, *part, tail.part[-1]]), end)


def timed_in_tau(spans: Sequence[float], end: End) -> RowSteps:
    """Return the rows of a run with a monitor (rescaled time: dt = g dτ). They are at the start, at the times ``spans``
    after it, and at the end.
    """
    inner = [span for span in spans if abs(end.span - span) > EQUAL * abs(end.span)]
    step_numbers = np.zeros(len(inner) + 2, dtype=np.int64)
    step_numbers[-1] = end.steps
    return RowSteps(step_numbers, np.zeros(len(step_numbers)), end, np.array([0.0, *inner, end.span]))


@dataclass(frozen=True)
class Crossed:
    """Section of a run: the zeros of a function ``g`` of the observables.

    The ``direction`` in which g passes through zero is ``rising``, ``falling`` or ``both``. ``text`` is the formula of
    g.
    """

    g: Function
    direction: str
    text: str


@dataclass(frozen=True, eq=False)
class Past:
    """A finished run that another run continues.

    ``t`` (rows,) are its times, and ``columns`` its recorded numbers (rows,) by name, such as the energy. ``x`` (rows,
    coordinates, *sizes) are the states of all rows, None if only numbers were recorded; ``first`` and ``last`` are the
    first and the last state. The run made ``steps`` steps.
    """

    t: Floats
    first: Floats
    last: Floats
    columns: Mapping[str, Floats]
    steps: int
    x: Floats | None = None


@dataclass(frozen=True)
class IntegrationPlan:
    """Plan of an integration: the initial values ``at``, the ``rows`` to store, and further settings.

    ``begin`` is the initial time, even if H does not depend on the time. A failing step is halved at most ``retry``
    times. Crossings of the ``section`` are recorded. ``transforms`` are the spectra and correlations to compute from
    the frames. ``past`` is the finished run that this integration continues. ``origin`` is the provenance text for
    output files.
    """

    at: Beginning
    rows: RowSteps
    begin: float = 0.0
    retry: int = 0
    section: Crossed | None = None
    transforms: Transforms | None = None
    past: Past | None = field(default=None, compare=False)
    origin: str = ""

    @property
    def times(self) -> Floats:
        """The times of all rows. If the integration continues an earlier run, the times of the earlier run come
        first.
        """
        times = self.rows.times(self.begin, self.at.h)
        return times if self.past is None else np.append(self.past.t, times[1:])

    @property
    def steps(self) -> int:
        """Number of whole steps up to the end. If an earlier run is continued, its steps are counted too."""
        return self.rows.steps + (self.past.steps if self.past else 0)
