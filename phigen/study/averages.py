"""Time averages of observables along a run, with standard errors from block averages.

Successive rows of a run are correlated, so the standard error of their mean is estimated from means of blocks that are
longer than the correlation time. Whenever there are twice as many blocks as requested, pairs of blocks are merged
(Flyvbjerg and Petersen, J. Chem. Phys. 91 (1989) 461). So the memory does not depend on the length of the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from phigen.runtime.interface import Floats
from phigen.runtime.lattice import LatticeTrajectory
from phigen.runtime.lattice_series import LatticeSeries
from phigen.runtime.trajectory import Trajectory
from phigen.spec.model import Run

#: Default number of blocks for the standard error. With 20 blocks, the standard error itself has a
#: relative standard deviation of 1/sqrt(2·19) = 0.16.
BLOCKS = 20
#: Least length of blocks for a reliable standard error, in correlation times τ. With blocks of length L, the variance
#: of the mean is estimated as 1 − τ/L times its true value. With blocks of this least length, the estimate is 10 % too
#: small.
LEAST_LENGTH = 10.0
#: An observable counts as conserved, up to the error of the method, if its values differ by less than this fraction of
#: their size. Then its mean counts as resolved, whatever the length of the blocks.
CONSERVED = 1e-6


@dataclass(frozen=True)
class Average:
    """Statistics of one observable over the rows of a run.

    ``error`` is the standard error of the mean, NaN if there are fewer than two blocks. ``correlation_time`` is the
    integrated autocorrelation time in the time unit of the run. Error and correlation time are estimated from blocks.
    ``resolved`` says that the blocks are much longer than the correlation time. If the blocks are shorter, the
    estimates of the error and of the correlation time are too small.
    """

    mean: float
    error: float
    variance: float
    least: float
    largest: float
    correlation_time: float
    resolved: bool = False


class Averages:
    """Running averages of ``width`` observables; ``state`` has all intermediate results, as arrays that can be saved.

    Rows before the time ``after`` are left out. In a run backwards in time, rows with larger times are left out.
    Standard errors come from blocks of rows. As soon as there are ``blocks`` rows, the number of blocks is at least
    ``blocks`` and less than 2·``blocks``.
    """

    def __init__(
        self, width: int, *, after: float | None = None, backwards: bool = False, blocks: int | None = None
    ) -> None:
        self._after = -math.inf if after is None else after
        self._sign, self._blocks = -1.0 if backwards else 1.0, blocks or BLOCKS
        self.state: dict[str, Any] = {
            "count": np.zeros((), dtype=np.int64),
            "mean": np.zeros(width),
            "squares": np.zeros(width),  # sum of squared deviations from the mean
            "least": np.full(width, math.inf),
            "largest": np.full(width, -math.inf),
            "sums": np.empty((0, width)),  # sums over the rows of each block
            "open": np.zeros(width),  # sum over the block that is not yet full
            "size": np.ones((), dtype=np.int64),  # rows per block
            "times": np.full(2, math.nan),  # times of the first and the last row
        }

    @property
    def count(self) -> int:
        """Number of rows that have been averaged so far."""
        return int(self.state["count"])

    @property
    def times(self) -> tuple[float, float]:
        """Times of the first and the last row that were averaged; NaN if there are none."""
        first, last = self.state["times"].tolist()
        return first, last

    def see(self, t: Floats, rows: Floats) -> None:
        """Include new rows of values in the averages. Calls follow the order of the run.

        ``rows`` has the shape (count, width), and ``t`` has the times of the rows (count,).
        """
        selected = self._sign * t >= self._sign * self._after if math.isfinite(self._after) else np.full(len(t), True)
        t, rows = t[selected], rows[selected]
        if not len(rows) or not rows.shape[1]:
            return
        self._moments(rows)
        first = t[0] if self.count == len(rows) else self.state["times"][0]
        self.state["times"] = np.array([first, t[-1]])
        self._block(rows, self.count - len(rows))

    def _moments(self, rows: Floats) -> None:
        """Merge the mean and the variance of new rows into those of all rows (Chan, Golub and LeVeque, 1979)."""
        state, count_before = self.state, self.count
        count_after = count_before + len(rows)
        mean = rows.mean(axis=0)
        delta = mean - state["mean"]
        squares = ((rows - mean) ** 2).sum(axis=0) + delta**2 * (count_before * len(rows) / count_after)
        self.state |= {
            "count": np.asarray(count_after),
            "mean": state["mean"] + delta * (len(rows) / count_after),
            "squares": state["squares"] + squares,
            "least": np.minimum(state["least"], rows.min(axis=0)),
            "largest": np.maximum(state["largest"], rows.max(axis=0)),
        }

    def _block(self, rows: Floats, count_before: int) -> None:
        """Add rows to the blocks, which already contain ``count_before`` rows."""
        while len(rows):
            size = int(self.state["size"])
            room = size - count_before % size
            block_rows, rows = rows[:room], rows[room:]
            self.state["open"] = self.state["open"] + block_rows.sum(axis=0)
            count_before += len(block_rows)
            if count_before % size == 0:
                self.state["sums"] = np.vstack([self.state["sums"], self.state["open"]])
                self.state["open"] = np.zeros_like(self.state["open"])
            if len(self.state["sums"]) == 2 * self._blocks:
                self.state["sums"] = self.state["sums"][::2] + self.state["sums"][1::2]
                self.state["size"] = np.asarray(2 * size)

    def results(self) -> list[Average]:
        """Return the statistics of each observable; NaN if there are too few rows."""
        state, n = self.state, self.count
        if not n:
            return [Average(*(math.nan,) * 6) for _ in state["mean"]]
        variance = state["squares"] / (n - 1) if n > 1 else np.full_like(state["mean"], math.nan)
        blocks, size = len(state["sums"]), int(state["size"])
        error = time = np.full_like(state["mean"], math.nan)
        resolved = np.full(time.shape, False)
        if blocks > 1:
            of_blocks = (state["sums"] / size).var(axis=0, ddof=1)
            error = np.sqrt(of_blocks / blocks)
            first, last = self.times
            apart = abs(last - first) / max(1, n - 1)
            with np.errstate(all="ignore"):
                time = np.where(variance > 0, 0.5 * apart * size * of_blocks / variance, 0.0)
            resolved = LEAST_LENGTH * time <= apart * size
        magnitude = np.maximum(np.abs(state["least"]), np.abs(state["largest"]))
        resolved |= state["largest"] - state["least"] <= CONSERVED * magnitude
        columns = (state["mean"], error, variance, state["least"], state["largest"], time)
        rows = zip(*(column.tolist() for column in columns), resolved.tolist(), strict=True)
        return [Average(*row) for row in rows]


def averages(
    trajectory: Trajectory | LatticeTrajectory | LatticeSeries, *, after: float | None = None, blocks: int | None = None
) -> dict[str, Average]:
    """Return the time averages of the observables of a trajectory, or of the columns of a series, by name.

    Rows from the time ``after`` on are averaged. Standard errors come from at least ``blocks`` blocks. ``phigen run``
    and sweeps take ``after`` and ``blocks`` from the setting ``average:`` of a run. A trajectory does not contain this
    setting, so both values must be passed to obtain the numbers that ``phigen run`` prints. Observables of lattices
    with a value at each site are left out. Raises ValueError if no row is at or after the time ``after``.
    """
    end, sign = float(trajectory.t[-1]), -1 if trajectory.h < 0 else 1
    if after is not None and not sign * after <= sign * end:
        raise ValueError(f"after = {after:g} is not before the end of the trajectory, t = {end:g}")
    column_values = trajectory.columns if isinstance(trajectory, LatticeSeries) else trajectory.observables
    columns = {name: values for name, values in column_values.items() if np.ndim(values) == 1}
    running = Averages(len(columns), after=after, backwards=trajectory.h < 0, blocks=blocks)
    running.see(trajectory.t, np.reshape([*columns.values()], (len(columns), -1)).T)
    return dict(zip(columns, running.results(), strict=True))


def averages_of(run: Run, width: int) -> Averages:
    """Return an accumulator for averages of ``width`` observables, with the setting ``average:`` of a run."""
    choice = run.average
    start_time = None if choice.after is None else float(choice.after)
    return Averages(width, after=start_time, backwards=run.step < 0, blocks=choice.blocks)
