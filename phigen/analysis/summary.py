"""What a run conserved: numbers for one method, from the states it stored."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.analysis.arrays import Floats, evaluate
from phigen.geometry.system import System
from phigen.spec.model import Run
from phigen.symbolic.symbols import ELAPSED, initial

#: Windows of equal length in which the largest energy error is taken, to tell drift from oscillation.
WINDOWS = 10

#: A quantity that starts below this fraction of the largest coordinate counts as zero: its error is absolute.
_NEGLIGIBLE = 1e-10

#: The largest error of a window without rows.
_NOTHING = -1.0


@dataclass(frozen=True)
class Drift:
    """How far a conserved quantity went: the largest error, relative to the initial value unless that is 0.

    ``growth`` is the largest error in the last tenth of the run over that in the first; 1 without drift, NaN if
    there are too few rows or no error.
    """

    error: float
    relative: bool
    growth: float

    @property
    def kind(self) -> str:
        """``relative`` or ``absolute``."""
        return "relative" if self.relative else "absolute"


@dataclass(frozen=True)
class Summary:
    """What one method conserved; ``exact`` is the largest error against the closed form, None if there is none.

    ``good`` rows of the states are finite; the numbers are about these.
    """

    method: str
    energy: Drift
    casimirs: Mapping[str, Drift]
    invariants: Mapping[str, Drift]
    exact: Drift | None
    final: tuple[float, ...]
    good: int
    rows: int


def summarise(
    method: str, system: System, run: Run | None, parameters: Mapping[str, float], t: Floats, x: Floats
) -> Summary:
    """The summary of states ``x`` (rows, DIM) at times ``t``, all quantities evaluated from their formulas."""
    watch = Watch(method, system, run, parameters, len(x))
    watch.see(t, x)
    return watch.summary()


class Watch:
    """Sums up the states of one method as they come, in memory that does not grow with their number.

    ``rows`` is how many there will be, for the windows in which drift is told from oscillation. ``state`` is all that
    was seen, as arrays.
    """

    def __init__(
        self, method: str, system: System, run: Run | None, parameters: Mapping[str, float], rows: int
    ) -> None:
        self._about = method, rows
        self._system, self._run, self._parameters = system, run, parameters
        self._groups = {
            "energy": {"H": system.hamiltonian},
            "casimirs": system.casimirs,
            "invariants": system.invariants,
        }
        self._formulas = [formula for group in self._groups.values() for formula in group.values()]
        states, quantities = np.full(len(system.coordinates), np.nan), len(self._formulas)
        self.state: dict[str, Any] = {
            "first": states,
            "final": states,
            "start": np.zeros(quantities),
            "maxima": np.full((quantities, WINDOWS + 1), _NOTHING),
            "exact": np.zeros(()),
            "good": np.zeros((), dtype=np.int64),
            "broken": np.zeros((), dtype=bool),
        }

    @property
    def begun(self) -> bool:
        """Whether the initial state has been seen."""
        return bool(self.state["good"])

    def see(self, t: Floats, x: Floats) -> None:
        """Take in the next rows, times (rows,) and states (rows, DIM); those after one not finite do not count."""
        state, good = self.state, int(self.state["good"])
        finite = np.isfinite(x).all(axis=1)
        count = 0 if state["broken"] else len(x) if finite.all() else int(np.argmin(finite))
        state["broken"] = np.asarray(state["broken"] or count < len(x))
        if count == 0:
            return
        t, x = t[:count], x[:count]
        columns = {c: x[:, i] for i, c in enumerate(self._system.coordinates)}
        values = [np.broadcast_to(a, t.shape) for a in evaluate(self._formulas, {**self._parameters, **columns})]
        if good == 0:
            state |= {"first": x[0].copy(), "start": np.array([v[0] for v in values])}
        windows = _windows(np.arange(good, good + count), self._about[1])
        scale = float(np.max(np.abs(state["first"])))
        for k, v in enumerate(values):
            errors, _ = errors_from(float(state["start"][k]), v, scale)
            np.maximum.at(state["maxima"][k], windows, errors)
        if self._run and self._run.exact:
            off = _against_exact(self._system, self._run, self._parameters, state["first"], t, x)
            state["exact"] = np.asarray(max(off, float(state["exact"])))
        state |= {"final": x[-1].copy(), "good": np.asarray(good + count)}

    def summary(self) -> Summary:
        """The summary of what was seen."""
        (method, rows), state = self._about, self.state
        scale = float(np.max(np.abs(state["first"])))
        found = iter([_drift(m, float(s), scale, rows) for m, s in zip(state["maxima"], state["start"], strict=True)])
        drifts = {kind: {name: next(found) for name in group} for kind, group in self._groups.items()}
        return Summary(
            method=method,
            energy=drifts["energy"]["H"],
            casimirs=drifts["casimirs"],
            invariants=drifts["invariants"],
            exact=Drift(float(state["exact"]), True, math.nan) if self._run and self._run.exact else None,
            final=tuple(state["final"].tolist()),
            good=int(state["good"]),
            rows=rows,
        )


def _windows(rows: NDArray[np.int64], of: int) -> NDArray[np.int64]:
    """The window of each row but the first, which has one of its own: `WINDOWS` parts of a run of so many rows."""
    ends = np.cumsum([len(part) for part in np.array_split(np.arange(1, of), WINDOWS)])
    return np.where(rows == 0, WINDOWS, np.searchsorted(ends, rows - 1, side="right"))


def _drift(maxima: Floats, start: float, scale: float, rows: int) -> Drift:
    first, last = float(maxima[0]), float(maxima[WINDOWS - 1])
    usable = rows >= 2 * WINDOWS and first > 0 and last != _NOTHING
    error = float(np.max(maxima)) if np.isfinite(maxima).all() else math.inf
    return Drift(max(error, 0.0), _is_relative(start, scale), last / first if usable else math.nan)


def errors_of(values: Floats, scale: float = 1.0) -> tuple[Floats, bool]:
    """The errors (rows,) of a conserved quantity, and whether they are relative to its initial value.

    They are absolute if that is negligible beside ``scale``, the largest coordinate.
    """
    return errors_from(float(values[0]), values, scale)


def errors_from(start: float, values: Floats, scale: float) -> tuple[Floats, bool]:
    """`errors_of` of later rows of a trajectory, given the initial value."""
    relative = _is_relative(start, scale)
    return np.abs(values - start) / (abs(start) if relative else 1.0), relative


def _is_relative(start: float, scale: float) -> bool:
    return abs(start) > _NEGLIGIBLE * scale


def exact_solution(
    system: System, run: Run, parameters: Mapping[str, float], x0: Floats, t: Floats
) -> dict[str, Floats]:
    """The closed form of a run, coordinate by coordinate, for those it gives."""
    values: dict[str, Any] = {ELAPSED: t, **parameters}
    values |= {initial(c): float(v) for c, v in zip(system.coordinates, x0, strict=True)}
    arrays = evaluate(list(run.exact.values()), values)
    return {c: np.broadcast_to(a, t.shape) for c, a in zip(run.exact, arrays, strict=True)}


def _against_exact(
    system: System, run: Run, parameters: Mapping[str, float], x0: Floats, t: Floats, x: Floats
) -> float:
    """The largest difference, relative to the largest coordinate of the closed form at that time."""
    solution = exact_solution(system, run, parameters, x0, t)
    columns = [system.coordinates.index(c) for c in solution]
    expected = np.column_stack(list(solution.values()))
    scale = np.max(np.abs(expected), axis=1)
    errors = np.max(np.abs(x[:, columns] - expected), axis=1) / np.where(scale > 0, scale, 1.0)
    return float(np.max(errors[np.isfinite(errors)], initial=0.0))
