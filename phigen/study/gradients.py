"""Verification of gradients of runs: comparison with tangent maps, and with finite differences of the runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from phigen.errors import StepError
from phigen.runtime.interface import row_steps
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.solver import Solver
from phigen.symbolic.arrays import Floats

#: Number of steps and stride of the runs. Rows are after 4, 8 and 11 steps: the reverse pass works in blocks of eight
#: steps, so that one row lies inside a block, one at its end, and one after a shorter last stride.
STEPS, STRIDE = 11, 4
#: The step of a run is halved at most this number of times while the run fails. Some runs start on a lattice with few
#: sites, or at the end of the user's run. For these runs, the user's step size may be too large.
HALVINGS = 6
#: Largest accepted difference between a gradient and the product of the transposed tangent maps, relative to the terms
#: of the product. Gradient and product are exact up to rounding.
TRANSPOSED = 1e-12
#: DIFFERENCES: largest accepted deviation of a gradient from finite differences of order 6; errors of the finite
#: differences contribute to the deviation. _DISTANCES: the two displacements in the finite differences, in units of the
#: displaced quantity.
DIFFERENCES = 1e-7
_DISTANCES = (2e-3, 2e-3 / 256)
_WEIGHTS = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60), (-1, -3 / 4), (-2, 3 / 20), (-3, -1 / 60))
_FORWARD_WEIGHTS = ((1, 6.0), (2, -15 / 2), (3, 20 / 3), (4, -15 / 4), (5, 6 / 5), (6, -1 / 6))
#: The error of a derivative is relative to the larger of two numbers: the derivative, and this fraction of the function
#: value. Finite differences cannot resolve smaller derivatives.
_LEAST = 1e-3
#: _DIRECTIONS: number of random directions in which the initial state is displaced. _MOST_COLUMNS: for states with at
#: most this number of coordinates, there is one tangent vector along each coordinate; for longer states, the tangent
#: vectors are random.
_DIRECTIONS, _MOST_COLUMNS = 3, 64

#: Result of a check: its name, the measured value, the limit, and the cause to report if the value exceeds the limit.
Measured = tuple[str, float, float, str]


@dataclass(frozen=True)
class GradedRun:
    """Short run of one target's solver from the state ``x`` (numbers,), with derivatives.

    ``rows(x, parameters)`` returns the states (rows, numbers). ``pullback(bars)`` returns the cotangents of x and of
    the parameters, by name, for the cotangents ``bars`` of the rows. ``carried(vectors)`` propagates tangent vectors
    (count, numbers) to each row after the first. ``units`` are typical magnitudes of the numbers of a state.
    """

    x: Floats
    units: Floats
    parameters: Mapping[str, Any]
    rows: Callable[[Floats, Mapping[str, Any]], Floats]
    pullback: Callable[[Floats], tuple[Floats, Mapping[str, Any]]]
    carried: Callable[[Floats], Floats]
    bars: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Draw random cotangents ``bars`` of all rows. The seed is fixed, so all targets get equal cotangents."""
        random_bars = np.random.default_rng(1).normal(size=(len(row_steps(STEPS, STRIDE)), len(self.x)))
        object.__setattr__(self, "bars", random_bars / self.units)


def possible_step(run: Callable[[float], object], h: float) -> float:
    """Return the largest of the step sizes h, h/2, h/4, … with which ``run`` succeeds; h if it fails with all of
    them."""
    for halving in range(HALVINGS + 1):
        try:
            run(h / 2.0**halving)
        except StepError:
            continue
        return h / 2.0**halving
    return h


def of_solver(
    solver: Solver, x: Floats, units: Floats, h: float, parameters: Mapping[str, float], t0: float
) -> GradedRun:
    """Return the run of a solver without lattice from ``x`` (DIM,) at the time ``t0``.

    The run has `STEPS` steps. The step size is h, or smaller if the run fails with h.
    """
    begin = t0 if solver.interface.time else None
    h = possible_step(lambda size: solver.integrate(x, size, STEPS, STRIDE, t0=begin, parameters=parameters), h)

    def carried(vectors: Floats) -> Floats:
        products, product = [], vectors.T
        for step, (_, tangent) in enumerate(solver.tangents(x, h, STEPS, t0=begin, parameters=parameters), 1):
            product = tangent @ product
            if step % STRIDE == 0 or step == STEPS:
                products.append(product.T)
        return np.array(products)

    def pullback(bars: Floats) -> tuple[Floats, Mapping[str, Any]]:
        gradients = solver.pullback(x, h, STEPS, bars, STRIDE, t0=begin, parameters=parameters)
        return gradients.x0_bar, gradients.parameters_bar

    def rows(start: Floats, values: Mapping[str, Any]) -> Floats:
        return solver.integrate(start, h, STEPS, STRIDE, t0=begin, parameters=values).x

    return GradedRun(x, units, parameters, rows, pullback, carried)


def of_lattice(
    solver: LatticeSolver, x: Floats, units: Floats, h: float, parameters: Mapping[str, Any], t0: float | None
) -> GradedRun:
    """Return the run of a lattice from ``x`` (coordinates, *sizes).

    The run has `STEPS` steps. The step size is h, or smaller if the run fails with h. ``units`` are typical magnitudes
    of the numbers of ``x``, as a one-dimensional array.
    """
    arguments: dict[str, Any] = {"t0": t0}
    h = possible_step(lambda size: solver.integrate(x, size, STEPS, STRIDE, parameters=parameters, **arguments), h)

    def carried(vectors: Floats) -> Floats:
        shaped = vectors.reshape(len(vectors), *x.shape)
        propagated = solver.tangents(x, h, STEPS, shaped, STRIDE, parameters=parameters, **arguments)
        return np.array([vectors.reshape(len(vectors), -1) for _, vectors in propagated])

    def pullback(bars: Floats) -> tuple[Floats, Mapping[str, Any]]:
        shaped = bars.reshape(-1, *x.shape)
        gradients = solver.pullback(x, h, STEPS, shaped, STRIDE, parameters=parameters, **arguments)
        return gradients.x0_bar.reshape(-1), gradients.parameters_bar

    def rows(start: Floats, values: Mapping[str, Any]) -> Floats:
        trajectory = solver.integrate(start.reshape(x.shape), h, STEPS, STRIDE, parameters=values, **arguments)
        return np.asarray(trajectory.x).reshape(len(trajectory.x), -1)

    return GradedRun(x.reshape(-1), units, parameters, rows, pullback, carried)


def measured(
    fixed_level_runs: Sequence[GradedRun], free_level_runs: Sequence[GradedRun], place: str = ""
) -> Iterator[Measured]:
    """Yield the results of two checks of gradients: against tangent maps, and against finite differences.

    In systems with a monitor, the equations contain the energy level e = −H(x₀). The first check needs runs in which e
    is fixed (``fixed_level_runs``), since tangent maps hold e fixed. The second check needs ``free_level_runs``, whose
    gradients include the dependence of e on initial state and parameters. ``place`` is added to the names of the
    checks.
    """
    apart, failure = _largest(fixed_level_runs, transposition_error)
    reason = failure or f"the gradient differs from the transpose of the tangent maps by {apart:.1e}"
    yield f"gradient against tangent maps{place}", apart, TRANSPOSED, reason
    slip, failure = _largest(free_level_runs, difference_error)
    reason = failure or f"the gradient differs from finite differences by {slip:.1e}"
    yield f"gradient against differences{place}", slip, DIFFERENCES, reason


def _largest(runs: Sequence[GradedRun], error: Callable[[GradedRun], float]) -> tuple[float, str]:
    """Return the largest value of ``error`` for the runs; infinity if a run fails or a value is not finite.

    The second result is the reason why a run fails, "" if none fails.
    """
    largest = 0.0
    for run in runs:
        try:
            value = error(run)
        except StepError as failure:
            return math.inf, f"the run of {STEPS} steps fails, with smaller steps too: {failure}"
        largest = max(largest, value if math.isfinite(value) else math.inf)
    return largest, ""


def transposition_error(run: GradedRun) -> float:
    """Return the largest difference between ⟨w, DΦ v⟩ and ⟨DΦᵀ w, v⟩ for several tangent vectors v.

    Φ maps the initial state to the rows of the run, and w are the cotangents of the rows. Tangent maps give DΦ v, and
    the gradient of the run is DΦᵀ w. The difference is relative to the sum of the absolute values of the terms of ⟨w,
    DΦ v⟩. The v are all unit vectors or, for long states, random vectors.
    """
    count = len(run.x)
    vectors = run.units * (np.eye(count) if count <= _MOST_COLUMNS else _directions(count, _DIRECTIONS))
    tangent_image = run.carried(vectors)
    terms = run.bars[1:, None, :] * tangent_image
    forward = terms.sum(axis=(0, 2)) + vectors @ run.bars[0]
    size = np.abs(terms).sum(axis=(0, 2)) + np.abs(vectors) @ np.abs(run.bars[0])
    size = np.maximum(size, _LEAST * np.max(size))
    backward = vectors @ run.pullback(run.bars)[0]
    return float(np.max(np.abs(forward - backward) / size))


def difference_error(run: GradedRun) -> float:
    """Return the largest difference between derivatives from the gradient and finite differences of the run.

    The derivatives are those along random directions of the initial state, and with respect to each parameter. The
    difference is relative to the derivative or, if that is small, to a fraction of the function value.
    """
    x_bar, parameters_bar = run.pullback(run.bars)
    least = _LEAST * float(np.sum(np.abs(run.bars * run.rows(run.x, run.parameters))))
    worst = 0.0
    for exact, difference in _derivatives(run, x_bar, parameters_bar):
        apart = [abs(exact - d) / (max(abs(exact), abs(d), least) or 1.0) for d in _differences(run, difference)]
        worst = max(worst, min(apart, default=math.inf))
    return worst


#: Function of a distance that returns the initial state and the parameters, displaced by this distance.
_Moved = Callable[[float], tuple[Floats, Mapping[str, Any]]]


def _derivatives(run: GradedRun, x_bar: Floats, parameters_bar: Mapping[str, Any]) -> Iterator[tuple[float, _Moved]]:
    """Yield directional derivatives that are computed from the gradient, each with a function for its direction.

    The argument of the function is a distance. The function returns initial state and parameters, displaced by this
    distance along the direction.
    """
    for v in _directions(len(run.x), _DIRECTIONS) * run.units:
        yield float(x_bar @ v), lambda e, v=v: (run.x + e * v, run.parameters)  # type: ignore[misc]
    for name, bar in parameters_bar.items():
        value = np.asarray(run.parameters[name], dtype=np.float64)
        largest = float(np.max(np.abs(value), initial=0.0)) or 1.0
        # Entries of an array may differ by powers of ten, and may have to stay positive. So each entry is displaced in
        # proportion to its size.
        units = np.where(value != 0, np.abs(value), largest)
        v = units * (_directions(value.size, 1).reshape(value.shape) if value.ndim else np.ones(()))
        v = np.where(value != 0, v, np.abs(v))  # 0 is increased only, since a parameter may have to be nonnegative
        yield (
            float(np.sum(bar * v)),
            lambda e, name=name, value=value, v=v: (run.x, {**run.parameters, name: _as_number(value + e * v)}),  # type: ignore[misc]
        )


def _differences(run: GradedRun, displaced: _Moved) -> Iterator[float]:
    """Yield the derivative along a displacement by finite differences, once for each distance in `_DISTANCES`.

    Differences are central. If a run fails, they are one-sided. If a run fails again, the distance is skipped.
    """
    middle = run.rows(run.x, run.parameters)
    for apart in _DISTANCES:
        for weights in (_WEIGHTS, _FORWARD_WEIGHTS):
            try:
                changes = [(w, run.rows(*displaced(k * apart)) - middle) for k, w in weights]
            except (StepError, ValueError):  # the run meets a singularity, or a parameter violates its bound
                continue
            yield float(sum(w * np.sum(run.bars * change) for w, change in changes)) / apart
            break


def members_error(
    solver: Solver, states: Floats, units: Floats, h: float, parameters: Mapping[str, float], t0: float
) -> float:
    """Return the largest difference between gradients of the members of an ensemble and gradients of single runs.

    ``states`` (members, DIM) are the initial states. The ensemble is run as one batch. The difference is relative to
    the largest entry of the gradients.
    """
    arguments: dict[str, Any] = {"t0": t0 if solver.interface.time else None, "parameters": parameters}
    h = min((possible_step(partial(solver.integrate, x, steps=STEPS, **arguments), h) for x in states), key=abs)
    bars = _directions(states.shape[1], len(states)) / units
    try:
        together = solver.pullback(states, h, STEPS, bars, **arguments).x0_bar * units
        alone = [
            solver.pullback(x, h, STEPS, bar, **arguments).x0_bar * units for x, bar in zip(states, bars, strict=True)
        ]
    except StepError:
        return math.inf
    return float(np.max(np.abs(together - alone)) / (np.max(np.abs(together)) or 1.0))


def _directions(size: int, count: int) -> Floats:
    """Return random vectors (count, size). Every call returns the same vectors."""
    return np.random.default_rng(2).normal(size=(count, size))


def _as_number(value: Floats) -> Any:
    """Return a 0-dimensional array as a number, other arrays unchanged."""
    return value if value.ndim else float(value)
