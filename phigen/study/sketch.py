"""Selection of rows of a run for figures, so that the memory does not depend on the length of the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.runtime.trajectory import Trajectory
from phigen.symbolic.arrays import Floats

Numbers = NDArray[np.int64]

#: ROWS: largest number of rows at equal intervals that are stored. WINDOWS: number of equal parts of the run; in each
#: of them, the rows with the largest errors are stored too.
ROWS, WINDOWS = 8000, 400
#: Largest number of points of a section (crossings) that are stored for a figure.
POINTS = 20_000


class Thinned:
    """Selection of at most ``max_rows`` rows from a sequence of rows: all rows, or every second, every fourth, …

    Whenever there are too many selected rows, every second one is dropped. So the selection depends only on the number
    of rows, not on the portions in which they arrive. ``state`` has the rows and counts, as arrays that can be saved.
    """

    def __init__(self, width: int, max_rows: int) -> None:
        self._most = max_rows
        self.state: dict[str, Any] = {
            "rows": np.empty((0, width)),
            "every": np.ones((), dtype=np.int64),
            "seen": np.zeros((), dtype=np.int64),
        }

    @property
    def rows(self) -> Floats:
        """The selected rows (rows, width)."""
        rows: Floats = self.state["rows"]
        return rows

    @property
    def seen(self) -> int:
        """The number of rows received so far."""
        return int(self.state["seen"])

    def see(self, rows: Floats) -> None:
        """Receive the next rows (rows, width)."""
        interval, row_count = int(self.state["every"]), self.seen
        thinned = np.concatenate([self.rows, rows[-row_count % interval :: interval]])
        while len(thinned) > self._most:
            interval, thinned = 2 * interval, thinned[::2]
        self.state |= {"rows": thinned, "every": np.asarray(interval), "seen": np.asarray(row_count + len(rows))}


class Sketch:
    """Selection of the rows of a run for its figures.

    Rows at equal intervals are stored. In addition, the run is divided into `WINDOWS` equal parts. For each part, the
    rows with the largest errors of the energy and of each Casimir are stored. A stored row contains its number, t, x,
    energy, Casimirs and observables. ``rows`` is the number of all rows of the run.
    """

    def __init__(self, dimension: int, casimirs: int, rows: int, observables: int = 0) -> None:
        self._quantities = slice(2 + dimension, 3 + dimension + casimirs)
        self._dimension, self._of = dimension, rows
        width = 3 + dimension + casimirs + observables
        self._thinned = Thinned(width, ROWS)
        self._peaks: dict[str, Any] = {
            "first": np.full(width, np.nan),
            "last": np.full(width, np.nan),
            "errors": np.full((1 + casimirs, WINDOWS), -1.0),
            "peaks": np.full((1 + casimirs, WINDOWS, width), np.nan),
        }

    @property
    def state(self) -> dict[str, Any]:
        """The stored rows and counts, as arrays that can be saved and restored."""
        return {**self._thinned.state, **self._peaks}

    @state.setter
    def state(self, arrays: Mapping[str, Any]) -> None:
        self._thinned.state = {name: arrays[name] for name in self._thinned.state}
        self._peaks = {name: arrays[name] for name in self._peaks}

    def see(self, rows: Floats) -> None:
        """Receive the next rows (rows, 2 + DIM + Casimirs + observables): t, x, energy, Casimirs, observables."""
        if not len(rows):
            return
        numbered = np.column_stack([np.arange(self._thinned.seen, self._thinned.seen + len(rows)), rows])
        if self._thinned.seen == 0:
            self._peaks["first"] = numbered[0]
        self._peaks["last"] = numbered[-1]
        self._thinned.see(numbered)
        first = self._peaks["first"]
        windows = (numbered[:, 0] * WINDOWS // max(self._of, 1)).astype(np.int64).clip(0, WINDOWS - 1)
        for k, values in enumerate(numbered[:, self._quantities].T):
            with np.errstate(invalid="ignore"):  # an infinite value gives ∞ − ∞ = NaN, without a warning
                errors = np.abs(values - first[self._quantities][k])
            for window in np.unique(windows):
                part = np.flatnonzero(windows == window)
                best = part[np.argmax(errors[part])]
                if not errors[best] <= self._peaks["errors"][k, window]:
                    self._peaks["errors"][k, window] = errors[best]
                    self._peaks["peaks"][k, window] = numbered[best]

    def trajectory(
        self,
        coordinates: tuple[str, ...],
        casimirs: tuple[str, ...],
        h: float,
        steps: int,
        parameters: Mapping[str, float],
        broken: bool = False,
        observables: tuple[str, ...] = (),
    ) -> Trajectory:
        """Return the stored rows as a trajectory. If the run has failed (``broken``), a row of NaN is added, whose time
        is one step later."""
        peaks = self._peaks["peaks"].reshape(-1, self._peaks["peaks"].shape[-1])
        stored_rows = np.concatenate(
            [self._thinned.rows, peaks[self._peaks["errors"].ravel() >= 0], self._peaks["last"][None]]
        )
        _, row_indices = np.unique(stored_rows[:, 0], return_index=True)
        rows = stored_rows[row_indices][:, 1:]
        if broken:
            rows = np.vstack([rows, np.full(rows.shape[1], np.nan)])
            rows[-1, 0] = rows[-2, 0] + h
        t, x, values = rows[:, 0], rows[:, 1 : 1 + self._dimension], rows[:, 2 + self._dimension :].T
        return Trajectory(
            t=t,
            x=x,
            energy=rows[:, 1 + self._dimension],
            casimirs=dict(zip(casimirs, values[: len(casimirs)], strict=True)),
            observables=dict(zip(observables, values[len(casimirs) :], strict=True)),
            steps=steps,
            h=h,
            parameters=parameters,
            coordinates=coordinates,
        )
