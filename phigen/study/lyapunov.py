"""Lyapunov exponents of a trajectory, through the exact tangent map of each step.

A frame of tangent vectors is propagated by the tangent maps of the steps, and made orthonormal by a QR decomposition
after each step. The diagonal entries of R measure the growth of the tangent vectors. The exponents are the sums of the
logarithms of these entries, divided by the time (G. Benettin et al., Meccanica 15 (1980); K. Geist, U. Parlitz, W.
Lauterborn, Prog. Theor. Phys. 83 (1990)). The exponents are those of the map of a step, not of the exact flow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.memory import expect_room
from phigen.runtime.interface import Progress
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.solver import Solver
from phigen.symbolic.arrays import Floats

#: The exponents are recorded when the number of steps has grown by this factor, eight times until the number doubles.
_SPACING = 2 ** (1 / 8)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Lyapunov exponents of a trajectory, in descending order, with the history of their convergence.

    ``history`` (rows, exponents) has the exponents after the times ``times`` (rows,), which grow geometrically.
    Exponents are per unit of ``clock``, the variable in which steps have equal size: the time t, or τ for systems with
    a monitor.
    """

    exponents: Floats
    times: Floats
    history: Floats
    clock: str = "t"

    @property
    def largest(self) -> float:
        """The largest Lyapunov exponent."""
        return float(self.exponents[0])

    @property
    def t(self) -> float:
        """The time over which the growth was measured."""
        return float(self.times[-1])

    @property
    def total(self) -> float:
        """Sum of all exponents, the growth rate of the volume of phase space.

        The sum is 0 if π is constant, or if the Poisson structure is unimodular (has an invariant volume).
        """
        return float(np.sum(self.exponents))

    @property
    def pairing(self) -> float:
        """Largest |λ_i + λ_{n+1−i}| of the exponents λ_1 ≥ … ≥ λ_n.

        The value is 0 for a symplectic map, and for a Poisson map too, since Casimirs contribute zeros to the
        exponents.
        """
        return float(np.max(np.abs(self.exponents + self.exponents[::-1])))

    @property
    def uncertainty(self) -> float:
        """Largest change of an exponent during the second half of the time; exponents converge like 1/t at best."""
        late_values = self.history[self.times >= self.t / 2]
        return float(np.max(np.ptp(late_values, axis=0)))


class FrameGrowth:
    """Growth of a frame of tangent vectors, step by step.

    The initial frame consists of all unit vectors, or of the orthonormal columns of ``frame``. ``state`` has all
    intermediate results, as arrays that can be saved.
    """

    def __init__(self, dimension: int, h: float, frame: Floats | None = None) -> None:
        self._h = h
        begin = np.eye(dimension) if frame is None else frame
        self.state: dict[str, Any] = {
            "frame": begin,
            "logs": np.zeros(begin.shape[1]),
            "steps": np.zeros((), dtype=np.int64),
            "times": np.empty(0),
            "history": np.empty((0, begin.shape[1])),
        }

    @property
    def frame(self) -> Floats:
        """The tangent vectors after the last step, as orthonormal columns."""
        frame: Floats = self.state["frame"]
        return frame

    def see(self, tangent: Floats) -> None:
        """Propagate the tangent vectors through one step. The matrix ``tangent`` is the tangent map of the step."""
        self.take(tangent @ self.frame)

    def take(self, propagated: Floats, steps: int = 1) -> None:
        """Receive the tangent vectors after ``steps`` further steps. Record their growth, and make them
        orthonormal.

        ``propagated`` has the tangent vectors as columns.
        """
        state = self.state
        state["frame"], r = np.linalg.qr(propagated)
        state["logs"] = state["logs"] + np.log(np.abs(np.diagonal(r)))
        state["steps"] = state["steps"] + steps
        if state["steps"] >= _SPACING ** len(state["times"]):
            state["times"], state["history"] = self._noted()

    def spectrum(self) -> Spectrum:
        """Return the exponents so far. Raises `ValueError` if no step was made."""
        if not self.state["steps"]:
            raise ValueError("Lyapunov exponents need at least one step")
        times, history = self._noted()
        order = np.argsort(-history[-1], kind="stable")
        return Spectrum(history[-1][order], times, history[:, order])

    def _noted(self) -> tuple[Floats, Floats]:
        """Return the times and the history of the exponents, with the current time and exponents appended."""
        t, times, history = abs(float(self.state["steps"]) * self._h), self.state["times"], self.state["history"]
        if len(times) and times[-1] == t:
            return times, history
        return np.append(times, t), np.vstack([history, self.state["logs"] / t])


def spectrum(
    solver: Solver,
    x0: ArrayLike,
    h: float,
    steps: int,
    parameters: Mapping[str, float] | None = None,
    t0: float | None = None,
    **draws: Any,
) -> Spectrum:
    """Return the Lyapunov exponents along ``steps`` steps of size ``h`` from ``x0`` (DIM,).

    Raises `TypeError` if ``solver`` was not compiled with ``tangent=True``, `StepError` if a step fails, and
    `ValueError` for wrong arguments. ``draws`` are the arguments for noise: seed, member, step0.
    """
    growth = FrameGrowth(len(solver.coordinates), h)
    for _, tangent in solver.tangents(x0, h, steps, t0=t0, parameters=parameters, **draws):
        growth.see(tangent)
    return growth.spectrum()


def lattice_spectrum(
    solver: LatticeSolver,
    x0: ArrayLike,
    h: float,
    steps: int,
    count: int = 1,
    parameters: Mapping[str, Any] | None = None,
    interval: int = 10,
    t0: float | None = None,
    progress: Progress | None = None,
    **draws: int | None,
) -> Spectrum:
    """Return the ``count`` largest Lyapunov exponents of a lattice along a run from ``x0`` (coordinates, *sizes).

    The initial tangent vectors are random; they are made orthonormal after every ``interval`` steps. Raises `TypeError`
    if ``solver`` was not compiled with ``tangent=True``, `StepError` if a step fails, and `ValueError` for wrong
    arguments. ``draws`` are the arguments for noise: seed, step0.
    """
    x = np.asarray(x0, dtype=float)
    if not 1 <= count <= x.size:
        raise ValueError(f"a lattice of these sizes has 1 to {x.size} exponents, not {count}")
    # Three arrays of 8-byte numbers exist at once: the random vectors, the copy that qr makes, and the result of qr.
    expect_room(f"the arrays of {count} tangent vectors", 3 * 8 * count * x.size)
    frame = np.linalg.qr(np.random.default_rng(0).normal(size=(x.size, count)))[0]
    growth = FrameGrowth(x.size, h, frame)
    options: Any = {"t0": t0, "parameters": parameters, **draws}
    carry = solver.tangents(x, h, steps, frame.T.reshape(count, *x.shape), interval, **options)
    following, steps_done = None, 0
    while steps_done < steps:
        _, propagated = carry.send(following)
        advanced = min(interval, steps - steps_done)
        growth.take(propagated.reshape(count, -1).T, advanced)
        following, steps_done = growth.frame.T.reshape(propagated.shape), steps_done + advanced
        if progress:
            progress(steps_done)
    return growth.spectrum()
