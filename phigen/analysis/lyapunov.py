"""Lyapunov exponents of a trajectory, through the exact tangent map of each step.

A frame of tangent vectors is carried along by the derivatives of the steps and made orthonormal again after each, by
QR: the logarithms of the diagonal of R add up to the growth of lengths, areas, …: G. Benettin et al., Meccanica 15
(1980); K. Geist, U. Parlitz, W. Lauterborn, Prog. Theor. Phys. 83 (1990). Exponents are those of the step as a map,
per unit of time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from phigen.analysis.arrays import Floats
from phigen.runtime.solver import Solver

#: The numbers of steps at which the exponents are noted grow by this factor.
_SPACING = 2 ** (1 / 8)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The exponents of a trajectory after the time ``t``, the largest first, and how they converged.

    ``history`` (rows, DIM) holds the exponents at the times ``times`` (rows,), which grow geometrically.
    """

    exponents: Floats
    times: Floats
    history: Floats

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
        """How much an exponent changed in the second half of the time, at most; they converge like 1/t at best."""
        late = self.history[self.times >= self.t / 2]
        return float(np.max(np.ptp(late, axis=0)))


@dataclass
class FrameGrowth:
    """The growth of a frame of tangent vectors, step by step: ``frame`` (DIM, DIM), and ``logs``, its logarithms."""

    h: float
    frame: Floats
    logs: Floats
    steps: int = 0
    times: list[float] = field(default_factory=list)
    history: list[Floats] = field(default_factory=list)

    @classmethod
    def of(cls, dimension: int, h: float) -> FrameGrowth:
        """The frame at the start."""
        return cls(h, np.eye(dimension), np.zeros(dimension))

    def see(self, tangent: Floats) -> None:
        """Carry the frame through one step of that derivative."""
        self.frame, r = np.linalg.qr(tangent @ self.frame)
        self.logs += np.log(np.abs(np.diagonal(r)))
        self.steps += 1
        if self.steps >= _SPACING ** len(self.times):
            self._note()

    def spectrum(self) -> Spectrum:
        """The exponents so far; raises `ValueError` if no step was made."""
        if not self.steps:
            raise ValueError("there are no exponents without a step")
        if self.times[-1] != abs(self.steps * self.h):
            self._note()
        history = np.array(self.history)
        order = np.argsort(-history[-1], kind="stable")
        return Spectrum(history[-1][order], np.array(self.times), history[:, order])

    def _note(self) -> None:
        t = abs(self.steps * self.h)
        self.times.append(t)
        self.history.append(self.logs / t)


def spectrum(
    solver: Solver, x0: ArrayLike, h: float, steps: int, parameters: Mapping[str, float] | None = None
) -> Spectrum:
    """The Lyapunov exponents along ``steps`` steps of size ``h`` from ``x0`` (DIM,).

    ``solver`` must be compiled with ``tangent=True``, else `TypeError`. Raises `StepError`, and `ValueError` for wrong
    arguments.
    """
    growth = FrameGrowth.of(len(solver.coordinates), h)
    for _, tangent in solver.tangents(x0, h, steps, parameters=parameters):
        growth.see(tangent)
    return growth.spectrum()
