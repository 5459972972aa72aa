"""Summary of a run of one method: errors of energy, Casimirs, invariants and solution, computed from its states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.geometry.conservation import ENERGY, RELATIVE, Unit, moving, rounding, units
from phigen.geometry.system import System
from phigen.spec.model import Run
from phigen.study.balance import powers, works
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.symbols import ELAPSED, initial

#: Number of windows: parts of equal length into which a run is divided. The largest errors in the windows show whether
#: an error drifts or oscillates.
WINDOWS = 10

#: Entry for the largest error in a window without rows.
_NOTHING = -1.0
#: Windows are compared only if each coordinate that oscillates has at least this number of turning points in the first
#: window.
_TURNS = 2


@dataclass(frozen=True)
class Drift:
    """Largest error of a conserved quantity, in the unit of the quantity.

    ``growth`` is the largest error in the last tenth of the run, divided by the largest error in the first tenth. It is
    about 1 without drift, and NaN where the quotient has no meaning: if the errors are rounding errors, or if the first
    tenth of the run contains no full oscillation.
    """

    error: float
    unit: Unit
    growth: float = math.nan


@dataclass(frozen=True)
class Summary:
    """Errors of one method in a run with ``rows`` rows. ``good`` is the number of rows before the first row that is not
    finite; later rows are ignored.

    ``exact`` is the largest error against the closed form, None if the run states no closed form. If the method fails
    in its first step, all errors are infinite. If H is not constant along the motion, ``energy`` is the error of H −
    work, and ``change`` is the largest change of H. Then the field ``work`` has the work at the end of the run, and the
    field ``off`` the estimated error of this work, in the unit of the energy.
    """

    method: str
    energy: Drift
    casimirs: Mapping[str, Drift]
    invariants: Mapping[str, Drift]
    exact: Drift | None
    final: tuple[float, ...]
    good: int
    rows: int
    off: float = math.nan
    work: float = 0.0
    change: Drift | None = None

    @property
    def is_balance(self) -> bool:
        """Whether ``energy`` measures H − work instead of H, because H is not conserved."""
        return math.isfinite(self.off)

    @property
    def units(self) -> dict[str, Unit]:
        """Units in which the errors are measured, by the name of the quantity."""
        return {ENERGY: self.energy.unit, **{n: d.unit for n, d in {**self.casimirs, **self.invariants}.items()}}


def summarise(
    method: str, system: System, run: Run | None, parameters: Mapping[str, float], t: Floats, x: Floats
) -> Summary:
    """Return the summary of the states ``x`` (rows, DIM) at the times ``t`` (rows,) of a run of ``method``.

    Energy, Casimirs and invariants are evaluated from the formulas of the system.
    """
    watch = Watch(method, system, run, parameters, len(x))
    watch.see(t, x)
    return watch.summary()


class Watch:
    """Running summary of the states of one method. Its memory does not grow with the number of states.

    The run will have ``rows`` rows. The rows are divided into `WINDOWS` parts of equal length, whose largest errors are
    compared. ``state`` has all intermediate results, as arrays that can be saved.
    """

    def __init__(
        self, method: str, system: System, run: Run | None, parameters: Mapping[str, float], rows: int
    ) -> None:
        self._about = method, rows
        self._system, self._run, self._parameters = system, run, parameters
        self._groups = {
            ENERGY: {"H": system.hamiltonian},
            "casimirs": system.casimirs,
            "invariants": system.invariants,
        }
        self._formulas = [formula for group in self._groups.values() for formula in group.values()]
        self._found: list[Unit] = []
        states, quantities = np.full(len(system.coordinates), np.nan), len(self._formulas)
        self.state: dict[str, Any] = {
            "first": states,
            "final": states,
            "start": np.zeros(quantities),
            "maxima": np.full((quantities, WINDOWS + 1), _NOTHING),
            "exact": np.zeros(()),
            "turns": np.zeros((2, len(system.coordinates)), dtype=np.int64),
            "heading": np.zeros(len(system.coordinates)),
            "good": np.zeros((), dtype=np.int64),
            "broken": np.zeros((), dtype=bool),
        }
        self._powers = powers(system)
        # "instant": the last time, with the power and its derivatives at this time. "work": the work so far, and its
        # estimated error.
        if self._powers:
            self.state |= {"instant": np.full(1 + len(self._powers), np.nan), "work": np.zeros(2)}
            self.state |= {"change": np.zeros(())}
        if system.driven:
            self.state["since"] = np.zeros(())

    @property
    def begun(self) -> bool:
        """Whether the initial state has been received."""
        return bool(self.state["good"])

    @property
    def good(self) -> int:
        """The number of finite rows that have been received."""
        return int(self.state["good"])

    def break_down(self) -> None:
        """Record that the method failed, so that no further rows follow."""
        self.state["broken"] = np.asarray(True)

    def see(self, t: Floats, x: Floats) -> None:
        """Receive the times (rows,) and the states (rows, DIM) of the next rows.

        The first non-finite row and all rows after it are ignored.
        """
        state, good_rows = self.state, int(self.state["good"])
        finite = np.isfinite(x).all(axis=1)
        count = 0 if state["broken"] else len(x) if finite.all() else int(np.argmin(finite))
        state["broken"] = np.asarray(state["broken"] or count < len(x))
        if count == 0:
            return
        t, x = t[:count], x[:count]
        if "since" in state and not self.begun:
            state["since"] = np.asarray(t[0])
        columns = {c: x[:, i] for i, c in enumerate(self._system.coordinates)} | dict.fromkeys(self._system.times, t)
        evaluation_point = {**self._parameters, **columns}
        values = [np.broadcast_to(a, t.shape) for a in evaluate(self._formulas, evaluation_point)]
        if self._powers:
            work = self._work(t, [np.broadcast_to(a, t.shape) for a in evaluate(self._powers, evaluation_point)])
            energies, values[0] = values[0], values[0] - work
        if good_rows == 0:
            state |= {"first": x[0].copy(), "start": np.array([v[0] for v in values])}
        state["good"] = np.asarray(good_rows + count)
        windows = _windows(np.arange(good_rows, good_rows + count), self._about[1])
        for k, (v, unit) in enumerate(zip(values, self._units(), strict=True)):
            with np.errstate(invalid="ignore"):  # no warning if the initial value is not finite: then errors are NaN
                np.maximum.at(state["maxima"][k], windows, unit.errors(v, float(state["start"][k])))
        if self._powers:  # the work at the start is 0, so state["start"] has the initial H
            changes = self._units()[0].errors(energies, float(state["start"][0]))
            state["change"] = np.maximum(state["change"], np.max(changes))
        self._see_turns(x, windows)
        if self._run and self._run.exact:
            exact_error = _against_exact(self._system, self._run, self._parameters, state["first"], t, x)
            state["exact"] = np.asarray(max(exact_error, float(state["exact"])))
        state["final"] = x[-1].copy()

    def _work(self, t: Floats, slopes: Sequence[Floats]) -> Floats:
        """Return the work done from the start to each of the times ``t``. The work up to the last of the times is
        stored for the next call.

        ``slopes`` are the power and its derivatives at these times. The times are later than those of earlier calls.
        """
        state = self.state
        if not self.begun:
            state["instant"] = np.array([t[0], *(f[0] for f in slopes)])
        rows = np.concatenate([state["instant"][:, np.newaxis], np.array([t, *slopes])], axis=1)
        parts, work_error = works(rows[0], rows[1:])
        sums: Floats = state["work"][0] + np.cumsum(parts)
        state["work"] = np.array([sums[-1], state["work"][1] + np.sum(work_error)])
        state["instant"] = rows[:, -1].copy()
        return sums

    def summary(self) -> Summary:
        """Return the summary of the rows received so far."""
        (method, rows), state = self._about, self.state
        steps = self._run.steps if self._run else rows
        telling = rows >= 2 * WINDOWS and _is_telling(state["turns"])
        failed = bool(state["broken"]) and self.good <= 1  # no finite row follows the initial state
        maxima = np.full_like(state["maxima"], math.inf) if failed else state["maxima"]
        drifts = [_drift(m, unit, steps, telling) for m, unit in zip(maxima, self._units(), strict=True)]
        drift_of = iter(drifts)
        drifts_by_kind = {kind: {name: next(drift_of) for name in group} for kind, group in self._groups.items()}
        return Summary(
            method=method,
            energy=drifts_by_kind[ENERGY]["H"],
            casimirs=drifts_by_kind["casimirs"],
            invariants=drifts_by_kind["invariants"],
            exact=Drift(math.inf if failed else float(state["exact"]), Unit(kind=RELATIVE))
            if self._run and self._run.exact
            else None,
            final=tuple(state["final"].tolist()),
            good=int(state["good"]),
            rows=rows,
            work=float(state["work"][0]) if self._powers else 0.0,
            change=Drift(math.inf if failed else float(state["change"]), drifts_by_kind[ENERGY]["H"].unit)
            if self._powers
            else None,
            off=float(state["work"][1]) / drifts_by_kind[ENERGY]["H"].unit.size if self._powers else math.nan,
        )

    def _units(self) -> Sequence[Unit]:
        if not self._found and self.begun:
            values = {**self._parameters, **{t: float(self.state["since"]) for t in self._system.times}}
            unit_list = units(self._formulas, self._system.coordinates, values, self.state["first"])
            names, changing = [ENERGY, *self._groups["casimirs"], *self._groups["invariants"]], moving(self._system)
            self._found = [replace(unit, moves=name in changing) for name, unit in zip(names, unit_list, strict=True)]
        return self._found or [Unit()] * len(self._formulas)

    def _see_turns(self, x: Floats, windows: NDArray[np.int64]) -> None:
        """Count the turning points of each coordinate in the first window and in the whole run.

        Windows are explained at `WINDOWS`. For each row of ``x``, ``windows`` has the number of the window.
        """
        state = self.state
        previous = state["final"] if np.isfinite(state["final"]).all() else x[0]
        for i, moves in enumerate(np.diff(x, axis=0, prepend=previous[None]).T):
            moving = np.flatnonzero(moves)
            signs = np.concatenate([[state["heading"][i]], np.sign(moves[moving])])
            turn_windows = windows[moving[signs[1:] * signs[:-1] < 0]]
            state["turns"][:, i] += (int((turn_windows == 0).sum()), len(turn_windows))
            state["heading"][i] = signs[-1]


def _is_telling(turns: NDArray[np.int64]) -> bool:
    """Whether windows can be compared: the first one contains an oscillation of each coordinate that oscillates.

    ``turns`` (2, DIM) are the numbers of turning points in the first window and in the whole run.
    """
    turning = turns[1] > 0
    return bool(turning.any() and (turns[0, turning] >= _TURNS).all())


def _windows(rows: NDArray[np.int64], row_count: int) -> NDArray[np.int64]:
    """Return, for each row number in ``rows``, the number of the window that contains the row.

    Windows are numbered from 0. The initial row 0 is in no window, and gets the number `WINDOWS`. ``row_count`` is the
    number of all rows of the run.
    """
    share, remainder = divmod(row_count - 1, WINDOWS)
    window_ends = np.cumsum([share + (k < remainder) for k in range(WINDOWS)])
    return np.where(rows == 0, WINDOWS, np.searchsorted(window_ends, rows - 1, side="right"))


def _drift(maxima: Floats, unit: Unit, steps: int, telling: bool) -> Drift:
    first, last = float(maxima[0]), float(maxima[WINDOWS - 1])
    error = max(float(np.max(maxima)) if np.isfinite(maxima).all() else math.inf, 0.0)
    compared = telling and first > 0 and last != _NOTHING and error > rounding(steps) * unit.terms
    return Drift(error, unit, last / first if compared else math.nan)


def exact_solution(
    system: System, run: Run, parameters: Mapping[str, float], x0: Floats, t: Floats
) -> dict[str, Floats]:
    """Return the closed form of the run at the times ``t``, as arrays by coordinate.

    Coordinates without a closed form are left out.
    """
    values: dict[str, Any] = {ELAPSED: t, **parameters}
    values |= {initial(c): float(v) for c, v in zip(system.coordinates, x0, strict=True)}
    arrays = evaluate(list(run.exact.values()), values)
    return {c: np.broadcast_to(a, t.shape) for c, a in zip(run.exact, arrays, strict=True)}


def _against_exact(
    system: System, run: Run, parameters: Mapping[str, float], x0: Floats, t: Floats, x: Floats
) -> float:
    """Return the largest error of the states ``x`` (rows, DIM) against the closed form of the run.

    An error is relative to the largest coordinate of the closed form at the same time.
    """
    solution = exact_solution(system, run, parameters, x0, t)
    columns = [system.coordinates.index(c) for c in solution]
    expected = np.column_stack(list(solution.values()))
    scale = np.max(np.abs(expected), axis=1)
    errors = np.max(np.abs(x[:, columns] - expected), axis=1) / np.where(scale > 0, scale, 1.0)
    return float(np.max(errors[np.isfinite(errors)], initial=0.0))
