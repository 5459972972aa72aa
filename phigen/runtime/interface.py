"""What the runtime knows of a generated solver, and what it asks of a back end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from phigen.runtime.session import Session

Floats = NDArray[np.float64]

#: Told the number of steps done so far, now and then.
Progress = Callable[[int], Any]


@dataclass(frozen=True)
class Interface:
    """The names a generated solver speaks of, all in the order of declaration."""

    name: str  # prefix of the symbols of the C code
    coordinates: tuple[str, ...]
    order: int
    parameters: Mapping[str, float]  # defaults
    positive: frozenset[str] = frozenset()  # the parameters that must be positive
    casimirs: tuple[str, ...] = ()

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)


class BackendError(Exception):
    """A step failed inside a back end; `phigen.runtime.solver` turns it into the user's `StepError`.

    ``states`` holds the rows so far with the last good state as its last row (an ensemble: its members as far as they
    came), ``step`` the number of good steps, −1 where the back end cannot tell.
    """

    def __init__(self, status: str, step: int, states: Floats, members: tuple[int, ...] = ()) -> None:
        super().__init__(status)
        self.status, self.step, self.states, self.members = status, step, states, members


class MissingExtraError(Exception):
    """The generated code was built without the function that was asked for."""


class Backend(Protocol):
    """A loaded solver.

    States are float64 arrays whose last axis is the coordinates. ``parameters`` holds every parameter, in the order
    of declaration. Arguments were checked by the caller. A failing step raises `BackendError`.
    """

    target: str

    @property
    def identity(self) -> str:
        """A hash of all that decides the results, and what bytes of a session mean."""
        ...

    def start(self, x0: Floats, parameters: Mapping[str, float]) -> Session:
        """A session at x0 (DIM,)."""
        ...

    def restored(self, saved: bytes, parameters: Mapping[str, float]) -> Session:
        """The session whose `Session.saved` bytes these are, made by a back end of the same `identity`."""
        ...

    def with_gauge(self, gauge: Floats) -> Backend:
        """A back end whose trajectories all have the given gauge, one value for each Casimir of the gauge."""
        ...

    def ensemble(self, x0: Floats, h: float, steps: int, parameters: Mapping[str, float]) -> Floats:
        """Final states (members, DIM) of initial states (members, DIM)."""
        ...

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """H of the states (rows, DIM), shape (rows,)."""
        ...

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """Casimirs of the states (rows, DIM), shape (rows, number of Casimirs)."""
        ...

    def vector_field(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """π∇H at the states (rows, DIM), the same shape."""
        ...


def row_steps(steps: int, stride: int) -> NDArray[np.int64]:
    """Numbers of the steps that are stored: 0, stride, 2·stride, …, and the last."""
    rows = np.arange(0, steps + 1, stride, dtype=np.int64)
    return rows if rows[-1] == steps else np.append(rows, steps)
