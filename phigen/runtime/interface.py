"""What the runtime knows of a generated solver, and how its failures are told."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Told the number of steps done so far, now and then.
Progress = Callable[[int], Any]


#: Names of NAME_status in C, by value, without the prefix.
STATUSES = ("OK", "NO_CONVERGENCE", "SINGULAR", "NOT_FINITE", "BAD_ARGUMENT")


def status_name(value: int) -> str:
    """The name of a status in C."""
    return STATUSES[value] if value < len(STATUSES) else f"STATUS_{value}"


@dataclass(frozen=True)
class Draws:
    """Which random numbers a trajectory takes: those of a ``seed`` and a ``member``, from those of a ``step`` on."""

    seed: int = 0
    member: int = 0
    step: int = 0


#: Where nothing else is asked for.
FIRST_DRAWS = Draws()


@dataclass(frozen=True)
class Interface:
    """The names a generated solver speaks of, all in the order of declaration."""

    name: str  # prefix of the symbols of the C code
    coordinates: tuple[str, ...]
    order: int
    parameters: Mapping[str, float]  # defaults
    positive: frozenset[str] = frozenset()  # the parameters that must be positive
    casimirs: tuple[str, ...] = ()
    time: str = ""  # its name, where the Hamiltonian depends on it
    moving: frozenset[str] = frozenset()  # of energy and Casimirs, those that time or forces change
    monitored: bool = False  # whether steps are equal in τ, not in t
    attitude: tuple[int, ...] = ()  # the shape of an attitude, if there is one
    position: bool = False  # whether there is a position too
    noise: tuple[str, ...] = ()  # the sources
    draws: int = 0  # the increments of the noise in a step
    single: bool = False  # whether the C computes in single precision
    observables: tuple[str, ...] = ()

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def element(self) -> int:
        """Numbers of an attitude and a position."""
        return math.prod(self.attitude) + 3 * self.position if self.attitude else 0


@dataclass(frozen=True)
class LatticeInterface(Interface):
    """The solver of a lattice: ``coordinates`` are those of a site, and states have the shape (coordinates, *sizes).

    ``at_sites`` are the parameters with a value at each site. ``casimir_kinds`` tells of each Casimir whether it is one
    for each of the ``sites``, or a ``sum`` or ``product`` over them. Sizes are multiples of ``periods``, at least
    ``least``. Of a `graph` parameters at ``at_bonds`` have a value at each bond.
    """

    axes: tuple[str, ...] = ()
    at_sites: tuple[str, ...] = ()
    casimir_kinds: tuple[str, ...] = ()
    periods: tuple[int, ...] = ()
    least: tuple[int, ...] = ()
    required: frozenset[str] = frozenset()  # parameters at sites and bonds whose defaults are not one number
    first_open: bool = False  # whether the first axis has open ends
    open_axes: tuple[bool, ...] = ()
    colour_period: int = 1  # the first axis: after so many planes colours of sites are as before
    graph: bool = False
    pairs: bool = False  # whether each site acts on each other
    compensated: bool = False  # whether the C saves what rounding has left out of the fields
    at_bonds: tuple[str, ...] = ()
    observed_fields: tuple[str, ...] = ()  # observables with a value at each site
    dear: bool = False  # whether steps take longer than what is kept of them, to go back, takes to be written and read

    def is_shared(self, sites: int) -> bool:
        """Whether threads share the work on so many sites, by the numbers of the runtime in C."""
        return sites > (512 if self.pairs else 4096)


@dataclass
class Clock:
    """The time after so many steps: counted from where the size of the step was set, so no error adds up."""

    t: float = 0.0
    h: float = 0.0
    counted: int = 0

    def after(self, steps: int) -> float:
        """The time then."""
        return self.t + (steps - self.counted) * self.h

    def set_step(self, h: float, steps: int) -> None:
        """Steps have the size h from now on."""
        if h != self.h:
            self.t, self.h, self.counted = self.after(steps), h, steps


class BackendError(Exception):
    """A step failed inside a back end; `phigen.runtime.solver` turns it into the user's `StepError`.

    ``states`` holds the rows so far with the last good state as its last row (an ensemble: its members as far as they
    came), ``step`` the number of good steps, −1 where the back end cannot tell, ``failures`` the status of each member.
    """

    def __init__(
        self,
        status: str,
        step: int,
        states: Floats,
        members: tuple[int, ...] = (),
        failures: Mapping[int, str] | None = None,
    ) -> None:
        super().__init__(status)
        self.status, self.step, self.states, self.members = status, step, states, members
        self.failures = failures if failures is not None else dict.fromkeys(members, status)


class MissingExtraError(Exception):
    """The generated code was built without the function that was asked for."""


def row_steps(steps: int, stride: int) -> NDArray[np.int64]:
    """Numbers of the steps that are stored: 0, stride, 2·stride, …, and the last."""
    rows = np.arange(0, steps + 1, stride, dtype=np.int64)
    return rows if rows[-1] == steps else np.append(rows, steps)
