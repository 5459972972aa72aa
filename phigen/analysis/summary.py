"""What a run conserved: numbers for one method, from the states it stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from phigen.analysis.arrays import Floats, evaluate
from phigen.geometry.system import System
from phigen.spec.model import Run

#: Windows of equal length in which the largest energy error is taken, to tell drift from oscillation.
WINDOWS = 10

#: A quantity that starts below this fraction of the largest coordinate counts as zero: its error is absolute.
_NEGLIGIBLE = 1e-10


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
    rows = len(x)
    good = int(np.argmin(np.isfinite(x).all(axis=1))) or rows
    t, x = t[:good], x[:good]
    values: dict[str, Any] = {**parameters, **{c: x[:, i] for i, c in enumerate(system.coordinates)}}
    scale = float(np.max(np.abs(x[0]), initial=0.0))

    def drifts(formulas: Mapping[str, Any]) -> dict[str, Drift]:
        arrays = evaluate(list(formulas.values()), values)
        return {name: drift(np.broadcast_to(a, t.shape), scale) for name, a in zip(formulas, arrays, strict=True)}

    return Summary(
        method=method,
        energy=drifts({"H": system.hamiltonian})["H"],
        casimirs=drifts(system.casimirs),
        invariants=drifts(system.invariants),
        exact=_against_exact(system, run, parameters, t, x) if run and run.exact else None,
        final=tuple(x[-1].tolist()),
        good=good,
        rows=rows,
    )


def drift(values: Floats, scale: float = 1.0) -> Drift:
    """The drift of the values of one quantity along a trajectory."""
    errors, relative = errors_of(values, scale)
    growth = float("nan")
    if len(errors) >= 2 * WINDOWS:
        windows = [float(np.max(part)) for part in np.array_split(errors[1:], WINDOWS)]
        growth = windows[-1] / windows[0] if windows[0] > 0 else float("nan")
    finite = errors[np.isfinite(errors)]
    return Drift(float(np.max(finite, initial=0.0)) if len(finite) == len(errors) else float("inf"), relative, growth)


def errors_of(values: Floats, scale: float = 1.0) -> tuple[Floats, bool]:
    """The errors (rows,) of a conserved quantity, and whether they are relative to its initial value.

    They are absolute if that is negligible beside ``scale``, the largest coordinate.
    """
    start = float(values[0])
    relative = abs(start) > _NEGLIGIBLE * scale
    return np.abs(values - start) / (abs(start) if relative else 1.0), relative


def exact_solution(
    system: System, run: Run, parameters: Mapping[str, float], x0: Floats, t: Floats
) -> dict[str, Floats]:
    """The closed form of a run, coordinate by coordinate, for those it gives."""
    values: dict[str, Any] = {"t:": t, **parameters}
    values |= {f"x0:{c}": float(v) for c, v in zip(system.coordinates, x0, strict=True)}
    arrays = evaluate(list(run.exact.values()), values)
    return {c: np.broadcast_to(a, t.shape) for c, a in zip(run.exact, arrays, strict=True)}


def _against_exact(system: System, run: Run, parameters: Mapping[str, float], t: Floats, x: Floats) -> Drift:
    """The largest difference, relative to the largest coordinate of the closed form at that time."""
    solution = exact_solution(system, run, parameters, x[0], t)
    columns = [system.coordinates.index(c) for c in solution]
    expected = np.column_stack(list(solution.values()))
    scale = np.max(np.abs(expected), axis=1)
    errors = np.max(np.abs(x[:, columns] - expected), axis=1) / np.where(scale > 0, scale, 1.0)
    errors = errors[np.isfinite(errors)]
    return Drift(float(np.max(errors, initial=0.0)), True, float("nan"))
