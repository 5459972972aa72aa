"""Lyapunov exponents of a trajectory, through the exact tangent map of each step.

A frame of tangent vectors is carried along by the derivatives of the steps and made orthonormal again after each, by
QR: the logarithms of the diagonal of R add up to the growth of lengths, areas, …: G. Benettin et al., Meccanica 15
(1980); K. Geist, U. Parlitz, W. Lauterborn, Prog. Theor. Phys. 83 (1990). Exponents are those of the step as a map,
per unit of time.
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

#: The numbers of steps at which the exponents are noted grow by this factor.
_SPACING = 2 ** (1 / 8)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The exponents of a trajectory after the time ``t``, the largest first, and how they converged.

    ``history`` (rows, DIM) holds the exponents at the times ``times`` (rows,), which grow geometrically. The ``clock``
    is what steps are equal in: with a monitor all is in τ.
    """

    exponents: Floats
    times: Floats
    history: Floats
    clock: str = "t"

    @property
    def largest(self) -> float:
        """The largest exponent."""
        return float(self.exponents[0])

    @property
    def t(self) -> float:
        """The time over which lengths were followed."""
        return float(self.times[-1])

    @property
    def total(self) -> float:
        """The sum of all exponents: the growth of volume, 0 where π is constant or the coordinates unimodular."""
        return float(np.sum(self.exponents))

    @property
    def pairing(self) -> float:
        """The largest |λ_i + λ_{n+1−i}|: 0 for symplectic maps, and on leaves if the Casimirs add zeros."""
        return float(np.max(np.abs(self.exponents + self.exponents[::-1])))

    @property
    def uncertainty(self) -> float:
        """The largest change of an exponent in the second half of the time; exponents converge like 1/t at best."""
        late = self.history[self.times >= self.t / 2]
        return float(np.max(np.ptp(late, axis=0)))


class FrameGrowth:
    """The growth of a frame of tangent vectors, step by step; ``state`` has all of it, as arrays.

    It begins as all unit vectors, or as the columns of ``frame``.
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
        """The vectors, as orthonormal columns."""
        frame: Floats = self.state["frame"]
        return frame

    def see(self, tangent: Floats) -> None:
        """Carry the frame through one step of that derivative."""
        self.take(tangent @ self.frame)

    def take(self, carried: Floats, steps: int = 1) -> None:
        """The columns of the frame after some steps."""
        state = self.state
        state["frame"], r = np.linalg.qr(carried)
        state["logs"] = state["logs"] + np.log(np.abs(np.diagonal(r)))
        state["steps"] = state["steps"] + steps
        if state["steps"] >= _SPACING ** len(state["times"]):
            state["times"], state["history"] = self._noted()

    def spectrum(self) -> Spectrum:
        """The exponents so far; raises `ValueError` if no step was made."""
        if not self.state["steps"]:
            raise ValueError("there are no exponents without a step")
        times, history = self._noted()
        order = np.argsort(-history[-1], kind="stable")
        return Spectrum(history[-1][order], times, history[:, order])

    def _noted(self) -> tuple[Floats, Floats]:
        """Times and history with the exponents of now at their end."""
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
    """The Lyapunov exponents along ``steps`` steps of size ``h`` from ``x0`` (DIM,).

    ``solver`` must be compiled with ``tangent=True``, else `TypeError`. Raises `StepError`, and `ValueError` for wrong
    arguments. ``draws`` are those of noise: seed, member, step0.
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
    every: int = 10,
    t0: float | None = None,
    progress: Progress | None = None,
    **draws: int | None,
) -> Spectrum:
    """The ``count`` largest Lyapunov exponents of a lattice along a run from ``x0`` (coordinates, *sizes).

    The tangent vectors begin at random, and are made orthonormal ``every`` so many steps. ``solver`` must be compiled
    with ``tangent=True``, else `TypeError`. Raises `StepError`, and `ValueError` for wrong arguments. ``draws`` are
    those of noise: seed, step0.
    """
    x = np.asarray(x0, dtype=float)
    if not 1 <= count <= x.size:
        raise ValueError(f"a lattice of these sizes has 1 to {x.size} exponents, not {count}")
    expect_room(f"the arrays of {count} tangent vectors", 3 * 8 * count * x.size)  # drawn, in qr, and orthonormal
    frame = np.linalg.qr(np.random.default_rng(0).normal(size=(x.size, count)))[0]
    growth = FrameGrowth(x.size, h, frame)
    options: Any = {"t0": t0, "parameters": parameters, **draws}
    carry = solver.tangents(x, h, steps, frame.T.reshape(count, *x.shape), every, **options)
    following, done = None, 0
    while done < steps:
        _, carried = carry.send(following)
        advanced = min(every, steps - done)
        growth.take(carried.reshape(count, -1).T, advanced)
        following, done = growth.frame.T.reshape(carried.shape), done + advanced
        if progress:
            progress(done)
    return growth.spectrum()
